"""What happens in a simulation: a value that is passed, a singular configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import IN_RANGE, LOST, ROOT_LENGTH, SINGULAR_SENSITIVITY
from kincompile.errors import InputError
from kincompile.runtime.inputs import mapping_of
from kincompile.runtime.roots import root
from kincompile.runtime.singular import events as singular
from kincompile.runtime.singular.events import LOCK_UP, Event, event_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from kincompile.runtime.dynamics.equations import Equations
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.inputs import Inputs

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
        movements, _ = self._lost(point, 1 / SINGULAR_SENSITIVITY)
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
        movements, demands = self._lost(point, LOST)
        if not movements.size:
            return None
        demanded = self._equations.demanded(q, t)
        size = float(np.linalg.norm(demands.T @ demanded))
        is_driven = size > IN_RANGE * float(np.linalg.norm(demanded))
        kind = LOCK_UP if is_driven else SINGULAR
        return event_of(self._inputs.code, kind, SENTENCES, t, q.copy(), movements)

    def _away(self, t: float, y: Array) -> Array:
        """Return how far the columns are above the values that are looked for."""
        n, code = self._equations.n, self._inputs.code
        q, q_dot = y[:n], y[n : 2 * n]
        values = code.observe(q, q_dot, np.zeros(n), t, self._inputs.p)[0] if code.outputs else ()
        return np.asarray(np.concatenate((q, values))[self._columns] - self._values)

    def _located(self, k: int, t0: float, t1: float, state: States) -> Event:
        width = ROOT_LENGTH * max(abs(t1 - t0), abs(t0), abs(t1))
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
