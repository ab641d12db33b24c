r"""Newton's method for :math:`\Phi(q, t) = 0` at one time, as in the textbook.

.. math:: \Phi_q(q_k, t)\,\Delta q_k = -\Phi(q_k, t), \qquad q_{k+1} = q_k + \Delta q_k

It stops when the correction is small; that correction has been applied (Haug, Computer-Aided
Kinematics and Dynamics of Mechanical Systems, chapter 4). The equations must then hold too.

Iterates that converge by themselves, and near the guess, are never disturbed. When they do not, a
second attempt starts again from the same guess with safeguards: the correction is bent towards the
gradient of the residual (Levenberg, Marquardt), cut to half a radian and to the size of the
mechanism, and then shortened until the residual falls (Armijo). Where what was found is not near,
the assembly on the other side of the nearest singular position is looked at too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kincompile.criteria import (
    AS_NEAR,
    BEND,
    LARGEST_ANGLE,
    MAX_CORRECTIONS,
    MAX_ITERATIONS,
    MIRRORED,
    MOST_TURNED,
    NUDGE,
    RESIDUAL_FACTOR,
    RESTARTS,
    ROUNDING,
    SAME_POSITION,
    SHORTEST_STEP,
    SUFFICIENT,
    TOLERANCE,
    TOO_NEAR,
)
from kincompile.errors import InputError
from kincompile.html import Shown
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.march import March, Outcome, distance
from kincompile.runtime.problem import Problem, crawls, norm, problem, unsolvable, weights_of
from kincompile.runtime.status import Status
from kincompile.tables import counted, indented, table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.engine import Point
    from kincompile.runtime.inputs import Inputs, Values

    Vector: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class NewtonResult(Shown):
    """The way of Newton's method from a guess to a position.

    Attributes
    ----------
    q : ndarray, shape (n,)
        The last iterate, with angles that the equations leave free by whole turns nearest to the
        guess.
    status : Status
        CONVERGED, or why not.
    iterates : ndarray, shape (k + 1, n)
        The guess, or where another attempt began, and the positions after each correction.
    corrections : ndarray, shape (k,)
        Euclidean norm of each correction.
    residuals : ndarray, shape (k + 1,)
        Euclidean norm of Phi at each iterate.
    residual : float
        Largest absolute value of Phi there; NaN where it has none.
    iterations : int
        The number k of corrections.
    """

    q: NDArray[np.float64]
    status: Status
    iterates: NDArray[np.float64]
    corrections: NDArray[np.float64]
    residuals: NDArray[np.float64]
    residual: float
    iterations: int

    def to_text(self) -> str:
        """Return the outcome, and the norms of Phi and of the correction in each iteration."""
        rows = [
            [str(k), f"{residual:.3g}", f"{self.corrections[k]:.3g}" if k < self.iterations else ""]
            for k, residual in enumerate(self.residuals)
        ]
        outcome = f"{self.status.name} after {counted(self.iterations, 'iteration')}"
        lines = table(("k", "|Phi|", "|correction|"), rows, ("k", "|Phi|", "|correction|"))
        return "\n".join([f"{outcome}, residual {self.residual:.3g}", *indented(lines)])


@dataclass(slots=True, eq=False)
class Attempt:
    """The record of one run of Newton's method."""

    equations: Problem
    status: Status = Status.NOT_CONVERGED  # how it ended
    points: list[Point] = field(default_factory=list)  # the guess and every position reached
    corrections: list[float] = field(default_factory=list)  # Euclidean norm of each correction
    turned: Point | None = None  # the last position with angles turned back, where they were
    other: Point | None = None  # another assembly that is as near to the guess, where one was met

    @property
    def last(self) -> Point:
        """The last position, angles turned back; there is one unless the guess has no values."""
        return self.turned or self.points[-1]

    @property
    def found(self) -> Point | None:
        """The last position; None where there is none."""
        return self.last if self.points else None


if TYPE_CHECKING:
    Step: TypeAlias = Callable[[Problem, float, Point], tuple[Point, float] | Status]


