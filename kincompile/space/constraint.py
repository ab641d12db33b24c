"""What spatial constraint types share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PointLike
from kincompile.model.constraint import Constraint, constraint_type
from kincompile.space.bodies import SPATIAL
from kincompile.space.triads import with_triads

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.expressions import Scalar


class SpatialConstraint(Constraint):
    """A constraint of bodies in space; every type is a subclass."""

    bodies = SPATIAL

    @staticmethod
    def completed(
        points: Mapping[str, tuple[Scalar, ...]], defaults: Mapping[str, float]
    ) -> Mapping[str, tuple[Scalar, ...]]:
        """Return the points and directions with the triads about the axes."""
        return with_triads(points, defaults)


@constraint_type
class SpatialPoints(SpatialConstraint):
    """A constraint of a point on body i and a point on body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PointLike = argument.point("s_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PointLike = argument.point("s_j", on="j")
