"""The equations of motion of a mechanism with its parameters set, as compiled code gives them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import (
    COMPLEX_STEP,
    RANK,
    RESIDUAL_FACTOR,
    SMALL_CORRECTION,
    SOLVED,
    TOLERANCE,
)
from kincompile.errors import InputError
from kincompile.names import without_loads
from kincompile.runtime.engine.code import DYNAMICS, SLOPES
from kincompile.runtime.engine.linear import powers_of_rows
from kincompile.runtime.problem import problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.runtime.engine.code import Array, Compiled, Dynamics
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.inputs import Inputs

    Evaluate = Callable[[Array, float], Array]

CORRECTIONS = 8
"""Corrections of a state that drifted, until its constraints hold: each squares what is missing."""


def dynamics_of(code: Compiled) -> Dynamics:
    """Return the compiled equations of motion of a mechanism; say so where there can be none."""
    if not code.has_loads:
        raise InputError(without_loads(code.name))
    return code.request(DYNAMICS)


class Equations:
    """The equations of motion at the parameters of a simulation.

    A state is y = (q, q_dot, work), with the work of loads and drivers since the start.
    `independent` are the rows of equations that repeat no other.
    """

    def __init__(self, inputs: Inputs, dynamics: Dynamics) -> None:
        self.code, self.parameters = inputs.code, inputs.p
        self.n = inputs.guess.size
        self.names_free = dynamics.free
        self._accelerate = _evaluator(dynamics.accelerations, self.n, inputs.p)
        self._correct = _evaluator(dynamics.corrections, self.n, inputs.p)
        left_out = set(dynamics.redundant)
        rows = [k for k, name in enumerate(self.code.equations) if name not in left_out]
        self.independent = np.array(rows, dtype=int)
        self.evaluations = self.jacobians = 0
        # By what part of their terms planned accelerations missed their equations where a state was
        # led back last, and whether they are solved for with pivots.
        self.missed, self.is_pivoted = 0.0, False
        self._slopes: _Slopes | None = None
        self.measure_at(inputs.guess, float(inputs.t[0]))

    def measure_at(self, q: Array, t: float) -> None:
        """Take the scales of coordinates and equations from a position."""
        self.joints = problem(self.code, self.parameters, q, t)

    @property
    def scale(self) -> Array:
        """Scale of each coordinate."""
        return self.joints.reference

    def rate(self, t: float, y: Array) -> Array:
        """Return the rate of a state; NaN where there is none."""
        self.evaluations += 1
        n = self.n
        found = self._pivoted(y, t) if self.is_pivoted else self._accelerate(y, t)
        return np.concatenate((y[n : 2 * n], found))

    def turn_to_pivots(self) -> bool:
        """Choose how accelerations are solved for, at the state that was led back last.

        Return whether the planned solve served so far, and no longer does.
        """
        served = not self.is_pivoted
        self.is_pivoted = bool(self.missed > SOLVED)
        return served and self.is_pivoted

    def _pivoted(self, y: Array, t: float) -> Array:
        """Return accelerations and power by a solve with pivots; NaN where there is none.

        Elimination that was planned may miss its equations where masses are of very different size.
        """
        n, rows, own, p = self.n, self.independent, self.code, self.parameters
        q, q_dot = y[:n], y[n : 2 * n]
        point, nothing = self.point(q, t), np.full(n + 1, np.nan)
        Q = np.asarray(own.Q(q, q_dot, t, p))
        if point is None or not np.isfinite(Q).all():
            return nothing
        values = np.linalg.svd(self.scaled(point), compute_uv=False)
        if (values <= RANK * values[:1]).any():  # independent equations depend on each other there
            return nothing
        Phi_q, size = point.Phi_q[rows], n + rows.size
        matrix = np.zeros((size, size))
        matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = self.inertia(q, t), Phi_q.T, Phi_q
        sides = np.concatenate((Q, own.gamma(q, q_dot, t, p)[rows]))
        powers = powers_of_rows(matrix)
        try:
            found = np.linalg.solve(powers[:, np.newaxis] * matrix, powers * sides)
            rest = sides - matrix @ found
            found += np.linalg.solve(powers[:, np.newaxis] * matrix, powers * rest)
        except np.linalg.LinAlgError:
            return nothing
        weights = np.concatenate((self.scale, self.joints.weights()[rows]))
        terms = weights * (np.abs(matrix) @ np.abs(found) + np.abs(sides))
        missing = weights * np.abs(matrix @ found - sides)
        for own_rows in (slice(n), slice(n, None)):  # forces, and equations
            if not missing[own_rows].max(initial=0.0) <= SOLVED * terms[own_rows].max(initial=0.0):
                return nothing
        change = np.imag(own.M(q + 1j * COMPLEX_STEP * q_dot, t, p)) / COMPLEX_STEP
        demanded = found[n:] @ self.joints.nu(q, t)[rows]
        power = Q @ q_dot + q_dot @ change @ q_dot / 2 - demanded
        return np.append(found[:n], power)

    def held_rate(self, t: float, y: Array) -> Array:
        """Return the rate of a state that is first led back to its constraints; NaN where not.

        Beside a singular configuration the rate of a state that missed them ever so little would be
        anything.
        """
        held, drift = self.corrected(t, y)
        return self.rate(t, held) if np.isfinite(drift) else np.full_like(y, np.nan)

    def jacobian(self, t: float, y: Array) -> Array:
        """Return the derivatives of the rate of a state by the state, shape (2 n + 1, 2 n + 1)."""
        self.jacobians += 1
        if self._slopes is None:
            self._slopes = _Slopes(self.code, self.parameters, self.n)
        return self._slopes.jacobian(t, y)

    def corrected(self, t: float, y: Array) -> tuple[Array, float]:
        """Return a state led back to its constraints, and by how much at most, in scales.

        It is moved as little as possible, as the masses measure it; the work stays.
        """
        n, drift = self.n, 0.0
        for _ in range(CORRECTIONS):
            found = self._correct(y, t)
            change, self.missed = found[: 2 * n], found[-1]
            y = y.copy()
            y[: 2 * n] += change
            sizes = np.abs(change.reshape(2, n)) / self.scale
            drift = max(drift, float(sizes.max(initial=0.0)))
            if self.joints.is_small(change[:n], y[:n], SMALL_CORRECTION):
                return y, drift
        # Beside a singular configuration rounding errors of Phi move more than that.
        point = self.joints.at(y[:n], t)
        holds = point is not None and self.joints.holds_to_rounding(point)
        return y, drift if holds else np.nan

    def point(self, q: Array, t: float) -> Point | None:
        """Return a position with its Phi_q; None where the equations have no finite value."""
        found = self.joints.at(q, t)
        return found if found is not None and np.isfinite(found.Phi_q).all() else None

    def holds(self, point: Point) -> bool:
        """Say whether all equations hold, those too that repeat others."""
        return bool(self.joints.holds(point, RESIDUAL_FACTOR * TOLERANCE))

    def scaled(self, point: Point) -> Array:
        """Return Phi_q of independent equations, all coordinates and equations to one scale."""
        return np.asarray(self.joints.scaled(point.Phi_q)[self.independent])

    def inertia(self, q: Array, t: float) -> Array:
        """Return M."""
        return np.asarray(self.code.M(q, t, self.parameters))

    def demanded(self, q: Array, t: float) -> Array:
        """Return how fast independent equations demand that movements be, all to one scale."""
        return np.asarray((self.joints.weights() * self.joints.nu(q, t))[self.independent])


class _Slopes:
    """The linear system that the derivatives of accelerations and power solve, evaluated."""

    def __init__(self, code: Compiled, p: Array, n: int) -> None:
        slopes, places, numbers = code.request(SLOPES)
        self._evaluate, m = _evaluator(slopes, n, p), len(code.equations)
        self._n, self._size, size = n, n + m + 1, n + m + 1 + 2 * n
        self._system = np.zeros((self._size, size))
        for (row, column), number in numbers.items():
            self._system[row, column] = number
        self._places = np.array([row * size + column for row, column in places], dtype=int)
        self._found = np.zeros((2 * n + 1, 2 * n + 1))
        self._found[:n, n : 2 * n] = np.eye(n)

    def jacobian(self, t: float, y: Array) -> Array:
        """Return the derivatives of the rate of a state; NaN where there are none."""
        n, system, found = self._n, self._system.copy(), self._found.copy()
        system.put(self._places, self._evaluate(y, t))
        try:
            solved = np.linalg.solve(system[:, : self._size], system[:, self._size :])
        except np.linalg.LinAlgError:  # singular: the step fails, and says why
            return np.full_like(found, np.nan)
        found[n:, : 2 * n] = solved[[*range(n), -1]]
        return found


def _evaluator(code: Compiled, n: int, p: Array) -> Evaluate:
    """Return what gives the outputs of some code at a state (2 n + 1,), NaN where it has none."""
    size, observe, numbers = len(code.outputs), code.observe_floats, p.tolist()
    if observe is None:
        assert code.observe_into is not None
        return _compiled(code.observe_into, n, size, p)

    def evaluate(y: Array, t: float) -> Array:
        values = y.tolist()
        q_dot = values[n : 2 * n]
        try:
            return np.array(observe(values[:n], q_dot, q_dot, t, numbers))
        except (ArithmeticError, ValueError):
            return np.full(size, np.nan)

    return evaluate


def _compiled(observe: Callable[..., None], n: int, size: int, p: Array) -> Evaluate:
    """Return the same of a module whose functions are compiled."""
    found, sets = np.empty((1, size, 1)), np.ascontiguousarray(p)

    def evaluate(y: Array, t: float) -> Array:
        q, q_dot = y[:n, np.newaxis], y[n : 2 * n, np.newaxis]
        observe((q, q_dot, q_dot), np.array([t]), sets, found)
        return found[0, :, 0].copy()

    return evaluate
