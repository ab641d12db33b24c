"""A large mechanism's motion followed through its times: in stages, and with care."""

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
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.motion import Motion, Progress

LARGEST_CAREFUL = 1000
"""Coordinates up to which a large mechanism is left to the careful march where its own fails: there
a step takes a fraction of a second."""


def follow_large(
    inputs: Inputs, motion: Motion, smooth: bool, progress: Progress | None
) -> Outcome:
    """Go through the grid with the module of a large mechanism, from point to point."""
    march, times = _large_march(inputs, motion), inputs.t.tolist()
    good, outcome, index = None, Outcome(Status.CONVERGED, 0, None), 0
    while outcome.status is Status.CONVERGED and index < len(times):
        found = march.start(times[0]) if good is None else march.advance(good, times[index])
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


def _large_outcome(found: LargeState | Status, good: LargeState | None) -> Outcome:
    """Return a point of a large mechanism's motion, or how it failed after a good one."""
    if isinstance(found, LargeState):
        point = Point(found.q, found.Phi, np.empty((0, 0)), 0.0)
        state = State(found.t, point, found.q_dot, found.q_ddot, ())
        return Outcome(Status.CONVERGED, found.iterations, state, point)
    last = None if good is None else _large_outcome(good, None).state
    return Outcome(found, 0, last)
