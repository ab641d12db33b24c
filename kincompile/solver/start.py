"""A position from a guess: the second text that the solvers of languages print.

Plain Newton, and safeguarded steps where that fails or strays; angles are turned by whole turns,
and the assembly on the other side of the nearest singular position is looked at too. It is read as
`text` is, and works on one point, the first lane.
"""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.text import Point
from kincompile.solver.words import *


class Start(Struct):
    """By what positions around a guess are judged, and numbers that are worked on."""

    t: Real
    tolerance: Real
    meant: Row[N]  # the guess, with angles turned as the equations show that it is meant
    reference: Row[N]  # scale of each coordinate
    near: Row[N]  # how far each may be from an assembly that it is near
    place: Row[N]  # how large it is in the guess
    floor: Real  # correction, in scales, below which there are only rounding errors
    magnitude: Row[M]  # what the terms of each equation contribute at a generic position
    noise: Row[M]  # what rounding errors of the coordinates leave of each equation
    limit: Row[M]  # what its terms contribute at most, wherever they are
    terms: Row[M]  # what they contribute at a point
    step: Row[N]
    way: Row[N]
    matrix: Matrix[TALL, WIDE]  # of equations, the last column their right side
    directions: Matrix[WIDE, WIDE]


class Attempt(Struct):
    """A run of Newton's method, and by what it is compared with others."""

    status: Int
    iterations: Int
    is_thrown: Bool  # whether it went so far that rounding errors decide where it ends
    q: Row[N]  # the last position
    first: Row[N]  # the position after the first correction
    away: Real  # from the guess, in millionths of what is near, up to there
    rank: Int  # 2 far from the guess, 1 on another branch than it shows, 0 as it is meant
    far: Real  # distance from the guess, in millionths of the scales


def orient(s: Start):
    """Give the Euler parameters of the guess a length near one: any length is an orientation.

    By their largest first, since the squares of large ones overflow.
    """
    for i in range(3, N):
        if COVER[i] + 3 == i:
            most: Real = 0.0
            total: Real = 0.0
            for k in range(4):
                most = abs(s.meant[i - k]) if abs(s.meant[i - k]) > most else most
            for k in range(4):
                part = s.meant[i - k] / most
                total += part * part
            rest = sqrt(total)
            if most * rest > LONGEST_P or most * rest < 1.0 / LONGEST_P:
                for k in range(4):
                    s.meant[i - k] = s.meant[i - k] / most / rest


def place_at(q: Row[N], t: Real, b: Point) -> Bool:
    """Evaluate the equations at a position; return whether they have values there."""
    total: Real = 0.0
    b.t[0] = t
    for i in range(N):
        b.q[i][0] = q[i]
    position(b, lanes=1)
    for i in range(M):
        total += b.Phi[i][0]
    return finite(total)


def find_terms(scale: Row[N], b: Point, s: Start):
    """Find what the terms of each equation contribute at scales of the coordinates."""
    s.terms = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        j = PATTERN[e][1]
        s.terms[i] += abs(b.Phi_q[e][0]) * scale[j]
    for i in range(M):
        most = s.terms[i] if s.terms[i] <= s.limit[i] else s.limit[i]
        s.terms[i] = most if most > s.magnitude[i] else s.magnitude[i]


def judge_around(q: Row[N], size: Real, b: Point, s: Start):
    """Find by what positions around one are judged."""
    generic = row(N)
    wide = row(N)
    farthest: Real = 0.0
    for i in range(N):
        s.reference[i] = 1.0 if ANGULAR[i] else size
        s.near[i] = NEAR_ANGLE if ANGULAR[i] else NEAR_PART * size
        s.place[i] = min(abs(q[i]), FARTHEST * s.reference[i])
        generic[i] = q[i] + s.reference[i] * PROBE[i]
        wide[i] = s.reference[i] + s.place[i]
        if not ANGULAR[i] and s.place[i] > farthest:
            farthest = s.place[i]
    s.floor = ROUNDING * farthest / size
    s.magnitude = 0.0
    s.noise = 0.0
    for i in range(M):
        s.limit[i] = INFINITE
    if place_at(generic, s.t, b):
        find_terms(wide, b, s)
        for i in range(M):
            s.noise[i] = ROUNDING * s.terms[i]
        find_terms(s.reference, b, s)
        for i in range(M):
            # With 24 bits: rounding errors do not show in what is judged by it.
            s.magnitude[i] = single(s.terms[i])
            s.limit[i] = STEEP / ROUNDING * s.noise[i] if s.noise[i] > 0.0 else INFINITE


def holds(b: Point, s: Start) -> Bool:
    """Return whether every equation holds, relative to what its terms contribute."""
    find_terms(s.reference, b, s)
    for i in range(M):
        if not abs(b.Phi[i][0]) <= RESIDUAL_FACTOR * s.tolerance * s.terms[i] + s.noise[i]:
            return False
    return True


