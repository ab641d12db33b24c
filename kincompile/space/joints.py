"""Joints in space: stacks of the primitives.

Each body carries a point s and a right-handed triad (f, g, h) of unit vectors, h along the axis.
Rows are "j minus i".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.calculus.expressions import (
    Angle,
    Circular,
    Expression,
    Pi,
    Scalar,
    Symbol,
    dot,
)
from kincompile.calculus.space import f_i, f_j, g_i, g_j, h_i, h_j, i, j, separation
from kincompile.calculus.symbols import C, contact_i
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, PointLike, ValueLike
from kincompile.model.constraint import CamConstraint, constraint_type
from kincompile.space.constraint import SpatialConstraint, SpatialPoints

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import sympy

    from kincompile.model.constraint import Constraint

XYZ = ("x", "y", "z")


def parallel() -> tuple[Scalar, Scalar]:
    """Return f_i^T h_j and g_i^T h_j: the axes are parallel."""
    return dot(i.A(f_i), j.A(h_j)), dot(i.A(g_i), j.A(h_j))


def on_line() -> tuple[Scalar, Scalar]:
    """Return f_i^T d and g_i^T d: the point of body j is on the axis of body i."""
    return dot(i.A(f_i), separation()), dot(i.A(g_i), separation())


def angle_from(reference: Scalar) -> Scalar:
    """Return the angle of f_j about h_i from f_i, less a reference: the one nearest to it.

    So the number of turns is that of the reference, and no other root has the residual zero.
    """
    cosine, sine = dot(i.A(f_i), j.A(f_j)), dot(i.A(g_i), j.A(f_j))
    c, s = Circular("cos", reference), Circular("sin", reference)
    return Angle(sine * c - cosine * s, cosine * c + sine * s)


def angle_from_driver() -> Scalar:
    """Return theta - alpha, with the angle theta that is nearest to the value C of a driver."""
    return angle_from(C) + C - contact_i.alpha


@constraint_type
class Spherical(SpatialPoints):
    """A point on body i and a point on body j coincide: a ball joint."""

    source = "Haug 9.4"
    row_names = XYZ

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d."""
        return (separation(),)


@constraint_type
class Axes(SpatialConstraint):
    """A constraint of two axes, given by direction; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    axis_i: PointLike = argument.axis("h_i", on="i")
    j: BodyLike = argument.body("j")
    axis_j: PointLike = argument.axis("h_j", on="j")


@constraint_type
class Parallel(Axes):
    """An axis of body i and an axis of body j are parallel."""

    source = "Haug 9.4"
    row_names = ("f", "g")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return f_i^T h_j and g_i^T h_j."""
        return parallel()


@constraint_type
class AxisAndPoint(SpatialConstraint):
    """A constraint of an axis of body i and a point of body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    axis_i: PointLike = argument.axis("h_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")


@constraint_type
class PointOnLine(AxisAndPoint):
    """A point on body j lies on an axis of body i."""

    source = "Haug 9.4"
    row_names = ("f", "g")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return f_i^T d and g_i^T d."""
        return on_line()


