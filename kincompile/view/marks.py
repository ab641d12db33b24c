"""The marks that a drawing consists of: plain data, given to matplotlib and to the page alike.

Lengths are those of the model. Each renderer chooses line widths and colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

Point: TypeAlias = tuple[float, ...]
"""Components (xi, eta) in a frame, in space (xi, eta, zeta)."""


@dataclass(frozen=True, slots=True, order=True)
class BodyFrame:
    """The axes of a body, or of the ground."""

    index: int  # index of the body in the mechanism; -1 for the ground
    # Columns of q with its x, y and phi, in space x, y, z and Euler parameters; none for the
    # ground.
    columns: tuple[int, ...]


GROUND_FRAME = BodyFrame(-1, ())
"""The frame of the ground."""


def in_ground(q: Array, frame: BodyFrame, points: Array | Point) -> Array:
    """Return where points of a frame are, in the axes of the ground.

    Parameters
    ----------
    q : ndarray, shape (..., n)
        Positions.
    points : array_like, shape (..., 2), in space (..., 3)
        Components in the frame; the leading axes broadcast against those of `q`.

    Returns
    -------
    ndarray, shape (..., 2), in space (..., 3)
    """
    local = np.asarray(points, dtype=np.float64)
    if local.shape[-1] == 3:
        return _in_space(q, frame, local)
    xi, eta = np.moveaxis(local, -1, 0)
    if frame == GROUND_FRAME:
        x, y = np.zeros((2, *q.shape[:-1]))
        c, s = np.ones_like(x), np.zeros_like(x)
    else:
        x, y, phi = (q[..., column] for column in frame.columns)
        c, s = np.cos(phi), np.sin(phi)
    return np.stack((x + c * xi - s * eta, y + s * xi + c * eta), axis=-1)


def _in_space(q: Array, frame: BodyFrame, local: Array) -> Array:
    """Return r + A s; Euler parameters of any length are those of an orientation."""
    if frame == GROUND_FRAME:
        return np.broadcast_to(local, np.broadcast_shapes((*q.shape[:-1], 3), local.shape))
    own = q[..., list(frame.columns)]
    r, e0, e = own[..., :3], own[..., 3:4], own[..., 4:]
    across = np.cross(e, local)
    square = e0**2 + np.sum(e * e, axis=-1, keepdims=True)
    return np.asarray(r + local + 2 * (e0 * across + np.cross(e, across)) / square)


@dataclass(frozen=True, slots=True)
class FramePoint:
    """A point fixed in a frame."""

    frame: BodyFrame
    point: Point

    def at(self, q: Array) -> Array:
        """Return where the point is, shape (N, 2), at positions q of shape (N, n)."""
        return in_ground(q, self.frame, self.point)


@dataclass(frozen=True, slots=True)
class Hull:
    """A body as the convex hull of its joint points; two points are a bar, one is a dot.

    `attached` are all its joint points, from which a page finds the hull for other parameters. A
    "shell" is a solid in space that its author gave, without rods along its edges.
    """

    frame: BodyFrame
    points: tuple[Point, ...]
    attached: tuple[Point, ...] = ()
    style: str = "hull"


@dataclass(frozen=True, slots=True)
class Polygon:
    """A body as the closed polygon that its author gave."""

    frame: BodyFrame
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Pin:
    """Two points that a joint holds together; hatched where the first is on the ground."""

    joint: str
    first: FramePoint
    second: FramePoint


@dataclass(frozen=True, slots=True)
class Rail:
    """A straight piece of a frame on which something slides or rolls."""

    joint: str
    # frame, base, axis: a point of its line and the direction, of length one, in a frame.
    frame: BodyFrame
    base: Point
    axis: Point
    # "guide" (a track of the ground, in which a block slides), "slot" (of a body), "rack" (the
    # pitch line of a rack) or "face" (of a follower).
    style: str
    follower: FramePoint  # what slides or rolls on it
    at_least: tuple[float, ...]  # distances along the axis that it covers in any case
    reach: tuple[float, float]  # distances along the axis between which it is drawn

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
    guide: BodyFrame


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
    """A closed curve in a frame; `style` is "cam" (its edge is touched) or "slot" (a pin in it).

    Its points have the distance `rho` from its centre, which is given at the angle zero.
    """

    joint: str
    frame: BodyFrame
    points: tuple[Point, ...]
    style: str
    centre: Point = (0.0, 0.0)
    rho: float = 0.0


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


@dataclass(frozen=True, slots=True)
class Symbol:
    """A solid that stands for a part of a joint in space, fixed in one frame."""

    joint: str
    shape: str  # a name in `SOLIDS`
    place: FramePoint
    # axis, cross: unit vectors in the frame of `place`: what it is turned about, and one at a right
    # angle.
    axis: Point
    cross: Point
    # What slides along its axis, where it is as long as the motion.
    follower: FramePoint | None = None
    reach: tuple[float, float] = (0.0, 0.0)  # distances along the axis between which it is drawn


Mark: TypeAlias = (
    Hull | Polygon | Pin | Rail | Slider | Span | Wheel | Contour | Drive | Dot | Symbol
)


def shape_of(mark: Mark) -> str:
    """Return what a mark looks like: a name in `SHAPES`."""
    match mark:
        case Pin():
            return "stand" if mark.first.frame == GROUND_FRAME else "pin"
        case Rail():
            return "track" if mark.style == "guide" else mark.style
        case Span() | Hull():
            return mark.style
        case Wheel():
            return "ring" if mark.is_internal else "wheel"
        case Contour():
            return "curved slot" if mark.style == "slot" else mark.style
        case Symbol():
            return mark.shape
        case Drive():
            return "turn" if mark.axis is None else "push"
    return type(mark).__name__.lower()


def ends_of(mark: Symbol) -> tuple[Point, Point]:
    """Return the two ends of what is drawn along the axis of a symbol, in its frame."""
    first, last = (
        tuple(x + far * u for x, u in zip(mark.place.point, mark.axis, strict=True))
        for far in mark.reach
    )
    return first, last


def moves_with(mark: Mark) -> set[BodyFrame]:
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
        case Symbol():
            return [(FramePoint(mark.place.frame, end), 0.0) for end in ends_of(mark)]
        case Slider() | Drive() | Dot():
            return [(mark.place, 0.0)]
    return [(FramePoint(mark.frame, point), 0.0) for point in points]
