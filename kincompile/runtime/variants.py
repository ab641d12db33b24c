"""Many parameter sets of one mechanism at once: the march on arrays over the variants.

All variants take the same steps in time together. A variant that does anything out of the ordinary,
at the start or on the way, is followed by the careful march alone for that step, and no other
variant notices.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import MAX_CORRECTIONS, TOO_NEAR
from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.march import March, Outcome, State, all_hold, give_up, start
from kincompile.runtime.problem import largest, problem
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.inputs import Inputs, Values

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

CHUNK = 2048
"""Variants at a time, so that intermediate arrays stay in the cache and memory is bounded."""


@dataclass(frozen=True, slots=True, eq=False)
class Variants:
    """Parameter sets as they were given.

    Attributes
    ----------
    common
        Parameters of all sets, as `solve` takes those of one; of the first set, where they differ.
    sets : ndarray, shape (B, k), or None
        The sets, where an array of them was given.
    sweep
        Arrays of values by the names of their parameters.
    is_product
        Whether every value of one goes with every value of the others; else they go in pairs.
    problems
        What is wrong with them.
    """

    common: Values = None
    sets: Array | None = None
    sweep: Mapping[str, Array] = field(default_factory=dict)
    is_product: bool = False
    problems: tuple[str, ...] = ()

    def parameters(self, inputs: Inputs) -> Array | None:
        """Return the parameters of each set, shape (B, k); None where there is one set."""
        if not self.sweep:
            return self.sets
        values = [array.ravel() for array in self._grid()]
        result = np.tile(inputs.p, (values[0].size, 1))
        for name, column in zip(self.sweep, values, strict=True):
            result[:, inputs.module.PARAMETERS.index(name)] = column
        return result

    def _grid(self) -> Sequence[Array]:
        arrays = tuple(self.sweep.values())
        return np.meshgrid(*arrays, indexing="ij") if self.is_product else arrays


def read_variants(module: ModuleType, p: Values, product: bool) -> Variants:
    """Read parameters that may be those of several sets: see `solve`.

    Raises
    ------
    InputError
        When an array of sets has the wrong size or a value is not finite.
    """
    if isinstance(p, Mapping):
        return _read_sweep(p, product)
    if not isinstance(p, np.ndarray) or p.ndim != 3:
        return Variants(p)
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
    return Variants(sets[0], sets)


def _read_sweep(p: Mapping[str, Any], product: bool) -> Variants:
    """Read parameters by name, of which some have an array of values."""
    problems: list[str] = []
    common, sweep = dict(p), {}
    for name, given in p.items():
        if isinstance(given, str) or np.ndim(given) != 1:
            continue
        values = np.asarray(given)
        if values.size == 0 or values.dtype.kind not in "iuf":
            problems.append(f"parameter {name!r} has the values {given!r}: give real numbers.")
            common.pop(name)
            continue
        sweep[name] = values.astype(np.float64)
        bad = values[~np.isfinite(values)]
        common[name] = bad[0] if bad.size else values[0]
    sizes = {name: values.size for name, values in sweep.items()}
    if len(set(sizes.values())) > 1 and not product:
        counts = listed(f"{size} of {name!r}" for name, size in sizes.items())
        problems.append(
            f"the parameters have values of different numbers, {counts}: arrays are taken in "
            "pairs, so give them one length, or product=True (--product) to solve every "
            f"combination, {math.prod(sizes.values())} of them."
        )
    return Variants(common, None, sweep, product, tuple(problems))


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
    march = inputs.code.march_variants
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
    """Variants that are solved together, and alone for the steps that are out of the ordinary."""

    def __init__(self, inputs: Inputs, sets: Array, arrays: _Arrays, first: int) -> None:
        self._inputs, self._sets, self._arrays, self._first = inputs, sets, arrays, first
        self._times: list[float] = inputs.t.tolist()
        self._alive = np.ones(len(sets), dtype=bool)
        engine = Planned(inputs.code, np.ascontiguousarray(sets.T))
        nominal = problem(inputs.module, sets[0], inputs.guess, self._times[0], inputs.guess)
        self._march = March(nominal, engine, inputs.tolerance)

    def run(self) -> None:
        """Go through the grid with all variants."""
        inputs, time = self._inputs, self._times[0]
        guess = np.repeat(inputs.guess[:, np.newaxis], len(self._sets), axis=1)
        found = self._march.correct(guess, time, inputs.max_iterations)
        state, checks = self._march.complete(found.point)
        good = all_hold(found.good, checks)
        self._record(0, state, good, found.iterations)
        for variant in np.flatnonzero(~good).tolist():
            alone = self._alone(variant, inputs.guess)
            own = replace(inputs, p=self._sets[variant])
            self._take(0, state, variant, start(alone, time, own))
        for index in range(1, len(self._times)):
            state = self._step(index, state)

    def _step(self, index: int, state: State) -> State:
        """Take all variants that are left from one time to the next."""
        t = self._times[index]
        following, good, iterations = self._march.step_together(state, t, MAX_CORRECTIONS)
        good &= self._alive
        self._record(index, following, good, iterations)
        for variant in np.flatnonzero(self._alive & ~good).tolist():
            alone = self._alone(variant, state.point.q[:, variant])
            point = alone.equations.at(np.ascontiguousarray(state.point.q[:, variant]), state.t)
            known = Status.NOT_FINITE if point is None else alone.state(point)
            if isinstance(known, Status):
                outcome = Outcome(known, 0, None)
            else:
                outcome = alone.advance(known, t, self._inputs.max_iterations)
                if outcome.position is None:
                    own = replace(self._inputs, p=self._sets[variant])
                    outcome = give_up(alone, outcome, t, own)
            self._take(index, following, variant, outcome)
        return following

    def _alone(self, variant: int, q: Array) -> March:
        """Return the march of one variant."""
        inputs, time = self._inputs, self._times[0]
        equations = problem(inputs.module, self._sets[variant], q, time, inputs.guess)
        return March(equations, equations.engine, inputs.tolerance)

    def _record(self, index: int, state: State, good: Mask, iterations: Any) -> None:
        """Write down the variants that are good at a point."""
        arrays, own = self._arrays, slice(self._first, self._first + good.size)
        found = state.point.q, state.q_dot, state.q_ddot
        for target, values in zip(arrays.motion[:, index], found, strict=True):
            target[:, own] = values if good.all() else np.where(good, values, np.nan)
        arrays.status[index, own][good] = Status.CONVERGED
        arrays.residual[index, own][good] = largest(state.point.Phi, good.size)[good]
        arrays.iterations[index, own][good] = iterations[good]

    def _take(self, index: int, state: State, variant: int, outcome: Outcome) -> None:
        """Put what was found for one variant alone into the state of all, and write it down.

        A variant that fails is parked at the guess.
        """
        found, arrays, place = outcome.state, self._arrays, self._first + variant
        status = outcome.status
        if found is not None and status is Status.CONVERGED and found.sensitivity > TOO_NEAR:
            status = Status.SINGULAR  # its rates are too uncertain to go on from
        arrays.status[index, place] = status
        if found is None or status is not Status.CONVERGED:
            self._alive[variant] = False
            state.point.q[:, variant] = self._inputs.guess
            state.q_dot[:, variant] = state.q_ddot[:, variant] = 0.0
            return
        state.point.q[:, variant] = found.point.q
        state.q_dot[:, variant], state.q_ddot[:, variant] = found.q_dot, found.q_ddot
        state.determinants[:, variant] = found.determinants
        arrays.motion[:, index, :, place] = found.point.q, found.q_dot, found.q_ddot
        arrays.residual[index, place] = np.max(np.abs(found.point.Phi))
        arrays.iterations[index, place] = outcome.iterations


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
        sweep={},
        statistics={"coarse": 0, "marched": 0},
        events=[],
        module=module,
    )
