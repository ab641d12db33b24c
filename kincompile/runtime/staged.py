"""The solve of Phi_q x = b of a large mechanism in stages: blocks as lanes, chains sparsely."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray
    from scipy.sparse.linalg import SuperLU

    Array = NDArray[np.float64]
    Index = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class StagedFactors:
    """Phi_q, factored.

    Attributes
    ----------
    nonzeros : ndarray, shape (nnz,)
        Its entries.
    parts
        What each stage keeps: the lanes of the planned solve, or a sparse factorization.
    signs : ndarray
        Signs of the determinants of all blocks of lanes.
    """

    nonzeros: Array
    parts: list[Any]
    signs: NDArray[np.bool_]


class _SparseStage:
    """Equations that are solved together: a fixed pattern, values put in place."""

    def __init__(self, stage: Any, pattern: Index, size: int) -> None:
        # Importing SciPy's sparse matrices takes longer than the whole runtime.
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        self._splu: Any = splu
        self.rows, self.columns, self._outer = stage.rows, stage.columns, stage.outer
        row_number = _numbering(stage.rows, size)
        column_number = _numbering(stage.columns, size)
        rows, columns = pattern[stage.inner].T
        count = self.rows.size
        numbered = csc_array(
            (np.arange(1, stage.inner.size + 1), (row_number[rows], column_number[columns])),
            shape=(count, count),
        )
        # The values of the pattern's entries in the order of the columns.
        self._order = stage.inner[numbered.data - 1]
        self._matrix = csc_array(
            (np.zeros(count and numbered.nnz), numbered.indices, numbered.indptr),
            shape=(count, count),
        )
        self._outer_rows, self._outer_columns = (
            row_number[pattern[stage.outer, 0]],
            pattern[stage.outer, 1],
        )

    def factor(self, nonzeros: Array) -> SuperLU:
        """Factor the matrix; RuntimeError where it is exactly singular."""
        self._matrix.data = nonzeros[self._order]
        # The equations are in an order in which the matrix is nearly triangular already.
        factored: SuperLU = self._splu(self._matrix, permc_spec="NATURAL", diag_pivot_thresh=0.1)
        return factored

    def solve(self, part: SuperLU, nonzeros: Array, b: Array, x: Array) -> None:
        """Put the solution into x."""
        right = b[self.rows]
        np.subtract.at(right, self._outer_rows, nonzeros[self._outer] * x[self._outer_columns])
        x[self.columns] = part.solve(right)


class _LaneStage:
    """Equal blocks, each number an array over them."""

    def __init__(self, stage: Any, pattern: Index, functions: Any) -> None:
        self._stage, self._functions = stage, functions
        self._outer_columns = pattern[stage.outer.reshape(-1), 1].reshape(stage.outer.shape)

    def factor(self, nonzeros: Array) -> tuple[Any, Any]:
        """Return factors and determinants."""
        factored: tuple[Any, Any] = self._stage.factor(
            self._functions, [nonzeros[places] for places in self._stage.varying]
        )
        return factored

    def solve(self, part: tuple[Any, Any], nonzeros: Array, b: Array, x: Array) -> None:
        """Put the solution into x."""
        stage = self._stage
        right = b[stage.rows]
        for row, places, columns in zip(
            stage.outer_rows, stage.outer, self._outer_columns, strict=True
        ):
            right[row] -= nonzeros[places] * x[columns]
        for columns, values in zip(
            stage.columns, stage.solve(self._functions, part[0], right), strict=True
        ):
            x[columns] = values


class StagedSolver:
    """Factors and solves Phi_q of a grouped module, again and again with one pattern."""

    def __init__(self, module: ModuleType) -> None:
        pattern, size = module.PATTERN, module.N_EQUATIONS
        self._stages: list[_LaneStage | _SparseStage] = [
            _LaneStage(stage, pattern, module.ARRAYS)
            if stage.factor
            else _SparseStage(stage, pattern, size)
            for stage in module.STAGES
        ]
        self._size = size

    def factor(self, nonzeros: Array) -> StagedFactors:
        """Factor Phi_q, given by its entries in the order of PATTERN.

        Raises
        ------
        RuntimeError
            Where a sparse stage is exactly singular.
        """
        parts = [stage.factor(nonzeros) for stage in self._stages]
        determinants = [
            np.atleast_1d(value)
            for stage, part in zip(self._stages, parts, strict=True)
            if isinstance(stage, _LaneStage)
            for value in part[1]
        ]
        signs = np.concatenate(determinants) > 0 if determinants else np.empty(0, dtype=bool)
        return StagedFactors(nonzeros, parts, signs)

    def solve(self, factors: StagedFactors, b: Array) -> Array:
        """Return x of Phi_q x = b, shape (n,)."""
        x = np.empty(self._size)
        for stage, part in zip(self._stages, factors.parts, strict=True):
            stage.solve(part, factors.nonzeros, b, x)
        return x


def _numbering(members: Index, size: int) -> Index:
    """Return the position of each member among the members."""
    numbers = np.full(size, -1, dtype=np.int32)
    numbers[members] = np.arange(members.size)
    return numbers
