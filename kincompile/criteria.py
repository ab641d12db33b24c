"""By what numbers are judged: converged, assembled, near singular, on the branch.

One set for all that computes: the runtime, the emitted C and the page's JavaScript (which get these
numbers through their templates), the rank analysis and the checker. Nothing is absolute. A
coordinate is compared with its own scale (1 rad, or the size of the mechanism), an equation with
what its terms contribute at those scales. So no system of units is judged otherwise.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Sizes

WILD = 1e3
"""A coordinate beyond this many references is an iterate gone wild, not a larger scale."""

STEEP = 1e6
"""An equation this much steeper than at a generic position is near a pole. Its scale is then that
of the generic position, so that a vanishing step at tan(pi/2) is not taken for a root."""

# Converged

TOLERANCE = 1e-10
"""Correction, in scales of the coordinates, at which Newton's method stops: convergence is
quadratic, so that what is left is a rounding error."""

STEP_TOLERANCE = 1e-9
"""Relative tolerance of a step of a simulation."""

LAST_CORRECTION = 1e-11
"""Correction, in scales, up to which Phi_q before it serves velocity and acceleration after it."""

ROUNDING = 16 * float(np.finfo(np.float64).eps)
"""Part of a coordinate, or of the terms of an equation, below which floating point has no more to
give."""

SLIGHT = 1e-6
"""Part of a whole that is nothing where it was worked out by differences, roots or ranks."""

FARTHEST = SLIGHT / ROUNDING
"""Distance from zero, in scales, up to which coordinates loosen the equations by what rounding
leaves of them: what is left of more is no position, and a guess may stand anywhere."""

MAX_ITERATIONS = 25
"""Iterations from a guess after which an attempt is given up."""

MAX_CORRECTIONS = 6
"""Iterations from a prediction after which it is given up; a good one takes three."""

MAX_SHORTEST = 60
"""Shortest steps after which an attempt is given up: one moves nothing by more than a scale."""

# Assembled

NEAR_ANGLE, NEAR_PART = math.pi / 6, 0.1
"""A guess is near an assembly where angles are no further off than the first, and lengths than this
part of the size of the mechanism: then no other assembly may come before it."""

SETTLED = 0.5
"""Part of that distance up to which an assembly is not asked whether another one is nearer."""

ASTRAY = 5.0
"""Distance from a guess, in those up to which it is near, beyond which steps went astray: half the
size of the mechanism."""

THROWN = 10.0
"""Distance from a guess, in those up to which it is near, beyond which an iterate is thrown so far
that rounding errors decide where the next ones end."""

AS_NEAR = 1.1
"""How much further from a guess an assembly may be, and still be named as one that is as near."""

MIRRORED = 2.0
"""How much further than the first assembly another one may seem to be, and still be looked at: what
tells of it is of first order."""

MOST_MIRRORED = 300
"""Coordinates up to which the assembly on the other side of a singular position is looked for:
beyond, singular values take a tenth of a second."""

MIRROR_STEP = 1e-5
"""Step of the difference that shows how a singular value changes, in distances of a near guess."""

FAR = math.pi / 4
"""Angle between a guess and a position beyond which small steps from the guess may well lead to a
nearer one. Of 3000 guesses within 30 degrees and a tenth of a length of an assembly Newton's own
steps miss 21, and end 56 degrees away and more."""

RESIDUAL_FACTOR = 10.0
"""How much larger than the tolerance, relative to its terms, a residual may be at the end."""

ASSEMBLED = RESIDUAL_FACTOR * TOLERANCE
"""Residual, relative to its terms, of an assembled position."""

SOLVED = 1e-10
"""Part of its terms by which an equation of Phi_q x = b may miss its right side: what elimination
leaves of it up to the sensitivity from which rates are uncertain. Terms are those of the
equation's own coefficients and the largest component of x, in scales."""

ON_CURVE = 1e-13
"""Correction, in scales, of a point on a curve between two others, up to which its velocity and
acceleration are those of the corrected position."""

CURVE_CORRECTIONS = 3
"""Corrections after which a point that is still not on its curve is left to the march."""

AGREEMENT = 1e-6
"""Part of the terms by which redundant equations may contradict each other in the rates."""

RANK = 1e-9
"""Singular value of Phi_q in scales, relative to the largest, that is zero."""

