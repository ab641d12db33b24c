r"""Singular configurations of a motion: located in time, classified, and named.

Where :math:`\Phi_q` is singular, its null vector :math:`v` is a movement that no equation forbids.
At a lock-up the drivers prescribe a motion that the joints do not allow: velocities become
unbounded, and the motion ends. At a bifurcation two motions cross, velocities stay finite, and the
mechanism may continue along either.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import AROUND, AT_EVENT, IN_RANGE, INVOLVED, LATE
from kincompile.html import Shown
from kincompile.names import listed
from kincompile.runtime.grid import HERMITE
from kincompile.runtime.march import March, Outcome, State
from kincompile.runtime.singular.curve import Bracket, Curve
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from kincompile.runtime.engine.code import Compiled
    from kincompile.runtime.engine.linear import Array as Vector
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.problem import Problem

    Motion = tuple[Vector, Vector, Vector]

LOCK_UP, BIFURCATION, BRANCH_SWITCH = "lock-up", "bifurcation", "branch switch"
"""Kinds of events."""

SENTENCES = {
    LOCK_UP: (
        "Lock-up at t = {t}: Phi_q is singular, and the velocities of {bodies} "
        "become unbounded: the drivers prescribe a motion that the joints do not allow. End the "
        "motion before this time (shorten the range of the drivers), change lengths, or drive one "
        "of these bodies instead."
    ),
    BIFURCATION: (
        "Bifurcation at t = {t}: Phi_q is singular, but velocities stay finite: {bodies} may "
        "continue in two ways. kc.solve(..., through='smooth'), or --through smooth, follows the "
        "smooth branch; otherwise end the motion before this time, change a length slightly, "
        "or drive one of these bodies near this time."
    ),
    BRANCH_SWITCH: (
        "Branch switch at t = {t}: at t = {later} the mechanism can be assembled, but "
        "{bodies} would have to jump there. Make the drivers continuous, or start a new "
        "motion at that time if the jump is wanted."
    ),
}
"""The message of an event, by its kind."""

DOUBTS = {
    "strays": "The position at t = {t} is on another branch than the guess{sides}",
    "other": "Another position at t = {t}, with {bodies} elsewhere, is as near to the guess",
    "remedy": ": kc.assemblies gives all of them; assembly=N, or --assembly N, starts in one.",
}
"""Warnings about a start on another branch than the guess may mean."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Event(Shown):
    """Something that happens to the motion as a whole.

    Attributes
    ----------
    kind : str
        ``"lock-up"``, ``"bifurcation"`` or ``"branch switch"``.
    t : float
        When; of a branch switch the last time up to which the motion could be followed.
    bodies : tuple of str
        Bodies that take part in the movement that nothing determines there, in the order of the
        mechanism; coordinates that belong to no body under their own names.
    message : str
        What happens, and what to do.
    q : ndarray, shape (n,)
        The position there.
    null_vector : dict
        Share of each coordinate in that movement: of lengths in sizes of the mechanism, of angles
        in radians, the largest being 1. Empty for a branch switch.
    """

    kind: str
    t: float
    bodies: tuple[str, ...]
    message: str
    q: Vector
    null_vector: dict[str, float]

    def to_text(self) -> str:
        """Return what happens, and what to do."""
        return self.message

    def __repr__(self) -> str:
        """Give kind, time and bodies."""
        return f"<{self.kind} at t = {self.t:.10g}: {listed(self.bodies)}>"


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """The motion on both sides of a bifurcation, on the smooth branch."""

    # before, after: points of the motion so far from the bifurcation that their rates are accurate
    before: State
    after: State

    def at(self, t: float) -> tuple[Vector, Vector, Vector]:
        """Return position, velocity and acceleration between the two, by interpolation."""
        ends = [(x.t, (x.point.q, x.q_dot, x.q_ddot)) for x in (self.before, self.after)]
        return quintic(*ends[0], *ends[1], t)


def quintic(t0: float, first: Motion, t1: float, last: Motion, t: float) -> Motion:
    """Return position, velocity and acceleration between two points of a motion that have them."""
    h = t1 - t0
    left, right = (np.array([x[0], h * x[1], h * h * x[2]]) for x in (first, last))
    coefficients = HERMITE.T @ np.vstack((left, right))
    s = (t - t0) / h
    powers = s ** np.arange(6)
    order = np.arange(1, 6)
    rates = np.append(0.0, order * powers[:5])
    second = np.append([0.0, 0.0], (order * (order - 1))[1:] * powers[:4])
    return powers @ coefficients, rates @ coefficients / h, second @ coefficients / h**2


def locate(march: March, state: State, latest: float) -> tuple[Event, Passage | None] | None:
    """Find the singular configuration that a motion cannot pass between a good state and `latest`.

    Returns the event, and for a bifurcation the motion on both sides of it; None where the curve
    goes on to that time, or nowhere.
    """
    equations = march.equations
    # A time that belongs to the motion, whatever span was asked for.
    speed = float(np.max(np.abs(state.q_dot) / equations.reference))
    curve = Curve(equations, state, 1 / speed if speed > 0 else abs(latest - state.t))
    forward = math.copysign(1.0, latest - state.t)
    start = curve.start(state, forward)
    bracket = start and curve.next_singular(start, latest + LATE * (latest - state.t))
    if not bracket:
        return None
    singular = curve.singular_point(bracket)
    if singular is None:
        return None
    place, at = singular
    if (place.t - latest) * forward > LATE * abs(latest - state.t):
        return None
    kind = LOCK_UP if bracket.turns else BIFURCATION
    event = _event(equations, kind, place.q, place.t, place.point.Phi_q)
    return event, None if bracket.turns else _passage(march, curve, bracket, at)


