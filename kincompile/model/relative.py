"""Relative coordinates and distances between two bodies."""

from __future__ import annotations

from kincompile.calculus.expressions import Basis, Expression, Perpendicular, Vector, dot
from kincompile.calculus.symbols import C, i, j, s_i, s_j
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, ValueLike
from kincompile.model.constraint import Constraint, constraint_type


def separation() -> Vector:
    """Return d = r_j + A_j s_j - r_i - A_i s_i, from the point on body i to that on body j."""
    return j.point(s_j) - i.point(s_i)


@constraint_type
class PointToPoint(Constraint):
    """A constraint of a point on body i and a point on body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")


@constraint_type
class RelativeX(PointToPoint):
    """The global x component from a point on body i to a point on body j is C."""

    source = "Haug 3.3"
    known_as = "horizontal offset, coordinate driver between two bodies"
    positive = "C is counted from the point on body i to that on body j, and grows with x."
    use = (
        'table, tool = m.body("table", guess=(1, 0.6, 0.2)), m.body("tool", guess=(2.5, 1.8, 0.5))',
        'm.add(kc.RelativeX("offset", table, (0.4, 0.2), tool, (0, -0.4), 1.2))',
    )
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_x^T d - C."""
        return (dot(Basis(), separation()) - C,)


@constraint_type
class RelativeY(PointToPoint):
    """The global y component from a point on body i to a point on body j is C."""

    source = "Haug 3.3"
    known_as = "vertical offset, coordinate driver between two bodies"
    positive = "C is counted from the point on body i to that on body j, and grows with y."
    use = (
        'table, tool = m.body("table", guess=(1, 0.6, 0.2)), m.body("tool", guess=(2.5, 1.8, 0.5))',
        'm.add(kc.RelativeY("height", table, (0.4, 0.2), tool, (0, -0.4), 0.6))',
    )
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_y^T d - C."""
        return (dot(Perpendicular(Basis()), separation()) - C,)


@constraint_type
class RelativeAngle(Constraint):
    """The angle of body j relative to body i is C."""

    source = "Haug 3.3"
    sets_motion = True
    known_as = (
        "weld (with a Revolute), fixed (with a Revolute), rotary actuator, robot joint drive, "
        "prescribed relative angle"
    )
    positive = "C is counted counterclockwise from body i to body j."
    use = (
        'arm, wrist = m.body("arm", guess=(1, 0.8, 0.3)), m.body("wrist", guess=(2.6, 1.5, 0.9))',
        'm.add(kc.RelativeAngle("motor", arm, wrist, 0.6))',
    )
    i: BodyLike = argument.body("i")
    j: BodyLike = argument.body("j")
    angle: ValueLike = argument.value("rad")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return phi_j - phi_i - C."""
        return (j.phi - i.phi - C,)


@constraint_type
class Distance(PointToPoint):
    """The distance between a point on body i and a point on body j is C > 0: a massless coupler."""

    source = "Haug 3.3.7"
    known_as = (
        "cylinder, hydraulic cylinder, linear actuator, massless link, connecting rod, "
        "two-force member"
    )
    positive = (
        "C is positive. Which of the two ways of closing the mechanism is meant, the guess decides."
    )
    use = (
        'boom, bucket = m.body("boom", guess=(1, 0.8, 0.3)), '
        'm.body("bucket", guess=(3.2, 1.6, 0.8))',
        'm.add(kc.Distance("cylinder", boom, (0.3, 0.3), bucket, (-0.4, 0.2), 1.6))',
    )
    distance: ValueLike = argument.distance()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T d - C^2."""
        d = separation()
        return (dot(d, d) - C**2,)
