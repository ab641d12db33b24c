"""Block triangular form: a square system as small ones that are solved one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Block:
    """Equations that must be solved together, and the coordinates they determine."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def matching(
    pattern: Sequence[tuple[int, int]] | NDArray[np.intp], shape: tuple[int, int]
) -> list[int]:
    """Match equations with coordinates, one to one and as many as possible.

    Parameters
    ----------
    pattern
        Row and column of each entry that is not identically zero.
    shape
        Numbers of equations and of coordinates.

    Returns
    -------
    list of int
        The column matched with each row, -1 where there is none.
    """
    rows, columns = np.array(pattern, dtype=np.intp).reshape(-1, 2).T
    matrix = csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)
    matched: list[int] = maximum_bipartite_matching(matrix, perm_type="column").tolist()
    return matched


def block_triangular(
    rows: Sequence[int], columns: Sequence[int], pattern: Iterable[tuple[int, int]]
) -> tuple[Block, ...] | None:
    """Split a square system into blocks in the order in which they can be solved.

    The blocks are the strong components of the matched equations (Dulmage and Mendelsohn): each
    needs the results of earlier blocks only.

    Parameters
    ----------
    rows, columns
        The equations and coordinates of the system, equally many.
    pattern
        Row and column of each entry that is not identically zero.

    Returns
    -------
    tuple of Block or None
        None where the equations cannot be matched with the coordinates: the system is structurally
        singular.
    """
    row_number = {row: k for k, row in enumerate(rows)}
    column_number = {column: k for k, column in enumerate(columns)}
    local = [(row_number[row], column_number[column]) for row, column in pattern]
    if not rows:
        return ()
    matched = matching(local, (len(rows), len(columns)))
    if -1 in matched:
        return None
    owner = {column: row for row, column in enumerate(matched)}
    edges = [(row, owner[column]) for row, column in local]
    heads, tails = zip(*edges, strict=True)
    graph = csr_array((np.ones(len(edges)), (heads, tails)), shape=(len(rows), len(rows)))
    _, labels = connected_components(graph, connection="strong")
    component = labels.tolist()
    needs: dict[int, set[int]] = {label: set() for label in component}
    for head, tail in edges:
        if component[head] != component[tail]:
            needs[component[head]].add(component[tail])
    members: dict[int, list[int]] = {}
    for row, label in enumerate(component):
        members.setdefault(label, []).append(row)
    order = TopologicalSorter({label: sorted(before) for label, before in sorted(needs.items())})
    return tuple(
        Block(
            tuple(rows[row] for row in members[label]),
            tuple(sorted(columns[matched[row]] for row in members[label])),
        )
        for label in order.static_order()
    )
