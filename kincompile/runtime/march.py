r"""From one point of the motion to the next.

The position at the next time is predicted from velocity and acceleration (Haug, section 3.6)

.. math:: q(t + h) \approx q + h\,\dot q + \tfrac12 h^2\,\ddot q

and corrected by Newton's method. A step counts only when it stays on its branch: Newton converges,
the prediction was good, Phi_q is not singular, and its determinant keeps its sign. Otherwise the
step is halved, and doubled again once it succeeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import (
    AGREEMENT,
    ALLOWED_PART,
    KINK,
    LARGE_ERROR,
    MAX_SUBSTEPS,
    NEARLY_SINGULAR,
    SINGULAR_SENSITIVITY,
    SMALL_ERROR,
    SMALLEST_PART,
    SMOOTH,
    TOO_NEAR,
)
from kincompile.runtime.linear import solve_linear
from kincompile.runtime.newton import Attempt, assemble, iterate, safeguarded_step
from kincompile.runtime.problem import Point, Problem, norm
from kincompile.runtime.singular.branches import signs, turned
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Vector


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A point of the motion, complete.

    Attributes
    ----------
    t : float
        Time.
    point : Point
        The position with Phi and Phi_q.
    q_dot, q_ddot : ndarray, shape (n,)
        Velocity and acceleration.
    branch : tuple of float
        Signs of the determinants of the blocks of Phi_q; empty where equations are redundant.
    sensitivity : float
        Movement, in scales of the coordinates, for an error of one scale in the equations.
    """

    t: float
    point: Point
    q_dot: Vector
    q_ddot: Vector
    branch: tuple[float, ...]
    sensitivity: float = 0.0


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


def start(equations: Problem, t: float, inputs: Inputs) -> Outcome:
    """Assemble the mechanism at the first time, from the guess."""
    attempt = assemble(equations, t, inputs.guess, inputs.tolerance, inputs.max_iterations)
    iterations = len(attempt.corrections)
    if attempt.status is not Status.CONVERGED:
        return Outcome(attempt.status, iterations, None, attempt=attempt)
    attempt = _on_branch_of_guess(equations, t, attempt, inputs)
    state = complete(equations, t, attempt.last)
    if isinstance(state, Status):
        return Outcome(state, iterations, None, attempt.last)
    return Outcome(Status.CONVERGED, iterations, state, attempt.last)


def _on_branch_of_guess(equations: Problem, t: float, attempt: Attempt, inputs: Inputs) -> Attempt:
    """Give what small steps from the guess lead to, where Newton's large ones left its branch."""
    guess, found = attempt.points[0], attempt.last
    if not leaves_branch(equations, t, guess, found):
        return attempt
    limits = inputs.tolerance, inputs.max_iterations
    careful = iterate(equations, t, guess.q, *limits, safeguarded_step)
    if careful.status is not Status.CONVERGED:
        return attempt
    spread = equations.spread(found.q)
    near, far = (np.max(np.abs(x.last.q - guess.q) / spread) for x in (careful, attempt))
    return attempt if near >= far or leaves_branch(equations, t, guess, careful.last) else careful


def leaves_branch(equations: Problem, t: float, guess: Point, found: Point) -> bool:
    """Say whether a guess shows a branch, and a position found from it lies on another."""
    wanted = signs(equations, guess.q, t, guess.Phi_q)
    return all(wanted) and signs(equations, found.q, t, found.Phi_q) != wanted


def advance(equations: Problem, state: State, t: float, inputs: Inputs) -> Outcome:
    """Follow the motion from a good point to time `t`, in sub-steps where need be."""
    step, iterations = t - state.t, 0
    smallest = abs(step) * SMALLEST_PART
    status = Status.NOT_CONVERGED
    for _ in range(MAX_SUBSTEPS):
        whole = abs(step) >= abs(t - state.t)
        outcome = _step(equations, state, t if whole else state.t + step, inputs)
        iterations += outcome.iterations
        # A state that is too near already may be gone away from, but not towards the singularity.
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
    return _give_up(equations, state, t, inputs, status, iterations)


