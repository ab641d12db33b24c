"""Many parameter sets of one mechanism at once: the march on arrays over the variants.

All variants take the same steps in time together. A variant that does anything out of the ordinary,
at the start or on the way, is followed by the careful march alone for that step, and no other
variant notices.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    FOLDED,
    LARGE_ERROR,
    MAX_CORRECTIONS,
    MAX_SUBSTEPS,
    SETTLED,
    SMALLEST_PART,
    TOO_NEAR,
)
from kincompile.errors import BranchSwitchWarning, memory_for
from kincompile.runtime.along import lead, lead_together
from kincompile.runtime.attempts import other_sides, safeguarded
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.follow import follow
from kincompile.runtime.march import (
    March,
    Outcome,
    State,
    all_hold,
    chosen,
    joined,
    largest,
    put,
    some_of,
)
from kincompile.runtime.problem import problem
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.singular.events import locate, status_after
from kincompile.runtime.start import give_up, start, turned_guesses
from kincompile.runtime.status import Status
from kincompile.tables import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.follow import Motion, Progress
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Problem
    from kincompile.runtime.singular.events import Event

    Mask = NDArray[np.bool_]
    Places = NDArray[np.intp]
    _Lost = tuple[int, int, March, State, Outcome]
    """A variant, its next time, its march, where it came from, and how far it got."""

CHUNK = 2048
"""Variants at a time, so that intermediate arrays stay in the cache and memory is bounded."""

LEFT = (
    "No position was found on the branch of the first set: along the line of parameters from it a "
    "bifurcation or a lock-up comes first. Solve it alone, with a guess of its own."
)
"""What is said of a variant that is not on the branch of the first set."""


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
        what = f"{count:,} variants at {points:,} times have {24e-9 * points * n * count:,.1f} GB"
        with memory_for(what, "give fewer at a time; kc.sweep takes them in chunks"):
            return cls(
                np.empty((3, points, n, count)),
                np.full((points, count), int(Status.NOT_REACHED)),
                np.full((points, count), np.nan),
                np.zeros((points, count), dtype=np.int64),
            )

    def clear(self, places: Places) -> None:
        """Take back what was written down for some variants."""
        self.motion[..., places] = self.residual[:, places] = np.nan
        self.status[:, places], self.iterations[:, places] = Status.NOT_REACHED, 0

    def put(self, motion: Motion, variant: int) -> None:
        """Fill in the motion of one variant, which was followed by itself."""
        self.motion[..., variant] = motion.q, motion.q_dot, motion.q_ddot
        self.status[:, variant] = motion.status
        self.residual[:, variant] = motion.residual
        self.iterations[:, variant] = motion.iterations


def solve_variants(inputs: Inputs, sets: Array, progress: Progress | None) -> Solution:
    """Solve all variants, sets of parameters (B, k), over the time grid of the inputs.

    `progress` is called as ``progress(done, total)`` after each chunk of variants. The arrays of
    the solution have shape (B, N, n), and there is a status per variant and point.
    """
    count, arrays = len(sets), _Arrays.over(inputs, len(sets))
    inputs, begin = _first_position(inputs)
    for first in range(0, count, CHUNK):
        chunk = slice(first, min(first + CHUNK, count))
        _solve_chunk(inputs, begin, sets[chunk], arrays, chunk)
        if progress:
            progress(chunk.stop, count)
    if inputs.smooth:
        _warn_of(inputs, _go_through(inputs, sets, arrays))
    return _solution(inputs, sets, arrays)


def _go_through(inputs: Inputs, sets: Array, arrays: _Arrays) -> dict[int, Event]:
    """Let variants that end at a bifurcation go alone, on past it, each from its own position.

    Returns the first bifurcation that each went through.
    """
    ends = (arrays.status == Status.SINGULAR).any(axis=0) & (arrays.status[0] == Status.CONVERGED)
    passed: dict[int, Event] = {}
    for variant in np.flatnonzero(ends).tolist():
        guess = np.ascontiguousarray(arrays.motion[0, 0, :, variant])
        motion, _ = follow(replace(inputs, p=sets[variant], guess=guess))
        arrays.put(motion, variant)
        if motion.passed:
            passed[variant] = motion.passed[0]
    return passed


def _warn_of(inputs: Inputs, passed: Mapping[int, Event]) -> None:
    """Say which variants went through a bifurcation."""
    if passed:
        variant, event = min(passed.items())
        warnings.warn(
            f"{inputs.code.name}: {counted(len(passed), 'variant')} went through a bifurcation, "
            f"the first, variant {variant}, at t = {event.t:.10g}, and on along the smooth branch.",
            BranchSwitchWarning,
            stacklevel=5,
        )


def solve_in_turn(inputs: Inputs, sets: Array, progress: Progress | None) -> Solution:
    """Solve variants of a module that has no lanes, one after the other."""
    arrays = _Arrays.over(inputs, len(sets))
    inputs, begin = _first_position(inputs)
    passed: dict[int, Event] = {}
    for variant, p in enumerate(sets):
        motion = _followed(inputs, begin, p)
        arrays.put(motion, variant)
        if motion.passed:
            passed[variant] = motion.passed[0]
        if progress:
            progress(variant + 1, len(sets))
    _warn_of(inputs, passed)
    return _solution(inputs, sets, arrays)


@dataclass(frozen=True, slots=True, eq=False)
class _Begin:
    """Where all sets start from: a position with the parameters of the inputs."""

    equations: Problem
    q: Array  # (n,): assembled, or the guess
    is_assembled: bool  # whether other sets can follow from there


def _first_position(inputs: Inputs) -> tuple[Inputs, _Begin]:
    """Assemble the mechanism with the first set, or else with the parameters of the model.

    It is found with care, and all sets are to be on its branch. Returns the inputs with those
    parameters and that position as the guess, as a chunk of a sweep has them.
    """
    time = float(inputs.t[0])
    for p in (inputs.p, np.array(inputs.code.module.DEFAULTS, dtype=np.float64)):
        own = replace(inputs, p=p)
        equations = problem(inputs.code.module, p, inputs.guess, time)
        march = March(equations, equations.engine, inputs.tolerance)
        together = own.code.lanes is not None
        outcome = start(march, time, own, is_in_vain=together)
        if together and outcome.status is Status.NOT_ASSEMBLED:  # by Newton's own steps
            here = p[np.newaxis], time, own.guess[np.newaxis]
            if not np.isnan(safeguarded(equations, *here, own.max_iterations)).any():
                outcome = start(march, time, own)
        found = outcome.state
        if found is not None and found.sensitivity <= TOO_NEAR:
            begin = found.point.q
            return replace(own, guess=begin), _Begin(equations, begin, is_assembled=True)
    equations = problem(inputs.code.module, inputs.p, inputs.guess, time)
    return inputs, _Begin(equations, inputs.guess, is_assembled=False)


def _followed(inputs: Inputs, begin: _Begin, p: Array) -> Motion:
    """Follow the motion of one set, from the branch on which all of them are to be."""
    own = replace(inputs, p=p)
    if not begin.is_assembled:
        return follow(own)[0]
    motion, _ = follow(replace(own, guess=begin.q))
    equations, q = begin.equations, motion.q[0]
    is_there = motion.status[0] == Status.CONVERGED
    if not is_there or not (_is_elsewhere(equations, q, begin.q) or _leaves(begin, own, q)):
        return motion
    led, crosses = lead(inputs, equations, begin.q, p)
    motion, _ = follow(own if led is None else replace(own, guess=led))
    is_there = motion.status[0] == Status.CONVERGED
    if led is None and is_there and (crosses or _leaves(begin, own, motion.q[0])):
        for values in (motion.q, motion.q_dot, motion.q_ddot):
            values[:] = np.nan
        motion.status[:] = Status.NOT_REACHED
        motion.status[0] = Status.NOT_CONVERGED
    return motion


def _is_elsewhere(equations: Problem, q: Array, begin: Array) -> Any:
    """Say whether a position, or each of a batch, is not as near as what is assembled beside it."""
    return equations.is_far(q, begin) | equations.is_turned(q, begin)


def _leaves(begin: _Begin, own: Inputs, q: Array) -> bool:
    """Say whether a position of a set is on another branch than all start from."""
    t = float(own.t[0])
    there, here = begin.equations.at(begin.q, t), problem(own.code.module, own.p, q, t)
    found = here.at(q, t)
    if there is None or found is None:
        return True
    return here.engine.signs(found) != begin.equations.engine.signs(there)


def _solve_chunk(inputs: Inputs, begin: _Begin, sets: Array, arrays: _Arrays, chunk: slice) -> None:
    """Solve some of the variants: compiled, where the module can, and with care those that fail."""
    march, together = inputs.code.march_variants, _Chunk(inputs, begin, sets, arrays, chunk)
    if march is None:
        together.run()
        return
    residual = np.empty((inputs.t.size, len(sets)))
    status, iterations = np.empty((2, *residual.shape), dtype=np.intc)
    near, motion = replace(inputs, guess=begin.q), arrays.motion[..., chunk]
    march(near, *together.scales, sets, motion, residual, status, iterations)
    arrays.residual[:, chunk] = residual
    arrays.status[:, chunk], arrays.iterations[:, chunk] = status, iterations
    elsewhere = (status[0] != Status.CONVERGED) | together.strays(motion[0, 0])
    # What ends at a lock-up is no failure of the compiled march.
    is_odd = status.any(axis=0) & ~(status == Status.LOCK_UP).any(axis=0)
    together.go_on(np.flatnonzero(is_odd & ~elsewhere))
    if elsewhere.any():
        places = chunk.start + np.flatnonzero(elsewhere)
        arrays.clear(places)
        _Chunk(inputs, begin, sets[elsewhere], arrays, places).run()


class _Chunk:
    """Variants that are solved together, and alone for the steps that are out of the ordinary."""

    def __init__(
        self, inputs: Inputs, begin: _Begin, sets: Array, arrays: _Arrays, own: slice | Places
    ) -> None:
        self._inputs, self._sets, self._arrays, self._own = inputs, sets, arrays, own
        self._places = np.arange(arrays.status.shape[1])[own]  # where variants are in the arrays
        self._begin, self._place = begin, begin.q[:, np.newaxis]
        self._times: list[float] = inputs.t.tolist()
        engine = Planned(inputs.code, np.ascontiguousarray(sets.T))
        self._march = March(begin.equations, engine, inputs.tolerance)
        self.scales = self._march.scales

    def strays(self, q: Array) -> Mask:
        """Say which variants (n, B) may have been assembled in another way than the first one."""
        equations, begin = self._march.equations, self._place
        found: Mask = _is_elsewhere(equations, q, begin)
        unsettled = np.flatnonzero(~found & (equations.away(q, begin) > SETTLED))
        if unsettled.size:
            found[unsettled] = self._leave(unsettled, q[:, unsettled])
        return found

    def _leave(self, variants: NDArray[np.intp], q: Array) -> Mask:
        """Say which variants are at positions (n, V) on another branch than all start from."""
        p = np.vstack((self._sets[variants], self._inputs.p))
        engine = Planned(self._inputs.code, np.ascontiguousarray(p.T))
        point = engine.evaluate(np.column_stack((q, self._begin.q)), self._times[0])
        found = engine.determinants(point)
        here, shown = found[:, :-1], found[:, -1:]
        folded = np.abs(shown) <= FOLDED * np.abs(here)  # then nothing shows a branch
        return np.asarray(((np.sign(here) != np.sign(shown)) & ~folded).any(axis=0))

    def run(self) -> None:
        """Go through the grid with all variants."""
        lanes, lost = self._assembled(), list[_Lanes]()
        march = self._march_of(lanes.variants)
        for k, t in enumerate(self._times[1:] if lanes.variants.size else (), start=1):
            following, good, iterations = march.step_together(lanes.state, t, MAX_CORRECTIONS)
            self._record(lanes, following, good, iterations)
            here, lanes = lanes, _Lanes(lanes.variants, lanes.index + 1, following)
            if not good.all():
                lost.append(here.some(~good))
                self._arrays.motion[:, k:, :, self._places[lost[-1].variants]] = np.nan
                lanes = lanes.some(good)
                march = self._march_of(lanes.variants)
                if not lanes.variants.size:
                    break
        self._finish(lost)

    def go_on(self, variants: Places) -> None:
        """Take variants on from where another march has left them."""
        if not variants.size:
            return
        arrays, places = self._arrays, self._places[variants]
        index: Places = (arrays.status[:, places] != Status.CONVERGED).argmax(axis=0)
        q = np.ascontiguousarray(arrays.motion[0, index - 1, :, places].T)
        march = self._march_of(variants)
        state, _ = march.complete(march.engine.evaluate(q, np.array(self._times)[index - 1]))
        self._finish([_Lanes(variants, index, state)])

    def _finish(self, lost: list[_Lanes]) -> None:
        """Take variants on, each at its own pace, and alone where that leads nowhere."""
        while lost:
            lost = self._with_care(self._at_own_pace(_joined(lost)))

    def _assembled(self) -> _Lanes:
        """Assemble all variants at the first time; return those that are."""
        inputs, time = self._inputs, self._times[0]
        begin = np.repeat(self._place, len(self._sets), axis=1)
        found = self._march.correct_together(begin, time, inputs.max_iterations)
        point, on_branch = found.point, found.good & ~self.strays(found.point.q)
        lost, crosses = np.flatnonzero(~on_branch), np.zeros(len(self._sets), dtype=bool)
        if lost.size and self._begin.is_assembled:
            led = lead_together(inputs, self._march.equations, self._begin.q, self._sets[lost])
            q, on_branch[lost], crosses[lost] = led
            point.q[:, lost[on_branch[lost]]] = q[:, on_branch[lost]]
            point = self._march.engine.evaluate(point.q, time)
        left, hopeless = np.flatnonzero(~on_branch), np.zeros(0, dtype=np.intp)
        if left.size:
            q, follows, is_assembled, vain = self._from_the_guess(left, found.good[left])
            on_branch[left] = follows & ~crosses[left]
            point.q[:, left[on_branch[left]]] = q[:, on_branch[left]]
            point = self._march.engine.evaluate(point.q, time)
            hopeless, left = left[vain], left[is_assembled & ~on_branch[left]]
        state, checks = self._march.complete(point)
        good = all_hold(on_branch, checks)
        good &= state.sensitivity <= TOO_NEAR
        everyone = np.arange(len(self._sets))
        self._record(_Lanes(everyone, 0 * everyone, state), state, good, found.iterations)
        self._arrays.motion[..., self._places[~good]] = np.nan
        for over, status in ((hopeless, Status.NOT_ASSEMBLED), (left, Status.NOT_CONVERGED)):
            self._arrays.status[0, self._places[over]] = status
        bad = np.setdiff1d(np.flatnonzero(~good), np.union1d(left, hopeless))
        for variant in bad.tolist():
            own = replace(inputs, p=self._sets[variant])
            outcome = start(self._alone(variant, inputs.guess), time, own)
            if self._begin.is_assembled and outcome.state is not None:
                place = outcome.state.point.q[:, np.newaxis]
                is_known = not inputs.code.redundant  # these have no determinants
                if crosses[variant] or (is_known and self._leave(np.array([variant]), place)[0]):
                    outcome = Outcome(Status.NOT_CONVERGED, outcome.iterations, None)
            alone = self._take(0, variant, outcome)
            if alone is not None:
                put(state, variant, alone)
                good[variant] = True
        return _Lanes(everyone, 0 * everyone + 1, state).some(good)

    def _from_the_guess(self, variants: Places, plain: Mask) -> tuple[Array, Mask, Mask, Mask]:
        """Assemble variants from the guess, as `start.assemble` does, on the branch of the first.

        Tried are Newton's own steps, where those from the guess as it is are known to lead to a
        position or not (`plain`), the safeguarded attempt, and beyond the singular positions that
        are nearest to where these lead. Returns positions (n, V), those nearest to the guess on the
        branch, which have one, which are assembled at all, and which no attempt assembles.
        """
        inputs, time, equations = self._inputs, self._times[0], self._march.equations
        most, sets, march = inputs.max_iterations, self._sets[variants], self._march_of(variants)
        assert isinstance(march.engine, Planned)
        guesses = np.repeat(inputs.guess[:, np.newaxis], variants.size, axis=1)
        guesses = turned_guesses(equations, march.engine, guesses, time)
        near = safeguarded(equations, sets, time, guesses.T, most)
        found, least = np.full_like(guesses, np.nan), np.full(variants.size, np.inf)
        is_assembled: Mask = np.zeros(variants.size, dtype=bool)

        def attempt(begin: Array) -> Array:
            q, good = self._corrected(variants, begin, most)
            q = equations.turned_back(q, guesses)
            q, holds = self._corrected(variants, q, MAX_CORRECTIONS, LARGE_ERROR)
            state, checks = march.complete(march.engine.evaluate(q, time))
            good = all_hold(good & holds, checks) & (state.sensitivity <= TOO_NEAR)
            is_assembled[good] = True
            reached = np.where(good, q, np.nan)
            good &= ~self._leave(variants, q) & ~equations.is_turned(q, guesses)
            away = np.where(good, equations.away(q, guesses), np.inf)
            found[:, away < least] = q[:, away < least]
            least[:] = np.minimum(away, least)
            return reached

        # Of redundant equations no determinants show a branch.
        if self._begin.is_assembled and not inputs.code.redundant:
            own = np.where(plain | (guesses != self._place).any(axis=0), guesses, np.nan)
            for begin in (own, near):
                attempt(other_sides(equations, sets, time, attempt(begin)))
        return found, least < np.inf, is_assembled, np.isnan(near[0]) & ~plain & ~is_assembled

    def _corrected(
        self, variants: Places, q: Array, most: int, reach: float = np.inf
    ) -> tuple[Array, Mask]:
        """Return where Newton's own steps lead from positions (n, V), and which get there."""
        q, good = q.copy(), np.asarray(np.isfinite(q).all(axis=0))
        some = np.flatnonzero(good)
        if some.size:
            march = self._march_of(variants[some])
            found = march.correct_together(q[:, some], self._times[0], most, reach)
            q[:, some], good[some] = found.point.q, found.good
        return q, good

    def _at_own_pace(self, lanes: _Lanes) -> _Lanes:
        """Take variants on, each by steps of its own, to the last time or to where it is stuck.

        Who is stuck at a lock-up or a bifurcation gets its status, for where exactly it is nothing
        that a set of many asks; returned are those that are stuck otherwise.
        """
        times, stuck = np.append(self._times, np.nan), [lanes.some(np.zeros(0, dtype=np.intp))]
        march, begin, step = self._march_of(lanes.variants), lanes.state, lanes.interval(times) / 2
        count, spent = np.zeros((2, step.size), dtype=np.int64)
        while lanes.variants.size:
            state, target = lanes.state, times[lanes.index]
            whole = np.abs(step) >= np.abs(target - state.t)
            aim = np.where(whole, target, state.t + step)
            following, good, iterations = march.step_together(state, aim, MAX_CORRECTIONS)
            count, spent = count + 1, spent + iterations
            reached = good & whole
            self._record(lanes, following, reached, spent)
            smallest = SMALLEST_PART * np.abs(target - begin.t)
            is_stuck = ~good & ((np.abs(step) <= smallest) | (count >= MAX_SUBSTEPS))
            if is_stuck.any():
                locked = is_stuck & march.lock_up(begin, state, target, smallest)
                parted = is_stuck & ~locked & march.bifurcation(state, target, smallest)
                exhausted = is_stuck & ~locked & ~parted & (count >= MAX_SUBSTEPS)
                self._end(lanes, locked, Status.LOCK_UP)
                self._end(lanes, parted, Status.SINGULAR)
                self._end(lanes, exhausted, Status.NOT_CONVERGED)
                stuck.append(lanes.some(is_stuck & ~locked & ~parted & ~exhausted))
            lanes = _Lanes(lanes.variants, lanes.index + reached, chosen(good, following, state))
            begin = chosen(reached, following, begin)
            forward = lanes.interval(times)
            size = march.pace(lanes.state, forward, step, good, smallest)
            step = np.where(reached, forward, np.copysign(size, forward))
            count, spent = np.where(reached, 0, count), np.where(reached, 0, spent)
            left = ~is_stuck & (lanes.index < len(self._times))
            if not left.all():
                lanes, begin = lanes.some(left), some_of(begin, left)
                step, count, spent = step[left], count[left], spent[left]
                march = self._march_of(lanes.variants)
        return _joined(stuck)

    def _with_care(self, lanes: _Lanes) -> list[_Lanes]:
        """Take variants to their next times alone; return those that get there and go on."""
        back: list[_Lanes] = []
        lost: list[_Lost] = []
        for variant, index in zip(lanes.variants.tolist(), lanes.index.tolist(), strict=True):
            q = np.ascontiguousarray(self._arrays.motion[0, index - 1, :, self._places[variant]])
            alone = self._alone(variant, q)
            point = alone.equations.at(q, self._times[index - 1])
            known = Status.NOT_FINITE if point is None else alone.state(point)
            if isinstance(known, Status):
                self._take(index, variant, Outcome(known, 0, None))
                continue
            outcome = alone.advance(known, self._times[index], self._inputs.max_iterations)
            if outcome.position is None:
                lost.append((variant, index, alone, known, outcome))
                continue
            state = self._take(index, variant, outcome)
            if state is not None and index + 1 < len(self._times):
                back.append(_Lanes(np.array([variant]), np.array([index + 1]), state))
        self._give_up(lost)
        return back

    def _give_up(self, lost: Sequence[_Lost]) -> None:
        """Find out why variants do not get to a time."""
        if not lost:
            return
        sets = self._sets[[variant for variant, *_ in lost]]
        times = np.array([self._times[index] for _, index, *_ in lost])
        places = np.array([known.point.q if end.state is None else end.state.point.q
                           for *_, known, end in lost])  # fmt: skip
        equations, most = self._march.equations, self._inputs.max_iterations
        vain = np.isnan(safeguarded(equations, sets, times, places, most)[0]).tolist()
        for (variant, index, alone, known, end), p, is_in_vain in zip(
            lost, sets, vain, strict=True
        ):
            t, own = self._times[index], replace(self._inputs, p=p)
            outcome = give_up(alone, end, t, own, is_in_vain=is_in_vain)
            if not outcome.exhausted and (found := locate(alone, known, t)):
                outcome = replace(outcome, status=status_after(found[0], outcome, t))
            self._take(index, variant, outcome)

    def _march_of(self, variants: Places) -> March:
        """Return the march of some variants together."""
        engine = Planned(self._inputs.code, np.ascontiguousarray(self._sets[variants].T))
        return March(self._march.equations, engine, self._inputs.tolerance)

    def _alone(self, variant: int, q: Array) -> March:
        """Return the march of one variant."""
        inputs, time = self._inputs, self._times[0]
        equations = problem(inputs.code.module, self._sets[variant], q, time)
        return March(equations, equations.engine, inputs.tolerance)

    def _record(self, lanes: _Lanes, state: State, good: Mask, iterations: Array) -> None:
        """Write down the variants that are good, each at its own next time."""
        arrays, index, place = self._arrays, lanes.index[good], self._places[lanes.variants[good]]
        found = state.point.q, state.q_dot, state.q_ddot
        together = np.array_equal(place, self._places) and (index == index[0]).all()
        for target, values in zip(arrays.motion, found, strict=True):
            if together:
                target[index[0]][:, self._own] = values
            else:
                target[index, :, place] = values[:, good].T
        arrays.status[index, place] = Status.CONVERGED
        arrays.residual[index, place] = largest(state.point.Phi, good.size)[good]
        arrays.iterations[index, place] = iterations[good]

    def _end(self, lanes: _Lanes, over: Mask, status: Status) -> None:
        """Write down variants whose motions end before their next times."""
        places = self._places[lanes.variants[over]]
        self._arrays.status[lanes.index[over], places] = status
        self._arrays.motion[:, lanes.index[over], :, places] = np.nan

    def _take(self, index: int, variant: int, outcome: Outcome) -> State | None:
        """Write down what was found for one variant alone; return the state it goes on from."""
        found, arrays, place = outcome.state, self._arrays, self._places[variant]
        status = outcome.status
        if found is not None and status is Status.CONVERGED and found.sensitivity > TOO_NEAR:
            status = Status.SINGULAR  # its rates are too uncertain to go on from
        arrays.status[index, place] = status
        if found is None or status is not Status.CONVERGED:
            arrays.motion[:, index, :, place] = np.nan
            return None
        arrays.motion[:, index, :, place] = found.point.q, found.q_dot, found.q_ddot
        arrays.residual[index, place] = np.max(np.abs(found.point.Phi))
        arrays.iterations[index, place] = outcome.iterations
        determinants = self._determinants(found, variant)[:, np.newaxis]
        return State(
            np.array([found.t]),
            replace(found.point, q=found.point.q[:, np.newaxis]),
            found.q_dot[:, np.newaxis],
            found.q_ddot[:, np.newaxis],
            determinants,
            np.array([found.sensitivity]),
            np.abs(determinants),
        )

    def _determinants(self, found: State, variant: int) -> Array:
        """Return the determinants of the blocks of one variant.

        Of redundant equations the careful march has one of all, and a batch those of the others.
        """
        if not self._inputs.code.redundant:
            return found.determinants
        engine = Planned(self._inputs.code, self._sets[variant])
        return engine.determinants(engine.evaluate(found.point.q[:, np.newaxis], found.t))[:, 0]


@dataclass(frozen=True, slots=True, eq=False)
class _Lanes:
    """Some variants: their numbers, those of the times that each comes to next, their states."""

    variants: Places
    index: Places
    state: State

    def interval(self, times: Array) -> Array:
        """Return how far each is from its next time; NaN after the last."""
        return np.asarray(times[self.index] - self.state.t)

    def some(self, which: Mask | Places) -> _Lanes:
        """Return some of them."""
        return _Lanes(self.variants[which], self.index[which], some_of(self.state, which))


def _joined(parts: Sequence[_Lanes]) -> _Lanes:
    """Return variants from several parts as one."""
    variants = np.concatenate([part.variants for part in parts])
    index = np.concatenate([part.index for part in parts])
    return _Lanes(variants, index, joined([part.state for part in parts]))


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
        why = f"{status.sentence} Solve it alone to see where exactly a motion ends, and why."
        why = LEFT if status is Status.NOT_CONVERGED and index == 0 else why
        message = (
            f"{module.NAME}: {failed.size} of {len(sets)} variants failed; the first is variant "
            f"{variant} at t = {inputs.t[index]:.10g} ({status.name}). {why}"
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
