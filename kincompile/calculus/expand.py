"""Expansion of a vector expression to components, over any values that add and multiply.

The same walk gives SymPy expressions (`ConstraintSystem.Phi`), straight-line code (the kernels) and
plain numbers: what the leaves are is the environment's business.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any, Protocol

from kincompile.calculus.expressions import (
    Basis,
    Dot,
    Expression,
    Norm,
    Number,
    Perpendicular,
    Pi,
    Power,
    Product,
    Profile,
    Scalar,
    Scaled,
    Sum,
    Symbol,
    TimeFunction,
    Turned,
    Vector,
    VectorSum,
    VectorSymbol,
)

Value = Any
Pair = tuple[Value, Value]


class Environment(Protocol):
    """What the leaves of an expression stand for."""

    def number(self, value: Fraction) -> Value:
        """Return an exact number."""

    def pi(self) -> Value:
        """Return pi."""

    def symbol(self, name: str) -> Value:
        """Return a scalar symbol."""

    def vector(self, name: str) -> Pair:
        """Return the two components of a vector symbol."""

    def time_function(self, name: str, order: int) -> Value:
        """Return C(t) or one of its derivatives."""

    def profile(self, name: str, order: int) -> Value:
        """Return rho(alpha) or one of its derivatives at the contact parameter."""

    def cos_sin(self, angle: Scalar, expand: Expansion) -> Pair:
        """Return cosine and sine of an angle."""

    def sqrt(self, value: Value) -> Value:
        """Return a square root."""


class Expansion:
    """Components of expressions in one environment; a subexpression met twice is expanded once."""

    def __init__(self, environment: Environment) -> None:
        self._environment = environment
        self._scalars: dict[Scalar, Value] = {}
        self.vectors: dict[Vector, Pair] = {}

    def components(self, expression: Expression) -> tuple[Value, ...]:
        """Return the one component of a scalar or the two of a vector."""
        if isinstance(expression, Scalar):
            return (self.scalar(expression),)
        return self.vector(expression)

    def scalar(self, expression: Scalar) -> Value:
        """Return the value of a scalar expression."""
        if expression not in self._scalars:
            self._scalars[expression] = self._scalar(expression)
        return self._scalars[expression]

    def vector(self, expression: Vector) -> Pair:
        """Return the components of a vector expression."""
        if expression not in self.vectors:
            self.vectors[expression] = self._vector(expression)
        return self.vectors[expression]

    def _scalar(self, expression: Scalar) -> Value:
        environment = self._environment
        match expression:
            case Number(value):
                return environment.number(value)
            case Pi():
                return environment.pi()
            case Symbol(name):
                return environment.symbol(name)
            case TimeFunction(name, order):
                return environment.time_function(name, order)
            case Profile(name, _, order):
                return environment.profile(name, order)
            case Sum(terms):
                return _total([self.scalar(term) for term in terms], environment)
            case Product(factors):
                return self._product(factors)
            case Power(base, exponent):
                return self.scalar(base) ** exponent
            case Norm(vector):
                x, y = self.vector(vector)
                return environment.sqrt(x**2 + y**2)
            case Dot(left, right):
                (a, b), (x, y) = self.vector(left), self.vector(right)
                return a * x + b * y
        raise TypeError(f"not a scalar expression: {expression!r}")

    def _product(self, factors: tuple[Scalar, ...]) -> Value:
        first, *rest = factors
        if first == Number(Fraction(-1)):
            return -self._product(tuple(rest))
        value = self.scalar(first)
        for factor in rest:
            value = value * self.scalar(factor)
        return value

    def _vector(self, expression: Vector) -> Pair:
        environment = self._environment
        match expression:
            case VectorSymbol(name):
                return environment.vector(name)
            case Basis():
                return environment.number(Fraction(1)), environment.number(Fraction(0))
            case Turned(angle, vector, 1):
                x, y = self.vector(Turned(angle, vector))
                return -y, x
            case Turned(angle, vector, _):
                cosine, sine = environment.cos_sin(angle, self)
                x, y = self.vector(vector)
                return x * cosine - y * sine, x * sine + y * cosine
            case Perpendicular(vector):
                x, y = self.vector(vector)
                return -y, x
            case VectorSum(terms):
                pairs = [self.vector(term) for term in terms]
                xs, ys = [x for x, _ in pairs], [y for _, y in pairs]
                return _total(xs, environment), _total(ys, environment)
            case Scaled(Number(value), vector) if value == -1:
                x, y = self.vector(vector)
                return -x, -y
            case Scaled(factor, vector):
                value, (x, y) = self.scalar(factor), self.vector(vector)
                return value * x, value * y
        raise TypeError(f"not a vector expression: {expression!r}")


def _total(values: list[Value], environment: Environment) -> Value:
    if not values:
        return environment.number(Fraction(0))
    total = values[0]
    for value in values[1:]:
        total = total + value
    return total
