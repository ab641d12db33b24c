"""The orders in which a hand-written Jacobian may have its columns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.compare.reference import Block, Reference

Columns = tuple[int | None, ...]
_MOST_PERMUTED = 5  # 120 orders; with more bodies only the reversed order is tried


@dataclass(frozen=True, slots=True)
class Layout:
    """Which generated column each hand-written column is; None where it belongs to the ground.

    `convention` says in words how this differs from the order of the system, "" where it does not.
    """

    columns: Columns
    convention: str = ""


def usual_layout(reference: Reference, block: Block | None, width: int) -> Layout | None:
    """Return the layout of the system's own order for a matrix of a width, None where none fits."""
    every = tuple(range(len(reference.coordinates)))
    if width == len(every):
        return Layout(every)
    if block is not None:
        own = tuple(column for column in block.columns if column is not None)
        if width == len(own):
            return Layout(own)
        if width == len(block.columns):
            return Layout(block.columns, _GROUND)
    ground = _ground(reference)
    if width == len(every) + len(ground) and ground:
        return Layout((*ground, *every), _GROUND)
    return None


def _ground(reference: Reference) -> Columns:
    """Return the columns of the ground, as many as a body has."""
    return (None,) * len(next(iter(reference.system.body_columns), ()))


_GROUND = "columns of the ground are present (they are not checked)"


def expected_widths(reference: Reference, block: Block | None) -> str:
    """Say how many columns a Jacobian may have."""
    every = len(reference.coordinates)
    names = listed(reference.coordinates, 60)
    text = f"{every} columns, one for each of: {names}"
    if block is not None:
        own = [reference.coordinates[k] for k in block.columns if k is not None]
        text += f"; or {len(own)}, those of the constraint: {listed(own)}"
    return text


def other_layouts(reference: Reference, usual: Layout, row_count: int) -> Iterator[Layout]:
    """Yield layouts in other orders: of the bodies, of their coordinates, of the ground."""
    groups, rest = _groups(reference, usual.columns)
    ground = [group for group in groups if None in group]
    bodies = [group for group in groups if group not in ground]
    seen = {usual.columns}
    for order in _orders(bodies):
        for layout in _arranged(order, rest, moved=list(order) != bodies):
            for columns in _with_ground(layout.columns, ground):
                if columns not in seen:
                    seen.add(columns)
                    words = [layout.convention] if layout.convention else []
                    yield Layout(columns, "; ".join([*words, *([_GROUND] if ground else [])]))
    # One row alone cannot tell an order from a slip.
    if not groups and row_count > 1 and len(rest) <= _MOST_PERMUTED:
        for columns in permutations(rest):
            if columns not in seen:
                yield Layout(columns, "the coordinates have another order")


def _groups(reference: Reference, columns: Columns) -> tuple[list[Columns], Columns]:
    """Return the columns of each body, ground included, and the other columns."""
    of_bodies = reference.system.body_columns
    starts: dict[int | None, int] = {own[0]: len(own) for own in of_bodies}
    starts[None] = len(_ground(reference))
    groups: list[Columns] = []
    k = 0
    while k < len(columns) and (width := starts.get(columns[k], 0)):
        groups.append(columns[k : k + width])
        k += width
    return groups, columns[k:]


def _orders(bodies: list[Columns]) -> Iterator[tuple[Columns, ...]]:
    if len(bodies) <= _MOST_PERMUTED:
        yield from permutations(bodies)
    else:
        yield tuple(bodies)
        yield tuple(reversed(bodies))


def _arranged(order: tuple[Columns, ...], rest: Columns, moved: bool) -> Iterator[Layout]:
    """Yield the ways to write the coordinates of bodies in a given order."""
    words = ["the bodies have another order"] if moved else []
    by_kind = list(zip(*order, strict=True))
    arrangements = {
        "": [column for x, y, phi in order for column in (x, y, phi)],
        "each body has its angle first": [c for x, y, phi in order for c in (phi, x, y)],
        "all x come first, then all y, then all angles": [c for kind in by_kind for c in kind],
        "the positions come first, then the angles": [
            *(column for x, y, _ in order for column in (x, y)),
            *(phi for _, _, phi in order),
        ],
    }
    for text, columns in arrangements.items():
        yield Layout((*columns, *rest), "; ".join([*words, *([text] if text else [])]))


def _with_ground(columns: Columns, ground: list[Columns]) -> Iterator[Columns]:
    """Yield the columns with those of the ground at every place between two bodies."""
    if not ground:
        yield columns
        return
    for k in range(0, len(columns) + 1, len(ground[0])):
        yield (*columns[:k], *ground[0], *columns[k:])
