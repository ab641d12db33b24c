"""The way of one point to another time, in parts: the text between `step` and `march`."""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.step import *
from kincompile.solver.words import *


def speed_of(b: Point, s: Scales) -> Real:
    """Return the largest velocity of a point, in scales of the coordinates."""
    most: Real = 0.0
    for i in range(N):
        speed = abs(b.q_dot[i][0]) * s.inverse[i][0]
        most = speed if speed > most else most
    return most


def until_lock_up(b: Point, s: Scales, forward: Real) -> Real:
    """Return the time left at the growth of the largest velocity, where it grows forward."""
    speed = speed_of(b, s)
    growth: Real = 0.0
    for i in range(N):
        if abs(b.q_dot[i][0]) * s.inverse[i][0] == speed:
            sign = 1.0 if b.q_dot[i][0] > 0.0 else -1.0
            growth = b.q_ddot[i][0] * s.inverse[i][0] * sign
    return speed / (2.0 * abs(growth)) if forward * growth > 0.0 else INFINITE


def locks_up(b: Point, s: Scales, t: Real, smallest: Real, before: Real) -> Bool:
    """Say whether a point that cannot be left by the smallest step is at a lock-up before a time.

    There the equations must have values. Its speed was that before.
    """
    forward = t - b.t[0]
    left = until_lock_up(b, s, forward)
    if not (left <= LEFT * smallest and speed_of(b, s) >= GROWN * before):
        return False
    b.t[0] = t
    position(b, lanes=1)
    total: Real = 0.0
    for i in range(M):
        total += b.Phi[i][0]
    return finite(total) and abs(forward) - left > BEFORE_LOCK_UP / SMALLEST_PART * smallest


def walk(b: Point, s: Scales, at: State, t: Real, o: Outcome):
    """Take one point, the first lane, from a good one to a time, in sub-steps.

    These are halved where they fail and longer where they do not, and no longer than a part of the
    way to where velocities end as they grow. The good point is the last one that was reached.
    """
    put_at(b, at, 0, 1)
    before = speed_of(b, s)
    # Times that rounding does not tell apart have no step between them.
    smallest = max(abs(t - at.t) * SMALLEST_PART, ROUNDING * abs(t))
    h: Real = 0.5 * (t - at.t)
    iterations: Int = 0
    is_stuck: Bool = False
    for n in range(MAX_SUBSTEPS):
        is_whole = abs(h) >= abs(t - at.t)
        following = t if is_whole else at.t + h
        step(b, s, following, o, lanes=1)
        is_good = o.status[0] == CONVERGED
        iterations += o.iterations[0]
        if is_good:
            take_up(at, b, 0)
        else:
            put_at(b, at, 0, 1)
        # A time that is no number leaves no step.
        is_stuck = not is_good and not abs(h) > smallest
        if is_stuck or (is_good and is_whole):
            break
        size = abs(h)
        least = max(size / SHORTER, 2.0 * smallest if is_good else 0.0)
        ahead = max(BEFORE * until_lock_up(b, s, h), least)
        size = min(size * (GROWTH if is_good else 0.5), ahead)
        h = size if h > 0.0 else -size
    if o.status[0] == CONVERGED and at.t != t:
        o.status[0] = NOT_CONVERGED
    if is_stuck and locks_up(b, s, t, smallest, before):
        o.status[0] = LOCK_UP
    o.iterations[0] = iterations
