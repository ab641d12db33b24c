"""The orders in which a hand-written Jacobian may have its columns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from kincompile.checker.reference import ConstraintBlock, Reference
    from kincompile.checker.states import Array

Columns = tuple[int | None, ...]
_MOST_PERMUTED = 5  # 120 orders; with more bodies only the reversed order is tried
MOVED = "the bodies have another order"
PERMUTED = "the coordinates have another order"
_WITH_GROUND = "columns of the ground are present (they are not checked)"


@dataclass(frozen=True, slots=True)
class Layout:
    """The generated column of each hand-written column; None where it belongs to the ground.

    `convention` is the difference from the order of the system in words, "" where there is none.
    """

    columns: Columns
    convention: str = ""

    def arranged(self, values: Array) -> Array:
        """Return values by column of the system, (..., n), in this order; NaN for the ground."""
        last = np.full((*values.shape[:-1], 1), np.nan)
        order = [-1 if column is None else column for column in self.columns]
        return np.concatenate([values, last], axis=-1)[..., order]

    def is_shown(self, rows: Collection[int], blocks: Iterable[ConstraintBlock]) -> bool:
        """Return whether rows that it explains show it; it is one for all of a hand-in.

        Blocks of two bodies that are swapped in one constraint are a slip, and so are two entries
        that are swapped in one row: for another order of bodies it takes two constraints.
        """
        if self.convention.startswith(MOVED):
            return sum(not set(rows).isdisjoint(block.rows) for block in blocks) > 1
        return len(rows) > (self.convention == PERMUTED)

    def by_column(self, values: Array, count: int) -> Array:
        """Return values in this order by the `count` columns of the system; zeros for the rest."""
        own = [k for k, column in enumerate(self.columns) if column is not None]
        result = np.zeros((*values.shape[:-1], count))
        result[..., [column for column in self.columns if column is not None]] = values[..., own]
        return result


def usual_layout(reference: Reference, block: ConstraintBlock | None, width: int) -> Layout | None:
    """Return the layout of the system's own order for a matrix of a width, None where none fits."""
    every = tuple(range(len(reference.coordinates)))
    layouts = [Layout(every)]
    if block is not None:
        layouts.append(Layout(tuple(column for column in block.columns if column is not None)))
        layouts.append(Layout(block.columns, _WITH_GROUND))
    if reference.system.bodies:
        layouts.append(Layout((*_ground(reference), *every), _WITH_GROUND))
    return next((layout for layout in layouts if len(layout.columns) == width), None)


def _ground(reference: Reference) -> Columns:
    return (None,) * len(next(iter(reference.body_columns), ()))


def expected_widths(reference: Reference, block: ConstraintBlock | None) -> str:
    """Return in words how many columns a Jacobian may have."""
    every = reference.coordinates
    text = f"{len(every)} columns, one for each of: {listed(every, 60)}"
    if block is not None:
        own = [every[k] for k in block.columns if k is not None]
        text += f"; or {len(own)}, those of the constraint: {listed(own)}"
    return text


def other_layouts(reference: Reference, usual: Layout) -> Iterator[Layout]:
    """Yield layouts in other orders: of the bodies, of their coordinates, of the ground."""
    groups, rest = _split(reference, usual.columns)
    bodies = [group for group in groups if None not in group]
    ground = _ground(reference) if len(bodies) < len(groups) else ()
    seen = {usual.columns}
    for order in _orders(bodies):
        for words, columns in _arrangements(order, is_moved=list(order) != bodies):
            for placed in _with_ground((*columns, *rest), ground):
                if placed not in seen:
                    seen.add(placed)
                    text = [*words, _WITH_GROUND] if ground else words
                    yield Layout(placed, "; ".join(text))
    if not groups and len(rest) <= _MOST_PERMUTED:
        for other in permutations(rest):
            if other != usual.columns:
                yield Layout(other, PERMUTED)


def _split(reference: Reference, columns: Columns) -> tuple[list[Columns], Columns]:
    """Return the columns of each body, ground included, and the other columns."""
    widths: dict[int | None, int] = {own[0]: len(own) for own in reference.body_columns}
    widths[None] = len(_ground(reference))
    groups: list[Columns] = []
    while columns and (width := widths.get(columns[0], 0)):
        groups.append(columns[:width])
        columns = columns[width:]
    return groups, columns


def _orders(bodies: Sequence[Columns]) -> Iterator[tuple[Columns, ...]]:
    if len(bodies) <= _MOST_PERMUTED:
        yield from permutations(bodies)
    else:
        yield tuple(bodies)
        yield tuple(reversed(bodies))


_ORIENTATIONS = {
    3: (2, "angle", "angles"),
    6: (3, "small rotation", "small rotations"),
    7: (3, *("Euler parameters",) * 2),
}
"""By the number of columns of a body: where those of its orientation begin, and their names."""


def _arrangements(
    order: tuple[Columns, ...], is_moved: bool
) -> Iterator[tuple[list[str], list[int | None]]]:
    """Yield the ways to write the coordinates of bodies in a given order, each with its name."""
    words = [MOVED] if is_moved else []
    yield words, [column for triple in order for column in triple]
    width = len(order[0]) if order else 0
    place, turn, turns = _ORIENTATIONS.get(width, (width, "", ""))
    turned_first = [column for own in order for column in (*own[place:], *own[:place])]
    yield [*words, f"each body has its {turn} first"], turned_first
    by_kind = [column for kind in zip(*order, strict=True) for column in kind]
    yield [*words, f"all x come first, then all y, then all {turns}"], by_kind
    positions = [column for own in order for column in own[:place]]
    rest = [column for own in order for column in own[place:]]
    yield [*words, f"the positions come first, then the {turns}"], [*positions, *rest]


def _with_ground(columns: Columns, ground: Columns) -> Iterator[Columns]:
    """Yield the columns with those of the ground at every place between two bodies."""
    for k in range(0, len(columns) + 1, len(ground)) if ground else (0,):
        yield (*columns[:k], *ground, *columns[k:])
