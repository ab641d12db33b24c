"""What marks look like, as data: the strokes of each shape, and how a stroke is drawn.

Python evaluates the tables in `polylines.py`, for matplotlib and for figures; a page is given the
same tables, and evaluates them in its script `plane.js`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import TypeAlias

    Corner: TypeAlias = "tuple[float, float, float] | None"

GROUND_COLOUR, DRIVER_COLOUR = "#595959", "#1a1a1a"
"""Colours of the ground and of drivers."""

INKS: Mapping[str, str] = {
    "ink": "#1a1a1a", "paper": "#ffffff", "quiet": GROUND_COLOUR, "tint": "#ebebeb",
    "drive": DRIVER_COLOUR, "bad": "#ff0000",
}  # fmt: skip
"""Colours on white paper; a page has its own by the same names, for light and dark."""

HUES: Mapping[str, tuple[str, ...]] = {
    "light": (
        "#2563eb", "#b45309", "#047857", "#7c3aed", "#0e7490", "#be185d", "#4d7c0f", "#475569",
    ),
    "dark": (
        "#7aa7ff", "#f0b35a", "#4fd1a5", "#b99aff", "#4cc9e0", "#f48cc0", "#a5cf5a", "#a9b6c9",
    ),
}  # fmt: skip
"""Colours of bodies and of paths, on light and on dark paper."""


def mixed(colour: str, part: float, paper: str = "#ffffff") -> str:
    """Return a colour on paper through which a part of it is seen."""
    over, under = ([int(text[k : k + 2], 16) for k in (1, 3, 5)] for text in (colour, paper))
    values = (round(part * a + (1 - part) * b) for a, b in zip(over, under, strict=True))
    return "#" + "".join(f"{value:02x}" for value in values)


@dataclass(frozen=True, slots=True)
class Look:
    """What a line or an area is drawn like."""

    width: float  # of the line [points]
    # line, face: names in `INKS` of the line's and of the area's colour; without, that of the body,
    # areas pale.
    line: str = ""
    face: str = ""
    dash: str = ""  # "--", ":" or "" for an unbroken line

    @property
    def colour(self) -> str:
        """Colour of the line; "" for that of the body."""
        return INKS.get(self.line, "")

    @property
    def area(self) -> str:
        """Colour of the area; "" for a pale one of the body's."""
        return INKS.get(self.face, "")


