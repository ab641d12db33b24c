r"""A module with its parameters set, and Newton's method for its equations.

It solves :math:`\Phi(q, t) = 0` at one time, as in the textbook.

.. math:: \Phi_q(q_k, t)\,\Delta q_k = -\Phi(q_k, t), \qquad q_{k+1} = q_k + \Delta q_k

It stops when the correction is small; that correction has been applied (Haug, Computer-Aided
Kinematics and Dynamics of Mechanical Systems, chapter 4). The equations must then hold too.

A plain step applies the correction. A shortest one does so where equations are dependent or too
few, or some coordinates are held. A safeguarded one bends it towards the gradient of the residual
(Levenberg, Marquardt), cuts it to half a radian and to the size of the mechanism, and then shortens
it until the residual falls (Armijo).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kincompile import criteria
from kincompile.runtime.engine.linear import Dense, unsolvable
from kincompile.runtime.engine.scales import Scales, converges_linearly, norm, weights_of
from kincompile.runtime.engine.sparse import Sparse
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.engine.linear import Linear
    from kincompile.runtime.engine.scales import Point


@dataclass(slots=True, eq=False, kw_only=True)
class Problem(Scales):
    """The equations of a module with its parameters set, and the scales they are judged by."""

    engine: Linear  # what solves them
    p: Array  # (k,): parameters

    def with_functions(self, **functions: Any) -> Problem:
        """Return equations with other functions than those of their module."""
        code = replace(self.code, lanes=None, blocks=(), **functions)
        return replace(self, code=code, engine=Dense(code, self.p))

    def nu(self, q: Array, t: float) -> Array:
        """Return the right side of the velocity equation, NaN where it has no value."""
        try:
            return np.asarray(self.code.nu(q, t, self.p))
        except (ArithmeticError, ValueError):
            return np.full(len(self.code.equations), np.nan)

    def at(self, q: Array, t: float) -> Point | None:
        """Evaluate the equations, or give None where they have no finite value."""
        if not math.isfinite(norm(q)):  # which functions of a module refuse
            return None
        point = self.engine.evaluate(q, t)
        return point if math.isfinite(norm(point.Phi)) else None


def problem(
    code: Compiled,
    p: Array,
    q: Array,
    t: float,
    *,
    sparse: bool = False,
    engine: Linear | None = None,
) -> Problem:
    """Set the parameters; the equations at a guess or a position give the scales.

    With `sparse`, code that has blocks is solved by them, without a dense matrix. An engine with
    these parameters may be given.
    """
    m, angular, pattern = len(code.equations), code.angular, code.pattern
    if engine is None:
        engine = Sparse(code, p) if sparse and code.blocks else Dense(code, p)

    def entries(q: Array) -> tuple[Array, Array]:
        point = engine.evaluate(q, t)
        values = point.Phi_q
        return point.Phi, values if values.ndim == 1 else values[pattern[:, 0], pattern[:, 1]]

    size = float(criteria.rounded(criteria.size_of(entries, pattern, angular, q))) or 1.0
    reference = np.where(angular, 1.0, size)
    if isinstance(engine, Sparse):
        engine.reference = reference
    place, probe = np.minimum(np.abs(q), criteria.FARTHEST * reference), criteria.probe_of(m)
    floor = float(criteria.ROUNDING * (place[~angular] / size).max(initial=0.0))
    none = np.zeros(m)
    equations = Problem(
        code=code, engine=engine, p=p, angular=angular, size=size, reference=reference,
        place=place, floor=floor, probe=probe, magnitude=none, noise=none,
    )  # fmt: skip
    generic = equations.at(q + reference * criteria.probe_of(q.size), t)
    if generic is not None and np.isfinite(generic.Phi_q).all():
        equations.magnitude = criteria.rounded(equations.terms(generic, reference))
        here = equations.terms(generic, reference + equations.place)
        equations.noise = criteria.ROUNDING * here
        equations.limit = np.where(here > 0, criteria.STEEP * here, np.inf)
    return equations


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
    def missed(self) -> float:
        """By how much the equations are missed at the end, relative to their terms."""
        return self.equations.missed(self.last.Phi) if self.points else math.inf

    @property
    def found(self) -> Point | None:
        """The last position; None where there is none."""
        return self.last if self.points else None

    @property
    def away(self) -> Array:
        """How far each position reached is from the guess (k, n), in parts of what is near."""
        q = np.array([point.q for point in self.points])
        return np.asarray(np.abs(q - q[0]) / self.equations.near)

    @property
    def is_linear(self) -> bool:
        """Whether it converges no faster than towards a double root."""
        return converges_linearly(self.corrections)


if TYPE_CHECKING:
    Step: TypeAlias = Callable[[Problem, float, Point], tuple[Point, float] | Status]


def iterate(
    equations: Problem,
    t: float,
    guess: Array,
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
        if attempt.is_linear and equations.holds(
            attempt.last, criteria.RESIDUAL_FACTOR * tolerance
        ):
            attempt.status = Status.SINGULAR
    return attempt


def plain_step(
    equations: Problem, t: float, point: Point, tight: float = 0.0
) -> tuple[Point, float] | Status:
    """Apply the whole correction; Phi and Phi_q before it serve one of up to `tight` scales."""
    correction = equations.engine.solve(point, -point.Phi)
    size = norm(correction)
    if not math.isfinite(size):
        return unsolvable(point)
    if tight and equations.extent(correction) <= tight:
        return replace(point, q=point.q + correction), size
    following = equations.at(point.q + correction, t)
    return Status.NOT_FINITE if following is None else (following, size)


def nearest(equations: Problem, t: float, guess: Array, held: Sequence[int] = ()) -> Attempt:
    """Run it by shortest steps; coordinates of the numbers `held` stay as they are in the guess."""
    step = partial(shortest_step, held=held)
    return iterate(equations, t, guess, criteria.TOLERANCE, criteria.MAX_SHORTEST, step)


def shortest_step(
    equations: Problem, t: float, point: Point, held: Sequence[int] = ()
) -> tuple[Point, float] | Status:
    """Apply the shortest correction, in scales, as far as it moves nothing by more than a scale."""
    matrix = equations.scaled(point.Phi_q)
    if held:
        matrix[:, held] = 0.0
    if not np.isfinite(matrix).all():  # LAPACK would say so on the terminal
        return Status.NOT_FINITE
    change = np.linalg.lstsq(matrix, equations.weights() * point.Phi, rcond=criteria.RANK)[0]
    change *= equations.reference / max(1.0, float(np.abs(change).max(initial=0.0)))
    following = equations.at(point.q - change, t)
    return Status.NOT_FINITE if following is None else (following, norm(change))


def near_step(equations: Problem, t: float, point: Point) -> tuple[Point, float] | Status:
    """Apply the whole correction, unless it leads too far to settle near a guess."""
    outcome = plain_step(equations, t, point)
    is_far = not isinstance(outcome, Status) and outcome[1] > norm(equations.near)
    return Status.NOT_CONVERGED if is_far else outcome


def safeguarded_step(equations: Problem, t: float, point: Point) -> tuple[Point, float] | Status:
    """Apply as much of the correction as keeps the angles near and lowers the residual."""
    weights = weights_of(equations.terms(point, equations.reference))
    correction = _direction(equations, point, weights)
    if correction is None:
        return Status.NOT_FINITE
    before = norm(weights * point.Phi)
    part = _clamp(equations, point, correction)
    while part >= criteria.SHORTEST_STEP:
        following = equations.at(point.q + part * correction, t)
        if following is not None:
            after = norm(weights * following.Phi)
            if after <= (1 - criteria.SUFFICIENT * part) * before or after <= criteria.ROUNDING:
                return following, part * norm(correction)
        part /= 2
    return Status.NOT_CONVERGED


def _direction(equations: Problem, point: Point, weights: Array) -> Array | None:
    """Give Newton's correction, bent towards the gradient while the residual is large.

    This is Levenberg's and Marquardt's direction: it exists where Phi_q is singular, always lowers
    the residual, and becomes Newton's as the residual vanishes.
    """
    if point.Phi_q.ndim == 1:  # large and sparse: a shortened step of Newton's has to do
        correction = equations.engine.solve(point, -point.Phi)
        return correction if np.isfinite(correction).all() else None
    scale = equations.reference
    residual = weights * point.Phi
    bend = math.sqrt(criteria.BEND * min(1.0, norm(residual)))
    matrix = np.vstack((weights[:, np.newaxis] * point.Phi_q * scale, bend * np.eye(scale.size)))
    sides = np.concatenate((-residual, np.zeros_like(scale)))
    if not np.isfinite(matrix).all():  # LAPACK would say so on the terminal
        return None
    try:
        correction = scale * np.linalg.lstsq(matrix, sides, rcond=None)[0]
    except np.linalg.LinAlgError:
        return None
    return np.asarray(correction, dtype=np.float64)


def _clamp(equations: Problem, point: Point, correction: Array) -> float:
    """Give the part of a correction that moves angles and lengths no further than is sensible."""
    limits = equations.reference * np.where(equations.angular, criteria.LARGEST_ANGLE, 1.0)
    return min(1.0, 1.0 / float(np.max(np.abs(correction) / limits, initial=0.0) or 1.0))
