r"""A whole time grid at once: a coarse march, interpolation, and Newton on all points together.

The coarse march takes the same steps as `march.advance`, as far apart as the prediction is good, on
plain floats and with the planned solve, so that one costs as much as a few calls of NumPy. It takes
no decision of its own: where anything is out of the ordinary it stops, and the careful march goes
on.

Between two of its points every coordinate is interpolated by the polynomial of fifth degree through
:math:`q, \dot q, \ddot q` at both ends (Hermite). That is so near that the first correction already
leaves rounding errors, and the second shows it. Nothing is taken on trust: a point counts only if
its corrections became small, its equations hold, it stayed near the interpolation, and the
determinant of every block of Phi_q kept its sign.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import (
    LARGEST_ERROR,
    LARGEST_STRIDE,
    LEAST_STRIDE,
    NOISE,
    SMALLEST_DETERMINANT,
    TARGET_ERROR,
)
from kincompile.runtime.engine.linear import Planned
from kincompile.runtime.march import March, Node, coarse_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.march import State

BLOCK = 45_000
"""Coordinates of points at a time: enough for the cost of a call not to count, few enough for the
intermediate arrays to stay in the cache."""

SMALLEST_STEP_COUNT = 8
"""No coarse step is longer than this part of the grid."""

HERMITE = np.array([
    [1, 0, 0, -10, 15, -6], [0, 1, 0, -6, 8, -3], [0, 0, 0.5, -1.5, 1.5, -0.5],
    [0, 0, 0, 10, -15, 6], [0, 0, 0, -4, 7, -3], [0, 0, 0, 0.5, -1, 0.5],
])  # fmt: skip
"""The basis of quintic Hermite interpolation over [0, 1], in powers of s: rows for q, h q_dot and
h^2 q_ddot at the left end, then at the right end."""


def solve_grid(
    march: March,
    times: Array,
    first: State,
    states: Array,
    residual: Array,
    good: NDArray[np.bool_],
) -> int:
    """Solve as much of a grid of times (N,) as can be trusted, into arrays.

    `first` is the point at its start. Filled are `states` (3, n, N) with position, velocity and
    acceleration, the largest absolute values of Phi (N,) at the last positions but one, a rounding
    error away, and which points are good (N,). Returns the number of points in the coarse march.
    """
    equations, code = march.equations, march.equations.code
    assert code.lanes is not None
    reference = equations.reference
    floats = Planned(code, equations.p.tolist(), code.lanes.floats)
    q, q_dot, q_ddot, determinants = (
        x.tolist() for x in (first.point.q, first.q_dot, first.q_ddot, first.determinants)
    )
    if code.redundant:  # the careful march has one determinant, of all equations
        start = floats.evaluate(q, float(times[0]))
        floats.factor(start)
        determinants = list(start.factors[1])
    node = Node(0, q, q_dot, q_ddot, determinants)
    nodes = _coarse_march(floats, node, times, (1 / reference).tolist())
    reached = nodes[-1].index + 1
    _interpolate(nodes, times[:reached], states[0])
    signed = np.array([node.determinants for node in nodes])
    smallest = np.copysign(SMALLEST_DETERMINANT * np.max(np.abs(signed), axis=0), signed[0])
    batch = March(equations, Planned(code, equations.p), march.tolerance)
    parts = max(1, round(reached * reference.size / BLOCK))
    edges = np.linspace(0, reached, parts + 1).astype(int).tolist()
    for start, stop in itertools.pairwise(edges):
        part = slice(start, stop)
        found = states[..., part], residual[part]
        good[part] = batch.solve_together(times[part], *found, smallest)
    return len(nodes)


def _coarse_march(
    engine: Planned, first: Node, times: Array, per_scale: Sequence[float]
) -> list[Node]:
    """Follow the motion over a time grid in as few steps as the prediction allows.

    Returns nodes from `first` to the last point of the grid, or to the last that could be trusted.
    """
    nodes, last = [first], len(times) - 1
    longest = max(1, last // SMALLEST_STEP_COUNT)
    stride = max(1, min(longest, last // 64))
    while nodes[-1].index < last:
        node = nodes[-1]
        index = min(node.index + stride, last)
        try:
            step = coarse_step(engine, node, index, times, per_scale)
        except (ArithmeticError, ValueError):
            step = None
        error = LARGEST_ERROR * 8 if step is None else step[1]
        if step is not None and error <= LARGEST_ERROR:
            nodes.append(step[0])
        elif stride == 1:
            break
        ratio = (TARGET_ERROR / max(error, NOISE)) ** (1 / 3)
        ratio = min(LARGEST_STRIDE, max(LEAST_STRIDE, ratio))
        stride = max(1, min(longest, int((index - node.index) * ratio)))
    return nodes


def _interpolate(nodes: list[Node], times: Array, q: Array) -> None:
    """Write the Hermite polynomials of fifth degree between the nodes into q, shape (n, N)."""
    index = np.array([node.index for node in nodes])
    at = times[index]
    steps = np.diff(at)
    counts = np.diff(index)
    h = np.repeat(steps, counts)
    s = (times[:-1] - np.repeat(at[:-1], counts)) / h
    basis = np.ones((len(HERMITE), s.size))
    for power, following in itertools.pairwise(basis):
        np.multiply(power, s, out=following)
    data = np.array([(node.q, node.q_dot, node.q_ddot) for node in nodes]).transpose(0, 2, 1)
    powers = np.vander(steps, 3, increasing=True)[:, np.newaxis]
    coefficients = np.concatenate((data[:-1] * powers, data[1:] * powers), axis=2) @ HERMITE
    for between, (start, stop) in zip(
        coefficients, itertools.pairwise(index.tolist()), strict=True
    ):
        np.matmul(between, basis[:, start:stop], out=q[:, start:stop])
    q[:, nodes[-1].index] = nodes[-1].q
