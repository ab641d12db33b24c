"""Phi_q, nu and gamma of a constraint type, derived once from its Phi and kept, with the steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus import expressions as ex
from kincompile.derive.rules import TIME, Direction, Step, along

if TYPE_CHECKING:
    from kincompile.calculus.symbols import CoordinateSymbol
    from kincompile.calculus.template import Template


@dataclass(frozen=True, slots=True)
class RowBlock:
    """One row block of a constraint: a vector equation (two rows) or a scalar one."""

    Phi: ex.Expression
    # Its columns: Phi_q q_dot with each rate one in turn, by component of the coordinates of the
    # template, and each a vector or a scalar, as Phi is.
    Phi_q: tuple[ex.Expression, ...]
    velocity: ex.Expression  # Phi_q q_dot
    nu: ex.Expression  # -Phi_t
    # -(Phi_q q_dot)_q q_dot, -2 Phi_qt q_dot and -Phi_tt.
    gamma_terms: tuple[ex.Expression, ex.Expression, ex.Expression]
    gamma: ex.Expression  # their sum
    # Phi_t_steps, gamma_steps: the rules that fired for Phi_t and for each of the three terms,
    # innermost first.
    Phi_t_steps: tuple[Step, ...]
    gamma_steps: tuple[tuple[Step, ...], ...]


@cache
def derive(template: Template) -> tuple[RowBlock, ...]:
    """Differentiate the Phi of a constraint type: its row blocks, in order."""
    return tuple(_row_block(template, Phi) for Phi in template.Phi)


def _row_block(template: Template, Phi: ex.Expression) -> RowBlock:
    along_q_dot: Direction = template.motion
    along_t: Direction = {TIME: ex.ONE}
    Phi_t, Phi_t_steps = recorded(Phi, along_t)
    velocity = along(Phi, along_q_dot)
    second = (
        (-1, *recorded(velocity, along_q_dot)),
        (-2, *recorded(velocity, along_t)),
        (-1, *recorded(Phi_t, along_t)),
    )
    first_term, second_term, third_term = (factor * found for factor, found, _ in second)
    gamma_terms = first_term, second_term, third_term
    return RowBlock(
        Phi=Phi,
        Phi_q=tuple(
            along(Phi, template.direction({item: unit}))
            for item in template.coordinates
            for unit in units(item)
        ),
        velocity=velocity,
        nu=-Phi_t,
        gamma_terms=gamma_terms,
        gamma=_total(gamma_terms),
        Phi_t_steps=Phi_t_steps,
        gamma_steps=tuple(steps for _, _, steps in second),
    )


def units(coordinate: CoordinateSymbol) -> tuple[ex.Expression, ...]:
    """Return the unit rates of a coordinate: 1 of a scalar, e_x, e_y, ... of a vector."""
    if isinstance(coordinate, ex.VectorSymbol):
        return tuple(ex.Basis(axis, coordinate.size) for axis in range(coordinate.size))
    return (ex.ONE,)


def recorded(
    expression: ex.Expression, direction: Direction
) -> tuple[ex.Expression, tuple[Step, ...]]:
    """Differentiate along a direction, and return the steps too."""
    record: list[Step] = []
    return along(expression, direction, record), tuple(record)


def _total(terms: tuple[ex.Expression, ...]) -> ex.Expression:
    vectors = tuple(term for term in terms if isinstance(term, ex.Vector))
    if vectors:
        return ex.vector_sum(vectors)
    return ex.sum_of(tuple(term for term in terms if isinstance(term, ex.Scalar)))