# Differences

FIRST_DIFFERENCE, SECOND_DIFFERENCE = 1e-5, 1e-4
"""Parts of a line or a span over which differences give first and second derivatives."""

COMPLEX_STEP = 1e-30
"""Of a derivative: no difference is taken, and its square is lost in every number."""

# Zero

TINY = 1e-300
"""In place of nothing, where it is divided by."""

NOISE = 1e-12
"""Part of the terms of a sum, or of the largest number of a kind, that is a rounding error."""

STILL = 1e-11
"""Movement, relative to the largest number of the same unit, that is a rounding error."""

ZERO = 1e-9
"""Part of a whole that is nothing: of the terms of a sum at a random state, of the forces that act,
of the largest residual, of a movement."""

HALF = 1e-8
"""Part of a number that leaves half of its digits: up to it two that were solved for agree."""

SAME = 1e-7
"""Part of the largest up to which a motion repeats itself, and forces of a motion balance."""

NEAR_MISS = 1e-3
"""What equations are missed by, relative to their terms, where they may hold after all."""

# Near singular. Sensitivity: movement, in scales, for an error of one scale in the equations

SINGULAR_SENSITIVITY = 1e7
"""Beyond this rounding has taken half of the digits of q, and a double root cannot be
distinguished from two roots."""

TOO_NEAR = 1e5
"""Beyond this the rates of a sub-step are too uncertain to go on from: a bifurcation is approached
to 1e-5 of the way, a lock-up, whose sensitivity grows as a root, to 1e-10."""

NEARLY_SINGULAR = 30.0
"""From this on two branches may be so near each other that Newton confuses them."""

SMALLEST_DETERMINANT = 1e-5
"""Determinant of a block, relative to the largest along the motion, below which a point that was
not looked at closely is not trusted."""

FOLDED = 1e-9
"""Determinant of a block at the guess, beside that at the assembled position, up to which the guess
shows no branch: bodies without a guess lie on one line."""

LOST = 1e-3
"""Singular value of Phi_q in scales, relative to the largest, that explains why a motion ended: it
falls as the square root of the time that is left."""

SAFE_PIVOT, KEPT_PIVOT = 1e-3, 0.1
"""Size of a plain number, relative to the largest of its row, from which on it is a pivot, and of a
pivot, relative to the largest of its column, from which on it stays where it is."""

SAME_DETERMINANT = 0.5
"""Part of a determinant down to which Phi_q counts as no nearer to singular."""

LARGEST_POWER = 600.0
"""Power of e beyond which no determinant is given: floating point ends at 709."""

# Near singular, in a simulation

ACROSS, ACROSS_LATER, ACROSS_LEFT = 0.1, 0.7, 1e-5
"""Movement, in scales, to a singular configuration from which a step across it is tried; part of
its time after which that is tried again; movement from which the motion ends where none was."""

ORDINARY = 0.5
"""Part of the time to a singular configuration up to which an ordinary step may be long."""

FORESEEN, NEARLY, SHORT, IMAGINARY = 0.8, 1e-4, 0.99, 0.3
"""Part of the way to it from which its time is foreseen once more; part of a step from which one
look more gives that time; part of the way that is gone for it: at it there is nothing to see.
Imaginary part of a time, relative to its real part, up to which it may yet become real."""

# On the branch. Errors of a prediction are in radians and sizes of the mechanism

SMALL_ERROR, LARGE_ERROR = 0.05, 0.5
"""Errors that are always and never good. Near a lock-up the predicted movement is tens of radians,
and a part of it proves nothing."""

STEEPEST = 1e4
"""Slope of a coordinate by an input of a transmission, in scales, from which its position counts as
singular: nearer ones have rounding errors as large as the last correction."""

LONGEST_PART = 4.0
"""Part of the last way of a transmission's inputs up to which positions are extrapolated by it."""

ALLOWED_PART = 0.25
"""Error, as a part of the predicted movement, that is good in between."""

KINK, SMOOTH = 8.0, 1e-9
"""Just past a bifurcation the other branch is as near as the error of the prediction. It shows in
the velocity: on one branch its error, times the step, is three times that of the position, for
higher orders some more; on the other it is finite however near the position. Below the second
number rounding errors decide."""

