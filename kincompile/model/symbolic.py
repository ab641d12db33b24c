"""A vector expression in SymPy: the leaves of a template in the user's own names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import sympy

from kincompile.model.expressions import Scalar, alpha, as_sympy, t
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Mapping
    from fractions import Fraction

    from kincompile.calculus import expressions as ex
    from kincompile.calculus.expand import Expansion
    from kincompile.calculus.symbols import CoordinateSymbol
    from kincompile.calculus.template import Template


class Bound(Protocol):
    """A template with what its symbols stand for: a joint, or a point of a body."""

    @property
    def template(self) -> Template:
        """The vectors."""

    @property
    def columns(self) -> tuple[str | None, ...]:
        """Names of the coordinates, None for those of the ground."""

    @property
    def scalars(self) -> Mapping[str, Scalar]:
        """Scalar attributes by symbol."""

    @property
    def points(self) -> Mapping[str, tuple[Scalar, ...]]:
        """Points and directions by symbol."""

    @property
    def profiles(self) -> Mapping[str, sympy.Expr]:
        """Profiles of cams by symbol."""


class SymbolicEnvironment:
    """The leaves of a template as SymPy expressions."""

    def __init__(self, bound: Bound) -> None:
        self._bound = bound
        self._motion: dict[CoordinateSymbol, tuple[sympy.Expr, ...]] = {}
        names = iter(bound.columns)
        values = iter([value for item in bound.template.owners for value in item.ground])
        for item, item_rate in zip(bound.template.coordinates, bound.template.rates, strict=True):
            own = [(next(names), next(values)) for _ in range(item.size)]
            self._motion[item] = tuple(_symbol(name, value) for name, value in own)
            self._motion[item_rate] = tuple(_symbol(name and rate(name)) for name, _ in own)

    def number(self, value: Fraction) -> ex.Value:
        """Return an exact number."""
        return sympy.Rational(value.numerator, value.denominator)

    def pi(self) -> ex.Value:
        """Return pi."""
        return sympy.pi

    def symbol(self, symbol: ex.Symbol) -> ex.Value:
        """Return a coordinate, a rate or a scalar attribute."""
        if symbol in self._motion:
            return self._motion[symbol][0]
        return as_sympy(self._bound.scalars[symbol.name])

    def vector(self, symbol: ex.VectorSymbol) -> ex.Components:
        """Return a position, a velocity or a body-fixed point.

        A vector that is given by name among the points is that, also where it is a rate: omega'.
        """
        if symbol in self._motion and symbol.name not in self._bound.points:
            return self._motion[symbol]
        return tuple(as_sympy(value) for value in self._bound.points[symbol.name])

    def time_function(self, function: ex.TimeFunction) -> ex.Value:
        """Return C(t) or one of its derivatives."""
        return as_sympy(self._bound.scalars[function.name]).diff(t, function.order)

    def profile(self, profile: ex.ProfileFunction) -> ex.Value:
        """Return rho(alpha) or one of its derivatives at the contact parameter."""
        rho = self._bound.profiles[profile.name].diff(alpha, profile.order)
        return rho.subs(alpha, self.symbol(profile.argument))

    def entries(self, rotation: ex.Rotation, expand: Expansion) -> ex.Components:
        """Return the numbers that all vectors share that a rotation turns."""
        return expand.entries(rotation)

    def call(self, function: str, *values: ex.Value) -> ex.Value:
        """Return an elementary function."""
        return getattr(sympy, function)(*values)


def _symbol(name: str | None, ground: int = 0) -> sympy.Expr:
    return sympy.Integer(ground) if name is None else sympy.Symbol(name)
