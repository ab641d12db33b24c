"""A large mechanism's motion followed through its times: compiled, in stages, and with care."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.runtime.follow import follow, go_on, other_branch, taken_up
from kincompile.runtime.large import LargeMarch, LargeState
from kincompile.runtime.march import Outcome, State, start
from kincompile.runtime.problem import Point, problem
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.motion import Motion, Progress

LARGEST_CAREFUL = 1000
"""Coordinates up to which a large mechanism is left to the careful march where its own fails: there
a step takes a fraction of a second."""


def follow_large(
    inputs: Inputs,
    motion: Motion,
    may_be_compiled: bool,
    smooth: bool,
    progress: Progress | None,
) -> Outcome:
    """Go through the grid with the module of a large mechanism.

    Where it has a march of its own, that goes as far as it can, here one point is added, and so on.
    """
    march, times = _large_march(inputs, motion), inputs.t.tolist()
    good, outcome, index = None, Outcome(Status.CONVERGED, 0, None), 0
    while outcome.status is Status.CONVERGED and index < len(times):
        done = _run_compiled(march, motion, index) if may_be_compiled and index else 0
        if done:
            good, index = None, index + done
        if index < len(times):
            good, found = _next_large(march, motion, times, index, good)
            outcome = _large_outcome(found, good)
            motion.put(index, outcome)
            motion.statistics["marched"] += index > 0
            if isinstance(found, LargeState):
                good, index = found, index + 1
        if progress and index < len(times):
            progress(index, len(times))
    if march.pivoted:
        motion.statistics["pivoted"] = march.pivoted
    if outcome.status is Status.CONVERGED or inputs.guess.size > LARGEST_CAREFUL:
        if progress:
            progress(len(times), len(times))
        return outcome
    if good is None:
        return follow(inputs, motion, False, smooth, progress)
    equations = problem(inputs.module, inputs.p, good.q, times[0], inputs.guess)
    outcome = taken_up(equations, motion, good.t, index - 1)
    return go_on(equations, inputs, motion, index, outcome, False, smooth, progress)


def _large_march(inputs: Inputs, motion: Motion) -> LargeMarch:
    """Return the march of a large mechanism, whose start is on the guess's branch if it can be."""
    march, t = LargeMarch(inputs), float(inputs.t[0])
    if inputs.guess.size > LARGEST_CAREFUL:
        return march
    found = march.start(t)
    if isinstance(found, Status) or not march.leaves_branch(found):
        return march
    at_guess = problem(inputs.module, inputs.p, inputs.guess, t, inputs.guess)
    careful = start(at_guess, t, inputs).position
    motion.note = other_branch(at_guess, inputs, careful or at_guess.at(found.q, t))
    return march if careful is None else LargeMarch(replace(inputs, guess=careful.q))


def _run_compiled(march: LargeMarch, motion: Motion, index: int) -> int:
    """Let compiled code fill the points from an index on; return how many it could."""
    states = motion.q, motion.q_dot, motion.q_ddot
    done = march.run_compiled(index, states, motion.residual, motion.iterations)
    if done:
        motion.status[index : index + done] = Status.CONVERGED
        motion.statistics["compiled"] = motion.statistics.get("compiled", 0) + done
    return done


def _next_large(
    march: LargeMarch, motion: Motion, times: Sequence[float], index: int, good: LargeState | None
) -> tuple[LargeState | None, LargeState | Status]:
    """Return the state before a point, which is found again if it is not given, and the point."""
    if index == 0:
        return None, march.start(times[0])
    if good is None:
        known = march.take_up(motion.q[index - 1], times[index - 1])
        if isinstance(known, Status):
            return None, known
        good = known
    return good, march.advance(good, times[index])


def _large_outcome(found: LargeState | Status, good: LargeState | None) -> Outcome:
    """Return a point of a large mechanism's motion, or how it failed after a good one."""
    if isinstance(found, LargeState):
        point = Point(found.q, found.Phi, np.empty((0, 0)), 0.0)
        state = State(found.t, point, found.q_dot, found.q_ddot, ())
        return Outcome(Status.CONVERGED, found.iterations, state, point)
    last = None if good is None else _large_outcome(good, None).state
    return Outcome(found, 0, last)