def ended(
    march: March, outcome: Outcome, t: float, before: Iterable[State]
) -> tuple[Outcome, Event | None, Passage | None]:
    """Find the event that ends a motion on the way to a time, and the way through it if any.

    The outcome gets its status. From the point before is looked too: a rounding error before an
    event a state is too near to say what it is.
    """
    equations, state, nearest = march.equations, outcome.state, outcome.nearest
    assert state is not None
    places = itertools.chain([state], before)
    found = next(filter(None, (locate(march, place, t) for place in places)), None)
    if not found and outcome.jumps and nearest is not None:
        switch = branch_switch(equations.code, state, t, nearest.q, equations.reference)
        found = switch, None
    if not found:
        return outcome, None, None
    return replace(outcome, status=status_after(found[0], outcome, t)), *found


def singular_start(equations: Problem, point: Point, t: float) -> Event | None:
    """Tell what a position is from which no motion is known: a lock-up or a bifurcation."""
    nu = equations.nu(point.q, t)
    if not (np.isfinite(nu).all() and np.isfinite(point.Phi_q).all()):
        return None
    weights = equations.weights()
    basis, sizes, _ = np.linalg.svd(equations.scaled(point.Phi_q), full_matrices=False)
    missing = basis[:, sizes <= IN_RANGE * sizes[0]].T @ (weights * nu)
    demanded = float(np.linalg.norm(missing)) > IN_RANGE * float(np.linalg.norm(weights * nu))
    kind = LOCK_UP if demanded else BIFURCATION
    # The module keeps the position; the event's is the user's.
    return _event(equations, kind, point.q.copy(), t, point.Phi_q)


def status_after(event: Event, outcome: Outcome, t: float) -> Status:
    """Return the status of a point at which an event has ended the motion.

    How Newton's method fails there rounding decides: beyond a lock-up there is no position that
    continues the motion, and none where it would have to jump; at a lock-up, and at and beyond a
    bifurcation, Phi_q is singular.
    """
    if outcome.position is not None or outcome.status is Status.NOT_FINITE:
        return outcome.status
    is_there = abs(event.t - t) <= AT_EVENT * max(abs(event.t), abs(t))
    if event.kind == BRANCH_SWITCH:
        return Status.NOT_CONVERGED
    return Status.LOCK_UP if event.kind == LOCK_UP and not is_there else Status.SINGULAR


def branch_switch(code: Compiled, state: State, t: float, q: Vector, reference: Vector) -> Event:
    """Return the event of a position q at t that a mechanism could only jump to from a state."""
    jump = (q - state.point.q) / reference
    bodies = involved(code, jump)
    text = SENTENCES[BRANCH_SWITCH].format(
        t=f"{state.t:.10g}", bodies=listed(bodies), later=f"{t:.10g}"
    )
    return Event(BRANCH_SWITCH, state.t, bodies, text, q, {})


def _event(equations: Problem, kind: str, q: Vector, t: float, Phi_q: Vector) -> Event:
    """Name what moves, and say what to do."""
    _, sizes, directions = np.linalg.svd(equations.scaled(Phi_q))
    # Equal loops become singular together: then several movements are free, in the end all.
    free = directions[np.append(sizes[:-1] <= IN_RANGE * max(sizes[0], 1.0), True)]
    return event_of(equations.code, kind, SENTENCES, t, q, free)


def event_of(
    code: Compiled, kind: str, sentences: Mapping[str, str], t: float, q: Vector, free: Vector
) -> Event:
    """Return an event at which movements (k, n), in scales, are free; it shows the last one."""
    bodies = involved(code, np.linalg.norm(free, axis=0))
    text = sentences[kind].format(t=f"{t:.10g}", bodies=listed(bodies))
    shares = (free[-1] / free[-1][np.argmax(np.abs(free[-1]))]).tolist()
    return Event(kind, t, bodies, text, q, dict(zip(code.coordinates, shares, strict=True)))


def involved(code: Compiled, movement: Vector) -> tuple[str, ...]:
    """Return the bodies that take part in a movement, and coordinates that belong to none."""
    large = np.abs(movement) > INVOLVED * np.max(np.abs(movement), initial=0.0)
    owners = code.owners()
    names = zip(code.coordinates, large.tolist(), strict=True)
    return tuple(dict.fromkeys(owners[name] for name, is_large in names if is_large))


def _passage(march: March, curve: Curve, bracket: Bracket, at: float) -> Passage | None:
    """Return the motion on both sides of a bifurcation."""
    sides = []
    for length in (at - AROUND, at + AROUND):
        place = curve.step(bracket.first, length)
        point = place and curve.equations.at(place.q, place.t)
        state = point and march.state(point)
        if not isinstance(state, State):
            return None
        sides.append(state)
    return Passage(*sides)
