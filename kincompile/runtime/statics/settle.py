"""From a guess to an equilibrium: downhill to a stable one, up to others, or to the nearest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import ZERO

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.statics.balance import Balance, Place

MOST_STEPS = 200
"""Steps after which a mechanism does not come to rest."""

REACH = 0.3
"""Longest step, in radians and sizes of the mechanism."""

SHORTEST = 1e-10
"""Part of a step that is tried last."""

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


def settle(
    balance: Balance, guess: Array, t: float, *, climbing: int | None = 0, steps: int = MOST_STEPS
) -> Rest | None:
    """Return where a mechanism goes from a guess; None where its joints cannot be assembled.

    It is moved along its forces, as it would go if it were damped heavily, so that what is found is
    not unstable. The `climbing` softest of its movements go against the forces instead, to an
    equilibrium with as many that are unstable. With None, Newton's method goes to a near one of any
    kind.
    """
    place = balance.hold(guess, t)
    if place is None:
        return None
    for step in range(steps):
        stiffness = balance.stiffness(place)
        if not np.isfinite(stiffness).all():
            return Rest(place, stiffness, False, step)
        move, down = _move(place, stiffness, climbing)
        size = float(np.linalg.norm(move))
        part = min(1.0, REACH / (size or 1.0))
        following = _moved(balance, place, part * move, part * down)
        if following is None:
            return Rest(place, stiffness, False, step)
        place = following
        if size <= ZERO:
            return Rest(place, balance.stiffness(place), place.is_balanced, step)
    return Rest(place, stiffness, False, steps)


def _move(place: Place, stiffness: Array, climbing: int | None) -> tuple[Array, Array]:
    """Return the step, and the same one with the movements that climb turned down.

    It is Newton's, with the stiffnesses of what climbs taken as negative, the others as positive.
    At rest at the top of a hill it goes down on one side.
    """
    if climbing is None:
        move = _newton_move(place, stiffness)
        return move, 0 * move
    values, ways = np.linalg.eigh((stiffness + stiffness.T) / 2)
    signs = np.where(np.arange(values.size) < climbing, -1.0, 1.0)
    force = ways.T @ place.force
    force[np.abs(force) <= place.nothing] = 0.0
    held = signs * np.sort(np.linalg.eigvals(stiffness).real)
    if (signs * values > place.nothing).all():
        steps = ways.T @ np.linalg.solve(stiffness, place.force)
    elif not force.any() and (held < -place.nothing).any():
        steps = REACH * np.eye(values.size)[np.argmin(held)]
    else:
        sizes = np.maximum(np.abs(values), place.nothing or 1.0)
        # Unrestrained coordinates drift forever; they must not delay the others.
        steps = signs * np.clip(force / sizes, -REACH, REACH)
    return ways @ steps, ways @ (signs * steps)


def _newton_move(place: Place, stiffness: Array) -> Array:
    """Return Newton's step, the shortest one where some stiffness is nothing."""
    left, values, right = np.linalg.svd(stiffness)
    known = values > place.nothing
    return np.asarray(right[known].T @ ((left[:, known].T @ place.force) / values[known]))


def _moved(balance: Balance, place: Place, move: Array, down: Array) -> Place | None:
    """Return the position after as much of a step as does not overshoot; None where there is none.

    Beyond the bottom the forces push back along `down`, which is zero where any step is good.
    """
    part, push = 1.0, float(place.force @ down)
    while part >= SHORTEST:
        following = balance.hold(place.q + part * (place.free @ move), place.point.t)
        if following is not None:
            way = following.free.T @ (place.free @ down / balance.scale**2)
            back = float(following.force @ way)
            if back >= -OVERSHOT * push or abs(back) <= following.nothing:
                return following
        part /= 2
    return None
