"""The planned solve as Python text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.lines import wrapped
from kincompile.emitters.numpy.text import NUMPY, assignments, tuple_text
from kincompile.emitters.planned_solve import explained
from kincompile.emitters.printer import Printer
from kincompile.emitters.schedule import Assignment
from kincompile.emitters.solve_statements import operands

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.emitters.planned_solve import BlockCall, SolveListing
    from kincompile.ir.inline import InlineProgram


def solve_functions(code: InlineProgram, listing: SolveListing) -> list[str]:
    """Return the lines of `_factor` and `_solve`."""
    printer, names = Printer(NUMPY, listing.plan.nodes, listing.names), listing.names
    factor = _unpack([names[node] for _, _, node in listing.plan.entries], "J")
    factor += _steps(listing.factor_steps, printer)
    choices = ["where = f.where"] if listing.plan.has_choices else []
    kept = tuple_text(names[node] for node in listing.factors)
    determinants = tuple_text(printer.text(node) for node in listing.plan.determinants)
    factor += f"return {kept}, {determinants}".split("\n")
    solve = [*_unpack([names[node] for node in listing.factors], "F")]
    solve += _unpack([names[node] for node in listing.plan.right], "b")
    solve += _steps(listing.solve_steps, printer)
    solution = tuple_text(printer.text(node) for node in listing.plan.solution)
    solve += f"return {solution}".split("\n")
    return [
        "def _factor(f, J):",
        '    """Factor Phi_q; also return the determinants of its blocks."""',
        *(
            f"    {line}"
            for line in (
                *(f"# {line}" for line in explained(code, listing.plan)),
                *choices,
                *factor,
            )
        ),
        "",
        "",
        "def _solve(f, F, b):",
        '    """Return x of Phi_q x = b."""',
        *(f"    {line}" for line in (*choices, *solve)),
    ]


def _steps(steps: Iterable[Assignment | BlockCall], printer: Printer) -> list[str]:
    """Return the statements of a function; LAPACK takes the larger blocks."""
    lines: list[str] = []
    texts: list[tuple[str, str]] = []
    for step in steps:
        if isinstance(step, Assignment):
            texts.append((step.name, printer.definition(step.node)))
            continue
        function = "solve" if step.right else "determinant"
        lines += assignments(texts)
        lines.append(f"{', '.join(step.names)} = f.block_{function}({step.size}, (")
        lines += operands(step.matrix, printer)
        lines += ["), (", *operands(step.right, printer)] if step.right else []
        lines.append("))")
        texts = []
    return lines + assignments(texts)


def _unpack(names: list[str], vector: str) -> list[str]:
    if not names:
        return []
    lines = wrapped(names)
    if len(lines) == 1:
        return [f"{lines[0] if len(names) == 1 else lines[0].rstrip(',')} = {vector}"]
    return ["(", *(f"    {line}" for line in lines), f") = {vector}"]
