"""Phi_q as the book prints it, read off the directional derivative.

By a position r the derivative along a change of r is linear in that change: ``k r_dot`` of a vector
constraint, whose block is k I, and ``u^T r_dot`` of a scalar one, whose row is u^T. By Euler
parameters p it is ``B(p, s) p_dot``, whose block is the matrix B(p, s), and ``u^T B(p, s) p_dot``.
By a small rotation pi' it is ``A omega'~ s = -A s~ omega'``, whose block is -A s~.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    ZERO_VECTOR,
    Cross,
    Dot,
    Expression,
    Product,
    Rotated,
    RotationSlope,
    RowOfSlope,
    Scalar,
    Scaled,
    Sum,
    TimesG,
    Vector,
    VectorSum,
    VectorSymbol,
    cross,
    dot,
    product_of,
    rotated,
    scaled,
    split_factor,
    vector_sum,
)
from kincompile.derive.derivation import recorded, units
from kincompile.derive.rules import Step, along
from kincompile.errors import InternalError

if TYPE_CHECKING:
    from kincompile.calculus.symbols import CoordinateSymbol
    from kincompile.calculus.template import Template


@dataclass(frozen=True, slots=True)
class PartialDerivative:
    """The derivative of a row block by a coordinate.

    Attributes
    ----------
    coordinate
        A coordinate of the template.
    entry
        By a vector r: k of the block k I where Phi is a vector, u of the row u^T where Phi is a
        scalar. By Euler parameters, and by a small rotation: the matrix, or the row, of slopes. By
        a scalar: a vector or a scalar, as Phi is.
    steps
        The rules that fired, innermost first, with what they give in the same form.
    """

    coordinate: CoordinateSymbol
    entry: Expression
    steps: tuple[Step, ...]

    def columns(self, entry: Expression) -> tuple[Expression, ...]:
        """Return the columns that an entry stands for, this one or another in its place."""
        return tuple(_applied(entry, unit) for unit in units(self.coordinate))


@cache
def partials(template: Template) -> tuple[tuple[PartialDerivative, ...], ...]:
    """Return the derivatives of a constraint type: by row block, then by coordinate."""
    changes = tuple(zip(template.coordinates, template.rates, strict=True))
    return tuple(
        tuple(_partial(template, Phi, coordinate, rate) for coordinate, rate in changes)
        for Phi in template.Phi
    )


def _partial(
    template: Template, Phi: Expression, coordinate: CoordinateSymbol, rate: CoordinateSymbol
) -> PartialDerivative:
    if not isinstance(rate, VectorSymbol):
        return PartialDerivative(coordinate, *recorded(Phi, {coordinate: ONE}))
    direction = template.direction({coordinate: rate})
    entry, steps = recorded(Phi, direction)
    leaves = direction.keys() - {coordinate}  # p, whose change is no multiple of pi'
    read_off = tuple(
        Step(step.rule, step.expression, coefficient(step.derivative, rate))
        for step in steps
        if step.expression not in leaves
    )
    return PartialDerivative(coordinate, coefficient(entry, rate), read_off)


def _applied(entry: Expression, change: Expression) -> Expression:
    """Return what an entry gives for a change of its coordinate."""
    if isinstance(change, Scalar):
        return change * entry
    if isinstance(entry, Scalar):
        return scaled(entry, change)
    match entry:
        case VectorSum(terms) if _has_slopes(entry):
            parts = [_applied(term, change) for term in terms]
            return sum(parts[1:], start=parts[0])
        case Scaled(factor, vector) if _has_slopes(vector):
            return factor * _applied(vector, change)
        case RotationSlope(rotation, vector, is_small):
            if is_small:
                return rotated(rotation, cross(vector, change))
            return rotated(rotation, vector, (change,))
        case RowOfSlope(left, slope):
            moved = _applied(slope, change)
            assert isinstance(moved, Vector)
            return dot(left, moved)
    return dot(entry, change)


def _has_slopes(vector: Vector) -> bool:
    """Return whether there is a slope, or a row of one, in a vector."""
    match vector:
        case VectorSum(terms):
            return any(map(_has_slopes, terms))
        case Scaled(_, inner):
            return _has_slopes(inner)
    return isinstance(vector, RotationSlope | RowOfSlope)


def _slope(vector: Vector, rate: VectorSymbol) -> Vector | None:
    """Return B(p, v) of B(p, v) p_dot, -A v~ of A omega'~ v; None for anything else."""
    match vector:
        case Rotated(rotation, Cross(turn, inner), ()) if turn == rate:
            return -RotationSlope(rotation, inner, is_small=True)
        case Rotated(rotation, inner, (along_rate,)) if along_rate == rate:
            return RotationSlope(rotation, inner)
    return None


def coefficient(expression: Expression, rate: VectorSymbol) -> Expression:
    """Return k of a vector k r_dot, u of a scalar u^T r_dot; of p_dot the slopes."""
    if isinstance(expression, Scalar):
        return _row(expression, rate)
    if expression == ZERO_VECTOR:
        return ZERO
    if isinstance(expression, VectorSum):
        terms = [coefficient(term, rate) for term in expression.terms]
        return vector_sum(tuple(term for term in terms if isinstance(term, Vector)))
    factor, vector = split_factor(expression)
    slope = _slope(vector, rate)
    if slope is not None:
        return scaled(factor, slope)
    if vector != rate:
        raise InternalError(f"{expression} is no multiple of {rate}")
    return factor


def _row(expression: Scalar, rate: VectorSymbol) -> Vector:
    match expression:
        case Sum(terms):
            return vector_sum(tuple(_row(term, rate) for term in terms))
        case Product(factors):
            rows = (
                scaled(product_of((*factors[:k], *factors[k + 1 :])), _row(factor, rate))
                for k, factor in enumerate(factors)
            )
            return vector_sum(tuple(rows))
        case Dot(left, right) if rate in (left, right):
            return right if left == rate else left
        case Dot(left, TimesG(p, turn, True)) if turn == rate:
            return TimesG(p, left)
        case Dot(left, right):
            for one, other in ((left, right), (right, left)):
                slope = _slope(one, rate)
                if slope is not None:
                    factor, matrix = split_factor(slope)
                    assert isinstance(matrix, RotationSlope)
                    return scaled(factor, RowOfSlope(other, matrix))
    if along(expression, {rate: rate}) != ZERO:
        raise InternalError(f"{expression} is not a multiple of {rate}")
    return ZERO_VECTOR
