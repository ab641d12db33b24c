r"""The solve of Phi_q x = b of a large mechanism in stages: blocks as lanes, chains, a sparse rest.

In a chain each block needs the one before it: with its diagonal blocks :math:`D` and the entries
:math:`C` through which blocks hang together, :math:`D x = b - E s` and :math:`s = C x`, where
:math:`E` says which equation each number of :math:`s` belongs to. With :math:`y = D^{-1} b` and
:math:`W = D^{-1} E`, which all blocks compute side by side,

.. math:: (1 + C W)\, s = C y, \qquad x = y - W s .

The matrix of :math:`s` is small and lower triangular, with ones on its diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from scipy.sparse.linalg import SuperLU

    from kincompile.runtime.engine.code import Code

    Array = NDArray[np.float64]
    Index = NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class StagedFactors:
    """Phi_q, factored."""

    nonzeros: Array  # (nnz,): its entries
    # What each stage keeps: the lanes of the planned solve, or a sparse factorization.
    parts: list[Any]


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

    def determinants(self, part: SuperLU) -> list[Array]:
        """Return the determinant of the one block that this is taken for."""
        return [np.array([_determinant(part)])]


class _LaneStage:
    """Equal blocks, each number an array over them."""

    def __init__(self, stage: Any, pattern: Index, functions: Any) -> None:
        self._stage, self._functions = stage, functions
        self.rows, self.columns = stage.rows, stage.columns
        self._varying = stage.varying.astype(np.intp)
        self._right = [_evenly(rows) for rows in stage.rows]
        self._x = [_evenly(columns) for columns in stage.columns]
        # One pass over all blocks for each row that has entries outside of its block.
        self._outer = [
            (row, _evenly(places), _evenly(pattern[places, 1]))
            for row, places in zip(stage.outer_rows, stage.outer, strict=True)
        ]

    def factor(self, nonzeros: Array) -> tuple[Any, Any]:
        """Return factors and determinants."""
        varying = nonzeros.take(self._varying)
        factored: tuple[Any, Any] = self._stage.factor(self._functions, varying)
        return factored

    def solve(self, part: tuple[Any, Any], nonzeros: Array, b: Array, x: Array) -> None:
        """Put the solution into x."""
        self.put(self.solution(part, nonzeros, b, x), x)

    def solution(self, part: tuple[Any, Any], nonzeros: Array, b: Array, x: Array) -> Sequence[Any]:
        """Return the solution, a number or an array (L,) for each of a block's coordinates."""
        right = [b[rows] for rows in self._right]
        for row, places, columns in self._outer:
            right[row] = right[row] - nonzeros[places] * x[columns]
        found: Sequence[Any] = self._stage.solve(self._functions, part[0], right)
        return found

    def put(self, values: Sequence[Any], x: Array) -> None:
        """Put a solution into x."""
        for columns, value in zip(self._x, values, strict=True):
            x[columns] = value

    def subtract(self, values: Array, x: Array) -> None:
        """Subtract a correction of a solution from x."""
        for columns, value in zip(self._x, values, strict=True):
            x[columns] -= value

    def unit_solution(self, part: tuple[Any, Any], row: int) -> Array:
        """Solve every block for the unit vector of a row; return x, shape (size, L)."""
        size, lanes = self.rows.shape
        right = [float(k == row) for k in range(size)]
        result = np.empty((size, lanes))
        for k, value in enumerate(self._stage.solve(self._functions, part[0], right)):
            result[k] = value
        return result

    def determinants(self, part: tuple[Any, Any]) -> list[Array]:
        """Return the determinants of the blocks."""
        lanes = self.rows.shape[1]
        return [np.broadcast_to(value, lanes) for value in part[1]]


LARGEST_BAND = 32
"""Numbers before it that a number of s may need, for LAPACK's banded form to be the fastest."""


