"""Outputs over a motion, those of other code at its points, and outputs between the points.

What asks between points, as measures do, is a generator (`Between`): it yields a time at which
outputs are not known yet, and goes on when they are. So the same code measures one motion, each
time followed by the careful march, and those of many parameter sets side by side, whose times are
found in one batch.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

from kincompile.criteria import (
    FIRST_DIFFERENCE,
    MAX_CORRECTIONS,
    SLIGHT,
    STILL,
    TOLERANCE,
    probe_of,
)
from kincompile.runtime.engine.linear import Planned, trusted
from kincompile.runtime.march import March, State, all_hold
from kincompile.runtime.memory import empty
from kincompile.runtime.results.columns import Observed
from kincompile.runtime.singular.events import quintic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.results.columns import MotionTable

T = TypeVar("T")
Between: TypeAlias = Generator[float, None, T]

BLOCK = 500
"""Points whose matrices are taken at a time, so that they fit into memory."""

SHARP = 1e-2
"""Part of the largest rate from which on a jump over twice `FIRST_DIFFERENCE` is a corner."""

FEW = 4
"""Times up to which a batch costs more than finding each by itself."""


def observed(code: Compiled, motion: tuple[Array, Array, Array], t: Array, p: Any) -> Observed:
    """Evaluate the outputs of a mechanism over a motion (..., N, n) with parameters p (..., k)."""
    names = code.outputs
    units = {name: code.units[name] for name in names}
    sets = np.asarray(p, dtype=np.float64)
    if sets.ndim > 1:
        sets = sets[:, np.newaxis]
    # Where second rates were found, so were position and velocity; nearly always that is all.
    if names and math.isfinite(float(motion[2].sum())):
        y, y_dot, y_ddot = _everywhere(code, motion, t, sets)
        return Observed(names, units, y, y_dot, y_ddot)
    results = np.full((3, *motion[0].shape[:-1], len(names)), np.nan)
    if names:
        if sets.ndim > 1:
            sets = np.broadcast_to(sets, (*motion[0].shape[:-1], sets.shape[-1]))

        def observe(at: NDArray[np.bool_], q_ddot: Array) -> NDArray[Any]:
            times, own = np.broadcast_to(t, at.shape)[at], sets[at] if sets.ndim > 1 else sets
            return np.array(code.observe(motion[0][at], motion[1][at], q_ddot, times, own))

        position, complete = (
            np.isfinite(sum(part.sum(axis=-1) for part in parts)) for parts in (motion[:2], motion)
        )
        if complete.any():
            results[:, complete] = observe(complete, motion[2][complete])
        corner = position & ~complete
        if corner.any():
            # Without an acceleration an output has what no acceleration changes.
            probe = np.broadcast_to(probe_of(motion[0].shape[-1]), motion[0][corner].shape)
            some, other = observe(corner, probe), observe(corner, probe**2)
            results[:, corner] = np.where(some == other, some, np.nan)
    return Observed(names, units, *results)


def _everywhere(code: Compiled, motion: Sequence[Array], t: Array, p: Array) -> Sequence[Array]:
    """Return the outputs, their rates and second rates of a motion that was found throughout."""
    observe = code.observe_into
    if observe is None or motion[0].ndim != 2 or p.ndim != 1:
        found: Sequence[Array] = code.observe(*motion, t, p)
        return found
    seen = empty((3, len(code.outputs), t.size))
    with np.errstate(all="ignore"):
        observe([part.T for part in motion], t, p, seen)
    return [part.T for part in seen]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """L points of a motion, of all variants one after the other."""

    p: Array  # (k,), or (k, L)
    t: Array  # (L,)
    # (n, L) each
    q: Array
    q_dot: Array
    q_ddot: Array

    @classmethod
    def of(cls, solution: MotionTable) -> Points:
        """Return the points of a motion."""
        *shape, n = solution.q.shape
        p = solution.p if len(shape) == 1 else np.repeat(solution.p, shape[-1], axis=0)
        states = (part.reshape(-1, n).T for part in (solution.q, solution.q_dot, solution.q_ddot))
        return cls(p.T, np.broadcast_to(solution.t, shape).ravel(), *states)

    def at(self, some: NDArray[Any]) -> Points:
        """Return some of the points."""
        p = self.p if self.p.ndim == 1 else self.p[:, some]
        states = (state[:, some] for state in (self.q, self.q_dot, self.q_ddot))
        return Points(p, self.t[some], *states)

    def parts(self, wanted: NDArray[np.bool_]) -> Iterator[tuple[NDArray[np.intp], Points]]:
        """Yield some of the points that are wanted after the others, with their numbers."""
        numbers = np.flatnonzero(wanted)
        for start in range(0, numbers.size, BLOCK):
            own = numbers[start : start + BLOCK]
            yield own, self.at(own)

    def observe(self, code: Compiled, p: Array, orders: int = 1) -> Array:
        """Return outputs of some code and their rates below an order, (orders, r, L)."""
        found = empty((orders, len(code.outputs), self.t.size))
        assert code.observe_into is not None
        with np.errstate(all="ignore"):
            code.observe_into((self.q, self.q_dot, self.q_ddot), self.t, p, found)
        return found

    def solved(self, code: Compiled, count: int, orders: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return the last outputs of some code, and where its planned solve can be trusted.

        By what part of their terms equations are missed, and determinants, come before them.
        """
        found = self.observe(code, self.p, orders)
        first = len(code.outputs) - count
        return found[:, first:], trusted(found[0, 0], found[0, 1:first])