KINK_UNSEEN, SMOOTH_UNSEEN = 16.0, 1e-6
"""The same where the sensitivity is not known: looser, as the step is divided by those who know."""

BEYOND = 1e-3
"""Part of a line of parameters beyond its end at which a bifurcation shows, and movement beyond the
end of a motion: there the mechanism can be assembled near by, which beyond a lock-up it cannot."""

# Corners of drivers

CORNER = 1e-9
"""Jump of a velocity, relative to the largest over the times, that is a corner of a driver."""

SAME_TIME = 4 * float(np.finfo(np.float64).eps)
"""How far, relative to the largest, a time may be from a corner and still be the corner's."""

# Steps

SMALLEST_PART = 2.0**-20
"""A step of this part of the distance between two times is not halved again."""

LEFT, GROWN, BEFORE_LOCK_UP = 64.0, 8.0, 1e-4
"""How a march that cannot take its smallest step any more is known to be at a lock-up. Velocities
grow there as one over the root of the time that is left, so that this is q_dot / (2 q_ddot): at
most `LEFT` smallest steps. They have grown `GROWN` times since the time before, and the time to be
reached lies beyond the lock-up by more than the part `BEFORE_LOCK_UP` of the way to it."""

GROWTH, SHORTER, BEFORE = 1.5, 8.0, 0.75
"""Factor by which a step is longer than a good one before it, and shorter at most; part of the way
to the end of growing velocities up to which it goes."""

MAX_SUBSTEPS = 10_000
"""Sub-steps between two times after which the march is given up, about a second."""

PATIENCE = 8
"""Sub-steps after one that was too long before a longer one is tried again."""

OTHER_SIZE = 100.0
"""How many times smaller or larger an equation must have become to be measured again."""

CLOSE, SOON, SLOW = 0.1, 0.1, 0.1
"""Part of the largest sensitivity above which a step that fails is one towards a singularity; of
the time of a movement in which velocities that grow end it soon; and of its largest speed down to
which one coordinate shows how fast all are."""

# Points of a grid together

TARGET_ERROR, LARGEST_ERROR = 0.0006, 0.0015
"""Error of the coarse march's prediction aimed at, in radians or sizes of the mechanism, and above
which a step is not trusted. It falls with the third power of the step, the interpolation's with the
sixth: the first leaves the points of the grid about 1e-6 from their place."""

LEAST_STRIDE, LARGEST_STRIDE = 0.25, 2.0
"""Least and largest factor between two steps of the coarse march."""

LAST_COARSE_CORRECTION = 1e-5
"""Correction, in scales, with which a coarse step ends: the square of it, which is what it leaves,
and what it changes in the rates are below the error of the interpolation."""

LARGEST_DISPLACEMENT = 1e-3
"""Distance from the interpolation, in radians or sizes of the mechanism, that is still trusted."""

# Newton's method from a guess

LARGEST_ANGLE = 0.5
"""Longest safeguarded step of an angle, rad: sine and cosine are still nearly linear over it."""

BEND = 0.01
"""Weight of the gradient in a safeguarded step, for a residual as large as its terms. Of 174 starts
of random four-bars and six-bars that plain Newton fails from, 0.01 rescues 155, 0.1 133, 0.001 149,
and Newton's own direction 100."""

NUDGE, RESTARTS = 0.3, 4
"""How far the first restart is from the guess, in radians and sizes of the mechanism, and how many
there are, each as much further away."""

SAME_POSITION = 1e-6
"""Distance, in radians and sizes of the mechanism, up to which two positions are the same."""

LONGEST_P = 2.0
"""Length above which, as below its inverse, Euler parameters of a guess are divided by it."""

MOST_TURNED = 300
"""Angles up to which each is turned back alone where they do not turn back together."""

SUFFICIENT = 1e-4
"""Armijo's constant: the part of the decrease promised by the linear model that must come true."""

SHORTEST_STEP = 2.0**-20
"""A step shortened to this part without a decrease is at a minimum of the residual."""

ASSEMBLES, FALLING, STATIONARY = 1e-6, 0.9, 0.1
"""Of attempts by many sets: what equations are missed by, relative to their terms, up to which one
may lead to a position; the part of itself to which that must fall over three steps, or it
oscillates around a minimum; and the part of its square by which it would fall at least if equations
were linear: less only at a minimum, since where they can hold it is nearly all."""

