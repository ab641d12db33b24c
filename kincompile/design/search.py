"""Where to start a fit: many sets of parameters at once, in all ways to assemble them.

The sets are spread over the bounds by Sobol's sequence, or bred by SciPy's differential evolution.
Each is assembled from every way to assemble the mechanism that was found beforehand, and taken
through time together with the others (`March.step_together`); one that does not get through is no
start. Points without times are looked for along the path, in their order.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import optimize
from scipy.stats import qmc

from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.design.demands import compared, deviation, sides
from kincompile.design.trial import EAGERNESS
from kincompile.errors import KincompileWarning
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.engine.linear import Planned
from kincompile.runtime.march import March, all_hold
from kincompile.runtime.problem import problem
from kincompile.runtime.results.observed import observed
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.design.columns import Column
    from kincompile.design.demands import Demands
    from kincompile.design.targets import Passing
    from kincompile.runtime.engine.code import Compiled

    Array = NDArray[np.float64]

_SCIPY: Any = optimize
"""Its types leave out what it exports."""

STEPS = 72
"""Steps in time at least, so that a step is short enough to be followed."""

MOST_AT_ONCE = 2048
"""Sets that are taken through time together."""

WIDE = 10.0
"""Greatest over least value of a bound above which a parameter is spread by its logarithm."""

GENERATIONS = 40
"""Of differential evolution."""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where a fit may start: its score, variables, position and the number of its assembly."""

    score: float
    x: Array
    q: Array
    assembly: int


