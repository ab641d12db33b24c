"""Phi_q, nu and gamma of a constraint type, derived once from its Phi and kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus.expressions import (
    ONE,
    Scalar,
    Symbol,
    Vector,
    VectorSymbol,
    sum_of,
    vector_sum,
)
from kincompile.derive.rules import (
    TIME,
    Direction,
    coefficient,
    derivative,
    gradient,
    vector_derivative,
)

if TYPE_CHECKING:
    from kincompile.calculus.expressions import Expression
    from kincompile.calculus.template import Template


@dataclass(frozen=True, slots=True)
class RowBlock:
    r"""One row block of a constraint: a vector equation (two rows) or a scalar one.

    Attributes
    ----------
    Phi
        The constraint.
    Phi_q
        Its derivative by each coordinate of the template. By a position r: the number k of the
        block k I where Phi is a vector, the row (d/dx, d/dy) as a vector where Phi is a scalar. By
        an angle: a vector or a scalar, as Phi is.
    nu
        :math:`-\Phi_t`.
    gamma_terms
        :math:`-(\Phi_q \dot q)_q \dot q`, :math:`-2 \Phi_{qt} \dot q` and :math:`-\Phi_{tt}`.
    gamma
        Their sum.
    """

    Phi: Expression
    Phi_q: tuple[Expression, ...]
    nu: Expression
    gamma_terms: tuple[Expression, Expression, Expression]
    gamma: Expression


@cache
def derive(template: Template) -> tuple[RowBlock, ...]:
    """Differentiate the Phi of a constraint type: its row blocks, in order."""
    along_q_dot: Direction = dict(zip(template.coordinates, template.rates, strict=True))
    along_t: Direction = {TIME: ONE}
    blocks = []
    for Phi in template.Phi:
        Phi_t = _along(Phi, along_t)
        velocity = _along(Phi, along_q_dot)
        gamma_terms = (
            _times(-1, _along(velocity, along_q_dot)),
            _times(-2, _along(velocity, along_t)),
            _times(-1, _along(Phi_t, along_t)),
        )
        blocks.append(
            RowBlock(
                Phi,
                tuple(_by(Phi, coordinate) for coordinate in template.coordinates),
                _times(-1, Phi_t),
                gamma_terms,
                _total(gamma_terms),
            )
        )
    return tuple(blocks)


def _along(expression: Expression, direction: Direction) -> Expression:
    if isinstance(expression, Vector):
        return vector_derivative(expression, direction)
    return derivative(expression, direction)


def _by(expression: Expression, coordinate: VectorSymbol | Symbol) -> Expression:
    if isinstance(coordinate, Symbol):
        return _along(expression, {coordinate: ONE})
    if isinstance(expression, Vector):
        return coefficient(expression, coordinate)
    return gradient(expression, coordinate)


def _times(factor: int, expression: Expression) -> Expression:
    return factor * expression


def _total(terms: tuple[Expression, ...]) -> Expression:
    vectors = tuple(term for term in terms if isinstance(term, Vector))
    if vectors:
        return vector_sum(vectors)
    return sum_of(tuple(term for term in terms if isinstance(term, Scalar)))