def holds_to_rounding(b: Point, s: Start) -> Bool:
    """Return whether every equation holds as well as floating point permits."""
    scale = row(N)
    for i in range(N):
        size = abs(b.q[i][0])
        most = WILD * s.reference[i] + s.place[i]
        size = size if size > s.reference[i] else s.reference[i]
        scale[i] = size if size < most else most
    find_terms(scale, b, s)
    for i in range(M):
        if not abs(b.Phi[i][0]) <= ROUNDING * s.terms[i]:
            return False
    return True


def residual(terms: Row[M], b: Point) -> Real:
    """Return by how much all equations are missed, relative to terms."""
    total: Real = 0.0
    for i in range(M):
        part = b.Phi[i][0] / (terms[i] if terms[i] > 0.0 else 1.0)
        total += part * part
    return sqrt(total)


def fill_matrix(scale: Row[N], terms: Row[M], b: Point, s: Start):
    """Fill the matrix with Phi_q and the right side -Phi, in scales and relative to terms."""
    s.matrix = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        j = PATTERN[e][1]
        s.matrix[i][j] = b.Phi_q[e][0] * scale[j] / (terms[i] if terms[i] > 0.0 else 1.0)
    for i in range(M):
        s.matrix[i][N] = -b.Phi[i][0] / (terms[i] if terms[i] > 0.0 else 1.0)


def solve_least(s: Start, count: Count) -> Bool:
    """Find the step by which so many rows miss least (Householder); return whether there is one."""
    total: Real = 0.0
    for k in range(N):
        square: Real = 0.0
        for i in range(k, count):
            square += s.matrix[i][k] * s.matrix[i][k]
        if square == 0.0:
            # Nothing depends on it: the shortest step leaves it.
            s.matrix[k][k] = INFINITE
        else:
            size = -sqrt(square) if s.matrix[k][k] > 0.0 else sqrt(square)
            head = s.matrix[k][k] - size
            for j in range(k + 1, WIDE):
                dot: Real = head * s.matrix[k][j]
                for i in range(k + 1, count):
                    dot += s.matrix[i][k] * s.matrix[i][j]
                dot = dot / (-size * head)
                s.matrix[k][j] -= dot * head
                for i in range(k + 1, count):
                    s.matrix[i][j] -= dot * s.matrix[i][k]
            s.matrix[k][k] = size
    for n in range(N):
        k = N - 1 - n
        value = s.matrix[k][N]
        for j in range(k + 1, N):
            value -= s.matrix[k][j] * s.step[j]
        s.step[k] = value / s.matrix[k][k]
        total += abs(s.step[k])
    return finite(total)


def plain_step(q: Row[N], b: Point, s: Start) -> Int:
    """Apply the whole correction to a position; return CONVERGED, or why there is none."""
    trial = row(N)
    for i in range(N):
        trial[i] = 1.0
    for i in range(M):
        s.terms[i] = 1.0
    fill_matrix(trial, s.terms, b, s)
    if not solve_least(s, M):
        return SINGULAR
    for i in range(N):
        trial[i] = q[i] + s.step[i]
    return CONVERGED if place_at(trial, s.t, b) else NOT_FINITE


def safeguarded_step(q: Row[N], b: Point, s: Start) -> Int:
    """Apply as much of the correction as keeps the angles near and lowers the residual.

    It is bent towards the gradient while the residual is large (Levenberg, Marquardt).
    """
    trial = row(N)
    find_terms(s.reference, b, s)
    terms = copied(s.terms)
    before = residual(terms, b)
    fill_matrix(s.reference, terms, b, s)
    for i in range(N):
        s.matrix[M + i][i] = sqrt(BEND * (before if before < 1.0 else 1.0))
    if not solve_least(s, M + N):
        return NOT_FINITE
    excess: Real = 1.0
    for i in range(N):
        part = abs(s.step[i]) / (LARGEST_ANGLE if ANGULAR[i] else 1.0)
        excess = part if part > excess else excess
        s.step[i] *= s.reference[i]
    part: Real = 1.0 / excess
    while part >= SHORTEST_STEP:
        for i in range(N):
            trial[i] = q[i] + part * s.step[i]
        if place_at(trial, s.t, b):
            after = residual(terms, b)
            if after <= (1.0 - SUFFICIENT * part) * before or after <= ROUNDING:
                return CONVERGED
        part *= 0.5
    return NOT_CONVERGED


