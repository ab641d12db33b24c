"""What emitted code says about itself: names, sizes, units, numbers, rows, textbook sources."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.lines import labelled, table
from kincompile.quantities import quantity_named

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.ir.inline import ConstraintRows, Entry, InlineProgram
    from kincompile.ir.program import Instance


def header(code: InlineProgram, first: int = 0) -> list[str]:
    """Return the docstring's tables: coordinates, parameters, rows, which count from `first`."""
    program = code.program
    rows = [("row", "constraint", "", "source")]
    for section in code.constraints:
        instance, constraint = section.instance, section.instance.constraint
        driver = " (driver)" if constraint.is_driver else ""
        name = f'{instance.kernel.name} "{instance.name}"{driver}'
        rows.append((_rows(section, first), name, " - ".join(instance.bodies), constraint.source))
    lines = labelled("q", [f"{item.name}{_unit(item.unit)}" for item in program.coordinates])
    if program.parameters:
        lines += labelled("p", [f"{item.name}{_unit(item.unit)}" for item in program.parameters])
    if program.observers:
        lines += labelled("y", [f"{item.name}{_unit(item.unit)}" for item in program.outputs])
    lines += ["", *table(rows)]
    if program.loads:
        lines += ["", *table([("load", "", "source"), *map(_load, program.loads)])]
    return lines


def _load(item: Instance) -> tuple[str, str, str]:
    """Return type and name, bodies and source of a load."""
    name = f'{item.kernel.name} "{item.name}"'
    return name, " - ".join(item.bodies), item.constraint.source


def short_title(section: ConstraintRows, first: int = 0) -> str:
    """Return rows, type and name of a constraint or output, for a comment above its code."""
    instance = section.instance
    return f'{_rows(section, first)}  {instance.kernel.name} "{instance.name}"'


def title(section: ConstraintRows, first: int = 0) -> str:
    """Return rows, type, name and points of a constraint, for a comment above its rows.

    The last load has the sums over all of them.
    """
    if section.instance.is_load:
        return "sums over masses and loads"
    if section.instance.is_motion:
        return "M, Phi_q, Q and gamma together"
    return f"{short_title(section, first)}: {section.instance.constraint.text}"


def entry_titles(quantity: str, code: InlineProgram) -> Callable[[Entry], str]:
    """Return what says which entry a line is; nothing for rows of equations, which are titled."""
    found = quantity_named(quantity)
    rows, columns = (code.program.names_of(kind) for kind in (found.rows, found.columns))
    if found.is_matrix:
        return lambda entry: f"{rows[entry.row]} by {columns[entry.column]}"
    return lambda entry: "" if found.is_by_constraint else rows[entry.row]


def _unit(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def _rows(section: ConstraintRows, first: int) -> str:
    count = len(section.entries["Phi"])
    if count == 0:  # an output
        return str(first + section.instance.first_output)
    first += section.instance.first_row
    last = first + count - 1
    return str(first) if first == last else f"{first}-{last}"
