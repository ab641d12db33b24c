"""What all sections of a page share: the situation, the expanded formulas, anchors and lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.calculus.expressions import Symbol
from kincompile.derivation.document import Display, Math, Table, cells
from kincompile.derivation.emitted_lines import emitted_lines
from kincompile.derivation.expanded import Writer
from kincompile.derivation.formulas import Decimal, Equated, Glyph, Partial, size

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.derivation.document import Run, Runs, SourceLine
    from kincompile.derivation.formulas import Formula
    from kincompile.derivation.situation import Array, Situation
    from kincompile.ir.inline import Entry
    from kincompile.ir.inline import Section as Rows

BRIEF = 30
"""Nodes of a formula that still fits into a cell of a table."""

ROUNDING = 1e-14
"""Numbers this much smaller than the largest of their kind are shown as zero."""


class Page:
    """A page in the making."""

    def __init__(self, situation: Situation) -> None:
        self.situation = situation
        self.system = situation.system
        self.coordinates = [item.name for item in situation.system.coordinates]
        self.equations = situation.system.equations
        self._writer = Writer(situation.code.nodes)
        self._lines = emitted_lines(situation.code, situation.source)
        self.shown = _shown(situation)

    def expanded(self, entry: Entry) -> Formula:
        """Return an entry in sines and cosines."""
        return self._writer.formula(entry.node)

    def line(self, quantity: str, entry: Entry) -> SourceLine | None:
        """Return where the emitted module computes an entry."""
        return self._lines.get((quantity, entry.row, entry.column))

    def symbol(self, quantity: str, row: int) -> Glyph:
        """Return the symbol of an equation's Phi, nu or gamma."""
        return Glyph(quantity, self.equations[row], bold=False)

    def value(self, quantity: str, entry: Entry) -> float:
        """Return an entry's number at the chosen state, from the emitted module."""
        values = self.shown[quantity]
        return float(values[entry.row, entry.column] if values.ndim == 2 else values[entry.row])

    def partial(self, entry: Entry) -> Partial:
        """Return the symbol of an entry of Phi_q."""
        return Partial(self.symbol("Phi", entry.row), Symbol(self.coordinates[entry.column]))

    def brief(self, quantity: str, entry: Entry) -> Math:
        """Return an entry in sines and cosines where that is short, else its symbol."""
        formula = self.expanded(entry)
        if size(formula) <= BRIEF:
            return Math(formula)
        is_cell = quantity == "Phi_q"
        return Math(self.partial(entry) if is_cell else self.symbol(quantity, entry.row))

    def display(self, quantity: str, entry: Entry) -> Display:
        """Return an entry's line: symbol, formula, number, and the code that computes it."""
        is_cell = quantity == "Phi_q"
        left = self.partial(entry) if is_cell else self.symbol(quantity, entry.row)
        formula, number = self.expanded(entry), Decimal(self.value(quantity, entry))
        parts = (left, formula) if is_number(formula) else (left, formula, number)
        return Display(Equated(parts), anchor(quantity, entry), self.line(quantity, entry))

    def expansion(self, rows: Rows, quantities: tuple[str, ...]) -> tuple[Display, ...]:
        """Return the lines of a constraint's entries."""
        return tuple(
            self.display(quantity, entry) for name in quantities
            for quantity, entry in ((name, item) for item in rows.entries[name])
        )  # fmt: skip


def _shown(situation: Situation) -> dict[str, Array]:
    """Return the numbers of a situation without those that are rounding errors of zero."""
    names = ("q", "q_dot", "q_ddot", "nu", "gamma", "Phi_q")
    found = {name: getattr(situation, name) for name in names}
    sizes = {name: np.max(np.abs(values), initial=0.0) for name, values in found.items()}
    # Phi of an assembled mechanism is nothing but rounding error.
    found["Phi"], sizes["Phi"] = situation.Phi, sizes["q"]
    return {
        name: np.where(np.abs(values) <= ROUNDING * sizes[name], 0.0, values)
        for name, values in found.items()
    }


def is_number(formula: Formula) -> bool:
    """Return whether a formula is a plain number as it stands."""
    return type(formula).__name__ in ("Number", "Decimal")


def anchor(quantity: str, entry: Entry) -> str:
    """Return the anchor of an entry's line."""
    place = f"{entry.row}-{entry.column}" if quantity == "Phi_q" else str(entry.row)
    return f"{quantity}-{place}"


def table(
    header: tuple[Run, ...], rows: Sequence[tuple[Run | Runs, ...]], folded: str = ""
) -> Table:
    """Return a table from runs."""
    return Table(cells(*header), tuple(cells(*row) for row in rows), folded)


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, in the plural where it is not one."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def row_range(first: int, count: int) -> str:
    """Return rows from a first one, for instance 3-4 with a dash."""
    return str(first) if count == 1 else f"{first}\N{EN DASH}{first + count - 1}"
