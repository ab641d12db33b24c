"""The march of a mechanism over a time grid: the text that the solvers of all languages print.

It runs on NumPy (`words.on_numpy`), and `reader.read` reads it. A `Lane` is a number of each of the
points that are worked on together: an array in NumPy and C, a plain number where a language takes
one point at a time. `Rows[N]` are N of them. A `Real` is the same for all. Nothing that differs
from lane to lane decides an `if`: `where` chooses, `any_lane` asks all.

What `IS_CAREFUL` chooses is the march that has the last word, with the rules of the runtime's: it
goes as near to a singular position as rounding lets it. The other one hands over to it.
"""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.words import *


class State(Struct):
    """A good point of a motion."""

    t: Real
    p: Row[K]
    q: Row[N]
    q_dot: Row[N]
    q_ddot: Row[N]
    determinants: Row[BLOCKS]


class Point(Struct):
    """Points, and what the kernels compute there."""

    t: Lane
    p: Rows[K]
    q: Rows[N]
    q_dot: Rows[N]
    q_ddot: Rows[N]
    determinants: Rows[BLOCKS]
    Phi: Rows[M]
    Phi_q: Rows[NONZEROS]
    nu: Rows[M]
    gamma: Rows[M]


class Scales(Struct):
    """By what the numbers of a motion are judged; each point has its own."""

    reference: Rows[N]  # scale of each coordinate: 1 rad, or the size of the mechanism
    inverse: Rows[N]  # and its inverse: a division takes as long as five products
    magnitude: Rows[M]  # what the terms of each equation contribute at a generic position
    noise: Rows[M]  # what rounding errors of the coordinates leave of each equation
    if IS_CAREFUL:
        here: Rows[M]  # what the terms of each equation contribute where a point is
        part: Rows[M]  # of its terms, by which an equation of rates may be missed
    else:
        weight: Rows[M]  # of the square of what an equation of rates misses
    tolerance: Real


class Outcome(Struct):
    """What became of points; those that are over are not looked at any more."""

    status: LaneInt
    iterations: LaneInt
    is_over: LaneBool
    residual: Lane
    sensitivity: Lane
    if IS_CAREFUL:
        is_there: LaneBool  # whether it is a position of the motion, even one without rates
    else:
        by_velocity: Lane  # by how much velocities miss their equations, squared
        by_acceleration: Lane


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


@lanewise
def measure(b: Point, size: Real, s: Scales):
    """Measure the equations of a mechanism around positions, which stay as they are."""
    q = copied(b.q)
    for i in range(N):
        s.reference[i] = 1.0 if ANGULAR[i] else size
        s.inverse[i] = 1.0 / s.reference[i]
        b.q[i] += s.reference[i] * PROBE[i]
    position(b)
    s.magnitude = 0.0
    s.noise = 0.0
    for e in range(NONZEROS):
        i = PATTERN[e][0]
        j = PATTERN[e][1]
        slope = abs(b.Phi_q[e])
        s.magnitude[i] += slope * s.reference[j]
        most = FARTHEST * s.reference[j]
        place = where(abs(q[j]) < most, abs(q[j]), most)
        s.noise[i] += ROUNDING * slope * (s.reference[j] + place)
    for i in range(M):
        allowed = AGREEMENT if IS_REDUNDANT[i] else SOLVED
        if IS_CAREFUL:
            s.part[i] = allowed
        else:
            terms = allowed * s.magnitude[i]
            s.weight[i] = 1.0 / (terms * allowed * s.magnitude[i])
    b.q = q


