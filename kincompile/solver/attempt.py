"""An attempt at a position: how equations are judged around a guess, and Newton's method.

Its steps are plain ones, or safeguarded where those fail or stray. The second text that the solvers
of languages print; `start` builds on it. It is read as the march is, and works on one point, the
first lane.
"""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.step import Point
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
    is_crawling: Bool  # whether its corrections shrink no faster than towards a double root
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


def vanish(b: Point, s: Start) -> Bool:
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


def divisor(terms: Real) -> Real:
    """Return the terms of an equation to divide by, 1.0 where they contribute nothing."""
    return terms if terms > 0.0 else 1.0


def residual(terms: Row[M], b: Point) -> Real:
    """Return by how much all equations are missed, relative to terms."""
    total: Real = 0.0
    for i in range(M):
        part = b.Phi[i][0] / divisor(terms[i])
        total += part * part
    return sqrt(total)


def fill_matrix(scale: Row[N], terms: Row[M], b: Point, s: Start):
    """Fill the matrix with Phi_q and the right side -Phi, in scales and relative to terms."""
    s.matrix = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        j = PATTERN[e][1]
        s.matrix[i][j] = b.Phi_q[e][0] * scale[j] / divisor(terms[i])
    for i in range(M):
        s.matrix[i][N] = -b.Phi[i][0] / divisor(terms[i])


def solve_least(s: Start, count: Count) -> Bool:
    """Find the least-squares step of `count` rows (Householder); return whether one exists."""
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
    """Apply the whole correction to a position; return CONVERGED, or the reason for failing."""
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
    a.iterations = 0
    a.is_thrown = False
    a.is_crawling = False
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
            a.is_crawling = a.iterations > 1 and size > last / 4.0
            if a.iterations == 1:
                a.first = a.q
            has_ended: Bool = is_small and holds(b, s)
            if not has_ended and (is_small or a.is_crawling):
                has_ended = vanish(b, s)
            if has_ended:
                a.status = CONVERGED
                is_going = False
    if is_going and a.is_crawling and holds(b, s):
        a.status = SINGULAR
