"""The marks a drawing is made of: plain data, given to matplotlib and to the page alike.

A frame is the index of a body, in the order of the mechanism, or `GROUND_FRAME`. Lengths are those
of the model. What a mark looks like, its line widths and colours, is for each renderer to choose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

GROUND_FRAME = -1
"""The frame of the ground."""

Point: TypeAlias = tuple[float, float]
"""Components (xi, eta) in a frame."""


@dataclass(frozen=True, slots=True)
class Place:
    """A point fixed in a frame."""

    frame: int
    point: Point


@dataclass(frozen=True, slots=True)
class Link:
    """A body as the convex hull of its joint points; two points are a bar, one is a dot."""

    frame: int
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Outline:
    """A body as the closed polygon that its author gave."""

    frame: int
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Pin:
    """Two points that a joint holds together; hatched where the first is on the ground."""

    joint: str
    first: Place
    second: Place


@dataclass(frozen=True, slots=True)
class Rail:
    """A straight piece of a frame, from start to end along an axis of unit length.

    Something slides or rolls on it: `style` is "guide" (a track), "rack" (the pitch line of a rack)
    or "face" (of a follower).
    """

    joint: str
    frame: int
    start: Point
    end: Point
    axis: Point
    style: str


@dataclass(frozen=True, slots=True)
class Block:
    """A slider: a block at a point, along an axis of unit length in the same frame."""

    joint: str
    place: Place
    axis: Point


@dataclass(frozen=True, slots=True)
class Span:
    """A line between points of two frames.

    `style` is "rod" (a length that stays), "cylinder" (a length that is driven), "slide" (one body
    telescopes in the other) or "dimension" (a measure without a body of its own).
    """

    joint: str
    first: Place
    second: Place
    style: str


@dataclass(frozen=True, slots=True)
class Wheel:
    """The pitch circle of a gear, with a tick in the direction `theta` [rad] that shows turning."""

    joint: str
    place: Place
    radius: float
    theta: float
    is_internal: bool


@dataclass(frozen=True, slots=True)
class Profile:
    """A closed curve in a frame; `style` is "cam" (its edge is touched) or "slot" (a pin in it)."""

    joint: str
    frame: int
    points: tuple[Point, ...]
    style: str


@dataclass(frozen=True, slots=True)
class Drive:
    """A driver at a point: along `axis`, a direction of the ground, or turning where it is None."""

    joint: str
    place: Place
    axis: Point | None


Mark: TypeAlias = Link | Outline | Pin | Rail | Block | Span | Wheel | Profile | Drive


def moves_with(mark: Mark) -> set[int]:
    """Return the frames that a mark moves with."""
    return {place.frame for place, _ in reach(mark)}


def reach(mark: Mark) -> list[tuple[Place, float]]:
    """Return the points of a mark, each with how far it reaches beyond."""
    match mark:
        case Wheel():
            return [(mark.place, mark.radius)]
        case Link() | Outline() | Profile():
            points = mark.points
        case Rail():
            points = (mark.start, mark.end)
        case Pin() | Span():
            return [(mark.first, 0.0), (mark.second, 0.0)]
        case Block() | Drive():
            return [(mark.place, 0.0)]
    return [(Place(mark.frame, point), 0.0) for point in points]
