r"""From one point of the motion to the next: of one motion, or of many parameter sets together.

The position at the next time is predicted from velocity and acceleration (Haug, section 3.6)

.. math:: q(t + h) \approx q + h\,\dot q + \tfrac12 h^2\,\ddot q

and corrected by Newton's method. A step counts only when it stays on its branch: Newton converges,
the prediction was good, Phi_q is not singular, and its determinants keep their signs. Otherwise the
step is halved, and doubled again once it succeeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from operator import mul, sub
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import criteria
from kincompile.runtime.engine.linear import Dense, Planned, unsolvable
from kincompile.runtime.engine.scales import Point, column, within
from kincompile.runtime.problem import iterate, plain_step, problem
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.engine.linear import Lanes, Linear
    from kincompile.runtime.problem import Attempt, Problem

CORRECTIONS_ON_GRID = 2
"""Newton corrections of every point of a grid."""

SIGN_OF_LIFE = 256
"""Sub-steps between two times after which progress is shown."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A point of the motion, complete; or a batch of them, which is the last axis."""

    t: Any  # float or (N,): the time
    point: Point  # the position with Phi and Phi_q
    # q_dot, q_ddot (n,) or (n, N): velocity and acceleration
    q_dot: Array
    q_ddot: Array
    determinants: Array  # (blocks,) or (blocks, N): those of the blocks of Phi_q
    # float or (N,): movement, in scales of the coordinates, for an error of one scale in the
    # equations
    sensitivity: Any = 0.0
    # Sizes of the determinants where that was found, in their shape.
    probed: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What became of the way to a point in time."""

    status: Status  # CONVERGED, or why the point failed
    iterations: int  # Newton iterations spent
    # The point when converged; on failure the last good one on the way, if there is one.
    state: State | None
    # Where the mechanism is at that time, also when only velocity or acceleration failed.
    position: Point | None = None
    # Where the motion does not lead to that time: where Newton's method ends there.
    nearest: Point | None = None
    jumps: bool = False  # whether the mechanism is assembled there: it could only jump to it
    exhausted: bool = False  # whether the sub-steps on the way were too many
    left_branch: bool = False  # whether it was assembled on another branch than its guess shows
    is_folded: bool = False  # whether the guess that it was assembled from shows no branch
    other: Point | None = None  # another assembly that is as near to that guess

    @property
    def is_plain(self) -> bool:
        """Whether it converged, and nothing more is to be said of it."""
        return self.status is Status.CONVERGED and not self.left_branch and self.other is None


@dataclass(frozen=True, slots=True, eq=False)
class Corrected:
    """What Newton's method made of a batch of predictions."""

    point: Point  # the positions. Phi and Phi_q may be those of positions a rounding error away.
    good: Any  # (N,), bool: where it converged
    iterations: Any  # (N,): how many corrections were applied


