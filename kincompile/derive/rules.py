"""The rules of differentiation, on scalars and vectors.

They are dA/dphi = B = R A, dB/dphi = -A, and the sum, product and chain rule.
"""

from __future__ import annotations

from collections.abc import Mapping

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


def derivative(expression: Scalar, direction: Direction) -> Scalar:
    """Differentiate a scalar along a direction.

    With ``{phi_i: 1}`` it is the partial derivative by phi_i; with the rates,
    ``{r_i: r_i_dot, phi_i: phi_i_dot, ...}``, it is Phi_q q_dot; a driver C(t) differentiates to
    its next order where the direction holds the time.
    """
    match expression:
        case Sum(terms):
            return sum_of(tuple(derivative(term, direction) for term in terms))
        case Product(factors):
            return sum_of(
                tuple(
                    product_of((*factors[:k], derivative(factor, direction), *factors[k + 1 :]))
                    for k, factor in enumerate(factors)
                )
            )
        case Power(base, exponent):
            return exponent * power_of(base, exponent - 1) * derivative(base, direction)
        case Dot(left, right) if left == right:
            return 2 * dot(left, vector_derivative(right, direction))
        case Dot(left, right):
            return dot(vector_derivative(left, direction), right) + dot(
                left, vector_derivative(right, direction)
            )
        case Profile(name, argument, order):
            return Profile(name, argument, order + 1) * derivative(argument, direction)
        case TimeFunction(name, order) if TIME in direction:
            return TimeFunction(name, order + 1)
    change = direction.get(expression, ZERO)
    assert isinstance(change, Scalar)
    return change


def vector_derivative(expression: Vector, direction: Direction) -> Vector:
    """Differentiate a vector along a direction."""
    match expression:
        case VectorSum(terms):
            return vector_sum(tuple(vector_derivative(term, direction) for term in terms))
        case Scaled(factor, vector):
            return vector_sum(
                (
                    scaled(derivative(factor, direction), vector),
                    scaled(factor, vector_derivative(vector, direction)),
                )
            )
        case Turned(angle, vector, quarter):
            return vector_sum(
                (
                    scaled(derivative(angle, direction), turned(angle, vector, quarter + 1)),
                    turned(angle, vector_derivative(vector, direction), quarter),
                )
            )
        case Perpendicular(vector):
            return perpendicular(vector_derivative(vector, direction))
    change = direction.get(expression, ZERO_VECTOR)
    assert isinstance(change, Vector)
    return change


def gradient(expression: Scalar, position: VectorSymbol) -> Vector:
    """Differentiate a scalar by a position r: the row (d/dx, d/dy), as a vector."""
    match expression:
        case Sum(terms):
            return vector_sum(tuple(gradient(term, position) for term in terms))
        case Product(factors):
            return vector_sum(
                tuple(
                    scaled(
                        product_of((*factors[:k], *factors[k + 1 :])), gradient(factor, position)
                    )
                    for k, factor in enumerate(factors)
                )
            )
        case Power(base, exponent):
            return scaled(exponent * power_of(base, exponent - 1), gradient(base, position))
        case Dot(left, right) if left == right:
            return scaled(2 * coefficient(right, position), left)
        case Dot(left, right):
            return vector_sum(
                (
                    scaled(coefficient(left, position), right),
                    scaled(coefficient(right, position), left),
                )
            )
    return ZERO_VECTOR


def coefficient(expression: Vector, position: VectorSymbol) -> Scalar:
    """Return k where the derivative of a vector by a position r is k I."""
    match expression:
        case VectorSum(terms):
            return sum_of(tuple(coefficient(term, position) for term in terms))
        case Scaled(factor, vector):
            return factor * coefficient(vector, position)
    return ONE if expression == position else ZERO
