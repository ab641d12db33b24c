"""The marks of a drawing as lines and areas that move with q, for matplotlib and for figures.

A polyline is a chain of points that moves with a frame, is carried by a point without turning, or
is stretched between two points. Colours and line widths are in `LOOKS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.view.marks import (
    GROUND_FRAME,
    Contour,
    Drive,
    FramePoint,
    Hull,
    Mark,
    Pin,
    PlaneFrame,
    Polygon,
    Rail,
    Slider,
    Span,
    Wheel,
    in_ground,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array
GROUND_COLOUR, DRIVER_COLOUR = "#595959", "#1a1a1a"
"""Colours of the ground and of drivers."""

FILL = 0.22
"""Opacity of the areas of bodies."""


@dataclass(frozen=True, slots=True)
class Look:
    """What a line or an area is drawn like.

    Attributes
    ----------
    width
        Of the line [points].
    colour, face
        Of the line, and of the area; that of the body without, areas pale.
    opacity
        Of a line.
    dash
        "--", ":" or "" for an unbroken line.
    """

    width: float
    colour: str = ""
    face: str = ""
    opacity: float = 1.0
    dash: str = ""


LOOKS: Mapping[str, Look] = {
    "bar": Look(5, opacity=0.75),
    "body": Look(2),
    "wheel": Look(1.5),
    "rim": Look(1.5),
    "tick": Look(1.5),
    "rack": Look(1.5),
    "groove": Look(1.2),
    "block": Look(1.5),
    "rod": Look(3, "#4d4d4d"),
    "piston": Look(2.5, "#4d4d4d"),
    "barrel": Look(1.5, "#4d4d4d", "#cccccc"),
    "slide": Look(3, opacity=0.5),
    "dimension": Look(1, "#666666", dash="--"),
    "pin": Look(1.2, "#1a1a1a", "#ffffff"),
    "stand": Look(1.2, GROUND_COLOUR, "#ebebeb"),
    "ground": Look(1),
    "arrow": Look(1.3, DRIVER_COLOUR),
    "head": Look(0, DRIVER_COLOUR, DRIVER_COLOUR),
    "gap": Look(2, "#ff0000", dash=":"),
}
"""Look of each kind of polyline."""

PIN, BLOCK_LENGTH, BLOCK_HEIGHT, HATCH, TURN = 0.45, 1.6, 0.9, 0.8, 1.9
"""Radius of a pin, half sides of a slider, length of a hatch line, radius of a turning arrow, in
sizes of the drawing."""

BARREL = 0.6
"""Part of a cylinder's length, or of a telescope's, that is the outer body."""

UPRIGHT = 1e-9
"""Horizontal component up to which the axis of a rail is upright."""

CIRCLE = np.stack([f(np.radians(np.arange(0, 360, 5))) for f in (np.cos, np.sin)], axis=-1)
"""A circle of radius one, every five degrees."""


@dataclass(frozen=True, slots=True)
class Polyline:
    """A line or an area.

    Attributes
    ----------
    look
        What it is drawn like, a key of `LOOKS`.
    frame
        The frame whose colour it has.
    points : ndarray, shape (k, 2)
        In the frame; with `start`, offsets from that point in the axes of the ground; with `end`
        too, the fraction of the way between both, and the distance to its left. NaN interrupts a
        line.
    start, end
        The points that carry it, if the frame does not.
    is_area
        Whether it is closed and filled.
    """

    look: str
    frame: PlaneFrame
    points: Array
    start: FramePoint | None = None
    end: FramePoint | None = None
    is_area: bool = False

    def at(self, q: Array) -> Array:
        """Return where its points are, shape (k, 2), at a position q of shape (n,)."""
        if self.start is None:
            return in_ground(q, self.frame, self.points)
        start = self.start.at(q)
        if self.end is None:
            return start + self.points
        way = self.end.at(q) - start
        left = _left_of(way) / (float(np.hypot(*way)) or 1.0)
        fraction, distance = self.points[:, :1], self.points[:, 1:]
        return start + fraction * way + distance * left


def polylines(drawn: Drawing) -> list[Polyline]:
    """Return the lines and areas of a drawing, from back to front."""
    return [polyline for mark in drawn.marks for polyline in of_mark(mark, drawn.size)]


def of_mark(mark: Mark, size: float) -> Iterable[Polyline]:
    """Return the lines and areas of a mark, in a drawing with marks of a size."""
    match mark:
        case Hull():
            return _link(mark, size)
        case Polygon():
            return [Polyline("body", mark.frame, _array(mark.points), is_area=True)]
        case Pin():
            return _pin(mark, size)
        case Rail():
            return _rail(mark, size)
        case Slider():
            return [_block(mark, size)]
        case Span():
            return _span(mark, size)
        case Wheel():
            return _wheel(mark, size)
        case Contour():
            return _profile(mark)
        case Drive():
            return _drive(mark, size)


def _array(points: ArrayLike) -> Array:
    return np.array(points, dtype=np.float64)


def _left_of(direction: Array) -> Array:
    """Return a vector turned by a right angle, counterclockwise."""
    return np.array((-direction[1], direction[0]))


def _link(mark: Hull, size: float) -> list[Polyline]:
    """Draw a bar between two points, an area between more, a disc at one."""
    points = _array(mark.points)
    if len(points) == 1:
        return [Polyline("body", mark.frame, points + 1.2 * size * CIRCLE, is_area=True)]
    if len(points) == 2:
        return [Polyline("bar", mark.frame, points)]
    return [Polyline("body", mark.frame, points, is_area=True)]


def _pin(mark: Pin, size: float) -> list[Polyline]:
    """Draw a small circle, on a stand where it is on the ground, and a gap where it is open."""
    found = [
        Polyline("gap", mark.second.frame, _array(((0, 0), (1, 0))), mark.first, mark.second),
        Polyline("pin", mark.second.frame, PIN * size * CIRCLE, mark.second, is_area=True),
    ]
    if mark.first.frame != GROUND_FRAME:
        return found
    stand = size * _array(((0, 0), (-1.1, -1.9), (1.1, -1.9)))
    floor = size * np.concatenate([_array(((-1.8, -1.9), (1.8, -1.9))), _hatching(-1.8, 1.8, -1.9)])
    return [
        Polyline("stand", GROUND_FRAME, stand, mark.first, is_area=True),
        Polyline("ground", GROUND_FRAME, floor, mark.first),
        *found,
    ]


def _hatching(low: float, high: float, height: float, side: float = -1.0) -> Array:
    """Return slanted lines along the x axis at a height, to one side, in sizes of the drawing."""
    gap = (np.nan, np.nan)
    feet = np.arange(low + HATCH / 2, high + 1e-9, HATCH)
    ends = [(gap, (x, height), (x - HATCH / 2, height + side * HATCH)) for x in feet]
    return _array(ends).reshape(-1, 2)


def _rail(mark: Rail, size: float) -> list[Polyline]:
    """Draw two parallel lines, hatched on the ground, the teeth of a rack, or a thick face."""
    start, end, axis = _array(mark.start), _array(mark.end), _array(mark.axis)

    def along(points: Array) -> Array:
        """Turn sizes along and to the left of the rail into points of its frame."""
        return start + size * (points @ np.stack((axis, _left_of(axis))))

    if mark.style == "face":
        return [Polyline("bar", mark.frame, np.stack((start, end)))]
    reach = float((end - start) @ axis) / size
    if mark.style == "rack":
        teeth = _hatching(0.0, reach, 0.0)
        line = np.concatenate([_array(((0, 0), (reach, 0))), teeth])
        return [Polyline("rack", mark.frame, along(line))]
    sides = [_array(((0, h), (reach, h))) for h in (BLOCK_HEIGHT, -BLOCK_HEIGHT)]
    if mark.frame != GROUND_FRAME:
        return [Polyline("groove", mark.frame, along(side)) for side in sides]
    # Hatched below, or at the left of an upright rail, whichever way its axis points.
    side = -float(np.sign(axis[0])) if abs(axis[0]) > UPRIGHT else float(np.sign(axis[1]))
    hatch = _hatching(0.0, reach, side * BLOCK_HEIGHT, side)
    return [Polyline("ground", GROUND_FRAME, along(line)) for line in (*sides, hatch)]


def _block(mark: Slider, size: float) -> Polyline:
    """Draw a rectangle along the axis."""
    axis = _array(mark.axis)
    half_sides = size * _array((BLOCK_LENGTH, BLOCK_HEIGHT))
    corners = half_sides * _array(((1, 1), (-1, 1), (-1, -1), (1, -1)))
    points = _array(mark.place.point) + corners @ np.stack((axis, _left_of(axis)))
    return Polyline("block", mark.place.frame, points, is_area=True)


def _span(mark: Span, size: float) -> list[Polyline]:
    """Draw a line; a cylinder is a barrel with a piston rod in it."""
    whole = _array(((0, 0), (1, 0)))
    frame = max(mark.first.frame, mark.second.frame)
    if mark.style != "cylinder":
        return [Polyline(mark.style, frame, whole, mark.first, mark.second)]
    half = 0.8 * size
    barrel = _array(((0, half), (BARREL, half), (BARREL, -half), (0, -half)))
    return [
        Polyline("piston", frame, whole, mark.first, mark.second),
        Polyline("barrel", frame, barrel, mark.first, mark.second, is_area=True),
    ]


def _wheel(mark: Wheel, size: float) -> list[Polyline]:
    """Draw the pitch circle with a tick, which on an internal gear is outside."""
    centre = _array(mark.place.point)
    rim = centre + mark.radius * CIRCLE
    direction = _array((np.cos(mark.theta), np.sin(mark.theta)))
    ends = (mark.radius, mark.radius + size) if mark.is_internal else (0.0, mark.radius)
    tick = np.stack([centre + end * direction for end in ends])
    frame = mark.place.frame
    return [_curve(frame, rim, is_area=not mark.is_internal), Polyline("tick", frame, tick)]


def _profile(mark: Contour) -> list[Polyline]:
    """Draw a cam as an area, a slot as the closed line in which a pin runs."""
    return [_curve(mark.frame, _array(mark.points), is_area=mark.style == "cam")]


def _curve(frame: PlaneFrame, points: Array, *, is_area: bool) -> Polyline:
    """Draw a closed curve, as an area or as a line."""
    if is_area:
        return Polyline("wheel", frame, points, is_area=True)
    return Polyline("rim", frame, np.concatenate((points, points[:1])))


def _drive(mark: Drive, size: float) -> list[Polyline]:
    """Draw an arrow, bent where the driver turns something."""
    if mark.axis is None:
        angles = np.radians(np.linspace(-30, 240, 46))
        line = TURN * size * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        heading = _left_of(line[-1]) / np.hypot(*line[-1])
    else:
        heading = _array(mark.axis)
        line = size * np.outer((0.8, 2.8), heading)
    return [
        Polyline("arrow", mark.place.frame, line, mark.place),
        Polyline(
            "head", mark.place.frame, _head(line[-1], heading, size), mark.place, is_area=True
        ),
    ]


def _head(end: Array, heading: Array, size: float) -> Array:
    """Return the triangle at the end of an arrow."""
    corners = size * _array(((0.9, 0.0), (-0.3, 0.5), (-0.3, -0.5)))
    return end + corners @ np.stack((heading, _left_of(heading)))