if IS_CAREFUL:

    @lanewise
    def measure_here(b: Point, s: Scales, scale: Rows[N]):
        """Measure the equations where points are, for scales of the coordinates."""
        for i in range(M):
            s.here[i] = 0.0
        for e in range(NONZEROS):
            i = PATTERN[e][0]
            j = PATTERN[e][1]
            s.here[i] += abs(b.Phi_q[e]) * scale[j]
        for i in range(M):
            # An equation that is so much steeper than at a generic position is beside a pole.
            steepest = STEEP / ROUNDING * s.noise[i]
            here = where(s.here[i] < steepest, s.here[i], steepest)
            s.here[i] = where(here > s.magnitude[i], here, s.magnitude[i])

    @lanewise
    def holds_to_rounding(b: Point, s: Scales) -> LaneBool:
        """Say whether every equation holds as well as floating point permits."""
        scale = rows(N)
        holds: LaneBool = True
        position(b)
        for i in range(N):
            scale[i] = where(abs(b.q[i]) > s.reference[i], abs(b.q[i]), s.reference[i])
        measure_here(b, s, scale)
        for i in range(M):
            holds = holds & (abs(b.Phi[i]) <= ROUNDING * s.here[i])
        return holds

    @lanewise
    def meets_rates(b: Point, s: Scales, speed: Lane, gain: Lane) -> LaneBool:
        """Say whether velocity and acceleration, of these sizes, meet their equations."""
        first = copied(b.nu)
        second = copied(b.gamma)
        is_met: LaneBool = True
        for e in range(NONZEROS):
            i = PATTERN[e][0]
            j = PATTERN[e][1]
            first[i] -= b.Phi_q[e] * b.q_dot[j]
            second[i] -= b.Phi_q[e] * b.q_ddot[j]
        for i in range(M):
            allowed = s.part[i] * s.here[i]
            is_met = is_met & (abs(first[i]) <= allowed * speed)
            is_met = is_met & (abs(second[i]) <= allowed * gain)
        return is_met


@lanewise
def correct(b: Point, s: Scales, most: Int, o: Outcome):
    """Apply corrections until they are small, in scales of the coordinates.

    A point whose corrections are stays where it is.
    """
    going: LaneBool = ~o.is_over
    iterations: LaneInt = 0
    if IS_CAREFUL:
        last: Lane = INFINITE
    for iteration in range(most):
        if not any_lane(going):
            break
        is_large: LaneBool = False
        position(b)
        factor(b)
        change = solve(b, b.Phi)
        if IS_CAREFUL:
            size: Lane = 0.0
        for i in range(N):
            b.q[i] -= where(going, change[i], 0.0)
            allowed = s.tolerance * s.reference[i] + ROUNDING * abs(b.q[i])
            is_large = is_large | ~(abs(change[i]) <= allowed)
            if IS_CAREFUL:
                part_of_scale = abs(change[i]) * s.inverse[i]
                size = where(part_of_scale <= size, size, part_of_scale)
        iterations += going
        going = going & is_large
        if IS_CAREFUL:
            # Near a singular position rounding alone keeps the corrections above any bound.
            stalls = ~(size <= 0.25 * last)
            last = size
            if any_lane(going & stalls):
                going = going & ~(stalls & holds_to_rounding(b, s))
    o.iterations = iterations
    o.status = where(going, NOT_CONVERGED, CONVERGED)


@lanewise
def complete(b: Point, s: Scales, o: Outcome):
    """Check that the equations hold and that Phi_q is regular; solve for the rates.

    These are looked at: elimination with pivots chosen beforehand may lose all digits. They may
    miss their equations by parts of their size, the sum of their components in scales;
    accelerations are measured by the square of the velocities too, which gamma is made of.
    """
    right = rows(M)
    is_off: LaneBool = False
    speed: Lane = 0.0
    gain: Lane = 0.0
    position(b)
    factor(b)
    o.residual = 0.0
    o.sensitivity = 0.0
    if IS_CAREFUL:
        measure_here(b, s, s.reference)
    terms = max(RESIDUAL_FACTOR * s.tolerance, ROUNDING)
    for i in range(M):
        allowed = terms * (s.here[i] if IS_CAREFUL else s.magnitude[i]) + s.noise[i]
        size = abs(b.Phi[i])
        o.residual = where(size > o.residual, size, o.residual)
        is_off = is_off | ~(size <= allowed)
        right[i] = s.magnitude[i] * PROBE[i]
    # A third right side, of the size of the equations' terms, shows how near to singular Phi_q is.
    answer = solve(b, right)
    nu(b)
    b.q_dot = solve(b, b.nu)
    gamma(b)
    b.q_ddot = solve(b, b.gamma)
    for i in range(N):
        moved = abs(answer[i]) * s.inverse[i]
        o.sensitivity = where(moved <= o.sensitivity, o.sensitivity, moved)
        speed += abs(b.q_dot[i]) * s.inverse[i]
        gain += abs(b.q_ddot[i]) * s.inverse[i]
    if IS_CAREFUL:
        first = speed * speed
        second = gain + first
        is_met = meets_rates(b, s, speed, second)
    else:
        missed(b, s.weight, o.by_velocity, o.by_acceleration)
        first = speed * speed
        second = (gain + first) * (gain + first)
        is_met = (o.by_velocity <= first) & (o.by_acceleration <= second)
    found = where(is_met, CONVERGED, SINGULAR)
    found = where(finite(first + second), found, NOT_FINITE)
    if IS_CAREFUL:
        found = where(o.sensitivity <= SINGULAR_SENSITIVITY, found, SINGULAR)
    else:
        found = where(o.sensitivity <= TOO_NEAR, found, SINGULAR)
    found = where(is_off, NOT_CONVERGED, found)
    found = where(finite(o.residual), found, NOT_FINITE)
    o.status = where(o.status == CONVERGED, found, o.status)


