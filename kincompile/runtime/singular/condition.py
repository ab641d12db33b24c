r"""What Phi_q says of the points of a motion: its condition, and the branch they are on.

The condition number is free of units: how much an error may grow in the solve. The branch is shown
by the signs of the determinants of the structural blocks: two assembled positions that differ in a
sign cannot be reached from each other without passing a singular configuration. The planned solve
of a module, in one piece or in blocks, has the determinants at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.runtime.engine.linear import Dense, Planned, Sparse
from kincompile.runtime.problem import problem

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled

    Signs = NDArray[np.int8]

BLOCK = 512
"""Points at a time, so that memory is bounded."""

STRIP = 2048
"""Points at a time whose determinants are taken, so that arrays stay in the cache."""

LARGEST_DENSE = 300
"""Coordinates up to which all singular values are computed; beyond, the condition is estimated,
but where equations are redundant."""


def conditions(code: Compiled, q: Array, t: Array, p: Array) -> Array:
    """Return the condition number of the scaled Phi_q at every point of a motion, shape (N,).

    Lengths count in sizes of the mechanism, angles in radians, and each equation in what its terms
    contribute at a generic position: the number is the same in metres and in millimetres. For
    positions q (N, n) at t (N,); NaN where q is, and without equations.
    """
    result = np.full(t.size, np.nan)
    found = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not (found.size and code.equations):
        return result
    with np.errstate(all="ignore"):
        first = found[0]
        equations = problem(code, p, np.ascontiguousarray(q[first]), float(t[first]))
        columns = equations.reference
        rows = equations.weights()
        for start in range(0, found.size, BLOCK):
            part = found[start : start + BLOCK]
            if columns.size <= LARGEST_DENSE or rows.size > columns.size:
                matrices = code.Phi_q(np.ascontiguousarray(q[part]), t[part], p)
                result[part] = _of_dense(rows[:, np.newaxis] * matrices * columns)
            else:
                result[part] = [_estimate(code, q[k], t[k], p, rows, columns) for k in part]
    return result


def _of_dense(matrices: Array) -> Array:
    """Return the ratio of the largest and the smallest singular value of each matrix."""
    sizes = np.linalg.svd(matrices, compute_uv=False)
    return np.asarray(sizes[:, 0] / sizes[:, -1], dtype=np.float64)


def _estimate(code: Compiled, q: Array, t: float, p: Array, rows: Array, columns: Array) -> float:
    """Return an estimate in the 1-norm (Higham and Tisseur) from a sparse factorization."""
    # Importing SciPy's sparse matrices takes longer than the whole runtime.
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import LinearOperator, onenormest, splu

    i, j = code.pattern.T
    values = rows[i] * code.nonzeros(np.ascontiguousarray(q), t, p) * columns[j]
    matrix = csc_array((values, (i, j)), shape=(rows.size, columns.size))
    try:
        factored: Any = splu(matrix)
    except RuntimeError:  # exactly singular
        return np.inf
    inverse: Any = LinearOperator(  # type: ignore[call-arg, misc]  # its __new__ hides the names
        matrix.shape,
        matvec=factored.solve,
        rmatvec=lambda b: factored.solve(b, trans="T"),
        matmat=factored.solve,
        rmatmat=lambda b: factored.solve(b, trans="T"),
        dtype=np.float64,
    )
    return float(onenormest(inverse) * abs(matrix).sum(axis=0).max())


def signatures(code: Compiled, q: Array, t: Array, p: Sequence[float]) -> Signs:
    """Return the signature of each point of a motion, shape (N, blocks), for q (N, n) at t (N,).

    It is 0 where q is NaN.
    """
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    with np.errstate(all="ignore"):
        parts = list(_signs(code, q[known], t[known], np.asarray(p, dtype=np.float64)))
    found = np.nan_to_num(np.concatenate(parts)) if parts else np.zeros((0, 1))
    result = np.zeros((t.size, found.shape[1]), dtype=np.int8)
    result[known] = found
    return result


def _signs(code: Compiled, q: Array, t: Array, p: Array) -> Iterator[Array]:
    """Yield the signs of known positions, some at a time."""
    if code.lanes is None:
        engine = Sparse(code, p) if code.blocks else Dense(code, p)
        for position, time in zip(q, t.tolist(), strict=True):
            yield np.array([engine.signs(engine.evaluate(np.ascontiguousarray(position), time))])
        return
    planned = Planned(code, p)
    for start in range(0, t.size, STRIP):
        lanes = np.ascontiguousarray(q[start : start + STRIP].T)
        point = planned.evaluate(lanes, t[start : start + STRIP])
        yield np.sign(planned.determinants(point, point)).T


def counted_signatures(q: Array, t: Array, passed: Sequence[float]) -> Signs:
    """Return the signature of a motion with redundant equations, shape (N, 1); 0 where q is NaN.

    They have no determinant; the sign is that of the start, and changes with every bifurcation that
    was passed, at these times.
    """
    way = np.abs(t - t[0])
    count = sum(((way > abs(time - t[0])).astype(int) for time in passed), np.zeros(t.size, int))
    signs = np.where(np.isfinite(q).all(axis=1), 1 - 2 * (count % 2), 0)
    return signs.astype(np.int8)[:, np.newaxis]
