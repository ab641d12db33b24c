"""The order of solution of a large system: equal blocks as lanes, chains of them, a sparse rest.

The blocks of the block triangular form fall into classes of equal structure. A class whose blocks
do not need each other is solved as one, each number an array over its blocks. Classes that need
each other, or themselves, form a chain: loops, each driven by the one before. There too the blocks
are factored side by side; one after the other go only the few numbers that a block hands on to the
next. Blocks too large to be written out as straight-line code are left to a sparse factorization.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Index = NDArray[np.intp]
    Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Lanes:
    """Blocks of equal structure.

    Attributes
    ----------
    rows, columns : ndarray of int, shape (size, L)
        Equations and coordinates of each block.
    inner : ndarray of int, shape (entries, L)
        Numbers of the entries within the blocks.
    places : tuple of (row, column)
        Their place in a block.
    outer : ndarray of int, shape (others, L)
        Numbers of the entries in columns of other blocks: of earlier stages, or of the same chain.
    outer_rows : tuple of int
        Their row in a block.
    """

    rows: Index
    columns: Index
    inner: Index
    places: tuple[tuple[int, int], ...]
    outer: Index
    outer_rows: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Chain:
    """Blocks that need each other, none of them in a circle.

    Attributes
    ----------
    parts
        The classes of its blocks.
    links : ndarray of int, shape (count,)
        Equations with entries in columns of other blocks of the chain, in an order in which none
        needs a later one.
    """

    parts: tuple[Lanes, ...]
    links: Index


@dataclass(frozen=True, slots=True)
class Sparse:
    """Equations that are solved together by a sparse factorization.

    Attributes
    ----------
    rows, columns : ndarray of int, shape (size,)
        Its equations and coordinates, in an order in which the matrix is nearly lower triangular.
    inner, outer : ndarray of int
        Numbers of its entries within, and in columns of earlier stages.
    """

    rows: Index
    columns: Index
    inner: Index
    outer: Index


Stage = Lanes | Chain | Sparse

LARGEST_BLOCK = 40
"""Equations up to which a block is written out as straight-line code."""

SHARED = 4
"""Blocks a class, on average, from which on a chain is worth a function for each of its classes."""


def plan_stages(
    rows: Index, columns: Index, constants: Values, size: int
) -> tuple[Stage, ...] | None:
    """Split a large square system into stages.

    Parameters
    ----------
    rows, columns : ndarray of int, shape (nnz,)
        Place of each entry that is not identically zero, row by row.
    constants : ndarray, shape (nnz,)
        Its value where it is a plain number, NaN where it varies.
    size
        Number of equations, and of coordinates.

    Returns
    -------
    tuple of Stage or None
        In the order of solution; None where the system is structurally singular.
    """
    pattern = csr_array((np.ones(rows.size), (rows, columns)), shape=(size, size))
    matched = maximum_bipartite_matching(pattern, perm_type="column")
    if (matched < 0).any():
        return None
    blocks = _Blocks.of(rows, columns, matched)
    order, starts, signatures = _signatures(blocks, constants)
    classes: dict[tuple[int, ...], list[int]] = {}
    for block, signature in enumerate(signatures):
        classes.setdefault(signature, []).append(block)
    class_of_block = np.empty(len(signatures), dtype=np.intp)
    members = [np.array(found, dtype=np.intp) for found in classes.values()]
    for number, found in enumerate(members):
        class_of_block[found] = number
    needs = np.unique(class_of_block[blocks.outside()], axis=1)
    stages: list[Stage] = []
    for together, is_cyclic in _class_order(needs, len(classes)):
        chosen = np.concatenate([members[number] for number in together])
        largest = int(np.bincount(blocks.of_row)[chosen].max())
        if largest > LARGEST_BLOCK or (is_cyclic and chosen.size < SHARED * len(together)):
            stages.append(_sparse(chosen, blocks))
            continue
        lanes = []
        for number in together:
            first = starts[members[number]]
            count = len(signatures[members[number][0]])
            entries = order[first + np.arange(count)[:, np.newaxis]]
            lanes.append(_lanes(members[number], entries, blocks))
        stages.append(_chain(chosen, tuple(lanes), blocks) if is_cyclic else lanes[0])
    return tuple(stages)


@dataclass(frozen=True, slots=True)
class _Blocks:
    """The entries of Phi_q, and the blocks of the block triangular form.

    Attributes
    ----------
    rows, columns : ndarray of int, shape (nnz,)
        Place of each entry.
    of_row, of_column : ndarray of int, shape (size,)
        Block of each equation and of each coordinate.
    """

    rows: Index
    columns: Index
    of_row: Index
    of_column: Index

    @classmethod
    def of(cls, rows: Index, columns: Index, matched: Index) -> _Blocks:
        """Find the blocks: the strong components of the matched equations."""
        size = matched.size
        owner = np.empty(size, dtype=np.intp)
        owner[matched] = np.arange(size)
        edges = csr_array((np.ones(rows.size), (rows, owner[columns])), shape=(size, size))
        _, of_row = connected_components(edges, connection="strong")
        return cls(rows, columns, of_row, of_row[owner])

    def is_inner(self) -> NDArray[np.bool_]:
        """Return which entries lie within a block."""
        return np.asarray(self.of_row[self.rows] == self.of_column[self.columns])

    def outside(self) -> Index:
        """Return the blocks of row and column of each other entry, shape (2, others)."""
        outer = ~self.is_inner()
        return np.stack((self.of_row[self.rows[outer]], self.of_column[self.columns[outer]]))


def _ranks(labels: Index) -> Index:
    """Return the position of each member among those of its label."""
    order = np.argsort(labels, kind="stable")
    ranks = np.empty(labels.size, dtype=np.intp)
    counts = np.bincount(labels)
    ranks[order] = np.arange(labels.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return ranks


def _signatures(blocks: _Blocks, constants: Values) -> tuple[Index, Index, list[tuple[int, ...]]]:
    """Return the entries by block, where each block begins, and the signature of each block."""
    _, kind = np.unique(constants, return_inverse=True)  # all NaN are one kind
    row_rank, column_rank = _ranks(blocks.of_row), _ranks(blocks.of_column)
    place = np.where(blocks.is_inner(), column_rank[blocks.columns] + 1, 0)
    row, width = row_rank[blocks.rows], int(column_rank.max()) + 2
    code = (row * width + place) * (int(kind.max()) + 1) + kind
    block = blocks.of_row[blocks.rows]
    order = np.lexsort((blocks.columns, place == 0, row, block))
    starts = np.concatenate(([0], np.cumsum(np.bincount(block))))
    codes, bounds = code[order].tolist(), starts.tolist()
    return order, starts, [tuple(codes[a:b]) for a, b in itertools.pairwise(bounds)]


def _lanes(chosen: Index, entries: Index, blocks: _Blocks) -> Lanes:
    """Return the stage of equal blocks; `entries` has a row an entry and a column a block."""
    sample = entries[:, 0]
    inside = blocks.is_inner()[sample]
    row = _ranks(blocks.of_row)[blocks.rows[sample]]
    column = _ranks(blocks.of_column)[blocks.columns[sample]]
    return Lanes(
        _members(blocks.of_row, chosen),
        _members(blocks.of_column, chosen),
        entries[inside],
        tuple(zip(row[inside].tolist(), column[inside].tolist(), strict=True)),
        entries[~inside],
        tuple(row[~inside].tolist()),
    )


def _members(labels: Index, chosen: Index) -> Index:
    """Return the members of labels of equal size, a column a label."""
    members, sizes = np.argsort(labels, kind="stable"), np.bincount(labels)
    first = (np.cumsum(sizes) - sizes)[chosen]
    return np.asarray(members[first + np.arange(sizes[chosen[0]])[:, np.newaxis]])


def _class_order(needs: Index, count: int) -> list[tuple[list[int], bool]]:
    """Return groups of classes in order of solution, and whether their blocks need each other."""
    graph = csr_array((np.ones(needs.shape[1]), (needs[0], needs[1])), shape=(count, count))
    _, component = connected_components(graph, connection="strong")
    before: dict[int, set[int]] = {label: set() for label in component.tolist()}
    cyclic = set()
    for head, tail in needs.T.tolist():
        if component[head] == component[tail]:
            cyclic.add(int(component[head]))
        else:
            before[int(component[head])].add(int(component[tail]))
    ordered = TopologicalSorter({label: sorted(found) for label, found in sorted(before.items())})
    return [
        (np.flatnonzero(component == label).tolist(), label in cyclic)
        for label in ordered.static_order()
    ]


def _chain(chosen: Index, parts: tuple[Lanes, ...], blocks: _Blocks) -> Chain:
    """Return the stage of blocks that need each other."""
    heads, tails = blocks.outside()
    within = np.isin(heads, chosen) & np.isin(tails, chosen)
    rows = np.unique(blocks.rows[~blocks.is_inner()][within])
    position = _positions(heads[within], tails[within], int(blocks.of_row.max()) + 1)
    return Chain(parts, rows[np.argsort(position[blocks.of_row[rows]], kind="stable")])


def _sparse(chosen: Index, blocks: _Blocks) -> Sparse:
    """Return the stage of blocks that are solved by a sparse factorization, in order."""
    own = np.isin(blocks.of_row, chosen)
    rows, columns = np.flatnonzero(own), np.flatnonzero(np.isin(blocks.of_column, chosen))
    heads, tails = blocks.outside()
    position = _positions(heads, tails, int(blocks.of_row.max()) + 1)
    rows = rows[np.lexsort((rows, position[blocks.of_row[rows]]))]
    columns = columns[np.lexsort((columns, position[blocks.of_column[columns]]))]
    entries = np.flatnonzero(own[blocks.rows])
    inside = np.isin(blocks.of_column[blocks.columns[entries]], chosen)
    return Sparse(rows, columns, entries[inside], entries[~inside])


def _positions(heads: Index, tails: Index, count: int) -> Index:
    """Return the position of each block in an order in which none needs a later one.

    Each head needs its tail.
    """
    followers: list[list[int]] = [[] for _ in range(count)]
    missing = np.bincount(heads, minlength=count).tolist()
    for head, tail in zip(heads.tolist(), tails.tolist(), strict=True):
        followers[tail].append(head)
    ready = [block for block, number in enumerate(missing) if number == 0]
    position = np.empty(count, dtype=np.intp)
    for k in range(count):
        block = ready.pop()
        position[block] = k
        for head in followers[block]:
            missing[head] -= 1
            if missing[head] == 0:
                ready.append(head)
    return position
