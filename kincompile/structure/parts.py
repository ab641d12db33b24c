"""The parts of a system by Dulmage and Mendelsohn: where there are too many equations, too few."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.structure.blocks import Block, block_triangular, matching

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


@dataclass(frozen=True, slots=True)
class Parts:
    """Rows and columns of Phi_q by what the pattern alone says of them.

    Attributes
    ----------
    too_many_rows, too_many_columns
        Equations of which there are more than coordinates in them, and those coordinates.
    blocks
        The part in which each equation determines a coordinate, in the order of solution.
    too_few_rows, too_few_columns
        Coordinates of which there are more than equations for them, and those equations.
    """

    too_many_rows: tuple[int, ...]
    too_many_columns: tuple[int, ...]
    blocks: tuple[Block, ...]
    too_few_rows: tuple[int, ...]
    too_few_columns: tuple[int, ...]


def parts_of(pattern: Sequence[tuple[int, int]], shape: tuple[int, int]) -> Parts:
    """Split a system into the part with too many equations, the well determined, the rest.

    Parameters
    ----------
    pattern
        Row and column of each entry that is not identically zero.
    shape
        Numbers of equations and of coordinates.
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
    many_rows, many_columns = _reached(_missing(of_row), columns_of, of_column)
    few_columns, few_rows = _reached(_missing(of_column), rows_of, of_row)
    rows = [row for row in range(m) if row not in many_rows | few_rows]
    columns = [column for column in range(n) if column not in many_columns | few_columns]
    inner_rows, inner_columns = set(rows), set(columns)
    inner = [
        (row, column) for row, column in pattern if row in inner_rows and column in inner_columns
    ]
    return Parts(
        tuple(sorted(many_rows)),
        tuple(sorted(many_columns)),
        block_triangular(rows, columns, inner) or (),
        tuple(sorted(few_rows)),
        tuple(sorted(few_columns)),
    )


def _missing(matched: Iterable[int]) -> list[int]:
    """Return what has no partner."""
    return [item for item, partner in enumerate(matched) if partner < 0]


def _reached(
    start: list[int], others_of: Sequence[Sequence[int]], partner: Sequence[int]
) -> tuple[set[int], set[int]]:
    """Follow alternating paths from items without a partner; return items and others on them."""
    items, others, waiting = set(start), set(), list(start)
    while waiting:
        for other in others_of[waiting.pop()]:
            if other not in others:
                others.add(other)
                following = partner[other]
                if following >= 0 and following not in items:
                    items.add(following)
                    waiting.append(following)
    return items, others
