"""From a guess to an equilibrium: downhill to a stable one, or straight to the nearest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.statics.balance import Balance, Place

MOST_STEPS = 200
"""Steps after which a mechanism does not come to rest."""

REACH = 0.3
"""Longest step, in radians and sizes of the mechanism."""

SHORTEST = 1e-10
"""Part of a step that is tried last."""

AT_REST = 1e-9
"""Step, in scales, after which the next one is a rounding error."""

OVERSHOT = 0.5
"""Part of the force before a step that may push back after it."""


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """Where a mechanism came to rest, or did not."""

    place: Place  # the last position
    stiffness: Array  # (f, f): the reduced stiffness there
    is_balanced: bool  # whether it is an equilibrium
    steps: int  # how many it took

    @property
    def eigenvalues(self) -> Array:
        """The real parts of the eigenvalues of the stiffness, the least first."""
        return np.sort(np.linalg.eigvals(self.stiffness).real)

    @property
    def signs(self) -> tuple[int, ...]:
        """Their signs; 0 where a stiffness is nothing beside the forces."""
        least = self.place.nothing
        return tuple(int(x > least) - int(x < -least) for x in self.eigenvalues)


def settle(balance: Balance, guess: Array, t: float, *, downhill: bool = True) -> Rest | None:
    """Return where a mechanism goes from a guess; None where its joints cannot be assembled.

    Downhill it is moved along its forces, as it would go if it were damped heavily, so that what is
    found is not unstable. Else Newton's method goes to a near one of any kind.
    """
    place = balance.hold(guess, t)
    if place is None:
        return None
    for step in range(MOST_STEPS):
        stiffness = balance.stiffness(place)
        if not np.isfinite(stiffness).all():
            return Rest(place, stiffness, False, step)
        move = _move(place, stiffness) if downhill else _newton_move(place, stiffness)
        size = float(np.linalg.norm(move))
        following = _moved(balance, place, move * min(1.0, REACH / (size or 1.0)), downhill)
        if following is None:
            return Rest(place, stiffness, False, step)
        place = following
        if size <= AT_REST:
            return Rest(place, balance.stiffness(place), place.is_balanced, step)
    return Rest(place, stiffness, False, MOST_STEPS)


def _move(place: Place, stiffness: Array) -> Array:
    """Return the step downhill: Newton's, with the size of stiffnesses that are negative.

    At rest at the top of a hill it goes down on one side.
    """
    values, ways = np.linalg.eigh((stiffness + stiffness.T) / 2)
    if (values > place.nothing).all():
        return np.asarray(np.linalg.solve(stiffness, place.force))
    force = ways.T @ place.force
    force[np.abs(force) <= place.nothing] = 0.0
    falls = np.linalg.eigvals(stiffness).real < -place.nothing
    if not force.any() and falls.any():
        return np.asarray(REACH * ways[:, 0])
    sizes = np.maximum(np.abs(values), place.nothing or 1.0)
    # What nothing holds back goes on for ever, and keeps nothing else from coming to rest.
    return np.asarray(ways @ np.clip(force / sizes, -REACH, REACH))


def _newton_move(place: Place, stiffness: Array) -> Array:
    """Return Newton's step, the shortest one where some stiffness is nothing."""
    left, values, right = np.linalg.svd(stiffness)
    known = values > place.nothing
    return np.asarray(right[known].T @ ((left[:, known].T @ place.force) / values[known]))


def _moved(balance: Balance, place: Place, move: Array, downhill: bool) -> Place | None:
    """Return the position after as much of a step as does not overshoot; None where there is none.

    Beyond the bottom the forces push back.
    """
    part, push = 1.0, float(place.force @ move)
    while part >= SHORTEST:
        following = balance.hold(place.q + part * (place.free @ move), place.point.t)
        if following is not None:
            way = following.free.T @ ((following.q - place.q) / balance.scale**2) / part
            back = float(following.force @ way)
            if not downhill or back >= -OVERSHOT * push or abs(back) <= following.nothing:
                return following
        part /= 2
    return None
