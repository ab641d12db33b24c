"""Revolute and translational joints, and the composite joints made of them."""

from __future__ import annotations

from kincompile.calculus.expressions import Expression, Norm, dot, perpendicular
from kincompile.calculus.symbols import C, i, j, s_i, s_j, v_i, v_j
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PointLike, ValueLike
from kincompile.model.constraint import Constraint, constraint_type
from kincompile.model.relative import (
    PointToPoint,
    RelativeAngle,
    RelativeX,
    RelativeY,
    separation,
)


@constraint_type
class Revolute(PointToPoint):
    """A point on body i and a point on body j coincide."""

    source = "Haug 3.3.10"
    row_names = ("x", "y")
    simpler = (("x", RelativeY), ("y", RelativeX))
    replaced_by = (
        "a point on a line: a {simpler} with value 0 keeps {kept}, a RevoluteTranslational or a "
        "Distance does as well"
    )

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i s_i - r_j - A_j s_j."""
        return (i.point(s_i) - j.point(s_j),)


@constraint_type
class PointAndAxis(Constraint):
    """A constraint of an axis of body i and a point on body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PointLike = argument.point("s_i", on="i")
    axis_i: PointLike = argument.axis("v_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PointLike = argument.point("s_j", on="j")
    distance: ValueLike = argument.value()


@constraint_type
class RevoluteTranslational(PointAndAxis):
    """A point on body j keeps the distance C from an axis of body i, counted to its left."""

    source = "Haug 3.3"

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (R A_i v_i)^T d / |v_i| - C."""
        return (dot(perpendicular(i.A(v_i)), separation()) / Norm(v_i) - C,)


@constraint_type
class TranslationalDistance(PointAndAxis):
    """A point on body j is at C along an axis of body i, counted from a point on the axis."""

    source = "Haug 3.5"

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (A_i v_i)^T d / |v_i| - C."""
        return (dot(i.A(v_i), separation()) / Norm(v_i) - C,)


@constraint_type
class Translational(Constraint):
    """Body j slides along an axis of body i without turning: the two axes stay on one line."""

    source = "Haug 3.3.13"
    row_names = ("normal", "parallel")
    simpler = (("normal", RelativeAngle), ("parallel", RevoluteTranslational))
    i: BodyLike = argument.body("i")
    point_i: PointLike = argument.point("s_i", on="i")
    axis_i: PointLike = argument.axis("v_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PointLike = argument.point("s_j", on="j")
    axis_j: PointLike = argument.axis("v_j", on="j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (R A_i v_i)^T d and (R A_i v_i)^T A_j v_j."""
        normal = perpendicular(i.A(v_i))
        return dot(normal, separation()), dot(normal, j.A(v_j))
