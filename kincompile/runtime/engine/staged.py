"""The engine of large mechanisms: Phi_q stays sparse, and is solved in stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.runtime.engine.engine import Point, Rates
from kincompile.runtime.engine.stages import StagedSolver

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Code


class Staged:
    """An engine of one point at a time, in grouped form: Phi_q is the entries of its pattern."""

    def __init__(self, code: Code, p: Array) -> None:
        assert code.evaluate is not None
        self.code, self._p, self._evaluate = code, p, code.evaluate
        self._solver = StagedSolver(code)

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
            try:
                point.factors = self._solver.factor(point.Phi_q)
            except RuntimeError:  # a sparse stage is exactly singular
                point.factors = ()

    def solve(self, point: Point, b: Array, *, checked: bool = False) -> Array:
        """Return x of Phi_q x = b, in half the time if it is not checked in the equations.

        A correction of Newton's method need not be: its convergence tells.
        """
        self.factor(point)
        if not point.factors:
            return np.full(point.q.size, np.nan)
        return self._solver.solve(point.factors, b, checked=checked)

    def solve_transposed(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q^T x = b."""
        self.factor(point)
        if not point.factors:
            return np.full(point.q.size, np.nan)
        return self._solver.solve_transposed(point.factors, b)

    def rates(self, point: Point, besides: Array | None) -> Rates:
        """Return the rates at a point, and x of Phi_q x = besides if that is asked for."""
        q, t, p = point.q, point.t, self._p
        q_dot = self.solve(point, self.code.nu(q, t, p), checked=True)
        if not np.isfinite(q_dot).all():
            nothing = np.full(q.size, np.nan)
            return Rates(q_dot, nothing, nothing)
        q_ddot = self.solve(point, self.code.gamma(q, q_dot, t, p), checked=True)
        movement = np.empty(0) if besides is None else self.solve(point, besides)
        return Rates(q_dot, q_ddot, movement)

    def determinants(self, point: Point, before: Point) -> Array:
        """Return the determinants of the blocks."""
        self.factor(point)
        return self._solver.determinants(point.factors) if point.factors else np.zeros(1)

    def signs(self, point: Point) -> tuple[float, ...]:
        """Return the signs of the determinants."""
        return tuple(np.sign(self.determinants(point, point)).tolist())
