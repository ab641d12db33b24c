"""The planned solve as Python text."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from kincompile.targets.lines import wrapped
from kincompile.targets.numpy.dialect import NUMPY
from kincompile.targets.numpy.text import assignments, tuple_text
from kincompile.targets.planned_solve import components, explained
from kincompile.targets.printer import Printer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.ir.inline import InlineProgram
    from kincompile.targets.planned_solve import SolveListing


def solve_functions(code: InlineProgram, listing: SolveListing, prefix: str = "") -> list[str]:
    """Return the lines of `_factor` and `_solve`, with a prefix where there are several."""
    printer, names = Printer(NUMPY, listing.plan.nodes, listing.names), listing.names
    factor = [*_unpack([names[node] for node in listing.entries], "J")]
    factor += _steps(listing.factor_steps, listing, printer)
    kept = tuple_text(names[node] for node in listing.factors)
    determinants = tuple_text(printer.text(node) for node in listing.plan.determinants)
    factor += f"return {kept}, {determinants}".split("\n")
    solve = [*_unpack([names[node] for node in listing.factors], "F")]
    solve += _unpack([names[node] for node in listing.plan.right], "b")
    solve += _steps(listing.solve_steps, listing, printer)
    solution = tuple_text(printer.text(node) for node in listing.plan.solution)
    solve += f"return {solution}".split("\n")
    return [
        f"def {prefix}_factor(f, J):",
        '    """Return what a solve needs of Phi_q, and the determinants of its blocks."""',
        *(
            f"    {line}"
            for line in (*(f"# {line}" for line in explained(code, listing.plan)), *factor)
        ),
        "",
        "",
        f"def {prefix}_solve(f, F, b):",
        '    """Return x of Phi_q x = b."""',
        *(f"    {line}" for line in solve),
    ]


def _steps(nodes: Iterable[int], listing: SolveListing, printer: Printer) -> list[str]:
    """Return an assignment for each node; a larger block's solution comes from one call."""
    lines: list[str] = []
    done: set[tuple[int, ...]] = set()
    for is_linear, group in itertools.groupby(
        nodes, lambda node: listing.plan.nodes[node][0] == "linear"
    ):
        if not is_linear:
            lines += assignments([(listing.names[k], printer.definition(k)) for k in group])
            continue
        for node in group:
            _, name, size, _, *operands = listing.plan.nodes[node]
            if (name, *operands) not in done:
                done.add((name, *operands))
                lines += _block_call(node, name, size, operands, listing, printer)
    return lines


def _block_call(
    node: int,
    name: str,
    size: int,
    operands: list[int],
    listing: SolveListing,
    printer: Printer,
) -> list[str]:
    """Return the call of LAPACK for a block: its solution, or its determinant."""
    left = [listing.names[node]]
    if name == "solve":
        left = [listing.names[k] for k in components(listing.plan, node)]
    matrix, right = operands[: size * size], operands[size * size :]
    lines = [f"{', '.join(left)} = f.block_{name}({size}, (", *_indented(matrix, printer)]
    if right:
        lines += ["), (", *_indented(right, printer)]
    return [*lines, "))"]


def _indented(nodes: list[int], printer: Printer) -> list[str]:
    return [f"    {line}" for line in wrapped([printer.text(node) for node in nodes])]


def _unpack(names: list[str], vector: str) -> list[str]:
    if not names:
        return []
    lines = wrapped(names)
    if len(lines) == 1:
        return [f"{lines[0] if len(names) == 1 else lines[0].rstrip(',')} = {vector}"]
    return ["(", *(f"    {line}" for line in lines), f") = {vector}"]
