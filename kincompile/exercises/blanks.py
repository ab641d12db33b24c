"""The blanks of an exercise: entries of Phi_q and of gamma, or where a slip in Phi_q is."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, zip_longest
from random import Random
from typing import TYPE_CHECKING, TypeAlias

from kincompile.errors import InputError
from kincompile.model.resolve import Joint

if TYPE_CHECKING:
    import sympy

    from kincompile.model.system import ConstraintSystem

ENTRIES, ROWS = 6, 3
"""Blanks in Phi_q and in gamma."""

PLACE = "place"
"""The quantity of a blank in which the place of a slip in Phi_q is named."""

MOST_OPERATIONS = 60
"""Operations up to which an entry is asked for by hand."""

DIGITS = 3
"""Significant digits of a number in an exam, where a teacher asks for no others."""

State: TypeAlias = dict[str, float]
"""Values of coordinates, rates and t by name, at which an exam asks for numbers."""


@dataclass(frozen=True, slots=True)
class Blank:
    """An entry to be filled."""

    name: str  # what it is called in the hand-in file, ``"B1"``; ``"P1"`` of a place
    constraint: str  # name of the constraint
    quantity: str  # ``"Phi_q"``, ``"gamma"`` or `PLACE`
    row: int  # index of the equation in the system
    column: int | None  # index of the coordinate; None of gamma

    def label(self, system: ConstraintSystem) -> str:
        """Return the entry by the names of its equation and coordinate."""
        row = system.equations[self.row]
        if self.column is None:
            return f"{self.quantity}[{row}]"
        return f"{self.quantity}[{row}, {system.coordinates[self.column].name}]"

    def answer(self, Phi_q: sympy.ImmutableMatrix, gamma: sympy.ImmutableMatrix) -> sympy.Expr:
        """Return the right formula."""
        column = self.column
        found: sympy.Expr = gamma[self.row, 0] if column is None else Phi_q[self.row, column]
        return found


def choose_blanks(system: ConstraintSystem, seed: int) -> tuple[Blank, ...]:
    """Choose entries that a student must derive: those that vary, of all joints in turn."""
    random = Random(f"blanks-{seed}")
    Phi_q, gamma = system.Phi_q, system.gamma  # made anew each time they are asked for
    entries: list[list[tuple[str, str, int, int | None]]] = []
    rows: list[list[tuple[str, str, int, int | None]]] = []
    for item, first in zip(system.constraints, system.row_offsets, strict=True):
        if not isinstance(item, Joint) or item.written.is_own:
            continue
        own = range(first, first + len(item.equation_names))
        found: list[tuple[str, str, int, int | None]] = [
            (item.name, "Phi_q", row, column)
            for row in own
            for column in range(len(system.coordinates))
            if is_fair(Phi_q[row, column])
        ]
        random.shuffle(found)
        entries.append(found)
        gammas: list[tuple[str, str, int, int | None]] = [
            (item.name, "gamma", row, None) for row in own if is_fair(gamma[row, 0])
        ]
        random.shuffle(gammas)
        rows.append(gammas)
    chosen = [*_in_turn(entries)[:ENTRIES], *_in_turn(rows)[:ROWS]]
    if not chosen:
        raise InputError(
            f"{system.name} has no joint whose Phi_q or gamma varies, so there is nothing to ask; "
            "give a mechanism with bodies and joints"
        )
    chosen.sort(key=lambda item: (item[1] == "gamma", item[2], item[3] or 0))
    return tuple(Blank(f"B{k}", *item) for k, item in enumerate(chosen, 1))


def is_fair(entry: sympy.Expr) -> bool:
    """Return whether an entry varies, and is short enough to be derived by hand."""
    return bool(entry.free_symbols) and int(entry.count_ops()) <= MOST_OPERATIONS


def _in_turn(
    groups: list[list[tuple[str, str, int, int | None]]],
) -> list[tuple[str, str, int, int | None]]:
    """Return the first of each group, then the second of each, and so on."""
    return [item for item in chain.from_iterable(zip_longest(*groups)) if item is not None]
