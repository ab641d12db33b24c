r"""Equilibria over time: followed as positions are in kinematics, and where they end.

Position and multipliers together are solved for, :math:`\Phi_q^T \lambda = Q`, :math:`\Phi = 0`:
as many equations as unknowns, whose curve over time the runtime follows as that of any mechanism.
Where the stiffness of a movement vanishes the curve turns back in time, a limit point, or another
one crosses it, a bifurcation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import ZERO
from kincompile.runtime.march import State
from kincompile.runtime.singular.curve import Curve
from kincompile.runtime.singular.events import event_of
from kincompile.runtime.statics.balance import settle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.problem import Problem
    from kincompile.runtime.singular.events import Event
    from kincompile.runtime.statics.balance import Balance, Place, Rest

LIMIT_POINT, BIFURCATION = "limit point", "bifurcation"
"""Kinds of critical points."""

SENTENCES = {
    LIMIT_POINT: (
        "Limit point at t = {t}: the stiffness of {bodies} vanishes, and there is no equilibrium "
        "near it beyond that: the mechanism snaps through. kc.equilibrium(..., through='snap') "
        "goes on from where it comes to rest."
    ),
    BIFURCATION: (
        "Bifurcation at t = {t}: the stiffness of {bodies} vanishes, and other equilibria branch "
        "off. Those that are followed on may be unstable; kc.equilibrium(..., through='snap') goes "
        "on from where the mechanism comes to rest."
    ),
}
"""What is said of a critical point."""

NEAR = 0.2
"""How far the next equilibrium may be, in scales, to continue the last."""

SHORTEST = 1e-4
"""Part of the whole time below which no step is tried."""


def follow(
    balance: Balance, rest: Rest, times: Sequence[float], through: str | None
) -> tuple[list[Rest], list[Event]]:
    """Return the equilibria at times, the first of them given, as far as they go, and what happens.

    With `through="snap"` they go on from where the mechanism comes to rest.
    """
    continuation = _Continuation(balance, abs(times[-1] - times[0]) or 1.0, through is not None, [])
    found: list[Rest] = [rest]
    for t in times[1:]:
        following = continuation.continued(found[-1], t)
        if following is None or not following.is_balanced:
            break
        found.append(following)
    return found, continuation.events


@dataclass(frozen=True, slots=True, eq=False)
class _Continuation:
    """Going from one equilibrium to the next."""

    balance: Balance
    span: float
    snaps: bool  # whether it goes on past critical points, to where the mechanism comes to rest
    events: list[Event]  # critical points that were met

    def continued(self, rest: Rest, latest: float) -> Rest | None:
        """Return the equilibrium that continues one at a later time; None where there is none."""
        t = rest.place.point.t
        step = latest - t
        while t != latest:
            ahead = latest if abs(latest - t) <= abs(step) else t + step
            following = settle(self.balance, rest.place.q, ahead, climbing=None)
            if following is not None and self._continues(rest, following):
                rest, t, step = following, ahead, 2 * step
                continue
            step /= 2
            if abs(step) >= SHORTEST * self.span:
                continue
            passed = self._passed(rest, latest)
            if passed is None or not passed.is_balanced:
                return passed
            rest, t, step = passed, passed.place.point.t, latest - passed.place.point.t
        return rest

    def _continues(self, rest: Rest, following: Rest) -> bool:
        """Say whether an equilibrium is near the last and held like it."""
        if not following.is_balanced or following.signs != rest.signs:
            return False
        away = np.abs((following.place.q - rest.place.q) / self.balance.scale)
        return float(away.max(initial=0.0)) <= NEAR

    def _passed(self, rest: Rest, latest: float) -> Rest | None:
        """Return an equilibrium beyond the next critical point; None where none is to be found."""
        located = Path(self.balance, rest.place, self.span).event(rest, latest)
        ahead = math.copysign(1.0, latest - rest.place.point.t)
        if located is None or (located[0].t - latest) * ahead > 0:
            return None
        event, q, t = located
        self.events.append(event)
        if event.kind == LIMIT_POINT:
            if not self.snaps:
                return None
            t = event.t + ahead * SHORTEST * self.span
        t = min(t, latest, key=lambda time: time * ahead)
        return settle(self.balance, q, t, climbing=0 if self.snaps else None)


class Path:
    """The equilibria near one, over time, as the curve of a mechanism."""

    def __init__(self, balance: Balance, place: Place, duration: float) -> None:
        self.balance, self._duration = balance, duration
        left = np.linalg.svd(balance.equations.scaled(place.point.Phi_q))[0]
        rank = place.q.size - place.free.shape[1]
        # Redundant joints share their load in any way: one way of it is followed.
        self._rows = left[:, :rank].T * balance.equations.weights()
        self._size = place.nothing / ZERO or 1.0
        self.system = self._system()

    def unknowns(self, place: Place) -> Array:
        """Return position and multipliers of an equilibrium, the latter without unit."""
        factors = np.linalg.lstsq(self._rows.T, place.multipliers, rcond=None)[0]
        return np.concatenate((place.q, factors / self._size))

    def _factors(self, y: Array) -> Array:
        return self._rows.T @ (self._size * y[self.balance.scale.size :])

    def _position(self, y: Array, t: float, p: Array) -> tuple[Array, Array]:
        """Return the equations of equilibrium, without units, and their derivatives."""
        balance, n = self.balance, self.balance.scale.size
        q, factors = y[:n], self._factors(y)
        Phi, Phi_q = balance.code.position(q, t, p)
        rows = self._rows @ Phi_q
        side = (balance.scale / self._size)[:, np.newaxis]
        turning = side * balance.turning(q, factors, t, np.eye(n))
        forces = side[:, 0] * (Phi_q.T @ factors - balance.loads(q, t))
        upper = np.hstack((turning, side * rows.T * self._size))
        lower = np.hstack((rows, np.zeros((len(rows), len(rows)))))
        return np.concatenate((forces, self._rows @ Phi)), np.vstack((upper, lower))

    def _in_time(self, y: Array, t: float, p: Array) -> Array:
        """Return the right side of the rates."""
        del p
        n = self.balance.scale.size
        forces, Phi_t = self.balance.in_time(y[:n], self._factors(y), t)
        return -np.concatenate((self.balance.scale / self._size * forces, self._rows @ Phi_t))

    def _system(self) -> Problem:
        """Return the equations of equilibrium as those of a mechanism."""
        equations, added = self.balance.equations, np.ones(len(self._rows))
        ones = np.ones(equations.place.size + added.size)
        names = (f"lambda_{k}" for k, _ in enumerate(added))
        system = equations.with_functions(
            position=self._position,
            nu=self._in_time,
            coordinates=(*equations.code.coordinates, *names),
            redundant=(),
            pattern=np.argwhere(np.outer(ones, ones)),
        )
        return replace(
            system,
            reference=np.concatenate((equations.reference, added)),
            place=np.concatenate((equations.place, 0 * added)),
            magnitude=ones,
            noise=0 * ones,
            limit=np.inf,
        )

    def event(self, rest: Rest, latest: float) -> tuple[Event, Array, float] | None:
        """Return the next critical point, and a place of the curve behind it with its time."""
        y, t = self.unknowns(rest.place), float(rest.place.point.t)
        point = self.system.at(y, t)
        if point is None:
            return None
        rates = self.system.engine.solve(point, self._in_time(y, t, self.system.p))
        state = State(t, point, rates, 0 * rates, np.ones(1))
        curve = Curve(self.system, state, self._duration)
        start = curve.start(state, math.copysign(1.0, latest - t))
        bracket = None if start is None else curve.next_singular(start, latest)
        located = None if bracket is None else curve.singular_point(bracket)
        if bracket is None or located is None:
            return None
        n, code = self.balance.scale.size, self.balance.code
        place, _ = located
        movement = np.linalg.svd(place.matrix[:, :-1])[2][-1][:n]
        kind = LIMIT_POINT if bracket.turns else BIFURCATION
        free = movement[np.newaxis]
        found = event_of(code, kind, SENTENCES, place.t, place.q[:n], free)
        return found, bracket.second.q[:n], bracket.second.t
