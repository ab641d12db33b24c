"""Expansion of a vector expression to components, over any values that add and multiply.

The same walk gives SymPy expressions (`ConstraintSystem.Phi`), straight-line code (the kernels) and
plain numbers: what the leaves are is the environment's business.
"""

from __future__ import annotations

from fractions import Fraction
from functools import reduce
from operator import add, mul
from typing import TYPE_CHECKING, Protocol

from kincompile.calculus import expressions as ex

if TYPE_CHECKING:
    from collections.abc import Sequence


class Environment(Protocol):
    """What the leaves of an expression stand for."""

    def number(self, value: Fraction) -> ex.Value:
        """Return an exact number."""

    def pi(self) -> ex.Value:
        """Return pi."""

    def symbol(self, symbol: ex.Symbol) -> ex.Value:
        """Return a scalar symbol."""

    def vector(self, symbol: ex.VectorSymbol) -> ex.Components:
        """Return the components of a vector symbol."""

    def time_function(self, function: ex.TimeFunction) -> ex.Value:
        """Return C(t) or one of its derivatives."""

    def profile(self, profile: ex.ProfileFunction) -> ex.Value:
        """Return rho(alpha) or one of its derivatives at the contact parameter."""

    def entries(self, rotation: ex.Rotation, expand: Expansion) -> ex.Components:
        """Return the numbers that all vectors share that a rotation turns."""

    def call(self, function: str, *values: ex.Value) -> ex.Value:
        """Return cosine (``"cos"``), sine, square root (``"sqrt"``) or ``"atan2"`` of y and x."""


class Expansion:
    """Components of expressions in one environment; a subexpression met twice is expanded once.

    `size` is the number of components of a vector of which nothing is left, zero.
    """

    def __init__(self, environment: Environment, size: int = 2) -> None:
        self.environment = environment
        self._size = size
        self.scalars: dict[ex.Scalar, ex.Value] = {}
        self.vectors: dict[ex.Vector, ex.Components] = {}

    def components(self, expression: ex.Expression) -> ex.Components:
        """Return the one component of a scalar or those of a vector."""
        if isinstance(expression, ex.Scalar):
            return (self.scalar(expression),)
        return self.vector(expression)

    def scalar(self, expression: ex.Scalar) -> ex.Value:
        """Return the value of a scalar expression."""
        if expression not in self.scalars:
            self.scalars[expression] = self._scalar(expression)
        return self.scalars[expression]

    def vector(self, expression: ex.Vector) -> ex.Components:
        """Return the components of a vector expression."""
        if expression not in self.vectors:
            self.vectors[expression] = self._vector(expression)
        return self.vectors[expression]

    def entries(self, rotation: ex.Rotation) -> ex.Components:
        """Return the numbers that all vectors share that a rotation turns."""
        coordinates = tuple(self.components(item) for item in rotation.coordinates)
        return rotation.entries(coordinates, self.environment.call)

    def _scalar(self, expression: ex.Scalar) -> ex.Value:
        environment = self.environment
        match expression:
            case ex.Number(value):
                return environment.number(value)
            case ex.Pi():
                return environment.pi()
            case ex.Symbol():
                return environment.symbol(expression)
            case ex.TimeFunction():
                return environment.time_function(expression)
            case ex.ProfileFunction():
                return environment.profile(expression)
            case ex.Sum(terms):
                return self._total([self.scalar(term) for term in terms])
            case ex.Product(factors):
                return self._product(factors)
            case ex.Power(base, exponent):
                return self.scalar(base) ** exponent
            case ex.Norm(vector):
                squares = [item**2 for item in self.vector(vector)]
                return environment.call("sqrt", reduce(add, squares))
            case ex.Root(square):
                return environment.call("sqrt", self.scalar(square))
            case ex.Circular(name, argument):
                return environment.call(name, self.scalar(argument))
            case ex.Angle(sine, cosine):
                return environment.call("atan2", self.scalar(sine), self.scalar(cosine))
            case ex.Dot(left, right):
                return reduce(add, map(mul, self.vector(left), self.vector(right)))
        raise TypeError(f"not a scalar expression: {expression!r}")

    def _product(self, factors: tuple[ex.Scalar, ...]) -> ex.Value:
        first, *rest = factors
        if first == ex.Number(Fraction(-1)):
            return -self._product(tuple(rest))
        value = self.scalar(first)
        for factor in rest:
            value = value * self.scalar(factor)
        return value

    def _vector(self, expression: ex.Vector) -> ex.Components:
        environment = self.environment
        match expression:
            case ex.VectorSymbol():
                return environment.vector(expression)
            case ex.Basis(axis, size):
                return tuple(environment.number(Fraction(k == axis)) for k in range(size))
            case ex.Rotated(rotation, vector, along):
                return rotation.components(
                    environment.entries(rotation, self),
                    self.vector(vector),
                    tuple(self.components(item) for item in along),
                    self.components,
                )
            case ex.Perpendicular(vector):
                x, y = self.vector(vector)
                return -y, x
            case ex.Cross(left, right):
                return cross_product(self.vector(left), self.vector(right))
            case ex.TimesG(p, vector, is_transposed):
                return times_g(self.vector(p), self.vector(vector), is_transposed)
            case ex.VectorSum(()):
                return (environment.number(Fraction(0)),) * self._size
            case ex.VectorSum(terms):
                parts = zip(*(self.vector(term) for term in terms), strict=True)
                return tuple(self._total(part) for part in parts)
            case ex.Scaled(ex.Number(value), vector) if value == -1:
                return tuple(-item for item in self.vector(vector))
            case ex.Scaled(factor, vector):
                value, inner = self.scalar(factor), self.vector(vector)
                return tuple(value * item for item in inner)
        raise TypeError(f"not a vector expression: {expression!r}")

    def _total(self, values: Sequence[ex.Value]) -> ex.Value:
        return reduce(add, values) if values else self.environment.number(Fraction(0))


def cross_product(left: ex.Components, right: ex.Components) -> ex.Components:
    """Return the vector product of two vectors of three components."""
    (a1, a2, a3), (b1, b2, b3) = left, right
    return a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1


def times_g(p: ex.Components, vector: ex.Components, is_transposed: bool) -> ex.Components:
    """Return G v or G^T v of Euler parameters p, G = [-e, -e~ + e0 I]."""
    e0, e1, e2, e3 = p
    if is_transposed:
        a, b, c = vector
        first = -(e1 * a + e2 * b + e3 * c)
        return (
            first, e0 * a + e2 * c - e3 * b, e0 * b + e3 * a - e1 * c, e0 * c + e1 * b - e2 * a
        )  # fmt: skip
    w, a, b, c = vector
    return (
        e0 * a - e1 * w + e3 * b - e2 * c,
        e0 * b - e2 * w + e1 * c - e3 * a,
        e0 * c - e3 * w + e2 * a - e1 * b,
    )
