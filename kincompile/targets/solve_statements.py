"""The planned solve as statements: what C and JavaScript write alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.targets.lines import wrapped
from kincompile.targets.schedule import Assignment, count_uses

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import TypeAlias

    from kincompile.ir.inline import InlineProgram
    from kincompile.targets.planned_solve import BlockCall, SolveListing
    from kincompile.targets.printer import Printer
    from kincompile.targets.statements import Statements

    Call: TypeAlias = Callable[[BlockCall, Printer], list[str]]


def factorization(
    write: Statements, code: InlineProgram, listing: SolveListing, printer: Printer, call: Call
) -> list[str]:
    """Return the statements that take Phi_q, in the order of its pattern, to F and determinants.

    `call` gives the statements that solve a larger block, or take its determinant.
    """
    plan, names = listing.plan, listing.names
    numbers = {place: k for k, place in enumerate(code.pattern())}
    read = count_uses(plan.nodes, (*listing.factors, *plan.determinants))
    lines = []
    for row, column, node in plan.entries:
        if node in read:
            entry = write.element.format("Phi_q", numbers[row, column])
            lines += write.assigned(write.value.format(names[node]), entry)
    lines += _steps(write, listing.factor_steps, printer, call)
    for k, node in enumerate(listing.factors):
        lines += write.assigned(write.element.format("F", k), names[node])
    for k, node in enumerate(plan.determinants):
        lines += write.assigned(write.element.format("determinants", k), printer.text(node))
    return lines


def solution(write: Statements, listing: SolveListing, printer: Printer, call: Call) -> list[str]:
    """Return the statements that take F and `right` to `to`, x of Phi_q x = right."""
    plan, names = listing.plan, listing.names
    read = count_uses(plan.nodes, plan.solution)
    given = [(names[node], "F", k) for k, node in enumerate(listing.factors)]
    given += [(names[node], "right", k) for k, node in enumerate(plan.right) if node in read]
    lines = []
    for name, vector, k in given:
        lines += write.assigned(write.value.format(name), write.element.format(vector, k))
    lines += _steps(write, listing.solve_steps, printer, call)
    for k, node in enumerate(plan.solution):
        lines += write.assigned(write.element.format("to", k), printer.text(node))
    return lines


def operands(nodes: Iterable[int], printer: Printer) -> list[str]:
    """Return the indented lines of numbers that a call is given."""
    return [f"    {line}" for line in wrapped([printer.text(node) for node in nodes])]


def _steps(
    write: Statements, steps: Iterable[Assignment | BlockCall], printer: Printer, call: Call
) -> list[str]:
    """Return the statements of a function; larger blocks are solved by a call."""
    lines: list[str] = []
    for step in steps:
        if isinstance(step, Assignment):
            lines += write.assigned(write.value.format(step.name), printer.definition(step.node))
        else:
            lines += call(step, printer)
    return lines