class _ChainStage:
    """Blocks that need each other, none of them in a circle."""

    def __init__(self, stage: Any, pattern: Index, functions: Any, size: int) -> None:
        self._parts = [_LaneStage(part, pattern, functions) for part in stage.parts]
        place = _numbering(stage.links, size)
        # W: for each part its rows with links, and where in s the number of each block stands.
        self._units: list[tuple[int, int, Index]] = []
        # Where a column's entry for a number of s stands in W, by column.
        unit_columns, unit_places = [], []
        for number, part in enumerate(self._parts):
            of_row = place[part.rows]
            for row in np.flatnonzero((of_row >= 0).any(axis=1)).tolist():
                self._units.append((number, row, of_row[row]))
                unit_columns.append(part.columns.reshape(-1))
                unit_places.append(np.broadcast_to(of_row[row], part.columns.shape).reshape(-1))
        self._count = stage.links.size
        self._link_entries(stage, pattern, place, size)
        self._products(np.concatenate(unit_columns), np.concatenate(unit_places), size)

    def _link_entries(self, stage: Any, pattern: Index, place: Index, size: int) -> None:
        """Find the entries of C: numbers of the entries, their columns, and their place in s."""
        own = np.zeros(size, dtype=bool)
        for part in self._parts:
            own[part.columns] = True
        outer = np.concatenate([part.outer.reshape(-1) for part in stage.parts])
        entries = outer.astype(np.intp)
        entries = entries[own[pattern[entries, 1]]]
        rows, columns = pattern[entries].T
        self._entries, self._columns, self._rows = entries, columns, place[rows]

    def _products(self, columns: Index, places: Index, size: int) -> None:
        """Find the products of C and W, and where in the matrix of s each is added.

        `columns` and `places` are those of the entries of W, one after the other.
        """
        kept = np.flatnonzero(places >= 0)
        order = kept[np.argsort(columns[kept], kind="stable")]
        count = np.bincount(columns[order], minlength=size)
        first = np.cumsum(count) - count
        # Every entry of C meets all entries of W in the row of its column.
        repeats = count[self._columns]
        which = np.repeat(np.arange(repeats.size), repeats)
        within = np.arange(which.size) - np.repeat(np.cumsum(repeats) - repeats, repeats)
        self._of_W = order[first[self._columns[which]] + within]
        self._of_C = self._entries[which]
        rows, columns = self._rows[which], places[self._of_W]
        self._band = int(np.max(rows - columns, initial=0))
        self._matrix = (
            _Banded(rows, columns, self._count, self._band)
            if self._band <= LARGEST_BAND
            else _Triangular(rows, columns, self._count)
        )

    def factor(self, nonzeros: Array) -> tuple[list[Any], list[Array], Any]:
        """Return the factors of the blocks, W, and the matrix of s."""
        factored = [part.factor(nonzeros) for part in self._parts]
        units = [
            self._parts[number].unit_solution(factored[number], row)
            for number, row, _ in self._units
        ]
        flat = np.concatenate([item.reshape(-1) for item in units])
        products = nonzeros.take(self._of_C) * flat.take(self._of_W)
        return factored, units, self._matrix.factor(products)

    def solve(
        self, part: tuple[list[Any], list[Array], Any], nonzeros: Array, b: Array, x: Array
    ) -> None:
        """Put the solution into x, whose entries of this chain are zero."""
        factored, units, matrix = part
        # All of them before any is put into x: there the other blocks are still zero.
        found = [
            lanes.solution(its_factors, nonzeros, b, x)
            for lanes, its_factors in zip(self._parts, factored, strict=True)
        ]
        for lanes, values in zip(self._parts, found, strict=True):
            lanes.put(values, x)
        right = _summed(
            self._rows, nonzeros.take(self._entries) * x.take(self._columns), self._count
        )
        s = self._matrix.solve(matrix, right)
        for (number, _, places), unit in zip(self._units, units, strict=True):
            # Blocks without a link have the place -1: their number is the zero at the end.
            share = unit * np.append(s, 0.0).take(places)
            self._parts[number].subtract(share, x)

    def determinants(self, part: tuple[list[Any], list[Array], Any]) -> list[Array]:
        """Return the determinants of the blocks."""
        return [
            value
            for lanes, its_factors in zip(self._parts, part[0], strict=True)
            for value in lanes.determinants(its_factors)
        ]


