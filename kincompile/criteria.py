"""By what numbers are judged: converged, assembled, near singular, on the branch.

One set for all that computes: the runtime, the emitted C and the page's JavaScript (which get these
numbers through their templates), the rank analysis and the checker. Nothing is absolute. A
coordinate is compared with its own scale (1 rad, or the size of the mechanism), an equation with
what its terms contribute at those scales. So no system of units is judged otherwise.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# Sizes

NO_SIZE = 1e-12
"""Lengths up to this are taken for rounding errors of zero; the unit then stands for the size."""

WILD = 1e3
"""A coordinate beyond this many references is an iterate gone wild, not a larger scale."""

STEEP = 1e6
"""An equation this much steeper than at a generic position is beside a pole, where it is measured
by what it is at the generic one: tan(x) at pi/2 is no root, however near one a step says it is."""

# Converged

TOLERANCE = 1e-10
"""Correction, in scales of the coordinates, at which Newton's method stops: convergence is
quadratic, so that what is left is a rounding error."""

LAST_CORRECTION = 1e-11
"""Correction, in scales, up to which Phi_q before it serves velocity and acceleration after it."""

ROUNDING = 16 * float(np.finfo(np.float64).eps)
"""Part of a coordinate, or of the terms of an equation, below which floating point has no more to
give."""

MAX_ITERATIONS = 25
"""Iterations from a guess after which an attempt is given up."""

MAX_CORRECTIONS = 6
"""Iterations from a prediction after which it is given up; a good one takes three."""

# Assembled

RESIDUAL_FACTOR = 10.0
"""How much larger than the tolerance, relative to its terms, a residual may be at the end."""

ASSEMBLED = RESIDUAL_FACTOR * TOLERANCE
"""Residual, relative to its terms, of an assembled position."""

AGREEMENT = 1e-6
"""Part of the terms by which redundant equations may contradict each other in the rates."""

# Near singular. Sensitivity: movement, in scales, for an error of one scale in the equations

SINGULAR_SENSITIVITY = 1e7
"""Beyond this rounding has taken half of the digits of q, and a double root cannot be told from two
roots."""

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

# On the branch. Errors of a prediction are in radians and sizes of the mechanism

SMALL_ERROR, LARGE_ERROR = 0.05, 0.5
"""Errors that are always and never good. Near a lock-up the predicted movement is tens of radians,
and a part of it proves nothing."""

ALLOWED_PART = 0.25
"""Error, as a part of the predicted movement, that is good in between."""

KINK, SMOOTH = 8.0, 1e-9
"""Just past a bifurcation the other branch is as near as the error of the prediction. It shows in
the velocity: on one branch its error, times the step, is three times that of the position, for
higher orders some more; on the other it is finite however near the position. Below the second
number rounding errors decide."""

KINK_UNSEEN, SMOOTH_UNSEEN = 16.0, 1e-6
"""The same where the sensitivity is not known: looser, as the step is divided by those who know."""

# Corners of drivers

CORNER = 1e-9
"""Jump of a velocity, relative to the largest over the times, that is a corner of a driver."""

SAME_TIME = 4 * float(np.finfo(np.float64).eps)
"""How far, relative to the largest, a time may be from a corner and still be the corner's."""

# Steps

SMALLEST_PART = 2.0**-20
"""A step of this part of the distance between two times is not halved again."""

MAX_SUBSTEPS = 10_000
"""Sub-steps between two times after which the march is given up, about a second."""


def size_of(angular: NDArray[np.bool_], *positions: ArrayLike) -> float:
    """Return the size of a mechanism: the largest length in its positions, 0.0 where none has one.

    Parameters
    ----------
    angular : ndarray of bool, shape (n,)
        Which coordinates are angles.
    *positions : array_like, shape (n,)
        Guesses and assembled positions.
    """
    size = float(np.max(np.abs(np.where(angular, 0.0, np.asarray(positions))), initial=0.0))
    return size if size > NO_SIZE else 0.0


def probe_of(n: int) -> NDArray[np.float64]:
    """Return n numbers of size 1/2 to 1 and either sign without a pattern: a quasi-random sequence.

    No null vector of a mechanism can be expected to be orthogonal to them.
    """
    golden = (math.sqrt(5) - 1) / 2
    sequence = np.arange(1, n + 1) * golden % 1
    signs = np.where(sequence * 64 % 2 < 1, 1.0, -1.0)
    return np.asarray(signs * (1 + sequence) / 2, dtype=np.float64)
