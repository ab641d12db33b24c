"""Named points of bodies, whose coordinates and rates are expressions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import sympy

from kincompile.model.expressions import as_sympy

if TYPE_CHECKING:
    from kincompile.model.bodies import Body
    from kincompile.model.expressions import Scalars


class rate(sympy.Function):  # noqa: N801 - a function for those who write expressions
    """The time derivative of an expression along the motion, in an output.

    ``kc.outputs.rate(foot.x)`` is the velocity of a point along x, the rate of that its
    acceleration.
    """

    nargs = 1


@dataclass(frozen=True, slots=True)
class BodyPoint:
    """A named point P of a body, at (xi, eta) in its frame [length]; made by `Mechanism.point`.

    It may stand where a joint wants a body and a point on it, ``Revolute("B", foot, rod, (0, 0))``.
    A solution has its columns ``x_foot`` and ``y_foot``, which are called ``foot.x`` and ``foot.y``
    too, and their rates.
    """

    name: str
    body: Body
    local: Scalars

    def _coordinate(self, row: int) -> sympy.Expr:
        """Return an entry of r + A s."""
        body = self.body
        try:
            xi, eta = (as_sympy(value) for value in self.local)
        except (TypeError, ValueError, sympy.SympifyError):
            return sympy.S.Zero  # the check of the mechanism says what is wrong with it
        c, s = sympy.cos(body.phi), sympy.sin(body.phi)
        return cast("sympy.Expr", (body.x + c * xi - s * eta, body.y + s * xi + c * eta)[row])

    @property
    def x(self) -> sympy.Expr:
        """Its global x coordinate as an expression."""
        return self._coordinate(0)

    @property
    def y(self) -> sympy.Expr:
        """Its global y coordinate as an expression."""
        return self._coordinate(1)

    @property
    def x_dot(self) -> sympy.Expr:
        """Its velocity along x, for outputs."""
        return cast("sympy.Expr", rate(self.x))

    @property
    def y_dot(self) -> sympy.Expr:
        """Its velocity along y, for outputs."""
        return cast("sympy.Expr", rate(self.y))