def newton(
    module: ModuleType,
    t: float,
    q0: Values,
    p: Values = None,
    *,
    tolerance: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
) -> NewtonResult:
    """Solve Phi(q, t) = 0 for the position at one time.

    Parameters
    ----------
    module
        An emitted module with as many equations as coordinates.
    t : float
        Time.
    q0 : array_like, shape (n,), or mapping, or None
        Start; a mapping from coordinates to values overrides the module's GUESS, None is GUESS.
    p : array_like, shape (k,), or mapping, or None
        Parameters; a mapping overrides the module's DEFAULTS.
    tolerance : float
        The correction at which to stop, relative to the scales of the coordinates: one radian for
        an angle, for a length the size of the mechanism.
    max_iterations : int
        Cap on the iterations of each of the two attempts, plain and safeguarded.

    Returns
    -------
    NewtonResult
        The plain attempt where it converges, else the safeguarded one.

    Raises
    ------
    InputError
        When a value has the wrong name, shape, type or is not finite.
    StructuralError
        When the equations cannot determine the coordinates: what is wrong, and what to do.
    """
    inputs = read_inputs(module, t, p, q0, tolerance, max_iterations)
    if inputs.t.size > 1:
        raise InputError(f"newton works at one time, got {inputs.t.size}: use solve for a grid.")
    with np.errstate(all="ignore"):
        time = float(inputs.t[0])
        equations = problem(module, inputs.p, inputs.guess, time)
        attempt = assemble(equations, time, inputs.guess, inputs.tolerance, inputs.max_iterations)
    return _result(attempt, inputs.guess)


def start(march: March, t: float, inputs: Inputs, *, is_in_vain: bool = False) -> Outcome:
    """Assemble the mechanism at the first time, from the guess."""
    limits = inputs.tolerance, inputs.max_iterations
    attempt = assemble(march.equations, t, inputs.guess, *limits, is_in_vain=is_in_vain)
    iterations = len(attempt.corrections)
    if attempt.status is not Status.CONVERGED:
        return Outcome(attempt.status, iterations, None, nearest=attempt.found)
    guess, point = attempt.points[0], attempt.last
    if attempt.equations is not march.equations or guess.q is not inputs.guess:
        here = [march.equations.at(q, t) for q in (inputs.guess, point.q)]
        guess, point = (known for known in here if known is not None)
    left = march.equations.leaves_branch(guess, point)
    folded = march.equations.is_folded(guess, point)
    state = march.state(point)
    # Towards a singular position Newton's method creeps, and ends a rounding error before it.
    if not isinstance(state, Status) and crawls(attempt.corrections):
        state = Status.SINGULAR if state.sensitivity > TOO_NEAR else state
    found = Outcome(
        Status.CONVERGED, iterations, None, point,
        strays=left, is_folded=folded, other=attempt.other,
    )  # fmt: skip
    if isinstance(state, Status):
        return replace(found, status=state)
    return replace(found, state=state)


def give_up(
    march: March, outcome: Outcome, t: float, inputs: Inputs, *, is_in_vain: bool = False
) -> Outcome:
    """Find out what is there at a time that the motion does not reach."""
    assert outcome.state is not None
    if outcome.exhausted:
        return outcome
    limits = inputs.tolerance, inputs.max_iterations
    start, equations = outcome.state.point.q, march.equations
    attempt = assemble(equations, t, start, *limits, is_in_vain=is_in_vain)
    # What is wrong there, rather than on the way.
    jumps = attempt.status is Status.CONVERGED
    return replace(
        outcome,
        status=outcome.status if jumps else attempt.status,
        iterations=outcome.iterations + len(attempt.corrections),
        nearest=attempt.found,
        jumps=jumps,
    )


def assemble(
    equations: Problem,
    t: float,
    guess: Vector,
    tolerance: float,
    max_iterations: int,
    *,
    is_in_vain: bool = False,
) -> Attempt:
    """Find a position from a guess: plain Newton, and safeguarded where that fails or strays.

    What is near the guess comes first, the nearest of it; then what is not far, then what is on the
    branch that the guess shows, then the nearer. Angles that the equations leave free by whole
    turns are those nearest to the guess. Where safeguarded attempts are known to be in vain, none
    is made.
    """
    limits = tolerance, max_iterations
    plain = iterate(equations, t, guess, *limits)
    found = plain.status is Status.CONVERGED
    if not plain.points or (found and equations.is_settled(plain.points)):
        return plain
    if not equations.is_careful:
        return assemble(equations.careful(), t, guess, *limits, is_in_vain=is_in_vain)
    if is_in_vain and not found:
        plain.status = Status.NOT_CONVERGED
        return plain
    good = [plain]
    if not found or equations.strays(plain.points[0], plain.last):
        attempts = [plain]
        for begin in (guess,) if found else begins(equations, guess):
            attempts.append(iterate(equations, t, begin, *limits, safeguarded_step))
            if attempts[-1].status is Status.CONVERGED:
                break
        good = _ordered(equations, plain.points[0], attempts, tolerance)
        if not good:
            return min(attempts[1:], key=lambda attempt: _missed(equations, attempt))
    mirrored = equations.other_side(good[0].last)
    away = equations.away(good[0].last.q, guess)
    if equations.away(mirrored, guess) <= MIRRORED * max(1.0, away):
        beyond = iterate(equations, t, mirrored, *limits)
        most = min(AS_NEAR * max(1.0, away), MIRRORED)
        if beyond.points and equations.away(beyond.last.q, guess) <= most:
            good = _ordered(equations, plain.points[0], [*good, beyond], tolerance)
    if len(good) > 1:
        good[0].other = _as_near(equations, guess, good)
    return good[0]


