r"""The equations of equilibrium at one position, and the way there from a guess.

A position is one of equilibrium where the loads do no work for any movement that the joints allow,
:math:`Z^T Q = 0` with :math:`\Phi_q Z = 0`. Its stiffness is how this force falls along these
movements, :math:`K = Z^T (\partial(\Phi_q^T \lambda)/\partial q - Q_q) Z`: loads turn, and so do
the forces of joints. Derivatives of the emitted functions are taken by complex steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import COMPLEX_STEP, RANK, SHORTEST_STEP, TINY, ZERO
from kincompile.runtime.problem import nearest, problem
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Problem

MOST_STEPS = 200
"""Steps after which a mechanism does not come to rest."""

REACH = 0.3
"""Longest step, in radians and sizes of the mechanism."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A position at which the joints hold, and what acts there."""

    point: Point  # position, time and equations
    free: Array  # (n, f): movements that the joints allow, orthonormal in scales of the coordinates
    multipliers: Array  # (m,): lambda; of redundant equations the shortest
    force: Array  # (f,): work of the loads for each of the movements
    nothing: float  # force, or stiffness, that is nothing beside what loads and joints do

    @property
    def q(self) -> Array:
        """The position."""
        return self.point.q

    @property
    def is_balanced(self) -> bool:
        """Whether nothing pushes the mechanism anywhere."""
        return bool((np.abs(self.force) <= self.nothing).all())


class Balance:
    """A mechanism with loads, its parameters set; `equations` are its joints, with their scales."""

    def __init__(self, inputs: Inputs) -> None:
        self.code, self._p = inputs.code, inputs.p
        self.equations: Problem = problem(self.code, inputs.p, inputs.guess, float(inputs.t[0]))

    @property
    def scale(self) -> Array:
        """Scale of each coordinate."""
        return self.equations.reference

    def hold(self, q: Array, t: float) -> Place | None:
        """Return the position near one at which the joints hold; None where none is found."""
        attempt = nearest(self.equations, t, q)
        if attempt.status is not Status.CONVERGED or not np.isfinite(attempt.last.Phi_q).all():
            return None
        point, scale, weights = attempt.last, self.scale, self.equations.weights()
        left, values, right = np.linalg.svd(self.equations.scaled(point.Phi_q))
        rank, q = int((values > RANK * values[:1]).sum()), point.q
        Q = self.loads(q, t)
        free = (right[rank:] * scale).T
        factors = weights * (left[:, :rank] @ ((right[:rank] @ (scale * Q)) / values[:rank]))
        acting = np.abs(Q) + np.abs(point.Phi_q.T) @ np.abs(factors)
        held = np.abs(self.slopes(q, t)) @ scale
        level = float((np.maximum(acting, held) * scale).max(initial=0.0))
        return Place(point, free, factors, free.T @ Q, ZERO * level)

    def loads(self, q: Array, t: complex) -> Array:
        """Return Q of the mechanism at rest."""
        return np.asarray(self.code.Q(q, np.zeros_like(q), t, self._p))

    def slopes(self, q: Array, t: float) -> Array:
        """Return Q_q of the mechanism at rest."""
        return np.asarray(self.code.Q_q(q, np.zeros_like(q), t, self._p))

    def acting(self, place: Place) -> Array:
        """Return the size of all that acts on each coordinate, shape (n,)."""
        q, t = place.q, place.point.t
        joints = np.abs(place.point.Phi_q.T) @ np.abs(place.multipliers)
        return np.asarray(np.abs(self.loads(q, t)) + np.abs(self.slopes(q, t)).sum(axis=1) + joints)

    def turning(self, q: Array, factors: Array, t: float, directions: Array) -> Array:
        r"""Return the changes of :math:`\Phi_q^T \lambda - Q` along directions (n, k)."""
        loads = self.slopes(q, t) @ directions
        moved = np.asarray(self.code.Phi_q(q + 1j * COMPLEX_STEP * directions.T, t, self._p))
        joints = np.einsum("kmn,m->nk", moved.imag, factors) / COMPLEX_STEP
        return np.asarray(joints - loads)

    def stiffness(self, place: Place) -> Array:
        """Return the reduced stiffness K, shape (f, f)."""
        turning = self.turning(place.q, place.multipliers, place.point.t, place.free)
        return np.asarray(place.free.T @ turning)

    def growth(self, place: Place, stiffness: Array) -> float | None:
        r"""Return how fast a small movement grows, as a part of the fastest rate of any.

        It is the largest real part of the s with
        :math:`\det(s^2 Z^T M Z - s Z^T Q_{\dot q} Z + K) = 0`; None where masses do not determine
        how the mechanism moves.
        """
        q, t, free = place.q, place.point.t, place.free
        inertia = free.T @ self.code.M(q, t, self._p) @ free
        values = np.linalg.eigvalsh(inertia)
        if not values.min(initial=np.inf) > RANK * values.max(initial=0.0):
            return None
        slopes = free.T @ self.code.Q_q_dot(q, np.zeros_like(q), t, self._p) @ free
        both = np.linalg.solve(inertia, np.hstack((-stiffness, slopes)))
        size = len(both)
        s = np.linalg.eigvals(np.vstack((np.eye(size, 2 * size, size), both)))
        # Growth along a direction without stiffness does not make an equilibrium unstable.
        is_drift = np.abs(s) ** 2 * values.min(initial=np.inf) <= place.nothing
        if np.abs(np.linalg.eigvals(stiffness)).min(initial=np.inf) > place.nothing:
            is_drift[:] = False
        return float(s.real[~is_drift].max(initial=0.0) / np.abs(s).max(initial=TINY))

    def in_time(self, q: Array, factors: Array, t: float) -> tuple[Array, Array]:
        r"""Return how :math:`\Phi_q^T \lambda - Q` and Phi change in time where nothing moves."""
        later = t + 1j * COMPLEX_STEP
        moved = np.asarray(self.code.Phi_q(q, later, self._p))
        load = np.asarray(self.loads(q, later))
        forces = (moved.imag.T @ factors - load.imag) / COMPLEX_STEP
        return forces, -np.asarray(self.code.nu(q, t, self._p))

    def gradients(self, names: Sequence[str], q: Array, t: float) -> Array:
        """Return the derivatives of coordinates or outputs of these names, shape (k, n)."""
        rows = np.eye(q.size)
        if self.code.outputs:
            still = np.zeros_like(q)
            rows = np.vstack((rows, self.code.outputs_q(q, still, still, t, self._p)))
        return np.asarray(rows[self.code.columns(names)])


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

    Beyond the bottom the forces push back along `down`, at most by half; that is zero where any
    step is good.
    """
    part, push = 1.0, float(place.force @ down)
    while part >= SHORTEST_STEP:
        following = balance.hold(place.q + part * (place.free @ move), place.point.t)
        if following is not None:
            way = following.free.T @ (place.free @ down / balance.scale**2)
            back = float(following.force @ way)
            if back >= -push / 2 or abs(back) <= following.nothing:
                return following
        part /= 2
    return None
