"""A position from a guess: the second half of the text that `attempt` begins.

What a guess means decides between positions: angles are turned by whole turns, and the assembly on
the other side of the nearest singular position is looked at too.
"""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.attempt import *
from kincompile.solver.words import *


def find_way(q: Row[N], guess: Row[N], s: Start):
    """Find the way from a guess to a position as a mechanism shows it.

    Whole turns of an angle are no way, and Euler parameters p and -p are one orientation.
    """
    for i in range(N):
        change = q[i] - guess[i]
        s.way[i] = change - TURN * floor(change / TURN + 0.5) if ANGULAR[i] else change
    for i in range(3, N):
        if COVER[i] + 3 == i:
            along: Real = 0.0
            for k in range(4):
                along += q[i - k] * guess[i - k]
            for k in range(4):
                both = q[i - k] + guess[i - k]
                s.way[i - k] = both if along < 0.0 else q[i - k] - guess[i - k]


def away_from(q: Row[N], guess: Row[N], s: Start) -> Real:
    """Return how far a position is from a guess; up to 1.0 it is near."""
    most: Real = 0.0
    find_way(q, guess, s)
    for i in range(N):
        part = abs(s.way[i]) / s.near[i]
        most = most if part <= most else part
    return most


def turn(first: Row[N], b: Point, s: Start) -> Bool:
    """Turn angles of the guess by whole turns towards its first correction; return whether any was.

    Only those count that the equations do not leave free by whole turns, as driven ones, and only
    where the equations miss less then: a step of a whole turn throws all the others far.
    """
    Phi = row(M)
    turns = row(N)
    trial = copied(s.meant)
    is_turned: Bool = False
    if not place_at(s.meant, s.t, b):
        return False
    missed_least: Real = residual(s.magnitude, b)
    for i in range(M):
        Phi[i] = b.Phi[i][0]
    for i in range(N):
        turns[i] = floor((first[i] - s.meant[i]) / TURN + 0.5) if ANGULAR[i] else 0.0
        if turns[i] != 0.0:
            trial[i] += TURN
            if place_at(trial, s.t, b):
                for k in range(M):
                    b.Phi[k][0] -= Phi[k]
                if residual(s.magnitude, b) <= SAME_POSITION:
                    turns[i] = 0.0
            trial[i] = s.meant[i]
    # Together first, then each alone.
    for n in range(N + 1):
        is_new: Bool = False
        low = 0 if n == 0 else n - 1
        high = N if n == 0 else n
        trial = copied(s.meant)
        for i in range(low, high):
            if turns[i] != 0.0:
                trial[i] += TURN * turns[i]
                is_new = True
        if is_new and place_at(trial, s.t, b):
            missed_now = residual(s.magnitude, b)
            if missed_now < (1.0 - SUFFICIENT) * missed_least:
                missed_least = missed_now
                is_turned = True
                for i in range(low, high):
                    turns[i] = 0.0
                s.meant = trial
    return is_turned


def unwind(guess: Row[N], b: Point, s: Start, a: Attempt, other: Attempt):
    """Turn angles by whole turns towards a guess, and Euler parameters to its signs.

    As far as the equations allow it. Parameters that are as far from it either way become those
    whose largest is positive.
    """
    # Together first: angles that a gear or a driver connects turn together.
    for n in range(N + 1):
        is_new: Bool = False
        low = 0 if n == 0 else n - 1
        high = N if n == 0 else n
        trial = copied(a.q)
        for i in range(low, high):
            if MAY_TURN[i] and abs(trial[i] - guess[i]) > 0.5 * TURN:
                trial[i] -= TURN * floor((trial[i] - guess[i]) / TURN + 0.5)
                is_new = True
        if is_new:
            iterate(trial, False, MAX_CORRECTIONS, b, s, other)
            is_same: Bool = other.status == CONVERGED
            for i in range(N):
                is_same = is_same and abs(other.q[i] - trial[i]) <= SAME_POSITION * s.reference[i]
            if is_same:
                a.q = other.q
    for i in range(3, N):
        if COVER[i] + 3 == i:
            along: Real = 0.0
            most: Real = 0.0
            trial = copied(a.q)
            for k in range(4):
                p = a.q[i - k]
                along += p * guess[i - k]
                most = p if abs(p) > abs(most) else most
                trial[i - k] = -p
            is_turned = (along if abs(along) > SAME_POSITION else most) < 0.0
            if is_turned and place_at(trial, s.t, b) and holds(b, s):
                a.q = trial


