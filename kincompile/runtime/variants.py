"""Many parameter sets of one mechanism at once: the march on arrays over the variants.

All variants take the same steps in time together. A variant that does anything out of the ordinary,
at the start or on the way, is followed by the careful march alone for that step, and no other
variant notices.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    KINK_UNSEEN,
    MAX_CORRECTIONS,
    RESIDUAL_FACTOR,
    ROUNDING,
    SMALL_ERROR,
    SMALLEST_DETERMINANT,
    SMOOTH_UNSEEN,
    TOO_NEAR,
)
from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.runtime.lanes import LaneCode
from kincompile.runtime.march import State, advance, complete, start
from kincompile.runtime.problem import problem
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.march import Outcome
    from kincompile.runtime.problem import Problem

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

CHUNK = 2048
"""Variants at a time, so that intermediate arrays stay in the cache and memory is bounded."""


def read_variants(module: ModuleType, p: object) -> Array | None:
    """Return parameter sets of shape (B, k) where `p` has the shape (B, 1, k), else None.

    Raises
    ------
    InputError
        When a set has the wrong size or a value is not finite.
    """
    if not isinstance(p, np.ndarray) or p.ndim != 3:
        return None
    count, one, size = p.shape
    if one != 1 or size != len(module.PARAMETERS) or count == 0 or p.dtype.kind not in "iuf":
        raise InputError(
            f"p has shape {p.shape} and type {p.dtype}: give real numbers of shape "
            f"(B, 1, {len(module.PARAMETERS)}) for B variants of {listed(module.PARAMETERS)}."
        )
    sets = np.ascontiguousarray(p[:, 0], dtype=np.float64)
    bad = np.argwhere(~np.isfinite(sets))
    if bad.size:
        variant, which = bad[0].tolist()
        raise InputError(
            f"parameter {module.PARAMETERS[which]!r} of variant {variant} is "
            f"{sets[variant, which]}: give a finite number."
        )
    return sets


@dataclass(frozen=True, slots=True, eq=False)
class _Arrays:
    """The arrays of the solution: motion (3, N, n, B) for q, q_dot, q_ddot, the others (N, B).

    The variants are the last axis, as in the code that fills them.
    """

    motion: Array
    status: NDArray[np.int64]
    residual: Array
    iterations: NDArray[np.int64]

    @classmethod
    def over(cls, inputs: Inputs, count: int) -> _Arrays:
        """Make the arrays for so many variants, with nothing reached."""
        points, n = inputs.t.size, inputs.guess.size
        return cls(
            np.empty((3, points, n, count)),
            np.full((points, count), int(Status.NOT_REACHED)),
            np.full((points, count), np.nan),
            np.zeros((points, count), dtype=np.int64),
        )


def solve_variants(
    inputs: Inputs, sets: Array, progress: Callable[[int, int], object] | None
) -> Solution:
    """Solve all variants over the time grid.

    Parameters
    ----------
    inputs
        Module, times, guess and tolerance; its parameters are not used.
    sets : ndarray, shape (B, k)
        Parameters of each variant.
    progress : callable, optional
        Called as ``progress(done, total)`` after each chunk of variants.

    Returns
    -------
    Solution
        With arrays q, q_dot, q_ddot of shape (B, N, n) and a status per variant and point.
    """
    count = len(sets)
    arrays = _Arrays.over(inputs, count)
    with np.errstate(all="ignore"):  # what is not finite gets a status, not a warning
        for first in range(0, count, CHUNK):
            chunk = slice(first, min(first + CHUNK, count))
            _solve_chunk(inputs, sets[chunk], arrays, chunk)
            if progress:
                progress(chunk.stop, count)
    return _solution(inputs, sets, arrays)


def solve_in_turn(
    inputs: Inputs,
    sets: Array,
    alone: Callable[[Inputs], Solution],
    progress: Callable[[int, int], object] | None,
) -> Solution:
    """Solve variants of a module that has no lanes, one after the other, as `alone` does."""
    arrays = _Arrays.over(inputs, len(sets))
    for variant, p in enumerate(sets):
        solution = alone(replace(inputs, p=p))
        arrays.motion[..., variant] = solution.q, solution.q_dot, solution.q_ddot
        arrays.status[:, variant] = solution.status
        arrays.residual[:, variant] = solution.residual
        arrays.iterations[:, variant] = solution.iterations
        if progress:
            progress(variant + 1, len(sets))
    return _solution(inputs, sets, arrays)


def _solve_chunk(inputs: Inputs, sets: Array, arrays: _Arrays, chunk: slice) -> None:
    """Solve some of the variants: compiled, where the module can, and with care those that fail."""
    march = getattr(inputs.module, "march_variants", None)
    if march is None:
        _Chunk(inputs, sets, arrays, chunk.start).run()
        return
    residual = np.empty((inputs.t.size, len(sets)))
    status, iterations = np.empty((2, *residual.shape), dtype=np.intc)
    march(inputs, sets, arrays.motion[..., chunk], residual, status, iterations)
    arrays.residual[:, chunk] = residual
    arrays.status[:, chunk], arrays.iterations[:, chunk] = status, iterations
    failed = np.flatnonzero(status.any(axis=0))
    if failed.size:
        alone = _Arrays.over(inputs, failed.size)
        _Chunk(inputs, sets[failed], alone, 0).run()
        arrays.motion[..., chunk.start + failed] = alone.motion
        arrays.status[:, chunk.start + failed] = alone.status
        arrays.residual[:, chunk.start + failed] = alone.residual
        arrays.iterations[:, chunk.start + failed] = alone.iterations


class _Chunk:
    """Variants that are solved together."""

    def __init__(self, inputs: Inputs, sets: Array, arrays: _Arrays, first: int) -> None:
        self._inputs, self._sets, self._arrays, self._first = inputs, sets, arrays, first
        self._code = LaneCode(inputs.module, inputs.module.ARRAYS, np.ascontiguousarray(sets.T))
        count = len(sets)
        self._alive = np.ones(count, dtype=bool)
        self._q, self._q_dot, self._q_ddot = np.empty((3, inputs.guess.size, count))
        self._signs: Any = np.zeros((0, count))
        self._smallest: Any = 0.0
        nominal = problem(inputs.module, sets[0], inputs.guess, float(inputs.t[0]), inputs.guess)
        self._allowed = RESIDUAL_FACTOR * inputs.tolerance * nominal.magnitude
        self._spread = nominal.spread(inputs.guess)[:, np.newaxis]

    def run(self) -> None:
        """Go through the grid with all variants."""
        times = self._inputs.t.tolist()
        guess = np.repeat(self._inputs.guess[:, np.newaxis], len(self._sets), axis=1)
        good, iterations = self._correct(guess, times[0], self._inputs.max_iterations)
        self._record(0, good, iterations)
        self._smallest = SMALLEST_DETERMINANT * self._sizes
        for variant in np.flatnonzero(~good).tolist():
            equations = self._equations(variant, self._inputs.guess, times[0])
            self._take(0, variant, start(equations, times[0], self._inputs_of(variant)))
        for index in range(1, len(times)):
            self._step(index, times)

    def _step(self, index: int, times: list[float]) -> None:
        """Take all variants that are left from one time to the next."""
        h = times[index] - times[index - 1]
        before = self._q.copy(), self._q_dot.copy(), self._q_ddot.copy()
        signs = self._signs.copy()
        predicted = self._q + h * (self._q_dot + (0.5 * h) * self._q_ddot)
        good, iterations = self._correct(predicted, times[index], MAX_CORRECTIONS)
        good &= np.max(np.abs(self._q - predicted) / self._spread, axis=0) <= SMALL_ERROR
        good &= (self._signs == signs).all(axis=0)
        good &= self._is_smooth(before, predicted, h)
        self._record(index, good, iterations)
        for variant in np.flatnonzero(self._alive & ~good).tolist():
            equations = self._equations(variant, before[0][:, variant], times[index - 1])
            state = _state(equations, times[index - 1], [part[:, variant] for part in before])
            if isinstance(state, Status):
                self._fail(index, variant, state)
            else:
                outcome = advance(equations, state, times[index], self._inputs_of(variant))
                self._take(index, variant, outcome)

    def _is_smooth(self, before: tuple[Array, Array, Array], predicted: Array, h: float) -> Mask:
        """Say where the velocity is as well predicted as the position is."""
        change = self._q_dot - (before[1] + h * before[2])
        kink = abs(h) * np.max(np.abs(change) / self._spread, axis=0)
        error = np.max(np.abs(self._q - predicted) / self._spread, axis=0)
        return np.asarray(kink <= KINK_UNSEEN * (error + SMOOTH_UNSEEN))

    def _correct(self, q: Array, t: float, corrections: int) -> tuple[Mask, NDArray[np.int64]]:
        """Run Newton's method on all variants; keep what it gives, and say where it is good."""
        q = q.copy()
        tolerance = self._inputs.tolerance
        done = np.zeros(q.shape[1], dtype=bool)
        iterations = np.zeros(q.shape[1], dtype=np.int64)
        for _ in range(corrections):
            at = self._code.position(q, t)
            change = np.array(np.broadcast_arrays(*self._code.solve(at, at.Phi), q[0])[:-1])
            change[:, done] = 0.0
            q -= change
            iterations += ~done
            allowed = tolerance * self._spread + ROUNDING * np.abs(q)
            done |= (np.abs(change) <= allowed).all(axis=0)
            if (done | ~self._alive).all():
                break
        return self._complete(q, t, done), iterations

    def _complete(self, q: Array, t: float, done: Mask) -> Mask:
        """Solve for velocity and acceleration, and check what was found."""
        at = self._code.position(q, t)
        residual = np.max(np.abs(np.array(np.broadcast_arrays(*at.Phi, q[0])[:-1])), axis=0)
        good = done & self._alive
        for value, limit in zip(at.Phi, self._allowed.tolist(), strict=True):
            good &= np.abs(value) <= limit
        q_dot, q_ddot = self._code.rates(at, q, t)
        self._q = q
        for rows, values in ((self._q_dot, q_dot), (self._q_ddot, q_ddot)):
            for row, value in zip(rows, values, strict=True):
                row[:] = value
        good &= np.isfinite(self._q_dot.sum(axis=0) + self._q_ddot.sum(axis=0))
        determinants = _blocks(at.determinants, q.shape[1])
        self._signs, self._sizes = np.sign(determinants), np.abs(determinants)
        self._residual = residual
        good &= (self._sizes > self._smallest).all(axis=0)
        return good

    def _record(self, index: int, good: Mask, iterations: NDArray[np.int64]) -> None:
        """Write down the variants that are good at a point."""
        arrays, own = self._arrays, slice(self._first, self._first + good.size)
        for target, values in zip(
            arrays.motion[:, index], (self._q, self._q_dot, self._q_ddot), strict=True
        ):
            target[:, own] = values if good.all() else np.where(good, values, np.nan)
        arrays.status[index, own][good] = Status.CONVERGED
        arrays.residual[index, own][good] = self._residual[good]
        arrays.iterations[index, own][good] = iterations[good]

    def _take(self, index: int, variant: int, outcome: Outcome) -> None:
        """Write down what the careful march found for one variant, and let it go on from there."""
        if outcome.status is not Status.CONVERGED or outcome.state is None:
            self._fail(index, variant, outcome.status)
            return
        if outcome.state.sensitivity > TOO_NEAR:  # its rates are too uncertain to go on from
            self._fail(index, variant, Status.SINGULAR)
            return
        arrays, place, state = self._arrays, self._first + variant, outcome.state
        self._q[:, variant] = state.point.q
        self._q_dot[:, variant] = state.q_dot
        self._q_ddot[:, variant] = state.q_ddot
        arrays.motion[:, index, :, place] = state.point.q, state.q_dot, state.q_ddot
        arrays.status[index, place] = Status.CONVERGED
        arrays.residual[index, place] = np.max(np.abs(state.point.Phi))
        arrays.iterations[index, place] = outcome.iterations
        lane = LaneCode(
            self._inputs.module, self._inputs.module.FLOATS, self._sets[variant].tolist()
        )
        determinants = lane.position(state.point.q.tolist(), state.t).determinants
        self._signs[:, variant] = np.sign(_blocks(determinants, 1)[:, 0])

    def _fail(self, index: int, variant: int, status: Status) -> None:
        """Write down why a variant ends; its place in the arrays is kept busy with its guess."""
        self._arrays.status[index, self._first + variant] = status
        self._alive[variant] = False
        self._q[:, variant] = self._inputs.guess
        self._q_dot[:, variant] = self._q_ddot[:, variant] = 0.0

    def _equations(self, variant: int, q: Array, t: float) -> Problem:
        return problem(self._inputs.module, self._sets[variant], q, t, self._inputs.guess)

    def _inputs_of(self, variant: int) -> Inputs:
        return replace(self._inputs, p=self._sets[variant])