@constraint_type
class InPlane(SpatialConstraint):
    """A point on body j lies in a plane of body i, given by a point and its normal."""

    source = "Haug 9.4"
    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    normal_i: PointLike = argument.axis("h_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return h_i^T d."""
        return (dot(i.A(h_i), separation()),)


@constraint_type
class RelativeTranslation(AxisAndPoint):
    """A point on body j is at C along an axis of body i, counted from a point on the axis."""

    source = "Haug 9.4"
    sets_motion = True
    value: ValueLike = argument.value()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return h_i^T d - C."""
        return (dot(i.A(h_i), separation()) - C,)


@constraint_type
class RevoluteSpherical(AxisAndPoint):
    """A rod of length C with a hinge on body i, about an axis, and a ball on body j."""

    source = "Haug 9.4"
    row_names = ("plane", "distance")
    distance: ValueLike = argument.distance()

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return h_i^T d and d^T d - C^2."""
        d = separation()
        return dot(i.A(h_i), d), dot(d, d) - C**2


@constraint_type
class PointsAndAxes(AxisAndPoint):
    """A joint of an axis of body i and an axis of body j; the types are its subclasses."""

    axis_j: PointLike = argument.axis("h_j", on="j")


def motor(joint: PointsAndAxes | Triads, points: Mapping[str, tuple[ValueLike, ...]]) -> Constraint:
    """Return a driver of the turning about the axis of a joint."""
    f_i, h_i, f_j, h_j = (points[key] for key in ("f_i", "h_i", "f_j", "h_j"))
    return RelativeRotation(joint.name, joint.i, h_i, f_i, joint.j, h_j, f_j, 0)


def slide(joint: PointsAndAxes | Triads) -> Constraint:
    """Return a driver of the sliding along the axis of a joint."""
    return RelativeTranslation(
        joint.name, joint.i, joint.point_i, joint.axis_i, joint.j, joint.point_j, 0
    )


@constraint_type
class Revolute(PointsAndAxes):
    """Body j turns about an axis of body i: a hinge."""

    source = "Haug 9.4"
    row_names = (*XYZ, "f", "g")
    replaced_by = "a {simpler}"

    @classmethod
    def keeping_others(cls, lost: Sequence[str]) -> type[Constraint] | None:
        """Return the joint that leaves out as many of its directions and of its turns."""
        slides, turns = (sum(row in rows for row in lost) for rows in (XYZ, "fg"))
        return {(1, 0): Cylindrical, (0, 1): Universal, (0, 2): Spherical, (1, 2): PointOnLine}.get(
            (slides, turns)
        )

    def drivers(self, points: Mapping[str, tuple[ValueLike, ...]]) -> tuple[Constraint, ...]:
        """Return a motor of the hinge."""
        return (motor(self, points),)

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d, f_i^T h_j and g_i^T h_j."""
        return separation(), *parallel()


@constraint_type
class Cylindrical(PointsAndAxes):
    """Body j turns about an axis of body i and slides along it."""

    source = "Haug 9.4"
    row_names = ("parallel_f", "parallel_g", "line_f", "line_g")

    def drivers(self, points: Mapping[str, tuple[ValueLike, ...]]) -> tuple[Constraint, ...]:
        """Return a motor and a slide."""
        return motor(self, points), slide(self)

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return f_i^T h_j, g_i^T h_j, f_i^T d and g_i^T d."""
        return *parallel(), *on_line()


@constraint_type
class Planar(PointsAndAxes):
    """A plane of body j slides on a plane of body i; the axes are their normals."""

    source = "Haug 9.4"
    row_names = ("parallel_f", "parallel_g", "plane")

    def drivers(self, points: Mapping[str, tuple[ValueLike, ...]]) -> tuple[Constraint, ...]:
        """Return a motor about the normal."""
        return (motor(self, points),)

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return f_i^T h_j, g_i^T h_j and h_i^T d."""
        return *parallel(), dot(i.A(h_i), separation())


@constraint_type
class Universal(PointsAndAxes):
    """Two axes at a right angle meet in a cross: Hooke's joint."""

    source = "Haug 9.4"
    right_angle = ("h_i", "h_j")
    row_names = (*XYZ, "cross")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d and h_i^T h_j."""
        return separation(), dot(i.A(h_i), j.A(h_j))


@constraint_type
class RevoluteCylindrical(PointsAndAxes):
    """A hinge about the axis of body i meets at a right angle a slide along that of body j."""

    source = "Haug 9.4"
    right_angle = ("h_i", "h_j")
    row_names = ("cross", "line_f", "line_g")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return h_i^T h_j, f_j^T d and g_j^T d."""
        d = separation()
        return dot(i.A(h_i), j.A(h_j)), dot(j.A(f_j), d), dot(j.A(g_j), d)


@constraint_type
class Triads(SpatialConstraint):
    """A joint of a triad of body i and a triad of body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    axis_i: PointLike = argument.axis("h_i", on="i")
    cross_i: PointLike = argument.cross("f_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")
    axis_j: PointLike = argument.axis("h_j", on="j")
    cross_j: PointLike = argument.cross("f_j", on="j")


@constraint_type
class Translational(Triads):
    """Body j slides along an axis of body i without turning; its cross is at a right angle."""

    source = "Haug 9.4"
    right_angle = ("f_i", "f_j")
    row_names = ("parallel_f", "parallel_g", "line_f", "line_g", "cross")

    def drivers(self, points: Mapping[str, tuple[ValueLike, ...]]) -> tuple[Constraint, ...]:
        """Return a slide."""
        del points
        return (slide(self),)

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return the rows of a cylindrical joint and f_i^T f_j."""
        return *parallel(), *on_line(), dot(i.A(f_i), j.A(f_j))


@constraint_type
class Fixed(Triads):
    """Body j does not move on body i: the triads stay the same."""

    source = "Haug 9.4"
    row_names = (*XYZ, "f", "g", "cross")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d, f_i^T h_j, g_i^T h_j and f_i^T g_j."""
        return separation(), *parallel(), dot(i.A(f_i), j.A(g_j))


@constraint_type
class ConstantVelocity(Triads):
    """Two shafts meet in a point and turn at the same rate, whatever the angle between them.

    The axes point along both shafts the same way, from one end of the line of shafts to the other.
    Straight, the crosses are one direction; bent, body j is turned by the bend and nothing else.
    The rows also hold with one shaft turned by half a turn: the guess decides.
    """

    # It has f_i^T g_j + g_i^T f_j, for axes that both point away from the joint.
    source = "OndselSolver"
    alike = ("h_i", "h_j")
    row_names = (*XYZ, "cross")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d and g_i^T f_j - f_i^T g_j."""
        return separation(), dot(i.A(g_i), j.A(f_j)) - dot(i.A(f_i), j.A(g_j))


@constraint_type
class Turning(SpatialConstraint):
    """A constraint of the angle of a cross from another; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    axis_i: PointLike = argument.axis("h_i", on="i")
    cross_i: PointLike = argument.cross("f_i", on="i")
    j: BodyLike = argument.body("j")
    axis_j: PointLike = argument.axis("h_j", on="j")
    cross_j: PointLike = argument.cross("f_j", on="j")


@constraint_type
class RelativeRotation(Turning):
    """The angle of the cross of body j from that of body i, about the axis of body i, is C."""

    source = "Haug 9.4"
    sets_motion = True
    angle: ValueLike = argument.value("rad")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return theta - C with theta = atan2(g_i^T f_j, f_i^T f_j), the one nearest to C."""
        return (angle_from(C),)


def advance() -> Scalar:
    """Return h_i^T d - pitch alpha/(2 pi): how far body j is from where its angle alpha puts it."""
    return dot(i.A(h_i), separation()) - Symbol("pitch") * contact_i.alpha / (2 * Pi())


@constraint_type
class Screw(Triads, CamConstraint):
    """Body j turns about an axis of body i and advances by the pitch in each turn.

    Its angle is a coordinate ``theta_<name>``, from the cross of body i to that of body j over any
    number of turns; so a motion keeps its turn. The points coincide where the angle is zero.
    """

    source = "Haug 9.4"
    row_names = ("parallel_f", "parallel_g", "line_f", "line_g", "turn", "advance")
    contacts = (contact_i,)
    contact_letter = "theta"
    driven_by = RelativeRotation
    pitch: ValueLike = argument.radius("pitch", "Advance in one turn")

    def drivers(self, points: Mapping[str, tuple[ValueLike, ...]]) -> tuple[Constraint, ...]:
        """Return a motor of the spindle."""
        return (motor(self, points),)

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return the rows of a cylindrical joint, theta - alpha and h_i^T d - pitch alpha/(2 pi).

        Of all angles theta it is the one nearest to the coordinate alpha.
        """
        return *parallel(), *on_line(), angle_from(contact_i.alpha), advance()

    @staticmethod
    def beside_driver() -> tuple[Expression, ...]:
        """Return the same with the angle theta that is nearest to the driver's C."""
        return *parallel(), *on_line(), angle_from_driver(), advance()

    @property
    def theta(self) -> sympy.Symbol:
        """Symbol of the angle."""
        return self.alpha


@constraint_type
class JointAngle(Turning, CamConstraint):
    """A coordinate ``theta_<name>``, the angle of a hinge over any number of turns.

    It counts from the cross of body i to that of body j, about the axis of body i. `theta` is its
    symbol, for free equations and outputs.
    """

    source = "own"
    contacts = (contact_i,)
    contact_letter = "theta"
    driven_by = RelativeRotation

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return theta - alpha: of all angles theta the one nearest to the coordinate alpha."""
        return (angle_from(contact_i.alpha),)

    @staticmethod
    def beside_driver() -> tuple[Expression, ...]:
        """Return theta - alpha: of all angles theta the one nearest to the driver's C."""
        return (angle_from_driver(),)

    @property
    def theta(self) -> sympy.Symbol:
        """Symbol of the angle."""
        return self.alpha
