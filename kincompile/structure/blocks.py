"""The decomposition of Dulmage and Mendelsohn, by the pattern of Phi_q alone.

A maximum matching pairs equations with coordinates that they determine. It shows the part with too
many equations, the part with too few, and the square part between them. That one has a block
triangular form: a *block* is a strongly connected component, equations that can only be solved
together, and the blocks are solved one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    Index = NDArray[np.intp]

SMALL = 300
"""Equations up to which the plain algorithms below are faster than importing SciPy's."""


@dataclass(frozen=True, slots=True)
class Block:
    """Equations that must be solved together, and the coordinates that they determine."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Parts:
    """Rows and columns of Phi_q by what the pattern alone says of them."""

    # too_many_rows, too_many_columns: equations of which there are more than coordinates in them,
    # and those coordinates
    too_many_rows: tuple[int, ...]
    too_many_columns: tuple[int, ...]
    blocks: tuple[Block, ...]  # the square part, in the order of solution
    # too_few_rows, too_few_columns: coordinates of which there are more than equations for them,
    # and those equations
    too_few_rows: tuple[int, ...]
    too_few_columns: tuple[int, ...]


def parts_of(pattern: Sequence[tuple[int, int]], shape: tuple[int, int]) -> Parts:
    """Split a system into the part with too many equations, the square one, that with too few.

    Arguments are those of `matching`.
    """
    m, n = shape
    of_row = matching(pattern, shape).tolist()
    of_column = [-1] * n
    for row, column in enumerate(of_row):
        if column >= 0:
            of_column[column] = row
    columns_of: list[list[int]] = [[] for _ in range(m)]
    rows_of: list[list[int]] = [[] for _ in range(n)]
    for row, column in pattern:
        columns_of[row].append(column)
        rows_of[column].append(row)
    many_rows, many_columns = _reached(of_row, columns_of, of_column)
    few_columns, few_rows = _reached(of_column, rows_of, of_row)
    rows = set(range(m)) - many_rows - few_rows
    columns = set(range(n)) - many_columns - few_columns
    inner = [(row, column) for row, column in pattern if row in rows and column in columns]
    blocks = block_triangular(sorted(rows), sorted(columns), inner) or ()
    many = tuple(sorted(many_rows)), tuple(sorted(many_columns))
    return Parts(*many, blocks, tuple(sorted(few_rows)), tuple(sorted(few_columns)))


def _reached(
    matched: Sequence[int], others_of: Sequence[Sequence[int]], partner: Sequence[int]
) -> tuple[set[int], set[int]]:
    """Follow alternating paths from items without a partner; return items and others on them."""
    waiting = [item for item, other in enumerate(matched) if other < 0]
    items, others = set(waiting), set[int]()
    while waiting:
        for other in others_of[waiting.pop()]:
            if other not in others:
                others.add(other)
                following = partner[other]
                if following >= 0 and following not in items:
                    items.add(following)
                    waiting.append(following)
    return items, others


def matching(pattern: Sequence[tuple[int, int]] | Index, shape: tuple[int, int]) -> Index:
    """Match equations with coordinates, one to one and as many as possible.

    For the row and column of each entry that is not identically zero, and the shape of the matrix,
    it is the column matched with each row, shape (m,), -1 where there is none.
    """
    rows, columns = np.array(pattern, dtype=np.intp).reshape(-1, 2).T
    if max(shape) > SMALL:
        from scipy.sparse.csgraph import maximum_bipartite_matching

        found: Index = maximum_bipartite_matching(_matrix(rows, columns, shape), "column")
        return found
    columns_of: list[list[int]] = [[] for _ in range(shape[0])]
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        columns_of[row].append(column)
    matched, owner = [-1] * shape[0], [-1] * shape[1]
    for row in range(shape[0]):
        _match(row, columns_of, matched, owner)
    return np.array(matched, dtype=np.intp)


def _match(
    start: int, columns_of: Sequence[Sequence[int]], matched: list[int], owner: list[int]
) -> None:
    """Match one more row, by an alternating path on which others change their columns."""
    reached_from: dict[int, int] = {}
    waiting = [start]
    for row in waiting:
        for column in columns_of[row]:
            if column in reached_from:
                continue
            reached_from[column] = row
            if owner[column] >= 0:
                waiting.append(owner[column])
                continue
            while column >= 0:  # back along the path: each row passes its column on
                row = owner[column] = reached_from[column]
                matched[row], column = column, matched[row]
            return


def components(heads: Index, tails: Index, count: int) -> Index:
    """Return the number of the strongly connected component of each node, shape (count,).

    Heads and tails (edges,) are the ends of each edge, nodes from 0 to count - 1.
    """
    if count > SMALL:
        from scipy.sparse.csgraph import connected_components

        graph = _matrix(heads, tails, (count, count))
        found: Index = connected_components(graph, connection="strong")[1]
        return found
    reached = np.eye(count, dtype=np.float32)
    reached[heads, tails] = 1
    for _ in range(count.bit_length()):  # paths of twice the length
        reached = np.minimum(reached @ reached, 1)
    return np.unique(np.argmax((reached * reached.T) > 0, axis=1), return_inverse=True)[1]


def _matrix(rows: Index, columns: Index, shape: tuple[int, int]) -> object:
    from scipy.sparse import csr_array

    short = np.array([rows, columns], np.int32)  # csgraph took no others before SciPy 1.15
    return csr_array((np.ones(rows.size), tuple(short)), shape=shape)


def order_of_solution(needs: Index, labels: Iterable[int]) -> list[int]:
    """Return labels in an order in which none needs a later one; `needs` has pairs as columns."""
    before: dict[int, set[int]] = {label: set() for label in labels}
    for head, tail in needs.T.tolist():
        if head != tail:
            before[head].add(tail)
    return list(TopologicalSorter(before).static_order())


@dataclass(frozen=True, slots=True)
class BlockForm:
    """The block triangular form of a square matrix given by its entries."""

    # rows, columns (nnz,): place of each entry
    rows: Index
    columns: Index
    # of_row, of_column (size,): block of each equation and of each coordinate
    of_row: Index
    of_column: Index

    @classmethod
    def of(cls, rows: Index, columns: Index, size: int) -> BlockForm | None:
        """Find the blocks; None where the matrix is structurally singular."""
        matched = matching(np.stack((rows, columns), axis=1), (size, size))
        if (matched < 0).any():
            return None
        owner = np.empty(size, dtype=np.intp)
        owner[matched] = np.arange(size)
        of_row = components(rows, owner[columns], size)
        return cls(rows, columns, of_row, of_row[owner])

    def order(self) -> tuple[Index, Index, Index]:
        """Return rows and columns (size,) in an order of solution, and the sizes of the blocks."""
        needs = self.needs()
        number = np.arange(self.of_row.max(initial=-1) + 1)
        if (needs[0] < needs[1]).any():  # SciPy numbers what is needed first
            number[order_of_solution(np.unique(needs, axis=1), number.tolist())] = number.copy()
        labels = number[self.of_row], number[self.of_column]
        rows, columns = (np.argsort(label, kind="stable") for label in labels)
        return rows, columns, np.bincount(labels[0])

    def is_inner(self) -> NDArray[np.bool_]:
        """Return which entries lie within a block, shape (nnz,)."""
        return np.asarray(self.of_row[self.rows] == self.of_column[self.columns])

    def needs(self) -> Index:
        """Return the blocks of row and column of each other entry, shape (2, others)."""
        outer = ~self.is_inner()
        return np.stack((self.of_row[self.rows[outer]], self.of_column[self.columns[outer]]))


def block_triangular(
    rows: Sequence[int], columns: Sequence[int], pattern: Iterable[tuple[int, int]]
) -> tuple[Block, ...] | None:
    """Split a square system into blocks in an order in which they can be solved.

    Rows and columns, equally many, are increasing; the pattern has the row and column of each entry
    that is not identically zero. None where the system is structurally singular: the equations
    cannot be matched with the coordinates.
    """
    if not rows:
        return ()
    local = np.array(list(pattern), dtype=np.intp).reshape(-1, 2).T
    row_numbers, column_numbers = np.array(rows, np.intp), np.array(columns, np.intp)
    form = BlockForm.of(
        np.searchsorted(row_numbers, local[0]), np.searchsorted(column_numbers, local[1]), len(rows)
    )
    if form is None:
        return None
    return tuple(
        Block(
            tuple(row_numbers[form.of_row == label].tolist()),
            tuple(column_numbers[form.of_column == label].tolist()),
        )
        for label in order_of_solution(form.needs(), range(form.of_row.max() + 1))
    )
