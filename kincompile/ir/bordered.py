"""A large block of Phi_q a part at a time: the legs of a platform, and then the platform.

Columns that rows of many parts share are the *border*. Without them the block falls into parts,
each of few columns and of at least as many rows. A part is eliminated with pivots from its own
rows; the rows that it does not need have entries in the border alone, and those of all parts
determine it (bordered block diagonal form: Duff, Erisman, Reid, Direct Methods for Sparse Matrices,
chapter 9).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import SAFE_PIVOT
from kincompile.structure.blocks import Block

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from kincompile.ir.graph import Graph

    Rows = Mapping[int, Mapping[int, int]]  # nodes of entries, by row and column

LARGEST_PART = 6
"""Columns of a part: six unknowns a body are the rule in space."""


@dataclass(frozen=True, slots=True)
class Bordered:
    """Parts of a block, and what joins them."""

    parts: tuple[Block, ...]  # each of at least as many rows as columns
    rows: tuple[int, ...]  # those that have entries in the border alone
    border: tuple[int, ...]  # columns


def bordered(
    block: Block, rows: Mapping[int, Collection[int]], value: Callable[[int, int], float]
) -> Bordered | None:
    """Find parts of a block, by the columns of its rows; None where that brings nothing.

    The column that most rows of the largest part share joins the border, until all parts are
    small. A part must be regular where `value` is the size of its entries.
    """
    border: list[int] = []
    while True:
        parts = _parts(block, rows, border)
        largest = max(parts, key=lambda x: len(x.columns))
        if len(largest.columns) <= LARGEST_PART:
            break
        border.append(max(largest.columns, key=lambda x: sum(x in rows[k] for k in largest.rows)))
        if 2 * len(border) > len(block.columns):
            return None
    if len(parts) < 2 or not all(_is_regular(part, rows, value) for part in parts):
        return None
    taken = {row for part in parts for row in part.rows}
    return Bordered(parts, tuple(x for x in block.rows if x not in taken), tuple(sorted(border)))


def _parts(
    block: Block, rows: Mapping[int, Collection[int]], border: Iterable[int]
) -> tuple[Block, ...]:
    """Return what a block falls into where the columns of a border are left out."""
    left = set(block.columns).difference(border)
    found: list[tuple[set[int], set[int]]] = []  # rows and columns
    for row in block.rows:
        own = {row}, left.intersection(rows[row])
        if not own[1]:
            continue
        touched = [part for part in found if part[1] & own[1]]
        for part in touched:
            found.remove(part)
            for mine, others in zip(own, part, strict=True):
                mine |= others
        found.append(own)
    return tuple(Block(tuple(sorted(x)), tuple(sorted(y))) for x, y in found)


def _is_regular(
    part: Block, rows: Mapping[int, Collection[int]], value: Callable[[int, int], float]
) -> bool:
    """Say whether the rows of a part determine its columns, and by no small difference."""
    if len(part.rows) < len(part.columns):
        return False
    entries = [[value(x, y) if y in rows[x] else 0.0 for y in part.columns] for x in part.rows]
    matrix = np.array(entries)
    sizes = np.linalg.svd(matrix / np.abs(matrix).max(axis=1, keepdims=True), compute_uv=False)
    return bool(sizes[-1] > SAFE_PIVOT * sizes[0])


@dataclass(frozen=True, slots=True)
class Eliminated:
    """What elimination with partial pivoting makes of rows: columns from the first one on."""

    upper: list[list[int]]  # rows of the pivots: entries from the pivot on
    inverses: list[int]  # of the pivots
    sides: list[int]
    # rest, rest_sides: rows that are left, of the columns that are
    rest: list[list[int]]
    rest_sides: list[int]
    determinant: int  # product of the pivots, with the sign of all exchanges

    def solved(self, graph: Graph, known: Sequence[int]) -> list[int]:
        """Return the columns that were eliminated, from those that were not."""
        x = list(known)
        for row, inverse, side in zip(
            reversed(self.upper), reversed(self.inverses), reversed(self.sides), strict=True
        ):
            for entry, value in zip(row[1:], x, strict=True):
                side = graph.sub(side, graph.mul(entry, value))
            x.insert(0, graph.mul(side, inverse))
        return x[: len(self.upper)]


def eliminated(
    graph: Graph, rows: Sequence[Sequence[int]], sides: Sequence[int], count: int
) -> Eliminated:
    """Eliminate the first columns of rows, with partial pivoting.

    Rows change places by choices, not by branches, so that many points are solved at once.
    """
    a, b, determinant = [list(row) for row in rows], list(sides), graph.const(1)
    upper, inverses = [], []
    for k in range(count):
        for i in range(k + 1, len(a)):
            if graph.value_of(a[i][0]) == 0:
                continue  # never larger
            is_larger = graph.compare("<", graph.square(a[k][0]), graph.square(a[i][0]))
            choose = partial(graph.select, is_larger)
            pairs = [(choose(y, x), choose(x, y)) for x, y in zip(a[k], a[i], strict=True)]
            a[k], a[i] = (list(row) for row in zip(*pairs, strict=True))
            b[k], b[i] = choose(b[i], b[k]), choose(b[k], b[i])
            determinant = choose(graph.neg(determinant), determinant)
        determinant = graph.mul(determinant, a[k][0])
        upper.append(a[k])
        inverses.append(graph.div(graph.const(1), a[k][0]))
        for i in range(k + 1, len(a)):
            factor = graph.mul(a[i][0], inverses[k])
            a[i] = [
                graph.sub(x, graph.mul(factor, y)) for x, y in zip(a[i][1:], a[k][1:], strict=True)
            ]
            b[i] = graph.sub(b[i], graph.mul(factor, b[k]))
    return Eliminated(upper, inverses, b[:count], a[count:], b[count:], determinant)


def solve_parts(
    graph: Graph,
    block: Block,
    form: Bordered,
    rows: Rows,
    sides: Mapping[int, int],
    solve: Callable[[list[list[int]], list[int]], tuple[list[int], int]],
) -> tuple[dict[int, int], int]:
    """Return the solution of a block by column, and its determinant.

    `solve` gives x of a x = b and the determinant of a.
    """
    zero = graph.const(0)
    done, first_rows, last_rows = [], list[int](), list[int]()
    left = list[tuple[dict[int, int], int]]()  # rows of the border, and their sides
    for part in form.parts:
        shared = set().union(*(rows[x] for x in part.rows))
        border = [x for x in form.border if x in shared]
        columns, count = [*part.columns, *border], len(part.columns)
        own = [[rows[x].get(y, zero) for y in columns] for x in part.rows]
        found = eliminated(graph, own, [sides[x] for x in part.rows], count)
        done.append((part, border, found))
        first_rows += part.rows[:count]
        last_rows += part.rows[count:]
        rest = (dict(zip(border, row, strict=True)) for row in found.rest)
        left += zip(rest, found.rest_sides, strict=True)
    last_rows += form.rows
    left += [(dict(rows[x]), sides[x]) for x in form.rows]
    a = [[row.get(y, zero) for y in form.border] for row, _ in left]
    x, determinant = solve(a, [side for _, side in left])
    solution = dict(zip(form.border, x, strict=True))
    for part, border, found in done:
        own_x = found.solved(graph, [solution[y] for y in border])
        solution |= zip(part.columns, own_x, strict=True)
        determinant = graph.mul(determinant, found.determinant)
    columns = [y for part in form.parts for y in part.columns]
    is_odd = _is_odd([*first_rows, *last_rows], block.rows)
    if is_odd != _is_odd([*columns, *form.border], block.columns):
        determinant = graph.neg(determinant)
    return solution, determinant


def _is_odd(order: Sequence[int], given: Sequence[int]) -> bool:
    """Say whether one order of numbers comes from another by an odd number of exchanges."""
    places = [given.index(x) for x in order]
    return sum(x > y for k, x in enumerate(places) for y in places[k + 1 :]) % 2 == 1
