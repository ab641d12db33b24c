r"""From one point of the motion to the next: of one motion, or of many parameter sets together.

The position at the next time is predicted from velocity and acceleration (Haug, section 3.6)

.. math:: q(t + h) \approx q + h\,\dot q + \tfrac12 h^2\,\ddot q

and corrected by Newton's method. A step counts only when it stays on its branch: Newton converges,
the prediction was good, Phi_q is not singular, and its determinants keep their signs. Otherwise the
step is halved, and doubled again once it succeeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    ALLOWED_PART,
    FOLDED,
    KINK,
    LARGE_ERROR,
    LAST_CORRECTION,
    MAX_SUBSTEPS,
    NEARLY_SINGULAR,
    RESIDUAL_FACTOR,
    ROUNDING,
    SINGULAR_SENSITIVITY,
    SMALL_ERROR,
    SMALLEST_PART,
    SMOOTH,
    TOO_NEAR,
)
from kincompile.runtime.engine.dense import Dense
from kincompile.runtime.newton import Attempt, assemble, iterate, safeguarded_step, unsolvable
from kincompile.runtime.problem import column, within
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.engine.engine import Engine, Point
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Problem

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A point of the motion, complete; or a batch of them, which is the last axis.

    Attributes
    ----------
    t : float
        Time.
    point : Point
        The position with Phi and Phi_q.
    q_dot, q_ddot : ndarray, shape (n,) or (n, N)
        Velocity and acceleration.
    determinants : ndarray, shape (blocks,) or (blocks, N)
        Those of the blocks of Phi_q.
    sensitivity : float or ndarray, shape (N,)
        Movement, in scales of the coordinates, for an error of one scale in the equations.
    """

    t: float
    point: Point
    q_dot: Array
    q_ddot: Array
    determinants: Array
    sensitivity: Any = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What became of the way to a point in time.

    Attributes
    ----------
    status : Status
        CONVERGED, or why the point failed.
    iterations : int
        Newton iterations spent.
    state : State or None
        The point when converged; on failure the last good one on the way, if there is one.
    position : Point or None
        Where the mechanism is at that time, also when only velocity or acceleration failed.
    attempt : Attempt or None
        When the motion does not lead to that time: the try to assemble the mechanism there
        nevertheless. If even that converges, the mechanism could only jump there.
    """

    status: Status
    iterations: int
    state: State | None
    position: Point | None = None
    attempt: Attempt | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Corrected:
    """What Newton's method made of a prediction.

    Attributes
    ----------
    point : Point
        The position. Phi and Phi_q may be those of a position a rounding error away.
    good : bool or ndarray of bool, shape (N,)
        Where it converged.
    iterations : int or ndarray of int, shape (N,)
        How many corrections were applied.
    """

    point: Point
    good: Any
    iterations: Any


class March:
    """Takes a motion, or a batch of motions with parameter sets of their own, from time to time.

    Parameters
    ----------
    equations
        The scales by which all is judged.
    engine
        What solves: the equations' own, or one for a batch.
    tolerance
        Bound of the last correction, in scales of the coordinates.
    """

    def __init__(self, equations: Problem, engine: Engine, tolerance: float) -> None:
        self.equations, self.engine, self.tolerance = equations, engine, tolerance
        self._residual = max(RESIDUAL_FACTOR * tolerance, ROUNDING)
        # Factors of Phi_q a rounding error away serve the rates; a dense matrix has none to save.
        self._tight = 0.0 if isinstance(engine, Dense) else min(tolerance, LAST_CORRECTION)

    def correct(self, q: Array, t: Any, most: int) -> Corrected:
        """Run Newton's method from a prediction, on each of a batch until it has converged.

        The last correction may be so small that Phi_q before it serves what comes after it.
        """
        equations, engine, single = self.equations, self.engine, q.ndim == 1
        far = np.abs(q) if single else np.abs(q[:, [0, -1]]).max(axis=1)
        rounding = ROUNDING * far
        tight = self._tight * equations.reference + rounding
        q = q.copy()
        done, iterations = np.zeros(q.shape[1:], bool), np.zeros(q.shape[1:], int)
        size: Any = np.inf
        for _ in range(most):
            point = engine.evaluate(q, t)
            change = engine.solve(point, point.Phi)
            if done.any():
                change[:, done] = 0.0
            q -= change
            iterations = iterations + ~done
            if single:
                # Near a singular position rounding alone keeps the corrections above any bound.
                last, size = size, ((np.abs(change) - rounding) / equations.reference).max()
                if size <= self.tolerance or size > last / 4:
                    point = point if size <= self._tight else engine.evaluate(q, t)
                    done = (size <= self.tolerance) & equations.holds(point, self._residual)
                    if not done:
                        done = equations.holds_to_rounding(point)
                if done or not size < np.inf:
                    return Corrected(point, done, iterations)
            else:
                done = done | within(change, self.tolerance * equations.reference + rounding)
                if done.all() and within(change, tight).all():
                    return Corrected(point, equations.holds(point, self._residual), iterations)
                if done.all():
                    break
        point = engine.evaluate(q, t)
        return Corrected(point, done & equations.holds(point, self._residual), iterations)

    def complete(self, point: Point) -> tuple[State, Checks]:
        """Solve for velocity and acceleration; say where all is as it must be, and what it is else.

        A third right side, of the size of the equations' own terms, shows how near to singular
        Phi_q is.
        """
        equations = self.equations
        scale = equations.scale(point.q)
        besides = equations.terms(point, scale) * column(equations.probe, point.q)
        rates = self.engine.rates(point, besides)
        sensitivity = (np.abs(rates.movement) / scale).max(axis=0)
        finite = np.isfinite((rates.q_dot + rates.q_ddot).sum(axis=0))
        checks = (
            (sensitivity < SINGULAR_SENSITIVITY, Status.SINGULAR),
            (finite, Status.NOT_FINITE),
            (rates.agree, Status.SINGULAR),
        )
        determinants = self.engine.determinants(point, point)
        return State(point.t, point, rates.q_dot, rates.q_ddot, determinants, sensitivity), checks

    def state(self, point: Point) -> State | Status:
        """Return a position as a state of the motion, or say why it is none."""
        state, checks = self.complete(point)
        status = first_failed(checks)
        if status is Status.SINGULAR and unsolvable(point) is Status.NOT_FINITE:
            return Status.NOT_FINITE
        return state if status is Status.CONVERGED else status

    def predict(self, state: State, t: float) -> Array:
        """Return the position at a time that velocity and acceleration lead to."""
        h = t - state.t
        return state.point.q + h * (state.q_dot + (h / 2) * state.q_ddot)

    def error(self, state: State, q: Array, predicted: Array, spread: Array) -> tuple[Any, Any]:
        """Return how far Newton ended from the prediction, and where that is near enough.

        Near enough to have stayed on the branch.
        """
        error = distance(q, predicted, spread)
        movement = distance(predicted, state.point.q, spread)
        allowed = np.minimum(LARGE_ERROR, np.maximum(SMALL_ERROR, ALLOWED_PART * movement))
        return error, error <= allowed

    def follows(self, state: State, following: State, error: Any, spread: Array) -> Checks:
        """Say where a state continues the motion from the one before it.

        Where a determinant has changed its sign, a singular configuration lies between the two.
        Just past a bifurcation, which may be as near as the error of the prediction, the other
        branch shows in the velocity.
        """
        h = following.t - state.t
        expected = state.q_dot + h * state.q_ddot
        kink = abs(h) * distance(following.q_dot, expected, spread)
        signs = np.sign(self.engine.determinants(following.point, state.point))
        same = (signs == np.sign(state.determinants)).all(axis=0)
        smooth = (following.sensitivity <= NEARLY_SINGULAR) | (kink <= KINK * error + SMOOTH)
        return (same, Status.SINGULAR), (smooth, Status.SINGULAR)

    def step(self, state: State, t: float, most: int) -> Outcome:
        """Predict, correct, and accept the point at `t` only when it continues the motion."""
        predicted = self.predict(state, t)
        spread = self.equations.spread(predicted)
        found = self.correct(predicted, t, most)
        point, iterations = found.point, int(found.iterations)
        error, is_near = self.error(state, point.q, predicted, spread)
        if not (found.good and is_near):
            return Outcome(Status.NOT_CONVERGED, iterations, None)
        following = self.state(point)
        if isinstance(following, Status):
            return Outcome(following, iterations, None, point)
        status = first_failed(self.follows(state, following, error, spread))
        if status is not Status.CONVERGED:
            return Outcome(status, iterations, None)
        return Outcome(status, iterations, following, point)

    def step_together(self, state: State, t: float, most: int) -> tuple[State, Any, Any]:
        """Take a step with a batch; return the states, where they are good, and the iterations."""
        predicted = self.predict(state, t)
        spread = self.equations.spread(predicted)
        found = self.correct(predicted, t, most)
        following, checks = self.complete(found.point)
        error, near = self.error(state, found.point.q, predicted, spread)
        checks += self.follows(state, following, error, spread)
        is_far = following.sensitivity <= TOO_NEAR
        return following, all_hold(found.good & near & is_far, checks), found.iterations

    def advance(self, state: State, t: float, most: int) -> Outcome:
        """Follow the motion from a good state to time `t`, in sub-steps where need be.

        Where it does not get there, the last good state on the way is in the outcome.
        """
        step, iterations = t - state.t, 0
        smallest = abs(step) * SMALLEST_PART
        status = Status.NOT_CONVERGED
        for _ in range(MAX_SUBSTEPS):
            whole = abs(step) >= abs(t - state.t)
            outcome = self.step(state, t if whole else state.t + step, most)
            iterations += outcome.iterations
            # A state that is too near already may be gone away from, but not towards singularity.
            too_near = max(TOO_NEAR, state.sensitivity)
            near = outcome.state is not None and outcome.state.sensitivity > too_near
            status = Status.SINGULAR if near and not whole else outcome.status
            if whole and outcome.position:
                return Outcome(status, iterations, outcome.state or state, outcome.position)
            if outcome.state and not near:
                state, step = outcome.state, 2 * step
            elif abs(step) <= smallest:
                break
            else:
                step /= 2
        return Outcome(status, iterations, state)


def distance(q: Array, other: Array, spread: Array) -> Any:
    """Return how far positions are apart, in radians or sizes of the mechanism."""
    if q.ndim == 1:
        return (np.abs(q - other) / spread).max()
    result = np.zeros(q.shape[1:])
    for here, there, scale in zip(q, other, spread.ravel().tolist(), strict=True):
        np.maximum(result, np.abs(here - there) / scale, out=result)
    return result


Checks = tuple[tuple[Any, Status], ...]
"""What must be true, of one point or of each of a batch, and the status where it is not."""


def first_failed(checks: Checks) -> Status:
    """Return the status of the first check that fails."""
    return next((status for good, status in checks if not good), Status.CONVERGED)


def all_hold(good: Any, checks: Checks) -> Any:
    """Say which of a batch were good, and pass all checks."""
    for check, _ in checks:
        good = good & check
    return good


def start(march: March, t: float, inputs: Inputs) -> Outcome:
    """Assemble the mechanism at the first time, from the guess."""
    equations = march.equations
    attempt = assemble(equations, t, inputs.guess, inputs.tolerance, inputs.max_iterations)
    iterations = len(attempt.corrections)
    if attempt.status is not Status.CONVERGED:
        return Outcome(attempt.status, iterations, None, attempt=attempt)
    attempt = _on_branch_of_guess(equations, t, attempt, inputs)
    state = march.state(attempt.last)
    if isinstance(state, Status):
        return Outcome(state, iterations, None, attempt.last)
    return Outcome(Status.CONVERGED, iterations, state, attempt.last)


def _on_branch_of_guess(equations: Problem, t: float, attempt: Attempt, inputs: Inputs) -> Attempt:
    """Give what small steps from the guess lead to, where Newton's large ones left its branch."""
    guess, found = attempt.points[0], attempt.last
    if not leaves_branch(equations, guess, found):
        return attempt
    limits = inputs.tolerance, inputs.max_iterations
    careful = iterate(equations, t, guess.q, *limits, safeguarded_step)
    if careful.status is not Status.CONVERGED:
        return attempt
    spread = equations.spread(found.q)
    near, far = (np.max(np.abs(x.last.q - guess.q) / spread) for x in (careful, attempt))
    return attempt if near >= far or leaves_branch(equations, guess, careful.last) else careful


def leaves_branch(equations: Problem, guess: Point, found: Point) -> bool:
    """Say whether a guess shows a branch, and a position found from it lies on another."""
    wanted = equations.engine.signs(guess)
    return all(wanted) and equations.engine.signs(found) != wanted


def is_folded(equations: Problem, guess: Point, found: Point) -> bool:
    """Say whether a guess shows no branch: beside a position, a determinant is zero there."""
    here, there = (equations.engine.determinants(point, point) for point in (guess, found))
    return bool((np.abs(here) <= FOLDED * np.abs(there)).any())


def give_up(march: March, outcome: Outcome, t: float, inputs: Inputs) -> Outcome:
    """Find out what is there at a time that the motion does not reach."""
    state = outcome.state
    assert state is not None
    limits = inputs.tolerance, inputs.max_iterations
    attempt = assemble(march.equations, t, state.point.q, *limits)
    iterations = outcome.iterations + len(attempt.corrections)
    # What is wrong there, rather than on the way.
    found = attempt.status is Status.CONVERGED
    status = outcome.status if found else attempt.status
    return Outcome(status, iterations, state, attempt=attempt)
