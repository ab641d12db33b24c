r"""The solve of Phi_q x = b of a large mechanism by its block triangular form.

Equal blocks are factored and solved side by side. With the blocks :math:`D` and the other entries
:math:`C` the matrix is :math:`D + C`. Blocks that others need, perhaps in a long chain, are solved
first: :math:`E` says which equation each number of :math:`s = C x` belongs to, and with
:math:`y = D^{-1} b` and :math:`W = D^{-1} E`

.. math:: (1 + C W)\, s = C y, \qquad x = y - W s .

The small matrix of :math:`s` is lower triangular, with ones on its diagonal. Where a block is
large, or few are equal, and where digits were lost, SuperLU has the whole matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import KEPT_PIVOT, LARGEST_POWER, SOLVED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Compiled

    Array = NDArray[np.float64]
    Index = NDArray[np.intp]

LARGEST_BLOCK, MOST_KINDS, LARGEST_BAND = 40, 100, 200
"""Equations of a block, kinds of blocks, and numbers before it that one of s may need, up to which
blocks are solved side by side: more take longer than SuperLU does."""


@dataclass(frozen=True, slots=True, eq=False)
class BlockFactors:
    """Phi_q, factored: by SuperLU, or each kind of blocks with W, and the matrix of s."""

    nonzeros: Array  # (nnz,): its entries
    whole: Any = None
    blocks: tuple[Factors, ...] = ()
    units: tuple[Array, ...] = ()
    chain: Array | None = None  # (band, count)


class BlockSolver:
    """Factors and solves Phi_q of a grouped module, again and again with one pattern.

    `pivoted` counts how often the blocks lost too many digits, and SuperLU took their place.
    """

    def __init__(self, code: Compiled) -> None:
        from scipy.linalg import get_lapack_funcs

        row_order, column_order, sizes, varies = code.blocks
        self._tbtrs: Any = get_lapack_funcs("tbtrs", dtype=np.float64)
        self.pivoted, self._size = 0, len(code.equations)
        self._rows, self._columns = np.ascontiguousarray(code.pattern.T, dtype=np.intp)
        edges, label = np.cumsum(sizes) - sizes, np.repeat(np.arange(sizes.size), sizes)
        of_row, of_column, row, column = np.empty((4, self._size), dtype=np.intp)
        of_row[row_order] = of_column[column_order] = label
        row[row_order] = column[column_order] = np.arange(self._size) - edges[label]
        block, places = of_row[self._rows], np.stack((row[self._rows], column[self._columns]))
        is_outer = block != of_column[self._columns]
        is_needed = np.isin(np.arange(sizes.size), of_column[self._columns[is_outer]])
        # The structure of a block: its places, which of them vary, and whether others need it.
        inner = np.flatnonzero(~is_outer)
        place = places[0] * (sizes.max() + 1) + places[1]
        inner = inner[np.lexsort((place[inner], block[inner]))]
        count = np.bincount(block[inner], minlength=sizes.size)
        first = np.cumsum(count) - count
        structure = (4 * place + 2 * varies + is_needed[block])[inner]
        marks = np.random.default_rng(0).integers(1 << 62, size=structure.max() + 1)
        kinds = np.unique(np.add.reduceat(marks[structure], first), return_inverse=True)[1]
        self._kinds: list[EqualBlocks] = []
        self._is_whole = bool(sizes.max() > LARGEST_BLOCK or kinds.max() >= MOST_KINDS)
        if self._is_whole:
            return
        every = [np.flatnonzero(kinds == kind) for kind in range(kinds.max() + 1)]
        for own in sorted(every, key=lambda own: not is_needed[own[0]]):
            members = edges[own] + np.arange(sizes[own[0]])[:, np.newaxis]
            entries = inner[first[own] + np.arange(count[own[0]])[:, np.newaxis]]
            one = entries[:, 0]
            equal = row_order[members], column_order[members], entries, places[:, one], ~varies[one]
            self._kinds.append(EqualBlocks(*equal))
        self._needed = sum(bool(is_needed[own[0]]) for own in every)
        last = np.flatnonzero(is_outer & ~is_needed[block])
        self._last = last, self._rows[last], self._columns[last]
        self._link(np.flatnonzero(is_outer & is_needed[block]), edges[of_row] + row)

    def _link(self, entries: Index, position: Index) -> None:
        """Find the products of C and W, and where in the matrix of s each is added."""
        rows, columns = self._rows[entries], self._columns[entries]
        links, numbers = np.unique(position[rows], return_inverse=True)
        place = np.full(self._size, -1, dtype=np.intp)
        place[rows] = numbers
        self._chained, self._count = (entries, numbers, columns), links.size
        # Of each kind the rows that need others, and which number of s each block's row has.
        self._units: list[tuple[Index, Index]] = []
        unit_columns, unit_places = [np.empty(0, np.intp)], [np.empty(0, np.intp)]
        for kind in self._kinds[: self._needed]:
            own = np.flatnonzero((place[kind.rows] >= 0).any(axis=1))
            self._units.append((own, place[kind.rows[own]]))
            both = np.broadcast_arrays(kind.columns[:, np.newaxis], self._units[-1][1])
            unit_columns.append(both[0].ravel())
            unit_places.append(both[1].ravel())
        of_column, of_place = np.concatenate(unit_columns), np.concatenate(unit_places)
        kept = np.flatnonzero(of_place >= 0)
        order = kept[np.argsort(of_column[kept], kind="stable")]
        # Every entry of C meets all entries of W in the row of its column.
        count = np.bincount(of_column[order], minlength=self._size)
        repeats = count[columns]
        which = np.repeat(np.arange(repeats.size), repeats)
        within = np.arange(which.size) - np.repeat(np.cumsum(repeats) - repeats, repeats)
        self._of_W = order[(np.cumsum(count) - count)[columns[which]] + within]
        self._of_C = entries[which]
        below = numbers[which] - of_place[self._of_W]
        self._width = int(below.max(initial=0)) + 1
        self._places = of_place[self._of_W] * self._width + below
        self._is_whole = self._width > LARGEST_BAND

    def factor(self, nonzeros: Array) -> BlockFactors:
        """Factor Phi_q, given by its entries in the order of PATTERN."""
        if self._is_whole:
            return BlockFactors(nonzeros, self._superlu(nonzeros))
        blocks = tuple([kind.factor(nonzeros) for kind in self._kinds])
        needed = zip(self._kinds, blocks, self._units, strict=False)
        units = tuple([kind.units(own, rows) for kind, own, (rows, _) in needed])
        flat = np.concatenate([np.empty(0), *(unit.ravel() for unit in units)])
        products = nonzeros.take(self._of_C) * flat.take(self._of_W)
        chain = _summed(self._places, products, self._count * self._width)
        return BlockFactors(nonzeros, None, blocks, units, chain.reshape(-1, self._width).T)

    def _superlu(self, nonzeros: Array) -> Any:
        """Factor the whole matrix; None where it is singular or not finite."""
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        shape = self._size, self._size
        try:
            return splu(csc_array((nonzeros, (self._rows, self._columns)), shape=shape))
        except (RuntimeError, ValueError):
            return None

    def determinants(self, factors: BlockFactors) -> Array:
        """Return the determinants of all blocks, up to constant factors, or of the whole matrix."""
        if self._is_whole:
            return np.array([_determinant(factors.whole) if factors.whole else 0.0])
        return np.concatenate([own.determinants for own in factors.blocks])

    def solve(self, factors: BlockFactors, b: Array, reference: Array | None = None) -> Array:
        """Return x of Phi_q x = b, shape (n,); not finite where Phi_q is singular.

        With the scales of the coordinates the equations are looked at. Without, it is enough that x
        is finite: for a correction of Newton's method, whose convergence tells the rest.
        """
        whole = factors.whole
        if not self._is_whole:
            x = self._solve(factors, b)
            if np.isfinite(x).all() and (
                reference is None or self._is_good(factors.nonzeros, b, x, reference)
            ):
                return x
            self.pivoted += 1
            whole = self._superlu(factors.nonzeros)
        return np.full(self._size, np.nan) if whole is None else np.asarray(whole.solve(b))

    def _solve(self, factors: BlockFactors, b: Array) -> Array:
        """Return the solution, block by block."""
        x, nonzeros = np.zeros(self._size), factors.nonzeros
        every = list(zip(self._kinds, factors.blocks, strict=True))
        for kind, own in every[: self._needed]:
            kind.put(kind.solve(own, kind.right_side(b)), x)
        if self._count:
            entries, links, columns = self._chained
            right = _summed(links, nonzeros.take(entries) * x.take(columns), self._count)
            s = self._tbtrs(factors.chain, right, uplo="L", diag="U")[0]
            s = np.append(s, 0.0)  # for rows that need no others, whose place is -1
            for kind, unit, (_, places) in zip(
                self._kinds, factors.units, self._units, strict=False
            ):
                x[kind.columns] -= (unit * s[places]).sum(axis=1)
        entries, rows, columns = self._last
        b = b - _summed(rows, nonzeros.take(entries) * x.take(columns), self._size)
        for kind, own in every[self._needed :]:
            kind.put(kind.solve(own, kind.right_side(b)), x)
        return x

    def product(self, nonzeros: Array, x: Array) -> Array:
        """Return Phi_q x."""
        return _summed(self._rows, nonzeros * x.take(self._columns), self._size)

    def _is_good(self, nonzeros: Array, b: Array, x: Array, reference: Array) -> bool:
        """Say whether a solution satisfies every equation."""
        missing = np.abs(self.product(nonzeros, x) - b)
        terms = self.product(np.abs(nonzeros), reference)
        return bool(np.all(missing <= SOLVED * terms * np.max(np.abs(x) / reference, initial=0.0)))


def _determinant(factors: Any) -> float:
    """Return a determinant from its factorization by SuperLU."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    pivots = factors.U.diagonal()
    size, negative = pivots.size, np.count_nonzero(pivots < 0)
    for order in (factors.perm_r, factors.perm_c):  # a circle of k numbers is k - 1 exchanges
        places = (np.arange(size, dtype=np.int32), order.astype(np.int32))  # as csgraph wants them
        circles = csr_array((np.ones(size), places), shape=(size, size))
        negative += size - connected_components(circles, connection="weak")[0]
    power = np.clip(np.sum(np.log(np.abs(pivots))), -LARGEST_POWER, LARGEST_POWER)
    return float((-1.0 if negative % 2 else 1.0) * np.exp(power))


