"""Expansion of a vector expression to components, over any values that add and multiply.

The same walk gives SymPy expressions (`ConstraintSystem.Phi`), straight-line code (the kernels) and
plain numbers: what the leaves are is the environment's business.
"""

from __future__ import annotations

from fractions import Fraction
from functools import reduce
from operator import add, mul
from typing import TYPE_CHECKING, Protocol

from kincompile.calculus.expressions import (
    Angle,
    Basis,
    Circular,
    Cross,
    Dot,
    Expression,
    Norm,
    Number,
    Perpendicular,
    Pi,
    Power,
    Product,
    ProfileFunction,
    Root,
    Rotated,
    Scalar,
    Scaled,
    Sum,
    Symbol,
    TimeFunction,
    TimesG,
    Vector,
    VectorSum,
    VectorSymbol,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.calculus.expressions import Components, Rotation, Value


class Environment(Protocol):
    """What the leaves of an expression stand for."""

    def number(self, value: Fraction) -> Value:
        """Return an exact number."""

    def pi(self) -> Value:
        """Return pi."""

    def symbol(self, symbol: Symbol) -> Value:
        """Return a scalar symbol."""

    def vector(self, symbol: VectorSymbol) -> Components:
        """Return the components of a vector symbol."""

    def time_function(self, function: TimeFunction) -> Value:
        """Return C(t) or one of its derivatives."""

    def profile(self, profile: ProfileFunction) -> Value:
        """Return rho(alpha) or one of its derivatives at the contact parameter."""

    def entries(self, rotation: Rotation, expand: Expansion) -> Components:
        """Return the numbers that all vectors share that a rotation turns."""

    def call(self, function: str, *values: Value) -> Value:
        """Return cosine (``"cos"``), sine, square root (``"sqrt"``) or ``"atan2"`` of y and x."""


class Expansion:
    """Components of expressions in one environment; a subexpression met twice is expanded once.

    `size` is the number of components of a vector of which nothing is left, zero.
    """

    def __init__(self, environment: Environment, size: int = 2) -> None:
        self.environment = environment
        self._size = size
        self.scalars: dict[Scalar, Value] = {}
        self.vectors: dict[Vector, Components] = {}

    def components(self, expression: Expression) -> Components:
        """Return the one component of a scalar or those of a vector."""
        if isinstance(expression, Scalar):
            return (self.scalar(expression),)
        return self.vector(expression)

    def scalar(self, expression: Scalar) -> Value:
        """Return the value of a scalar expression."""
        if expression not in self.scalars:
            self.scalars[expression] = self._scalar(expression)
        return self.scalars[expression]

    def vector(self, expression: Vector) -> Components:
        """Return the components of a vector expression."""
        if expression not in self.vectors:
            self.vectors[expression] = self._vector(expression)
        return self.vectors[expression]

    def entries(self, rotation: Rotation) -> Components:
        """Return the numbers that all vectors share that a rotation turns."""
        coordinates = tuple(self.components(item) for item in rotation.coordinates)
        return rotation.entries(coordinates, self.environment.call)

    def _scalar(self, expression: Scalar) -> Value:
        environment = self.environment
        match expression:
            case Number(value):
                return environment.number(value)
            case Pi():
                return environment.pi()
            case Symbol():
                return environment.symbol(expression)
            case TimeFunction():
                return environment.time_function(expression)
            case ProfileFunction():
                return environment.profile(expression)
            case Sum(terms):
                return self._total([self.scalar(term) for term in terms])
            case Product(factors):
                return self._product(factors)
            case Power(base, exponent):
                return self.scalar(base) ** exponent
            case Norm(vector):
                squares = [item**2 for item in self.vector(vector)]
                return environment.call("sqrt", reduce(add, squares))
            case Root(square):
                return environment.call("sqrt", self.scalar(square))
            case Circular(name, argument):
                return environment.call(name, self.scalar(argument))
            case Angle(sine, cosine):
                return environment.call("atan2", self.scalar(sine), self.scalar(cosine))
            case Dot(left, right):
                return reduce(add, map(mul, self.vector(left), self.vector(right)))
        raise TypeError(f"not a scalar expression: {expression!r}")

    def _product(self, factors: tuple[Scalar, ...]) -> Value:
        first, *rest = factors
        if first == Number(Fraction(-1)):
            return -self._product(tuple(rest))
        value = self.scalar(first)
        for factor in rest:
            value = value * self.scalar(factor)
        return value

    def _vector(self, expression: Vector) -> Components:
        environment = self.environment
        match expression:
            case VectorSymbol():
                return environment.vector(expression)
            case Basis(axis, size):
                return tuple(environment.number(Fraction(k == axis)) for k in range(size))
            case Rotated(rotation, vector, along):
                return rotation.components(
                    environment.entries(rotation, self),
                    self.vector(vector),
                    tuple(self.components(item) for item in along),
                    self.components,
                )
            case Perpendicular(vector):
                x, y = self.vector(vector)
                return -y, x
            case Cross(left, right):
                return cross_product(self.vector(left), self.vector(right))
            case TimesG(p, vector, is_transposed):
                return times_g(self.vector(p), self.vector(vector), is_transposed)
            case VectorSum(()):
                return (environment.number(Fraction(0)),) * self._size
            case VectorSum(terms):
                parts = zip(*(self.vector(term) for term in terms), strict=True)
                return tuple(self._total(part) for part in parts)
            case Scaled(Number(value), vector) if value == -1:
                return tuple(-item for item in self.vector(vector))
            case Scaled(factor, vector):
                value, inner = self.scalar(factor), self.vector(vector)
                return tuple(value * item for item in inner)
        raise TypeError(f"not a vector expression: {expression!r}")

    def _total(self, values: Sequence[Value]) -> Value:
        return reduce(add, values) if values else self.environment.number(Fraction(0))


def cross_product(left: Components, right: Components) -> Components:
    """Return the vector product of two vectors of three components."""
    (a1, a2, a3), (b1, b2, b3) = left, right
    return a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1


def times_g(p: Components, vector: Components, is_transposed: bool) -> Components:
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
