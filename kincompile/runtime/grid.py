r"""A whole time grid at once: a coarse march, interpolation, and Newton on all points together.

Between two points of the coarse march every coordinate is interpolated by the polynomial of fifth
degree through :math:`q, \dot q, \ddot q` at both ends (Hermite). That is so near that the first
correction already leaves rounding errors, and the second shows it. Nothing is taken on trust: a
point counts only if its corrections became small, its equations hold, it stayed near the
interpolation, and the determinant of every block of Phi_q kept its sign.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import LAST_CORRECTION, RESIDUAL_FACTOR, ROUNDING, SMALLEST_DETERMINANT
from kincompile.runtime.coarse import Node, coarse_march
from kincompile.runtime.lanes import LaneCode

if TYPE_CHECKING:
    from typing import TypeAlias

    from numpy.typing import NDArray

    from kincompile.runtime.lanes import Lane
    from kincompile.runtime.march import State
    from kincompile.runtime.problem import Problem

    Array: TypeAlias = NDArray[np.float64]

BLOCK = 3000
"""Points at a time, so that intermediate arrays stay in the cache."""

LARGEST_DISPLACEMENT = 1e-3
"""Distance from the interpolation, in radians or sizes of the mechanism, that is still trusted."""

CORRECTIONS_ON_GRID = 2
"""Newton corrections of every point."""


@dataclass(frozen=True, slots=True, eq=False)
class GridResult:
    """What was found on a grid.

    Attributes
    ----------
    q, q_dot, q_ddot : ndarray, shape (n, N)
        The motion; each coordinate is a row.
    residual : ndarray, shape (N,)
        Largest absolute value of Phi at the last position but one, a rounding error away.
    good : ndarray of bool, shape (N,)
        Which points can be trusted.
    """

    q: Array
    q_dot: Array
    q_ddot: Array
    residual: Array
    good: NDArray[np.bool_]


def solve_grid(
    equations: Problem, times: Array, first: State, tolerance: float, result: GridResult
) -> int:
    """Solve as much of a time grid as can be trusted, into the arrays of `result`.

    Parameters
    ----------
    equations
        A module with a planned solve, its parameters and scales.
    times : ndarray, shape (N,)
        The grid.
    first
        The point at its start.
    tolerance
        Bound of the last correction.

    Returns
    -------
    int
        Number of points in the coarse march.
    """
    module, p = equations.module, equations.p.tolist()
    code = LaneCode(module, module.FLOATS, p)
    q = first.point.q.tolist()
    determinants = code.position(q, first.t).determinants
    node = Node(0, q, first.q_dot.tolist(), first.q_ddot.tolist(), determinants)
    spread = equations.spread(first.point.q)
    nodes = coarse_march(code, node, times, spread.tolist(), tolerance)
    reached = nodes[-1].index + 1
    _interpolate(nodes, times[:reached], result.q)
    blocks = [
        math.copysign(SMALLEST_DETERMINANT * max(map(abs, values)), values[0])
        for values in zip(*(node.determinants for node in nodes), strict=True)
    ]
    farthest = np.max(np.abs([node.q for node in nodes]), axis=0)
    limits = _Limits(
        min(tolerance, LAST_CORRECTION) * spread + ROUNDING * farthest,
        LARGEST_DISPLACEMENT * spread,
        RESIDUAL_FACTOR * tolerance * equations.magnitude,
        blocks,
    )
    code = LaneCode(module, module.ARRAYS, p)
    parts = max(1, round(reached / BLOCK))
    edges = np.linspace(0, reached, parts + 1).astype(int).tolist()
    for start, stop in itertools.pairwise(edges):
        _solve_block(code, times[start:stop], result, slice(start, stop), limits)
    return len(nodes)


@dataclass(frozen=True, slots=True)
class _Limits:
    """What a point must keep to be trusted."""

    correction: Array
    displacement: Array
    residual: Array
    determinants: list[float]


def _interpolate(nodes: list[Node], times: Array, q: Array) -> None:
    """Write the Hermite polynomials of fifth degree between the nodes into q, shape (n, N)."""
    index = np.array([node.index for node in nodes])
    at = times[index]
    steps = np.diff(at)
    counts = np.diff(index)
    h = np.repeat(steps, counts)
    s = (times[:-1] - np.repeat(at[:-1], counts)) / h
    basis = _hermite(s)
    data = np.array([(node.q, node.q_dot, node.q_ddot) for node in nodes]).transpose(0, 2, 1)
    powers = np.vander(steps, 3, increasing=True)[:, np.newaxis]
    coefficients = np.concatenate((data[:-1] * powers, data[1:] * powers), axis=2)
    for between, (start, stop) in zip(
        coefficients, itertools.pairwise(index.tolist()), strict=True
    ):
        q[:, start:stop] = between @ basis[:, start:stop]
    q[:, nodes[-1].index] = nodes[-1].q


def _hermite(s: Array) -> Array:
    """Return the basis of quintic Hermite interpolation at s in [0, 1], shape (6, N).

    In the order q, h q_dot, h^2 q_ddot at the left end, then at the right end.
    """
    r = 1 - s
    s3, r3 = s * s * s, r * r * r
    return np.array((
        r3 * (1 + s * (3 + 6 * s)),
        r3 * s * (1 + 3 * s),
        0.5 * r3 * s * s,
        s3 * (1 + r * (3 + 6 * r)),
        -s3 * r * (1 + 3 * r),
        0.5 * s3 * r * r,
    ))  # fmt: skip


def _solve_block(
    code: LaneCode, t: Array, result: GridResult, block: slice, limits: _Limits
) -> None:
    """Correct a block of interpolated positions twice, and solve for velocity and acceleration."""
    q = result.q[:, block]
    good = result.good[block]
    good[:] = True
    at = code.position(q, t)
    for row, change, limit in zip(
        q, code.solve(at, at.Phi), limits.displacement.tolist(), strict=True
    ):
        row -= change
        if not _squared(change) <= limit**2:
            good &= np.abs(change) <= limit
    at = code.position(q, t)
    changes = code.solve(at, at.Phi)
    for row, change, limit in zip(q, changes, limits.correction.tolist(), strict=True):
        row -= change
        if not _squared(change) <= limit**2:
            good &= np.abs(change) <= limit
    residual = result.residual[block]
    residual[:] = 0.0
    for value, limit in zip(at.Phi, limits.residual.tolist(), strict=True):
        size = np.abs(value)
        np.maximum(residual, size, out=residual)
        if not _squared(value) <= limit**2:
            good &= size <= limit
    for value, smallest in zip(at.determinants, limits.determinants, strict=True):
        relative = value / smallest
        if not np.min(relative) > 1:
            good &= relative > 1
    total: Any = 0.0
    for rows, values in zip((result.q_dot, result.q_ddot), code.rates(at, q, t), strict=True):
        for row, value in zip(rows, values, strict=True):
            row[block] = value
            total = total + value
    if not np.isfinite(np.sum(total)):
        good &= np.isfinite(total)


def _squared(lane: Lane) -> Any:
    """Return the sum of the squares of all points of a block.

    Nearly always all points together meet what each must meet, and one number costs less than a
    mask.
    """
    return np.dot(lane, lane)