def _summed(places: Index, values: Array, size: int) -> Array:
    """Return an array with each value added at its place."""
    return np.asarray(np.bincount(places, values, size), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """L and U of L blocks."""

    entries: Array  # (slots, L)
    full: Array  # (r, r, L): what the planned pivots leave
    order: Index | None  # (r, L): its rows in the order of their pivots
    determinants: Array  # (L,), up to the sign of the order that is planned


class EqualBlocks:
    """Plans, factors and solves L blocks of s equations.

    `rows` and `columns` (s, L) are their equations and coordinates, `entries` (k, L) numbers of
    their entries, `places` (2, k) rows and columns of these in a block; `is_number` (k,) says which
    are the same at all positions. Such pivots come first, with the least fill (Markowitz); the
    rest, a small full matrix, has partial pivoting in each block.
    """

    def __init__(
        self, rows: Index, columns: Index, entries: Index, places: Index, is_number: Index
    ) -> None:
        size = len(rows)
        pattern, number = np.zeros((2, size, size), dtype=bool)
        pattern[*places], number[*places] = True, is_number
        order = np.tile(np.arange(size), (2, 1))
        planned = size
        for k in range(size):
            counts = [pattern[k:, k:].sum(axis=axis) - 1 for axis in (1, 0)]
            fill = np.where(number[k:, k:], np.multiply.outer(*counts), size * size)
            if fill.min() == size * size:
                planned = k
                break
            i, j = (k + x for x in divmod(int(fill.argmin()), size - k))
            order[0, [k, i]], order[1, [k, j]] = order[0, [i, k]], order[1, [j, k]]
            for table in (pattern, number):
                table[[k, i]] = table[[i, k]]
                table[:, [k, j]] = table[:, [j, k]]
            below, right = (k + 1 + np.flatnonzero(x[k + 1 :, k]) for x in (pattern, pattern.T))
            pattern[np.ix_(below, right)], number[np.ix_(below, right)] = True, False
        pattern[planned:, planned:] = True
        slots = (np.cumsum(pattern) - 1).reshape(size, size)
        self.rows, self.columns = rows[order[0]], columns[order[1]]
        self._read, self._put = ([_evenly(x) for x in own] for own in (self.rows, self.columns))
        self._entries, self._planned, self._full = entries, planned, slots[planned:, planned:]
        self._slots = slots[*(np.argsort(own)[x] for own, x in zip(order, places, strict=True))]
        self._shape = int(pattern.sum()), rows.shape[1]
        # Of each pivot its slot, and row or column and slot of the entries below and right of it.
        self._steps = []
        for k in range(planned):
            below, right = (k + 1 + np.flatnonzero(x[k + 1 :, k]) for x in (pattern, pattern.T))
            updates = [[(slots[i, j], slots[k, j]) for j in right] for i in below]
            lower = [(i, slots[i, k], own) for i, own in zip(below, updates, strict=True)]
            self._steps.append((slots[k, k], lower, [*zip(right, slots[k, right], strict=True)]))

    def factor(self, nonzeros: Array) -> Factors:
        """Factor the blocks."""
        a = np.zeros(self._shape)
        a[self._slots] = nonzeros.take(self._entries)
        sizes = np.ones(self._shape[1])
        for pivot, below, _ in self._steps:
            sizes *= a[pivot]
            for _, factor, updates in below:
                a[factor] /= a[pivot]
                for target, source in updates:
                    a[target] -= a[factor] * a[source]
        full = a[self._full]
        order, determinants = _factor(full)
        return Factors(a, full, order, sizes * determinants)

    def right_side(self, b: Array) -> Array:
        """Return what b (n,) has for the blocks, shape (s, L)."""
        return np.array([b[numbers] for numbers in self._read])

    def put(self, values: Array, x: Array) -> None:
        """Put a solution (s, L) into x (n,)."""
        for columns, value in zip(self._put, values, strict=True):
            x[columns] = value

    def units(self, factors: Factors, rows: Index) -> Array:
        """Solve for the unit vectors of some rows; return x, shape (s, rows, L)."""
        x = np.zeros((len(self.rows), rows.size, self._shape[1]))
        x[rows, np.arange(rows.size)] = 1.0
        return self.solve(factors, x)

    def solve(self, factors: Factors, x: Array) -> Array:
        """Solve for a right side (s, L) or (s, k, L), whose place the solution takes."""
        a = factors.entries
        for k, (_, below, _) in enumerate(self._steps):
            for i, factor, _ in below:
                x[i] -= a[factor] * x[k]
        _substitute(factors.full, factors.order, x[self._planned :])
        for k, (pivot, _, right) in reversed([*enumerate(self._steps)]):
            for j, entry in right:
                x[k] -= a[entry] * x[j]
            x[k] /= a[pivot]
        return x


def _factor(a: Array) -> tuple[Index | None, Array]:
    """Factor full matrices (r, r, L) in place; return the order of their rows and determinants."""
    order, determinants = None, np.ones(a.shape[-1])
    for k in range(len(a)):
        column = np.abs(a[k:, k])
        moved = np.flatnonzero(column[0] < KEPT_PIVOT * column.max(axis=0))
        if moved.size:
            if order is None:
                order = np.repeat(np.arange(len(a))[:, np.newaxis], a.shape[-1], axis=1)
            other = k + column[:, moved].argmax(axis=0)
            for rows in (a.transpose(0, 2, 1), order):
                rows[k, moved], rows[other, moved] = rows[other, moved], rows[k, moved]
            determinants[moved] *= -1
        determinants *= a[k, k]
        a[k + 1 :, k] /= a[k, k]
        a[k + 1 :, k + 1 :] -= a[k + 1 :, k, np.newaxis] * a[k, k + 1 :]
    return order, determinants


def _substitute(a: Array, order: Index | None, x: Array) -> None:
    """Solve with factored full matrices for right sides (r, L) or (r, k, L), in place."""
    if x.ndim == 3:
        a, order = a[:, :, np.newaxis], None if order is None else order[:, np.newaxis]
    if order is not None:
        x[...] = np.take_along_axis(x, order, axis=0)
    for k in range(len(a)):
        x[k + 1 :] -= a[k + 1 :, k] * x[k]
    for k in reversed(range(len(a))):
        x[k] /= a[k, k]
        x[:k] -= a[:k, k] * x[k]


def _evenly(numbers: Index) -> Index | slice:
    """Return indices as a slice where they are evenly spaced: NumPy then needs no copy."""
    first, last = int(numbers[0]), int(numbers[-1])
    step = (last - first) // max(numbers.size - 1, 1) or 1
    is_even = step > 0 and np.array_equal(numbers, np.arange(first, last + 1, step))
    return slice(first, last + 1, step) if is_even else numbers
