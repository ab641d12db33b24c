"""The planned solve as statements: what C, JavaScript and Octave write alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.lines import wrapped
from kincompile.emitters.planned_solve import explained
from kincompile.emitters.schedule import Assignment, count_uses

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import TypeAlias

    from kincompile.emitters.planned_solve import BlockCall, SolveListing
    from kincompile.emitters.printer import Printer
    from kincompile.emitters.statements import Statements
    from kincompile.ir.inline import InlineProgram

    Call: TypeAlias = Callable[[BlockCall, Printer], list[str]]


def solve_functions(
    code: InlineProgram, listing: SolveListing, factor: list[str], solve: list[str]
) -> list[str]:
    """Return the functions that factor Phi_q and that solve Phi_q x = right, with what they are."""
    return [
        "",
        "// Factor Phi_q; also return the determinants of its blocks.",
        *(f"// {line}" for line in explained(code, listing.plan)),
        *factor,
        "",
        "// x of Phi_q x = right.",
        *solve,
    ]


def factorization(
    write: Statements, code: InlineProgram, listing: SolveListing, printer: Printer, call: Call
) -> list[str]:
    """Return the statements that take Phi_q to F and determinants.

    Phi_q is a matrix, or its entries in the order of the pattern. `call` gives the statements that
    solve a larger block, or take its determinant.
    """
    plan, names = listing.plan, listing.names
    numbers = {place: k for k, place in enumerate(code.pattern())}
    read = count_uses(plan.nodes, (*listing.factors, *plan.determinants))
    lines = []
    for row, column, node in plan.entries:
        if node in read:
            place = row + write.first, column + write.first
            entry = write.element.format("Phi_q", numbers[row, column])
            entry = write.entry.format("Phi_q", *place) or entry
            lines += write.assigned(write.value.format(names[node]), entry)
    lines += _steps(write, listing.factor_steps, printer, call)
    for k, node in enumerate(listing.factors):
        text = write.kept.format(names[node]) if _is_truth(listing, node) else names[node]
        lines += write.assigned(write.element.format("F", k), text)
    for k, node in enumerate(plan.determinants):
        lines += write.assigned(
            write.element.format("determinants", k + write.first), printer.text(node)
        )
    return lines


def solution(write: Statements, listing: SolveListing, printer: Printer, call: Call) -> list[str]:
    """Return the statements that take F and `right` to `to`, x of Phi_q x = right.

    Entries of Phi_q that are not in F are read by themselves, in the order of the pattern.
    """
    plan, names = listing.plan, listing.names
    read = count_uses(plan.nodes, plan.solution)
    given = [(node, "Phi_q", k) for node, k in listing.entries]
    given += [(node, "F", k) for k, node in enumerate(listing.factors)]
    given += [(node, "right", k) for k, node in enumerate(plan.right) if node in read]
    lines = []
    for node, vector, k in given:
        text = write.element.format(vector, k)
        text = write.taken.format(text) if _is_truth(listing, node) else text
        lines += write.assigned(write.value.format(names[node]), text)
    lines += _steps(write, listing.solve_steps, printer, call)
    for k, node in enumerate(plan.solution):
        lines += write.assigned(write.element.format("to", k), printer.text(node))
    return lines


def _is_truth(listing: SolveListing, node: int) -> bool:
    """Whether a number that is kept is a truth: which of two rows has the larger pivot."""
    return listing.plan.nodes[node][0] in ("compare", "logic")


def operands(nodes: Iterable[int], printer: Printer) -> list[str]:
    """Return the indented lines of numbers that a call is given."""
    return [f"    {line}" for line in wrapped([printer.text(node) for node in nodes])]


def block_call(write: Statements, opened: str) -> Call:
    """Return the printer of a block's solve, or of its determinant, as a call with arrays.

    `opened` is how a call begins, with its name, the block's size and the array of the matrix.
    """

    def call(step: BlockCall, printer: Printer) -> list[str]:
        name = f"block_of_{step.names[0]}" if step.right else step.names[0]
        begun = opened.format("block_solve" if step.right else "block_determinant", step.size)
        right = ["], [", *operands(step.right, printer)] if step.right else []
        taken = [(own, f"{name}[{k}]") for k, own in enumerate(step.names)] if step.right else []
        return [
            f"{write.value.format(name)} = {begun}",
            *operands(step.matrix, printer),
            *right,
            "]);",
            *(f"{write.value.format(own)} = {entry};" for own, entry in taken),
        ]

    return call


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
