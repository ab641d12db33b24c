"""The condition number of Phi_q, free of units: how much an error may grow in the solve."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.runtime.problem import problem

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array as Vector
    from kincompile.runtime.engine.code import Compiled

BLOCK = 512
"""Points at a time, so that memory is bounded."""

LARGEST_DENSE = 300
"""Coordinates up to which all singular values are computed; beyond, the condition is estimated,
but where equations are redundant."""


def conditions(code: Compiled, q: Vector, t: Vector, p: Vector) -> Vector:
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


def _of_dense(matrices: Vector) -> Vector:
    """Return the ratio of the largest and the smallest singular value of each matrix."""
    sizes = np.linalg.svd(matrices, compute_uv=False)
    return np.asarray(sizes[:, 0] / sizes[:, -1], dtype=np.float64)


def _estimate(
    code: Compiled, q: Vector, t: float, p: Vector, rows: Vector, columns: Vector
) -> float:
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
