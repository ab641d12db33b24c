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

from kincompile.calculus import expressions as ex
from kincompile.derive.derivation import recorded, units
from kincompile.derive.rules import Step, along
from kincompile.errors import InternalError

if TYPE_CHECKING:
    from kincompile.calculus.symbols import CoordinateSymbol
    from kincompile.calculus.template import Template


@dataclass(frozen=True, slots=True)
class PartialDerivative:
    """The derivative of a row block by a coordinate."""

    coordinate: CoordinateSymbol  # a coordinate of the template
    # By a vector r: k of the block k I where Phi is a vector, u of the row u^T where Phi is a
    # scalar. By Euler parameters, and by a small rotation: the matrix, or the row, of slopes. By a
    # scalar: a vector or a scalar, as Phi is.
    entry: ex.Expression
    # The rules that fired, innermost first, with what they give in the same form.
    steps: tuple[Step, ...]

    def columns(self, entry: ex.Expression) -> tuple[ex.Expression, ...]:
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
    template: Template, Phi: ex.Expression, coordinate: CoordinateSymbol, rate: CoordinateSymbol
) -> PartialDerivative:
    if not isinstance(rate, ex.VectorSymbol):
        return PartialDerivative(coordinate, *recorded(Phi, {coordinate: ex.ONE}))
    direction = template.direction({coordinate: rate})
    entry, steps = recorded(Phi, direction)
    leaves = direction.keys() - {coordinate}  # p, whose change is no multiple of pi'
    read_off = tuple(
        Step(step.rule, step.expression, coefficient(step.derivative, rate))
        for step in steps
        if step.expression not in leaves
    )
    return PartialDerivative(coordinate, coefficient(entry, rate), read_off)


def _applied(entry: ex.Expression, change: ex.Expression) -> ex.Expression:
    """Return what an entry gives for a change of its coordinate."""
    if isinstance(change, ex.Scalar):
        return change * entry
    if isinstance(entry, ex.Scalar):
        return ex.scaled(entry, change)
    match entry:
        case ex.VectorSum(terms) if _has_slopes(entry):
            parts = [_applied(term, change) for term in terms]
            return sum(parts[1:], start=parts[0])
        case ex.Scaled(factor, vector) if _has_slopes(vector):
            return factor * _applied(vector, change)
        case ex.RotationSlope(rotation, vector, is_small):
            if is_small:
                return ex.rotated(rotation, ex.cross(vector, change))
            return ex.rotated(rotation, vector, (change,))
        case ex.RowOfSlope(left, slope):
            moved = _applied(slope, change)
            assert isinstance(moved, ex.Vector)
            return ex.dot(left, moved)
    return ex.dot(entry, change)


def _has_slopes(vector: ex.Vector) -> bool:
    """Return whether there is a slope, or a row of one, in a vector."""
    match vector:
        case ex.VectorSum(terms):
            return any(map(_has_slopes, terms))
        case ex.Scaled(_, inner):
            return _has_slopes(inner)
    return isinstance(vector, ex.RotationSlope | ex.RowOfSlope)


def _slope(vector: ex.Vector, rate: ex.VectorSymbol) -> ex.Vector | None:
    """Return B(p, v) of B(p, v) p_dot, -A v~ of A omega'~ v; None for anything else."""
    match vector:
        case ex.Rotated(rotation, ex.Cross(turn, inner), ()) if turn == rate:
            return -ex.RotationSlope(rotation, inner, is_small=True)
        case ex.Rotated(rotation, inner, (along_rate,)) if along_rate == rate:
            return ex.RotationSlope(rotation, inner)
    return None


def coefficient(expression: ex.Expression, rate: ex.VectorSymbol) -> ex.Expression:
    """Return k of a vector k r_dot, u of a scalar u^T r_dot; of p_dot the slopes."""
    if isinstance(expression, ex.Scalar):
        return _row(expression, rate)
    if expression == ex.ZERO_VECTOR:
        return ex.ZERO
    if isinstance(expression, ex.VectorSum):
        terms = [coefficient(term, rate) for term in expression.terms]
        return ex.vector_sum(tuple(term for term in terms if isinstance(term, ex.Vector)))
    factor, vector = ex.split_factor(expression)
    slope = _slope(vector, rate)
    if slope is not None:
        return ex.scaled(factor, slope)
    if vector != rate:
        raise InternalError(f"{expression} is no multiple of {rate}")
    return factor


def _row(expression: ex.Scalar, rate: ex.VectorSymbol) -> ex.Vector:
    match expression:
        case ex.Sum(terms):
            return ex.vector_sum(tuple(_row(term, rate) for term in terms))
        case ex.Product(factors):
            rows = (
                ex.scaled(ex.product_of((*factors[:k], *factors[k + 1 :])), _row(factor, rate))
                for k, factor in enumerate(factors)
            )
            return ex.vector_sum(tuple(rows))
        case ex.Dot(left, right) if rate in (left, right):
            return right if left == rate else left
        case ex.Dot(left, ex.TimesG(p, turn, True)) if turn == rate:
            return ex.TimesG(p, left)
        case ex.Dot(left, right):
            for one, other in ((left, right), (right, left)):
                slope = _slope(one, rate)
                if slope is not None:
                    factor, matrix = ex.split_factor(slope)
                    assert isinstance(matrix, ex.RotationSlope)
                    return ex.scaled(factor, ex.RowOfSlope(other, matrix))
    if along(expression, {rate: rate}) != ex.ZERO:
        raise InternalError(f"{expression} is not a multiple of {rate}")
    return ex.ZERO_VECTOR
