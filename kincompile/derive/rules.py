"""The rules of differentiation, on scalars and vectors.

They are dA/dphi = B = R A, dB/dphi = -A, and the sum, product and chain rule. Whoever wants to see
which of them fired, and on what, hands in a list that records it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    ZERO_VECTOR,
    Dot,
    Expression,
    Perpendicular,
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
    dot,
    perpendicular,
    power_of,
    product_of,
    scaled,
    sum_of,
    turned,
    vector_sum,
)

Direction = Mapping[Expression, Expression]
"""What each leaf becomes when differentiated; a leaf that is absent is held constant."""

TIME = Symbol("t")
"""The key that stands for time in a direction."""


class Rule(Enum):
    """A rule of differentiation; the value says it in words."""

    SUM = "sum rule"
    PRODUCT = "product rule"
    CHAIN = "chain rule"
    A_TO_B = "dA/dphi = B"
    B_TO_A = "dB/dphi = -A"
    CONSTANT = "constant"
    COORDINATE = "coordinate"
    DRIVER = "driver: C(t) to its time derivative"
    PROFILE = "profile: rho(alpha) to its derivative"


@dataclass(frozen=True, slots=True)
class Step:
    """One application of a rule."""

    rule: Rule
    expression: Expression
    derivative: Expression


Record = list[Step] | None
"""Steps as they happen, inside out; None where nobody looks."""


def derivative(expression: Scalar, direction: Direction, record: Record = None) -> Scalar:
    """Differentiate a scalar along a direction.

    With ``{phi_i: 1}`` it is the partial derivative by phi_i; with the rates,
    ``{r_i: r_i_dot, phi_i: phi_i_dot, ...}``, it is Phi_q q_dot; a driver C(t) differentiates to
    its next order where the direction holds the time.
    """
    rule, result = _scalar(expression, direction, record)
    if record is not None:
        record.append(Step(rule, expression, result))
    return result


def _scalar(expression: Scalar, direction: Direction, record: Record) -> tuple[Rule, Scalar]:
    match expression:
        case Sum(terms):
            return Rule.SUM, sum_of(tuple(derivative(term, direction, record) for term in terms))
        case Product(factors):
            return Rule.PRODUCT, sum_of(
                tuple(
                    product_of(
                        (*factors[:k], derivative(factor, direction, record), *factors[k + 1 :])
                    )
                    for k, factor in enumerate(factors)
                )
            )
        case Power(base, exponent):
            outer = exponent * power_of(base, exponent - 1)
            return Rule.CHAIN, outer * derivative(base, direction, record)
        case Dot(left, right) if left == right:
            return Rule.PRODUCT, 2 * dot(left, vector_derivative(right, direction, record))
        case Dot(left, right):
            return Rule.PRODUCT, dot(vector_derivative(left, direction, record), right) + dot(
                left, vector_derivative(right, direction, record)
            )
        case Profile(name, argument, order):
            inner = derivative(argument, direction, record)
            return Rule.PROFILE, Profile(name, argument, order + 1) * inner
        case TimeFunction(name, order) if TIME in direction:
            return Rule.DRIVER, TimeFunction(name, order + 1)
    change = direction.get(expression)
    if change is None:
        return Rule.CONSTANT, ZERO
    assert isinstance(change, Scalar)
    return Rule.COORDINATE, change


def vector_derivative(expression: Vector, direction: Direction, record: Record = None) -> Vector:
    """Differentiate a vector along a direction."""
    rule, result = _vector(expression, direction, record)
    if record is not None:
        record.append(Step(rule, expression, result))
    return result


def _vector(expression: Vector, direction: Direction, record: Record) -> tuple[Rule, Vector]:
    match expression:
        case VectorSum(terms):
            parts = tuple(vector_derivative(term, direction, record) for term in terms)
            return Rule.SUM, vector_sum(parts)
        case Scaled(factor, vector):
            return Rule.PRODUCT, vector_sum(
                (
                    scaled(derivative(factor, direction, record), vector),
                    scaled(factor, vector_derivative(vector, direction, record)),
                )
            )
        case Turned(angle, vector, quarter):
            return _ROTATION[quarter], vector_sum(
                (
                    scaled(
                        derivative(angle, direction, record), turned(angle, vector, quarter + 1)
                    ),
                    turned(angle, vector_derivative(vector, direction, record), quarter),
                )
            )
        case Perpendicular(vector):
            return Rule.CONSTANT, perpendicular(vector_derivative(vector, direction, record))
    change = direction.get(expression)
    if change is None:
        return Rule.CONSTANT, ZERO_VECTOR
    assert isinstance(change, Vector)
    return Rule.COORDINATE, change


_ROTATION = (Rule.A_TO_B, Rule.B_TO_A)
"""What differentiating R^k A(phi) by phi is called, for k = 0 and k = 1."""


def gradient(expression: Scalar, position: VectorSymbol, record: Record = None) -> Vector:
    """Differentiate a scalar by a position r: the row (d/dx, d/dy), as a vector."""
    rule, result = _gradient(expression, position, record)
    if record is not None:
        record.append(Step(rule, expression, result))
    return result


def _gradient(expression: Scalar, position: VectorSymbol, record: Record) -> tuple[Rule, Vector]:
    match expression:
        case Sum(terms):
            parts = tuple(gradient(term, position, record) for term in terms)
            return Rule.SUM, vector_sum(parts)
        case Product(factors):
            return Rule.PRODUCT, vector_sum(
                tuple(
                    scaled(
                        product_of((*factors[:k], *factors[k + 1 :])),
                        gradient(factor, position, record),
                    )
                    for k, factor in enumerate(factors)
                )
            )
        case Power(base, exponent):
            outer = exponent * power_of(base, exponent - 1)
            return Rule.CHAIN, scaled(outer, gradient(base, position, record))
        case Dot(left, right) if left == right:
            return Rule.PRODUCT, scaled(2 * coefficient(right, position, record), left)
        case Dot(left, right):
            return Rule.PRODUCT, vector_sum(
                (
                    scaled(coefficient(left, position, record), right),
                    scaled(coefficient(right, position, record), left),
                )
            )
    return Rule.CONSTANT, ZERO_VECTOR


def coefficient(expression: Vector, position: VectorSymbol, record: Record = None) -> Scalar:
    """Return k where the derivative of a vector by a position r is k I."""
    rule, result = _coefficient(expression, position, record)
    if record is not None:
        record.append(Step(rule, expression, result))
    return result


def _coefficient(expression: Vector, position: VectorSymbol, record: Record) -> tuple[Rule, Scalar]:
    match expression:
        case VectorSum(terms):
            parts = tuple(coefficient(term, position, record) for term in terms)
            return Rule.SUM, sum_of(parts)
        case Scaled(factor, vector):
            return Rule.PRODUCT, factor * coefficient(vector, position, record)
    return (Rule.COORDINATE, ONE) if expression == position else (Rule.CONSTANT, ZERO)
