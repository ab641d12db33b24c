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
import math
from dataclasses import dataclass
from operator import mul, sub
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    KINK_UNSEEN,
    LARGEST_DISPLACEMENT,
    LARGEST_ERROR,
    LARGEST_STRIDE,
    LAST_COARSE_CORRECTION,
    LEAST_STRIDE,
    MAX_CORRECTIONS,
    NOISE,
    SMALLEST_DETERMINANT,
    SMOOTH_UNSEEN,
    TARGET_ERROR,
)
from kincompile.runtime.engine.linear import Planned
from kincompile.runtime.march import March, largest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.engine.linear import Lanes
    from kincompile.runtime.march import State

BLOCK = 45_000
"""Coordinates of points at a time: enough for the cost of a call not to count, few enough for the
intermediate arrays to stay in the cache."""

CORRECTIONS_ON_GRID = 2
"""Newton corrections of every point."""

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
    node = _Node(0, q, q_dot, q_ddot, determinants)
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
        found = states[..., part], residual[part], good[part]
        _solve_block(batch, times[part], *found, smallest)
    return len(nodes)


@dataclass(frozen=True, slots=True)
class _Node:
    """A point of the coarse march: its number in the time grid, and floats."""

    index: int
    q: Lanes
    q_dot: Lanes
    q_ddot: Lanes
    determinants: Lanes


def _coarse_march(
    engine: Planned, first: _Node, times: Array, per_scale: Sequence[float]
) -> list[_Node]:
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
            step = _coarse_step(engine, node, index, times, per_scale)
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


def _coarse_step(
    engine: Planned, node: _Node, index: int, times: Array, per_scale: Sequence[float]
) -> tuple[_Node, float] | None:
    """Return the point at `index` and the error of its prediction; None without convergence."""
    t = float(times[index])
    h = t - float(times[node.index])
    half = 0.5 * h
    predicted = [
        x + h * (v + half * a) for x, v, a in zip(node.q, node.q_dot, node.q_ddot, strict=True)
    ]
    q: Any = predicted
    for _ in range(MAX_CORRECTIONS):
        point = engine.evaluate(q, t)
        correction = engine.solve(point, point.Phi)
        q = list(map(sub, q, correction))
        if max(map(abs, map(mul, correction, per_scale))) <= LAST_COARSE_CORRECTION:
            break
    else:
        return None
    point.q = q
    _, q_dot, _, q_ddot = engine.velocity_and_acceleration(point)
    determinants = point.factors[1]
    if not math.isfinite(sum(q_ddot)):
        return None
    if any(x * y <= 0 for x, y in zip(determinants, node.determinants, strict=True)):
        return None
    error = max(map(abs, map(mul, map(sub, q, predicted), per_scale)))
    rates = zip(q_dot, node.q_dot, node.q_ddot, per_scale, strict=True)
    kink = abs(h) * max([abs(w - v - h * a) * s for w, v, a, s in rates])
    if kink > KINK_UNSEEN * (error + SMOOTH_UNSEEN):
        return None
    return _Node(index, q, q_dot, q_ddot, determinants), error


def _interpolate(nodes: list[_Node], times: Array, q: Array) -> None:
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


def _solve_block(
    march: March,
    t: Array,
    states: Array,
    residual: Array,
    trusted: NDArray[np.bool_],
    smallest: Array,
) -> None:
    """Correct a block of interpolated positions twice, and solve for velocity and acceleration."""
    engine, (q, q_dot, q_ddot) = march.engine, states
    assert isinstance(engine, Planned)
    found = march.correct_together(q, t, CORRECTIONS_ON_GRID, LARGEST_DISPLACEMENT)
    point, good = found.point, found.good
    residual[:] = largest(point.Phi, t.size)
    rates = engine.rates(point, None, (q_dot, q_ddot))
    for values, least in zip(point.factors[1], smallest, strict=True):
        good = good & (values / least > 1)
    trusted[:] = good & engine.meet(march.equations, point, rates)
