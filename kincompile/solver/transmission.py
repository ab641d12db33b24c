"""A mechanism as a function of its inputs: the third text that the solvers of languages print.

A call predicts the position for new inputs from the last two, corrects it by Newton's method and
looks at it: a position that is not on the way from the last one is never given. Where inputs are
too far for that the way is followed in parts.
"""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.words import *


class Transmission(Struct):
    """A position of a mechanism, from which it goes on, and how it came there."""

    size: Real  # of the mechanism, by which lengths are judged
    p: Row[K]
    u: Row[U]  # inputs
    q: Row[N]  # coordinates that several equations together determine
    determinants: Row[BLOCKS]
    slopes: Matrix[N, U]  # of q by u
    way: Row[U]  # by what u changed last
    bend: Row[N]  # second order of q along that way
    twist: Row[N]  # third order
    turned: Matrix[N, U]  # by what the slopes changed on it


class Pose(Struct):
    """A position, and what is computed there."""

    u: Row[U]
    q: Row[N]
    change: Row[N]  # correction of Newton's method
    determinants: Row[BLOCKS]
    slopes: Matrix[N, U]
    x: Row[X]  # outputs
    J: Matrix[X, U]  # of x by u
    missed: Row[ONE]  # by what part of their terms equations are missed


def predict(s: Transmission, u: Row[U], b: Pose):
    """Predict the position for inputs: along the last way to third order, across it to first."""
    step = row(U)
    across = row(U)
    along: Real = 0.0
    length: Real = 0.0
    for j in range(U):
        b.u[j] = u[j]
        step[j] = u[j] - s.u[j]
        along += step[j] * s.way[j]
        length += s.way[j] * s.way[j]
    part: Real = 0.0
    if abs(along) <= LONGEST_PART * length and length > 0.0:
        part = along / length
    for j in range(U):
        across[j] = part * (step[j] - part * s.way[j])
    for i in range(N):
        place: Real = s.q[i] + part * part * (s.bend[i] + part * s.twist[i])
        for j in range(U):
            place += s.slopes[i, j] * step[j] + s.turned[i, j] * across[j]
        b.q[i] = place


def correct(s: Transmission, b: Pose) -> Real:
    """Take the correction of a position; return how large it is, in scales."""
    inverse = 1.0 / s.size
    size: Real = 0.0
    for i in range(N):
        change = abs(b.change[i]) * (1.0 if ANGULAR[i] else inverse)
        size = size if change <= size else change
        b.q[i] -= b.change[i]
    return size


def settle(s: Transmission, most: Int, farthest: Real, b: Pose) -> Int:
    """Correct a position until corrections are small; return what became of it."""
    moved: Real = 0.0
    for iteration in range(most):
        evaluate(s, b)
        size = correct(s, b)
        moved += size
        if not finite(moved):
            return NOT_FINITE
        if moved > farthest:
            return NOT_CONVERGED
        if size <= LAST_CORRECTION:
            return CONVERGED if b.missed[0] <= SOLVED else SINGULAR
    return NOT_CONVERGED


def steepness(s: Transmission, b: Pose) -> Real:
    """Return the largest slope, in scales of coordinates and inputs."""
    inverse = 1.0 / s.size
    most: Real = 0.0
    for i in range(N):
        scale = 1.0 if ANGULAR[i] else inverse
        for j in range(U):
            slope = abs(b.slopes[i, j]) * scale * (1.0 if IS_ANGLE[j] else s.size)
            most = most if slope <= most else slope
    return most


def bends(s: Transmission, b: Pose) -> Bool:
    """Say whether a position is on another branch, which begins on the way from the last one."""
    error: Real = 0.0
    kink: Real = 0.0
    for i in range(N):
        scale = 1.0 if ANGULAR[i] else s.size
        apart: Real = b.q[i] - s.q[i]
        turn: Real = 0.0
        for j in range(U):
            step = b.u[j] - s.u[j]
            apart -= s.slopes[i, j] * step
            turn += (b.slopes[i, j] - s.slopes[i, j]) * step
        error = max(error, abs(apart) / scale)
        kink = max(kink, abs(turn) / scale)
    return kink > KINK * error + SMOOTH


