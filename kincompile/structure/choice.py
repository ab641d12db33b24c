"""Which equations the solve leaves out where some repeat others.

Equations that are independent at nearly every position may depend on each other at a few, where the
ones left out are what holds the mechanism: the solve would fail there, though nothing is singular.
So the motion is followed with all equations, and of each joint those rows are left out without
which the others stay independent.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import HALF, NOISE
from kincompile.structure.rank import DEPENDENT, damped

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.structure.rank import Array, Evaluate, RankReport

TIMES, ITERATIONS = 32, 8
"""Positions along the motion, and steps of Gauss and Newton to each from the line through two."""

NEAR_ENOUGH = math.sqrt(HALF)
"""Last step to a position, in scales: what it leaves is the square of it."""

BETTER = 4.0
"""How many times farther from dependent another choice must keep the equations to be taken."""


def rows_left_out(
    evaluate: Evaluate, ranks: RankReport, end: float, joints: Iterable[range]
) -> tuple[int, ...]:
    """Return as many rows as are redundant, without which the others are independent.

    They are so from t = 0 to the end, as far as the motion can be followed. `joints` are the rows
    of each joint, of which as many are left out as are redundant.
    """
    null = _left_null_spaces(np.array([matrix for _, matrix in along_motion(evaluate, ranks, end)]))
    chosen = list(ranks.redundant)
    if not len(null):
        return ranks.redundant
    for rows in joints:
        others = [row for row in chosen if row not in rows]
        own = combinations(rows, len(chosen) - len(others))
        options = [others + list(some) for some in own] if len(others) < len(chosen) else []
        margins = [_margin(null, option) for option in options]
        if options and max(margins) > BETTER * _margin(null, chosen):
            chosen = options[margins.index(max(margins))]
    return tuple(sorted(chosen))


def _margin(null: Array, rows: Sequence[int]) -> float:
    """Return how far from dependent the other rows are at the worst position, from 0 to 1."""
    return float(np.linalg.svd(null[:, rows], compute_uv=False)[:, -1].min())


def _left_null_spaces(matrices: Array) -> Array:
    """Return an orthonormal basis of the combinations of rows that vanish, (S, m, m - n).

    Singular positions have more of them, and do not count.
    """
    if not len(matrices):
        return matrices
    u, values, _ = np.linalg.svd(matrices)
    return np.asarray(u[values[:, -1] > DEPENDENT][:, :, matrices.shape[2] :])


def along_motion(
    evaluate: Evaluate, ranks: RankReport, end: float, times: int = TIMES
) -> list[tuple[Array, Array]]:
    """Return q and Phi_q in scales, with rows of length one, as far as it can be followed.

    What no equation determines stays where it is.
    """
    found: list[tuple[Array, Array]] = []
    before, q = ranks.nearest, ranks.nearest
    for t in np.linspace(0, end, times):
        at = 2 * q - before
        for _ in range(ITERATIONS):  # few digits do; `rank`'s steps, to all, double a build
            Phi, Phi_q = (x[0] for x in evaluate(at[np.newaxis], np.array([t])))
            matrix = Phi_q * ranks.scale
            lengths = np.linalg.norm(matrix, axis=1)
            if not np.isfinite(lengths).all() or not lengths.all():
                return found
            matrix = matrix / lengths[:, np.newaxis]
            # so little that only what no equation determines stays
            step = damped(matrix, Phi / lengths, NOISE)
            at = at - ranks.scale * step
            if np.max(np.abs(step)) <= NEAR_ENOUGH:
                break
        else:
            return found
        found.append((at, matrix))
        before, q = q, at
    return found