def iterate(guess: Row[N], is_safe: Bool, most: Int, b: Point, s: Start, a: Attempt):
    """Run Newton's method from a guess, by safeguarded steps or by plain ones."""
    size: Real = 0.0
    is_crawling: Bool = False
    a.iterations = 0
    a.is_thrown = False
    a.q = guess
    a.first = guess
    a.status = NOT_CONVERGED if place_at(guess, s.t, b) else NOT_FINITE
    is_going: Bool = a.status == NOT_CONVERGED
    while is_going and a.iterations < most:
        moved = safeguarded_step(a.q, b, s) if is_safe else plain_step(a.q, b, s)
        if moved != CONVERGED:
            a.status = moved
            is_going = False
        else:
            is_small: Bool = True
            last: Real = size
            size = 0.0
            for i in range(N):
                change = b.q[i][0] - a.q[i]
                allowed = s.tolerance if s.tolerance > s.floor else s.floor
                allowed = allowed * s.reference[i] + ROUNDING * abs(b.q[i][0])
                is_small = is_small and abs(change) <= allowed
                size += change * change
                a.q[i] = b.q[i][0]
                if not abs(a.q[i] - guess[i]) <= THROWN * s.near[i]:
                    a.is_thrown = True
            size = sqrt(size)
            a.iterations += 1
            is_crawling = a.iterations > 1 and size > last / 4.0
            if a.iterations == 1:
                a.first = a.q
            has_ended: Bool = is_small and holds(b, s)
            if not has_ended and (is_small or is_crawling):
                has_ended = holds_to_rounding(b, s)
            if has_ended:
                a.status = CONVERGED
                is_going = False
    if is_going and is_crawling and holds(b, s):
        a.status = SINGULAR


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
        trial = copied(s.meant)
        for i in range(N):
            if turns[i] != 0.0 and (n == 0 or n == i + 1):
                trial[i] += TURN * turns[i]
                is_new = True
        if is_new and place_at(trial, s.t, b):
            missed_now = residual(s.magnitude, b)
            if missed_now < (1.0 - SUFFICIENT) * missed_least:
                missed_least = missed_now
                is_turned = True
                for i in range(N):
                    if n == 0 or n == i + 1:
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
        trial = copied(a.q)
        for i in range(N):
            is_wound = MAY_TURN[i] and abs(trial[i] - guess[i]) > 0.5 * TURN
            if is_wound and (n == 0 or n == i + 1):
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

    What is near the guess comes first, the nearest of it; then what is not far, then what is on its
    branch, then the nearer.
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
        best.q = a.q
        best.away = a.away
        best.rank = a.rank
        best.far = a.far


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
    s.directions = 0.0
    for i in range(N):
        s.directions[i][i] = 1.0
    is_done: Bool = False
    sweeps: Int = 0
    # Rotations of pairs of columns until all are orthogonal (Jacobi).
    while not is_done and sweeps < 60:
        is_done = True
        sweeps += 1
        for i in range(N):
            for j in range(i + 1, N):
                first: Real = 0.0
                second: Real = 0.0
                mixed: Real = 0.0
                for k in range(M):
                    first += s.matrix[k][i] * s.matrix[k][i]
                    second += s.matrix[k][j] * s.matrix[k][j]
                    mixed += s.matrix[k][i] * s.matrix[k][j]
                if abs(mixed) > ROUNDING / 16.0 * sqrt(first * second):
                    is_done = False
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
        size = s.magnitude[i] if s.magnitude[i] > 0.0 else 1.0
        bend += image[i] * b.Phi_q[e][0] / size * s.way[PATTERN[e][1]]
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


def rescue(is_sound: Bool, most: Int, b: Point, s: Start, a: Attempt):
    """Make safeguarded attempts until one converges: from the guess, then further and further away.

    With all bodies on a line no equation tells which way to bend. Where a position was found
    already, one is enough.
    """
    begin = row(N)
    reach: Real = 0.0
    for k in range(1 if is_sound else RESTARTS + 1):
        for i in range(N):
            place = i + 1 - k if i + 1 >= k else M + i + 1 - k
            begin[i] = s.meant[i]
            if k > 0:
                begin[i] += reach * s.reference[i] * PROBE[place]
        iterate(begin, True, most, b, s, a)
        if a.status == CONVERGED:
            break
        reach += NUDGE


def position_from(guess: Row[N], size: Real, most: Int, b: Point, s: Start, best: Attempt):
    """Find a position from a guess, or why there is none."""
    plain = Attempt()
    a = Attempt()
    other = Attempt()
    s.meant = guess
    orient(s)
    near = copied(s.meant)
    judge_around(near, size, b, s)
    best.status = NOT_FINITE
    best.q = near
    if place_at(near, s.t, b):
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
            rescue(is_sound, most, b, s, a)
            if a.status == CONVERGED:
                take(b, s, a, other, best)
            elif plain.status == CONVERGED and not is_sound:
                take(b, s, plain, other, best)
            elif not is_sound:
                best.status = a.status
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
            unwind(near, b, s, best, other)