LOOKS: Mapping[str, Look] = {
    "body": Look(1.5),
    "edge": Look(1.3),
    "bar": Look(3.5),
    "groove": Look(1.3, face="paper"),
    "rod": Look(1.3, "quiet", "tint"),
    "dimension": Look(1, "quiet", dash="--"),
    "pin": Look(1.5, "ink", "paper"),
    "dot": Look(1, "ink", "ink"),
    "stand": Look(1.3, "quiet", "tint"),
    "ground": Look(1.1, "quiet"),
    "arrow": Look(1.8, "drive"),
    "head": Look(0, "drive", "drive"),
    "gap": Look(2, "bad", dash=":"),
}
"""Look of each kind of stroke."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """A line or an area of a mark, as a chain of corners in its axes."""

    look: str  # a key of `LOOKS`
    # What gives the axes: "place", "first" or "second", a point with the axes of the ground;
    # "axis", a point with an axis; "line", from start to end, or from first to second; "barrel",
    # the first part of it; "spoke", a radius of a wheel. Of "points" and "circle", a closed curve,
    # `grow` alone says what is drawn.
    on: str
    # Each as a part of the line's length, and sizes along and to its left. None interrupts.
    corners: tuple[Corner, ...] = ()
    is_area: bool = False  # whether it is closed and filled
    # Distance at which the corners are repeated along a line, or around a circle, in sizes.
    every: float = 0.0
    grow: float = 0.0  # sizes by which a closed curve is widened


def _arc(radius: float, first: int, last: int, part: float = 0.0) -> tuple[Corner, ...]:
    """Return an arc about a part of the line, from angle to angle [degrees], every 15 degrees."""
    angles = np.radians(np.linspace(first, last, 1 + abs(last - first) // 15))
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    return tuple((part, *pair) for pair in np.round(np.stack((x, y), axis=-1), 6).tolist())


def _capsule(radius: float) -> tuple[Corner, ...]:
    """Return a line with round ends as an area."""
    return (*_arc(radius, 90, 270), *_arc(radius, -90, 90, 1.0))


def _box(
    start: tuple[float, float], end: tuple[float, float], half: float, left: float = 0.0
) -> tuple[Corner, ...]:
    """Return a rectangle from one part of the line, and sizes along it, to another."""
    high, low = left + half, left - half
    return ((*start, high), (*end, high), (*end, low), (*start, low))


_HATCH: tuple[Corner, ...] = (None, (0, 0, 0), (0, -0.4, -0.8))
_TOOTH: tuple[Corner, ...] = (None, (0, 0, -0.3), (0, 0, 0.3))
_COG: tuple[Corner, ...] = ((0, -0.6, 0.4), (0, 0, 0.4), (0, 0, -0.4), (0, 0.6, -0.4))
_HEAD: tuple[Corner, ...] = ((0, 3.7, 0), (0, 2.5, 0.5), (0, 2.5, -0.5))
_BACK: tuple[Corner, ...] = ((0, -3.7, 0), (0, -2.5, 0.5), (0, -2.5, -0.5))
_TURN: tuple[Corner, ...] = _arc(1.9, -45, 105)
_TURN_HEAD: tuple[Corner, ...] = ((0, -1.361, 1.602), (0, -0.332, 2.396), (0, -0.073, 1.43))
_PIN = Stroke("pin", "second", _arc(0.5, 0, 345), is_area=True)
_GAP = Stroke("gap", "line", ((0, 0, 0), (1, 0, 0)))
_STAND = ((0, 0, 0), (0, -1.2, -1.9), (0, 1.2, -1.9))
_FLOOR = ((0, -1.9, -1.9), (0, 1.9, -1.9))
_FEET = tuple(
    corner
    for foot in (-1.4, -0.6, 0.2, 1.0, 1.8)
    for corner in (None, (0, foot, -1.9), (0, foot - 0.4, -2.7))
)


def _mirrored(corners: tuple[Corner, ...]) -> tuple[Corner, ...]:
    return tuple(corner and (corner[0], corner[1], -corner[2]) for corner in corners)


def _shifted(corners: tuple[Corner, ...], left: float) -> tuple[Corner, ...]:
    return tuple(corner and (corner[0], corner[1], corner[2] + left) for corner in corners)


_TRACK = Stroke("ground", "line", ((0, 0, -1), (1, 0, -1)))
_SLEEPERS = Stroke("ground", "line", _shifted(_HATCH, -1), every=0.8)

SHAPES: Mapping[str, tuple[Stroke, ...]] = {
    "track": (
        _TRACK,
        _SLEEPERS,
        Stroke("ground", "line", _mirrored(_TRACK.corners)),
        Stroke("ground", "line", _mirrored(_SLEEPERS.corners), every=0.8),
    ),
    "rack": (
        Stroke("body", "line", _box((0, 0), (1, 0), 0.7, -1.1), is_area=True),
        Stroke("edge", "line", _COG, every=1.2),
    ),
    "face": (Stroke("bar", "line", ((0, 0, 0), (1, 0, 0))),),
    "ring": (
        Stroke("edge", "circle"),
        Stroke("edge", "circle", grow=2),
        Stroke("edge", "circle", _TOOTH, every=1.2),
        Stroke("edge", "spoke", ((1, 0, 0), (1, 2, 0))),
    ),
    "wheel": (
        Stroke("body", "circle", is_area=True),
        Stroke("edge", "circle", _TOOTH, every=1.2),
        Stroke("edge", "spoke", ((0, 0, 0), (1, 0, 0))),
    ),
    "cam": (Stroke("body", "points", is_area=True),),
    "curved slot": (
        Stroke("groove", "points", is_area=True, grow=0.8),
        Stroke("body", "points", is_area=True, grow=-0.8),
    ),
    "polygon": (Stroke("body", "points", is_area=True),),
    "hull": (Stroke("body", "points", is_area=True, grow=1),),
    "slot": (
        Stroke("body", "line", _capsule(1.7), is_area=True),
        Stroke("groove", "line", _capsule(1.0), is_area=True),
    ),
    "rod": (Stroke("rod", "line", _capsule(0.6), is_area=True),),
    "cylinder": (
        Stroke("body", "line", _capsule(0.4), is_area=True),
        Stroke("body", "barrel", _box((0, -0.6), (1, 0), 1.0), is_area=True),
    ),
    "slide": (Stroke("body", "line", _capsule(0.7), is_area=True),),
    "dimension": (Stroke("dimension", "line", ((0, 0, 0), (1, 0, 0))),),
    "slider": (Stroke("body", "axis", _box((0, -1.7), (0, 1.7), 1.0), is_area=True),),
    "stand": (
        Stroke("stand", "first", _STAND, is_area=True),
        Stroke("ground", "first", _FLOOR),
        Stroke("ground", "first", _FEET),
        _GAP,
        _PIN,
    ),
    "pin": (_GAP, _PIN),
    "turn": (
        Stroke("arrow", "place", _TURN),
        Stroke("head", "place", _TURN_HEAD, is_area=True),
    ),
    "push": (
        Stroke("arrow", "axis", ((0, -2.8, 0), (0, 2.8, 0))),
        Stroke("head", "axis", _HEAD, is_area=True),
        Stroke("head", "axis", _BACK, is_area=True),
    ),
    "dot": (Stroke("dot", "place", _arc(0.35, 0, 345), is_area=True),),
}
"""The strokes of each shape, shapes from back to front."""


def tables() -> dict[str, Any]:
    """Return the tables as plain data, for a page."""
    return {
        "shapes": {name: [asdict(item) for item in strokes] for name, strokes in SHAPES.items()},
        "looks": {name: asdict(look) for name, look in LOOKS.items()},
        "hues": dict(HUES),
    }
