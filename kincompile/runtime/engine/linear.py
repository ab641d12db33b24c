"""Linear systems with as many equations as unknowns, or with redundant ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array as Vector


def solve_linear(matrix: Vector, sides: Vector) -> Vector:
    """Return x of matrix x = sides; of more equations than unknowns in the sense of least squares.

    Redundant equations that agree change nothing. That they do agree is for the caller to check.

    Parameters
    ----------
    matrix : ndarray, shape (m, n)
        With m >= n.
    sides : ndarray, shape (m,) or (m, k)
        Right-hand sides.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the rank is less than n.
    """
    m, n = matrix.shape
    if m == n:
        return np.asarray(np.linalg.solve(matrix, sides), dtype=np.float64)
    solution, _, rank, _ = np.linalg.lstsq(matrix, sides, rcond=None)
    if rank < n:
        raise np.linalg.LinAlgError("dependent columns")
    return np.asarray(solution, dtype=np.float64)