def _blocks(determinants: Any, count: int) -> Array:
    """Return the determinants of the blocks as an array, shape (blocks, count)."""
    result = np.empty((len(determinants), count))
    for block, values in enumerate(determinants):
        result[block] = values
    return result


def _state(equations: Any, t: float, parts: list[Array]) -> State | Status:
    """Return a variant's last good point in the form of the careful march."""
    point = equations.at(np.ascontiguousarray(parts[0]), t)
    return Status.NOT_FINITE if point is None else complete(equations, t, point)


def _solution(inputs: Inputs, sets: Array, arrays: _Arrays) -> Solution:
    module = inputs.module
    q, q_dot, q_ddot = arrays.motion.transpose(0, 3, 1, 2)
    statuses = arrays.status.T
    failed = np.flatnonzero((statuses != Status.CONVERGED).any(axis=1))
    message = f"{module.NAME}: all {len(sets)} variants converged at all {inputs.t.size} points."
    if failed.size:
        variant = int(failed[0])
        index = int(np.argmax(statuses[variant] != Status.CONVERGED))
        status = next(item for item in Status if item == statuses[variant, index])
        message = (
            f"{module.NAME}: {failed.size} of {len(sets)} variants failed; the first is variant "
            f"{variant} at t = {inputs.t[index]:.10g} ({status.name}). {status.sentence}"
        )
    return Solution(
        t=inputs.t,
        q=q,
        q_dot=q_dot,
        q_ddot=q_ddot,
        status=statuses,
        residual=arrays.residual.T,
        iterations=arrays.iterations.T,
        success=failed.size == 0,
        message=message,
        name=module.NAME,
        coordinates=module.COORDINATES,
        equations=module.EQUATIONS,
        units=dict(module.UNITS),
        parameters=dict(zip(module.PARAMETERS, sets.T, strict=True)),
        statistics={"coarse": 0, "marched": 0},
        events=[],
        module=module,
    )
