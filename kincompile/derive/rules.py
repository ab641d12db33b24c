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

from kincompile.calculus import expressions as ex

Direction = Mapping[ex.Expression, ex.Expression]
"""How each leaf changes; a leaf that is absent is held constant."""

TIME = ex.Symbol("t")
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
    expression: ex.Expression
    derivative: ex.Expression


Record = list[Step] | None
"""Recorded steps, innermost first; None disables recording."""


@overload
def along(expression: ex.Scalar, direction: Direction, record: Record = None) -> ex.Scalar: ...
@overload
def along(expression: ex.Vector, direction: Direction, record: Record = None) -> ex.Vector: ...
@overload
def along(
    expression: ex.Expression, direction: Direction, record: Record = None
) -> ex.Expression: ...
def along(expression: ex.Expression, direction: Direction, record: Record = None) -> ex.Expression:
    """Differentiate an expression along a direction.

    With ``{phi_i: 1}`` it is the partial derivative by phi_i, with ``{r_i: e_x}`` that by x_i; with
    the rates, ``{r_i: r_i_dot, phi_i: phi_i_dot, ...}``, it is Phi_q q_dot; a driver C(t) gives
    its next order where the direction holds the time.
    """
    differentiate = _scalar if isinstance(expression, ex.Scalar) else _vector
    rule, result = differentiate(expression, direction, record)  # type: ignore[arg-type]
    if record is not None:
        record.append(Step(rule, expression, result))
    return result


def _scalar(expression: ex.Scalar, direction: Direction, record: Record) -> tuple[Rule, ex.Scalar]:
    match expression:
        case ex.Sum(terms):
            return Rule.SUM, ex.sum_of(tuple(along(term, direction, record) for term in terms))
        case ex.Product(factors):
            return Rule.PRODUCT, ex.sum_of(
                tuple(
                    ex.product_of(
                        (*factors[:k], along(factor, direction, record), *factors[k + 1 :])
                    )
                    for k, factor in enumerate(factors)
                )
            )
        case ex.Power(base, exponent):
            outer = exponent * ex.power_of(base, exponent - 1)
            return Rule.CHAIN, outer * along(base, direction, record)
        case ex.Dot(left, right) if left == right:
            return Rule.PRODUCT, 2 * ex.dot(left, along(right, direction, record))
        case ex.Dot(left, right):
            return Rule.PRODUCT, ex.dot(along(left, direction, record), right) + ex.dot(
                left, along(right, direction, record)
            )
        case ex.Norm(vector) if along(vector, direction) != ex.ZERO_VECTOR:
            return Rule.CHAIN, ex.dot(vector, along(vector, direction, record)) * expression**-1
        case ex.Root(square):
            half = ex.Number(Fraction(1, 2))
            return Rule.CHAIN, half * along(square, direction, record) * expression**-1
        case ex.Circular(name, argument):
            sign, other = (-1, "sin") if name == "cos" else (1, "cos")
            inner = along(argument, direction, record)
            return Rule.CHAIN, sign * ex.Circular(other, argument) * inner
        case ex.Angle(sine, cosine):
            by_sine, by_cosine = (along(item, direction, record) for item in (sine, cosine))
            turn = cosine * by_sine - sine * by_cosine
            return Rule.ANGLE, turn / (sine**2 + cosine**2)
        case ex.ProfileFunction(name, argument, order):
            inner = along(argument, direction, record)
            return Rule.PROFILE, ex.ProfileFunction(name, argument, order + 1) * inner
        case ex.TimeFunction(name, order) if TIME in direction:
            return Rule.DRIVER, ex.TimeFunction(name, order + 1)
    change = direction.get(expression)
    if change is None:
        return Rule.CONSTANT, ex.ZERO
    assert isinstance(change, ex.Scalar)
    return Rule.COORDINATE, change


def _vector(expression: ex.Vector, direction: Direction, record: Record) -> tuple[Rule, ex.Vector]:
    match expression:
        case ex.VectorSum(terms):
            return Rule.SUM, ex.vector_sum(tuple(along(term, direction, record) for term in terms))
        case ex.Scaled(factor, vector):
            return Rule.PRODUCT, ex.vector_sum(
                (
                    ex.scaled(along(factor, direction, record), vector),
                    ex.scaled(factor, along(vector, direction, record)),
                )
            )
        case ex.Rotated(rotation, vector, directions):
            rules = _ROTATION[rotation.letters]
            # A is of degree 2 in Euler parameters: its third derivative is zero.
            turning = rotation.coordinates if len(directions) < len(rules) else ()
            changes = [along(item, direction, record) for item in turning]
            moved = along(vector, direction, record)
            name = rules[min(len(directions), len(rules) - 1)]
            if any(
                isinstance(item, ex.Scaled) and isinstance(item.vector, ex.TimesG)
                for item in changes
            ):
                name = Rule.TURN
            return name, ex.vector_sum(
                (
                    *(ex.rotated(rotation, vector, (*directions, change)) for change in changes),
                    *(
                        ex.rotated(
                            rotation, vector, (*directions[:k], change, *directions[k + 1 :])
                        )
                        for k, item in enumerate(directions)
                        if (change := direction.get(item)) is not None
                    ),
                    ex.rotated(rotation, moved, directions),
                )
            )
        case ex.TimesG(p, vector, False):
            by_p, by_vector = (along(item, direction, record) for item in (p, vector))
            pairs = (by_p, vector), (p, by_vector)
            return Rule.PRODUCT, ex.vector_sum(
                tuple(ex.TimesG(*pair) for pair in pairs if ex.ZERO_VECTOR not in pair)
            )
        case ex.TimesG(p, vector, True) if p in direction:
            factor, change = ex.split_factor(along(p, direction))
            assert isinstance(change, ex.TimesG), "p changes by a small rotation"
            number, turn = ex.split_factor(ex.cross(change.vector, vector))
            back = ex.dot(change.vector, vector) * p
            onward = (
                ex.ZERO_VECTOR if turn == ex.ZERO_VECTOR else ex.TimesG(p, turn, is_transposed=True)
            )
            return Rule.TURN, factor * (number * onward - back)
        case ex.Perpendicular(vector):
            return Rule.CONSTANT, ex.perpendicular(along(vector, direction, record))
    change = direction.get(expression)
    if change is None:
        return Rule.CONSTANT, ex.ZERO_VECTOR
    assert isinstance(change, ex.Vector)
    return Rule.COORDINATE, change


_ROTATION = {
    "AB": (Rule.A_TO_B, Rule.B_TO_A),
    "ABB": (Rule.A_TO_SLOPE, Rule.SLOPE),
}
"""What the derivative of A is called, and that of it, by the letters of these."""
