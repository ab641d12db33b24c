"""The marks of each type of constraint in space.

A new type needs one function here and its line in `DRAWINGS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeAlias

from kincompile.space import catalogue as space
from kincompile.view.geometry import JointGeometry, along
from kincompile.view.marks import GROUND_FRAME, Drive, FramePoint, Mark, Span, Symbol

if TYPE_CHECKING:
    from kincompile.model.constraint import Constraint
    from kincompile.view.marks import Point

DrawJoint: TypeAlias = Callable[[JointGeometry], list[Mark]]

AXES: tuple[Point, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORIGIN: Point = (0.0, 0.0, 0.0)

HINGES = (space.Revolute, space.Cylindrical, space.Screw)
"""Types about whose axis an angle turns, and where its driver is drawn."""


def _symbol(
    joint: JointGeometry, shape: str, index: str, place: FramePoint | None = None
) -> Symbol:
    """Return a solid about the axis of a body, at the point that the joint has on it."""
    where = joint.point(f"s_{index}") if place is None else place
    h, f = (joint.mechanism.numbers(joint.joint.points[f"{key}_{index}"]) for key in "hf")
    return Symbol(joint.name, shape, where, h, f)


def _at(joint: JointGeometry, shape: str, place: FramePoint) -> Symbol:
    """Return a solid that looks alike from all sides."""
    return Symbol(joint.name, shape, place, AXES[2], AXES[0])


def _sliding(joint: JointGeometry, shape: str, index: str, follower: str) -> Symbol:
    """Return a solid along the axis of a body, as long as the motion of what slides on it."""
    mark, place = _symbol(joint, shape, index), joint.point(follower)
    ways = along(joint.mechanism.q, mark.place, mark.axis, place)
    reach = (min(float(ways.min()), 0.0), max(float(ways.max()), 0.0))
    return Symbol(joint.name, shape, mark.place, mark.axis, mark.cross, place, reach)


def _gap(joint: JointGeometry) -> Span:
    """Return the line between two points that coincide where the mechanism is assembled."""
    return joint.span("s_i", "s_j", "gap")


def _revolute(joint: JointGeometry) -> list[Mark]:
    return [_symbol(joint, "knuckles", "i"), _symbol(joint, "hinge", "j"), _gap(joint)]


def _spherical(joint: JointGeometry) -> list[Mark]:
    return [_at(joint, "ball", joint.point("s_j")), _gap(joint)]


def _pair(first: str, second: str) -> DrawJoint:
    """Return the drawing of a solid along the axis of body i, and of one of body j on it."""

    def drawing(joint: JointGeometry) -> list[Mark]:
        return [_sliding(joint, first, "i", "s_j"), _symbol(joint, second, "j")]

    return drawing


def _crossed(shape: str) -> DrawJoint:
    """Return the drawing of a solid of each body about its axis, which meet in a point."""

    def drawing(joint: JointGeometry) -> list[Mark]:
        return [_symbol(joint, shape, "i"), _symbol(joint, shape, "j"), _gap(joint)]

    return drawing


def _constant_velocity(joint: JointGeometry) -> list[Mark]:
    ball = _at(joint, "ball", joint.point("s_j"))
    return [_symbol(joint, "shaft", "i"), _symbol(joint, "shaft", "j"), ball, _gap(joint)]


def _planar(joint: JointGeometry) -> list[Mark]:
    return [_symbol(joint, "table", "i"), _symbol(joint, "foot", "j")]


def _fixed(joint: JointGeometry) -> list[Mark]:
    return [_symbol(joint, "weld", "j"), _gap(joint)]


def _in_plane(joint: JointGeometry) -> list[Mark]:
    return [_symbol(joint, "table", "i"), _at(joint, "ball", joint.point("s_j"))]


def _point_on_line(joint: JointGeometry) -> list[Mark]:
    return [_sliding(joint, "rail", "i", "s_j"), _at(joint, "ball", joint.point("s_j"))]


def _revolute_cylindrical(joint: JointGeometry) -> list[Mark]:
    """Draw a hinge on body i, and a rail of body j through it."""
    return [_symbol(joint, "hinge", "i"), _sliding(joint, "rail", "j", "s_i")]


def _rod(first: str, second: str) -> DrawJoint:
    """Return the drawing of a length between two points: a rod with balls, a cylinder if driven."""

    def drawing(joint: JointGeometry) -> list[Mark]:
        length = joint.span(first, second, "cylinder" if joint.is_driver else "rod")
        return [length, *(_at(joint, "ball", end) for end in (length.first, length.second))]

    return drawing


def _revolute_spherical(joint: JointGeometry) -> list[Mark]:
    """Draw a rod with a hinge at body i and a ball at body j."""
    rod = joint.span("s_i", "s_j", "rod")
    return [rod, _symbol(joint, "hinge", "i"), _at(joint, "ball", rod.second)]


def _relative_translation(joint: JointGeometry) -> list[Mark]:
    """Draw a driver along the axis of body i; a distance that stays is a measure."""
    if joint.is_driver:
        return [_symbol(joint, "push", "i"), joint.span("s_i", "s_j", "dimension")]
    return [joint.span("s_i", "s_j", "dimension")]


def _turning(joint: JointGeometry) -> list[Mark]:
    """Draw a turning arrow about the hinge that is driven; an angle that stays is not drawn."""
    return [_symbol(joint, "turn", "j", _hinge(joint))] if joint.is_driver else []


def _hinge(joint: JointGeometry) -> FramePoint:
    """Return the point on body j of the hinge of the same two bodies, or the body's origin."""
    names = {item.name for item in joint.joint.bodies}
    body = joint.joint.bodies[1]
    frame = joint.mechanism.frames.get(body.name, GROUND_FRAME)
    for other in joint.mechanism.joints:
        if isinstance(other.written, HINGES) and {item.name for item in other.bodies} == names:
            return joint.mechanism.point(other, f"s_{'ij'[other.bodies.index(body)]}")
    return FramePoint(frame, ORIGIN)


