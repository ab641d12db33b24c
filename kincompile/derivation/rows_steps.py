"""The steps that joints and free equations have in common: expansion and placement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.derivation.document import (
    Code,
    Display,
    Math,
    Section,
    Verbatim,
    row_range,
    table,
    text,
)
from kincompile.derivation.formulas import Decimal, Equated, Glyph, decimals
from kincompile.tables import counted

if TYPE_CHECKING:
    from kincompile.derivation.document import Block, Run, Runs
    from kincompile.derivation.evaluation import Evaluation
    from kincompile.ir.inline import Section as Rows

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")


def step(name: str, number: int, title: str, level: str, *blocks: Block) -> Section:
    """Return a step of a constraint."""
    return Section(f"{name}-step-{number}", (f"{number}. {title}",), blocks, (), level)


def expansion_step(evaluation: Evaluation, name: str, rows: Rows) -> Section:
    """Return the step in which everything becomes sines and cosines: the emitted code."""
    note = text(
        "This is what the emitted module computes, with its intermediate values written out. "
        "Entries of the Jacobian that are not listed are zero."
    )
    lines = evaluation.expansion(rows, QUANTITIES)
    return step(name, 7, "Expanded to sines and cosines", "expanded", note, *lines)


def placement_step(evaluation: Evaluation, name: str, rows: Rows) -> Section:
    """Return the step that says where the rows and columns of a constraint are."""
    first, count = rows.instance.first_row, len(rows.entries["Phi"])
    note = text(
        f"{counted(count, 'equation')}; the constraints before have {first}: that is the row "
        f"offset. {'Row' if count == 1 else 'Rows'} {row_range(first, count)} counted from 0, "
        f"{row_range(first + 1, count)} counted from 1."
    )
    lines: list[tuple[Run | Runs, ...]] = []
    for column in sorted({entry.column for entry in rows.entries["Phi_q"]}):
        lines.append((Verbatim(evaluation.coordinates[column]), str(column), str(column + 1)))
    header = ("coordinate", "column from 0", "from 1")
    return step(
        name, 8, "Placement by row and column offset", "expanded", note, table(header, lines)
    )


def result_blocks(evaluation: Evaluation, name: str, rows: Rows) -> tuple[Block, ...]:
    """Return the numbers of a constraint's rows: Phi, its columns of Phi_q, nu and gamma."""
    first, count = rows.instance.first_row, len(rows.entries["Phi"])
    chosen = slice(first, first + count)
    columns = sorted({entry.column for entry in rows.entries["Phi_q"]})
    shown = evaluation.shown
    names: list[Run] = []
    for column in columns:
        names += [", " if names else "", Verbatim(evaluation.coordinates[column])]
    return (
        Display(Equated((Glyph("Phi", exponent=name), decimals(shown["Phi"][chosen])))),
        text("In the columns of ", *names, ":"),
        Display(
            Equated(
                (Glyph("Phi", "q", exponent=name), decimals(shown["Phi_q"][chosen][:, columns]))
            )
        ),
        Display(Equated((Glyph("nu", exponent=name), decimals(shown["nu"][chosen])))),
        Display(Equated((Glyph("gamma", exponent=name), decimals(shown["gamma"][chosen])))),
        Code(f"rows = slice({first}, {first + count})  # {name}\nprint(Phi_q(q, t, p)[rows])"),
    )


def state_table(evaluation: Evaluation, names: list[str]) -> Block:
    """Return coordinates and rates at the chosen state."""
    rows: list[tuple[Run | Runs, ...]] = []
    for name in names:
        column = evaluation.coordinates.index(name)
        numbers = (Math(Decimal(evaluation.shown[key][column])) for key in ("q", "q_dot"))
        rows.append((Verbatim(name), *numbers))
    return table(("coordinate", "value", "rate"), rows)
