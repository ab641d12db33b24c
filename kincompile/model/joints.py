"""Revolute and translational joints, and the composite joints made of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.calculus.expressions import Expression, Norm, dot, perpendicular
from kincompile.calculus.symbols import C, i, j, s_i, s_j, v_i, v_j
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, PointLike, ValueLike
from kincompile.model.constraint import Constraint, constraint_type
from kincompile.model.relative import (
    PointToPoint,
    RelativeAngle,
    RelativeX,
    RelativeY,
    separation,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.expressions import Scalar


@constraint_type
class Revolute(PointToPoint):
    """A point on body i and a point on body j coincide."""

    source = "Haug 3.3.10"
    known_as = "pin, pin joint, hinge, bearing, turning pair, R joint, pivot"
    positive = "It has no value. Exchanging i and j turns the signs of its rows."
    use = (
        'crank, rod = m.body("crank", guess=(1, 0.7, 0.6)), m.body("rod", guess=(2.8, 0.9, -0.3))',
        'm.add(kc.Revolute("A", crank, (1, 0), rod, (-1, 0)))',
    )
    row_names = ("x", "y")
    simpler = (("x", RelativeY), ("y", RelativeX))
    replaced_by = (
        "a point on a line: a {simpler} with value 0 keeps {kept}, a RevoluteTranslational or a "
        "Distance does as well"
    )

    def measured(self, points: Mapping[str, tuple[Scalar, ...]]) -> Constraint:
        """Return a driver of the angle of body j from body i."""
        del points
        return RelativeAngle(self.name, self.i, self.j, 0)

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i s_i - r_j - A_j s_j."""
        return (i.point(s_i) - j.point(s_j),)


@constraint_type
class PointAndAxis(Constraint):
    """A constraint of an axis of body i and a point on body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    axis_i: PointLike = argument.axis("v_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")
    distance: ValueLike = argument.value()


@constraint_type
class RevoluteTranslational(PointAndAxis):
    """A point on body j keeps the distance C from an axis of body i, counted to its left."""

    source = "Haug 3.3"
    known_as = (
        "slot, pin in a slot, pin in a straight slot, sliding block with a pin, half joint, "
        "Scotch yoke"
    )
    positive = "C counts to the left of axis_i, looking along it; 0 puts the point on the axis."
    use = (
        'lever, crank = m.body("lever", guess=(1, 0.6, 0.35)), '
        'm.body("crank", guess=(2.6, 1.8, 0.9))',
        'm.add(kc.RevoluteTranslational("slot", lever, (0, 0), (1, 0), crank, (-0.6, 0), 0))',
    )

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (R A_i v_i)^T d / |v_i| - C."""
        return (dot(perpendicular(i.A(v_i)), separation()) / Norm(v_i) - C,)


@constraint_type
class TranslationalDistance(PointAndAxis):
    """A point on body j is at C along an axis of body i, counted from a point on the axis."""

    source = "Haug 3.5"
    sets_motion = True
    known_as = "stroke, linear drive, piston drive, cylinder in a telescope"
    positive = "C counts along axis_i, from point_i."
    use = (
        'boom, stick = m.body("boom", guess=(1, 0.6, 0.3)), m.body("stick", guess=(3.0, 1.5, 0.6))',
        'm.add(kc.TranslationalDistance("stroke", boom, (0, 0), (1, 0), stick, (-0.5, 0), 1.5))',
    )

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (A_i v_i)^T d / |v_i| - C."""
        return (dot(i.A(v_i), separation()) / Norm(v_i) - C,)


@constraint_type
class Translational(Constraint):
    """Body j slides along an axis of body i without turning: the two axes stay on one line."""

    source = "Haug 3.3.13"
    known_as = (
        "slider, prismatic joint, sliding pair, P joint, guide, rail, linear bearing, telescope"
    )
    positive = (
        "It has no value: the way along the axis is free. The axes may point alike or "
        "oppositely; the guess decides."
    )
    use = (
        'boom, stick = m.body("boom", guess=(1, 0.6, 0.3)), m.body("stick", guess=(2.9, 1.3, 0.3))',
        'm.add(kc.Translational("guide", boom, (0.5, 0), (1, 0), stick, (-0.3, 0), (1, 0)))',
    )
    row_names = ("normal", "parallel")
    simpler = (("normal", RelativeAngle), ("parallel", RevoluteTranslational))
    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    axis_i: PointLike = argument.axis("v_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")
    axis_j: PointLike = argument.axis("v_j", on="j")

    def measured(self, points: Mapping[str, tuple[Scalar, ...]]) -> Constraint:
        """Return a driver of the way of the point of body j along the axis of body i."""
        del points
        sides = self.i, self.point_i, self.axis_i, self.j, self.point_j
        return TranslationalDistance(self.name, *sides, 0)

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (R A_i v_i)^T d and (R A_i v_i)^T A_j v_j."""
        normal = perpendicular(i.A(v_i))
        return dot(normal, separation()), dot(normal, j.A(v_j))