def sets_out(s: Transmission, u: Row[U], b: Pose) -> Int:
    """Predict the position for inputs; return whether it is near enough to be corrected.

    A prediction that is far away proves nothing, since angles may turn to any assembly.
    """
    predict(s, u, b)
    inverse = 1.0 / s.size
    moved: Real = 0.0
    for i in range(N):
        way = abs(b.q[i] - s.q[i]) * (1.0 if ANGULAR[i] else inverse)
        moved = moved if way <= moved else way
    if not finite(moved):
        return NOT_FINITE
    return NOT_CONVERGED if moved > LARGE_ERROR else CONVERGED


def arrives(s: Transmission, b: Pose) -> Int:
    """Say whether a position is on the branch of the last one.

    Where the determinant of a block has changed its sign a singular position lies between.
    """
    status: Int = CONVERGED
    for i in range(BLOCKS):
        # not so where either is not a number
        if not s.determinants[i] * b.determinants[i] > 0.0:
            status = SINGULAR
    steep = steepness(s, b)
    if not steep <= STEEPEST or (steep > NEARLY_SINGULAR and bends(s, b)):
        status = SINGULAR
    return status


def goes(s: Transmission, u: Row[U], b: Pose) -> Int:
    """Go to inputs in one step; return what became of it."""
    status: Int = sets_out(s, u, b)
    if status == CONVERGED:
        status = settle(s, MAX_CORRECTIONS, SMALL_ERROR, b)
    return arrives(s, b) if status == CONVERGED else status


def accept(s: Transmission, b: Pose):
    """Take a position as the last one, with the way to it unless it is the same."""
    moves: Bool = False
    way = row(U)
    for j in range(U):
        way[j] = b.u[j] - s.u[j]
        if way[j] != 0.0:
            moves = True
    if moves:
        s.way = way
        for i in range(N):
            before: Real = 0.0
            after: Real = 0.0
            for j in range(U):
                before += s.slopes[i, j] * way[j]
                after += b.slopes[i, j] * way[j]
                s.turned[i, j] = b.slopes[i, j] - s.slopes[i, j]
            apart = b.q[i] - s.q[i]
            s.bend[i] = before + 2.0 * after - 3.0 * apart
            s.twist[i] = before + after - 2.0 * apart
    for i in range(N):
        for j in range(U):
            s.slopes[i, j] = b.slopes[i, j]
    s.q = b.q
    s.u = b.u
    s.determinants = b.determinants


def follow(s: Transmission, u: Row[U], b: Pose) -> Int:
    """Go towards inputs in parts, halved where they fail and doubled where they do not.

    The last position that was reached is kept.
    """
    first = copied(s.u)
    aim = row(U)
    done: Real = 0.0
    h: Real = 0.5
    status: Int = NOT_CONVERGED
    for n in range(MAX_SUBSTEPS):
        is_last = done + h >= 1.0
        for j in range(U):
            aim[j] = u[j] if is_last else first[j] + (done + h) * (u[j] - first[j])
        status = goes(s, aim, b)
        if status == CONVERGED:
            accept(s, b)
            done += h
            h *= 2.0
            if is_last:
                return CONVERGED
        else:
            h *= 0.5
            # Steps are small beside what is done of the way: away from a singular position the
            # first ones are smaller still.
            if h < SMALLEST_PART * max(done, SMALLEST_PART):
                return NOT_FINITE if status == NOT_FINITE else SINGULAR
    return NOT_REACHED


def ends(status: Int, b: Pose) -> Int:
    """Return what became of a position; one that was not found has no numbers."""
    if status != CONVERGED:
        for i in range(X):
            b.x[i] = NOTHING
            for j in range(U):
                b.J[i, j] = NOTHING
    return status


def transmit(s: Transmission, u: Row[U], b: Pose) -> Int:
    """Find the position for inputs, on the way from the last one; return what became of it."""
    if goes(s, u, b) == CONVERGED:
        accept(s, b)
        return CONVERGED
    return ends(follow(s, u, b), b)


def begin(s: Transmission, u: Row[U], q: Row[N], b: Pose) -> Int:
    """Find the position near a guess, from which to go on; return what became of it."""
    for j in range(U):
        b.u[j] = u[j]
    for i in range(N):
        b.q[i] = q[i]
    status: Int = settle(s, MAX_ITERATIONS, NEAR_ANGLE, b)
    if status == CONVERGED and not steepness(s, b) <= STEEPEST:
        status = SINGULAR
    if status == CONVERGED:
        accept(s, b)
        for j in range(U):
            s.way[j] = 0.0
            for i in range(N):
                s.turned[i, j] = 0.0
        for i in range(N):
            s.bend[i] = 0.0
            s.twist[i] = 0.0
    return ends(status, b)
