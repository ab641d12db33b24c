"""Many parameter sets that a plain step does not assemble: a third text, on top of the march.

Of each set it finds out at once whether a line of parameters leads to it from a known position, and
whether safeguarded steps from a guess come near to one. C prints it: its runtime asks for this of
sets by the thousand, and other languages take one after the other, by `start`.
"""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.march import *
from kincompile.solver.step import *
from kincompile.solver.words import *


class Descent(Struct):
    """Where safeguarded attempts are."""

    weight: Rows[M]  # by what equations are multiplied to count alike
    entry: Rows[NONZEROS]  # Phi_q with these weights, in scales
    normal: Rows[NORMAL]  # of the normal equations the lower triangle, row by row
    step: Rows[N]  # correction, in scales
    residual: Lane
    steepest: Lane  # largest entry of Phi_q
    falls: Lane  # part of its square by which a residual falls, if the equations are linear
    is_near: LaneBool


@lanewise
def weigh(b: Point, s: Scales, d: Descent):
    """Find by what equations are multiplied to count alike, and by how much they are missed."""
    total: Lane = 0.0
    d.weight = 0.0
    d.steepest = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        slope = abs(b.Phi_q[e])
        d.weight[i] += slope * s.reference[PATTERN[e][1]]
        d.steepest = where(slope > d.steepest, slope, d.steepest)
    for i in range(M):
        most = STEEP / ROUNDING * s.noise[i]
        terms = where((most > 0.0) & (d.weight[i] > most), most, d.weight[i])
        terms = where(s.magnitude[i] > terms, s.magnitude[i], terms)
        d.weight[i] = where(terms > 0.0, 1.0 / terms, 1.0)
        total += d.weight[i] * b.Phi[i] * d.weight[i] * b.Phi[i]
    d.residual = sqrt(total)


