r"""Generalised forces and mass matrix of a load, derived from its virtual work and kinetic energy.

A force F whose point moves by delta r does the work :math:`F^T \delta r`, so that
:math:`Q = (\partial r/\partial q)^T F`. Of a kinetic energy T it is
:math:`\delta q^T (T_q - d/dt\, T_{\dot q})`: linear in the second rates, whose coefficient is -M,
and the rest belongs to Q. Both are directional derivatives, in the plane as in space.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus import expressions as ex
from kincompile.calculus.rotations import PlaneRotation
from kincompile.calculus.template import Template
from kincompile.derive.derivation import units
from kincompile.derive.rules import along

if TYPE_CHECKING:
    from kincompile.derive.rules import Direction

Work = tuple["ex.Expression", "ex.Expression"]
"""A force and the displacement of what it acts on, both vectors or both scalars."""

Leaf = ex.Symbol | ex.VectorSymbol


@dataclass(frozen=True, slots=True)
class LoadTemplate(Template):
    """A load in vectors, with every attribute symbolic."""

    energy: ex.Scalar  # kinetic energy; zero of a force
    work: tuple[Work, ...]  # forces and displacements, whose products are the virtual work
    # Forces that may depend on any coordinates and rates, leaves of `work`.
    values: tuple[Leaf, ...]

    def __hash__(self) -> int:
        # As of a constraint: templates are keys of caches.
        return hash(self.type_name)


@dataclass(frozen=True, slots=True)
class LoadDerivatives:
    """What a load adds to the equations of motion, by its own coordinates."""

    M: tuple[tuple[ex.Scalar, ...], ...]  # mass matrix, row by row
    Q: tuple[ex.Scalar, ...]  # generalised forces
    # Q_q, Q_q_dot: their derivatives: a row for each of Q, a column for each of the load's own
    # coordinates and then of the others on which its values depend.
    Q_q: tuple[tuple[ex.Scalar, ...], ...]
    Q_q_dot: tuple[tuple[ex.Scalar, ...], ...]


def slope_of(leaf: Leaf, column: int, *, by_rate: bool) -> Leaf:
    """Return the symbol of the derivative of a value by a coordinate, or by its rate."""
    name = f"{leaf.name}_by_{'rate' if by_rate else 'q'}_{column}"
    return ex.Symbol(name) if isinstance(leaf, ex.Symbol) else ex.VectorSymbol(name, leaf.size)


@cache
def derive_load(template: LoadTemplate, others: int, *, varies: bool) -> LoadDerivatives:
    """Derive M, Q and its Jacobians of a type of load."""
    motion: Direction = dict(zip(template.coordinates, template.rates, strict=True))
    by_q, by_rate = _columns(template.coordinates), _columns(template.rates)
    momenta = [along(template.energy, direction) for direction in by_rate]
    M = tuple(tuple(simplified(along(p, direction)) for direction in by_rate) for p in momenta)
    Q = tuple(
        simplified(ex.sum_of((along(template.energy, by), -along(p, motion), *_work(template, by))))
        for p, by in zip(momenta, by_q, strict=True)
    )

    def jacobian(columns: list[Direction], *, by_rate: bool) -> tuple[tuple[ex.Scalar, ...], ...]:
        directions: list[Direction] = [*columns, *({} for _ in range(others))]
        if varies:
            directions = [
                {**own, **{leaf: slope_of(leaf, k, by_rate=by_rate) for leaf in template.values}}
                for k, own in enumerate(directions)
            ]
        return tuple(
            tuple(simplified(along(force, direction)) for direction in directions) for force in Q
        )

    return LoadDerivatives(M, Q, jacobian(by_q, by_rate=False), jacobian(by_rate, by_rate=True))


def _columns(symbols: tuple[Leaf, ...]) -> list[Direction]:
    return [{item: unit} for item in symbols for unit in units(item)]


def _work(template: LoadTemplate, direction: Direction) -> tuple[ex.Scalar, ...]:
    return tuple(inner(force, along(moved, direction)) for force, moved in template.work)


def inner(force: ex.Expression, displacement: ex.Expression) -> ex.Scalar:
    """Return the product of a force and a displacement, of vectors the scalar product."""
    if isinstance(force, ex.Vector):
        assert isinstance(displacement, ex.Vector)
        return ex.dot(force, displacement)
    assert isinstance(displacement, ex.Scalar)
    return force * displacement


def simplified(expression: ex.Scalar) -> ex.Scalar:
    """Return an expression whose products of vectors of one frame are formed in that frame.

    :math:`(A u)^T A v = u^T v`, and in the plane :math:`(A u)^T B v = u^T R v`, which is zero where
    both are the same. The axes are unit vectors across each other.
    """
    match expression:
        case ex.Sum(terms):
            return ex.sum_of(tuple(map(simplified, terms)))
        case ex.Product(factors):
            return ex.product_of(tuple(map(simplified, factors)))
        case ex.Power(base, exponent):
            return ex.power_of(simplified(base), exponent)
        case ex.Dot(ex.Basis(axis), ex.Basis(other_axis)):
            return ex.ONE if axis == other_axis else ex.ZERO
        case ex.Dot(
            ex.Rotated(PlaneRotation() as rotation, u, first), ex.Rotated(other, v, second)
        ):
            if rotation == other:
                return _in_frame(u, v, len(second) - len(first))
    return expression


def _in_frame(u: ex.Vector, v: ex.Vector, quarters: int) -> ex.Scalar:
    """Return u^T R^quarters v; a vector has no component across itself."""
    if quarters == 0:
        return ex.dot(u, v)
    if u == v:
        return ex.ZERO
    return quarters * ex.dot(u, ex.perpendicular(v))
