"""The engine of the grouped form: equal blocks of a large sparse matrix side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.runtime.engine.blocks import BlockSolver
from kincompile.runtime.engine.linear import Linear, Rates
from kincompile.runtime.engine.scales import Point

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Compiled


class Sparse(Linear):
    """An engine of one point at a time, in grouped form: Phi_q is the entries of its pattern."""

    def __init__(self, code: Compiled, p: Array) -> None:
        assert code.evaluate is not None
        self.code, self._p, self._evaluate = code, p, code.evaluate
        self._solver = BlockSolver(code)
        self.reference = np.ones(len(code.coordinates))  # scales of the coordinates

    @property
    def pivoted(self) -> int:
        """How often the planned solve was not good enough."""
        return self._solver.pivoted

    def evaluate(self, q: Array, t: float) -> Point:
        """Evaluate Phi and the entries of Phi_q at one point."""
        return Point(q, t, *self._evaluate(q, t, self._p))

    def factor(self, point: Point) -> None:
        """Factor Phi_q of a point, once."""
        if point.factors is None:
            point.factors = self._solver.factor(point.Phi_q)

    def solve(self, point: Point, b: Array, *, checked: bool = False) -> Array:
        """Return x of Phi_q x = b, in half the time if it is not checked in the equations.

        Corrections of Newton's method need no check: convergence would reveal a bad one.
        """
        self.factor(point)
        return self._solver.solve(point.factors, b, self.reference if checked else None)

    def rates(self, point: Point, extra_rhs: Array | None) -> Rates:
        """Return the rates at a point; with `extra_rhs` also x of Phi_q x = extra_rhs."""
        q, t, p = point.q, point.t, self._p
        nu = self.code.nu(q, t, p)
        q_dot = self.solve(point, nu, checked=True)
        if not np.isfinite(q_dot).all():
            nothing = np.full(q.size, np.nan)
            return Rates(q_dot, nothing, nothing, nu, nothing)
        gamma = self.code.gamma(q, q_dot, t, p)
        q_ddot = self.solve(point, gamma, checked=True)
        movement = np.empty(0) if extra_rhs is None else self.solve(point, extra_rhs)
        return Rates(q_dot, q_ddot, movement, nu, gamma)

    def missing(self, point: Point, x: Array, b: Array) -> Array:
        """Return Phi_q x - b."""
        return self._solver.product(point.Phi_q, x) - b

    def determinants(self, point: Point, before: Point) -> Array:
        """Return the determinants of the blocks."""
        self.factor(point)
        return self._solver.determinants(point.factors)