def complete(equations: Problem, t: float, point: Point) -> State | Status:
    """Solve for velocity and acceleration at a position, or say why they cannot be had."""
    module, p, q, Phi_q = equations.module, equations.p, point.q, point.Phi_q
    scale = equations.scale(q)
    # A third right-hand side, of the size of the equations' own terms, costs nothing and shows how
    # near to singular the matrix is.
    sides = np.empty((point.Phi.size, 2))
    sides[:, 1] = equations.terms(point, scale) * equations.probe
    try:
        sides[:, 0] = module.nu(q, t, p)
        q_dot, probe = solve_linear(Phi_q, sides).T
        sensitivity = float(np.max(np.abs(probe) / scale))
        if not sensitivity < SINGULAR_SENSITIVITY:
            return Status.SINGULAR if np.isfinite(Phi_q).all() else Status.NOT_FINITE
        gamma = module.gamma(q, q_dot, t, p)
        q_ddot = solve_linear(Phi_q, gamma)
    except np.linalg.LinAlgError:
        return Status.SINGULAR
    except (ArithmeticError, ValueError):
        return Status.NOT_FINITE
    if not math.isfinite(norm(q_dot) + norm(q_ddot)):
        return Status.NOT_FINITE
    if not (_agree(point, q_dot, sides[:, 0]) and _agree(point, q_ddot, gamma)):
        return Status.SINGULAR
    return State(t, point, q_dot, q_ddot, signs(equations, q, t, Phi_q), sensitivity)


def _agree(point: Point, rates: Vector, sides: Vector) -> bool:
    """Say whether redundant equations are all met by the rates that solve them best."""
    if point.Phi_q.shape[0] == point.Phi_q.shape[1]:
        return True
    terms = np.abs(point.Phi_q) @ np.abs(rates) + np.abs(sides)
    missing = np.abs(point.Phi_q @ rates - sides)
    return bool(np.max(missing) <= AGREEMENT * np.max(terms))


def _step(equations: Problem, state: State, t: float, inputs: Inputs) -> Outcome:
    """Predict, correct, and accept the point at `t` only when it continues the motion."""
    h = t - state.t
    move = h * state.q_dot + (h * h / 2) * state.q_ddot
    predicted = state.point.q + move
    attempt = iterate(equations, t, predicted, inputs.tolerance, inputs.max_iterations)
    iterations = len(attempt.corrections)
    if attempt.status is not Status.CONVERGED:
        return Outcome(Status.NOT_CONVERGED, iterations, None)
    point = attempt.last
    if not _predicted_well(equations, point.q - predicted, move, predicted):
        return Outcome(Status.NOT_CONVERGED, iterations, None)
    following = complete(equations, t, point)
    if isinstance(following, Status):
        return Outcome(following, iterations, None, point)
    # Where a determinant has changed its sign, a singular configuration lies between the two.
    if following.branch != state.branch or turned(equations, state.point.Phi_q, point.Phi_q):
        return Outcome(Status.SINGULAR, iterations, None)
    if following.sensitivity > NEARLY_SINGULAR:
        error, kink = np.abs(point.q - predicted), h * _change(state, following)
        spread = equations.spread(predicted)
        if np.max(np.abs(kink) / spread) > KINK * np.max(error / spread) + SMOOTH:
            return Outcome(Status.SINGULAR, iterations, None)
    return Outcome(Status.CONVERGED, iterations, following, point)


def _change(state: State, following: State) -> Vector:
    """Return how far the velocity is from its prediction."""
    h = following.t - state.t
    return following.q_dot - (state.q_dot + h * state.q_ddot)


def _predicted_well(equations: Problem, error: Vector, move: Vector, predicted: Vector) -> bool:
    """Say whether Newton ended near enough to the prediction to have stayed on the branch."""
    spread = equations.spread(predicted)
    movement = float(np.max(np.abs(move) / spread))
    allowed = min(LARGE_ERROR, max(SMALL_ERROR, ALLOWED_PART * movement))
    return bool(np.max(np.abs(error) / spread) <= allowed)


def _give_up(
    equations: Problem, state: State, t: float, inputs: Inputs, status: Status, iterations: int
) -> Outcome:
    """Find out what is there at the time that the motion does not reach."""
    attempt = assemble(equations, t, state.point.q, inputs.tolerance, inputs.max_iterations)
    iterations += len(attempt.corrections)
    if attempt.status is not Status.CONVERGED:
        status = attempt.status  # what is wrong there, rather than on the way
    return Outcome(status, iterations, state, attempt=attempt)