def _relative(axis: Point) -> DrawJoint:

    def drawing(joint: JointGeometry) -> list[Mark]:
        drive = [Drive(joint.name, joint.point("s_j"), axis)] if joint.is_driver else []
        return [joint.span("s_i", "s_j", "dimension"), *drive]

    return drawing


def _absolute(axis: int) -> DrawJoint:
    """Return the drawing of a point at C along an axis: in a plane of the ground, or driven."""

    def drawing(joint: JointGeometry) -> list[Mark]:
        place, value = joint.point("s_i"), joint.constant("C")
        if value is None:
            return [Drive(joint.name, place, AXES[axis])]
        at = place.at(joint.mechanism.q)[0]
        base = tuple(value if k == axis else float(x) for k, x in enumerate(at))
        table = Symbol(
            joint.name, "table", FramePoint(GROUND_FRAME, base), AXES[axis], AXES[axis - 1]
        )
        return [table, _at(joint, "ball", place)]

    return drawing


def _measure(joint: JointGeometry) -> list[Mark]:
    return [joint.span("s_i", "s_j", "dimension")]


def _nothing(joint: JointGeometry) -> list[Mark]:
    """Draw nothing: a direction has no place."""
    del joint
    return []


DRAWINGS: Mapping[type[Constraint], DrawJoint] = {
    space.Normalization: _nothing,
    space.Dot1: _nothing,
    space.Parallel: _nothing,
    space.AbsoluteOrientation: _nothing,
    space.JointAngle: _nothing,
    space.Dot2: _measure,
    space.AbsoluteX: _absolute(0),
    space.AbsoluteY: _absolute(1),
    space.AbsoluteZ: _absolute(2),
    space.AbsoluteDistance: _rod("c", "s_i"),
    space.RelativeX: _relative(AXES[0]),
    space.RelativeY: _relative(AXES[1]),
    space.RelativeZ: _relative(AXES[2]),
    space.Distance: _rod("s_i", "s_j"),
    space.PointOnLine: _point_on_line,
    space.InPlane: _in_plane,
    space.Planar: _planar,
    space.Spherical: _spherical,
    space.Revolute: _revolute,
    space.Cylindrical: _pair("rail", "sleeve"),
    space.Translational: _pair("track", "block"),
    space.Universal: _crossed("yoke"),
    space.ConstantVelocity: _constant_velocity,
    space.Screw: _pair("screw", "nut"),
    space.Fixed: _fixed,
    space.RevoluteCylindrical: _revolute_cylindrical,
    space.RevoluteSpherical: _revolute_spherical,
    space.RelativeTranslation: _relative_translation,
    space.RelativeRotation: _turning,
}
"""The function that draws each type of constraint."""
