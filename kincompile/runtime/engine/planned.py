"""The engine of the planned elimination: batches of points or parameter sets, or plain floats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import SMALLEST_DETERMINANT
from kincompile.runtime.engine.engine import Point, Rates, rates_agree

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Code, LaneFunctions

Lanes = Sequence[Any] | NDArray[np.float64]
"""One lane a coordinate or an equation: a float, or an array (N,) over a batch."""


@dataclass(slots=True, eq=False)
class Planned:
    """An engine whose linear systems go by the elimination that was planned at compile time."""

    code: Code  # a module with a planned solve
    p: Lanes  # (k,) or (k, N), or sequence of float: parameters, of all points or a set for each
    # The module's elementary functions of floats, where positions are lists of floats: one of them
    # then takes as long as a few calls of NumPy. None for those of arrays.
    functions: Any = None

    @property
    def _own(self) -> tuple[LaneFunctions, Any]:
        """The code of the mechanism, and the elementary functions that it is given."""
        own = self.code.lanes
        assert own is not None
        return own, self.functions or own.arrays

    def evaluate(self, q: Any, t: Any) -> Point:
        """Evaluate Phi and the varying entries of Phi_q."""
        own, functions = self._own
        values = own.position(functions, q, t, self.p)
        m = len(self.code.equations)
        return Point(q, t, values[:m], values[m:])

    def factor(self, point: Point) -> None:
        """Factor Phi_q of a point, once; the determinants of its blocks come with it."""
        if point.factors is None:
            own, functions = self._own
            point.factors = own.factor(functions, point.Phi_q)

    def solve(self, point: Point, b: Lanes) -> Any:
        """Return x of Phi_q x = b, one lane a coordinate."""
        self.factor(point)
        own, functions = self._own
        return own.solve(functions, point.factors[0], b)

    def solve_transposed(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q^T x = b: column by column of the inverse, which the plan knows."""
        n = len(self.code.equations)
        sides = np.eye(n)[:, :, np.newaxis]
        columns = (stacked(self.solve(point, side), point.q.shape[1]) for side in sides)
        return np.array([np.sum(b * column, axis=0) for column in columns])

    def velocity_and_acceleration(self, point: Point) -> tuple[Lanes, Lanes]:
        """Return the rates at a point, one lane a coordinate."""
        own, functions = self._own
        q_dot = self.solve(point, own.nu(functions, point.q, point.t, self.p))
        gamma = own.gamma(functions, point.q, q_dot, point.t, self.p)
        return q_dot, self.solve(point, gamma)

    def rates(self, point: Point, besides: Array | None) -> Rates:
        """Return the rates at a point, and x of Phi_q x = besides if that is asked for."""
        q_dot, q_ddot = self.velocity_and_acceleration(point)
        movement = () if besides is None else self.solve(point, besides)
        points = point.q.shape[1]
        found = Rates(*(stacked(part, points) for part in (q_dot, q_ddot, movement)))
        if self.code.redundant:  # the elimination leaves them out
            states = point.q, found.q_dot, found.q_ddot
            return replace(found, agree=rates_agree(self.code, point.t, self.p, states))
        return found

    def determinants(self, point: Point, before: Point | None = None) -> Array:
        """Return the determinants of the blocks, shape (blocks, N)."""
        self.factor(point)
        return stacked(point.factors[1], point.q.shape[1])

    def signs(self, point: Point) -> tuple[float, ...]:
        """Return the signs at the first point."""
        return tuple(np.sign(self.determinants(point)[:, 0]).tolist())


def stacked(lanes: Lanes, points: int) -> Array:
    """Return lanes, some of which may be one number for all points, as an array (..., N)."""
    result = np.empty((len(lanes), points))
    for row, lane in zip(result, lanes, strict=True):
        row[:] = lane
    return result


def trusted(determinants: Array) -> NDArray[np.bool_]:
    """Return at which of N points elimination can be trusted, by determinants (blocks, N)."""
    sizes = np.abs(determinants)
    smallest = SMALLEST_DETERMINANT * np.max(sizes, axis=1, initial=0.0, where=sizes < np.inf)
    found: NDArray[np.bool_] = np.all(sizes > smallest[:, np.newaxis], axis=0)
    return found