class ObservedMotion:
    """Outputs over rising times (N,), and between them."""

    def __init__(self, solution: MotionTable, code: Compiled, p: Array) -> None:
        own = solution.observed
        good = np.flatnonzero(np.isfinite(solution.q_dot).all(axis=1))
        self.t, order = np.unique(solution.t[good], return_index=True)
        self.rows = good[order]
        # Forces are not followed between the times; they come after all that is.
        self.names = tuple(name for name in own.names if name not in own.without_rates)
        self.units, count = own.units, len(self.names)
        y, y_dot, y_ddot = (part[self.rows, :count] for part in (own.y, own.y_dot, own.y_ddot))
        self.emitted: NDArray[np.bool_] = np.any(np.isfinite(y_dot), axis=0)
        self.y, self.y_dot, self.y_ddot = y, y_dot, y_ddot
        for k in np.flatnonzero(~self.emitted).tolist():
            y_dot[:, k] = derivative(self.t, y[:, k])
        self.span = float(self.t[-1] - self.t[0])
        self._solution, self._code, self.p = solution, code, p
        on_grid = np.array((self.y, self.y_dot, self.y_ddot)).transpose(1, 0, 2)
        self.known: dict[float, Array] = dict(zip(self.t.tolist(), on_grid, strict=True))
        self._states: dict[int, State | None] = {}
        self._is_free = len(code.equations) < len(solution.coordinates)
        size = np.abs(y)
        with np.errstate(invalid="ignore"):
            middle = np.median(np.where(np.isfinite(size), size, 0.0), axis=0)
        # Points of the grid that lie on a pole, as those of a ratio of rates.
        self.is_far: NDArray[np.bool_] = np.isinf(size) | ((size > middle / STILL) & (middle > 0))
        self._scales = self._largest()

    def scale(self, k: int) -> float:
        """Return the largest number of the unit of an output."""
        return self._scales[self.units[self.names[k]]]

    def at(self, t: float, k: int) -> Between[tuple[float, float, float]]:
        """Return an output and its rates at any time in the span; NaN where it cannot be followed.

        A rate that is not emitted is that of the polynomial of fourth degree around it.
        """
        y, y_dot, y_ddot = (yield from self._observed(t))[:, k]
        if not self.emitted[k]:
            h = FIRST_DIFFERENCE * self.span
            at = yield from self.values([t + part * h for part in (-2, -1, 1, 2)], k)
            y_dot = (8 * (at[2] - at[1]) - (at[3] - at[0])) / (12 * h)
        return float(y), float(y_dot), float(y_ddot)

    def values(self, times: Sequence[float], k: int) -> Between[list[float]]:
        """Return an output at any times in the span."""
        found = []
        for t in times:
            found.append(float((yield from self._observed(t))[0, k]))
        return found

    def has_corner(self, t: float, k: int, rate: float, most: float) -> Between[bool]:
        """Say whether an output turns back in a corner, where its rate jumps, at most by `most`."""
        if self.emitted[k]:
            return not abs(rate) <= SLIGHT * most
        h = FIRST_DIFFERENCE * self.span
        before, here, after = yield from self.values([t - h, t, t + h], k)
        bend = before - 2 * here + after
        return not abs(bend) <= SHARP * h * most

    def _observed(self, t: float) -> Between[Array]:
        """Return all outputs and their rates at a time, shape (3, k); ask for it if need be."""
        if t not in self.known:
            yield t
        return self.known[t]

    def look(self, t: float) -> None:
        """Find the outputs and their rates at a time."""
        motion = self._interpolated(t) if self._is_free else self._followed(t)
        found = np.full((3, len(self.names)), np.nan)
        if motion is not None:
            with np.errstate(all="ignore"):
                found = np.array(self._code.observe(*motion, t, self.p))
        self.known[t] = found

    def _followed(self, t: float) -> tuple[Array, Array, Array] | None:
        """Follow the motion from a neighbour on the grid, the nearer one first."""
        near = sorted(self._neighbours(t), key=lambda k: abs(float(self.t[k]) - t))
        for state in filter(None, map(self._on_grid, near)):
            with np.errstate(all="ignore"):
                outcome = self.march.advance(state, t, MAX_CORRECTIONS)
            if outcome.position is not None:
                found = outcome.state
                return None if found is None else (found.point.q, found.q_dot, found.q_ddot)
        return None

    def _interpolated(self, t: float) -> tuple[Array, Array, Array]:
        """Return a motion that follows from forces, between its points."""
        own, rows = self._solution, self.rows[self._neighbours(t)]
        ends = [(own.q[row], own.q_dot[row], own.q_ddot[row]) for row in rows.tolist()]
        times = own.t[rows].tolist()
        return ends[0] if len(ends) == 1 else quintic(times[0], ends[0], times[1], ends[1], t)

    def _neighbours(self, t: float) -> list[int]:
        """Return the numbers of the points before and after a time."""
        after = min(int(np.searchsorted(self.t, t)), self.t.size - 1)
        return sorted({max(after - 1, 0), after})

    def _on_grid(self, k: int) -> State | None:
        """Return a point of the grid as a state from which the motion is followed."""
        if k not in self._states:
            point = self.march.equations.at(self.position(k), float(self.t[k]))
            state = None if point is None else self.march.state(point)
            self._states[k] = state if isinstance(state, State) else None
        return self._states[k]

    @cached_property
    def march(self) -> March:
        """What follows the motion."""
        return March.at(self._code, self.p, self.position(0), self.t[0], TOLERANCE)

    def nearest(self, t: float) -> int:
        """Return the number of the point of the grid that is nearest to a time."""
        return min(self._neighbours(t), key=lambda k: abs(float(self.t[k]) - t))

    def position(self, k: int) -> Array:
        """Return the position at a point of the grid."""
        return np.ascontiguousarray(self._solution.q[self.rows[k]])

    def _largest(self) -> dict[str, float]:
        """Return the largest number of each unit."""
        names = (*self._solution.coordinates, *self.names)
        y = np.where(self.is_far, 0.0, self.y)
        values = np.abs(np.column_stack((self._solution.q[self.rows], y))).max(axis=0)
        units = self._solution.units
        found: dict[str, float] = {"rad": 1.0}
        for name, value in zip(names, values.tolist(), strict=True):
            unit = units.get(name, "")
            found[unit] = max(found.get(unit, 0.0), value)
        return found