class March:
    """Takes a motion, or a batch of motions with parameter sets of their own, from time to time.

    The engine is that of the equations, or one for a batch; the tolerance bounds the last
    correction, in scales of the coordinates.
    """

    def __init__(self, equations: Problem, engine: Linear, tolerance: float) -> None:
        self.equations, self.engine = equations, engine
        self._asked, self.tolerance = tolerance, max(tolerance, equations.floor)
        self._residual = max(criteria.RESIDUAL_FACTOR * tolerance, criteria.ROUNDING)
        # Factors of Phi_q a rounding error away serve the rates; a dense matrix has none to save.
        self._tight = 0.0 if isinstance(engine, Dense) else min(tolerance, criteria.LAST_CORRECTION)
        self._step = partial(plain_step, tight=self._tight) if self._tight else plain_step

    @classmethod
    def at(
        cls, code: Compiled, p: Array, q: Array, t: float, tolerance: float,
        engine: Linear | None = None,
    ) -> March:  # fmt: skip
        """Return the march of a mechanism, whose scales are those at a position."""
        equations = problem(code, p, q, t, sparse=True, engine=engine)
        return cls(equations, equations.engine, tolerance)

    def with_engine(self, engine: Linear) -> March:
        """Return the march with another engine for the same equations."""
        return March(replace(self.equations, engine=engine), engine, self._asked)

    @property
    def scales(self) -> tuple[float, float]:
        """The size of the mechanism and the tolerance, for a compiled march."""
        return self.equations.size, self.tolerance

    def correct(self, q: Array, t: float, most: int) -> Attempt:
        """Run Newton's method from a prediction."""
        return iterate(self.equations, t, q, self._asked, most, self._step)

    def correct_together(self, q: Array, t: Any, most: int, reach: float = np.inf) -> Corrected:
        """Run Newton's method on a batch, in place; what has converged stays where it is.

        Good is what did so, and was moved by less than `reach`, in scales, in the first iteration.
        """
        equations, engine = self.equations, self.engine
        rounding = criteria.ROUNDING * np.abs(q[:, [0, -1]]).max(axis=1)
        loose, tight = (x * equations.reference + rounding for x in (self.tolerance, self._tight))
        done, iterations = np.zeros(q.shape[1], bool), np.zeros(q.shape[1], int)
        good: Any = True
        is_tight = False
        for iteration in range(most):
            point = engine.evaluate(q, t)
            change = engine.solve(point, point.Phi)
            if done.any():
                change = [np.where(done, 0.0, lane) for lane in change]
            for row, lane in zip(q, change, strict=True):
                row -= lane
            iterations += ~done
            if iteration == 0:  # what it leaves is seen by a second one only
                good = within(change, reach * equations.reference)
                continue
            if is_tight := all_within(change, tight):  # nearly always; what is tight is loose
                done[:] = True
            else:
                done = done | within(change, loose)
            if done.all():
                break
        if not is_tight:
            point = engine.evaluate(q, t)
        return Corrected(point, good & done & equations.holds(point, self._residual), iterations)

    def complete(self, point: Point, before: State | None = None) -> tuple[State, Checks]:
        """Solve for velocity and acceleration; return the checks of a point, with their statuses.

        A third right side, of the size of the equations' own terms, shows how near to singular
        Phi_q is. Where no determinant has halved since that was last looked at, it is no nearer.
        """
        equations, engine = self.equations, self.engine
        sensitivity, probed = np.inf, None
        determinants = engine.determinants(point, point)
        if before is not None and not isinstance(engine, Dense):
            sensitivity, probed = before.sensitivity, before.probed
        if probed is None or not (np.abs(determinants) >= criteria.SAME_DETERMINANT * probed).all():
            probed = np.abs(determinants)
            extra_rhs = column(equations.magnitude * equations.probe, point.q)
            rates = engine.solved(equations, point, extra_rhs)
            sensitivity = equations.extent(rates.movement)
        else:
            rates = engine.solved(equations, point)
        finite = np.isfinite((rates.q_dot + rates.q_ddot).sum(axis=0))
        checks = (
            (sensitivity < criteria.SINGULAR_SENSITIVITY, Status.SINGULAR),
            (finite, Status.NOT_FINITE),
            (rates.are_met, Status.SINGULAR),
        )
        numbers = rates.q_dot, rates.q_ddot, determinants, sensitivity, probed
        return State(point.t, point, *numbers), checks

    def state(self, point: Point, before: State | None = None) -> State | Status:
        """Return a position as a state of the motion, or the status of the first check it fails."""
        state, checks = self.complete(point, before)
        status = next((failed for good, failed in checks if not good), None)
        if status is Status.SINGULAR and unsolvable(point) is Status.NOT_FINITE:
            return Status.NOT_FINITE
        return status or state

    def predict(self, state: State, t: float) -> Array:
        """Return the position at a time that velocity and acceleration lead to."""
        h = t - state.t
        predicted: Array = state.point.q + h * (state.q_dot + (h / 2) * state.q_ddot)
        return predicted

    def error(self, state: State, q: Array, predicted: Array) -> tuple[Any, Any]:
        """Return how far Newton ended from the prediction, and where that is near enough.

        Near enough to have stayed on the branch.
        """
        error = self.equations.extent(q - predicted)
        movement = self.equations.extent(predicted - state.point.q)
        allowed = np.minimum(
            criteria.LARGE_ERROR, np.maximum(criteria.SMALL_ERROR, criteria.ALLOWED_PART * movement)
        )
        return error, error <= allowed

    def follows(self, state: State, following: State, error: Any) -> Checks:
        """Say where a state continues the motion from the one before it.

        Where a determinant has changed its sign, a singular configuration lies between the two.
        Just past a bifurcation, which may be as near as the error of the prediction, the other
        branch shows in the velocity.
        """
        h = following.t - state.t
        expected = state.q_dot + h * state.q_ddot
        kink = abs(h) * self.equations.extent(following.q_dot - expected)
        signs = np.sign(self.engine.determinants(following.point, state.point))
        same = (signs == np.sign(state.determinants)).all(axis=0)
        smooth = (following.sensitivity <= criteria.NEARLY_SINGULAR) | (
            kink <= criteria.KINK * error + criteria.SMOOTH
        )
        return (same, Status.SINGULAR), (smooth, Status.SINGULAR)

    def step(self, state: State, t: float, most: int) -> Outcome:
        """Predict, correct, and accept the point at `t` only when it continues the motion."""
        predicted = self.predict(state, t)
        attempt = self.correct(predicted, t, most)
        iterations = len(attempt.corrections)
        if attempt.status is not Status.CONVERGED:
            return Outcome(Status.NOT_CONVERGED, iterations, None)
        point = attempt.last
        error, is_near = self.error(state, point.q, predicted)
        if not is_near:
            return Outcome(Status.NOT_CONVERGED, iterations, None)
        following = self.state(point, state)
        if isinstance(following, Status):
            return Outcome(following, iterations, None, point)
        for good, status in self.follows(state, following, error):
            if not good:
                return Outcome(status, iterations, None)
        return Outcome(Status.CONVERGED, iterations, following, point)

    def step_together(self, state: State, t: Any, most: int) -> tuple[State, Any, Any]:
        """Take a step with a batch; return the states, where they are good, and the iterations."""
        predicted = self.predict(state, t)
        found = self.correct_together(predicted.copy(), t, most)
        following, checks = self.complete(found.point, state)
        error, near = self.error(state, found.point.q, predicted)
        checks += self.follows(state, following, error)
        is_far = following.sensitivity <= criteria.TOO_NEAR
        return following, all_hold(found.good & near & is_far, checks), found.iterations

    def solve_together(self, t: Array, states: Array, residual: Array, smallest: Array) -> Any:
        """Correct interpolated positions (n, N) twice, and solve for velocity and acceleration.

        All in place, `states` (3, n, N); returns which points can be trusted, whose determinants
        keep their signs and are larger than the `smallest`.
        """
        engine, (q, q_dot, q_ddot) = self.engine, states
        assert isinstance(engine, Planned)
        found = self.correct_together(q, t, CORRECTIONS_ON_GRID, criteria.LARGEST_DISPLACEMENT)
        point, good = found.point, found.good
        residual[:] = largest(point.Phi, t.size)
        rates = engine.rates(point, None, (q_dot, q_ddot))
        for values, least in zip(point.factors[1], smallest, strict=True):
            good = good & (values / least > 1)
        return good & engine.meet(self.equations, point, rates)

    def lock_up(self, begin: State, state: State, t: Any, smallest: Any) -> Any:
        """Say of a batch that cannot be taken on by its smallest step where it is at a lock-up.

        There velocities grow as one over the root of the time that is left: they have grown since
        the begin of the way to `t`, where the equations have values.
        """
        forward = t - state.t
        speed, left = self.until_lock_up(state, forward)
        grown = speed >= criteria.GROWN * self.equations.extent(begin.q_dot)
        before = np.abs(forward) - left > criteria.BEFORE_LOCK_UP * np.abs(t - begin.t)
        ends = (left <= criteria.LEFT * smallest) & grown & before
        if ends.any():
            there = self.engine.evaluate(state.point.q, t).Phi
            ends &= np.isfinite(sum(row for row in there) + np.zeros(speed.shape))
        return ends

    def bifurcation(self, state: State, t: Array, smallest: Array) -> Any:
        """Say of a batch that cannot be taken on by its smallest step where it is at a bifurcation.

        Phi_q is nearly singular there, and the motion goes on as it was predicted beyond where a
        lock-up might be. Nothing is said where the growth of velocities may end it further on,
        or where equations are left out, which may forbid one of the ways.
        """
        if self.equations.code.redundant:
            return np.zeros(smallest.shape, dtype=bool)
        pace = self.time_of(state)
        ahead = np.maximum(criteria.BEYOND * pace, criteria.LEFT * smallest)
        forward = np.copysign(ahead, t - state.t)
        _, left = self.until_lock_up(state, forward)
        predicted = self.predict(state, state.t + forward)
        found = self.correct_together(predicted.copy(), state.t + forward, criteria.MAX_CORRECTIONS)
        beyond, checks = self.complete(found.point)
        error, near = self.error(state, found.point.q, predicted)
        _, smooth = self.follows(state, beyond, error)
        good = found.good & near & (state.sensitivity > criteria.CLOSE * criteria.TOO_NEAR)
        good &= (2 * left < ahead) | (left > criteria.SOON * pace)
        return all_hold(good, (*checks, smooth))

    def until_lock_up(self, state: State, forward: Any) -> tuple[Array, Array]:
        """Return the largest velocities of a batch, in scales, and the time left at its growth.

        That time is infinite where it does not grow towards the sign of `forward`.
        """
        reference = column(self.equations.reference, state.q_dot)
        rates, growths = state.q_dot / reference, state.q_ddot / reference
        fastest = np.abs(rates).argmax(axis=0), np.arange(rates.shape[1])
        speed = np.abs(rates[fastest])
        growth = np.sign(forward) * np.sign(rates[fastest]) * growths[fastest]
        return speed, np.where(growth > 0, speed / (2 * growth), np.inf)

    def pace(self, state: State, forward: Any, step: Array, good: Any, smallest: Any) -> Array:
        """Return the sizes of a batch's next steps, after those to states that were good or not."""
        _, until = self.until_lock_up(state, forward)
        least = np.maximum(np.abs(step) / criteria.SHORTER, np.where(good, 2 * smallest, 0.0))
        longer = np.abs(step) * np.where(good, criteria.GROWTH, 0.5)
        return np.asarray(np.minimum(longer, np.maximum(criteria.BEFORE * until, least)))

    def time_of(self, state: State) -> Any:
        """Return the time in which something moves as far as its scale, large at rest."""
        reference = column(self.equations.reference, state.q_dot)
        speed, growth = ((np.abs(x) / reference).max(axis=0) for x in (state.q_dot, state.q_ddot))
        return 1 / np.maximum(np.maximum(speed, np.sqrt(growth)), criteria.TINY)

    def advance(
        self, state: State, t: float, most: int, alive: Callable[[], object] = bool
    ) -> Outcome:
        """Follow the motion from a good state to time `t`, in sub-steps where need be.

        Where it does not get there, the last good state on the way is in the outcome. Where there
        are many sub-steps, `alive` is called now and then.
        """
        step, iterations, wait = t - state.t, 0, 0
        smallest = min(abs(step), self.time_of(state)) * criteria.SMALLEST_PART
        status = Status.NOT_CONVERGED
        for count in range(criteria.MAX_SUBSTEPS):
            if count % SIGN_OF_LIFE == SIGN_OF_LIFE - 1:
                alive()
            whole = abs(step) >= abs(t - state.t)
            outcome = self.step(state, t if whole else state.t + step, most)
            iterations += outcome.iterations
            # Steps may move away from a near-singular state, but not closer to the singularity.
            too_near = max(criteria.TOO_NEAR, state.sensitivity)
            near = outcome.state is not None and outcome.state.sensitivity > too_near
            status = Status.SINGULAR if near and not whole else outcome.status
            if whole and outcome.position:
                return Outcome(status, iterations, outcome.state or state, outcome.position)
            if outcome.state and not near:
                # After a step that was too long the next ones are no longer.
                state, wait = outcome.state, max(wait - 1, 0)
                step *= 1 if wait and abs(2 * step) < abs(t - state.t) else 2
            elif abs(step) <= smallest:
                break
            else:
                step, wait = step / 2, criteria.PATIENCE
        else:
            return Outcome(Status.NOT_CONVERGED, iterations, state, exhausted=True)
        return Outcome(status, iterations, state)


