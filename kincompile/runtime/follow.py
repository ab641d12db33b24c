"""A motion followed through its times: on the grid where it can be trusted, else point by point."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kincompile.criteria import OTHER_SIZE, RESIDUAL_FACTOR, SMALL_ERROR, TOO_NEAR
from kincompile.runtime.engine.code import Kind
from kincompile.runtime.engine.linear import LARGEST_CAREFUL, Dense
from kincompile.runtime.engine.scales import Point
from kincompile.runtime.engine.sparse import Sparse
from kincompile.runtime.grid import solve_grid
from kincompile.runtime.march import CORRECTIONS_ON_GRID, March, Outcome, State
from kincompile.runtime.memory import empty
from kincompile.runtime.singular.events import ended, singular_start
from kincompile.runtime.singular.sides import doubt
from kincompile.runtime.start import give_up, start
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.engine.linear import Linear
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.singular.events import Event, Passage

    Progress: TypeAlias = Callable[[int, int], object]


START: Kind[tuple[object, Outcome, March]] = Kind("start")
"""The last start of a module, with what it depends on: motions often begin at the same time."""


@dataclass(slots=True, eq=False)
class Motion:
    """A motion while it is being filled, N points and n coordinates; or B, which is the last axis.

    What is said beside the arrays is said of one.
    """

    # (3, n, N) or (3, n, N, B): q, q_dot and q_ddot; NaN where nothing was found, and unknown after
    # the last point reached
    states: Array
    # status, residual, iterations (N,) or (N, B): what became of each point
    status: NDArray[np.int64]
    residual: Array
    iterations: NDArray[np.int64]
    # Points by how they were found.
    statistics: dict[str, int] = field(default_factory=lambda: {"coarse": 0, "marched": 0})
    # events, passed: what happened on the way, and those of it that the motion went through
    events: list[Event] = field(default_factory=list)
    passed: list[Event] = field(default_factory=list)
    # Points so near to a singular configuration that their rates are uncertain.
    near: list[int] = field(default_factory=list)
    note: str = ""  # a remark for the message of the solution
    undriven: str = ""  # which drivers are missing, where equations depend on others everywhere
    is_folded: bool = False  # whether the guess shows no branch

    @classmethod
    def over(cls, inputs: Inputs, *count: int) -> Motion:
        """Make the arrays for a time grid, or for several motions over it, with nothing reached."""
        n, shape = inputs.guess.size, (inputs.t.size, *count)
        if count or inputs.code.blocks:
            states = empty((3, shape[0], n, *count)).swapaxes(1, 2)
        else:  # each coordinate contiguous in memory, as the code of a grid wants it
            states = empty((3, n, *shape))
        status = np.full(shape, int(Status.NOT_REACHED))
        return cls(states, status, np.full(shape, np.nan), np.zeros(shape, dtype=np.int64))

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All that there is an entry of for each point, and of each motion."""
        return self.states, self.status, self.residual, self.iterations

    def fields(self) -> dict[str, Any]:
        """Return the fields of a solution that it has."""
        names = ("q", "q_dot", "q_ddot", "status", "residual", "iterations")
        arrays = zip(names, (*self.states, *self.arrays[1:]), strict=True)
        said = {"statistics": self.statistics, "events": self.events}
        return said | {name: values.T for name, values in arrays}

    def of(self, which: Any) -> Motion:
        """Return one of the motions, or some of them; of a number or a slice in the same arrays."""
        states, status, residual, iterations = (values[..., which] for values in self.arrays)
        return Motion(states, status, residual, iterations)

    def during(self, times: slice) -> Motion:
        """Return all motions at some of the times, in the same arrays."""
        said = self.status[times], self.residual[times], self.iterations[times]
        return Motion(self.states[:, :, times], *said)

    def fill(self, which: Any, motion: Motion) -> None:
        """Fill in one of the motions, or some, that were followed by themselves."""
        for values, own in zip(self.arrays, motion.arrays, strict=True):
            values[..., which] = own

    def forget(self, *which: Any) -> None:
        """Take back what was written down at some times, of some of the motions."""
        self.states[..., *which] = self.residual[which] = np.nan
        self.status[which], self.iterations[which] = Status.NOT_REACHED, 0

    def put(self, index: int, outcome: Outcome) -> None:
        """Write down what became of a point."""
        self.status[index] = outcome.status
        self.iterations[index] = outcome.iterations
        self.states[..., index] = self.residual[index] = np.nan
        if outcome.position is not None:
            self.states[0, :, index] = outcome.position.q
        if (point := outcome.position or (None if outcome.jumps else outcome.nearest)) is not None:
            self.residual[index] = np.max(np.abs(point.Phi))
        if outcome.status is Status.CONVERGED and outcome.state is not None:
            self.states[1:, :, index] = outcome.state.q_dot, outcome.state.q_ddot
            if outcome.state.sensitivity > TOO_NEAR:
                self.near.append(index)

    def march_compiled(
        self, inputs: Inputs, march: March, guess: Array, sets: Array | None = None
    ) -> bool:
        """Let a compiled module follow it from a guess, or motions with sets of parameters (B, k).

        Their guess is one of all, (n,), or one of each, (n, B). Says whether all went well.
        """
        run, residual = inputs.code.march, np.empty(self.residual.shape)
        status, iterations = np.empty((2, *residual.shape), dtype=np.intc)
        assert run is not None
        found = self.states, residual, status, iterations
        run(inputs, np.ascontiguousarray(guess), *march.scales, sets, *found)
        self.residual[:], self.status[:], self.iterations[:] = residual, status, iterations
        return not status.any()


