"""The planned solve as two functions: factorization, from Phi_q alone, and solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.emitters.lines import wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.schedule import Assignment, Scheduler, count_uses
from kincompile.ir.elimination import plan_solve
from kincompile.ir.graph import depending_on, number_of, operands_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.inline import InlineProgram


@dataclass(frozen=True, slots=True)
class BlockCall:
    """The call that solves a block too large for a closed form, or takes its determinant."""

    names: tuple[str, ...]  # names of the unknowns in order, or of the determinant
    size: int  # number of equations
    # matrix, right: nodes of the matrix row by row, and of the right side, empty for a determinant
    matrix: tuple[int, ...]
    right: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SolveListing:
    """The planned solve with names."""

    plan: SolvePlan
    factors: tuple[int, ...]  # nodes that the solution reads from the factorization
    # factor_steps, solve_steps: what is computed one after the other, in each function
    factor_steps: tuple[Assignment | BlockCall, ...]
    solve_steps: tuple[Assignment | BlockCall, ...]
    names: Mapping[int, str]  # names of all nodes that have one
    # Entries of Phi_q that the solution reads themselves: node, and place in the pattern.
    entries: tuple[tuple[int, int], ...] = ()


def schedule_solve(
    code: InlineProgram, reserved: Collection[str], *, reads_entries: bool = False
) -> SolveListing | None:
    """Arrange the planned solve, if there is one: what depends on Phi_q alone is computed once.

    `reserved` are names that the target uses; those of coordinates and equations are free here.
    Where the solution reads entries of Phi_q, these are not kept among the factors.
    """
    plan, table = plan_solve(code), NameTable(reserved)
    if plan is None:
        return None
    equations = [name.replace(".", "_") for name in code.program.equations]
    coordinates = [item.name for item in code.program.coordinates]
    names = {
        node: table.take(f"{equations[row]}_{coordinates[column]}")
        for row, column, node in plan.entries
    }
    names |= {node: table.take(equations[row]) for row, node in enumerate(plan.right)}
    labels = dict.fromkeys(plan.determinants, "determinant")
    labels |= zip(plan.solution, coordinates, strict=True)
    variable = depending_on(plan.nodes, plan.right)
    factors, entries = _factors(plan, variable), tuple[tuple[int, int], ...]()
    if reads_entries:
        places = {place: k for k, place in enumerate(code.pattern())}
        inputs = {node: places[row, column] for row, column, node in plan.entries}
        entries = tuple((node, inputs[node]) for node in factors if node in inputs)
        factors = tuple(node for node in factors if node not in inputs)
    blocks = {node for node, content in enumerate(plan.nodes) if content[0] == "linear"}
    scheduler = Scheduler(plan.nodes, labels, names, table, labels, {*labels, *factors, *blocks})
    needed = sorted(scheduler.uses)
    kept = scheduler.assign("k", [node for node in needed if node not in variable])
    solved = scheduler.assign("b", [node for node in needed if node in variable])
    return SolveListing(
        plan, factors, _calls(plan, kept, names), _calls(plan, solved, names), names, entries
    )


def schedule_determinants(plan: SolvePlan, names: dict[int, str], table: NameTable) -> SolveListing:
    """Arrange what the determinants of the blocks need of Phi_q, whose entries have names."""
    blocks = {node for node, content in enumerate(plan.nodes) if content[0] == "linear"}
    scheduler = Scheduler(plan.nodes, plan.determinants, names, table, {}, blocks)
    steps = scheduler.assign("k", sorted(scheduler.uses))
    return SolveListing(plan, (), _calls(plan, steps, names), (), names)


def _calls(
    plan: SolvePlan, steps: Iterable[Assignment], names: Mapping[int, str]
) -> tuple[Assignment | BlockCall, ...]:
    """Return steps in which all unknowns of a block are one call."""
    together: dict[object, list[int]] = {}
    for node, (kind, *content) in enumerate(plan.nodes):
        if kind == "linear":
            together.setdefault((content[0], *content[3:]), []).append(node)
    found: dict[object, Assignment | BlockCall] = {}
    for item in steps:
        kind, *content = plan.nodes[item.node]
        if kind != "linear":
            found[item.node] = item
            continue
        name, size, _, *operands = content
        key = name, *operands
        called = sorted(together[key], key=lambda k: int(plan.nodes[k][3]))
        matrix, right = operands[: size * size], operands[size * size :]
        names_of_call = tuple(names[k] for k in called)
        found.setdefault(key, BlockCall(names_of_call, size, tuple(matrix), tuple(right)))
    return tuple(found.values())


def _factors(plan: SolvePlan, variable: Collection[int]) -> tuple[int, ...]:
    """Return the values of Phi_q alone that the solution for a right side reads."""
    nodes = plan.nodes
    needed = count_uses(nodes, plan.solution).keys() & variable
    read = {k for node in needed for k in operands_of(nodes[node])}
    values = {nodes[k][1] if nodes[k][0] == "neg" else k for k in read}.difference(variable)
    return tuple(node for node in sorted(values) if number_of(nodes, node) is None)


def explained(code: InlineProgram, plan: SolvePlan) -> list[str]:
    """Return lines of a comment that say how the system is taken apart."""
    equations = code.program.equations
    coordinates = [item.name for item in code.program.coordinates]
    for column in plan.turned:
        body = next(item.name for item in code.program.bodies if column in item.columns)
        coordinates += [f"{name}_{body}" for name in ("s", "pi_f", "pi_g", "pi_h")]
    pivots = [f"{coordinates[item.column]} by {equations[item.row]}" for item in plan.pivots]
    lines = wrapped(["eliminated:", *pivots]) if pivots else []
    for block in plan.blocks:
        rows = ", ".join(equations[row] for row in block.rows)
        columns = ", ".join(coordinates[column] for column in block.columns)
        lines.append(f"block: {columns} by {rows}")
    return [line.replace("eliminated:,", "eliminated:").rstrip(",") for line in lines]
