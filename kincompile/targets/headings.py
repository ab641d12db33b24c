"""What emitted code says about itself, in every target: sizes, units, rows, textbook sources."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.quantities import quantity_named
from kincompile.targets.lines import labelled, table

if TYPE_CHECKING:
    from kincompile.ir.inline import Entry, InlineProgram, Section


def header(code: InlineProgram, first: int = 0) -> list[str]:
    """Return the docstring's tables: coordinates, parameters, rows, which count from `first`."""
    program = code.program
    rows = [("row", "constraint", "", "source")]
    for section in code.sections:
        instance, constraint = section.instance, section.instance.constraint
        driver = " (driver)" if constraint.is_driver else ""
        name = f'{instance.kernel.name} "{instance.name}"{driver}'
        rows.append((_rows(section, first), name, " - ".join(instance.bodies), constraint.source))
    lines = labelled("q", [f"{item.name}{_unit(item.unit)}" for item in program.coordinates])
    if program.parameters:
        lines += labelled("p", [f"{item.name}{_unit(item.unit)}" for item in program.parameters])
    return [*lines, "", *table(rows)]


def short_title(section: Section, first: int = 0) -> str:
    """Return rows, type and name of a constraint, for a comment above its code."""
    instance = section.instance
    return f'{_rows(section, first)}  {instance.kernel.name} "{instance.name}"'


def title(section: Section, first: int = 0) -> str:
    """Return rows, type, name and points of a constraint, for a comment above its rows."""
    return f"{short_title(section, first)}: {section.text}"


def place(quantity: str, entry: Entry, code: InlineProgram) -> str:
    """Return which entry of a matrix a line is; nothing for rows of equations, which are titled."""
    found = quantity_named(quantity)
    row = code.program.names_of(found.rows)[entry.row]
    if found.is_matrix:
        return f"{row} by {code.program.names_of(found.columns)[entry.column]}"
    return "" if found.rows == "equations" else row


def _unit(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def _rows(section: Section, first: int) -> str:
    first += section.instance.first_row
    last = first + len(section.entries["Phi"]) - 1
    return str(first) if first == last else f"{first}-{last}"
