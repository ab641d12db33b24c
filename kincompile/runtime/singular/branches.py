r"""The branch of a motion: the signs of the determinants of the structural blocks of Phi_q.

Two assembled positions of a mechanism that differ in a sign cannot be reached from each other
without passing a singular configuration. The planned solve of a module, in one piece or in stages,
has the determinants at hand. Where redundant equations forbid one, the determinant of the
equations' independent combinations takes their place: these turn slowly along a motion, and are
those of the point before.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kincompile.runtime.lanes import LaneCode, has_planned_solve
from kincompile.runtime.staged import StagedSolver, is_staged

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.problem import Problem, Vector

    Signs = NDArray[np.int8]

BLOCK = 2048
"""Points at a time, so that intermediate arrays stay in the cache."""


def determinants(
    equations: Problem, at: tuple[Vector, float, Vector], reference: Vector
) -> list[float]:
    """Return the determinants of the blocks at a position.

    Parameters
    ----------
    equations
        A module with its parameters set.
    at
        The position q, the time and Phi_q there.
    reference : ndarray, shape (m, n)
        Phi_q at a point near by: where there are no blocks, one determinant is given, relative to
        that point's.
    """
    q, t, Phi_q = at
    if has_planned_solve(equations.module):
        module, p = equations.module, equations.p.tolist()
        try:
            found = LaneCode(module, module.FLOATS, p).position(q.tolist(), t).determinants
        except ArithmeticError:  # floats refuse 1/0 in the factors of a singular block
            found = LaneCode(module, module.ARRAYS, p).position(q[:, np.newaxis], t).determinants
        return [float(np.ravel(value)[0]) for value in found]
    if equations.staged is not None:
        entries = tuple(equations.module.PATTERN.T)
        return _staged(equations.staged, Phi_q[entries], reference[entries])
    if reference.shape[0] != reference.shape[1]:
        basis = np.linalg.svd(reference, full_matrices=False)[0].T
        Phi_q, reference = basis @ Phi_q, basis @ reference
    sign, size = np.linalg.slogdet(Phi_q)
    sign_there, size_there = np.linalg.slogdet(reference)
    return [float(sign * sign_there * math.exp(min(size - size_there, 700.0)))]


def signs(equations: Problem, q: Vector, t: float, Phi_q: Vector) -> tuple[float, ...]:
    """Return the signs of the determinants of the blocks; none where equations are redundant."""
    if equations.staged is not None or has_planned_solve(equations.module):
        found = determinants(equations, (q, t, Phi_q), Phi_q)
        return tuple(float(np.sign(value)) for value in found)
    return (float(np.linalg.slogdet(Phi_q)[0]),) if Phi_q.shape[0] == Phi_q.shape[1] else ()


def _staged(solver: StagedSolver, nonzeros: Vector, reference: Vector) -> list[float]:
    """Return the determinants of a large mechanism's blocks; zeros where it cannot be factored."""
    for entries, part in ((nonzeros, 1.0), (reference, 0.0)):
        try:
            found: list[float] = (part * solver.determinants(solver.factor(entries))).tolist()
        except RuntimeError:
            continue
        return found
    return [0.0]


def turned(equations: Problem, before: Vector, after: Vector) -> bool:
    """Say whether a singular configuration lies between two near Phi_q with redundant equations."""
    if before.shape[0] == before.shape[1]:
        return False
    empty = np.empty(0)
    return determinants(equations, (empty, 0.0, after), before)[0] <= 0


def signatures(module: ModuleType, q: Vector, t: Vector, p: Sequence[float]) -> Signs:
    """Return the signature of every point of a motion, shape (N, blocks); 0 where q is NaN.

    Parameters
    ----------
    module
        The emitted module.
    q : ndarray, shape (N, n)
        Positions.
    t : ndarray, shape (N,)
        Times.
    p
        Parameters.
    """
    with np.errstate(all="ignore"):
        if has_planned_solve(module):
            return _planned(module, q, t, p)
        return _one_by_one(module, q, t, np.asarray(p, dtype=np.float64))


def counted_signatures(q: Vector, t: Vector, passed: Sequence[float]) -> Signs:
    """Return the signature of a motion with redundant equations, shape (N, 1).

    They have no determinant; the sign is that of the start, and changes with every bifurcation.

    Parameters
    ----------
    q : ndarray, shape (N, n)
        Positions; NaN gives 0.
    t : ndarray, shape (N,)
        Times.
    passed
        Times of the bifurcations that were passed.
    """
    way = np.abs(t - t[0])
    count = sum(((way > abs(time - t[0])).astype(int) for time in passed), np.zeros(t.size, int))
    signs = np.where(np.isfinite(q).all(axis=1), 1 - 2 * (count % 2), 0)
    return signs.astype(np.int8)[:, np.newaxis]


def _one_by_one(module: ModuleType, q: Vector, t: Vector, p: Vector) -> Signs:
    """Return the signs of the blocks of a large mechanism, or of the whole determinant."""
    solver = StagedSolver(module) if is_staged(module) else None
    signs: dict[int, Vector] = {}
    for k in np.flatnonzero(np.isfinite(q).all(axis=1)).tolist():
        at = np.ascontiguousarray(q[k]), t[k], p
        if solver is None:
            signs[k] = np.linalg.slogdet(module.Phi_q(*at))[0]
        else:
            nonzeros = module.Phi_q_nonzeros(*at)
            signs[k] = np.sign(_staged(solver, nonzeros, nonzeros))
    blocks = max((np.size(found) for found in signs.values()), default=1)
    result = np.zeros((t.size, blocks), dtype=np.int8)
    for k, found in signs.items():
        result[k] = found
    return result


def _planned(module: ModuleType, q: Vector, t: Vector, p: Sequence[float]) -> Signs:
    """Return the signs of the blocks that the planned solve has."""
    code = LaneCode(module, module.ARRAYS, list(p))
    parts = []
    for start in range(0, t.size, BLOCK):
        lanes, times = q[start : start + BLOCK].T, t[start : start + BLOCK]
        found = code.position(np.ascontiguousarray(lanes), times).determinants
        part = np.zeros((times.size, len(found)))
        for block, values in enumerate(found):
            part[:, block] = np.sign(values)
        parts.append(np.nan_to_num(part))
    unknown = ~np.isfinite(q).all(axis=1)
    result = np.concatenate(parts).astype(np.int8)
    result[unknown] = 0
    return result
