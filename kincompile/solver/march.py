"""The march of a mechanism over a time grid: the last part of the text that `step` begins."""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.step import *
from kincompile.solver.walk import *
from kincompile.solver.words import *


class Variants(Struct):
    """Motions over the same times, each with parameters of its own, and where its numbers go."""

    count: Count
    variants: Count
    t: Vector
    p: Table
    guess: Table
    size: Real
    tolerance: Real
    max_iterations: Int
    q: Block
    q_dot: Block
    q_ddot: Block
    residual: Vector
    status: Vector[Int]
    iterations: Vector[Int]


def scales_of(own: Scales, s: Scales, k: Count):
    """Take the scales of one lane."""
    own.tolerance = s.tolerance
    for i in range(M):
        own.magnitude[i][0] = s.magnitude[i][k]
        own.noise[i][0] = s.noise[i][k]
        if IS_CAREFUL:
            own.part[i][0] = s.part[i][k]
        else:
            own.weight[i][0] = s.weight[i][k]
    for i in range(N):
        own.reference[i][0] = s.reference[i][k]
        own.inverse[i][0] = s.inverse[i][k]


def advance(b: Point, s: Scales, at: State, t: Real, k: Count, o: Outcome):
    """Take one lane from a good point to a time, in sub-steps."""
    alone = Point()
    own = Scales()
    found = Outcome()
    constants(alone, lanes=1)
    scales_of(own, s, k)
    found.is_over[0] = False
    walk(alone, own, at, t, found)
    o.residual[k] = found.residual[0]
    o.status[k] = found.status[0]
    o.iterations[k] = found.iterations[0]
    put_at(b, at, k, k + 1)


if IS_CAREFUL:

    def advance_carefully(
        b: Point, s: Scales, at: State, nearness: Real, t: Real, o: Outcome
    ) -> Bool:
        """Take a good point, of a sensitivity, to a time in sub-steps.

        These are halved where they fail and doubled where they do not; after one that was too long
        the next ones are no longer. What is near a singular position is not gone on from. Return
        whether the march ended, and was not given up.
        """
        fastest: Real = TINY
        for i in range(N):
            speed = abs(at.q_dot[i]) * s.inverse[i][0]
            gain = sqrt(abs(at.q_ddot[i]) * s.inverse[i][0])
            fastest = speed if speed > fastest else fastest
            fastest = gain if gain > fastest else fastest
        smallest = min(abs(t - at.t), 1.0 / fastest) * SMALLEST_PART
        near: Real = nearness
        h: Real = t - at.t
        iterations: Int = 0
        wait: Int = 0
        for n in range(MAX_SUBSTEPS):
            is_whole = abs(h) >= abs(t - at.t)
            put_at(b, at, 0, 1)
            step(b, s, t if is_whole else at.t + h, o, lanes=1)
            iterations += o.iterations[0]
            o.iterations[0] = iterations
            if is_whole and o.is_there[0]:
                return True
            is_good = o.status[0] == CONVERGED
            is_near = is_good and o.sensitivity[0] > max(TOO_NEAR, near)
            if is_good and not is_near:
                take_up(at, b, 0)
                near = o.sensitivity[0]
                wait = max(wait - 1, 0)
                if wait == 0 or abs(2.0 * h) >= abs(t - at.t):
                    h *= 2.0
            elif abs(h) <= smallest:
                if is_near:
                    o.status[0] = SINGULAR
                o.is_there[0] = False
                return True
            else:
                h *= 0.5
                wait = PATIENCE
        o.status[0] = NOT_CONVERGED
        o.is_there[0] = False
        return False


def record(m: Variants, b: Point, o: Outcome, time: Count, first: Count, count: Count):
    """Write points at one time, from a variant on; those that are over have no numbers."""
    store(m.q, b.q, time, first, count)
    store(m.q_dot, b.q_dot, time, first, count)
    store(m.q_ddot, b.q_ddot, time, first, count)
    for k in lanes(count):
        place = time * m.variants + first + k
        m.residual[place] = NOTHING if o.is_over[k] else o.residual[k]
        m.status[place] = o.status[k]
        m.iterations[place] = o.iterations[k]
    for k in lanes(count):
        if o.is_over[k]:
            for i in range(N):
                m.q[i, time, first + k] = NOTHING
                m.q_dot[i, time, first + k] = NOTHING
                m.q_ddot[i, time, first + k] = NOTHING


def put_at_guesses(m: Variants, b: Point, s: Scales, first: Count, count: Count, o: Outcome):
    """Put variants at their guesses, at the first time, and measure their equations."""
    constants(b, lanes=count)
    s.tolerance = m.tolerance
    for i in range(K):
        for k in lanes(count):
            b.p[i][k] = m.p[i, first + k]
    for i in range(N):
        for k in lanes(count):
            b.q[i][k] = m.guess[i, first + k]
    for k in lanes(count):
        b.t[k] = m.t[0]
        o.is_over[k] = False
    measure(b, m.size, s, lanes=count)