def leaves_branch(q: Row[N], b: Point, s: Start) -> Bool:
    """Return whether the guess shows a branch, and a position found from it lies on another.

    Nothing but the rows that are solved has a determinant where others repeat them.
    """
    shown = row(BLOCKS)
    leaves: Bool = False
    for i in range(M):
        if IS_REDUNDANT[i]:
            return False
    if not place_at(s.meant, s.t, b):
        return False
    factor(b, lanes=1)
    for i in range(BLOCKS):
        shown[i] = b.determinants[i][0]
    if not place_at(q, s.t, b):
        return True
    factor(b, lanes=1)
    for i in range(BLOCKS):
        here = b.determinants[i][0]
        if not abs(shown[i]) > FOLDED * abs(here):
            return False
        leaves = leaves or not (here > 0.0 if shown[i] > 0.0 else here < 0.0)
    return leaves


def take(b: Point, s: Start, a: Attempt, other: Attempt, best: Attempt):
    """Take an attempt that converged as the best one, where it is nearer to what a guess means.

    Candidates are ranked: near the guess, by distance; not far from it; on its branch; then by
    distance.
    """
    unwind(s.meant, b, s, a, other)
    away = away_from(a.q, s.meant, s)
    is_far: Bool = False
    a.far = 0.0
    for i in range(N):
        size = abs(s.way[i])
        is_far = is_far or (MAY_TURN[i] and size > FAR)
        a.far = size / s.reference[i] if size / s.reference[i] > a.far else a.far
    a.far = floor(1e6 * a.far + 0.5)
    a.away = floor(1e6 * (away if away < 1.0 else 1.0) + 0.5)
    a.rank = 2
    if not is_far:
        a.rank = 1 if leaves_branch(a.q, b, s) else 0
    is_better: Bool = a.far < best.far
    if best.status != CONVERGED:
        is_better = True
    elif a.away != best.away:
        is_better = a.away < best.away
    elif a.rank != best.rank:
        is_better = a.rank < best.rank
    if is_better:
        best.status = a.status
        best.iterations = a.iterations
        best.is_crawling = a.is_crawling
        best.q = a.q
        best.away = a.away
        best.rank = a.rank
        best.far = a.far


def rotate(i: Int, j: Int, s: Start) -> Bool:
    """Rotate two columns of the matrix, and of the directions, until they are orthogonal.

    Return whether they were not.
    """
    first: Real = 0.0
    second: Real = 0.0
    mixed: Real = 0.0
    for k in range(M):
        first += s.matrix[k][i] * s.matrix[k][i]
        second += s.matrix[k][j] * s.matrix[k][j]
        mixed += s.matrix[k][i] * s.matrix[k][j]
    if not abs(mixed) > ROUNDING / 16.0 * sqrt(first * second):
        return False
    zeta = (second - first) / (2.0 * mixed)
    tangent = 1.0 / (abs(zeta) + sqrt(1.0 + zeta * zeta))
    tangent = tangent if zeta >= 0.0 else -tangent
    cosine = 1.0 / sqrt(1.0 + tangent * tangent)
    for k in range(M):
        x = s.matrix[k][i]
        y = s.matrix[k][j]
        s.matrix[k][i] = cosine * (x - tangent * y)
        s.matrix[k][j] = cosine * (tangent * x + y)
    for k in range(N):
        x = s.directions[k][i]
        y = s.directions[k][j]
        s.directions[k][i] = cosine * (x - tangent * y)
        s.directions[k][j] = cosine * (tangent * x + y)
    return True


def make_orthogonal(s: Start):
    """Rotate pairs of columns of the matrix until all are orthogonal (Jacobi)."""
    s.directions = 0.0
    for i in range(N):
        s.directions[i][i] = 1.0
    is_done: Bool = False
    sweeps: Int = 0
    while not is_done and sweeps < 60:
        is_done = True
        sweeps += 1
        for i in range(N):
            for j in range(i + 1, N):
                if rotate(i, j, s):
                    is_done = False