TOO_STEEP, INVERSE_ITERATIONS = 1e100, 25
"""Entry of Phi_q with whose square nothing can be solved; iterations that lead to its smallest
singular value."""

DAMPING, LESS_DAMPING, MORE_DAMPING = (1e-13, 1e-3, 1e3), 0.1, 8.0
"""Least, first and largest damping of Levenberg's and Marquardt's steps, in squares of scales, and
its factors after a step that lowers the residual, and after one that does not."""

STALLED = 0.98
"""Part of the square of a residual above which a step that lowers it hardly does."""

# Along the curve of solutions in q and t

LONGEST_ARC, FIRST_ARC, SHORTEST_ARC = 0.05, 0.01, 1e-9
"""Lengths of steps along the curve, in radians and sizes of the mechanism."""

MAX_ARCS = 400
"""Steps after which a search along the curve is given up."""

ARC_CORRECTIONS = 12
"""Newton corrections of a step; four do away from a singular configuration."""

SMALL_CORRECTION, TOLERABLE_CORRECTION = 1e-12, 1e-7
"""Corrections with which a step ends, and that near a bifurcation may remain of rounding errors."""

STRAIGHT = 0.98
"""Cosine of the angle by which the tangent may turn in a step."""

ROOT_LENGTH = 1e-13
"""Length of the piece of curve in which a singular configuration is found."""

AROUND = 2e-3
"""Distance from a bifurcation, in radians and sizes of the mechanism, at which places on the curve
are accurate to ten digits."""

AROUND_OFFSETS = (-2.0, -1.0, 1.0, 2.0)
"""Where the curve is interpolated around a bifurcation, in that distance."""

BESIDE = (0.0, -1e-8, 1e-8, -1e-6, 1e-6, -1e-5)
"""Distances from a lock-up at which a place is looked for: its time is off by their square."""

ROOT_STEPS = 80
"""Looks after which a search for a zero is over; as many halvings as there are bits."""

# Events

INVOLVED = 0.02
"""Part of the largest movement in a null vector from which on a coordinate is involved in it."""

AT_EVENT = 1e-9
"""Part of a time up to which it is that of an event."""

LATE = 1e-6
"""Time after the point that failed, relative to the way to it, up to which an event explains it."""

IN_RANGE = 1e-6
"""Part of nu that the equations cannot give, below which a singular point is no lock-up."""


# float32

IN_FLOAT32 = 1e-5
"""Part of a scale to which float32 must know the coordinates where a motion begins."""

OF_ROUNDING = (
    "AGREEMENT", "SINGULAR_SENSITIVITY", "SLIGHT", "SMALLEST_PART", "SMOOTH", "SOLVED",
    "STEEPEST", "TOLERANCE",
)  # fmt: skip
"""Criteria that say how many of the digits there are must be left, or may be lost."""


def for_float32(name: str) -> float:
    """Return a criterion for numbers of 24 bits: one of digits is the same part of those there are.

    So what is the power 0.6 of float64's rounding error is that power of float32's. Rates may lose
    half of their digits: with a third, as float64's, a delta robot would be near a singular
    position everywhere, at a sensitivity of 400. The Jacobian of a transmission is that before the
    last correction, which is then near what rounding leaves: J has five digits so.
    """
    eps, eps64 = (float(np.finfo(kind).eps) for kind in (np.float32, np.float64))
    match name:
        case "ROUNDING":
            return 16 * eps
        case "LAST_CORRECTION":
            return 2 * for_float32("ROUNDING")
        case "FARTHEST":
            return for_float32("SLIGHT") / for_float32("ROUNDING")
        case "TOO_NEAR":
            return for_float32("SINGULAR_SENSITIVITY")
    value: float = globals()[name]
    power = math.log(eps) / math.log(eps64)
    return float(f"{value**power:.2g}") if name in OF_ROUNDING else value


