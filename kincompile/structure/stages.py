"""The order of solution of a large system: batches of equal blocks, chains of them, a sparse rest.

The blocks of the block triangular form fall into classes of equal structure. A class whose blocks
do not need each other is solved as a *batch*, each number an array over its blocks. Classes that
need each other, or themselves, form a *chain*: loops, each driven by the one before. There too the
blocks are factored side by side; only the few interface variables between neighbouring blocks are
solved sequentially. Blocks too large to be written out as straight-line code are left to a sparse
factorization.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.structure.blocks import BlockForm, components, order_of_solution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Index = NDArray[np.intp]
    Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Batch:
    """Blocks of equal structure, solved side by side."""

    # rows, columns (size, L): equations and coordinates of each block
    rows: Index
    columns: Index
    inner: Index  # (entries, L): numbers of the entries within the blocks
    places: tuple[tuple[int, int], ...]  # their place in a block
    # (others, L): numbers of the entries in columns of other blocks: of earlier stages, or of the
    # same chain
    outer: Index
    outer_rows: tuple[int, ...]  # their row in a block


@dataclass(frozen=True, slots=True)
class Chain:
    """Blocks that need each other, none of them in a circle."""

    batches: tuple[Batch, ...]  # the classes of its blocks
    # (count,): equations with entries in columns of other blocks of the chain, in an order in which
    # none needs a later one; those columns are the interface variables
    interface: Index


@dataclass(frozen=True, slots=True)
class Sparse:
    """Equations that are solved together by a sparse factorization."""

    # rows, columns (size,): its equations and coordinates, in an order in which the matrix is
    # nearly lower triangular
    rows: Index
    columns: Index
    # inner, outer: numbers of its entries within, and in columns of earlier stages
    inner: Index
    outer: Index


Stage = Batch | Chain | Sparse

LARGEST_BLOCK = 40
"""Equations up to which a block is written out as straight-line code."""

SHARED = 4
"""Blocks a class, on average, from which on a chain is worth a function for each of its classes."""


def plan_stages(
    rows: Index, columns: Index, constants: Values, size: int
) -> tuple[Stage, ...] | None:
    """Split a large square system of this size into stages in the order of solution.

    Rows, columns and constants (nnz,) are of each entry that is not identically zero, row by row;
    of one that varies the constant is NaN. None where the system is structurally singular.
    """
    blocks = BlockForm.of(rows, columns, size)
    if blocks is None:
        return None
    classes = _classes(blocks, constants)
    class_of_block = np.empty(sum(item.blocks.size for item in classes), dtype=np.intp)
    for number, item in enumerate(classes):
        class_of_block[item.blocks] = number
    sizes = np.bincount(blocks.of_row)
    needs = np.unique(class_of_block[blocks.needs()], axis=1)
    stages: list[Stage] = []
    for together, is_cyclic in _class_order(needs, len(classes)):
        own = [classes[number] for number in together]
        chosen = np.concatenate([item.blocks for item in own])
        is_rare = is_cyclic and chosen.size < SHARED * len(together)
        if is_rare or sizes[chosen].max() > LARGEST_BLOCK:
            stages.append(_sparse(chosen, blocks))
            continue
        batches = tuple(_batch(item, blocks) for item in own)
        stages.append(_chain(chosen, batches, blocks) if is_cyclic else batches[0])
    return tuple(stages)


@dataclass(frozen=True, slots=True)
class _Class:
    """Blocks of equal structure, shape (L,), and their entries, shape (entries, L)."""

    blocks: Index
    entries: Index


def _classes(blocks: BlockForm, constants: Values) -> list[_Class]:
    """Return the classes of blocks, in the order of their first blocks.

    The structure of a block is the row, the column and, where it is one, the number of each of its
    entries; of entries outside the block the row alone.
    """
    _, kind = np.unique(constants, return_inverse=True)  # all NaN are one kind
    row_rank, column_rank = _ranks(blocks.of_row), _ranks(blocks.of_column)
    place = np.where(blocks.is_inner(), column_rank[blocks.columns] + 1, 0)
    row, width = row_rank[blocks.rows], int(column_rank.max()) + 2
    code = (row * width + place) * (int(kind.max()) + 1) + kind
    block = blocks.of_row[blocks.rows]
    order = np.lexsort((blocks.columns, place == 0, row, block))
    starts = np.concatenate(([0], np.cumsum(np.bincount(block))))
    codes, bounds = code[order].tolist(), starts.tolist()
    found: dict[tuple[int, ...], list[int]] = {}
    for number, (first, last) in enumerate(itertools.pairwise(bounds)):
        found.setdefault(tuple(codes[first:last]), []).append(number)
    classes = []
    for structure, members in found.items():
        entries = order[starts[members] + np.arange(len(structure))[:, np.newaxis]]
        classes.append(_Class(np.array(members, dtype=np.intp), entries))
    return classes


def _ranks(labels: Index) -> Index:
    """Return the position of each member among those of its label."""
    order = np.argsort(labels, kind="stable")
    ranks = np.empty(labels.size, dtype=np.intp)
    counts = np.bincount(labels)
    ranks[order] = np.arange(labels.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return ranks


def _batch(item: _Class, blocks: BlockForm) -> Batch:
    """Return the stage of a class of blocks."""
    sample = item.entries[:, 0]
    inside = blocks.is_inner()[sample]
    row = _ranks(blocks.of_row)[blocks.rows[sample]]
    column = _ranks(blocks.of_column)[blocks.columns[sample]]
    return Batch(
        _members(blocks.of_row, item.blocks),
        _members(blocks.of_column, item.blocks),
        item.entries[inside],
        tuple(zip(row[inside].tolist(), column[inside].tolist(), strict=True)),
        item.entries[~inside],
        tuple(row[~inside].tolist()),
    )


def _members(labels: Index, chosen: Index) -> Index:
    """Return the members of labels of equal size, a column a label."""
    members, sizes = np.argsort(labels, kind="stable"), np.bincount(labels)
    first = (np.cumsum(sizes) - sizes)[chosen]
    return np.asarray(members[first + np.arange(sizes[chosen[0]])[:, np.newaxis]])


def _class_order(needs: Index, count: int) -> list[tuple[list[int], bool]]:
    """Return groups of classes in order of solution, and whether their blocks need each other."""
    component = components(needs[0], needs[1], count)
    ends = component[needs]
    cyclic = set(ends[0][ends[0] == ends[1]].tolist())
    return [
        (np.flatnonzero(component == label).tolist(), label in cyclic)
        for label in order_of_solution(np.unique(ends, axis=1), np.unique(component).tolist())
    ]


def _chain(chosen: Index, batches: tuple[Batch, ...], blocks: BlockForm) -> Chain:
    """Return the chain: the batches of a cycle of blocks, and their interface equations."""
    needs = blocks.needs()
    within = np.isin(needs, chosen).all(axis=0)
    rows = np.unique(blocks.rows[~blocks.is_inner()][within])
    position = _positions(needs[:, within], chosen)
    return Chain(batches, rows[np.argsort(position[blocks.of_row[rows]], kind="stable")])


def _sparse(chosen: Index, blocks: BlockForm) -> Sparse:
    """Return the stage of blocks that are solved by a sparse factorization, in order."""
    own = np.isin(blocks.of_row, chosen)
    rows, columns = np.flatnonzero(own), np.flatnonzero(np.isin(blocks.of_column, chosen))
    needs = blocks.needs()
    position = _positions(needs[:, np.isin(needs, chosen).all(axis=0)], chosen)
    rows = rows[np.argsort(position[blocks.of_row[rows]], kind="stable")]
    columns = columns[np.argsort(position[blocks.of_column[columns]], kind="stable")]
    entries = np.flatnonzero(own[blocks.rows])
    inside = np.isin(blocks.of_column[blocks.columns[entries]], chosen)
    return Sparse(rows, columns, entries[inside], entries[~inside])


def _positions(needs: Index, chosen: Index) -> Index:
    """Return the position of each chosen block in an order in which none needs a later one."""
    order = order_of_solution(np.unique(needs, axis=1), chosen.tolist())
    position = np.empty(chosen.max() + 1, dtype=np.intp)
    position[order] = np.arange(len(order))
    return position