def assemble(m: Variants, b: Point, s: Scales, first: Count, count: Count, o: Outcome):
    """Assemble variants from their guesses, at the first time."""
    put_at_guesses(m, b, s, first, count, o)
    correct(b, s, m.max_iterations, o, lanes=count)
    complete(b, s, o, lanes=count)
    # The guess may be rough.
    measure(b, m.size, s, lanes=count)


if HAS_LANES:

    class Curve(Struct):
        """A motion between two good points: polynomials in the part of the time that is over."""

        t: Real
        h: Real
        determinants: Row[BLOCKS]
        place: Row[N]  # coefficients of the powers from 0 to 5
        first: Row[N]
        second: Row[N]
        third: Row[N]
        fourth: Row[N]
        fifth: Row[N]

    def lay(c: Curve, at: State, b: Point, k: Count):
        """Lay a curve from a good point to a lane, through their rates too (Hermite)."""
        c.t = at.t
        c.h = b.t[k] - at.t
        for i in range(BLOCKS):
            c.determinants[i] = at.determinants[i]
        for i in range(N):
            speed = c.h * at.q_dot[i]
            bow = 0.5 * c.h * c.h * at.q_ddot[i]
            away = b.q[i][k] - at.q[i] - speed - bow
            gain = c.h * b.q_dot[i][k] - speed - 2.0 * bow
            turn = 0.5 * c.h * c.h * b.q_ddot[i][k] - bow
            c.place[i] = at.q[i]
            c.first[i] = speed
            c.second[i] = bow
            c.third[i] = 10.0 * away - 4.0 * gain + turn
            c.fourth[i] = 7.0 * gain - 15.0 * away - 2.0 * turn
            c.fifth[i] = 6.0 * away - 3.0 * gain + turn

    @lanewise
    def put_on(c: Curve, t: Lane, b: Point, s: Scales, o: Outcome):
        """Put points on a curve, and correct them until the rates there are theirs.

        The last correction, which changes no rates, is applied. Other branches are far from a
        smooth curve but at singular configurations, which `complete` finds.
        """
        iterations: LaneInt = 0
        is_off: LaneBool = True
        has_crossed: LaneBool = False
        b.t = t
        way = (t - c.t) / c.h
        for i in range(N):
            high = c.third[i] + way * (c.fourth[i] + way * c.fifth[i])
            b.q[i] = c.place[i] + way * (c.first[i] + way * (c.second[i] + way * high))
        for correction in range(CURVE_CORRECTIONS):
            if not any_lane(is_off):
                break
            o.status = CONVERGED
            complete(b, s, o)
            change = solve(b, b.Phi)
            is_off = False
            for i in range(N):
                allowed = ON_CURVE * s.reference[i] + ROUNDING * abs(b.q[i])
                b.q[i] -= change[i]
                is_off = is_off | ~(abs(change[i]) <= allowed)
            iterations += 1
        for i in range(BLOCKS):
            before = c.determinants[i]
            stays = b.determinants[i] > 0.0 if before > 0.0 else b.determinants[i] < 0.0
            has_crossed = has_crossed | ~stays
        o.iterations = iterations
        o.status = where(is_off | has_crossed, NOT_CONVERGED, o.status)

    def fill(
        m: Variants, b: Point, s: Scales, at: State, between: Point, done: Count, good: Count
    ) -> Count:
        """Take a good point from lane to lane, and write the points on the way there.

        The lanes are LANES times apart. Return to how many the curves led.
        """
        c = Curve()
        o = Outcome()
        for k in range(good):
            lay(c, at, b, k)
            put_on(c, part(m.t, done + k * LANES), between, s, o, lanes=LANES)
            for n in lanes(LANES):
                if o.status[n] != CONVERGED:
                    return k
            record(m, between, o, 0, done + k * LANES, LANES)
            take_up(at, b, k)
        return good


