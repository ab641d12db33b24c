"""Limits of joints in space: of a hinge with the directions from which its angle counts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.model import declared as kinds
from kincompile.model.declared import declared, given
from kincompile.model.limits import JointLimit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.expressions import Scalar
    from kincompile.model.resolve import Joint

_CROSS = kinds.components(3, words="[xi, eta, zeta]")


@declared
class SpatialLimit(JointLimit):
    """The least and the greatest value of a joint or a driver; made by `spatial.Mechanism.limit`.

    The angle of a hinge is that from `cross_i` to `cross_j`, about the axis on body i. Without,
    they are the axes of the bodies that are farthest from its axis.
    """

    cross_i: Any = given(
        _CROSS, "Of a hinge: direction on body i from which its angle counts.", default=None
    )
    cross_j: Any = given(
        _CROSS, "Of a hinge: the direction on body j to which it counts.", default=None
    )

    def seen(self, joint: Joint) -> Mapping[str, tuple[Scalar, ...]]:
        """Return the points and directions of a joint, by which its value counts."""
        crosses = {"f_i": self.cross_i, "f_j": self.cross_j}
        return {**joint.points, **{key: x for key, x in crosses.items() if x is not None}}
