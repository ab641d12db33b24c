"""The rules of differentiation: one directional derivative of scalars and vectors.

They are dA/dphi = B = R A, dB/dphi = -A, and the sum, product and chain rule. Whoever wants to see
which of them fired, and on what, hands in a list that records it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import overload

from kincompile.calculus.expressions import (
    ZERO,
    ZERO_VECTOR,
    Angle,
    Circular,
    Dot,
    Expression,
    Norm,
    Number,
    Perpendicular,
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
    cross,
    dot,
    perpendicular,
    power_of,
    product_of,
    rotated,
    scaled,
    split_factor,
    sum_of,
    vector_sum,
)

Direction = Mapping[Expression, Expression]
"""How each leaf changes; a leaf that is absent is held constant."""

TIME = Symbol("t")
"""The key that stands for time in a direction."""


class Rule(Enum):
    """A rule of differentiation; the value says it in words."""

    SUM = "sum rule"
    PRODUCT = "product rule"
    CHAIN = "chain rule"
    A_TO_B = "dA/dphi = B"
    B_TO_A = "dB/dphi = -A"
    A_TO_SLOPE = "d(A s) = B(p, s) dp"
    SLOPE = "d(B(p, s) w) = B(w, s) dp"
    TURN = "p_dot = G^T omega'/2: A_dot = A omega'~"
    ANGLE = "d atan2(s, c) = (c ds - s dc)/(s^2 + c^2)"
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
"""Recorded steps, innermost first; None disables recording."""


@overload
def along(expression: Scalar, direction: Direction, record: Record = None) -> Scalar: ...
@overload
def along(expression: Vector, direction: Direction, record: Record = None) -> Vector: ...
@overload
def along(expression: Expression, direction: Direction, record: Record = None) -> Expression: ...
def along(expression: Expression, direction: Direction, record: Record = None) -> Expression:
    """Differentiate an expression along a direction.

    With ``{phi_i: 1}`` it is the partial derivative by phi_i, with ``{r_i: e_x}`` that by x_i; with
    the rates, ``{r_i: r_i_dot, phi_i: phi_i_dot, ...}``, it is Phi_q q_dot; a driver C(t) gives
    its next order where the direction holds the time.
    """
    differentiate = _scalar if isinstance(expression, Scalar) else _vector
    rule, result = differentiate(expression, direction, record)  # type: ignore[arg-type]
    if record is not None:
        record.append(Step(rule, expression, result))
    return result


def _scalar(expression: Scalar, direction: Direction, record: Record) -> tuple[Rule, Scalar]:
    match expression:
        case Sum(terms):
            return Rule.SUM, sum_of(tuple(along(term, direction, record) for term in terms))
        case Product(factors):
            return Rule.PRODUCT, sum_of(
                tuple(
                    product_of((*factors[:k], along(factor, direction, record), *factors[k + 1 :]))
                    for k, factor in enumerate(factors)
                )
            )
        case Power(base, exponent):
            outer = exponent * power_of(base, exponent - 1)
            return Rule.CHAIN, outer * along(base, direction, record)
        case Dot(left, right) if left == right:
            return Rule.PRODUCT, 2 * dot(left, along(right, direction, record))
        case Dot(left, right):
            return Rule.PRODUCT, dot(along(left, direction, record), right) + dot(
                left, along(right, direction, record)
            )
        case Norm(vector) if along(vector, direction) != ZERO_VECTOR:
            return Rule.CHAIN, dot(vector, along(vector, direction, record)) * expression**-1
        case Root(square):
            half = Number(Fraction(1, 2))
            return Rule.CHAIN, half * along(square, direction, record) * expression**-1
        case Circular(name, argument):
            sign, other = (-1, "sin") if name == "cos" else (1, "cos")
            inner = along(argument, direction, record)
            return Rule.CHAIN, sign * Circular(other, argument) * inner
        case Angle(sine, cosine):
            by_sine, by_cosine = (along(item, direction, record) for item in (sine, cosine))
            turn = cosine * by_sine - sine * by_cosine
            return Rule.ANGLE, turn / (sine**2 + cosine**2)
        case ProfileFunction(name, argument, order):
            inner = along(argument, direction, record)
            return Rule.PROFILE, ProfileFunction(name, argument, order + 1) * inner
        case TimeFunction(name, order) if TIME in direction:
            return Rule.DRIVER, TimeFunction(name, order + 1)
    change = direction.get(expression)
    if change is None:
        return Rule.CONSTANT, ZERO
    assert isinstance(change, Scalar)
    return Rule.COORDINATE, change


def _vector(expression: Vector, direction: Direction, record: Record) -> tuple[Rule, Vector]:
    match expression:
        case VectorSum(terms):
            return Rule.SUM, vector_sum(tuple(along(term, direction, record) for term in terms))
        case Scaled(factor, vector):
            return Rule.PRODUCT, vector_sum(
                (
                    scaled(along(factor, direction, record), vector),
                    scaled(factor, along(vector, direction, record)),
                )
            )
        case Rotated(rotation, vector, directions):
            rules = _ROTATION[rotation.letters]
            # A is of degree 2 in Euler parameters: its third derivative is zero.
            turning = rotation.coordinates if len(directions) < len(rules) else ()
            changes = [along(item, direction, record) for item in turning]
            moved = along(vector, direction, record)
            name = rules[min(len(directions), len(rules) - 1)]
            if any(
                isinstance(item, Scaled) and isinstance(item.vector, TimesG) for item in changes
            ):
                name = Rule.TURN
            return name, vector_sum(
                (
                    *(rotated(rotation, vector, (*directions, change)) for change in changes),
                    *(
                        rotated(rotation, vector, (*directions[:k], change, *directions[k + 1 :]))
                        for k, item in enumerate(directions)
                        if (change := direction.get(item)) is not None
                    ),
                    rotated(rotation, moved, directions),
                )
            )
        case TimesG(p, vector, False):
            by_p, by_vector = (along(item, direction, record) for item in (p, vector))
            pairs = (by_p, vector), (p, by_vector)
            return Rule.PRODUCT, vector_sum(
                tuple(TimesG(*pair) for pair in pairs if ZERO_VECTOR not in pair)
            )
        case TimesG(p, vector, True) if p in direction:
            factor, change = split_factor(along(p, direction))
            assert isinstance(change, TimesG), "p changes by a small rotation"
            number, turn = split_factor(cross(change.vector, vector))
            back = dot(change.vector, vector) * p
            onward = ZERO_VECTOR if turn == ZERO_VECTOR else TimesG(p, turn, is_transposed=True)
            return Rule.TURN, factor * (number * onward - back)
        case Perpendicular(vector):
            return Rule.CONSTANT, perpendicular(along(vector, direction, record))
    change = direction.get(expression)
    if change is None:
        return Rule.CONSTANT, ZERO_VECTOR
    assert isinstance(change, Vector)
    return Rule.COORDINATE, change


_ROTATION = {
    "AB": (Rule.A_TO_B, Rule.B_TO_A),
    "ABB": (Rule.A_TO_SLOPE, Rule.SLOPE),
}
"""What the derivative of A is called, and that of it, by the letters of these."""
