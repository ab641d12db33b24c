"""What marks look like in space, as data: the pieces of each shape.

Python evaluates the table in `solids.py`, for figures and for files; a page is given the same
table, and evaluates it in its script `space.js`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from kincompile.view.shapes import HUES, LOOKS, Look, Stroke

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.view.shapes import Corner

SOLID_LOOKS: Mapping[str, Look] = {
    **LOOKS,
    "ball": Look(1.2),
    "steel": Look(1.2, "quiet"),
    "plate": Look(1.2),
}
"""Look of each kind of piece: those of the plane, and what else is in space."""


@dataclass(frozen=True, slots=True)
class Piece(Stroke):
    """A part of a shape in space, as a chain of corners beside a line.

    Its axes are those that `on` names, as of a stroke, with "reach", along what slides; "stem",
    from the barrel on; "edges" of a body; "turn", across the axis. A corner is a part of the line's
    length, sizes along it, and sizes away from it.
    """

    # Of the solid that the corners make when they are turned about the line; without, they are the
    # corners of a flat line or area. Of a ball without corners, `grow` is the radius.
    sides: int = 0

    @property
    def is_ball(self) -> bool:
        """Whether it is a ball about its place."""
        return not self.corners and self.on == "place"


ROUND = 12
"""Sides of what is round."""


def _tube(
    radius: float, start: tuple[float, float] = (0, 0), end: tuple[float, float] = (1, 0)
) -> tuple[Corner, ...]:
    """Return a cylinder from one part of the line, and sizes along it, to another."""
    return ((*start, 0), (*start, radius), (*end, radius), (*end, 0))


def _about(radius: float, first: float, last: float) -> tuple[Corner, ...]:
    """Return a cylinder from one size along the line to another."""
    return _tube(radius, (0, first), (0, last))


def _ball(look: str, on: str, radius: float) -> Piece:
    return Piece(look, on, is_area=True, grow=radius)


def _solid(look: str, on: str, corners: tuple[Corner, ...], sides: int = ROUND) -> Piece:
    return Piece(look, on, corners, is_area=True, sides=sides)


_THREAD: tuple[Corner, ...] = ((0, -0.3, 0.45), (0, 0, 0.75), (0, 0.3, 0.45))
_TURN: tuple[Corner, ...] = (
    (0, 1.707, -1.707), (0, 2.23, -0.924), (0, 2.414, 0), (0, 2.23, 0.924), (0, 1.707, 1.707),
    (0, 0.924, 2.23), (0, 0, 2.414), (0, -0.625, 2.332),
)  # fmt: skip
_TURN_HEAD: tuple[Corner, ...] = ((0, -1.7, 2.0), (0, -0.5, 2.95), (0, -0.4, 1.7))
_PUSH: tuple[Corner, ...] = (
    (0, -4.4, 0), (0, -3, 0.7), (0, -3, 0.22), (0, 3, 0.22), (0, 3, 0.7), (0, 4.4, 0),
)  # fmt: skip

SOLIDS: Mapping[str, tuple[Piece, ...]] = {
    "hull": (
        Piece("plate", "points", is_area=True),
        _solid("body", "edges", _tube(0.5), 8),
    ),
    "shell": (Piece("plate", "points", is_area=True),),
    "knuckles": (
        _solid("body", "axis", _about(1.0, -2.3, -0.9)),
        _solid("body", "axis", _about(1.0, 0.9, 2.3)),
    ),
    "hinge": (
        _solid("body", "axis", _about(1.0, -0.8, 0.8)),
        _solid("steel", "axis", _about(0.4, -2.7, 2.7), 8),
    ),
    "ball": (_ball("ball", "place", 1.0),),
    "rail": (_solid("body", "reach", _tube(0.5), 8),),
    "track": (_solid("body", "reach", _tube(0.8), 4),),
    "sleeve": (_solid("body", "axis", _about(1.15, -1.9, 1.9)),),
    "block": (_solid("body", "axis", _about(2.0, -1.8, 1.8), 4),),
    "yoke": (
        _solid("body", "axis", _about(0.4, -2.0, 2.0), 8),
        _solid("body", "axis", _about(0.8, -2.2, -1.4), 8),
        _solid("body", "axis", _about(0.8, 1.4, 2.2), 8),
    ),
    "shaft": (_solid("body", "axis", _about(0.7, -2.2, 2.2)),),
    "stub": (_solid("body", "axis", _about(0.5, -5.0, 5.0), 8),),
    "screw": (
        _solid("body", "reach", _tube(0.45), 8),
        Piece("body", "reach", _THREAD, is_area=True, every=0.6, sides=8),
    ),
    "nut": (_solid("body", "axis", _about(1.7, -1.0, 1.0), 6),),
    "table": (_solid("plate", "axis", _about(5.0, -0.4, -0.1), 4),),
    "foot": (_solid("plate", "axis", _about(3.0, 0.0, 0.4), 4),),
    "weld": (_solid("body", "axis", _about(1.3, -0.9, 0.9), 4),),
    "rod": (_solid("steel", "line", _tube(0.4), 8),),
    "cylinder": (
        _solid("steel", "stem", _tube(0.4), 8),
        _solid("body", "barrel", _tube(0.9, (0, -0.6), (1, 0))),
    ),
    "dimension": (Piece("dimension", "line", ((0, 0, 0), (1, 0, 0))),),
    "gap": (Piece("gap", "line", ((0, 0, 0), (1, 0, 0))),),
    "turn": (
        Piece("arrow", "turn", _TURN),
        Piece("head", "turn", _TURN_HEAD, is_area=True),
    ),
    "push": (_solid("head", "axis", _PUSH, 6),),
    "dot": (_ball("dot", "place", 0.45),),
}
"""The pieces of each shape."""


def solid_tables() -> dict[str, Any]:
    """Return the tables as plain data, for a page."""
    return {
        "shapes": {name: [asdict(item) for item in pieces] for name, pieces in SOLIDS.items()},
        "looks": {name: asdict(look) for name, look in SOLID_LOOKS.items()},
        "hues": dict(HUES),
    }
