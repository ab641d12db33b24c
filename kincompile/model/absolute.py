"""Constraints between one body and the ground."""

from __future__ import annotations

from kincompile.calculus.expressions import Basis, Expression, Perpendicular, dot
from kincompile.calculus.symbols import C, c, i, s_i
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PointLike, ValueLike
from kincompile.model.constraint import Constraint, constraint_type


@constraint_type
class AbsoluteX(Constraint):
    """The global x coordinate of a point on a body is C."""

    source = "Haug 3.2.3"
    body: BodyLike = argument.body("i")
    point: PointLike = argument.point("s_i", on="i")
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_x^T (r_i + A_i s_i) - C."""
        return (dot(Basis(), i.point(s_i)) - C,)


@constraint_type
class AbsoluteY(Constraint):
    """The global y coordinate of a point on a body is C."""

    source = "Haug 3.2.4"
    body: BodyLike = argument.body("i")
    point: PointLike = argument.point("s_i", on="i")
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_y^T (r_i + A_i s_i) - C."""
        return (dot(Perpendicular(Basis()), i.point(s_i)) - C,)


@constraint_type
class AbsoluteAngle(Constraint):
    """The angle of a body is C."""

    source = "Haug 3.2.6"
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
    body: BodyLike = argument.body("i")
    point: PointLike = argument.point("s_i", on="i")
    ground_point: PointLike = argument.point("c", on="ground")
    distance: ValueLike = argument.distance()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T d - C^2 with d = r_i + A_i s_i - c."""
        d = i.point(s_i) - c
        return (dot(d, d) - C**2,)
