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
    """A straight piece of a frame, from start to end along an axis of unit length.

    Something slides or rolls on it: `style` is "guide" (a track), "rack" (the pitch line of a rack)
    or "face" (of a follower).
    """

    joint: str
    frame: PlaneFrame
    start: Point
    end: Point
    axis: Point
    style: str


@dataclass(frozen=True, slots=True)
class Slider:
    """A slider: a block at a point, along an axis of unit length in the same frame."""

    joint: str
    place: FramePoint
    axis: Point


@dataclass(frozen=True, slots=True)
class Span:
    """A line between points of two frames.

    `style` is "rod" (a constant length), "cylinder" (a driven length), "slide" (one body telescopes
    in the other) or "dimension" (a measure without a body of its own).
    """

    joint: str
    first: FramePoint
    second: FramePoint
    style: str


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


Mark: TypeAlias = Hull | Polygon | Pin | Rail | Slider | Span | Wheel | Contour | Drive


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
        case Slider() | Drive():
            return [(mark.place, 0.0)]
    return [(FramePoint(mark.frame, point), 0.0) for point in points]
