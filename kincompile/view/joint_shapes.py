"""What each type of constraint is drawn with: its marks.

A new type of constraint is drawn by one function here and its line in `DRAWINGS`; matplotlib and
the page draw the marks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeAlias

from kincompile.errors import UnsupportedError
from kincompile.model.absolute import AbsoluteAngle, AbsoluteDistance, AbsoluteX, AbsoluteY
from kincompile.model.cams import CamFlatFollower, CamFollower, PointFollower
from kincompile.model.gears import Gear, RackAndPinion
from kincompile.model.joints import (
    Revolute,
    RevoluteTranslational,
    Translational,
    TranslationalDistance,
)
from kincompile.model.relative import Distance, RelativeAngle, RelativeX, RelativeY
from kincompile.view.marks import (
    GROUND_FRAME,
    Block,
    Drive,
    Mark,
    Pin,
    Place,
    Point,
    Span,
)
from kincompile.view.placed import Placed

if TYPE_CHECKING:
    from kincompile.model.constraint import Constraint

Drawing: TypeAlias = Callable[[Placed], list[Mark]]

ALONG_X, ALONG_Y = (1.0, 0.0), (0.0, 1.0)


def _revolute(placed: Placed) -> list[Mark]:
    return [placed.pin(placed.place("s_i"), placed.place("s_j"))]


def _translational(placed: Placed) -> list[Mark]:
    """Draw a block on a rail of the ground; between moving bodies a sleeve and its slide.

    The sleeve is on body i, unless body j is the block of a crank that works in a slotted lever.
    """
    i, j = placed.place("s_i"), placed.place("s_j")
    v_i, v_j = placed.unit("v_i"), placed.unit("v_j")
    if i.frame == GROUND_FRAME:
        return [placed.rail(i, v_i, j), Block(placed.name, j, v_j)]
    if j.frame == GROUND_FRAME:
        return [placed.rail(j, v_j, i), Block(placed.name, i, v_i)]
    if j.frame in placed.scene.blocks:
        i, j, v_i = j, i, v_j
    return [Span(placed.name, i, j, "slide"), Block(placed.name, i, v_i)]


def _revolute_translational(placed: Placed) -> list[Mark]:
    """Draw a pin in a straight slot; a driven distance is measured from the axis."""
    i, j = placed.place("s_i"), placed.place("s_j")
    distance = placed.constant("C")
    track = placed.rail(i, placed.unit("v_i"), j, offset=distance or 0.0)
    measure = [Span(placed.name, i, j, "dimension")] if distance is None else []
    return [track, *measure, Pin(placed.name, j, j)]


def _translational_distance(placed: Placed) -> list[Mark]:
    return [placed.span("s_i", "s_j", "cylinder" if placed.is_driver else "dimension")]


def _distance(placed: Placed) -> list[Mark]:
    i, j = placed.place("s_i"), placed.place("s_j")
    length = placed.span("s_i", "s_j", "cylinder" if placed.is_driver else "rod")
    return [length, placed.pin(i, i), placed.pin(j, j)]


def _absolute_distance(placed: Placed) -> list[Mark]:
    fixed, moving = placed.place("c"), placed.place("s_i")
    length = placed.span("c", "s_i", "cylinder" if placed.is_driver else "rod")
    return [length, placed.pin(fixed, fixed), placed.pin(moving, moving)]


def _relative(axis: Point) -> Drawing:
    """Return the drawing of a component from point to point."""

    def drawing(placed: Placed) -> list[Mark]:
        drive = [Drive(placed.name, placed.place("s_j"), axis)] if placed.is_driver else []
        return [placed.span("s_i", "s_j", "dimension"), *drive]

    return drawing


def _absolute(axis: Point, across: Point) -> Drawing:
    """Return the drawing of a point at C along `axis`: on a rail of the ground, or driven."""

    def drawing(placed: Placed) -> list[Mark]:
        place, value = placed.place("s_i"), placed.constant("C")
        if value is None:
            return [Drive(placed.name, place, axis)]
        base = Place(GROUND_FRAME, (value * axis[0], value * axis[1]))
        return [placed.rail(base, across, place), Pin(placed.name, place, place)]

    return drawing


def _angle(placed: Placed) -> list[Mark]:
    """Draw a turning arrow at the bearing; an angle that stays is not drawn."""
    return [Drive(placed.name, placed.bearing(), None)] if placed.is_driver else []


def _gear(placed: Placed) -> list[Mark]:
    return [placed.wheel("s_i", "R_i", "theta_i"), placed.wheel("s_j", "R_j", "theta_j")]


def _rack_and_pinion(placed: Placed) -> list[Mark]:
    """Draw the pitch line from P to Q, and on as far as the pinion rolls."""
    p, q = placed.place("s_P"), placed.place("s_Q")
    length = math.dist(p.point, q.point)
    along = ((q.point[0] - p.point[0]) / length, (q.point[1] - p.point[1]) / length)
    pinion = placed.place("s_j")
    line = placed.rail(p, along, pinion, style="rack", at_least=(0.0, length))
    return [line, placed.wheel("s_j", "R_j", "theta_j")]


def _cam_follower(placed: Placed) -> list[Mark]:
    return [placed.profile("s_i", "rho_i", "cam"), placed.profile("s_j", "rho_j", "cam")]


def _cam_flat_follower(placed: Placed) -> list[Mark]:
    """Draw the cam, and a face as long as the cam is wide."""
    cam = placed.profile("s_i", "rho_i", "cam")
    centre = placed.place("s_i")
    radius = max(math.dist(point, centre.point) for point in cam.points)
    face = placed.rail(
        placed.place("s_j"), placed.unit("v_j"), centre, style="face", at_least=(-radius, radius)
    )
    return [cam, face]


def _point_follower(placed: Placed) -> list[Mark]:
    pin = placed.place("s_i")
    return [placed.profile("s_j", "rho_j", "slot"), Pin(placed.name, pin, pin)]


DRAWINGS: Mapping[type[Constraint], Drawing] = {
    Revolute: _revolute,
    Translational: _translational,
    RevoluteTranslational: _revolute_translational,
    TranslationalDistance: _translational_distance,
    Distance: _distance,
    AbsoluteDistance: _absolute_distance,
    RelativeX: _relative(ALONG_X),
    RelativeY: _relative(ALONG_Y),
    AbsoluteX: _absolute(ALONG_X, ALONG_Y),
    AbsoluteY: _absolute(ALONG_Y, ALONG_X),
    AbsoluteAngle: _angle,
    RelativeAngle: _angle,
    Gear: _gear,
    RackAndPinion: _rack_and_pinion,
    CamFollower: _cam_follower,
    CamFlatFollower: _cam_flat_follower,
    PointFollower: _point_follower,
}
"""What each type of constraint is drawn with."""


def marks_of(constraint: Constraint, placed: Placed) -> list[Mark]:
    """Return the marks of a constraint; a type without a drawing is drawn as the one it extends.

    Parameters
    ----------
    constraint
        The constraint as written: its type decides.
    placed
        Its attributes as numbers, and the motion that its marks must fit.

    Raises
    ------
    UnsupportedError
        If there is no drawing for the type.
    """
    for kind in type(constraint).__mro__:
        if kind in DRAWINGS:
            return DRAWINGS[kind](placed)
    name = type(constraint).__name__
    raise UnsupportedError(
        f"there is no drawing for the type {name} of {constraint.name!r}; add a function to "
        "DRAWINGS in kincompile/view/joint_shapes.py"
    )
