"""Many parameter sets of one mechanism at once: the march on arrays over the variants.

All variants take the same steps in time together. A variant that does anything out of the ordinary,
at the start or on the way, is followed by the careful march alone for that step, and no other
variant notices.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import MAX_CORRECTIONS, SETTLED, TOO_NEAR
from kincompile.runtime.attempts import in_vain
from kincompile.runtime.engine.engine import rates_agree
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.follow import follow
from kincompile.runtime.march import March, Outcome, State, all_hold, largest
from kincompile.runtime.newton import give_up, start
from kincompile.runtime.problem import problem
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.singular.events import locate, status_after
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.follow import Progress
    from kincompile.runtime.inputs import Inputs

    Mask = NDArray[np.bool_]
    _Lost = tuple[int, March, State, Outcome]
    """A variant with its march, where it came from, and how far it got."""

CHUNK = 2048
"""Variants at a time, so that intermediate arrays stay in the cache and memory is bounded."""


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


def solve_variants(inputs: Inputs, sets: Array, progress: Progress | None) -> Solution:
    """Solve all variants, sets of parameters (B, k), over the time grid of the inputs.

    `progress` is called as ``progress(done, total)`` after each chunk of variants. The arrays of
    the solution have shape (B, N, n), and there is a status per variant and point.
    """
    count = len(sets)
    arrays, begin = _Arrays.over(inputs, count), _first_position(inputs, sets[0])
    for first in range(0, count, CHUNK):
        chunk = slice(first, min(first + CHUNK, count))
        _solve_chunk(inputs, begin, sets[chunk], arrays, chunk)
        if progress:
            progress(chunk.stop, count)
    return _solution(inputs, sets, arrays)


def solve_in_turn(inputs: Inputs, sets: Array, progress: Progress | None) -> Solution:
    """Solve variants of a module that has no lanes, one after the other."""
    arrays = _Arrays.over(inputs, len(sets))
    for variant, p in enumerate(sets):
        motion, _ = follow(replace(inputs, p=p))
        arrays.motion[..., variant] = motion.q, motion.q_dot, motion.q_ddot
        arrays.status[:, variant] = motion.status
        arrays.residual[:, variant] = motion.residual
        arrays.iterations[:, variant] = motion.iterations
        if progress:
            progress(variant + 1, len(sets))
    return _solution(inputs, sets, arrays)


def _first_position(inputs: Inputs, p: Array) -> Array:
    """Return where all start: the first variant's position, or the guess where it has none.

    It was found with care, and others lie beside it.
    """
    time = float(inputs.t[0])
    equations = problem(inputs.code.module, p, inputs.guess, time)
    march = March(equations, equations.engine, inputs.tolerance)
    found = start(march, time, replace(inputs, p=p)).state
    return inputs.guess if found is None else found.point.q


def _solve_chunk(inputs: Inputs, begin: Array, sets: Array, arrays: _Arrays, chunk: slice) -> None:
    """Solve some of the variants: compiled, where the module can, and with care those that fail."""
    march, together = inputs.code.march_variants, _Chunk(inputs, begin, sets, arrays, chunk.start)
    if march is None:
        together.run()
        return
    residual = np.empty((inputs.t.size, len(sets)))
    status, iterations = np.empty((2, *residual.shape), dtype=np.intc)
    near, motion = replace(inputs, guess=begin), arrays.motion[..., chunk]
    march(near, *together.scales, sets, motion, residual, status, iterations)
    arrays.residual[:, chunk] = residual
    arrays.status[:, chunk], arrays.iterations[:, chunk] = status, iterations
    is_odd = status.any(axis=0) | together.strays(arrays.motion[0, 0, :, chunk])
    failed = np.flatnonzero(is_odd | np.logical_not(together.agree(motion)))
    if failed.size:
        alone = _Arrays.over(inputs, failed.size)
        _Chunk(inputs, begin, sets[failed], alone, 0).run()
        arrays.motion[..., chunk.start + failed] = alone.motion
        arrays.status[:, chunk.start + failed] = alone.status
        arrays.residual[:, chunk.start + failed] = alone.residual
        arrays.iterations[:, chunk.start + failed] = alone.iterations


class _Chunk:
    """Variants that are solved together, and alone for the steps that are out of the ordinary."""

    def __init__(
        self, inputs: Inputs, begin: Array, sets: Array, arrays: _Arrays, first: int
    ) -> None:
        self._inputs, self._sets, self._arrays, self._first = inputs, sets, arrays, first
        self._begin = begin[:, np.newaxis]
        self._times: list[float] = inputs.t.tolist()
        self._alive = np.ones(len(sets), dtype=bool)
        engine = Planned(inputs.code, np.ascontiguousarray(sets.T))
        nominal = problem(inputs.code.module, sets[0], inputs.guess, self._times[0])
        self._march = March(nominal, engine, inputs.tolerance)
        self.scales = self._march.scales

    def strays(self, q: Array) -> Mask:
        """Say which variants (n, B) may have been assembled in another way than the first one."""
        equations, begin = self._march.equations, self._begin
        found: Mask = equations.is_far(q, begin)
        unsettled = np.flatnonzero(~found & (equations.away(q, begin) > SETTLED))
        if unsettled.size:
            p = np.ascontiguousarray(self._sets[np.append(unsettled, 0)].T)
            engine = Planned(self._inputs.code, p)
            point = engine.evaluate(np.column_stack((q[:, unsettled], begin)), self._times[0])
            signs = np.sign(engine.determinants(point))
            found[unsettled] = (signs[:, :-1] != signs[:, -1:]).any(axis=0)
        return found

    def agree(self, motion: Array) -> Any:
        """Say which variants of a motion (3, N, n, B) meet redundant equations at all times."""
        if not self._inputs.code.redundant:
            return True
        pairs = zip(self._times, motion.swapaxes(0, 1), strict=True)
        code, p = self._inputs.code, self._sets.T
        return np.all([rates_agree(code, np.array(t), p, states) for t, states in pairs], axis=0)

    def run(self) -> None:
        """Go through the grid with all variants."""
        inputs, time = self._inputs, self._times[0]
        begin = np.repeat(self._begin, len(self._sets), axis=1)
        found = self._march.correct_together(begin, time, inputs.max_iterations)
        state, checks = self._march.complete(found.point)
        good = all_hold(found.good, checks) & ~self.strays(found.point.q)
        good &= state.sensitivity <= TOO_NEAR
        self._record(0, state, good, found.iterations)
        bad = np.flatnonzero(~good).tolist()
        alone = [self._alone(variant, inputs.guess) for variant in bad]
        guesses = [inputs.guess] * len(bad)
        vain = in_vain([x.equations for x in alone], time, guesses, inputs.max_iterations)
        for variant, march, is_in_vain in zip(bad, alone, vain.tolist(), strict=True):
            own = replace(inputs, p=self._sets[variant])
            self._take(0, state, variant, start(march, time, own, is_in_vain=is_in_vain))
        for index in range(1, len(self._times)):
            state = self._step(index, state)

    def _step(self, index: int, state: State) -> State:
        """Take all variants that are left from one time to the next."""
        t = self._times[index]
        following, good, iterations = self._march.step_together(state, t, MAX_CORRECTIONS)
        good &= self._alive
        self._record(index, following, good, iterations)
        lost: list[_Lost] = []
        for variant in np.flatnonzero(self._alive & ~good).tolist():
            alone = self._alone(variant, state.point.q[:, variant])
            point = alone.equations.at(np.ascontiguousarray(state.point.q[:, variant]), state.t)
            known = Status.NOT_FINITE if point is None else alone.state(point)
            if isinstance(known, Status):
                self._take(index, following, variant, Outcome(known, 0, None))
                continue
            outcome = alone.advance(known, t, self._inputs.max_iterations)
            if outcome.position is None:
                lost.append((variant, alone, known, outcome))
            else:
                self._take(index, following, variant, outcome)
        self._give_up(index, following, lost)
        return following

    def _give_up(self, index: int, following: State, lost: Sequence[_Lost]) -> None:
        """Find out why variants do not get to a time."""
        t, inputs = self._times[index], self._inputs
        places = [end.state.point.q for *_, end in lost if end.state is not None]
        problems = [alone.equations for _, alone, _, _ in lost]
        vain = in_vain(problems, t, places, inputs.max_iterations).tolist()
        for (variant, alone, known, end), is_in_vain in zip(lost, vain, strict=True):
            own = replace(inputs, p=self._sets[variant])
            outcome = give_up(alone, end, t, own, is_in_vain=is_in_vain)
            if outcome.jumps and (found := locate(alone, known, t)):
                outcome = replace(outcome, status=status_after(found[0], outcome, t))
            self._take(index, following, variant, outcome)

    def _alone(self, variant: int, q: Array) -> March:
        """Return the march of one variant."""
        inputs, time = self._inputs, self._times[0]
        equations = problem(inputs.code.module, self._sets[variant], q, time)
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
        state.determinants[:, variant] = self._determinants(found, variant)
        if state.probed is not None:
            state.probed[:, variant] = np.abs(state.determinants[:, variant])
            state.sensitivity[variant] = found.sensitivity
        arrays.motion[:, index, :, place] = found.point.q, found.q_dot, found.q_ddot
        arrays.residual[index, place] = np.max(np.abs(found.point.Phi))
        arrays.iterations[index, place] = outcome.iterations

    def _determinants(self, found: State, variant: int) -> Array:
        """Return the determinants of the blocks of one variant.

        Of redundant equations the careful march has one of all, and a batch those of the others.
        """
        if not self._inputs.code.redundant:
            return found.determinants
        engine = Planned(self._inputs.code, self._sets[variant])
        return engine.determinants(engine.evaluate(found.point.q[:, np.newaxis], found.t))[:, 0]


def _solution(inputs: Inputs, sets: Array, arrays: _Arrays) -> Solution:
    module = inputs.code.module
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
        sweep=dict(inputs.sweep),
        statistics={"coarse": 0, "marched": 0},
        events=[],
        module=module,
    )
