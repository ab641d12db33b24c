"""A step of the march: the text that the solvers of all languages print. `march` builds on it.

It runs on NumPy (`words.on_numpy`), and `reader.read` reads it. A `Lane` is a number of each of the
points that are worked on together: an array in NumPy and C, a plain number where a language takes
one point at a time. `Rows[N]` are N of them. A `Real` is the same for all. Nothing that differs
from lane to lane decides an `if`: `where` chooses, `any_lane` asks all.

`IS_CAREFUL` chooses the march that has the last word, with the rules of the runtime's: it goes as
near to a singular position as rounding allows. The plain march hands over to it.
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
