"""A position from a guess: Newton's method, with what a guess may mean beside the words of it.

Where what plain Newton finds is not near, safeguarded attempts begin at the guess and around it,
angles are turned by whole turns, and the assembly on the other side of the nearest singular
position is looked at too.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import criteria
from kincompile.runtime.engine.linear import LARGEST_CAREFUL, Dense, Floats, Planned, stacked
from kincompile.runtime.march import March, Outcome
from kincompile.runtime.problem import Attempt, iterate, near_step, safeguarded_step
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kincompile.runtime.engine.linear import Array
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Problem


def start(march: March, t: float, inputs: Inputs, *, is_in_vain: bool = False) -> Outcome:
    """Assemble the mechanism at the first time, from the guess.

    Where Newton's own steps settle near it, floats do, and matrices have no more to say.
    """
    limits, equations = (inputs.tolerance, inputs.max_iterations), march.equations
    if equations.code.lanes is not None and not equations.code.redundant:
        floats = march.with_engine(Floats(equations.code, equations.p))
        attempt = iterate(floats.equations, t, inputs.guess, *limits, near_step)
        if attempt.status is Status.CONVERGED and is_settled(attempt):
            outcome = _started(floats, attempt, *attempt.points[:: len(attempt.points) - 1])
            point = equations.at(attempt.last.q, t)
            if outcome.state is not None and point is not None:
                return replace(outcome, position=point, state=replace(outcome.state, point=point))
    attempt = assemble(equations, t, inputs.guess, *limits, is_in_vain=is_in_vain)
    if attempt.status is not Status.CONVERGED:
        status = attempt.status
        status = Status.NOT_ASSEMBLED if status is Status.NOT_CONVERGED else status
        return Outcome(status, len(attempt.corrections), None, nearest=attempt.found)
    guess, point = attempt.points[0], attempt.last
    if attempt.equations is not equations or guess.q is not inputs.guess:
        here = [equations.at(q, t) for q in (inputs.guess, point.q)]
        guess, point = (known for known in here if known is not None)
    return _started(march, attempt, guess, point)


def _started(march: March, attempt: Attempt, guess: Point, point: Point) -> Outcome:
    """Return the position that an attempt found from a guess as the start of a motion."""
    folded = is_folded(march.equations, guess, point)
    left = not folded and _is_on_another(march.equations, guess, point)
    state = march.state(point)
    # Towards a singular position Newton's method creeps, and ends a rounding error before it.
    if not isinstance(state, Status) and attempt.is_linear:
        state = Status.SINGULAR if state.sensitivity > criteria.TOO_NEAR else state
    found = state if isinstance(state, Status) else Status.CONVERGED
    return Outcome(
        found, len(attempt.corrections), None if isinstance(state, Status) else state, point,
        left_branch=left, is_folded=folded, other=attempt.other,
    )  # fmt: skip


def give_up(
    march: March, outcome: Outcome, t: float, inputs: Inputs, *, is_in_vain: bool = False
) -> Outcome:
    """Look for a position at a time that the motion does not reach."""
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
    guess: Array,
    tolerance: float,
    max_iterations: int,
    *,
    is_in_vain: bool = False,
) -> Attempt:
    """Find a position from a guess: plain Newton, and safeguarded where that fails or strays.

    Candidates are ranked: near the guess, by distance; not far from it; on the branch that the
    guess shows; then by distance. Angles that the equations leave free by whole
    turns are those nearest to the guess. Where safeguarded attempts are known to be in vain, none
    is made.
    """
    limits = tolerance, max_iterations
    if isinstance(equations.engine, Dense):
        equations = _careful(equations)
    plain = iterate(equations, t, guess, *limits)
    found = plain.status is Status.CONVERGED
    if not plain.points or (found and is_settled(plain)):
        return plain
    turned = turned_guess(equations, plain.points)
    if turned is not None:
        attempt = assemble(equations, t, turned, *limits)
        if attempt.status is Status.CONVERGED:
            attempt.turned = unwound(equations, t, attempt.last, guess, tolerance)
        return attempt
    if not _is_careful(equations):
        return assemble(_careful(equations), t, guess, *limits, is_in_vain=is_in_vain)
    if is_in_vain and not found:
        plain.status = Status.NOT_CONVERGED
        return plain
    is_sound = found and not is_thrown(plain)
    good = [plain] if found else []
    if not is_sound or left_branch(equations, plain.points[0], plain.last):
        attempts = []
        for begin in (guess,) if is_sound else restart_points(equations, guess):
            attempts.append(iterate(equations, t, begin, *limits, safeguarded_step))
            if attempts[-1].status is Status.CONVERGED:
                break
        known = [plain, *attempts] if is_sound else attempts
        good = _ordered(equations, plain.points[0], known, tolerance) or good
        if not good:
            return min(attempts, key=lambda attempt: attempt.missed)
    opposite = other_side(equations, good[0].last)
    away = equations.away(good[0].last.q, guess)
    if equations.away(opposite, guess) <= criteria.MIRRORED * max(1.0, away):
        beyond = iterate(equations, t, opposite, *limits)
        most = min(criteria.AS_NEAR * max(1.0, away), criteria.MIRRORED)
        is_sound = bool(beyond.points) and not is_thrown(beyond)
        if is_sound and equations.away(beyond.last.q, guess) <= most:
            good = _ordered(equations, plain.points[0], [*good, beyond], tolerance)
    if equations.is_turned(good[0].last.q, guess):
        good = _ordered(equations, plain.points[0], good, tolerance)
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
        leaves = not is_far and leaves_branch(equations, guess, point)
        far = round(equations.distance(point.q, guess.q), 6)
        return min(away, 1.0), is_far, leaves, far

    good = [attempt for attempt in attempts if attempt.status is Status.CONVERGED]
    for attempt in good:
        attempt.turned = unwound(equations, guess.t, attempt.last, guess.q, tolerance)
    return sorted(good, key=order)


def _as_near(equations: Problem, guess: Array, good: Sequence[Attempt]) -> Point | None:
    """Return another assembly than the first one that is as near to the guess, if one was met."""
    first, *rest = (attempt.last for attempt in good)
    reach = criteria.AS_NEAR * equations.away(first.q, guess)
    for other in rest:
        is_same = equations.distance(other.q, first.q) <= criteria.SAME_POSITION
        if not is_same and equations.away(other.q, guess) <= reach:
            return other
    return None


def unwound(equations: Problem, t: float, point: Point, guess: Array, tolerance: float) -> Point:
    """Turn angles by whole turns towards a guess, as far as the equations allow it."""
    far = np.abs(point.q - guess) > math.pi
    columns = np.flatnonzero((equations.angular | equations.code.may_turn) & far)
    # Together first: angles that a gear or a driver connects turn together.
    for some in (columns, *columns) if columns.size <= criteria.MOST_TURNED else (columns,):
        q = point.q.copy()
        q[some] -= math.tau * np.round((q - guess)[some] / math.tau)
        if not np.array_equal(q, point.q):
            turned = iterate(equations, t, q, tolerance, criteria.MAX_CORRECTIONS)
            is_same = turned.status is Status.CONVERGED
            if is_same and equations.extent(turned.last.q - q) <= criteria.SAME_POSITION:
                point = turned.last
    return _covered(equations, t, point, guess, tolerance)


def _covered(equations: Problem, t: float, point: Point, guess: Array, tolerance: float) -> Point:
    """Give Euler parameters the signs of a guess's, as far as the equations allow it.

    Where they are as far from it either way, the largest one becomes positive.
    """
    for cover in equations.code.covers:
        p = point.q[cover]
        along = p @ guess[cover]
        if (along if abs(along) > criteria.SAME_POSITION else p[np.argmax(np.abs(p))]) < 0:
            q = point.q.copy()
            q[cover] = -q[cover]
            other = equations.at(q, t)
            if other is not None and equations.holds(other, criteria.RESIDUAL_FACTOR * tolerance):
                point = other
    return point


def restart_points(equations: Problem, guess: Array) -> list[Array]:
    """Return where safeguarded attempts begin: a guess, and points further and further from it.

    With all bodies on a line, as with zeros, Phi_q gives no direction in which to bend.
    """
    bends = (np.roll(equations.probe, k)[: guess.shape[-1]] for k in range(criteria.RESTARTS))
    nudges = (
        k * criteria.NUDGE * equations.reference * bend for k, bend in enumerate(bends, start=1)
    )
    return [guess, *(guess + nudge for nudge in nudges)]


def _careful(equations: Problem) -> Problem:
    """Return equations with dense matrices and code in Python.

    Where Newton's method throws an iterate far, the last digit decides where it ends: so it has to
    be the same in all forms of a module.
    """
    engine = equations.engine
    if isinstance(engine, Dense) and engine.is_written:
        return equations
    return replace(equations, engine=Dense(equations.code, equations.p, is_written=True))


def _is_careful(equations: Problem) -> bool:
    """Say whether matrices are dense and code is in Python, or the mechanism too large for it."""
    is_written = isinstance(equations.engine, Dense) and equations.engine.is_written
    return is_written or equations.place.size > LARGEST_CAREFUL


def left_branch(equations: Problem, guess: Point, found: Point) -> bool:
    """Say whether a position found from a guess is not what the guess shows."""
    is_far = (
        equations.is_far(found.q, guess.q) or equations.away(found.q, guess.q) > criteria.ASTRAY
    )
    return bool(is_far) or leaves_branch(equations, guess, found)


def leaves_branch(equations: Problem, guess: Point, found: Point) -> bool:
    """Say whether a guess shows a branch, and a position found from it lies on another."""
    return not is_folded(equations, guess, found) and _is_on_another(equations, guess, found)


def _is_on_another(equations: Problem, guess: Point, found: Point) -> bool:
    """Say whether a position is on another branch than a guess, which shows one."""
    wanted = equations.engine.signs(guess)
    return all(wanted) and equations.engine.signs(found) != wanted


def is_folded(equations: Problem, guess: Point, found: Point) -> bool:
    """Say whether a guess shows no branch: beside a position, a determinant is zero there."""
    here, there = (equations.engine.determinants(point, point) for point in (guess, found))
    return bool((np.abs(here) <= criteria.FOLDED * np.abs(there)).any())


def is_settled(attempt: Attempt) -> bool:
    """Say whether an attempt ended near enough to its guess to skip searching for another one.

    In compiled code it must not have gone far: where it ends then, rounding would decide.
    """
    is_near = bool((attempt.away[-1] <= criteria.SETTLED).all())
    return is_near and (_is_careful(attempt.equations) or not is_thrown(attempt))


def is_thrown(attempt: Attempt) -> bool:
    """Say whether an attempt went so far that rounding errors decide where it ends."""
    return not bool((attempt.away <= criteria.THROWN).all())


def turned_guess(equations: Problem, way: Sequence[Point]) -> Array | None:
    """Return a guess with angles turned by whole turns towards its first correction.

    Only those count that the equations do not leave free by whole turns, as driven ones, and
    only where the equations miss less then: a step of a whole turn throws all the others far.
    """
    guess = way[0]
    turns = np.round((way[min(1, len(way) - 1)].q - guess.q) / math.tau)
    turning = np.flatnonzero(equations.angular & (turns != 0)).tolist()
    columns = [column for column in turning if _is_bound(equations, guess, column)]
    for some in (columns, *([column] for column in columns[: criteria.MOST_TURNED])):
        q = guess.q.copy()
        q[some] += math.tau * turns[some]
        other = equations.at(q, guess.t)
        if other is not None and equations.missed(other.Phi) < (
            (1 - criteria.SUFFICIENT) * equations.missed(guess.Phi)
        ):
            guess = other
            turns[some] = 0.0
    return None if guess is way[0] else guess.q


def turned_guesses(equations: Problem, engine: Planned, guesses: Array, t: float) -> Array:
    """Do so with each of a batch of guesses (n, N), where the equations miss less then."""

    def weighted(q: Array) -> Array:
        Phi = stacked(engine.evaluate(q, t).Phi, q.shape[1])
        return np.asarray(equations.weights()[:, np.newaxis] * Phi)

    def missed(q: Array) -> Any:
        return np.linalg.norm(weighted(q), axis=0)

    q, here = guesses.copy(), engine.evaluate(guesses, t)
    change = stacked(engine.solve(here, here.Phi), q.shape[1])
    turns = np.round(np.where(np.isfinite(change), -change, 0.0) / math.tau)
    turns[~equations.angular] = 0.0
    begin = weighted(q)
    for column in np.flatnonzero(turns.any(axis=1)):
        other = q.copy()
        other[column] += math.tau
        is_bound = np.linalg.norm(weighted(other) - begin, axis=0) > criteria.SAME_POSITION
        turns[column, ~is_bound] = 0.0
    columns, least = np.flatnonzero(turns.any(axis=1)), np.linalg.norm(begin, axis=0)
    for some in (columns, *columns[: criteria.MOST_TURNED, np.newaxis]):
        other = q.copy()
        other[some] += math.tau * turns[some]
        now = missed(other)
        fewer = now < (1 - criteria.SUFFICIENT) * least
        q[:, fewer], least[fewer] = other[:, fewer], now[fewer]
        turns[np.ix_(some, fewer)] = 0.0
    return q


def _is_bound(equations: Problem, point: Point, column: int) -> bool:
    """Say whether a whole turn of a coordinate changes the equations."""
    q = point.q.copy()
    q[column] += math.tau
    other = equations.at(q, point.t)
    return other is None or equations.missed(other.Phi - point.Phi) > criteria.SAME_POSITION


def other_side(equations: Problem, point: Point) -> Array:
    r"""Give about where a mechanism can be assembled beyond the nearest singular position.

    Two ways to assemble a dyad lie on both sides of the position in which it is stretched,
    along the movement that is free there. So the smallest singular value
    :math:`\sigma = u^T \Phi_q v` of one falls along :math:`v`, to zero half way to the other.
    NaN where the mechanism is too large, or nothing bends.
    """
    if point.q.size > criteria.MOST_MIRRORED:
        return np.full_like(point.q, np.nan)
    return mirrored(
        equations, point.q, point.Phi_q, lambda q: equations.engine.evaluate(q, point.t).Phi_q
    )


def mirrored(
    equations: Problem, q: Array, Phi_q: Array, evaluate: Callable[[Array], Array]
) -> Array:
    """Give it for one position (n,) with its Phi_q, or for each of a batch (N, n)."""
    rows, scale = equations.weights()[:, np.newaxis], equations.near
    here = rows * Phi_q * scale
    known: Any = np.isfinite(here).all(axis=(-2, -1), keepdims=True)
    here = np.where(known, here, 0.0)  # LAPACK would say so on the terminal
    left, sizes, right = np.linalg.svd(here, full_matrices=False)
    u, size, v = left[..., np.newaxis, :, -1], sizes[..., -1:], right[..., -1, :]
    moved = rows * evaluate(q + criteria.MIRROR_STEP * scale * v) * scale
    bend = (u @ (moved - here) @ v[..., np.newaxis])[..., 0] / criteria.MIRROR_STEP
    return np.where(known[..., 0], q - 2 * size / bend * scale * v, np.nan)
