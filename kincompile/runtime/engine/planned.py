"""The engine of the planned elimination: batches of points, or of parameter sets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.runtime.engine.engine import Point, Rates
from kincompile.runtime.engine.lanes import LaneCode, Lanes

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Code


class Planned:
    """An engine whose linear systems go by the elimination that was planned at compile time.

    Parameters
    ----------
    code
        A module with a planned solve.
    p : ndarray, shape (k,) or (k, N)
        Parameters, of all points or a set for each.
    """

    def __init__(self, code: Code, p: Array) -> None:
        assert code.lanes is not None
        self.code, self._p = code, p
        self._lanes = LaneCode(code, code.lanes.arrays, p)

    def evaluate(self, q: Array, t: Any) -> Point:
        """Evaluate Phi and the varying entries of Phi_q."""
        Phi, entries = self._lanes.evaluate(q, t)
        return Point(q, t, Phi, entries)

    def factor(self, point: Point) -> None:
        """Factor Phi_q of a point, once."""
        if point.factors is None:
            point.factors = self._lanes.factor(point.Phi, point.Phi_q)

    def solve(self, point: Point, b: Lanes) -> Array:
        """Return x of Phi_q x = b, shape (n, N)."""
        self.factor(point)
        return stacked(self._lanes.solve(point.factors, b), point.q.shape[1])

    def solve_transposed(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q^T x = b: column by column of the inverse, which the plan knows."""
        n = len(self.code.equations)
        columns = (self.solve(point, np.eye(n)[:, [k]]) for k in range(n))
        return np.array([np.sum(b * column, axis=0) for column in columns])

    def rates(self, point: Point, besides: Array | None) -> Rates:
        """Return the rates at a point, and x of Phi_q x = besides if that is asked for."""
        q_dot, q_ddot = np.empty((2, *point.q.shape))
        self.put_rates(point, q_dot, q_ddot)
        movement = np.empty(0) if besides is None else self.solve(point, besides)
        return Rates(q_dot, q_ddot, movement)

    def put_rates(self, point: Point, *places: Array) -> None:
        """Put velocity and acceleration at a point into arrays of shape (n, N)."""
        self.factor(point)
        for rows, lanes in zip(
            places, self._lanes.rates(point.factors, point.q, point.t), strict=True
        ):
            for row, lane in zip(rows, lanes, strict=True):
                row[:] = lane

    def determinants(self, point: Point, before: Point | None = None) -> Array:
        """Return the determinants of the blocks, shape (blocks, N)."""
        self.factor(point)
        return stacked(point.factors.determinants, point.q.shape[1])

    def signs(self, point: Point) -> tuple[float, ...]:
        """Return the signs at the first point."""
        return tuple(np.sign(self.determinants(point)[:, 0]).tolist())


def stacked(lanes: Lanes, points: int) -> Array:
    """Return lanes, some of which may be one number for all points, as an array (..., N)."""
    if isinstance(lanes, np.ndarray):
        return lanes
    result = np.empty((len(lanes), points))
    for row, lane in zip(result, lanes, strict=True):
        row[:] = lane
    return result
