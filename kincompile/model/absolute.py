"""Constraints between one body and the ground."""

from __future__ import annotations

from kincompile.calculus.expressions import Basis, Expression, Perpendicular, dot
from kincompile.calculus.symbols import C, c, i, s_i
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, ValueLike
from kincompile.model.constraint import Constraint, constraint_type


@constraint_type
class AbsoluteX(Constraint):
    """The global x coordinate of a point on a body is C."""

    source = "Haug 3.2.3"
    known_as = (
        "point on a vertical line, pin in a vertical slot, roller on a wall, coordinate driver"
    )
    positive = "C grows with x, to the right."
    use = (
        'block = m.body("block", guess=(2, 1, 0.3))',
        'm.add(kc.AbsoluteX("wall", block, (0.5, 0), 2.5))',
    )
    body: BodyLike = argument.body("i")
    point: PlaceLike = argument.point("s_i", on="i")
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_x^T (r_i + A_i s_i) - C."""
        return (dot(Basis(), i.point(s_i)) - C,)


@constraint_type
class AbsoluteY(Constraint):
    """The global y coordinate of a point on a body is C."""

    source = "Haug 3.2.4"
    known_as = (
        "point on a horizontal line, pin in a horizontal slot, roller on a floor, coordinate driver"
    )
    positive = "C grows with y, upwards."
    use = (
        'block = m.body("block", guess=(1, 1.2, 0.3))',
        'm.add(kc.AbsoluteY("floor", block, (0, -0.5), 0.7))',
    )
    body: BodyLike = argument.body("i")
    point: PlaceLike = argument.point("s_i", on="i")
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_y^T (r_i + A_i s_i) - C."""
        return (dot(Perpendicular(Basis()), i.point(s_i)) - C,)


@constraint_type
class AbsoluteAngle(Constraint):
    """The angle of a body is C."""

    source = "Haug 3.2.6"
    sets_motion = True
    known_as = "motor, crank drive, rotary driver, prescribed angle"
    positive = (
        "C is counted counterclockwise from the x axis of the ground to the body's xi axis. "
        "Whole turns count: 2 pi is not 0."
    )
    use = (
        'crank = m.body("crank", guess=(1.5, 1, 0.7))',
        'm.add(kc.AbsoluteAngle("motor", crank, 0.7 + 2 * kc.pi * kc.t))',
    )
    body: BodyLike = argument.body("i")
    angle: ValueLike = argument.value("rad")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return phi_i - C."""
        return (i.phi - C,)


@constraint_type
class AbsoluteDistance(Constraint):
    """The distance from a ground point to a point on a body is C > 0."""

    source = "Haug 3.2.1"
    known_as = (
        "rope to the ground, massless link to the ground, rod to the ground, cylinder on the ground"
    )
    positive = "C is positive. On which side of the ground point the body is, the guess decides."
    use = (
        'boom = m.body("boom", guess=(2, 1.5, 0.4))',
        'm.add(kc.AbsoluteDistance("rope", boom, (0.5, 0), (0.5, 0.5), 2.2))',
    )
    body: BodyLike = argument.body("i")
    point: PlaceLike = argument.point("s_i", on="i")
    ground_point: PlaceLike = argument.point("c", on="ground")
    distance: ValueLike = argument.distance()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T d - C^2 with d = r_i + A_i s_i - c."""
        d = i.point(s_i) - c
        return (dot(d, d) - C**2,)
