r"""The march of a large mechanism, whose module is in grouped form.

The steps are those of `march`: predict with :math:`q + h\,\dot q + \tfrac12 h^2\,\ddot q` (Haug,
section 3.6), correct by Newton, solve for velocity and acceleration, halve a step that fails. Phi_q
stays sparse, and is factored stage by stage. Where a step fails for good, a mechanism that is not
too large goes on by the careful march (`solve`), which has the last word.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import (
    ALLOWED_PART,
    KINK,
    LARGE_ERROR,
    LAST_CORRECTION,
    NEARLY_SINGULAR,
    RESIDUAL_FACTOR,
    ROUNDING,
    SMALL_ERROR,
    SMALLEST_DETERMINANT,
    SMALLEST_PART,
    SMOOTH,
    TOO_NEAR,
    probe_of,
    size_of,
)
from kincompile.runtime.staged import StagedFactors, StagedSolver
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from types import ModuleType

    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Vector


SHORTEST = 2.0**-10
"""Part of a Newton correction below which it is given up."""


USUAL = 4
"""Newton corrections of a good prediction; where it takes more, the solves of all are checked."""


@dataclass(frozen=True, slots=True, eq=False)
class LargeState:
    """A point of the motion, complete.

    Attributes
    ----------
    t : float
        Time.
    q, q_dot, q_ddot : ndarray, shape (n,)
        The motion.
    Phi : ndarray, shape (n,)
        What is left of the equations.
    determinants : ndarray
        Those of the blocks of Phi_q.
    iterations : int
        Newton iterations spent.
    """

    t: float
    q: Vector
    q_dot: Vector
    q_ddot: Vector
    Phi: Vector
    determinants: Vector
    iterations: int


class LargeMarch:
    """A grouped module with its parameters set, and its solver."""

    def __init__(self, inputs: Inputs) -> None:
        self._module: ModuleType = inputs.module
        self._p, self._inputs = inputs.p, inputs
        self._solver = StagedSolver(inputs.module)
        angular = np.array([unit == "rad" for unit in inputs.module.UNITS.values()])
        angular = angular[: inputs.guess.size]
        self._reach = size_of(angular, inputs.guess) or 1.0
        self._spread = np.where(angular, 1.0, self._reach)
        # At a dead point a whole row may vanish: what it contributes elsewhere measures it.
        generic = inputs.guess + self._spread * probe_of(inputs.guess.size)
        _, self._generic = self._module.evaluate(generic, float(inputs.t[0]), self._p)
        self._magnitude = self._terms(self._generic)
        self._smallest: Vector = np.zeros(0)

    @property
    def pivoted(self) -> int:
        """How often the planned solve was not good enough."""
        return self._solver.pivoted

    def start(self, t: float) -> LargeState | Status:
        """Assemble the mechanism at the first time, from the guess."""
        found = self._correct(self._inputs.guess, t, damped=True)
        if isinstance(found, LargeState):
            self._smallest = SMALLEST_DETERMINANT * np.abs(found.determinants)
        return found

    def leaves_branch(self, found: LargeState) -> bool:
        """Say whether the guess shows a branch, and a position found from it lies on another."""
        nonzeros = self._module.evaluate(self._inputs.guess, found.t, self._p)[1]
        try:
            shown = self._solver.determinants(self._solver.factor(nonzeros))
        except RuntimeError:
            return False
        return bool(np.all(shown != 0) and np.any((shown > 0) != (found.determinants > 0)))

    def advance(self, state: LargeState, t: float) -> LargeState | Status:
        """Follow the motion from a good point to time `t`, in sub-steps where need be."""
        step, iterations = t - state.t, 0
        smallest = abs(step) * SMALLEST_PART
        while True:
            whole = abs(step) >= abs(t - state.t)
            found = self._step(state, t if whole else state.t + step)
            if isinstance(found, LargeState) and not whole and self._is_too_near(found, state):
                found = Status.SINGULAR
            if isinstance(found, LargeState):
                iterations += found.iterations
                state, step = found, 2 * step
                if whole:
                    return found
            elif abs(step) <= smallest:
                return found
            else:
                step /= 2

    def _step(self, state: LargeState, t: float) -> LargeState | Status:
        """Predict, correct, and accept a point only when it continues the motion."""
        h = t - state.t
        move = h * state.q_dot + (h * h / 2) * state.q_ddot
        predicted = state.q + move
        found = self._correct(predicted, t)
        if isinstance(found, Status):
            return found
        spread = self._spread
        turn = h * (found.q_dot - state.q_dot - h * state.q_ddot)
        error, movement, kink = (
            np.max(np.abs(change) / spread) for change in (found.q - predicted, move, turn)
        )
        if error > min(LARGE_ERROR, max(SMALL_ERROR, ALLOWED_PART * float(movement))):
            return Status.NOT_CONVERGED
        if not np.array_equal(found.determinants > 0, state.determinants > 0):
            return Status.SINGULAR  # a singular configuration lies between the two
        is_small = np.any(np.abs(found.determinants) <= self._smallest)
        if is_small and self._sensitivity(found) > TOO_NEAR:
            return Status.SINGULAR  # its rates are too uncertain to go on from
        if kink > KINK * error + SMOOTH and self._sensitivity(found) > NEARLY_SINGULAR:
            return Status.SINGULAR
        return found

    def _is_too_near(self, found: LargeState, state: LargeState) -> bool:
        """Say whether a sub-step leads too near to a singularity to go on from there."""
        sensitivity = self._sensitivity(found)
        return sensitivity > TOO_NEAR and sensitivity > self._sensitivity(state)

    def _sensitivity(self, state: LargeState) -> float:
        """Return the movement, in scales, for an error of one scale in the equations."""
        probe = probe_of(state.q.size)
        _, nonzeros = self._module.evaluate(state.q, state.t, self._p)
        try:
            factors = self._solver.factor(nonzeros)
        except RuntimeError:
            return np.inf
        sizes = np.maximum(np.abs(nonzeros), np.abs(self._generic))
        movement = self._solver.solve(factors, self._terms(sizes) * probe)
        return float(np.max(np.abs(movement) / self._spread))

    def _terms(self, nonzeros: Vector) -> Vector:
        """Return what the terms of each equation contribute at the scales of the coordinates."""
        rows, columns = self._module.PATTERN.T
        sizes = np.abs(nonzeros) * self._spread[columns]
        terms = np.bincount(rows, sizes, self._module.N_EQUATIONS)
        return np.asarray(terms, dtype=np.float64)

    def _correct(self, q: Vector, t: float, *, damped: bool = False) -> LargeState | Status:
        """Run Newton's method, and solve for velocity and acceleration where it converges."""
        module, p, solver = self._module, self._p, self._solver
        Phi, nonzeros = module.evaluate(q, t, p)
        for iteration in range(1, self._inputs.max_iterations + 1):
            try:
                factors = solver.factor(nonzeros)
            except RuntimeError:
                return Status.SINGULAR
            correction = solver.solve(factors, Phi, checked=iteration > USUAL)
            if not np.isfinite(correction).all():
                return Status.SINGULAR if np.isfinite(Phi).all() else Status.NOT_FINITE
            q, Phi, nonzeros = self._apply(q, Phi, correction, t, damped=damped)
            largest = (np.abs(correction) - ROUNDING * np.abs(q)) / self._spread
            if np.max(largest) <= self._inputs.tolerance:
                if np.max(largest) > LAST_CORRECTION:
                    factors = solver.factor(nonzeros)
                return self._complete(q, t, Phi, factors, iteration)
        return Status.NOT_CONVERGED

    def _apply(
        self, q: Vector, Phi: Vector, correction: Vector, t: float, *, damped: bool
    ) -> tuple[Vector, Vector, Vector]:
        """Apply a correction; of a damped one as much as lowers the residual."""
        part = 1.0
        while True:
            moved = q - part * correction
            found, nonzeros = self._module.evaluate(moved, t, self._p)
            if not damped or part <= SHORTEST or np.sum(found**2) <= np.sum(Phi**2):
                return moved, found, nonzeros
            part /= 2

    def _complete(
        self, q: Vector, t: float, Phi: Vector, factors: StagedFactors, iterations: int
    ) -> LargeState | Status:
        """Solve for velocity and acceleration; check the equations and both solutions."""
        module, p, solver = self._module, self._p, self._solver
        allowed = RESIDUAL_FACTOR * self._inputs.tolerance * self._magnitude
        if not np.all(np.abs(Phi) <= allowed):
            return Status.NOT_CONVERGED
        q_dot = solver.solve(factors, module.nu(q, t, p))
        if not np.isfinite(q_dot).all():
            return Status.SINGULAR
        q_ddot = solver.solve(factors, module.gamma(q, q_dot, t, p))
        if not np.isfinite(q_ddot).all():
            return Status.SINGULAR
        return LargeState(t, q, q_dot, q_ddot, Phi, solver.determinants(factors), iterations)