@lanewise
def step(b: Point, s: Scales, t: Lane, o: Outcome):
    """Take points from where they are to other times.

    Those that end too far from the prediction q + h q_dot + h^2 q_ddot / 2 have not converged.
    Where the determinant of a block has changed its sign, a singular configuration lies between;
    near one, the velocity must be where it was predicted too, compared with the position's error.
    """
    before = copied(b.determinants)
    h = t - b.t
    b.t = t
    if IS_CAREFUL:
        movement: Lane = 0.0
    for i in range(N):
        if IS_CAREFUL:
            moved = abs(h * (b.q_dot[i] + 0.5 * h * b.q_ddot[i])) * s.inverse[i]
            movement = where(moved > movement, moved, movement)
        b.q[i] += h * (b.q_dot[i] + 0.5 * h * b.q_ddot[i])
        b.q_dot[i] += h * b.q_ddot[i]
    q = copied(b.q)
    q_dot = copied(b.q_dot)
    correct(b, s, MAX_ITERATIONS if IS_CAREFUL else MAX_CORRECTIONS, o)
    complete(b, s, o)
    error: Lane = 0.0
    kink: Lane = 0.0
    has_crossed: LaneBool = False
    for i in range(N):
        apart = abs(b.q[i] - q[i]) * s.inverse[i]
        turn = abs(h * (b.q_dot[i] - q_dot[i])) * s.inverse[i]
        error = where(apart <= error, error, apart)
        kink = where(turn > kink, turn, kink)
    for i in range(BLOCKS):
        stays = where(before[i] > 0.0, b.determinants[i] > 0.0, b.determinants[i] < 0.0)
        has_crossed = has_crossed | ~stays
    is_bent = (o.sensitivity > NEARLY_SINGULAR) & (kink > KINK * error + SMOOTH)
    is_past = is_bent | ((o.status == CONVERGED) & has_crossed)
    if IS_CAREFUL:
        allowed_part = ALLOWED_PART * movement
        allowed = where(allowed_part > SMALL_ERROR, allowed_part, SMALL_ERROR)
        allowed = where(allowed < LARGE_ERROR, allowed, LARGE_ERROR)
        is_position = (o.status != NOT_CONVERGED) & finite(o.residual) & (error <= allowed)
        o.is_there = is_position & ~(is_past & (o.status == CONVERGED))
    o.status = where(
        error <= (allowed if IS_CAREFUL else SMALL_ERROR),
        where(is_past, SINGULAR, o.status),
        NOT_CONVERGED,
    )


def speed_of(b: Point, s: Scales) -> Real:
    """Return the largest velocity of a point, in scales of the coordinates."""
    most: Real = 0.0
    for i in range(N):
        speed = abs(b.q_dot[i][0]) * s.inverse[i][0]
        most = speed if speed > most else most
    return most