def _ordered(
    equations: Problem, guess: Point, attempts: Sequence[Attempt], tolerance: float
) -> list[Attempt]:
    """Return the attempts that converged, angles turned back; first what a guess means."""

    def order(attempt: Attempt) -> tuple[float, bool, bool, float]:
        point = attempt.last
        away = round(float(equations.away(point.q, guess.q)), 6)
        is_far = bool(equations.is_far(point.q, guess.q))
        # From a guess so rough no sign is to be trusted.
        leaves = not is_far and equations.leaves_branch(guess, point)
        far = round(float(distance(point.q, guess.q, equations.reference)), 6)
        return min(away, 1.0), is_far, leaves, far

    good = [attempt for attempt in attempts if attempt.status is Status.CONVERGED]
    for attempt in good:
        attempt.turned = unwound(equations, guess.t, attempt.last, guess.q, tolerance)
    return sorted(good, key=order)


def _as_near(equations: Problem, guess: Vector, good: Sequence[Attempt]) -> Point | None:
    """Return another assembly than the first one that is as near to the guess, if one was met."""
    first, *rest = (attempt.last for attempt in good)
    reach = AS_NEAR * equations.away(first.q, guess)
    for other in rest:
        is_same = distance(other.q, first.q, equations.reference) <= SAME_POSITION
        if not is_same and equations.away(other.q, guess) <= reach:
            return other
    return None


def unwound(equations: Problem, t: float, point: Point, guess: Vector, tolerance: float) -> Point:
    """Turn angles by whole turns towards a guess, as far as the equations allow it."""
    far = np.abs(point.q - guess) > math.pi
    columns = np.flatnonzero((equations.angular | equations.code.may_turn) & far)
    # Together first: angles that a gear or a driver connects turn together.
    for some in (columns, *columns) if columns.size <= MOST_TURNED else (columns,):
        q = point.q.copy()
        q[some] -= math.tau * np.round((q - guess)[some] / math.tau)
        if not np.array_equal(q, point.q):
            turned = iterate(equations, t, q, tolerance, MAX_CORRECTIONS)
            is_same = turned.status is Status.CONVERGED
            if is_same and distance(turned.last.q, q, equations.reference) <= SAME_POSITION:
                point = turned.last
    return _covered(equations, t, point, guess, tolerance)


def _covered(equations: Problem, t: float, point: Point, guess: Vector, tolerance: float) -> Point:
    """Give Euler parameters the signs of a guess's, as far as the equations allow it.

    Where they are as far from it either way, the largest one becomes positive.
    """
    for cover in equations.code.covers():
        p = point.q[cover]
        along = p @ guess[cover]
        if (along if abs(along) > SAME_POSITION else p[np.argmax(np.abs(p))]) < 0:
            q = point.q.copy()
            q[cover] = -q[cover]
            other = equations.at(q, t)
            if other is not None and equations.holds(other, RESIDUAL_FACTOR * tolerance):
                point = other
    return point


def begins(equations: Problem, guess: Vector) -> list[Vector]:
    """Return where safeguarded attempts begin: a guess, and further and further away around it.

    With all bodies on a line no equation tells which way to bend: so it is for zeros.
    """
    bends = (np.roll(equations.probe, k)[: guess.size] for k in range(RESTARTS))
    nudges = (k * NUDGE * equations.reference * bend for k, bend in enumerate(bends, start=1))
    return [guess, *(guess + nudge for nudge in nudges)]