def march(m: Variants) -> Count:
    """Follow one motion; return how many points converged, from the first one on.

    The lanes are times of the motion, as if each were a variant at its own: all have the same
    parameters, and what is written for a variant is the time's.
    """
    b = Point()
    s = Scales()
    o = Outcome()
    at = State()
    assemble(m, b, s, 0, LANES, o)
    record(m, b, o, 0, 0, 1)
    take_up(at, b, 0)
    status: Int = o.status[0]
    done: Count = 1 if status == CONVERGED else 0
    width: Count = 1
    if HAS_LANES:
        between = Point()
        constants(between, lanes=LANES)
        keep(between, b)
    while status == CONVERGED and done < m.count:
        count = min(m.count - done, width)
        good: Count = 0
        if HAS_LANES:
            # Where points are dense the lanes are farther apart, with curves between them.
            stride: Count = LANES if count > LANES else 1
            count = count // stride
            for k in lanes(count):
                between.t[k] = m.t[done + (k + 1) * stride - 1]
        put_at(b, at, 0, count)
        step(b, s, between.t if HAS_LANES else part(m.t, done), o, lanes=count)
        while good < count and o.status[good] == CONVERGED:
            good += 1
        if HAS_LANES:  # noqa: SIM102
            if stride > 1:
                good = fill(m, b, s, at, between, done, good)
        if good > 0:
            if HAS_LANES:
                if stride == 1:
                    record(m, b, o, 0, done, good)
            else:
                record(m, b, o, 0, done, good)
            take_up(at, b, good - 1)
            done += good * stride if HAS_LANES else good
            # The fewer iterations, the more points the next prediction can serve.
            if good < count or o.iterations[good - 1] > 3:
                width = good // 2 if good > 1 else 1
                if HAS_LANES:
                    width = max(width, good * stride // 2)
            elif HAS_LANES:
                # A curve over as many points as two corrections lead to needs one.
                is_short = stride > 1 or o.iterations[good - 1] <= 2
                width = min(2 * width, LANES * LANES if is_short else LANES)
            else:
                width = min(2 * width, LANES)
        elif (count * stride if HAS_LANES else count) > 1:
            width = 1
        else:
            advance(b, s, at, m.t[done], 0, o)
            record(m, b, o, 0, done, 1)
            status = o.status[0]
            if status == CONVERGED:
                done += 1
    for k in range(done + 1, m.count):
        m.status[k] = NOT_REACHED
    return done


def set_out(m: Variants, b: Point, at: State, s: Scales) -> Int:
    """Assemble a motion that is followed one time after the other; return the status.

    The good point is then the one at the first time.
    """
    o = Outcome()
    assemble(m, b, s, 0, 1, o)
    take_up(at, b, 0)
    return o.status[0]


def go_on(b: Point, at: State, s: Scales, t: Real, p: Row[K]) -> Int:
    """Take a good point to a time, with parameters near its own; return the status.

    Where one step does not lead there, it goes with its own parameters, in sub-steps, and takes the
    others then. A point that does not get there stays where it is.
    """
    o = Outcome()
    o.is_over[0] = False
    put_at(b, at, 0, 1)
    has_own: Bool = True
    for i in range(K):
        has_own = has_own and p[i] == b.p[i][0]
        b.p[i][0] = p[i]
    step(b, s, t, o, lanes=1)
    if o.status[0] != CONVERGED:
        way = State()
        put_at(b, at, 0, 1)
        take_up(way, b, 0)
        advance(b, s, way, t, 0, o)
        if o.status[0] == CONVERGED and not has_own:
            for i in range(K):
                b.p[i][0] = p[i]
            step(b, s, t, o, lanes=1)
    if o.status[0] == CONVERGED:
        take_up(at, b, 0)
    return o.status[0]


def put_to_rest(m: Variants, b: Point, o: Outcome, first: Count, count: Count):
    """Let the variants that failed at a time rest at the guess, where they disturb no others."""
    for k in lanes(count):
        if o.is_over[k]:
            o.status[k] = NOT_REACHED
            o.iterations[k] = 0
        if o.status[k] != CONVERGED:
            o.is_over[k] = True
            for i in range(N):
                b.q[i][k] = m.guess[i, first + k]
                b.q_dot[i][k] = 0.0
                b.q_ddot[i][k] = 0.0


def follow_variants(m: Variants, farthest: Real) -> Count:
    """Follow the motions of variants; return how many converged at all times.

    One that is assembled with an angle that is farther from its guess is not followed.
    """
    b = Point()
    before = Point()
    s = Scales()
    o = Outcome()
    at = State()
    good: Count = 0
    for first in range(0, m.variants, LANES):
        count = min(m.variants - first, LANES)
        assemble(m, b, s, first, count, o)
        put_to_rest(m, b, o, first, count)
        record(m, b, o, 0, first, count)
        for k in lanes(count):
            for i in range(N):
                if MAY_TURN[i] and abs(b.q[i][k] - m.guess[i, first + k]) > farthest:
                    o.status[k] = NOT_REACHED
        put_to_rest(m, b, o, first, count)
        for time in range(1, m.count):
            is_going: Bool = False
            for k in lanes(count):
                is_going = is_going or not o.is_over[k]
            if is_going:
                keep(before, b)
                t: Lane = m.t[time]
                step(b, s, t, o, lanes=count)
                for k in lanes(count):
                    if o.status[k] != CONVERGED and not o.is_over[k]:
                        take_up(at, before, k)
                        advance(b, s, at, m.t[time], k, o)
            put_to_rest(m, b, o, first, count)
            record(m, b, o, time, first, count)
        for k in lanes(count):
            if not o.is_over[k]:
                good += 1
    return good


def march_variants(m: Variants) -> Count:
    """Follow the motions of variants; return how many converged at all times."""
    return follow_variants(m, INFINITE)
