"""Points of bodies in space, whose coordinates and rates are expressions."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, cast

from kincompile.calculus.space import i
from kincompile.model import declared as kinds
from kincompile.model.declared import declared, given
from kincompile.model.points import BodyPoint, PointCoordinate, rate

if TYPE_CHECKING:
    import sympy

    from kincompile.calculus.symbols import Frame
    from kincompile.model.expressions import Scalars


class SpatialCoordinate(PointCoordinate):
    """A global coordinate of a point, of the body's, its Euler parameters and xi, eta, zeta."""

    nargs = 8
    frame: ClassVar[Frame] = i


class point_x(SpatialCoordinate):  # noqa: N801
    """The x coordinate of a point of a body at x."""

    row = 0


class point_y(SpatialCoordinate):  # noqa: N801
    """The y coordinate of a point of a body at y."""

    row = 1


class point_z(SpatialCoordinate):  # noqa: N801
    """The z coordinate of a point of a body at z."""

    row = 2


@declared(slots=True)
class SpatialPoint(BodyPoint):
    """A named point P of a body, at (xi, eta, zeta) in its frame [length]; made by `point`.

    It may stand where a joint wants a body and a point on it. A solution has its columns
    ``x_foot``, ``y_foot``, ``z_foot``, which are called ``foot.x`` and so on too, and their rates.
    """

    local: Scalars = given(
        kinds.components(3, words="[xi, eta, zeta]"), "Its place in the body's frame.",
        unit="length",
    )  # fmt: skip

    functions: ClassVar[tuple[type[PointCoordinate], ...]] = (point_x, point_y, point_z)

    @property
    def z(self) -> sympy.Expr:
        """Its global z coordinate as an expression."""
        return self.coordinates[2]

    @property
    def z_dot(self) -> sympy.Expr:
        """Its velocity along z, for outputs."""
        return cast("sympy.Expr", rate(self.z))
