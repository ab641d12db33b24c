"""Blocks of equal structure, factored and solved side by side: a number is an array over them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import KEPT_PIVOT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Index = NDArray[np.intp]


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