def together(motions: Sequence[ObservedMotion], asking: Sequence[Between[T]]) -> list[T]:
    """Return what comes out of motions of one module, which share their batches."""
    found: dict[int, T] = {}
    while len(found) < len(motions):
        times = {}
        for number, ask in enumerate(asking):
            if number not in found:
                try:
                    times[number] = next(ask)
                except StopIteration as end:
                    found[number] = end.value
        _look_together([(motions[number], t) for number, t in times.items()])
    return [found[number] for number in range(len(motions))]


def _look_together(wanted: Sequence[tuple[ObservedMotion, float]]) -> None:
    """Find outputs, each of a motion at a time; what is out of the ordinary by itself."""
    good = np.zeros(len(wanted), dtype=bool)
    code = wanted[0][0].march.equations.code if len(wanted) > FEW else None
    if code is not None and code.lanes is not None and code.observe_into is not None:
        places = [motion.nearest(t) for motion, t in wanted]
        pairs = [(motion, place) for (motion, _), place in zip(wanted, places, strict=True)]
        q = np.array([motion.position(place) for motion, place in pairs]).T.copy()
        begin = np.array([motion.t[place] for motion, place in pairs])
        times = np.array([t for _, t in wanted])
        p = np.array([motion.p for motion, _ in wanted]).T.copy()
        march = March(wanted[0][0].march.equations, Planned(code, p), TOLERANCE)
        with np.errstate(all="ignore"):
            state, checks = march.complete(march.engine.evaluate(q, begin))
            following, is_near, _ = march.step_together(state, times, MAX_CORRECTIONS)
            good = all_hold(is_near, checks)
            seen = np.empty((3, len(code.outputs), times.size))
            states = following.point.q, following.q_dot, following.q_ddot
            code.observe_into(states, times, p, seen)
        for number in np.flatnonzero(good).tolist():
            motion, t = wanted[number]
            motion.known[t] = seen[:, : len(motion.names), number]
    for number in np.flatnonzero(~good).tolist():
        motion, t = wanted[number]
        motion.look(t)


def derivative(t: Array, values: Array) -> Array:
    """Return the derivative of a spline of fifth degree, where no rate is emitted."""
    degree = 5 if t.size > 5 else 3 if t.size > 3 else 1
    if t.size < 2 or not np.isfinite(values).all():
        return np.full(t.size, np.nan)
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(t, values, degree).derivative()(t), dtype=np.float64)
