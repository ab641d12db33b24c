"""The order of solution of a large system: equal blocks together as lanes, and a sparse rest where blocks form a chain.

The blocks of the block triangular form fall into classes of equal structure. A class whose blocks do not need each other is
solved as one, each number an array over its blocks. Classes that need each other, or themselves, stay together as one sparse
system: a chain of loops, each driven by the one before, has no parts that could run side by side.
"""

from __future__ import annotations

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
        Numbers of the entries in columns of earlier stages.
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


Stage = Lanes | Sparse


def plan_stages(rows: Index, columns: Index, constants: Values, size: int) -> tuple[Stage, ...] | None:
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
    owner = np.empty(size, dtype=np.intp)
    owner[matched] = np.arange(size)
    edges = csr_array((np.ones(rows.size), (rows, owner[columns])), shape=(size, size))
    _, block_of_row = connected_components(edges, connection="strong")
    block_of_column = block_of_row[owner]
    is_inner = block_of_row[rows] == block_of_column[columns]
    row_rank, column_rank = _ranks(block_of_row), _ranks(block_of_column)
    order, starts, signatures = _signatures(
        block_of_row[rows], row_rank[rows], column_rank[columns], is_inner, constants, columns
    )
    classes: dict[tuple[int, ...], list[int]] = {}
    for block, signature in enumerate(signatures):
        classes.setdefault(signature, []).append(block)
    class_of_block = np.empty(len(signatures), dtype=np.intp)
    for number, blocks in enumerate(classes.values()):
        class_of_block[blocks] = number
    outside = ~is_inner
    needs = np.unique(
        np.stack((class_of_block[block_of_row[rows[outside]]], class_of_block[block_of_column[columns[outside]]])), axis=1
    )
    block_rows = np.argsort(block_of_row, kind="stable")
    block_columns = np.argsort(block_of_column, kind="stable")
    sizes = np.bincount(block_of_row)
    firsts = np.concatenate(([0], np.cumsum(sizes)))
    stages: list[Stage] = []
    for members, is_cyclic in _class_order(needs, len(classes)):
        blocks = np.flatnonzero(np.isin(class_of_block, members))
        if is_cyclic:
            stages.append(_sparse(blocks, block_of_row, block_of_column, rows, columns, edges))
            continue
        width, first = int(sizes[blocks[0]]), firsts[blocks]
        own_rows = block_rows[first[np.newaxis, :] + np.arange(width)[:, np.newaxis]]
        own_columns = block_columns[first[np.newaxis, :] + np.arange(width)[:, np.newaxis]]
        count = int(starts[blocks[0] + 1] - starts[blocks[0]])
        entries = order[starts[blocks][np.newaxis, :] + np.arange(count)[:, np.newaxis]]
        inside = is_inner[entries[:, 0]]
        sample = entries[:, 0]
        stages.append(
            Lanes(
                own_rows,
                own_columns,
                entries[inside],
                tuple(
                    zip(row_rank[rows[sample[inside]]].tolist(), column_rank[columns[sample[inside]]].tolist(), strict=True)
                ),
                entries[~inside],
                tuple(row_rank[rows[sample[~inside]]].tolist()),
            )
        )
    return tuple(stages)


def _ranks(labels: Index) -> Index:
    """Return the position of each member among those of its label."""
    order = np.argsort(labels, kind="stable")
    ranks = np.empty(labels.size, dtype=np.intp)
    counts = np.bincount(labels)
    ranks[order] = np.arange(labels.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return ranks


def _signatures(
    block: Index, row_rank: Index, column_rank: Index, is_inner: NDArray[np.bool_], constants: Values, columns: Index
) -> tuple[Index, Index, list[tuple[int, ...]]]:
    """Return the entries sorted by block, where each block begins, and a signature for each block."""
    _, kind = np.unique(constants, return_inverse=True)  # all NaN are one kind
    place = np.where(is_inner, column_rank + 1, 0)
    code = (row_rank * (column_rank.max() + 2) + place) * (kind.max() + 1) + kind
    order = np.lexsort((columns, place == 0, row_rank, block))
    counts = np.bincount(block)
    starts = np.concatenate(([0], np.cumsum(counts)))
    codes, bounds = code[order].tolist(), starts.tolist()
    signatures = [tuple(codes[a:b]) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
    return order, starts, signatures


def _class_order(needs: Index, count: int) -> list[tuple[list[int], bool]]:
    """Return groups of classes in the order of solution, and whether their blocks need each other."""
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


def _sparse(
    blocks: Index, block_of_row: Index, block_of_column: Index, rows: Index, columns: Index, edges: csr_array
) -> Sparse:
    """Return the stage of blocks that need each other, in the order in which they do."""
    own = np.isin(block_of_row, blocks)
    own_rows, own_columns = np.flatnonzero(own), np.flatnonzero(np.isin(block_of_column, blocks))
    position = _depths(edges, block_of_row)
    own_rows = own_rows[np.lexsort((own_rows, position[block_of_row[own_rows]]))]
    own_columns = own_columns[np.lexsort((own_columns, position[block_of_column[own_columns]]))]
    entries = np.flatnonzero(own[rows])
    inside = np.isin(block_of_column[columns[entries]], blocks)
    return Sparse(own_rows, own_columns, entries[inside], entries[~inside])


def _depths(edges: csr_array, block_of_row: Index) -> Index:
    """Return the position of each block in an order in which none needs a later one."""
    heads, tails = block_of_row[edges.tocoo().row], block_of_row[edges.tocoo().col]
    count = int(block_of_row.max()) + 1
    needs: dict[int, set[int]] = {block: set() for block in range(count)}
    for head, tail in zip(heads.tolist(), tails.tolist(), strict=True):
        if head != tail:
            needs[head].add(tail)
    position = np.empty(count, dtype=np.intp)
    position[list(TopologicalSorter(needs).static_order())] = np.arange(count)
    return position