def other_side(q: Row[N], b: Point, s: Start) -> Bool:
    """Find about where the mechanism can be assembled beyond the nearest singular position.

    Along its movement v the smallest singular value u^T Phi_q v falls to zero half way. The
    position is left in the step. Return whether there is one; a large mechanism is not asked.
    """
    if N > MOST_MIRRORED or not place_at(q, s.t, b):
        return False
    trial = row(N)
    image = row(M)
    fill_matrix(s.near, s.magnitude, b, s)
    make_orthogonal(s)
    smallest: Int = 0
    least: Real = INFINITE
    for i in range(N):
        square: Real = 0.0
        for k in range(M):
            square += s.matrix[k][i] * s.matrix[k][i]
        if square < least:
            least = square
            smallest = i
    for i in range(M):
        image[i] = s.matrix[i][smallest]
    for i in range(N):
        s.way[i] = s.near[i] * s.directions[i][smallest]
        trial[i] = q[i] + MIRROR_STEP * s.way[i]
    if not place_at(trial, s.t, b):
        return False
    bend: Real = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        bend += image[i] * b.Phi_q[e][0] / divisor(s.magnitude[i]) * s.way[PATTERN[e][1]]
    total: Real = 0.0
    bend = (bend - least) / MIRROR_STEP
    for i in range(N):
        s.step[i] = q[i] - 2.0 * least / bend * s.way[i]
        total += s.step[i]
    return finite(total)


def is_settled(s: Start, a: Attempt) -> Bool:
    """Return whether an attempt led to an assembly so near that no nearer one is sought."""
    for i in range(N):
        if not abs(a.q[i] - s.meant[i]) <= SETTLED * s.near[i]:
            return False
    return a.status == CONVERGED


def rescue(is_sound: Bool, most: Int, b: Point, s: Start, a: Attempt, best: Attempt):
    """Make safeguarded attempts until one converges: from the guess, then further and further away.

    With all bodies on a line Phi_q gives no direction in which to bend. Where a position was found
    already, one is enough; else the best one ends as the attempt that misses the equations least.
    """
    begin = row(N)
    reach: Real = 0.0
    least: Real = INFINITE
    for k in range(1 if is_sound else RESTARTS + 1):
        for i in range(N):
            begin[i] = s.meant[i]
            if k > 0:
                place: Int = i + 1 + RESTARTS * M - k
                while place >= M:
                    place -= M
                begin[i] += reach * s.reference[i] * PROBE[place]
        iterate(begin, True, most, b, s, a)
        if a.status == CONVERGED:
            break
        missed_now = residual(s.magnitude, b) if place_at(a.q, s.t, b) else INFINITE
        if not is_sound and (k == 0 or missed_now < least):
            least = missed_now
            best.status = a.status
            best.iterations = a.iterations
        reach += NUDGE


def find_position(guess: Row[N], most: Int, b: Point, s: Start, best: Attempt):
    """Find a position from a guess, or the reason for failing, by scales measured around one."""
    plain = Attempt()
    a = Attempt()
    other = Attempt()
    s.meant = guess
    best.status = NOT_FINITE
    best.q = guess
    if place_at(guess, s.t, b):
        best.status = NOT_CONVERGED
        iterate(s.meant, False, most, b, s, plain)
        while not is_settled(s, plain) and turn(plain.first, b, s):
            iterate(s.meant, False, most, b, s, plain)
        is_near = is_settled(s, plain)
        is_sound = plain.status == CONVERGED and not plain.is_thrown
        if is_near or is_sound:
            take(b, s, plain, other, best)
        is_astray: Bool = not is_near and best.status != CONVERGED
        if is_sound and not is_near:
            is_astray = best.rank > 0 or away_from(best.q, s.meant, s) > ASTRAY
        if is_astray:
            rescue(is_sound, most, b, s, a, best)
            if a.status == CONVERGED:
                take(b, s, a, other, best)
            elif plain.status == CONVERGED and not is_sound:
                take(b, s, plain, other, best)
        if not is_near and best.status == CONVERGED and other_side(best.q, b, s):
            opposite = copied(s.step)
            away = away_from(best.q, s.meant, s)
            away = away if away > 1.0 else 1.0
            reach = AS_NEAR * away if AS_NEAR * away < MIRRORED else MIRRORED
            if away_from(opposite, s.meant, s) <= MIRRORED * away:
                iterate(opposite, False, most, b, s, a)
                is_good = a.status == CONVERGED and not a.is_thrown
                if is_good and away_from(a.q, s.meant, s) <= reach:
                    take(b, s, a, other, best)
        if best.status == CONVERGED:
            unwind(guess, b, s, best, other)


def position_from(guess: Row[N], size: Real, most: Int, b: Point, s: Start, best: Attempt):
    """Find a position from a guess, or the reason for failing, for a size of the mechanism."""
    s.meant = guess
    orient(s)
    near = copied(s.meant)
    judge_around(near, size, b, s)
    find_position(near, most, b, s, best)
