r"""A whole time grid at once: a coarse march, interpolation, and Newton on all points together.

Between two points of the coarse march every coordinate is interpolated by the polynomial of fifth
degree through :math:`q, \dot q, \ddot q` at both ends (Hermite). That is so near that the first
correction already leaves rounding errors, and the second shows it. Nothing is taken on trust: a
point counts only if its corrections became small, its equations hold, it stayed near the
interpolation, and the determinant of every block of Phi_q kept its sign.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import SMALLEST_DETERMINANT
from kincompile.runtime.coarse import Node, coarse_march
from kincompile.runtime.engine.lanes import LaneCode
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.march import March
from kincompile.runtime.problem import largest, within

if TYPE_CHECKING:
    from typing import TypeAlias

    from numpy.typing import NDArray

    from kincompile.runtime.march import State

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


def solve_grid(march: March, times: Array, first: State, result: GridResult) -> int:
    """Solve as much of a time grid as can be trusted, into the arrays of `result`.

    Parameters
    ----------
    march
        That of a module with a planned solve.
    times : ndarray, shape (N,)
        The grid.
    first
        The point at its start.

    Returns
    -------
    int
        Number of points in the coarse march.
    """
    equations, code = march.equations, march.equations.code
    assert code.lanes is not None
    spread = equations.spread(first.point.q)
    floats = LaneCode(code, code.lanes.floats, equations.p.tolist())
    q, q_dot, q_ddot = (x.tolist() for x in (first.point.q, first.q_dot, first.q_ddot))
    node = Node(0, q, q_dot, q_ddot, first.determinants.tolist())
    nodes = coarse_march(floats, node, times, spread.tolist(), march.tolerance)
    reached = nodes[-1].index + 1
    _interpolate(nodes, times[:reached], result.q)
    signed = np.array([node.determinants for node in nodes])
    smallest = np.copysign(SMALLEST_DETERMINANT * np.max(np.abs(signed), axis=0), signed[0])
    batch = March(equations, Planned(code, equations.p), march.tolerance)
    parts = max(1, round(reached / BLOCK))
    edges = np.linspace(0, reached, parts + 1).astype(int).tolist()
    for start, stop in itertools.pairwise(edges):
        _solve_block(batch, times[start:stop], result, slice(start, stop), smallest, spread)
    return len(nodes)


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
    march: March, t: Array, result: GridResult, block: slice, smallest: Array, spread: Array
) -> None:
    """Correct a block of interpolated positions twice, and solve for velocity and acceleration."""
    interpolated, engine = result.q[:, block], march.engine
    assert isinstance(engine, Planned)
    found = march.correct(interpolated, t, CORRECTIONS_ON_GRID)
    point = found.point
    q_dot, q_ddot = result.q_dot[:, block], result.q_ddot[:, block]
    engine.put_rates(point, q_dot, q_ddot)
    interpolated -= point.q
    good = found.good & within(interpolated, LARGEST_DISPLACEMENT * spread)
    interpolated[:] = point.q
    for values, least in zip(engine.determinants(point, point), smallest, strict=True):
        good = good & (values / least > 1)
    result.residual[block] = largest(point.Phi, t.size)
    result.good[block] = good & np.isfinite(sum(q_dot) + sum(q_ddot))