def follow(
    inputs: Inputs, progress: Progress | None = None, *, explains: bool = True
) -> tuple[Motion, Outcome]:
    """Go through the grid up to its end, or to the first point that fails.

    The event that ends a motion is located and noted; with `inputs.smooth` the motion continues
    past a bifurcation. `explains=False` skips locating it: searches over many mechanisms use that.
    """
    motion = Motion.over(inputs)
    continuation = _Continuation(inputs, motion, progress)
    outcome = continuation.start()
    if explains and (outcome.left_branch or outcome.other):
        motion.note = continuation.doubt(outcome)
    if inputs.method is None and continuation.march_compiled(outcome):
        return motion, outcome
    outcome = continuation.run(outcome)
    while explains and outcome.status is not Status.CONVERGED:
        outcome, passage = continuation.explain(outcome)
        if passage is None or not inputs.smooth:
            break
        outcome = continuation.run(continuation.go_through(passage))
    continuation.end()
    return motion, outcome


class _Continuation:
    """How far a motion was followed: `index` is the next point, found by `march`."""

    _march: March

    def __init__(self, inputs: Inputs, motion: Motion, progress: Progress | None) -> None:
        self._inputs, self._motion, self._times, self._index = inputs, motion, inputs.t, 0
        self._progress = progress or (lambda done, total: None)

    def start(self) -> Outcome:
        """Assemble the mechanism at the first time; a module keeps its last start."""
        inputs, made = self._inputs, self._inputs.code.made
        limits, given = (inputs.tolerance, inputs.max_iterations), (inputs.p, inputs.guess)
        key = inputs.code, float(self._times[0]), *limits, *(x.tobytes() for x in given)
        known = made.get((START, None))
        if known is None or known[0] != key:
            known = key, self._assembled(), self._march
            if not inputs.code.blocks:  # whose engine counts its solves
                made[START, None] = known
        _, outcome, self._march = known
        self._put(outcome)
        self._motion.is_folded = outcome.is_folded
        if outcome.position is not None and (self._times.size > 1 or not outcome.is_plain):
            # The guess may be rough: from here on the assembled mechanism gives the size.
            self._march = self._march_at(outcome.position.q, self._march.engine)
        return outcome

    def _assembled(self) -> Outcome:
        """Return the start from the guess."""
        inputs, time = self._inputs, float(self._times[0])
        self._march = self._march_at(inputs.guess, None)
        outcome = start(self._march, time, inputs)
        if self._is_sparse and outcome.state is None:
            self._leave_blocks(inputs.guess)
            outcome = start(self._march, time, inputs)
        return outcome

    def doubt(self, outcome: Outcome) -> str:
        """Say that the position found from the guess may not be the one that is meant."""
        if not self._may_be_dense:
            return ""
        return doubt(self._march.equations, self._inputs.guess, outcome, float(self._times[0]))

    def march_compiled(self, outcome: Outcome) -> bool:
        """Let a compiled module follow the motion from its start; say whether all went well.

        Where anything did not, the careful march finds out what it is, from the first time on.
        """
        motion, inputs, point = self._motion, self._inputs, outcome.position
        goes_on = inputs.t.size > 1 and outcome.status is Status.CONVERGED
        if inputs.code.march is None or not goes_on or point is None:
            return False
        is_whole = motion.march_compiled(inputs, self._march, point.q)
        if not is_whole:
            motion.forget(slice(1, None))
        motion.put(0, outcome)
        if is_whole:
            motion.statistics["compiled"] = inputs.t.size
        return is_whole

    def run(self, outcome: Outcome) -> Outcome:
        """Follow the motion as far as it goes."""
        trusted = self._solve_grid(outcome)
        while self._index < len(self._times) and outcome.status is Status.CONVERGED:
            state = outcome.state
            assert state is not None
            rest = trusted[self._index :]
            if rest[0] and self._continues(state):
                outcome = self._take_up(rest.size if rest.all() else int(np.argmin(rest)))
            else:
                outcome = self._advance(state)
            self._alive()
        return outcome

    def explain(self, outcome: Outcome) -> tuple[Outcome, Passage | None]:
        """Find the event that ends the motion, and the way through it if there is one.

        The outcome, and the point that failed, get the status of the event.
        """
        motion, equations, last = self._motion, self._march.equations, self._index - 1
        t, passage = float(self._times[last]), None
        if not self._may_be_dense or outcome.exhausted:
            return outcome, None
        if outcome.state is not None:
            outcome, event, passage = ended(self._march, outcome, t, self._point_before())
            motion.events += [event] if event else []
            motion.status[last] = outcome.status
        elif outcome.status is Status.SINGULAR and outcome.position is not None:
            motion.undriven = equations.code.undriven()
            if not motion.undriven:
                motion.events += filter(None, [singular_start(equations, outcome.position, t)])
        return outcome, passage

    def _point_before(self) -> Iterator[State]:
        """Yield the last of the times that was reached, if there is one."""
        if (index := self._index - 2) >= 0:
            q = np.ascontiguousarray(self._motion.states[0, :, index])
            if state := self._state(q, float(self._times[index])).state:
                yield state

    def go_through(self, passage: Passage) -> Outcome:
        """Fill the points within the passage through a bifurcation, and take the next one."""
        self._motion.passed.append(self._motion.events[-1])
        equations, times, after = self._march.equations, self._times, passage.after
        self._index -= 1
        forward = math.copysign(1.0, after.t - passage.before.t)
        while self._index < len(times) and (times[self._index] - after.t) * forward <= 0:
            t = float(times[self._index])
            q, q_dot, q_ddot = passage.at(t)
            point = equations.at(q, t)
            if point is None or not equations.holds(point, RESIDUAL_FACTOR * self._march.tolerance):
                self._index += 1
                return Outcome(Status.SINGULAR, 0, passage.before, None)
            state = State(t, point, q_dot, q_ddot, after.determinants)
            self._put(Outcome(Status.CONVERGED, 0, state, point))
        if self._index == len(times):
            return Outcome(Status.CONVERGED, 0, after, after.point)
        return self._advance(after)

    def end(self) -> None:
        """Clear the results of a grid after the last point reached."""
        self._motion.forget(slice(self._index, None))
        self._count_pivoted()

    def _count_pivoted(self) -> None:
        engine = self._march.engine
        if isinstance(engine, Sparse) and engine.pivoted:
            self._motion.statistics["pivoted"] = engine.pivoted

    @property
    def _is_sparse(self) -> bool:
        """Whether the blocks solve, and dense matrices may take over."""
        return isinstance(self._march.engine, Sparse) and self._may_be_dense

    @property
    def _may_be_dense(self) -> bool:
        return not (
            isinstance(self._march.engine, Sparse) and self._inputs.guess.size > LARGEST_CAREFUL
        )

    def _march_at(
        self, q: NDArray[np.float64], engine: Linear | None, t: float | None = None
    ) -> March:
        """Return the march of the mechanism, whose scales are those at a position."""
        inputs, time = self._inputs, float(self._times[0]) if t is None else t
        return March.at(inputs.code, inputs.p, q, time, inputs.tolerance, engine)

    def _leave_blocks(self, q: NDArray[np.float64]) -> None:
        """Solve dense matrices from here on: they have the last word."""
        self._count_pivoted()
        self._march = self._march_at(q, Dense(self._inputs.code, self._inputs.p))

    def _alive(self) -> None:
        self._progress(self._index, len(self._times))

    def _put(self, outcome: Outcome) -> None:
        self._motion.put(self._index, outcome)
        self._index += 1
        if self._index == 1:
            self._alive()

    def _advance(self, state: State) -> Outcome:
        """Go to the next time point by point."""
        march, most = self._march, self._inputs.max_iterations
        t = float(self._times[self._index])
        # A march that kept this call would keep the results until somebody collects garbage.
        outcome = march.advance(state, t, most, self._alive)
        doubtful = outcome.state is None or outcome.state.sensitivity > TOO_NEAR
        doubtful = doubtful or outcome.status is not Status.CONVERGED
        if doubtful and not outcome.exhausted and self._measure_again(state):
            again = self._advance(state)
            self._motion.iterations[self._index - 1] += outcome.iterations
            return again
        if self._is_sparse and doubtful and not outcome.exhausted:
            self._leave_blocks(state.point.q)
            known = self._state(state.point.q, state.t)
            careful = known if known.state is None else self._advance(known.state)
            spent = careful.iterations + outcome.iterations
            self._motion.iterations[self._index - 1] = spent
            return replace(careful, iterations=spent)
        if outcome.position is None and self._may_be_dense:
            outcome = give_up(march, outcome, t, self._inputs)
        self._put(outcome)
        self._motion.statistics["marched"] += 1
        # Rates near a singularity are too uncertain to predict from: the point before serves.
        if outcome.state and outcome.state.sensitivity > max(TOO_NEAR, state.sensitivity):
            return replace(outcome, state=state)
        return outcome

    def _measure_again(self, state: State) -> bool:
        """Measure the equations where the motion has come to; say whether they are others there.

        exp(-x) is not nearly singular at x = 20: it is small.
        """
        fresh = self._march_at(state.point.q, self._march.engine, state.t)
        now, before = fresh.equations.magnitude, self._march.equations.magnitude
        if not ((now < before / OTHER_SIZE) | (now > before * OTHER_SIZE)).any():
            return False
        self._march = fresh
        return True

    def _solve_grid(self, outcome: Outcome) -> NDArray[np.bool_]:
        """Solve all points from the last one on together; return which can be trusted."""
        motion, index, first = self._motion, self._index - 1, outcome.state
        trusted = np.zeros(len(self._times), dtype=bool)
        if not self._inputs.on_grid or outcome.status is not Status.CONVERGED or first is None:
            return trusted
        if first.t == self._times[index]:
            arrays = motion.states, motion.residual
            known = [values[..., index].copy() for values in arrays]
            found = (*(values[..., index:] for values in arrays), trusted[index:])
            times = self._inputs.t[index:]
            motion.statistics["coarse"] += solve_grid(self._march, times, first, *found)
            # The first point was found with care; the grid's numbers never take its place.
            for values, value in zip(arrays, known, strict=True):
                values[..., index] = value
            motion.iterations[index + 1 :] = CORRECTIONS_ON_GRID
        return trusted

    def _continues(self, state: State) -> bool:
        """Say whether a point of the grid lies on the branch that the march came by.

        After trusted points it does. Where the march went on by itself, the grid's next point must
        be near its prediction.
        """
        motion, index = self._motion, self._index
        if motion.status[index - 1] == Status.CONVERGED and motion.statistics["marched"] == 0:
            return True
        away = self._march.equations.extent(motion.states[0, :, index] - state.point.q)
        return bool(away <= SMALL_ERROR)

    def _take_up(self, count: int) -> Outcome:
        """Accept points of the grid; return the last one, from which the march continues."""
        motion, stop = self._motion, self._index + count
        last = stop - 1
        motion.status[self._index : stop] = Status.CONVERGED
        self._index = stop
        if stop < len(self._times):
            q = np.ascontiguousarray(motion.states[0, :, last])
            return self._state(q, float(self._times[last]))
        nothing, (q, q_dot, q_ddot) = np.empty(0), motion.states[..., last]
        point = Point(q, float(self._times[last]), nothing, nothing)
        state = State(point.t, point, q_dot, q_ddot, nothing)
        return Outcome(Status.CONVERGED, 0, state, point)

    def _state(self, q: NDArray[np.float64], t: float) -> Outcome:
        """Return a good position as a state from which the march can go on."""
        point = self._march.equations.at(q, t)
        assert point is not None  # it was evaluated before
        following = self._march.state(point)
        if isinstance(following, Status):
            return Outcome(following, 0, None, point)
        return Outcome(Status.CONVERGED, 0, following, point)