Checks = tuple[tuple[Any, Status], ...]
"""What must be true, of one point or of each of a batch, and the status where it is not."""


def all_hold(good: Any, checks: Checks) -> Any:
    """Say which of a batch were good, and pass all checks."""
    for check, _ in checks:
        good = good & check
    return good


def largest(rows: Iterable[Any], count: int) -> Array:
    """Return the largest size in the rows of a batch, for each of it."""
    result = np.zeros(count)
    for row in rows:
        np.maximum(result, np.abs(row), out=result)
    return result


def all_within(values: Iterable[Array], limits: Array) -> bool:
    """Say whether the values of a batch are within limits as `within` says, all together.

    Nearly always all meet together what each must meet, and one number costs less than a mask.
    """
    rows = zip(values, limits.ravel().tolist(), strict=True)
    return all(np.dot(row, row) <= limit * limit for row, limit in rows)


@dataclass(frozen=True, slots=True)
class Node:
    """A point of the coarse march: its number in the time grid, and floats."""

    index: int
    q: Lanes
    q_dot: Lanes
    q_ddot: Lanes
    determinants: Lanes


def coarse_step(
    engine: Planned, node: Node, index: int, times: Array, per_scale: Sequence[float]
) -> tuple[Node, float] | None:
    """Return the point at `index` and the error of its prediction; None without convergence."""
    t = float(times[index])
    h = t - float(times[node.index])
    half = 0.5 * h
    predicted = [
        x + h * (v + half * a) for x, v, a in zip(node.q, node.q_dot, node.q_ddot, strict=True)
    ]
    q: Any = predicted
    for _ in range(criteria.MAX_CORRECTIONS):
        point = engine.evaluate(q, t)
        correction = engine.solve(point, point.Phi)
        q = list(map(sub, q, correction))
        if max(map(abs, map(mul, correction, per_scale))) <= criteria.LAST_COARSE_CORRECTION:
            break
    else:
        return None
    point.q = q
    _, q_dot, _, q_ddot = engine.velocity_and_acceleration(point)
    determinants = point.factors[1]
    if not math.isfinite(sum(q_ddot)):
        return None
    if any(x * y <= 0 for x, y in zip(determinants, node.determinants, strict=True)):
        return None
    error = max(map(abs, map(mul, map(sub, q, predicted), per_scale)))
    rates = zip(q_dot, node.q_dot, node.q_ddot, per_scale, strict=True)
    kink = abs(h) * max([abs(w - v - h * a) * s for w, v, a, s in rates])
    if kink > criteria.KINK_UNSEEN * (error + criteria.SMOOTH_UNSEEN):
        return None
    return Node(index, q, q_dot, q_ddot, determinants), error