@lanewise
def eliminate(b: Point, scale: Row[N], bend: Lane, d: Descent):
    """Fill the matrix of the normal equations, for scales of the coordinates, and factor it.

    Its diagonal is larger by what bends the step.
    """
    first: Int = 0
    d.normal = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        j = PATTERN[e][1]
        d.entry[e] = d.weight[i] * b.Phi_q[e] * scale[j]
        if PATTERN[first][0] != i:
            first = e
        for f in range(first, e + 1):
            d.normal[j * (j + 1) // 2 + PATTERN[f][1]] += d.entry[e] * d.entry[f]
    for k in range(N):
        d.normal[k * (k + 1) // 2 + k] += bend
    for k in range(N):
        inverse = 1.0 / d.normal[k * (k + 1) // 2 + k]
        for i in range(k + 1, N):
            factor = d.normal[i * (i + 1) // 2 + k] * inverse
            for j in range(k + 1, i + 1):
                d.normal[i * (i + 1) // 2 + j] -= factor * d.normal[j * (j + 1) // 2 + k]


@lanewise
def substitute(d: Descent):
    """Solve the normal equations, which are factored, for a right side in place of the step."""
    d.falls = 0.0
    for k in range(N):
        part = d.step[k] / d.normal[k * (k + 1) // 2 + k]
        d.falls += d.step[k] * part
        for i in range(k + 1, N):
            d.step[i] -= d.normal[i * (i + 1) // 2 + k] * part
    for n in range(N):
        k = N - 1 - n
        for i in range(k + 1, N):
            d.step[k] -= d.normal[i * (i + 1) // 2 + k] * d.step[i]
        d.step[k] = d.step[k] / d.normal[k * (k + 1) // 2 + k]


@lanewise
def direct(b: Point, scale: Row[N], d: Descent):
    """Find Levenberg's and Marquardt's correction from the normal equations."""
    bend = BEND * where(d.residual < 1.0, d.residual, 1.0)
    eliminate(b, scale, bend, d)
    d.step = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        d.step[PATTERN[e][1]] -= d.entry[e] * d.weight[i] * b.Phi[i]
    substitute(d)
    d.falls = d.falls / (d.residual * d.residual)


@lanewise
def descend(b: Point, s: Scales, scale: Row[N], most: Int, d: Descent):
    """Take safeguarded steps, as `start` does, and note which come near to a position.

    An attempt is in vain that could not lower its residual if the equations were linear, or has not
    lowered it over three steps: it is at a minimum, or oscillates around one.
    """
    is_near: LaneBool = False
    going: LaneBool = True
    third: Lane = INFINITE
    second: Lane = INFINITE
    last: Lane = INFINITE
    position(b)
    for iteration in range(most):
        weigh(b, s, d)
        is_close = ~(d.residual > ASSEMBLES) | ~(d.steepest < TOO_STEEP)
        is_near = is_near | (going & is_close)
        going = going & ~is_close & (d.residual < FALLING * third)
        third = second
        second = last
        last = where(going, d.residual, last)
        if not any_lane(going):
            break
        direct(b, scale, d)
        is_wild = ~finite(d.falls)
        is_near = is_near | (going & is_wild)
        going = going & ~is_wild & (d.falls > STATIONARY)
        begin = copied(b.q)
        excess: Lane = 1.0
        for i in range(N):
            size = abs(d.step[i]) / (LARGEST_ANGLE if ANGULAR[i] else 1.0)
            excess = where(size > excess, size, excess)
        part = 1.0 / excess
        trying: LaneBool = going
        while any_lane(trying):
            for i in range(N):
                moved = begin[i] + part * scale[i] * d.step[i]
                b.q[i] = where(trying, moved, b.q[i])
            position(b)
            total: Lane = 0.0
            for i in range(M):
                total += d.weight[i] * b.Phi[i] * d.weight[i] * b.Phi[i]
            is_lower = sqrt(total) <= (1.0 - SUFFICIENT * part) * d.residual
            trying = trying & ~is_lower
            part = where(trying, 0.5 * part, part)
            is_over = trying & (part < SHORTEST_STEP)
            going = going & ~is_over
            trying = trying & ~is_over
            for i in range(N):
                b.q[i] = where(is_over, begin[i], b.q[i])
    d.is_near = is_near


def attempt_variants(m: Variants):
    """Make a safeguarded attempt from the guess of each variant, at the first time.

    Where it ends is written, and a status: CONVERGED where a position may be near, from which plain
    steps lead to it or nowhere, and NOT_CONVERGED where none is.
    """
    b = Point()
    s = Scales()
    o = Outcome()
    d = Descent()
    scale = row(N)
    for i in range(N):
        scale[i] = 1.0 if ANGULAR[i] else m.size
    for first in range(0, m.variants, LANES):
        count = min(m.variants - first, LANES)
        put_at_guesses(m, b, s, first, count, o)
        descend(b, s, scale, m.max_iterations, d, lanes=count)
        store(m.q, b.q, 0, first, count)
        for k in lanes(count):
            m.status[first + k] = CONVERGED if d.is_near[k] else NOT_CONVERGED


@lanewise
def mirror(b: Point, magnitude: Vector, scale: Row[N], d: Descent):
    """Go to about where mechanisms can be assembled beyond their nearest singular position.

    As `other_side` does. The movement to it is that of the smallest singular value: the inverse
    iteration of the normal equations leads to it.
    """
    image = rows(M)
    none: Lane = 0.0
    least: Lane = 0.0
    bend: Lane = 0.0
    position(b)
    for i in range(M):
        d.weight[i] = 1.0 / magnitude[i] if magnitude[i] > 0.0 else 1.0
        image[i] = 0.0
    eliminate(b, scale, none, d)
    for i in range(N):
        d.step[i] = PROBE[i]
    for iteration in range(INVERSE_ITERATIONS):
        substitute(d)
        square: Lane = 0.0
        for i in range(N):
            square += d.step[i] * d.step[i]
        size = sqrt(square)
        for i in range(N):
            d.step[i] = d.step[i] / size
    for e in range(NONZEROS):
        image[PATTERN[e][0]] += d.entry[e] * d.step[PATTERN[e][1]]
    for i in range(M):
        least += image[i] * image[i]
    for i in range(N):
        b.q[i] += MIRROR_STEP * scale[i] * d.step[i]
    position(b)
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        j = PATTERN[e][1]
        moved = d.weight[i] * b.Phi_q[e] * scale[j]
        bend += image[i] * (moved - d.entry[e]) * d.step[j]
    for i in range(N):
        b.q[i] -= (MIRROR_STEP + 2.0 * least * MIRROR_STEP / bend) * scale[i] * d.step[i]


def mirror_variants(m: Variants, magnitude: Vector):
    """Write about where variants can be assembled beyond the singular positions nearest to these.

    Equations are measured by what their terms contribute. Numbers that are not finite say nothing.
    """
    b = Point()
    s = Scales()
    o = Outcome()
    d = Descent()
    scale = row(N)
    for i in range(N):
        scale[i] = NEAR_ANGLE if ANGULAR[i] else NEAR_PART * m.size
    for first in range(0, m.variants, LANES):
        count = min(m.variants - first, LANES)
        put_at_guesses(m, b, s, first, count, o)
        mirror(b, magnitude, scale, d, lanes=count)
        store(m.q, b.q, 0, first, count)


def lead_variants(m: Variants, ends: Table):
    """Lead variants from their parameters to others, on a straight line, at the first time.

    The mechanism moves along the line as under a driver, and stays on its branch: the part of the
    line that lies behind takes the place of time. Written is what became of each at its end.
    """
    b = Point()
    before = Point()
    s = Scales()
    o = Outcome()
    at = State()
    for first in range(0, m.variants, LANES):
        count = min(m.variants - first, LANES)
        assemble(m, b, s, first, count, o)
        lead(b, ends, first, lanes=count)
        complete(b, s, o, lanes=count)
        keep(before, b)
        end: Lane = 1.0
        step(b, s, end, o, lanes=count)
        for k in lanes(count):
            if o.status[k] != CONVERGED:
                take_up(at, before, k)
                advance(b, s, at, 1.0, k, o)
        record(m, b, o, 0, first, count)
