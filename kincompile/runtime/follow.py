"""A motion followed through its times: on the grid where it can be trusted, else point by point."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import RESIDUAL_FACTOR, SMALL_ERROR, TOO_NEAR
from kincompile.runtime.grid import CORRECTIONS_ON_GRID, GridResult, solve_grid
from kincompile.runtime.march import (
    Outcome,
    State,
    advance,
    complete,
    leaves_branch,
    start,
)
from kincompile.runtime.problem import Point, problem
from kincompile.runtime.singular.events import branch_switch, locate, singular_start
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.motion import Motion, Progress
    from kincompile.runtime.problem import Problem
    from kincompile.runtime.singular.events import Passage


def follow(
    inputs: Inputs, motion: Motion, on_grid: bool, smooth: bool, progress: Progress | None
) -> Outcome:
    """Go through the grid up to its end, or to the first point that fails."""
    t = float(inputs.t[0])
    at_guess = problem(inputs.module, inputs.p, inputs.guess, t, inputs.guess)
    outcome = start(at_guess, t, inputs)
    motion.put(0, outcome)
    if progress:
        progress(1, inputs.t.size)
    motion.note = other_branch(at_guess, inputs, outcome.position)
    # The guess may be rough: from here on the assembled mechanism gives the size.
    assembled = inputs.guess if outcome.position is None else outcome.position.q
    equations = problem(inputs.module, inputs.p, assembled, t, inputs.guess)
    return go_on(equations, inputs, motion, 1, outcome, on_grid, smooth, progress)


def other_branch(equations: Problem, inputs: Inputs, position: Point | None) -> str:
    """Say so where the first position lies on another branch than the guess."""
    time = float(inputs.t[0])
    guess = equations.at(inputs.guess, time)
    if guess is None or position is None or not leaves_branch(equations, time, guess, position):
        return ""
    return (
        f" The position at t = {time:.10g} is on another branch than the guess: kc.assemblies "
        "gives all of them, and each serves as a guess."
    )


def go_on(
    equations: Problem,
    inputs: Inputs,
    motion: Motion,
    index: int,
    outcome: Outcome,
    on_grid: bool,
    smooth: bool,
    progress: Progress | None,
) -> Outcome:
    """Go from the point before an index to the end, or to the first point that fails."""
    index, outcome = _run(equations, inputs, motion, index, outcome, on_grid, progress)
    while outcome.status is not Status.CONVERGED:
        passage = _explain(equations, inputs, motion, index - 1, outcome)
        if passage is None or not smooth:
            break
        motion.passed.append(motion.events[-1])
        index, outcome = _pass(equations, inputs, motion, index - 1, passage)
        index, outcome = _run(equations, inputs, motion, index, outcome, on_grid, progress)
    motion.forget(index)
    return outcome


def _run(
    equations: Problem,
    inputs: Inputs,
    motion: Motion,
    index: int,
    outcome: Outcome,
    on_grid: bool,
    progress: Progress | None,
) -> tuple[int, Outcome]:
    """Follow a motion from the point before an index as far as it goes; return the next index."""
    times = inputs.t
    trusted = np.zeros(len(times), dtype=bool)
    if on_grid and outcome.state is not None and outcome.state.t == times[index - 1]:
        trusted[index - 1 :] = _grid(equations, inputs, motion, outcome.state, index - 1)
    while index < len(times) and outcome.status is Status.CONVERGED:
        state = outcome.state
        if state is None:
            break
        stop = _end_of_run(trusted, index)
        if stop > index and _continues(equations, motion, state, index):
            motion.status[index:stop] = Status.CONVERGED
            outcome = taken_up(equations, motion, float(times[stop - 1]), stop - 1)
            index = stop
        else:
            outcome = advance(equations, state, float(times[index]), inputs)
            motion.put(index, outcome)
            motion.statistics["marched"] += 1
            index += 1
            # Rates near a singularity are too uncertain to predict from: the point before serves.
            if outcome.state and outcome.state.sensitivity > max(TOO_NEAR, state.sensitivity):
                outcome = replace(outcome, state=state)
        if progress:
            progress(index, len(times))
    return index, outcome


def _explain(
    equations: Problem, inputs: Inputs, motion: Motion, index: int, outcome: Outcome
) -> Passage | None:
    """Find the event that ends the motion at a point; return the way through it if there is one."""
    t, state = float(inputs.t[index]), outcome.state
    if state is None:
        if outcome.status is Status.SINGULAR and outcome.position is not None:
            motion.events += filter(None, [singular_start(equations, outcome.position, t)])
        return None
    duration = abs(t - float(inputs.t[0]))
    found = locate(equations, state, t, duration)
    if found is not None:
        motion.events.append(found[0])
        return found[1]
    if outcome.attempt is not None and outcome.attempt.status is Status.CONVERGED:
        q = outcome.attempt.last.q
        motion.events.append(branch_switch(inputs.module, state, t, q, equations.spread(q)))
    return None


def _pass(
    equations: Problem, inputs: Inputs, motion: Motion, index: int, passage: Passage
) -> tuple[int, Outcome]:
    """Fill the points within the passage through a bifurcation, and take the next one."""
    times, after = inputs.t.tolist(), passage.after
    forward = math.copysign(1.0, after.t - passage.before.t)
    while index < len(times) and (times[index] - after.t) * forward <= 0:
        q, q_dot, q_ddot = passage.at(times[index])
        point = equations.at(q, times[index])
        if point is None or not equations.holds(point, RESIDUAL_FACTOR * inputs.tolerance):
            return index + 1, Outcome(Status.SINGULAR, 0, passage.before, None)
        motion.put(
            index,
            Outcome(Status.CONVERGED, 0, State(times[index], point, q_dot, q_ddot, ()), point),
        )
        index += 1
    if index == len(times):
        return index, Outcome(Status.CONVERGED, 0, after, after.point)
    outcome = advance(equations, after, times[index], inputs)
    motion.put(index, outcome)
    motion.statistics["marched"] += 1
    return index + 1, outcome


def _grid(
    equations: Problem, inputs: Inputs, motion: Motion, first: State, index: int
) -> NDArray[np.bool_]:
    """Solve all points from an index on together, and tell which of them can be trusted."""
    times = inputs.t[index:]
    trusted = np.zeros(times.size, dtype=bool)
    q, q_dot, q_ddot = (values[index:].T for values in (motion.q, motion.q_dot, motion.q_ddot))
    result = GridResult(q, q_dot, q_ddot, motion.residual[index:], trusted)
    motion.statistics["coarse"] += solve_grid(equations, times, first, inputs.tolerance, result)
    motion.iterations[index + 1 :] = CORRECTIONS_ON_GRID
    return trusted


def _end_of_run(trusted: NDArray[np.bool_], index: int) -> int:
    """Return where a run of trusted points that begins at an index ends."""
    rest = trusted[index:]
    return index + (rest.size if rest.all() else int(np.argmin(rest)))


def _continues(equations: Problem, motion: Motion, state: State, index: int) -> bool:
    """Say whether a point of the grid lies on the branch that the march came by.

    After trusted points it does. Where the march went on by itself, the grid's next point must be
    near its prediction.
    """
    if motion.status[index - 1] == Status.CONVERGED and motion.statistics["marched"] == 0:
        return True
    distance = np.abs(motion.q[index] - state.point.q) / equations.spread(state.point.q)
    return bool(np.max(distance) <= SMALL_ERROR)


def taken_up(equations: Problem, motion: Motion, t: float, index: int) -> Outcome:
    """Return a point of the grid as one from which the march can go on."""
    if index == motion.status.size - 1:
        point = Point(motion.q[index], np.empty(0), np.empty((0, 0)), 0.0)
        state = State(t, point, motion.q_dot[index], motion.q_ddot[index], ())
        return Outcome(Status.CONVERGED, 0, state, point)
    at = equations.at(np.ascontiguousarray(motion.q[index]), t)
    assert at is not None  # it was evaluated on the grid
    following = complete(equations, t, at)
    if isinstance(following, Status):
        return Outcome(following, 0, None, at)
    return Outcome(Status.CONVERGED, 0, following, at)
