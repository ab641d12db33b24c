"""The marks of each type of constraint.

A new type needs one function here and its line in `DRAWINGS`; matplotlib and the page draw the
marks.
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
from kincompile.view import marks
from kincompile.view.geometry import JointGeometry
from kincompile.view.live_numbers import length_of
from kincompile.view.marks import FramePoint, Point

if TYPE_CHECKING:
    from kincompile.model.constraint import Constraint

DrawJoint: TypeAlias = Callable[[JointGeometry], list[marks.Mark]]

ALONG_X, ALONG_Y = (1.0, 0.0), (0.0, 1.0)


def _revolute(joint: JointGeometry) -> list[marks.Mark]:
    return [joint.pin(joint.point("s_i"), joint.point("s_j"))]


def _translational(joint: JointGeometry) -> list[marks.Mark]:
    """Draw a block on a rail of the ground, or in the slot of a lever.

    Between other moving bodies there is a sleeve, on body i, with its slide.
    """
    i, j = joint.point("s_i"), joint.point("s_j")
    v_i, v_j = joint.unit("v_i"), joint.unit("v_j")
    blocks = joint.mechanism.blocks
    if j.frame == marks.GROUND_FRAME or (i.frame in blocks and i.frame != marks.GROUND_FRAME):
        i, j, v_i, v_j = j, i, v_j, v_i
    if i.frame == marks.GROUND_FRAME or j.frame in blocks:
        return [joint.rail(i, v_i, j), joint.slider(j, v_j)]
    return [marks.Span(joint.name, i, j, "slide"), joint.slider(i, v_i)]


def _revolute_translational(joint: JointGeometry) -> list[marks.Mark]:
    """Draw a pin in a straight slot; a driven distance is measured from the axis."""
    i, j = joint.point("s_i"), joint.point("s_j")
    axis, distance = joint.unit("v_i"), joint.constant("C")
    track, pin = joint.rail(i, axis, j, offset=distance or 0.0), marks.Pin(joint.name, j, j)
    if distance is None:
        return [track, marks.Span(joint.name, i, j, "dimension"), pin]
    return [track, joint.slider(j, axis, i.frame), pin]


def _translational_distance(joint: JointGeometry) -> list[marks.Mark]:
    return [joint.span("s_i", "s_j", "cylinder" if joint.is_driver else "dimension")]


def _distance(first: str, second: str) -> DrawJoint:

    def drawing(joint: JointGeometry) -> list[marks.Mark]:
        length = joint.span(first, second, "cylinder" if joint.is_driver else "rod")
        return [length, *(marks.Pin(joint.name, end, end) for end in (length.first, length.second))]

    return drawing


def _relative(axis: Point) -> DrawJoint:

    def drawing(joint: JointGeometry) -> list[marks.Mark]:
        drive = [marks.Drive(joint.name, joint.point("s_j"), axis)] if joint.is_driver else []
        return [joint.span("s_i", "s_j", "dimension"), *drive]

    return drawing


def _absolute(axis: Point, across: Point) -> DrawJoint:
    """Return the drawing of a point at C along `axis`: on a rail of the ground, or driven."""

    def drawing(joint: JointGeometry) -> list[marks.Mark]:
        place, value = joint.point("s_i"), joint.constant("C")
        if value is None:
            return [marks.Drive(joint.name, place, axis)]
        base = FramePoint(marks.GROUND_FRAME, (value * axis[0], value * axis[1]))
        block = joint.slider(place, across, marks.GROUND_FRAME)
        return [joint.rail(base, across, place), block, marks.Pin(joint.name, place, place)]

    return drawing


def _angle(joint: JointGeometry) -> list[marks.Mark]:
    """Draw a turning arrow at the bearing; an angle that stays is not drawn."""
    return [marks.Drive(joint.name, joint.bearing(), None)] if joint.is_driver else []


def _gear(joint: JointGeometry) -> list[marks.Mark]:
    return [joint.wheel("s_i", "R_i", "theta_i"), joint.wheel("s_j", "R_j", "theta_j")]


def _rack_and_pinion(joint: JointGeometry) -> list[marks.Mark]:
    """Draw the pitch line from P to Q, and on as far as the pinion rolls."""
    p, q = joint.point("s_P"), joint.point("s_Q")
    length = length_of(q.point[0] - p.point[0], q.point[1] - p.point[1])
    along = ((q.point[0] - p.point[0]) / length, (q.point[1] - p.point[1]) / length)
    pinion = joint.point("s_j")
    line = joint.rail(p, along, pinion, style="rack", at_least=(0.0, length))
    return [line, joint.wheel("s_j", "R_j", "theta_j")]


def _cam_follower(joint: JointGeometry) -> list[marks.Mark]:
    return [joint.profile("s_i", "rho_i", "cam"), joint.profile("s_j", "rho_j", "cam")]


def _cam_flat_follower(joint: JointGeometry) -> list[marks.Mark]:
    """Draw the cam, and a face as long as the cam is wide."""
    cam = joint.profile("s_i", "rho_i", "cam")
    centre = joint.point("s_i")
    radius = max(math.dist(point, centre.point) for point in cam.points)
    face = joint.rail(
        joint.point("s_j"), joint.unit("v_j"), centre, style="face", at_least=(-radius, radius)
    )
    return [cam, face]


def _point_follower(joint: JointGeometry) -> list[marks.Mark]:
    pin = joint.point("s_i")
    return [joint.profile("s_j", "rho_j", "slot"), marks.Pin(joint.name, pin, pin)]


DRAWINGS: Mapping[type[Constraint], DrawJoint] = {
    Revolute: _revolute,
    Translational: _translational,
    RevoluteTranslational: _revolute_translational,
    TranslationalDistance: _translational_distance,
    Distance: _distance("s_i", "s_j"),
    AbsoluteDistance: _distance("c", "s_i"),
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
"""The function that draws each type of constraint."""


def marks_of(
    constraint: Constraint,
    joint: JointGeometry,
    drawings: Mapping[type[Constraint], DrawJoint] = DRAWINGS,
) -> list[marks.Mark]:
    """Return the marks of a constraint; a type without a drawing is drawn as the one it extends.

    Raises
    ------
    UnsupportedError
        If there is no drawing for the type.
    """
    for kind in type(constraint).__mro__:
        if kind in drawings:
            return drawings[kind](joint)
    name = type(constraint).__name__
    raise UnsupportedError(
        f"there is no drawing for the type {name} of {constraint.name!r}; add a function to "
        "DRAWINGS in kincompile/view/joint_shapes.py, of a type in space in solid_joints.py"
    )
