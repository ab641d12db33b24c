"""Relative coordinates and distances between two bodies."""

from __future__ import annotations

from kincompile.calculus.expressions import Basis, Expression, Perpendicular, Vector, dot
from kincompile.calculus.symbols import C, i, j, s_i, s_j
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PointLike, ValueLike
from kincompile.model.constraint import Constraint, constraint_type


def separation() -> Vector:
    """Return d = r_j + A_j s_j - r_i - A_i s_i, from the point on body i to that on body j."""
    return j.point(s_j) - i.point(s_i)


@constraint_type
class PointToPoint(Constraint):
    """A constraint of a point on body i and a point on body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PointLike = argument.point("s_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PointLike = argument.point("s_j", on="j")


@constraint_type
class RelativeX(PointToPoint):
    """The global x component from a point on body i to a point on body j is C."""

    source = "Haug 3.3"
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_x^T d - C."""
        return (dot(Basis(), separation()) - C,)


@constraint_type
class RelativeY(PointToPoint):
    """The global y component from a point on body i to a point on body j is C."""

    source = "Haug 3.3"
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_y^T d - C."""
        return (dot(Perpendicular(Basis()), separation()) - C,)


@constraint_type
class RelativeAngle(Constraint):
    """The angle of body j relative to body i is C."""

    source = "Haug 3.3"
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
    distance: ValueLike = argument.distance()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T d - C^2."""
        d = separation()
        return (dot(d, d) - C**2,)
