"""Many motions taken on side by side, each by steps of its own: the march on a batch.

What they share is the code of a step. Each lane has its own time, its own next time and its own
step, which is halved where it fails and grows where it does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import MAX_CORRECTIONS, MAX_SUBSTEPS, SMALLEST_PART
from kincompile.runtime.engine.scales import Point
from kincompile.runtime.march import State
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.march import March

    Mask = NDArray[np.bool_]
    Places = NDArray[np.intp]
    MarchOf = Callable[[Places], March]
    Record = Callable[["Lanes", State, Mask, NDArray[np.int64]], None]


@dataclass(frozen=True, slots=True, eq=False)
class Lanes:
    """Some of many motions: their numbers, those of the times that each comes to next, states."""

    motions: Places
    index: Places
    state: State

    def interval(self, times: Array) -> Array:
        """Return how far each is from its next time; NaN after the last."""
        return np.asarray(times[self.index] - self.state.t)

    def some(self, which: Mask | Places) -> Lanes:
        """Return some of them."""
        return Lanes(self.motions[which], self.index[which], some_of(self.state, which))


def take_on(
    lanes: Lanes, times: Array, march_of: MarchOf, record: Record
) -> tuple[Lanes, NDArray[np.int64]]:
    """Take lanes on over times (N,), to the last one or to where each is stuck.

    They go from time to time together; one that does not get there waits, and takes steps of its
    own in the end. `record` gets lanes, the states that they come to, which have reached their next
    times, and how many iterations these took. Returned are those that are stuck, where they are,
    and `Status` (B,): LOCK_UP, SINGULAR at a bifurcation, NOT_CONVERGED after too many steps, and
    NOT_REACHED where none of these is known.
    """
    lanes = _in_step(lanes, times, march_of, record)
    ends, over = [lanes.some(np.zeros(0, dtype=np.intp))], [np.zeros(0, dtype=np.int64)]
    march, begin, times = march_of(lanes.motions), lanes.state, np.append(times, np.nan)
    step = lanes.interval(times) / 2
    count, spent = np.zeros((2, step.size), dtype=np.int64)
    while lanes.motions.size:
        state, target = lanes.state, times[lanes.index]
        whole = np.abs(step) >= np.abs(target - state.t)
        aim = np.where(whole, target, state.t + step)
        following, good, iterations = march.step_together(state, aim, MAX_CORRECTIONS)
        count, spent = count + 1, spent + iterations
        reached = good & whole
        record(lanes, following, reached, spent)
        smallest = SMALLEST_PART * np.abs(target - begin.t)
        is_over = ~good & (count >= MAX_SUBSTEPS)
        is_stuck = is_over | (~good & (np.abs(step) <= smallest))
        lanes = Lanes(lanes.motions, lanes.index + reached, chosen(good, following, state))
        begin = chosen(reached, following, begin)
        target, forward = times[lanes.index], lanes.interval(times)
        locked = march.lock_up(begin, lanes.state, target, smallest)
        is_stuck |= locked
        if is_stuck.any():
            status = np.where(is_over, Status.NOT_CONVERGED, Status.NOT_REACHED)
            status[locked] = Status.LOCK_UP
            others = np.flatnonzero(is_stuck & ~locked)
            if others.size:
                own = lanes.some(others)
                is_one = march_of(own.motions).bifurcation(
                    own.state, target[others], smallest[others]
                )
                status[others[is_one]] = Status.SINGULAR
            ends.append(lanes.some(is_stuck))
            over.append(status[is_stuck])
        size = march.pace(lanes.state, forward, step, good, smallest)
        step = np.where(reached, forward, np.copysign(size, forward))
        count, spent = np.where(reached, 0, count), np.where(reached, 0, spent)
        left = ~is_stuck & (lanes.index < len(times) - 1)
        if not left.all():
            lanes, begin = lanes.some(left), some_of(begin, left)
            step, count, spent = step[left], count[left], spent[left]
            march = march_of(lanes.motions)
    return together(ends), np.concatenate(over)


def _in_step(lanes: Lanes, times: Array, march_of: MarchOf, record: Record) -> Lanes:
    """Take lanes on from time to time, as long as each gets to the next one; return the others."""
    failed, left = [lanes.some(np.zeros(0, dtype=np.intp))], lanes.index < len(times)
    lanes = lanes.some(left)
    march = march_of(lanes.motions)
    while lanes.motions.size:
        target = times[lanes.index]
        following, good, iterations = march.step_together(lanes.state, target, MAX_CORRECTIONS)
        record(lanes, following, good, iterations)
        here, lanes = lanes, Lanes(lanes.motions, lanes.index + 1, following)
        left = good & (lanes.index < len(times))
        if not left.all():
            failed.append(here.some(~good))
            lanes = lanes.some(left)
            march = march_of(lanes.motions)
    return together(failed)


def together(parts: Sequence[Lanes]) -> Lanes:
    """Return lanes from several parts as one."""
    motions = np.concatenate([part.motions for part in parts])
    index = np.concatenate([part.index for part in parts])
    return Lanes(motions, index, joined([part.state for part in parts]))


def batch(states: Sequence[State], combine: Callable[[Sequence[Array]], Array]) -> State:
    """Return a batch of states whose arrays are combined from those of other batches."""
    arrays = []
    for state in states:
        times, near = (
            np.broadcast_to(x, state.q_dot.shape[1:]) for x in (state.t, state.sensitivity)
        )
        kept = state.determinants if state.probed is None else state.probed
        arrays.append(
            (times, state.point.q, state.q_dot, state.q_ddot, state.determinants, near, kept)
        )
    t, q, *rest = (combine(parts) for parts in zip(*arrays, strict=True))
    nothing = np.empty(0)
    return State(t, Point(q, t, nothing, nothing), *rest)


def some_of(state: State, which: Any) -> State:
    """Return some of a batch of states."""
    return batch([state], lambda parts: parts[0][..., which])


def joined(states: Sequence[State]) -> State:
    """Return several batches of states as one."""
    return batch(states, lambda parts: np.concatenate(parts, axis=-1))


def chosen(which: Any, one: State, other: State) -> State:
    """Return of each of a batch one state or the other."""
    return batch([one, other], lambda parts: np.where(which, *parts))
