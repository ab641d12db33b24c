"""The four primitives of spatial joints, and the constraints of one body to the ground."""

from __future__ import annotations

from typing import ClassVar

from kincompile.calculus.expressions import Basis, Expression, dot
from kincompile.calculus.space import AXES, a_i, a_j, c, i, j, s_i, separation, u
from kincompile.calculus.symbols import C
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, PointLike, ValueLike
from kincompile.model.constraint import constraint_type
from kincompile.space.constraint import SpatialConstraint, SpatialPoints


@constraint_type
class Normalization(SpatialConstraint):
    """The Euler parameters of a body have the length one: the body's own equation."""

    source = "Haug 9.3"
    is_own = True
    body: BodyLike = argument.body("i")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return p^T p - 1."""
        return (dot(i.p, i.p) - 1,)


@constraint_type
class Dot1(SpatialConstraint):
    """The scalar product of a vector of body i and one of body j is C."""

    source = "Haug 9.4"
    i: BodyLike = argument.body("i")
    vector_i: PointLike = argument.vector("a_i", on="i")
    j: BodyLike = argument.body("j")
    vector_j: PointLike = argument.vector("a_j", on="j")
    value: ValueLike = argument.value("")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return a_i^T a_j - C."""
        return (dot(i.A(a_i), j.A(a_j)) - C,)


@constraint_type
class Dot2(SpatialConstraint):
    """The scalar product of a vector of body i and the way to a point on body j is C."""

    source = "Haug 9.4"
    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    vector_i: PointLike = argument.vector("a_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return a_i^T d - C."""
        return (dot(i.A(a_i), separation()) - C,)


@constraint_type
class RelativeCoordinate(SpatialPoints):
    """A constraint of a global component, the k-th; the types are its subclasses."""

    k: ClassVar[int]
    value: ValueLike = argument.value()

    @classmethod
    def Phi(cls) -> tuple[Expression, ...]:
        """Return e_k^T d - C."""
        return (dot(AXES[cls.k], separation()) - C,)


@constraint_type
class RelativeX(RelativeCoordinate):
    """The global x component from a point on body i to a point on body j is C."""

    source = "Haug 9.4"
    k = 0


@constraint_type
class RelativeY(RelativeCoordinate):
    """The global y component from a point on body i to a point on body j is C."""

    source = "Haug 9.4"
    k = 1


@constraint_type
class RelativeZ(RelativeCoordinate):
    """The global z component from a point on body i to a point on body j is C."""

    source = "Haug 9.4"
    k = 2


@constraint_type
class Distance(SpatialPoints):
    """The distance between a point on body i and a point on body j is C > 0: a rod of two balls."""

    source = "Haug 9.4"
    distance: ValueLike = argument.distance()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T d - C^2."""
        d = separation()
        return (dot(d, d) - C**2,)


@constraint_type
class OnePoint(SpatialConstraint):
    """A constraint of a point on a body; the types are its subclasses."""

    body: BodyLike = argument.body("i")
    point: PlaceLike = argument.point("s_i", on="i")


@constraint_type
class AbsoluteCoordinate(OnePoint):
    """A constraint of a global component, the k-th; the types are its subclasses."""

    k: ClassVar[int]
    value: ValueLike = argument.value()

    @classmethod
    def Phi(cls) -> tuple[Expression, ...]:
        """Return e_k^T (r_i + A_i s_i) - C."""
        return (dot(AXES[cls.k], i.point(s_i)) - C,)


@constraint_type
class AbsoluteX(AbsoluteCoordinate):
    """The global x coordinate of a point on a body is C."""

    source = "Haug 9.4"
    k = 0


@constraint_type
class AbsoluteY(AbsoluteCoordinate):
    """The global y coordinate of a point on a body is C."""

    source = "Haug 9.4"
    k = 1


@constraint_type
class AbsoluteZ(AbsoluteCoordinate):
    """The global z coordinate of a point on a body is C."""

    source = "Haug 9.4"
    k = 2


@constraint_type
class AbsoluteDistance(OnePoint):
    """The distance from a ground point to a point on a body is C > 0."""

    source = "Haug 9.4"
    ground_point: PlaceLike = argument.point("c", on="ground")
    distance: ValueLike = argument.distance()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (r_i + A_i s_i - c)^T (r_i + A_i s_i - c) - C^2."""
        way = i.point(s_i) - c
        return (dot(way, way) - C**2,)


@constraint_type
class AbsoluteOrientation(SpatialConstraint):
    """The vector part e of the Euler parameters of a body is C times a vector u.

    About a unit vector u by the angle theta, C = sin(theta/2). At e0 = 0 it is singular.
    """

    source = "Haug 9.4"
    sets_motion = True
    row_names = ("e1", "e2", "e3")
    body: BodyLike = argument.body("i")
    vector: PointLike = argument.vector("u", on="i")
    value: ValueLike = argument.value("")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e - C u."""
        return tuple(dot(Basis(k + 1, 4), i.p) - C * dot(AXES[k], u) for k in range(3))
