"""Bodies, the ground and parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import sympy

from kincompile.names import body_coordinates, rate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.expressions import Scalars


@dataclass(frozen=True, slots=True)
class Body:
    """A planar rigid body with coordinates x, y [length] of its origin and angle phi [rad].

    Made by `Mechanism.body`; the ground is `Mechanism.ground`. The corners of its outline, in its
    own frame, are for pictures alone.
    """

    name: str
    guess: Scalars = (0, 0, 0)
    outline: Sequence[Scalars] = ()
    is_ground: bool = field(default=False, kw_only=True)

    def _coordinate(self, index: int) -> sympy.Expr:
        if self.is_ground:
            return sympy.S.Zero
        return sympy.Symbol(body_coordinates(self.name)[index])

    def _rate(self, index: int) -> sympy.Expr:
        if self.is_ground:
            return sympy.S.Zero
        return sympy.Symbol(rate(body_coordinates(self.name)[index]))

    @property
    def x(self) -> sympy.Expr:
        """Symbol of the x coordinate of the body's origin."""
        return self._coordinate(0)

    @property
    def y(self) -> sympy.Expr:
        """Symbol of the y coordinate of the body's origin."""
        return self._coordinate(1)

    @property
    def phi(self) -> sympy.Expr:
        """Symbol of the body's angle."""
        return self._coordinate(2)

    @property
    def x_dot(self) -> sympy.Expr:
        """Symbol of the rate of x."""
        return self._rate(0)

    @property
    def y_dot(self) -> sympy.Expr:
        """Symbol of the rate of y."""
        return self._rate(1)

    @property
    def phi_dot(self) -> sympy.Expr:
        """Symbol of the angular velocity."""
        return self._rate(2)


GROUND = Body("ground", is_ground=True)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that may change at run time without recompiling."""

    name: str
    default: float | None
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Coordinate:
    """A generalised coordinate: its name, the guess where Newton starts, and its unit."""

    name: str
    guess: float
    unit: str = ""