class _Banded:
    """A unit lower triangular matrix whose entries stand near the diagonal, as LAPACK has it."""

    def __init__(self, rows: Index, columns: Index, size: int, band: int) -> None:
        from scipy.linalg import get_lapack_funcs

        self._tbtrs: Any = get_lapack_funcs("tbtrs", dtype=np.float64)
        self._shape = size, band + 1
        self._places = columns * (band + 1) + (rows - columns)

    def factor(self, values: Array) -> Array:
        """Return the matrix of the values, which are added where their places are the same."""
        size, width = self._shape
        return _summed(self._places, values, size * width).reshape(size, width).T

    def solve(self, matrix: Array, right: Array) -> Array:
        """Return the solution."""
        solution: Array = self._tbtrs(matrix, right, uplo="L", diag="U")[0]
        return solution


class _Triangular:
    """A unit lower triangular matrix of any pattern."""

    def __init__(self, rows: Index, columns: Index, size: int) -> None:
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        self._splu: Any = splu
        diagonal = np.arange(size)
        ones = np.ones(size + rows.size)
        pattern = (np.append(diagonal, rows), np.append(diagonal, columns))
        self._matrix = csc_array((ones, pattern), shape=(size, size))
        keys = np.repeat(diagonal, np.diff(self._matrix.indptr)) * size + self._matrix.indices
        self._places = np.searchsorted(keys, columns * size + rows)
        self._diagonal = np.searchsorted(keys, diagonal * (size + 1))

    def factor(self, values: Array) -> SuperLU:
        """Return the matrix of the values, which are added where their places are the same."""
        data = _summed(self._places, values, self._matrix.nnz)
        data[self._diagonal] += 1.0
        self._matrix.data = data
        factored: SuperLU = self._splu(self._matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0)
        return factored

    def solve(self, matrix: SuperLU, right: Array) -> Array:
        """Return the solution."""
        solution: Array = matrix.solve(right)
        return solution


LOST, ROUNDED = 1e-8, 1e-12
"""A solution is good when each equation holds to the first part of its own terms, or to the second
of the largest: rounding errors go from large equations to small ones."""