def _missed(equations: Problem, attempt: Attempt) -> float:
    """Return by how much the equations are missed at the end of an attempt, relative to terms."""
    if not attempt.points:
        return math.inf
    return norm(attempt.last.Phi * equations.weights())


def iterate(
    equations: Problem,
    t: float,
    guess: Vector,
    tolerance: float,
    max_iterations: int,
    step: Step | None = None,
) -> Attempt:
    """Run Newton's method from a guess, with `plain_step` or another kind of step."""
    step = step or plain_step
    attempt = Attempt(equations)
    point = equations.at(guess, t)
    if point is None:
        attempt.status = Status.NOT_FINITE
        return attempt
    attempt.points.append(point)
    for _ in range(max_iterations):
        outcome = step(equations, t, attempt.last)
        if isinstance(outcome, Status):
            attempt.status = outcome
            break
        point, correction = outcome
        attempt.points.append(point)
        attempt.corrections.append(correction)
        if equations.has_converged(attempt.points[-2], point, tolerance, attempt.corrections):
            attempt.status = Status.CONVERGED
            break
    else:
        if crawls(attempt.corrections) and equations.holds(
            attempt.last, RESIDUAL_FACTOR * tolerance
        ):
            attempt.status = Status.SINGULAR
    return attempt


def plain_step(equations: Problem, t: float, point: Point) -> tuple[Point, float] | Status:
    """Apply the whole correction."""
    correction = equations.engine.solve(point, -point.Phi)
    size = norm(correction)
    if not math.isfinite(size):
        return unsolvable(point)
    following = equations.at(point.q + correction, t)
    return Status.NOT_FINITE if following is None else (following, size)


def safeguarded_step(equations: Problem, t: float, point: Point) -> tuple[Point, float] | Status:
    """Apply as much of the correction as keeps the angles near and lowers the residual."""
    weights = weights_of(equations.terms(point, equations.reference))
    correction = _direction(equations, point, weights)
    if correction is None:
        return Status.NOT_FINITE
    before = norm(weights * point.Phi)
    part = _clamp(equations, point, correction)
    while part >= SHORTEST_STEP:
        following = equations.at(point.q + part * correction, t)
        if following is not None:
            after = norm(weights * following.Phi)
            if after <= (1 - SUFFICIENT * part) * before or after <= ROUNDING:
                return following, part * norm(correction)
        part /= 2
    return Status.NOT_CONVERGED


def _direction(equations: Problem, point: Point, weights: Vector) -> Vector | None:
    """Give Newton's correction, bent towards the gradient while the residual is large.

    This is Levenberg's and Marquardt's direction: it exists where Phi_q is singular, always lowers
    the residual, and becomes Newton's as the residual vanishes.
    """
    if point.Phi_q.ndim == 1:  # large and sparse: a shortened step of Newton's has to do
        correction = equations.engine.solve(point, -point.Phi)
        return correction if np.isfinite(correction).all() else None
    scale = equations.reference
    residual = weights * point.Phi
    bend = math.sqrt(BEND * min(1.0, norm(residual)))
    matrix = np.vstack((weights[:, np.newaxis] * point.Phi_q * scale, bend * np.eye(scale.size)))
    sides = np.concatenate((-residual, np.zeros_like(scale)))
    if not np.isfinite(matrix).all():  # LAPACK would say so on the terminal
        return None
    try:
        correction = scale * np.linalg.lstsq(matrix, sides, rcond=None)[0]
    except np.linalg.LinAlgError:
        return None
    return np.asarray(correction, dtype=np.float64)


def _clamp(equations: Problem, point: Point, correction: Vector) -> float:
    """Give the part of a correction that moves angles and lengths no further than is sensible."""
    limits = equations.reference * np.where(equations.angular, LARGEST_ANGLE, 1.0)
    return min(1.0, 1.0 / float(np.max(np.abs(correction) / limits, initial=0.0) or 1.0))


def _result(attempt: Attempt, guess: Vector) -> NewtonResult:
    """Turn the record into arrays."""
    points, found = attempt.points, attempt.found
    return NewtonResult(
        q=guess if found is None else found.q,
        status=attempt.status,
        iterates=np.array([point.q for point in points] or [guess]),
        corrections=np.array(attempt.corrections),
        residuals=np.array([norm(point.Phi) for point in points] or [np.nan]),
        residual=math.nan if found is None else float(np.max(np.abs(found.Phi))),
        iterations=len(attempt.corrections),
    )
