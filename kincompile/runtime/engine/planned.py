"""The engine of the planned elimination: batches of points or parameter sets, or plain floats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import AGREEMENT, SMALLEST_DETERMINANT, SOLVED
from kincompile.runtime.engine.linear import Linear, Rates, sizes_of
from kincompile.runtime.engine.scales import Point

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Compiled, LaneFunctions
    from kincompile.runtime.engine.scales import Scales

Lanes = Sequence[Any] | NDArray[np.float64]
"""One lane a coordinate or an equation: a float, or an array (N,) over a batch."""

SLOW = 0.1
"""Part of its largest speed down to which one coordinate shows how fast all are."""

SEED = 1989
"""Of the weights of points."""


@dataclass(slots=True, eq=False)
class Planned(Linear):
    """An engine whose linear systems go by the elimination that was planned at compile time."""

    code: Compiled  # a module with a planned solve
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

    def velocity_and_acceleration(self, point: Point) -> tuple[Lanes, Lanes, Lanes, Lanes]:
        """Return nu, q_dot, gamma and q_ddot at a point, one lane an equation or coordinate."""
        own, functions = self._own
        nu = own.nu(functions, point.q, point.t, self.p)
        q_dot = self.solve(point, nu)
        gamma = own.gamma(functions, point.q, q_dot, point.t, self.p)
        return nu, q_dot, gamma, self.solve(point, gamma)

    def rates(
        self, point: Point, extra_rhs: Array | None, into: tuple[Array, Array] | None = None
    ) -> Rates:
        """Return the rates at a point, in arrays (n, N) that are given or new ones; see there."""
        nu, q_dot, gamma, q_ddot = self.velocity_and_acceleration(point)
        movement = () if extra_rhs is None else self.solve(point, extra_rhs)
        points = point.q.shape[1]
        velocity, acceleration = into or np.empty((2, len(q_dot), points))
        fill(velocity, q_dot)
        fill(acceleration, q_ddot)
        return Rates(velocity, acceleration, stacked(movement, points), nu, gamma)

    def missing(self, point: Point, x: Array, b: Lanes) -> Lanes:
        """Return Phi_q x - b, a row each."""
        rows, varying = [-right for right in b], iter(point.Phi_q)
        for row, column, number in self.code.entries:
            rows[row] = rows[row] + (next(varying) if number is None else number) * x[column]
        return rows

    def meet(self, scales: Scales, point: Point, rates: Rates) -> Any:
        """Say where the equations of rates hold; all together, where all points of a batch do."""
        together = self._meet_together(scales, point, rates)
        return together or Linear.meet(self, scales, point, rates)

    def parts(self, scales: Scales, point: Point) -> Array:
        """Return what each equation may be missed by; the solve leaves some of them out."""
        code, part = scales.code, np.asarray(SOLVED)
        if code.redundant:
            part = np.where(np.isin(code.equations, code.redundant), AGREEMENT, SOLVED)
        return np.asarray(part * scales.magnitude)

    def _meet_together(self, scales: Scales, point: Point, rates: Rates) -> bool:
        """Say whether all points of a batch meet together what each of them must meet.

        They do nearly always, and one number a row costs less than a mask. Velocities and
        accelerations are divided by their sizes and added up with weights of size 1/2 to 1, drawn
        at random with their signs: no errors cancel. Nearly always one coordinate shows how fast
        all are, and gives the sizes.
        """
        middle = np.abs(rates.q_dot[:, rates.q_dot.shape[1] // 2]) / scales.reference
        fast = int(np.argmax(middle))
        speed = np.abs(rates.q_dot[fast]) / scales.reference[fast]
        growth = speed * speed
        if not speed.min() > SLOW * speed.max():  # it turns back, or all are at rest
            speed, growth = sizes_of(scales, rates)
        parts = self.parts(scales, point)
        q_dot, q_ddot = rates.q_dot, rates.q_ddot
        weights = weights_of_points(speed.size)
        first, second = weights[0] / speed, weights[1] / growth
        sums = q_dot @ first + q_ddot @ second
        rows = (self.code.constant @ sums).tolist()
        for row, (nu, gamma) in enumerate(zip(rates.nu, rates.gamma, strict=True)):
            rows[row] -= sum_of(first, nu) + sum_of(second, gamma)
        x, part = np.empty_like(first), np.empty_like(first)
        for column, entries in self.code.varying:
            np.multiply(q_dot[column], first, out=x)
            np.multiply(q_ddot[column], second, out=part)
            x += part
            for row, place in entries:
                rows[row] += sum_of(x, point.Phi_q[place])
        return bool((np.abs(rows) <= 0.5 * parts).all())

    def determinants(self, point: Point, before: Point | None = None) -> Array:
        """Return the determinants of the blocks, shape (blocks, N)."""
        self.factor(point)
        return stacked(point.factors[1], point.q.shape[1])

    def signs(self, point: Point) -> tuple[float, ...]:
        """Return the signs at the first point."""
        return tuple(np.sign(self.determinants(point)[:, 0]).tolist())


@lru_cache(maxsize=16)
def weights_of_points(count: int) -> Array:
    """Return numbers of size 1/2 to 1 and either sign, drawn at random, (2, count)."""
    drawn = np.random.default_rng(SEED).uniform(-0.5, 0.5, (2, count))
    weights = np.asarray(drawn + np.copysign(0.5, drawn))
    weights.setflags(write=False)
    return weights


def sum_of(weights: Array, lane: Any) -> Any:
    """Return the weighted sum of a lane, which may be one number for all points."""
    if isinstance(lane, np.ndarray):
        return weights.dot(lane)
    return lane * weights.sum() if lane else 0.0


def stacked(lanes: Lanes, points: int) -> Array:
    """Return lanes, some of which may be one number for all points, as an array (..., N)."""
    result = np.empty((len(lanes), points))
    fill(result, lanes)
    return result


def fill(rows: Array, lanes: Lanes) -> None:
    """Write lanes into the rows of an array (..., N)."""
    for row, lane in zip(rows, lanes, strict=True):
        row[:] = lane


def trusted(missed: Array, determinants: Array) -> NDArray[np.bool_]:
    """Return at which of N points solves by elimination can be trusted.

    They are by what part of their terms equations are missed, (N,), and by determinants,
    (blocks, N): near a singular configuration errors are large though the equations hold.
    """
    sizes = np.abs(determinants)
    smallest = SMALLEST_DETERMINANT * np.max(sizes, axis=1, initial=0.0, where=sizes < np.inf)
    found: NDArray[np.bool_] = np.all(sizes > smallest[:, np.newaxis], axis=0)
    return found & (missed <= SOLVED)