class StagedSolver:
    """Factors and solves Phi_q of a grouped module, again and again with one pattern.

    `pivoted` counts how often the stages lost too many digits, and a factorization of the whole
    matrix with pivoting took their place.
    """

    def __init__(self, code: Code) -> None:
        pattern, size = code.pattern, len(code.equations)
        self.pivoted = 0
        self._rows, self._columns = np.ascontiguousarray(pattern.T)
        self._stages = [_stage(stage, pattern, code.arrays, size) for stage in code.stages]
        self._size = size

    def factor(self, nonzeros: Array) -> StagedFactors:
        """Factor Phi_q, given by its entries in the order of PATTERN."""
        return StagedFactors(nonzeros, [stage.factor(nonzeros) for stage in self._stages])

    def determinants(self, factors: StagedFactors) -> Array:
        """Return the determinants of all blocks, up to constant factors."""
        found = [
            value
            for stage, part in zip(self._stages, factors.parts, strict=True)
            for value in stage.determinants(part)
        ]
        return np.concatenate(found) if found else np.empty(0)

    def determinants_of(self, nonzeros: Array) -> Array:
        """Return the determinants of all blocks; one zero where Phi_q cannot be factored."""
        try:
            return self.determinants(self.factor(nonzeros))
        except RuntimeError:
            return np.zeros(1)

    def solve(self, factors: StagedFactors, b: Array, *, checked: bool = True) -> Array:
        """Return x of Phi_q x = b, shape (n,); not finite where Phi_q is singular.

        Without `checked` it is enough that x is finite: for a correction of Newton's method, whose
        convergence tells the rest, in half the time.
        """
        x = np.zeros(self._size)
        for stage, part in zip(self._stages, factors.parts, strict=True):
            stage.solve(part, factors.nonzeros, b, x)
        is_good = self._is_good(factors.nonzeros, b, x) if checked else np.isfinite(x).all()
        if is_good:
            return x
        self.pivoted += 1
        return self._solve_whole(factors, b)

    def _is_good(self, nonzeros: Array, b: Array, x: Array) -> bool:
        """Say whether a solution satisfies every equation."""
        products = nonzeros * x.take(self._columns)
        missing = np.abs(_summed(self._rows, products, self._size) - b)
        terms = _summed(self._rows, np.abs(products), self._size) + np.abs(b)
        return bool(np.all(missing <= LOST * terms + ROUNDED * terms.max(initial=0.0)))

    def solve_transposed(self, factors: StagedFactors, b: Array) -> Array:
        """Return x of Phi_q^T x = b by a factorization with pivoting; NaN where it is singular."""
        return self._solve_whole(factors, b, "T")

    def _solve_whole(self, factors: StagedFactors, b: Array, kind: str = "N") -> Array:
        """Return the solution by a factorization with pivoting; NaN where that is singular."""
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        places, shape = (self._rows, self._columns), (self._size, self._size)
        try:
            factored: Any = splu(csc_array((factors.nonzeros, places), shape=shape))
        except (RuntimeError, ValueError):  # singular; entries that are not finite
            return np.full(self._size, np.nan)
        solution: Array = factored.solve(b, kind)
        return solution


def _stage(
    stage: Any, pattern: Index, functions: Any, size: int
) -> _LaneStage | _ChainStage | _SparseStage:
    """Return what solves a stage."""
    if hasattr(stage, "parts"):
        return _ChainStage(stage, pattern, functions, size)
    if stage.factor:
        return _LaneStage(stage, pattern, functions)
    return _SparseStage(stage, pattern, size)


LARGEST_POWER = 600.0
"""Power of e beyond which no determinant is given: floating point ends at 709."""


def _determinant(factors: SuperLU) -> float:
    """Return a determinant from its factorization."""
    pivots = factors.U.diagonal()
    negative = np.count_nonzero(pivots < 0)
    for permutation in (factors.perm_r, factors.perm_c):
        negative += _is_odd(permutation)
    power = np.clip(np.sum(np.log(np.abs(pivots))), -LARGEST_POWER, LARGEST_POWER)
    return float((-1.0 if negative % 2 else 1.0) * np.exp(power))


def _is_odd(permutation: Index) -> int:
    """Return 1 for an odd permutation, else 0: a circle of k numbers is k - 1 exchanges."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    graph = csr_array((np.ones(permutation.size), (np.arange(permutation.size), permutation)))
    circles, _ = connected_components(graph, connection="weak")
    return int(permutation.size - circles) % 2


def _evenly(numbers: Index) -> Index | slice:
    """Return indices as a slice where they are evenly spaced: NumPy then needs no copy."""
    first, last = int(numbers[0]), int(numbers[-1])
    step = (last - first) // max(numbers.size - 1, 1) or 1
    if step > 0 and np.array_equal(numbers, np.arange(first, last + 1, step)):
        return slice(first, last + 1, step)
    return numbers.astype(np.intp)


def _summed(places: Index, values: Array, size: int) -> Array:
    """Return an array with each value added at its place."""
    return np.asarray(np.bincount(places, values, size), dtype=np.float64)


def _numbering(members: Index, size: int) -> Index:
    """Return the position of each member among the members."""
    numbers = np.full(size, -1, dtype=np.intp)
    numbers[members] = np.arange(members.size)
    return numbers
