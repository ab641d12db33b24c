r"""What happens in a simulation: a value that is passed, a singular configuration.

Where :math:`\Phi_q` loses rank, the motion goes on smoothly as a rule, but beside it the equations
of motion hold only for states that satisfy the constraints. So no step may end there, and no stage
of one: the configuration is foreseen, and the step across it has it where it evaluates nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import criteria
from kincompile.errors import InputError
from kincompile.runtime.inputs import mapping_of
from kincompile.runtime.singular import events as singular
from kincompile.runtime.singular.curve import root
from kincompile.runtime.singular.events import LOCK_UP, Event, event_of, quintic

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from kincompile.runtime.dynamics.equations import Equations
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.singular.events import Motion

    States = Callable[[float], Array]

PASSAGE, STOP, SINGULAR = "passage", "stop", "singular configuration"
"""Kinds of events of a simulation."""

SENTENCES = {
    PASSAGE: "{name} is {value:.6g} at t = {t}.",
    STOP: "{name} comes to its stop, {value:.6g}, at t = {t}, and the motion ends there.",
    SINGULAR: (
        "Singular configuration at t = {t}: Phi_q loses rank there, and the equations of "
        "motion do not determine how {bodies} continue. Change a length slightly, restart beyond "
        "it, or continue along the smooth branch with through='smooth'."
    ),
    LOCK_UP: singular.SENTENCES[LOCK_UP],
}
"""What is said of them."""

PARTS = 8
"""Parts of a step at whose ends a value is looked at: what it passes twice within one is missed."""

MIDDLE = 0.4667
"""Part of a step of DOP853 that is farthest from its stages, which are at 0.333 and at 0.6."""

BESIDE = 0.1
"""Part of a step across a singular configuration, on either side of it, within which positions and
rates are interpolated."""

LOOKS = 8
"""How often the time of a singular configuration is looked at, each look squaring its error."""


def _asked(kind: str, values: Mapping[str, Any]) -> Iterator[tuple[str, str, float]]:
    """Yield kind, name and value of what is to be located; of a name there may be several."""
    for name, given in values.items():
        for value in given if isinstance(given, list | tuple | np.ndarray) else [given]:
            if not (isinstance(value, int | float | np.number) and np.isfinite(value)):
                raise InputError(f"the event at {name!r} is {value!r}: give a finite number.")
            yield kind, name, float(value)


class Watch:
    """Looks for values of coordinates or outputs in each step, and names singular configurations.

    At `stops` the motion ends; with `smooth` it goes on through singular configurations.
    """

    def __init__(
        self,
        equations: Equations,
        inputs: Inputs,
        events: Mapping[str, Any] | None,
        stops: Mapping[str, Any] | None,
        *,
        smooth: bool,
    ) -> None:
        self._equations, self._inputs, self._smooth = equations, inputs, smooth
        given = [*_asked(PASSAGE, mapping_of(events, "events")),
                 *_asked(STOP, mapping_of(stops, "stops"))]  # fmt: skip
        self._kinds = [kind for kind, _, _ in given]
        self._columns = inputs.code.columns((name for _, name, _ in given), asked="events: ")
        self._values = np.array([value for _, _, value in given])
        self._signs = np.zeros(len(given))

    def begin(self, t: float, y: Array) -> None:
        """Look at the first state."""
        if self._columns:
            self._signs = np.sign(self._away(t, y))

    def events(self, t0: float, t1: float, state: States, singular: Event | None) -> list[Event]:
        """Return what happens in a step, in order, and remember its end."""
        found: list[Event] = [] if singular is None else [singular]
        if self._columns:
            for part in range(1, PARTS + 1):
                first, last = (t0 + (t1 - t0) * x / PARTS for x in (part - 1, part))
                last = t1 if part == PARTS else last
                now = np.sign(self._away(last, state(last)))
                for k in np.flatnonzero((self._signs != 0) & (now != self._signs)).tolist():
                    found.append(self._located(k, first, last, state))
                self._signs = now
        return sorted(found, key=lambda event: event.t, reverse=t1 < t0)

    def ends(self, event: Event) -> bool:
        """Say whether an event ends the motion."""
        return event.kind == STOP or (event.kind == SINGULAR and not self._smooth)

    def singular_at(self, t: float, q: Array) -> Event | None:
        """Return the event of a position at which Phi_q is singular, None where it is not."""
        point = self._equations.point(q, t)
        if point is None or not self._equations.holds(point):
            return None
        movements, _ = self._lost(point, 1 / criteria.SINGULAR_SENSITIVITY)
        if not movements.size:
            return None
        return event_of(self._inputs.code, SINGULAR, SENTENCES, t, q.copy(), movements)

    def end_at(self, t: float, q: Array) -> Event | None:
        """Return the event of a position at which the motion ended near a singular configuration.

        A lock-up is one only where equations that are lost demand a velocity.
        """
        point = self._equations.point(q, t)
        if point is None:
            return None
        movements, demands = self._lost(point, criteria.LOST)
        if not movements.size:
            return None
        demanded = self._equations.demanded(q, t)
        size = float(np.linalg.norm(demands.T @ demanded))
        is_driven = size > criteria.IN_RANGE * float(np.linalg.norm(demanded))
        kind = LOCK_UP if is_driven else SINGULAR
        return event_of(self._inputs.code, kind, SENTENCES, t, q.copy(), movements)

    def _away(self, t: float, y: Array) -> Array:
        """Return how far the columns are above the values that are looked for."""
        n, code = self._equations.n, self._inputs.code
        q, q_dot = y[:n], y[n : 2 * n]
        values = code.observe(q, q_dot, np.zeros(n), t, self._inputs.p)[0] if code.outputs else ()
        return np.asarray(np.concatenate((q, values))[self._columns] - self._values)

    def _located(self, k: int, t0: float, t1: float, state: States) -> Event:
        width = criteria.ROOT_LENGTH * max(abs(t1 - t0), abs(t0), abs(t1))
        t = root(lambda time: float(self._away(time, state(time))[k]), t0, t1, width)
        q = state(t)[: self._equations.n]
        code = self._inputs.code
        name = (*code.coordinates, *code.outputs)[self._columns[k]]
        text = SENTENCES[self._kinds[k]].format(name=name, value=self._values[k], t=f"{t:.10g}")
        owner = code.owners().get(name)
        return Event(self._kinds[k], t, () if owner is None else (owner,), text, q, {})

    def _lost(self, point: Point, part: float) -> tuple[Array, Array]:
        """Return movements (k, n) that Phi_q hardly hinders, and demands (m, k) of how fast.

        They belong to its singular values of at most `part` of the largest.
        """
        matrix = self._equations.scaled(point)
        left, sizes, right = np.linalg.svd(matrix, full_matrices=False)
        lost = sizes <= part * sizes[:1]
        return right[lost], left[:, lost]


def times_to(equations: Equations, t: float, y: Array) -> Array:
    r"""Return the times, negative in the past, after which Phi_q loses rank, to first order.

    :math:`\Phi_q + \tau \dot\Phi_q` loses rank where :math:`-1/\tau` is an eigenvalue of
    :math:`\dot\Phi_q \Phi_q^+`, of whatever multiplicity.
    """
    n, none = equations.n, np.zeros(0)
    q, q_dot = y[:n], y[n : 2 * n]
    speed = float((np.abs(q_dot) / equations.scale).max(initial=0.0))
    step = criteria.SLIGHT / speed if speed > 0 else 0.0
    here, there = equations.point(q, t), equations.point(q + step * q_dot, t + step)
    if not step or here is None or there is None or not here.Phi.size:
        return none
    matrix = equations.scaled(here)
    change = (equations.scaled(there) - matrix) / step
    basis, triangle = np.linalg.qr(matrix.T)
    try:
        found = np.linalg.eigvals(np.linalg.solve(triangle, (change @ basis).T))
    except np.linalg.LinAlgError:  # it is singular here
        return np.zeros(1)
    times = -1 / found[found != 0]
    return np.asarray(times.real[np.abs(times.imag) <= criteria.IMAGINARY * np.abs(times.real)])


def ahead(times: Array, forward: float) -> float:
    """Return the least time to a singular configuration that is still to come, infinity if none."""
    coming = times * forward
    return float(coming.min(where=coming >= 0, initial=np.inf))


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """A motion across a singular configuration at a time t, between two states beside it."""

    t: float
    first: tuple[float, Motion]
    last: tuple[float, Motion]

    def covers(self, t: float) -> bool:
        """Say whether a time is so near that only the states beside it tell how things are."""
        return (t - self.first[0]) * (t - self.last[0]) < 0

    def at(self, t: float) -> Motion:
        """Return position, velocity and acceleration there."""
        return quintic(*self.first, *self.last, t)


def foreseen(equations: Equations, t: float, y: Array, span: float) -> float:
    """Return in what time a motion comes to a singular configuration, about `span`; else NaN.

    Times are signed, as the motion goes.
    """
    n, part = equations.n, criteria.FORESEEN * span
    rate = equations.rate(t, y)
    there = y + part * rate
    there[:n] += part**2 / 2 * rate[n : 2 * n]
    held, drift = equations.corrected(t + part, there)
    if not np.isfinite(drift):
        return np.nan
    left = ahead(times_to(equations, t + part, held), np.sign(span))
    return part + np.sign(span) * left if left < abs(span) else np.nan


def passage(equations: Equations, t0: float, t1: float, state: States) -> Passage | None:
    """Return the singular configuration in the middle of a step, if there is one."""
    t = t0 + MIDDLE * (t1 - t0)
    for _ in range(LOOKS):
        times = times_to(equations, t, state(t))
        if not times.size:
            return None
        away = float(times[np.argmin(np.abs(times))])
        if not abs(t + away - (t0 + t1) / 2) < abs(t1 - t0) / 2:
            return None
        if abs(away) <= criteria.NEARLY * abs(t1 - t0):
            t += away
            break
        t += criteria.SHORT * away
    else:
        return None
    sides = []
    for time in (t - BESIDE * (t1 - t0), t + BESIDE * (t1 - t0)):
        y, n = state(time), equations.n
        rate = equations.rate(time, y)
        sides.append((time, (y[:n], y[n : 2 * n], rate[n : 2 * n])))
    return Passage(t, *sides)