def size_of(
    evaluate: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
    pattern: NDArray[np.signedinteger[Any]] | None,
    angular: NDArray[np.bool_],
    q: NDArray[np.float64],
) -> float:
    """Return the size of a mechanism as its equations show it, wherever it stands.

    Divided by the derivative with respect to a length, the derivative with respect to an angle is a
    lever arm: the largest one is the size. Where equations have none, it is the distance over which
    their derivatives change by as much as they are. Where even these are constant, any unit serves.

    Parameters
    ----------
    evaluate
        Gives Phi (m,) and the entries of Phi_q, (nnz,), at a position.
    pattern : ndarray of int, shape (nnz, 2)
        Rows and columns of these; None where they are all entries, row by row.
    angular : ndarray of bool, shape (n,)
        Which coordinates are angles.
    q : ndarray, shape (n,)
        A guess, or an assembled position.

    Returns
    -------
    float
        In the unit of the lengths; 0.0 where the equations are linear in them.
    """
    probe = probe_of(q.size)
    Phi, entries = evaluate(q + np.where(angular, probe, 0.0))  # at no special pose
    if pattern is None:
        pattern = np.argwhere(np.ones((Phi.size, q.size)))
    rows, columns = pattern.T
    largest = _largest_of_rows(rows + Phi.size * angular[columns], entries, 2 * Phi.size)
    slopes, arms = largest[: Phi.size], largest[Phi.size :]
    has_length = slopes > 0
    size = _largest(arms[has_length] / slopes[has_length])
    if size:
        return size
    farthest = _largest(q[~angular]) or 1.0
    lengths, step = np.where(angular, 0.0, probe), SMALL_PART * farthest
    near = _bends(evaluate, pattern, q, step * lengths)
    if near.size:
        size = float(np.min(near, where=near > 10 * step, initial=np.inf))
        if size < np.inf:
            generic = _bends(evaluate, pattern, q + size * lengths, step * lengths)
            known = generic[np.isfinite(generic) & (generic > 0)]
            size = known.size / float(np.sum(1 / known)) if known.size else 0.0
        # Nothing is so small beside its place but the distance from a pole.
        size = size if 10 * step < size < np.inf else farthest
    return size


def rounded(values: Any) -> NDArray[np.float64]:
    """Return scales with seven digits: all forms of a module then judge by the same numbers."""
    parts, exponents = np.frexp(values)
    return np.asarray(np.ldexp(np.rint(parts * 2.0**24) / 2.0**24, exponents))


SMALL_PART, CONSTANT = 1e-8, 1e-12
"""Step, as a part of the largest length, over which derivatives are compared, and the part of them
up to which a change is a rounding error."""


def _bends(
    evaluate: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
    pattern: NDArray[np.signedinteger[Any]],
    q: NDArray[np.float64],
    step: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return, of each equation that is not linear, over which distance its derivatives change."""
    Phi, entries = evaluate(q)
    change = np.abs(evaluate(q + step)[1] - entries) / _largest(step)
    bends, slopes = (
        _largest_of_rows(pattern[:, 0], values, Phi.size) for values in (change, entries)
    )
    curved = bends * _largest(step) > CONSTANT * slopes
    bends, slopes, Phi = bends[curved], slopes[curved], np.abs(Phi[curved])
    return np.asarray(np.maximum(slopes / bends, np.sqrt(Phi / bends)))


def _largest_of_rows(rows: Any, entries: NDArray[np.float64], m: int) -> NDArray[np.float64]:
    """Return the largest size of the entries of each row, 0.0 where it has none."""
    largest = np.zeros(m)
    np.maximum.at(largest, rows, np.abs(entries))
    return largest


def _largest(values: NDArray[np.float64]) -> float:
    """Return the largest size of finite values, 0.0 where there is none."""
    sizes = np.abs(values)
    largest = float(sizes.max(initial=0.0))
    return largest if largest < np.inf else float(sizes.max(where=np.isfinite(sizes), initial=0.0))


@cache
def probe_of(n: int) -> NDArray[np.float64]:
    """Return n numbers of size 1/2 to 1 and either sign without a pattern: a quasi-random sequence.

    No null vector of a mechanism can be expected to be orthogonal to them.
    """
    golden = (math.sqrt(5) - 1) / 2
    sequence = np.arange(1, n + 1) * golden % 1
    signs = np.where(sequence * 64 % 2 < 1, 1.0, -1.0)
    probe = np.asarray(signs * (1 + sequence) / 2, dtype=np.float64)
    probe.setflags(write=False)
    return probe