def locks_up(b: Point, s: Scales, t: Real, smallest: Real, before: Real) -> Bool:
    """Say whether a point that cannot be left by the smallest step is at a lock-up before a time.

    There the equations must have values. Its speed was that before.
    """
    forward = t - b.t[0]
    speed = speed_of(b, s)
    growth: Real = 0.0
    for i in range(N):
        if abs(b.q_dot[i][0]) * s.inverse[i][0] == speed:
            sign = 1.0 if b.q_dot[i][0] > 0.0 else -1.0
            growth = b.q_ddot[i][0] * s.inverse[i][0] * sign
    left = speed / (2.0 * abs(growth)) if forward * growth > 0.0 else INFINITE
    if not (left <= LEFT * smallest and speed >= GROWN * before):
        return False
    b.t[0] = t
    position(b, lanes=1)
    total: Real = 0.0
    for i in range(M):
        total += b.Phi[i][0]
    return finite(total) and abs(forward) - left > BEFORE_LOCK_UP / SMALLEST_PART * smallest


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
    """Take one lane from a good point to a time, in sub-steps.

    These are halved where they fail and doubled where they do not.
    """
    alone = Point()
    own = Scales()
    found = Outcome()
    constants(alone, lanes=1)
    scales_of(own, s, k)
    found.is_over[0] = False
    put_at(alone, at, 0, 1)
    before = speed_of(alone, own)
    smallest = abs(t - at.t) * SMALLEST_PART
    h: Real = 0.5 * (t - at.t)
    iterations: Int = 0
    is_stuck: Bool = False
    for n in range(MAX_SUBSTEPS):
        is_whole = abs(h) >= abs(t - at.t)
        following = t if is_whole else at.t + h
        put_at(alone, at, 0, 1)
        step(alone, own, following, found, lanes=1)
        is_good = found.status[0] == CONVERGED
        iterations += found.iterations[0]
        if is_good:
            take_up(at, alone, 0)
        is_stuck = not is_good and abs(h) <= smallest
        if is_stuck or (is_good and is_whole):
            break
        h *= 2.0 if is_good else 0.5
    status: Int = found.status[0]
    if status == CONVERGED and at.t != t:
        status = NOT_CONVERGED
    if is_stuck:
        put_at(alone, at, 0, 1)
        if locks_up(alone, own, t, smallest, before):
            status = LOCK_UP
    o.residual[k] = found.residual[0]
    o.status[k] = status
    o.iterations[k] = iterations
    take_up(at, alone, 0)
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
        if o.is_over[k]:
            for i in range(N):
                m.q[i, time, first + k] = NOTHING
                m.q_dot[i, time, first + k] = NOTHING
                m.q_ddot[i, time, first + k] = NOTHING


def assemble(m: Variants, b: Point, s: Scales, first: Count, count: Count, o: Outcome):
    """Assemble variants from their guesses, at the first time."""
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
    correct(b, s, m.max_iterations, o, lanes=count)
    complete(b, s, o, lanes=count)
    # The guess may be rough.
    measure(b, m.size, s, lanes=count)


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
    while status == CONVERGED and done < m.count:
        count = min(m.count - done, width)
        good: Count = 0
        put_at(b, at, 0, count)
        step(b, s, part(m.t, done), o, lanes=count)
        while good < count and o.status[good] == CONVERGED:
            good += 1
        if good > 0:
            record(m, b, o, 0, done, good)
            take_up(at, b, good - 1)
            done += good
            # The fewer iterations, the more points the next prediction can serve.
            if good < count or o.iterations[good - 1] > 3:
                width = good // 2 if good > 1 else 1
            else:
                width = min(2 * width, LANES)
        elif count > 1:
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


def put_to_rest(m: Variants, b: Point, o: Outcome, first: Count, count: Count):
    """Let the variants that failed at a time rest at the guess, where they disturb no others."""
    for k in lanes(count):
        if o.is_over[k]:
            o.status[k] = NOT_REACHED
        if o.status[k] != CONVERGED:
            o.is_over[k] = True
            for i in range(N):
                b.q[i][k] = m.guess[i, first + k]
                b.q_dot[i][k] = 0.0
                b.q_ddot[i][k] = 0.0


def march_variants(m: Variants) -> Count:
    """Follow the motions of variants; return how many converged at all times."""
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
        for time in range(1, m.count):
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
