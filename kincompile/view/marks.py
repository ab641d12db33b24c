"""The marks that a drawing consists of: plain data, given to matplotlib and to the page alike.

Lengths are those of the model. Each renderer chooses line widths and colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

Point: TypeAlias = tuple[float, float]
"""Components (xi, eta) in a frame."""


@dataclass(frozen=True, slots=True, order=True)
class PlaneFrame:
    """The axes of a body, or of the ground.

    Attributes
    ----------
    index
        Index of the body in the mechanism; -1 for the ground.
    columns
        Columns of q with its x, y and phi; none for the ground.
    """

    index: int
    columns: tuple[int, ...]


GROUND_FRAME = PlaneFrame(-1, ())
"""The frame of the ground."""


def in_ground(q: Array, frame: PlaneFrame, points: Array | Point) -> Array:
    """Return where points of a frame are, in the axes of the ground.

    Parameters
    ----------
    q : ndarray, shape (..., n)
        Positions.
    frame
        The frame of a body, or of the ground.
    points : array_like, shape (..., 2)
        Components in the frame; the leading axes broadcast against those of `q`.

    Returns
    -------
    ndarray, shape (..., 2)
    """
    xi, eta = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
    if frame == GROUND_FRAME:
        x, y = np.zeros((2, *q.shape[:-1]))
        c, s = np.ones_like(x), np.zeros_like(x)
    else:
        x, y, phi = (q[..., column] for column in frame.columns)
        c, s = np.cos(phi), np.sin(phi)
    return np.stack((x + c * xi - s * eta, y + s * xi + c * eta), axis=-1)


@dataclass(frozen=True, slots=True)
class FramePoint:
    """A point fixed in a frame."""

    frame: PlaneFrame
    point: Point

    def at(self, q: Array) -> Array:
        """Return where the point is, shape (N, 2), at positions q of shape (N, n)."""
        return in_ground(q, self.frame, self.point)


@dataclass(frozen=True, slots=True)
class Hull:
    """A body as the convex hull of its joint points; two points are a bar, one is a dot."""

    frame: PlaneFrame
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Polygon:
    """A body as the closed polygon that its author gave."""

    frame: PlaneFrame
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Pin:
    """Two points that a joint holds together; hatched where the first is on the ground."""

    joint: str
    first: FramePoint
    second: FramePoint


@dataclass(frozen=True, slots=True)
class Rail:
    """A straight piece of a frame on which something slides or rolls.

    Attributes
    ----------
    joint
        The constraint.
    frame, base, axis
        A point of its line and the direction, of length one, in a frame.
    style
        "guide" (a track of the ground, in which a block slides), "slot" (of a body), "rack" (the
        pitch line of a rack) or "face" (of a follower).
    follower
        What slides or rolls on it.
    at_least
        Distances along the axis that it covers in any case.
    reach
        Distances along the axis between which it is drawn.
    """

    joint: str
    frame: PlaneFrame
    base: Point
    axis: Point
    style: str
    follower: FramePoint
    at_least: tuple[float, ...]
    reach: tuple[float, float]

    @property
    def start(self) -> Point:
        """Its first end."""
        return self._at(self.reach[0])

    @property
    def end(self) -> Point:
        """Its other end."""
        return self._at(self.reach[1])

    def _at(self, distance: float) -> Point:
        return self.base[0] + distance * self.axis[0], self.base[1] + distance * self.axis[1]


@dataclass(frozen=True, slots=True)
class Slider:
    """A slider: a block at a point, along an axis of unit length in the frame of its guide."""

    joint: str
    place: FramePoint
    axis: Point
    guide: PlaneFrame


@dataclass(frozen=True, slots=True)
class Span:
    """A line between points of two frames.

    `style` is "rod" (a constant length), "cylinder" (a driven length, whose barrel has a length of
    its own), "slide" (one body telescopes in the other) or "dimension" (a measure without a body
    of its own).
    """

    joint: str
    first: FramePoint
    second: FramePoint
    style: str
    barrel: float = 0.0


@dataclass(frozen=True, slots=True)
class Wheel:
    """The pitch circle of a gear, with a tick in the direction `theta` [rad] that shows turning."""

    joint: str
    place: FramePoint
    radius: float
    theta: float
    is_internal: bool


@dataclass(frozen=True, slots=True)
class Contour:
    """A closed curve in a frame; `style` is "cam" (its edge is touched) or "slot" (a pin in it)."""

    joint: str
    frame: PlaneFrame
    points: tuple[Point, ...]
    style: str


@dataclass(frozen=True, slots=True)
class Drive:
    """A driver at a point: along `axis`, a direction of the ground, or turning where it is None."""

    joint: str
    place: FramePoint
    axis: Point | None


@dataclass(frozen=True, slots=True)
class Dot:
    """A named point of a body: it has its name beside it, and leaves a line."""

    name: str
    place: FramePoint


Mark: TypeAlias = Hull | Polygon | Pin | Rail | Slider | Span | Wheel | Contour | Drive | Dot


def shape_of(mark: Mark) -> str:
    """Return what a mark looks like: a name in `SHAPES`."""
    match mark:
        case Pin():
            return "stand" if mark.first.frame == GROUND_FRAME else "pin"
        case Rail():
            return "track" if mark.style == "guide" else mark.style
        case Span():
            return mark.style
        case Wheel():
            return "ring" if mark.is_internal else "wheel"
        case Contour():
            return "curved slot" if mark.style == "slot" else mark.style
        case Drive():
            return "turn" if mark.axis is None else "push"
    return type(mark).__name__.lower()


def moves_with(mark: Mark) -> set[PlaneFrame]:
    """Return the frames in which a mark is fixed."""
    return {place.frame for place, _ in reach(mark)}


def reach(mark: Mark) -> list[tuple[FramePoint, float]]:
    """Return the points of a mark, each with the distance that the mark reaches beyond it."""
    match mark:
        case Wheel():
            return [(mark.place, mark.radius)]
        case Hull() | Polygon() | Contour():
            points = mark.points
        case Rail():
            points = (mark.start, mark.end)
        case Pin() | Span():
            return [(mark.first, 0.0), (mark.second, 0.0)]
        case Slider() | Drive() | Dot():
            return [(mark.place, 0.0)]
    return [(FramePoint(mark.frame, point), 0.0) for point in points]