@dataclass(slots=True, eq=False)
class Search:
    """Scores many sets of parameters."""

    # module, demands, names, fixed: as of a `Workbench`
    module: ModuleType
    demands: Demands
    names: tuple[str, ...]
    fixed: dict[str, float]
    bounds: Array  # (k, 2): of the parameters
    guesses: Array  # (g, n): positions from which the mechanism is assembled
    # tried, moved: how many sets were tried, each from all guesses, and how many times one got
    # through
    tried: int = 0
    moved: int = 0
    farthest: float = -np.inf  # the latest time that a set has reached
    best: list[Start] = field(default_factory=list)
    _times: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Choose the times."""
        given = [item.times for item, _ in self.demands.passing if item.times is not None]
        spans = [np.linspace(first, last, STEPS + 1) for first, last in self.demands.free]
        kept = np.unique(np.concatenate([self.demands.grid, *given, *spans, np.zeros(0)]))
        between = np.linspace(kept[0], kept[-1], STEPS + 1)
        self._times = np.unique(np.concatenate([kept, between]))

    def spread(self, count: int, seed: int) -> None:
        """Try sets that are spread evenly over the bounds."""
        size = max(1, (count - 1).bit_length())
        parts = qmc.Sobol(len(self.names), seed=seed).random_base2(size)[:count]
        self.scores(parts)

    def breed(self, count: int, seed: int) -> None:
        """Try sets that differential evolution breeds, starting with such a spread."""
        size = max(1, (count - 1).bit_length())
        parts = qmc.Sobol(len(self.names), seed=seed).random_base2(size)[:count]

        def score(columns: Array) -> Array:
            found = self.scores(np.clip(np.atleast_2d(columns.T), 0.0, 1.0))
            return np.where(np.isfinite(found), found, 1e30)

        _SCIPY.differential_evolution(
            score, [(0.0, 1.0)] * len(self.names), init=parts, maxiter=GENERATIONS, seed=seed,
            vectorized=True, updating="deferred", polish=False, tol=1e-3,
        )  # fmt: skip

    def values(self, parts: Array) -> Array:
        """Return parameters (B, k) from numbers of the unit interval."""
        low, high = self.bounds.T
        is_wide = (low > 0) & (high > WIDE * low)
        safe = np.where(is_wide, low, 1.0)
        ratio = np.where(is_wide, high, 1.0) / safe
        found: Array = np.where(is_wide, safe * ratio**parts, low + (high - low) * parts)
        return found

    def scores(self, parts: Array) -> Array:
        """Return the least error of each set over its assemblies, infinite where it has none."""
        values = self.values(parts)
        found = np.full(len(values), np.inf)
        for first in range(0, len(values), MOST_AT_ONCE):
            some = values[first : first + MOST_AT_ONCE]
            for number, guess in enumerate(self.guesses):
                own = self._scored(some, guess, number)
                found[first : first + len(some)] = np.minimum(found[first : first + len(some)], own)
        self.tried += len(values)
        return found

    def _scored(self, values: Array, guess: Array, number: int) -> Array:
        """Return the scores of sets that are assembled from a guess, and remember good ones."""
        sets = np.repeat(self._own_defaults()[np.newaxis], len(values), axis=0)
        places = [self.module.PARAMETERS.index(name) for name in self.names]
        sets[:, places] = values
        alive, motion = self._through(sets, guess)
        self.moved += alive.size
        scores = np.full(len(values), np.inf)
        if not alive.size:
            return scores
        seen = _Columns(code_of(self.module), motion, self._times, sets[alive])
        error, variables = self._errors(seen, alive.size)
        scores[alive] = error
        for k in np.argsort(error)[:MOST_AT_ONCE].tolist():
            if np.isfinite(error[k]):
                x = np.concatenate((values[alive[k]], variables[k]))
                q = motion[0][k, self._first_place(variables[k])]
                self.best.append(Start(float(error[k]), x, q, number))
        return scores

    def _own_defaults(self) -> Array:
        p = code_of(self.module).defaults.copy()
        for name, value in self.fixed.items():
            p[self.module.PARAMETERS.index(name)] = value
        return p

    def _first_place(self, variables: Array) -> int:
        """Return the number of the first time that a trial with these times asks for."""
        instants = self.demands.instants(variables)
        first = min(at[0] for at in (*instants, self.demands.grid) if at.size)
        return int(np.argmin(np.abs(self._times - first)))

    def _through(self, sets: Array, guess: Array) -> tuple[NDArray[np.intp], tuple[Array, ...]]:
        """Return which sets get through all times, and q, q_dot, q_ddot, each (B, N, n)."""
        code, times = code_of(self.module), self._times.tolist()
        if code.redundant:
            return self._through_with_care(sets, guess)
        with np.errstate(all="ignore"):
            equations = problem(code, sets[0], guess, times[0])
            march = March(equations, Planned(code, np.ascontiguousarray(sets.T)), TOLERANCE)
            q = np.repeat(guess[:, np.newaxis], len(sets), axis=1)
            found = march.correct_together(q, times[0], MAX_ITERATIONS)
            state, checks = march.complete(found.point)
            good = all_hold(found.good, checks)
            history = []
            for t in times[1:]:
                history.append((state.point.q, state.q_dot, state.q_ddot))
                if not good.any():
                    break
                self.farthest = max(self.farthest, state.t)
                state, is_good, _ = march.step_together(state, t, MAX_ITERATIONS)
                good = good & is_good
            history.append((state.point.q, state.q_dot, state.q_ddot))
        alive = np.flatnonzero(good)
        if not alive.size:
            return alive, ()
        self.farthest = times[-1]
        parts = zip(*history, strict=True)
        return alive, tuple(
            np.stack([np.asarray(x)[:, alive].T for x in part], 1) for part in parts
        )

    def _through_with_care(
        self, sets: Array, guess: Array
    ) -> tuple[NDArray[np.intp], tuple[Array, ...]]:
        """Return the same of redundant equations.

        Those that are solved may be singular where all together are not, so that the careful march
        has to help.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", KincompileWarning)
            found = solve(self.module, self._times, sets[:, np.newaxis], guess)
        reached = self._times[np.flatnonzero(found.good.any(axis=0))]
        self.farthest = max(self.farthest, *reached.tolist()) if reached.size else self.farthest
        alive = np.flatnonzero(found.good.all(axis=1))
        return alive, tuple(part[alive] for part in (found.q, found.q_dot, found.q_ddot))

    def _errors(self, seen: _Columns, count: int) -> tuple[Array, Array]:
        """Return the error of each set, and its variables that are times."""
        total, times, free = np.zeros(count), [], iter(self.demands.free)
        for target, columns in self.demands.passing:
            off = self._deviations(seen, target, columns)
            if target.times is not None:
                at = np.searchsorted(self._times, target.times)
                total += off[:, at, np.arange(at.size)].sum(axis=1)
                continue
            first, last = next(free)
            inside = (self._times >= first) & (self._times <= last)
            error, chosen = in_order(off[:, inside])
            total += error
            own = self._times[inside][chosen]
            times.append(np.concatenate((own[:, :1], np.diff(own, axis=1)), axis=1))
        for shape, columns in self.demands.shaped:
            when = np.searchsorted(self._times, shape.times)
            paths = np.stack([seen[x.of, x.order][:, when] for x in columns], axis=-1)
            total += [np.sum(compared(shape, path)[0] ** 2) for path in paths]
        on_grid = np.searchsorted(self._times, self.demands.grid)
        for item, column, is_constant in self.demands.limits:
            places = slice(0, 1) if is_constant else on_grid
            for side in sides(item):
                gap = side.left(seen[column.of, column.order][:, places])
                total += EAGERNESS**2 * (np.minimum(gap, 0.0) ** 2).sum(axis=1)
        for ratio, column in self.demands.ratios:
            y = seen[column.of, column.order][:, on_grid]
            grid = self.demands.grid
            step, whole = grid[1] - grid[0], grid[-1] - grid[0]
            rise = (grid[y.argmax(axis=1)] - grid[y.argmin(axis=1)]) % whole
            got = rise / np.maximum(whole - rise, step)
            total += (ratio.weight * (got - ratio.ratio)) ** 2
        total = np.where(np.isfinite(total), total, np.inf)
        return total, np.concatenate([*times, np.empty((count, 0))], axis=1)

    def _deviations(self, seen: _Columns, target: Passing, columns: Sequence[Column]) -> Array:
        """Return the squared deviation of each wanted point at each time, shape (B, N, K)."""
        total: Any = 0.0
        for k, column in enumerate(columns):
            got = seen[column.of, column.order][..., np.newaxis]
            total = total + (target.weights[k] * deviation(target.values[:, k], column, got)) ** 2
        found: Array = total
        return found

    def ranked(self, count: int) -> list[Start]:
        """Return the best starts, each of another set, no two of which are nearly the same."""
        chosen: list[Start] = []
        span = np.ptp(self.bounds, axis=1)
        k = len(self.names)
        for item in sorted(self.best, key=lambda item: item.score):
            near = any(
                item.assembly == other.assembly
                and np.max(np.abs(item.x[:k] - other.x[:k]) / span) < APART
                for other in chosen
            )
            if not near:
                chosen.append(item)
            if len(chosen) == count:
                break
        return chosen


