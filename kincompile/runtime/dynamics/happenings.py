"""What happens within a step of a simulation: a value that is passed, a singular configuration."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.names import column_name, listed, suggestion
from kincompile.runtime.inputs import mapping_of
from kincompile.runtime.singular import events as singular
from kincompile.runtime.singular.events import LOCK_UP, Event, involved

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from kincompile.runtime.dynamics.equations import Equations
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.inputs import Inputs

    States = Callable[[float], Array]

PASSAGE, STOP, SINGULAR = "passage", "stop", "singular configuration"
"""Kinds of events of a simulation."""

SENTENCES = {
    PASSAGE: "{name} is {value:.6g} at t = {t}.",
    STOP: "{name} comes to its stop, {value:.6g}, at t = {t}, and the motion ends there.",
    SINGULAR: (
        "Singular configuration at t = {t}: Phi_q loses rank there, so that no equation of "
        "motion tells how {bodies} go on. Change a length slightly, begin anew beyond it, or let "
        "through='smooth' step across it."
    ),
    LOCK_UP: singular.SENTENCES[LOCK_UP],
}
"""What is said of them."""

NEAR = 1e-3
"""Singular value of the scaled Phi_q, relative to its largest, that explains why a motion ended: it
falls as the square root of the time that is left."""

SMALL = 1e-7
"""Singular value of the scaled Phi_q, relative to its largest, that is zero at an event."""

CLOSE = 1e-10
"""The same of a state that was not looked for."""

PARTS = 8
"""Parts of a step at whose ends a value is looked at: what it passes twice within one is missed."""

LOCATED = 1e-12
"""How exactly an event is located, relative to the length of the step and to its time."""


LARGEST_POWER = 700.0
"""Power of e beyond which no determinant is given."""


class Rank:
    """Phi_q of a state, scaled, shape (m, n), with its singular values.

    `free`, shape (n - m, n), are the movements that it leaves free, `movement` is the one that it
    hinders least of all others.
    """

    def __init__(self, matrix: Array) -> None:
        self.matrix = matrix
        _, self._sizes, right = np.linalg.svd(matrix)
        self.free, self.movement = right[len(matrix) :], right[len(self._sizes) - 1]

    def is_lost(self, part: float) -> bool:
        """Say whether its smallest singular value is so small a part of the largest."""
        return bool(self._sizes[-1] <= part * self._sizes[0])


def signed(matrix: Array, rows: Array) -> float:
    """Return the determinant of a matrix with further rows, bounded."""
    sign, size = np.linalg.slogdet(np.concatenate((matrix, rows)))
    return float(sign * math.exp(min(size, LARGEST_POWER)))


def _asked(kind: str, values: Mapping[str, Any]) -> Iterator[tuple[str, str, float]]:
    """Yield kind, name and value of what is to be located; of a name there may be several."""
    for name, given in values.items():
        for value in given if isinstance(given, list | tuple | np.ndarray) else [given]:
            if not (isinstance(value, int | float | np.number) and np.isfinite(value)):
                raise InputError(f"the event at {name!r} is {value!r}: give a finite number.")
            yield kind, name, float(value)


class Watch:
    """Looks for events in each step: values of coordinates or outputs, and singular configurations.

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
        module = inputs.code.module
        self._outputs: tuple[str, ...] = getattr(module, "OUTPUTS", ())
        given = [*_asked(PASSAGE, mapping_of(events, "events")),
                 *_asked(STOP, mapping_of(stops, "stops"))]  # fmt: skip
        self._kinds = [kind for kind, _, _ in given]
        self._names = self._checked([name for _, name, _ in given])
        self._values = np.array([value for _, _, value in given])
        self._signs = np.zeros(len(given))
        self._rank: Rank | None = None

    def _checked(self, names: list[str]) -> list[str]:
        known = (*self._inputs.code.coordinates, *self._outputs)
        found = [column_name(name) for name in names]
        if missing := [name for name in found if name not in known]:
            near = suggestion(missing[0], known) or "."
            raise InputError(
                f"an event is asked for at a value of {missing[0]!r}{near} There are "
                f"{listed(known)}; m.output(...) makes any expression an output."
            )
        return found

    def begin(self, t: float, y: Array) -> None:
        """Look at the first state."""
        if self._names:
            self._signs = np.sign(self._away(t, y))
        self._rank = self._rank_at(t, y)

    def events(self, t0: float, t1: float, state: States) -> list[Event]:
        """Return what happens in a step, in order, and remember its end."""
        found: list[Event] = []
        if self._names:
            for part in range(1, PARTS + 1):
                first, last = (t0 + (t1 - t0) * x / PARTS for x in (part - 1, part))
                last = t1 if part == PARTS else last
                now = np.sign(self._away(last, state(last)))
                for k in np.flatnonzero((self._signs != 0) & (now != self._signs)).tolist():
                    found.append(self._located(k, first, last, state))
                self._signs = now
        singular = self._singular(t0, t1, state)
        if singular is not None:
            found.append(singular)
        return sorted(found, key=lambda event: event.t, reverse=t1 < t0)

    def ends(self, event: Event) -> bool:
        """Say whether an event ends the motion."""
        return event.kind == STOP or (event.kind == SINGULAR and not self._smooth)

    def singular_at(self, t: float, y: Array) -> Event | None:
        """Return the event of a state at which Phi_q is singular, None where it is not."""
        found = self._rank_at(t, y)
        if found is None or not found.is_lost(SMALL):
            return None
        return self._event_at(SINGULAR, t, y, found.movement)

    def lock_up_at(self, t: float, y: Array) -> Event | None:
        """Return the event of a state at which the motion ended near a singular configuration."""
        found = self._rank_at(t, y)
        if found is None or not found.is_lost(NEAR):
            return None
        return self._event_at(LOCK_UP, t, y, found.movement)

    def _away(self, t: float, y: Array) -> Array:
        """Return how far the columns are above the values that are looked for."""
        n, code = self._equations.n, self._inputs.code
        q, q_dot = y[:n], y[n : 2 * n]
        known = dict(zip(code.coordinates, q.tolist(), strict=True))
        if self._outputs:
            values = code.module.observe(q, q_dot, np.zeros(n), t, self._inputs.p)[0]
            known |= zip(self._outputs, np.asarray(values).tolist(), strict=True)
        return np.asarray([known[name] for name in self._names] - self._values)

    def _located(self, k: int, t0: float, t1: float, state: States) -> Event:
        t = root(lambda time: float(self._away(time, state(time))[k]), t0, t1)
        q = state(t)[: self._equations.n]
        name = self._names[k]
        text = SENTENCES[self._kinds[k]].format(name=name, value=self._values[k], t=f"{t:.10g}")
        owner = self._inputs.code.owners().get(name)
        return Event(self._kinds[k], t, () if owner is None else (owner,), text, q, {})

    def _singular(self, t0: float, t1: float, state: States) -> Event | None:
        """Return the singular configuration within a step, if there is one.

        With the free movements of its beginning as further rows, Phi_q is a square matrix, whose
        determinant changes its sign where Phi_q loses rank.
        """
        before, y = self._rank, state(t1)
        now = self._rank = self._rank_at(t1, y)
        if before is None or now is None:
            return None
        if now.is_lost(CLOSE):
            return self._event_at(SINGULAR, t1, y, now.movement)

        def determinant(t: float) -> float:
            found = self._matrix(t, state(t))
            return math.nan if found is None else signed(found, before.free)

        if not signed(before.matrix, before.free) * signed(now.matrix, before.free) < 0:
            return None
        return self.singular_at(t := root(determinant, t0, t1), state(t))

    def _matrix(self, t: float, y: Array) -> Array | None:
        """Return Phi_q, scaled; None where it has no finite value."""
        point = self._equations.point(y[: self._equations.n], t)
        return None if point is None else self._equations.scaled(point)

    def _rank_at(self, t: float, y: Array) -> Rank | None:
        matrix = self._matrix(t, y)
        return None if matrix is None or not len(matrix) else Rank(matrix)

    def _event_at(self, kind: str, t: float, y: Array, movement: Array) -> Event:
        code, n = self._inputs.code, self._equations.n
        share = movement / np.abs(movement).max()
        bodies = involved(code, share)
        text = SENTENCES[kind].format(t=f"{t:.10g}", bodies=listed(bodies))
        shares = dict(zip(code.coordinates, share.tolist(), strict=True))
        return Event(kind, t, bodies, text, y[:n].copy(), shares)


def root(function: Callable[[float], float], t0: float, t1: float) -> float:
    """Return where a function changes its sign within a step."""
    from scipy.optimize import brentq

    low, high = min(t0, t1), max(t0, t1)
    width = LOCATED * max(high - low, abs(low), abs(high))
    return float(brentq(function, low, high, xtol=max(width, 1e-300), rtol=4 * np.finfo(float).eps))
