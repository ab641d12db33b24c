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
from kincompile.design.demands import deviation
from kincompile.design.designs import Designs
from kincompile.design.rows import Columns, Motions
from kincompile.errors import KincompileWarning
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.engine.linear import Planned
from kincompile.runtime.lanes import some_of
from kincompile.runtime.march import March, all_hold
from kincompile.runtime.problem import problem
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.design.columns import Column
    from kincompile.design.targets import Passing
    from kincompile.design.trial import Workbench
    from kincompile.design.variables import Variables

    Array = NDArray[np.float64]

_SCIPY: Any = optimize
"""Its types leave out what it exports."""

STEPS = 72
"""Steps in time at least, so that a step is short enough to be followed."""

MOST_AT_ONCE = 2048
"""Sets that are taken through time together."""

FEWEST, MOST_POINTS = 64, 2**18
"""Sets at once at least, and points of their motions, so that memory is bounded."""

MOST_KEPT = 512
"""Starts that are kept, the best ones."""

GENERATIONS, FEWEST_BRED = 40, 5
"""Of differential evolution, and the fewest sets that SciPy breeds from."""


@dataclass(slots=True, eq=False)
class Search:
    """Scores many sets of parameters."""

    bench: Workbench
    variables: Variables  # the parameters
    guesses: Array  # (g, n): positions from which the mechanism is assembled
    # tried, moved: how many sets were tried, each from all guesses, and how many times one got
    # through
    tried: int = 0
    moved: int = 0
    farthest: float = -np.inf  # the latest time that a set has reached
    first: float = np.nan  # the error of the first set, infinite where it does not get through
    found: Designs = field(default_factory=Designs.none)  # the best ones first
    _times: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Choose the times."""
        given = [item.times for item, _ in self.bench.demands.passing if item.times is not None]
        spans = [np.linspace(first, last, STEPS + 1) for first, last in self.bench.demands.free]
        kept = np.unique(np.concatenate([self.bench.demands.grid, *given, *spans, np.zeros(0)]))
        between = np.linspace(kept[0], kept[-1], STEPS + 1)
        self._times = np.unique(np.concatenate([kept, between]))

    @property
    def is_empty(self) -> bool:
        """Whether no set gets through the times."""
        return not self.found.error.size

    def spread(self, count: int, seed: Sequence[int]) -> None:
        """Try sets that are spread evenly over the bounds, and the defaults first."""
        self._tried(self._parts(count, seed))

    def sets(self, count: int, seed: Sequence[int]) -> Array:
        """Return the first sets (count, k) that are tried."""
        return self.variables.to_x(self._parts(count, seed))

    def drawing(self) -> Array | None:
        """Return the values that the model has, (k,), where they lie within the bounds."""
        defaults = code_of(self.bench.module).defaults
        x = defaults[[self.bench.module.PARAMETERS.index(name) for name in self.bench.names]]
        return x if self.variables.hold(x) else None

    def _parts(self, count: int, seed: Sequence[int]) -> Array:
        """Return numbers of the unit interval, (count, k), by Sobol's sequence."""
        sequence = qmc.Sobol(self.variables.low.size, seed=np.random.default_rng(seed))
        parts = np.asarray(sequence.random_base2(max(1, (count - 1).bit_length()))[:count])
        if (x := self.drawing()) is not None:
            parts[0] = self.variables.to_u(x)
        return parts

    def breed(self, count: int, seed: Sequence[int]) -> None:
        """Try sets that differential evolution breeds, starting with such a spread."""
        parts = self._parts(max(count, FEWEST_BRED), seed)

        def score(columns: Array) -> Array:
            found = self._tried(np.clip(np.atleast_2d(columns.T), 0.0, 1.0))
            return np.where(np.isfinite(found), found, 1e30)

        _SCIPY.differential_evolution(
            score, [(0.0, 1.0)] * len(self.bench.names), init=parts, maxiter=GENERATIONS,
            seed=np.random.default_rng(seed), vectorized=True, updating="deferred", polish=False,
            tol=1e-3,
        )  # fmt: skip

    def _tried(self, parts: Array) -> Array:
        """Return the scores of sets, and count them."""
        found = self.scores(parts)
        if not self.tried:
            self.first = float(found[0])
        self.tried += len(parts)
        return found

    def scores(self, parts: Array, own: Array | None = None) -> Array:
        """Return the least error of each set over its assemblies, infinite where it has none.

        Each may also have a guess of its own, (B, n).
        """
        values = self.variables.to_x(parts)
        found = np.full(len(values), np.inf)
        count = min(MOST_AT_ONCE, max(FEWEST, MOST_POINTS // self._times.size))
        for first in range(0, len(values), count):
            some = values[first : first + count]
            places = slice(first, first + len(some))
            for guess in (*self.guesses, *([] if own is None else [own[places]])):
                found[places] = np.minimum(found[places], self._scored(some, guess))
        return found

    def _scored(self, values: Array, guess: Array) -> Array:
        """Return the errors of sets that are assembled from a guess, or (B, n); keep the best."""
        sets = self.bench.sets(values)
        alive, motion = self._through(sets, guess)
        self.moved += alive.size
        errors = np.full(len(values), np.inf)
        if not alive.size:
            return errors
        seen = Columns(code_of(self.bench.module), motion, self._times, sets[alive])
        instants = [self._instants(seen, *item) for item in self.bench.demands.passing]
        on_grid = np.searchsorted(self._times, self.bench.demands.grid)
        t = np.broadcast_to(self._times, (alive.size, self._times.size))
        rows = Motions(self.bench.demands, t, on_grid, instants, seen.column, is_fine=False)
        error = rows.costs()
        is_whole = np.isfinite(error) & np.all(
            [np.diff(x).min(axis=1, initial=1) > 0 for x in instants], axis=0
        )
        errors[alive] = error = np.where(is_whole, error, np.inf)
        own = np.argsort(error, kind="stable")[:MOST_KEPT]
        own = own[np.isfinite(error[own])]
        places = np.concatenate(
            [np.broadcast_to(on_grid, (alive.size, on_grid.size)), *instants], 1
        )
        x = np.concatenate([values[alive], *self._variables(instants)], axis=1)
        q = np.take_along_axis(motion[0][own], places[own][..., np.newaxis], axis=1)
        some = Designs(error[own], x[own], self._times[places[own]], q)
        self.found = Designs.best([self.found, some], MOST_KEPT)
        return errors

    def _instants(
        self, seen: Columns, target: Passing, columns: Sequence[Column]
    ) -> NDArray[np.intp]:
        """Return which times a passing target is looked at, (B, K): those given, or the best."""
        if target.times is not None:
            at = np.searchsorted(self._times, target.times)
            return np.broadcast_to(at, (seen.count, at.size))
        free = next(
            span
            for span, (own, _) in zip(
                self.bench.demands.free, self.bench.demands.untimed, strict=True
            )
            if own is target
        )
        inside = np.flatnonzero((self._times >= free[0]) & (self._times <= free[1]))
        total: Any = 0.0
        for k, column in enumerate(columns):
            got = seen.column(column.of, column.order)[:, inside, np.newaxis]
            total = total + (target.weights[k] * deviation(target.values[:, k], column, got)) ** 2
        return np.asarray(inside[in_order(total)[1]])

    def _variables(self, instants: Sequence[NDArray[np.intp]]) -> list[Array]:
        """Return the variables that are times: of each target the first, and the steps."""
        own = [
            self._times[places]
            for places, (target, _) in zip(instants, self.bench.demands.passing, strict=True)
            if target.times is None
        ]
        return [np.concatenate((t[:, :1], np.diff(t, axis=1)), axis=1) for t in own]

    def _through(self, sets: Array, guess: Array) -> tuple[NDArray[np.intp], tuple[Array, ...]]:
        """Return which sets get through all times, and q, q_dot, q_ddot, each (B, N, n)."""
        code, times = code_of(self.bench.module), self._times.tolist()
        if code.redundant:
            return self._through_with_care(sets, guess)
        alive = np.arange(len(sets))
        history: list[Array] = []
        with np.errstate(all="ignore"):
            equations = problem(code, sets[0], self.guesses[0], times[0])

            def march() -> March:
                lanes = np.ascontiguousarray(sets[alive].T)
                return March(equations, Planned(code, lanes), TOLERANCE)

            on_way = march()
            q = np.broadcast_to(guess, (len(sets), guess.shape[-1])).T.copy()
            found = on_way.correct_together(q, times[0], MAX_ITERATIONS)
            state, checks = on_way.complete(found.point)
            good = all_hold(found.good, checks)
            for t in (*times[1:], None):
                if not good.all():
                    alive, state = alive[good], some_of(state, good)
                    history = [part[..., good] for part in history]
                    if not alive.size:
                        return alive, ()
                    on_way = march()
                history.append(np.array((state.point.q, state.q_dot, state.q_ddot)))
                self.farthest = max(self.farthest, float(np.max(state.t)))
                if t is not None:
                    state, good, _ = on_way.step_together(state, t, MAX_ITERATIONS)
        q, q_dot, q_ddot = np.moveaxis(np.array(history), (1, 3), (0, 1))
        return alive, (q, q_dot, q_ddot)

    def _through_with_care(
        self, sets: Array, guess: Array
    ) -> tuple[NDArray[np.intp], tuple[Array, ...]]:
        """Return the same of redundant equations.

        Those that are solved may be singular where all together are not, so that the careful march
        has to help. It begins all sets from one guess.
        """
        guess = guess if guess.ndim == 1 else self.guesses[0]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", KincompileWarning)
            found = solve(self.bench.module, self._times, sets[:, np.newaxis], guess)
        reached = self._times[np.flatnonzero(found.good.any(axis=0))]
        self.farthest = max(self.farthest, *reached.tolist()) if reached.size else self.farthest
        alive = np.flatnonzero(found.good.all(axis=1))
        return alive, tuple(part[alive] for part in (found.q, found.q_dot, found.q_ddot))


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
