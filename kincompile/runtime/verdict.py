"""How a motion went, in words: the solution with its verdict, and what is said of its start."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import LATE, MAX_SUBSTEPS, ZERO
from kincompile.errors import BranchSwitchWarning, SingularConfigurationWarning
from kincompile.names import listed
from kincompile.runtime.problem import problem
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.singular.assemblies import unchosen
from kincompile.runtime.singular.reach import impossible, missed
from kincompile.runtime.start import is_folded
from kincompile.runtime.status import Status
from kincompile.tables import pose

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.follow import Motion
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.march import Outcome
    from kincompile.runtime.problem import Problem
    from kincompile.runtime.singular.events import Event

NAMED_EQUATIONS = 3
"""How many equations a message names."""

NAMED_BODIES = 6
"""Of how many bodies a message gives the position."""

CANNOT_BE = "No position was found: the mechanism cannot be assembled"

WORDS = {
    "converged": "{name}: {points} converged; the largest residual is {residual}.",
    "failed": "{name} failed at t = {t}, point {point} of {count} ({status}).",
    "one before": "The point before it is good",
    "before": "The {before} points before it are good",
    "followed": "; the motion was followed to t = {t}",
    # There is no motion yet where a first point does not converge.
    "not assembled": f"{CANNOT_BE} at this time (change lengths, or what the drivers demand), or "
    "the guess is too far away (give one nearer to the assembled mechanism; kc.assemblies(module) "
    "looks for positions).",
    "exhausted": f"Between these two times {MAX_SUBSTEPS:,} steps were not enough: ask for more "
    "times.",
    "found": "The position there was found.",
    "jumps": "A position exists at that time, but the motion does not lead there continuously.",
}
"""What is said of a motion, and of how it ended."""

UNREACHED = (Status.NOT_CONVERGED, Status.NOT_ASSEMBLED, Status.LOCK_UP)
"""Statuses of a point at which no position was found."""


def finite(solution: Solution) -> Solution:
    """Take no point for converged whose numbers are not all finite, whichever march found it.

    The compiled march has checked its points; a second check would read them from memory again.
    """
    if solution.statistics.get("compiled") == solution.t.size:
        return solution
    numbers = solution.q, solution.q_dot, solution.q_ddot
    if math.isfinite(sum(values.ravel("K").sum() for values in numbers)):
        return solution  # nearly always, and one number costs less than a mask
    is_finite = np.isfinite(sum(values.sum(axis=-1) for values in numbers))
    wrong = (solution.status == Status.CONVERGED) & ~is_finite
    if not wrong.any():
        return solution
    status = np.where(wrong, Status.NOT_FINITE, solution.status)
    text = f"{solution.name} failed: {wrong.sum()} points have numbers that are not finite."
    message = f"{text} {Status.NOT_FINITE.sentence}"
    return replace(solution, status=status, success=False, message=message)


def start_of(inputs: Inputs, motion: Motion) -> str:
    """Say that a start does not choose between ways to assemble the mechanism, if it does not."""
    may_be_open = motion.is_folded or inputs.without_guess
    if not may_be_open or motion.status[0] != Status.CONVERGED:
        return ""
    return unchosen(inputs, motion.states[0, :, 0].copy(), motion.is_folded)


def start_of_first(inputs: Inputs, solution: Solution) -> str:
    """Say of variants what is said of the first."""
    if solution.status[0, 0] != Status.CONVERGED:
        return ""
    q, time = solution.q[0, 0].copy(), float(inputs.t[0])
    equations = problem(inputs.code, inputs.p, inputs.guess, time)
    guess, found = (equations.at(position, time) for position in (inputs.guess, q))
    return unchosen(inputs, q, bool(guess and found and is_folded(equations, guess, found)))


def solution_of(inputs: Inputs, motion: Motion, outcome: Outcome) -> Solution:
    """Put names, parameters and a verdict to the numbers, and warn of what was passed."""
    code = inputs.code
    success = outcome.status is Status.CONVERGED
    for event in motion.passed:
        text = f"{code.name} goes through a bifurcation at t = {event.t:.10g}, and on"
        warnings.warn(f"{text} along the smooth branch.", BranchSwitchWarning, stacklevel=4)
    if motion.near and success:
        warnings.warn(_nearly(inputs, motion.near), SingularConfigurationWarning, stacklevel=4)
    return Solution(
        success=success,
        message=_verdict(inputs, motion, outcome) + motion.note,
        **fields_of(inputs, motion),
    )


def fields_of(inputs: Inputs, motion: Motion) -> dict[str, Any]:
    """Return the fields of a solution that the motion of one parameter set has, or of several."""
    q, q_dot, q_ddot = (values.T for values in motion.states)
    status, residual, iterations = motion.status.T, motion.residual.T, motion.iterations.T
    said = {"statistics": motion.statistics, "events": motion.events, **about(inputs)}
    return dict(
        t=inputs.t, q=q, q_dot=q_dot, q_ddot=q_ddot,
        status=status, residual=residual, iterations=iterations, **said,
    )  # fmt: skip


def about(inputs: Inputs) -> dict[str, Any]:
    """Return what a solution says of its mechanism, by field."""
    code, p = inputs.code, inputs.p.tolist() if inputs.sets is None else inputs.sets.T
    return {
        "name": code.name,
        "coordinates": code.coordinates,
        "equations": code.equations,
        "units": dict(code.units),
        "parameters": dict(zip(code.parameters, p, strict=True)),
        "sweep": dict(inputs.sweep),
        "module": code.module,
    }


def _nearly(inputs: Inputs, near: list[int]) -> str:
    """Say that points of a motion, given by their numbers, are nearly singular."""
    more = f" and {len(near) - 1} more times" if len(near) > 1 else ""
    return (
        f"{inputs.code.name} is nearly singular at t = {inputs.t[near[0]]:.10g}{more}: its rates "
        "have few good digits there (see .condition). Drive another coordinate near this time, or "
        "change a length slightly."
    )


def _verdict(inputs: Inputs, motion: Motion, outcome: Outcome) -> str:
    """Say in words how a motion went; the outcome is that of the last point that was tried."""
    name, times, events = inputs.code.name, inputs.t, motion.events
    if outcome.status is Status.CONVERGED:
        points = f"all {times.size} points" if times.size > 1 else "the point"
        passed = "".join(f" Passed: {event.kind} at t = {event.t:.10g}." for event in events)
        largest = motion.residual.max()
        return (
            WORDS["converged"].format(name=name, points=points, residual=f"{largest:.2g}") + passed
        )
    index = int(np.argmax(motion.status != Status.CONVERGED))
    asked = _asked(inputs, outcome)
    why = motion.undriven or _why(outcome, events, times[index], asked)
    parts = [
        WORDS["failed"].format(
            name=name,
            t=f"{times[index]:.10g}",
            point=index + 1,
            count=times.size,
            status=outcome.status.name,
        ),
        _before(outcome, index),
        why,
        _there(inputs, outcome),
    ]
    return " ".join(part for part in parts if part)


def _before(outcome: Outcome, index: int) -> str:
    """Say how far the motion was followed."""
    if outcome.state is None:
        return ""
    good = WORDS["before" if index > 1 else "one before"].format(before=index)
    reached = WORDS["followed"].format(t=f"{outcome.state.t:.10g}")
    return f"{good}{'' if outcome.position else reached}."


def _asked(inputs: Inputs, outcome: Outcome) -> str:
    """Say which drivers and distances ask for more than the mechanism can give, and how much."""
    point = outcome.nearest
    if point is None or outcome.jumps or outcome.status not in UNREACHED:
        return ""
    return " ".join(impossible(_equations_at(inputs, point), point.q, point.t))


def _equations_at(inputs: Inputs, point: Point) -> Problem:
    return problem(inputs.code, inputs.p, point.q, point.t)


def _why(outcome: Outcome, events: Sequence[Event], t: float, asked: str) -> str:
    """Say why the motion ended, and what to do: by the event between its end and the failed time.

    Without one, what the status may mean is said in general, and the last event on the way.
    """
    if outcome.status is Status.NOT_ASSEMBLED:
        return f"{CANNOT_BE} at this time: {asked}" if asked else WORDS["not assembled"]
    if outcome.exhausted:
        return WORDS["exhausted"]
    general = " ".join((outcome.status.sentence, *(event.message for event in events[-1:])))
    if events and outcome.state is not None:
        event, end = events[-1], outcome.state.t
        if abs(event.t - end) + abs(event.t - t) <= abs(t - end) + LATE:
            general = event.message
    return f"{general} {asked}".rstrip()


def _there(inputs: Inputs, outcome: Outcome) -> str:
    """Name the equations that do not hold at the time of failure, or say what else is there."""
    if outcome.position is not None:
        return WORDS["found"]
    if outcome.jumps:
        return WORDS["jumps"]
    return "" if outcome.nearest is None else _unmet(inputs, outcome.nearest)


def _unmet(inputs: Inputs, point: Point) -> str:
    """Say by how much which equations are missed at the best position, and where its bodies are."""
    sizes = np.abs(point.Phi)
    order = np.argsort(-sizes, kind="stable")[:NAMED_EQUATIONS]
    rows = [row for row in order.tolist() if sizes[row] > ZERO * sizes[order[0]]]
    equations = _equations_at(inputs, point)
    worst = ", ".join(missed(equations, point, row) for row in rows)
    places = listed(_places(inputs.code, point.q), most=NAMED_BODIES)
    return (
        f"The equations with the largest residuals at the nearest position: {worst}. "
        f"There: {places}."
    )


def _places(code: Compiled, q: Array) -> Iterator[str]:
    """Yield where each body is, and the values of coordinates that belong to none."""
    values = dict(zip(code.coordinates, q.tolist(), strict=True))
    places = {body: slice(first, first + count) for body, first, count in code.bodies}
    for owner in dict.fromkeys(code.owners().values()):
        if owner in places:
            yield f"{owner} {pose(q[places[owner]].tolist())}"
        else:
            yield f"{owner} = {values[owner]:.4g}"
