"""How a motion went, in words: the time, the status, what does not hold there, and what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.names import listed
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Code
    from kincompile.runtime.engine.engine import Array, Point
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.march import Outcome
    from kincompile.runtime.singular.events import Event

NAMED_EQUATIONS = 3
"""How many equations a message names."""

NAMED_BODIES = 6
"""Of how many bodies a message gives the position."""

LOCATED = 1e-6
"""How exactly an event is located in time."""

NOT_ASSEMBLED = (
    "No position was found: the mechanism cannot be assembled at this time (change lengths, or "
    "what the drivers demand), or the guess is too far away (give one nearer to the assembled "
    "mechanism; kc.assemblies(module) looks for positions)."
)
"""What a first point that does not converge means, and what to do: there is no motion yet."""

MET = 1e-9
"""Residual, relative to the largest, up to which an equation counts as met."""


def verdict(
    inputs: Inputs,
    status: NDArray[np.int64],
    residual: Array,
    outcome: Outcome,
    events: Sequence[Event],
) -> str:
    """Say in words how a motion went.

    Parameters
    ----------
    inputs
        What was to be solved.
    status, residual : ndarray, shape (N,)
        What became of each point.
    outcome
        What became of the last point that was tried.
    events
        Events on the way, in order.
    """
    name, times = inputs.code.name, inputs.t
    if outcome.status is Status.CONVERGED:
        points = f"all {times.size} points" if times.size > 1 else "the point"
        passed = "".join(f" Passed: {event.kind} at t = {event.t:.10g}." for event in events)
        return f"{name}: {points} converged; the largest residual is {residual.max():.2g}.{passed}"
    index = int(np.argmax(status != Status.CONVERGED))
    parts = [
        f"{name} failed at t = {times[index]:.10g}, point {index + 1} of {times.size}"
        f" ({outcome.status.name}).",
        _before(outcome, index),
        _why(outcome, events, times[index]),
        _there(inputs.code, outcome),
    ]
    return " ".join(part for part in parts if part)


def unassembled(outcome: Outcome) -> Point | None:
    """Give the position nearest to an assembled one, where the mechanism does not assemble."""
    attempt = outcome.attempt
    if attempt is None or not attempt.points or attempt.status is Status.CONVERGED:
        return None
    return attempt.last


def _before(outcome: Outcome, index: int) -> str:
    """Say how far the motion was followed."""
    if outcome.state is None:
        return ""
    good = f"The {index} points before it are good" if index > 1 else "The point before it is good"
    reached = f"; the motion was followed to t = {outcome.state.t:.10g}"
    return f"{good}{'' if outcome.position else reached}."


def _why(outcome: Outcome, events: Sequence[Event], t: float) -> str:
    """Say why the motion ended, and what to do: by the event between its end and the failed time.

    Without one, what the status may mean is said in general, and the last event on the way.
    """
    if outcome.state is None and outcome.status is Status.NOT_CONVERGED:
        return NOT_ASSEMBLED
    general = " ".join((outcome.status.sentence, *(event.message for event in events[-1:])))
    if not events or outcome.state is None:
        return general
    event, end = events[-1], outcome.state.t
    is_between = abs(event.t - end) + abs(event.t - t) <= abs(t - end) + LOCATED
    return event.message if is_between else general


def _there(code: Code, outcome: Outcome) -> str:
    """Name the equations that do not hold at the time of failure, or say what else is there."""
    if outcome.position is not None:
        return "The position there was found."
    if outcome.attempt is not None and outcome.attempt.status is Status.CONVERGED:
        return "A position exists at that time, but the motion does not lead there continuously."
    point = unassembled(outcome)
    return "" if point is None else _unmet(code, point)


def _unmet(code: Code, point: Point) -> str:
    """Say by how much which equations are missed at the best position, and where its bodies are."""
    sizes = np.abs(point.Phi)
    order = np.argsort(-sizes, kind="stable")[:NAMED_EQUATIONS]
    rows = [row for row in order.tolist() if sizes[row] > MET * sizes[order[0]]]
    worst = ", ".join(f"{code.equations[row]} = {point.Phi[row]:.3g}" for row in rows)
    places = listed(_places(code, point.q), most=NAMED_BODIES)
    return (
        f"The equations with the largest residuals at the nearest position: {worst}. "
        f"There: {places}."
    )


def _places(code: Code, q: Array) -> Iterator[str]:
    """Yield where each body is, and the values of coordinates that belong to none."""
    values = dict(zip(code.coordinates, q.tolist(), strict=True))
    firsts = {body: first for body, first, _ in code.bodies}
    for owner in dict.fromkeys(code.owners().values()):
        if owner in firsts:
            x, y, phi = q[firsts[owner] : firsts[owner] + 3]
            yield f"{owner} at ({x:.4g}, {y:.4g}), angle {phi:.4g}"
        else:
            yield f"{owner} = {values[owner]:.4g}"
