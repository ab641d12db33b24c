"""Many parameter sets of one mechanism at once: the march on arrays over the variants.

All variants take the same steps in time together. A variant that does anything out of the ordinary,
at the start or on the way, is followed by the careful march alone for that step, and no other
variant notices.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import TOO_NEAR
from kincompile.errors import BranchSwitchWarning, memory_for
from kincompile.runtime.assembled import Begin, Sets, first_position, followed
from kincompile.runtime.attempts import safeguarded
from kincompile.runtime.follow import Motion, follow
from kincompile.runtime.lanes import Lanes, take_on
from kincompile.runtime.march import March, Outcome, State, all_hold, largest
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.singular.events import ended
from kincompile.runtime.start import give_up, start
from kincompile.runtime.status import Status
from kincompile.tables import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.follow import Progress
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.singular.events import Event

    Mask = NDArray[np.bool_]
    Places = NDArray[np.intp]
    Statuses = NDArray[np.int64]
    _Lost = tuple[int, int, March, State, Outcome]
    """A variant, its next time, its march, where it came from, and how far it got."""

CHUNK = 2048
"""Variants at a time, so that intermediate arrays stay in the cache and memory is bounded."""

LEFT = (
    "No position was found on the branch of the first set: along the line of parameters from it a "
    "bifurcation or a lock-up comes first. Solve it alone, with a guess of its own."
)
"""The message of a variant that is not on the branch of the first set."""


def _over(inputs: Inputs, count: int) -> Motion:
    """Make the arrays for a number of variants."""
    points, n = inputs.t.size, inputs.guess.size
    what = f"{count:,} variants at {points:,} times have {24e-9 * points * n * count:,.1f} GB"
    with memory_for(what, "give fewer at a time; kc.sweep takes them in chunks"):
        return Motion.over(inputs, count)


def solve_variants(inputs: Inputs, sets: Array, progress: Progress | None) -> Solution:
    """Solve all variants, sets of parameters (B, k), over the time grid of the inputs.

    `progress` is called as ``progress(done, total)`` after each chunk of variants. The arrays of
    the solution have shape (B, N, n), and there is a status per variant and point.
    """
    count, motions = len(sets), _over(inputs, len(sets))
    inputs, begin = first_position(inputs)
    is_whole = True
    for first in range(0, count, CHUNK):
        chunk = slice(first, min(first + CHUNK, count))
        is_whole &= _Chunk(inputs, begin, sets[chunk], motions.of(chunk)).solve()
        if progress:
            progress(chunk.stop, count)
    if is_whole:
        motions.statistics["compiled"] = inputs.t.size
    if inputs.smooth:
        _warn_of(inputs, _go_through(inputs, sets, motions))
    return _solution(inputs, motions, begin.doubt)


def _go_through(inputs: Inputs, sets: Array, motions: Motion) -> dict[int, Event]:
    """Let variants that end at a bifurcation go alone, on past it, each from its own position.

    Returns the first bifurcation that each went through.
    """
    status = motions.status
    ends = (status == Status.SINGULAR).any(axis=0) & (status[0] == Status.CONVERGED)
    passed: dict[int, Event] = {}
    for variant in np.flatnonzero(ends).tolist():
        guess = np.ascontiguousarray(motions.states[0, :, 0, variant])
        motion, _ = follow(replace(inputs, p=sets[variant], guess=guess))
        motions.fill(variant, motion)
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
    motions = _over(inputs, len(sets))
    inputs, begin = first_position(inputs)
    passed: dict[int, Event] = {}
    for variant, p in enumerate(sets):
        motion = followed(inputs, begin, p)
        motions.fill(variant, motion)
        if motion.passed:
            passed[variant] = motion.passed[0]
        if progress:
            progress(variant + 1, len(sets))
    _warn_of(inputs, passed)
    return _solution(inputs, motions, begin.doubt)


class _Chunk:
    """Variants that are solved together, and alone for the steps that are out of the ordinary."""

    def __init__(self, inputs: Inputs, begin: Begin, sets: Array, motions: Motion) -> None:
        self._inputs, self._begin, self._p = inputs, begin, sets
        self._sets, self._motions = Sets(inputs, begin, sets), motions
        self._times: list[float] = inputs.t.tolist()

    def solve(self) -> bool:
        """Solve: compiled, where the module can, and with care what fails.

        Says whether compiled code has reached, and checked, all that is there.
        """
        everyone = np.arange(len(self._p))
        if self._inputs.code.march is None:
            self._finish(self._assembled(everyone))
            return False
        self._march_compiled(self._begin.q, slice(1))
        motions = self._motions
        q, status = motions.states[0, :, 0].copy(), motions.status[0].copy()
        elsewhere = (status != Status.CONVERGED) | self._sets.left_branch(everyone, q)
        if elsewhere.any():
            self._solve_from_own_places(everyone, elsewhere, q, status)
            return False
        if self._inputs.t.size > 1:
            self._march_on(q)
        is_whole = not motions.status.any()
        self._go_on(everyone)
        return is_whole

    def _solve_from_own_places(
        self, everyone: Places, elsewhere: Mask, q: Array, status: Statuses
    ) -> None:
        """Solve all, of which some are not on the branch from the first position, from their own.

        Those that have none are at rest in the march: where a guess is no number, nothing moves.
        """
        motions, lost = self._motions, everyone[elsewhere]
        motions.forget(0, lost)
        lanes = self._assembled(lost, status[lost])
        q[:, lost] = np.nan
        q[:, lanes.motions] = lanes.state.point.q
        left = np.setdiff1d(lost, lanes.motions)
        kept = [values[..., 0, left] for values in motions.arrays]
        self._march_on(q)
        for values, own in zip(motions.arrays, kept, strict=True):
            values[..., 0, left] = own
        good = motions.status[0] == Status.CONVERGED
        good[left] = False
        self._go_on(everyone[good])
        lanes = lanes.some(~good[lanes.motions])
        if lanes.motions.size:
            first = Lanes(lanes.motions, lanes.index - 1, lanes.state)
            self._record(first, lanes.state, np.ones(lanes.motions.size, bool), 0 * lanes.index)
            self._finish(lanes)

    def _march_on(self, q: Array) -> None:
        """Let the compiled march follow all from positions (n, V) at the first time."""
        iterations = self._motions.iterations[0].copy()
        self._march_compiled(q, slice(None))
        self._motions.iterations[0] = iterations

    def _march_compiled(self, guess: Array, times: slice) -> None:
        """Let the compiled march follow all at some times, from one guess or those of each."""
        inputs = replace(self._inputs, t=self._inputs.t[times])
        part = self._motions.during(times)
        part.march_compiled(inputs, self._sets.march(), guess, self._p)

    def _go_on(self, variants: Places) -> None:
        """Take those variants on that the compiled march has left on their way."""
        status = self._motions.status[:, variants]
        # A lock-up ends a motion: the march has not failed.
        failed = status.any(axis=0) & ~(status == Status.LOCK_UP).any(axis=0)
        if failed.any():
            self._finish(self._known(variants[failed], (status[:, failed] != 0).argmax(axis=0)))

    def _known(self, variants: Places, index: Places) -> Lanes:
        """Return variants on the way to times from the points before these."""
        found = self._motions.states[:, :, index - 1, variants]
        q, q_dot, q_ddot = (np.ascontiguousarray(values) for values in found)
        march = self._sets.march(variants)
        state, _ = march.complete(march.engine.evaluate(q, np.array(self._times)[index - 1]))
        # These points are good, also where the elimination in a fixed order loses digits.
        near = np.fmin(state.sensitivity, TOO_NEAR)
        state = replace(state, q_dot=q_dot, q_ddot=q_ddot, sensitivity=near)
        return Lanes(variants, index, state)

    def _finish(self, lanes: Lanes) -> None:
        """Take variants on, each at its own pace, and alone where that leads nowhere."""
        times = np.array(self._times)
        while lanes.motions.size:
            ends, status = take_on(lanes, times, self._sets.march, self._record)
            for index, variant in zip(ends.index.tolist(), ends.motions.tolist(), strict=True):
                self._motions.forget(slice(index, None), variant)
            # Where exactly a motion ends is nothing that a set of many asks.
            self._motions.status[ends.index, ends.motions] = status
            stuck = ends.some(status == Status.NOT_REACHED)
            on = self._with_care(stuck)
            if not on.any():
                break
            lanes = self._known(stuck.motions[on], stuck.index[on] + 1)

    def _assembled(self, variants: Places, known: Statuses | None = None) -> Lanes:
        """Assemble variants at the first time; return those that are.

        Known may be what the compiled march said of them, as for `Sets.assembled`.
        """
        inputs, sets = self._inputs, Sets(self._inputs, self._begin, self._p[variants])
        begun = sets.assembled(known)
        state, checks = sets.march().complete(begun.point)
        good = all_hold(begun.on_branch, checks)
        good &= state.sensitivity <= TOO_NEAR
        lanes = Lanes(variants, 0 * variants, state)
        self._record(lanes, state, good, begun.iterations)
        if known is None:
            self._motions.forget(slice(None), variants[~good])
        over = ((begun.hopeless, Status.NOT_ASSEMBLED), (begun.left, Status.NOT_CONVERGED))
        for some, status in over:
            self._motions.status[0, variants[some]] = status
        bad = np.setdiff1d(np.flatnonzero(~good), np.union1d(begun.left, begun.hopeless))
        for lane in bad.tolist():
            variant = int(variants[lane])
            own = replace(inputs, p=self._p[variant])
            outcome = start(self._sets.alone(variant, inputs.guess), self._times[0], own)
            if self._begin.is_assembled and outcome.state is not None:
                place = outcome.state.point.q[:, np.newaxis]
                is_known = not inputs.code.redundant  # these have no determinants
                leaves = is_known and self._sets.leave(variants[[lane]], place)[0]
                if begun.crosses[lane] or leaves:
                    outcome = Outcome(Status.NOT_CONVERGED, outcome.iterations, None)
            good[lane] = self._take(0, variant, outcome)
        if good[bad].any():
            return self._known(variants[good], 0 * variants[good] + 1)
        return replace(lanes, index=lanes.index + 1).some(good)

    def _with_care(self, lanes: Lanes) -> Mask:
        """Take variants to their next times alone; say which get there and go on."""
        on = np.zeros(lanes.motions.size, dtype=bool)
        lost: list[_Lost] = []
        each = zip(lanes.motions.tolist(), lanes.index.tolist(), strict=True)
        for lane, (variant, index) in enumerate(each):
            q = np.ascontiguousarray(self._motions.states[0, :, index - 1, variant])
            alone = self._sets.alone(variant, q)
            point = alone.equations.at(q, self._times[index - 1])
            known = Status.NOT_FINITE if point is None else alone.state(point)
            if isinstance(known, Status):
                self._take(index, variant, Outcome(known, 0, None))
                continue
            outcome = alone.advance(known, self._times[index], self._inputs.max_iterations)
            if outcome.position is None:
                lost.append((variant, index, alone, known, outcome))
                continue
            on[lane] = self._take(index, variant, outcome) and index + 1 < len(self._times)
        self._give_up(lost)
        return on

    def _give_up(self, lost: Sequence[_Lost]) -> None:
        """Find out why variants do not get to a time."""
        if not lost:
            return
        sets = self._p[[variant for variant, *_ in lost]]
        times = np.array([self._times[index] for _, index, *_ in lost])
        places = np.array([known.point.q if end.state is None else end.state.point.q
                           for *_, known, end in lost])  # fmt: skip
        equations, most = self._begin.equations, self._inputs.max_iterations
        vain = np.isnan(safeguarded(equations, sets, times, places, most)[0]).tolist()
        for (variant, index, alone, known, end), p, is_in_vain in zip(
            lost, sets, vain, strict=True
        ):
            t, own = self._times[index], replace(self._inputs, p=p)
            outcome = give_up(alone, end, t, own, is_in_vain=is_in_vain)
            if not outcome.exhausted:
                outcome, *_ = ended(alone, outcome, t, [known])
            self._take(index, variant, outcome)

    def _record(self, lanes: Lanes, state: State, good: Mask, iterations: Any) -> None:
        """Write down the variants that are good, each at its own next time."""
        motions, index, own = self._motions, lanes.index[good], lanes.motions[good]
        found = state.point.q, state.q_dot, state.q_ddot
        is_all = own.size == len(self._p) and (index == index[0]).all()
        for target, values in zip(motions.states, found, strict=True):
            if is_all:
                target[:, index[0]] = values
            else:
                target[:, index, own] = values[:, good]
        motions.status[index, own] = Status.CONVERGED
        motions.residual[index, own] = largest(state.point.Phi, good.size)[good]
        motions.iterations[index, own] = iterations[good]

    def _take(self, index: int, variant: int, outcome: Outcome) -> bool:
        """Write down what was found for one variant alone; say whether it goes on from there."""
        found, status = outcome.state, outcome.status
        if found is not None and status is Status.CONVERGED and found.sensitivity > TOO_NEAR:
            status = Status.SINGULAR  # its rates are too uncertain to go on from
        self._motions.of(variant).put(index, replace(outcome, status=status))
        return status is Status.CONVERGED


def _solution(inputs: Inputs, motions: Motion, doubt: str) -> Solution:
    name, count = inputs.code.name, motions.status.shape[1]
    statuses = motions.status.T
    failed = np.flatnonzero((statuses != Status.CONVERGED).any(axis=1))
    message = f"{name}: all {count} variants converged at all {inputs.t.size} points."
    if failed.size:
        variant = int(failed[0])
        index = int(np.argmax(statuses[variant] != Status.CONVERGED))
        status = next(item for item in Status if item == statuses[variant, index])
        why = f"{status.sentence} Solve it alone to see where exactly a motion ends, and why."
        why = LEFT if status is Status.NOT_CONVERGED and index == 0 else why
        message = (
            f"{name}: {failed.size} of {count} variants failed; the first is variant "
            f"{variant} at t = {inputs.t[index]:.10g} ({status.name}). {why}"
        )
    return Solution(
        success=failed.size == 0,
        message=f"{message} {doubt}".rstrip(),
        doubt=doubt,
        t=inputs.t,
        **motions.fields(),
        **inputs.about(),
    )