APART = 0.01
"""Part of the bounds within which two starts are one."""


class _Columns:
    """The columns of motions, (B, N), by name and order, evaluated once."""

    def __init__(self, code: Compiled, motion: tuple[Array, ...], t: Array, sets: Array) -> None:
        self._coordinates = code.coordinates
        self._motion = motion
        q, q_dot, q_ddot = motion
        self._outputs = observed(code, (q, q_dot, q_ddot), t, sets)

    def __getitem__(self, key: tuple[str, int]) -> Array:
        """Return a coordinate or an output, or a rate of it."""
        name, order = key
        if name in self._coordinates:
            return self._motion[order][..., self._coordinates.index(name)]
        return self._outputs.column(name, order).values


def in_order(off: Array) -> tuple[Array, NDArray[np.intp]]:
    """Choose times for points so that their order is kept and the sum of deviations is least.

    Of deviations (B, N, K) of point k at time i, with N at least K, these are the sums (B,),
    infinite where there are too few times, and the rising numbers of the times (B, K).
    """
    sets, count, points = off.shape
    chosen = np.zeros((sets, points), dtype=np.intp)
    if count < points:
        return np.full(sets, np.inf), chosen
    rows = np.arange(sets)
    # least[:, i]: the least sum of the points so far with the last at time i or before; where: it.
    least, places = np.zeros((sets, count)), []
    for k in range(points):
        own = off[..., k].copy()
        own[:, 1:] += least[:, :-1] if k else 0.0
        own[:, :k] = np.inf
        is_new = own <= np.minimum.accumulate(own, axis=1)
        where = np.maximum.accumulate(np.where(is_new, np.arange(count), 0), axis=1)
        places.append(where)
        least = np.minimum.accumulate(own, axis=1)
    last = np.full(sets, count - 1)
    for k in range(points - 1, -1, -1):
        chosen[:, k] = places[k][rows, last]
        last = chosen[:, k] - 1
    return least[:, -1], chosen
