"""The planned solve as two functions: factorization, from Phi_q alone, and solution."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.ir.graph import number_of, operands_of
from kincompile.targets.layout import wrapped
from kincompile.targets.naming import content_name

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.inline import InlineProgram
    from kincompile.targets.naming import NameTable


@dataclass(frozen=True, slots=True)
class SolveListing:
    """The planned solve with names.

    Attributes
    ----------
    entries
        Names of the varying entries of Phi_q, in order: the input of the factorization.
    factors
        Nodes that the solution reads from the factorization.
    factor_steps, solve_steps
        Nodes to be computed one after the other, in each function.
    names
        Names of all nodes that have one.
    """

    plan: SolvePlan
    entries: tuple[int, ...]
    factors: tuple[int, ...]
    factor_steps: tuple[int, ...]
    solve_steps: tuple[int, ...]
    names: Mapping[int, str]


def schedule_solve(code: InlineProgram, plan: SolvePlan, table: NameTable) -> SolveListing:
    """Arrange the planned solve: what depends on Phi_q alone is computed once and kept.

    `table` knows the names that the target reserves; coordinates and equations are free here.
    """
    nodes = plan.nodes
    variable = _depending_on(plan, plan.right)
    needed = _needed(plan, (*plan.solution, *plan.determinants))
    uses = _count_uses(plan, needed)
    read = {k for node in needed & variable for k in _signless_operands(plan, node)}
    factors = [node for node in sorted(read - variable) if number_of(nodes, node) is None]
    equations, coordinates = (
        code.program.equations,
        [item.name for item in code.program.coordinates],
    )
    names = {
        node: table.take(f"{equations[row].replace('.', '_')}_{coordinates[column]}")
        for row, column, node in plan.entries
    }
    names.update(
        {
            node: table.take(name.replace(".", "_"))
            for node, name in zip(plan.right, equations, strict=True)
        }
    )
    solved = dict(zip(plan.solution, coordinates, strict=True))
    numbers = {node: nodes[node][1] for node in needed if nodes[node][0] == "const"}
    steps: dict[bool, list[int]] = {True: [], False: []}
    for node in sorted(needed):
        is_factor = node in factors or (node not in variable and node in plan.determinants)
        is_result = node in solved or nodes[node][0] == "linear"
        if node in names or number_of(nodes, node) is not None:
            continue
        if is_factor or is_result or (uses[node] > 1 and nodes[node][0] != "neg"):
            wanted = solved.get(node) or content_name(nodes[node], names, numbers)
            if node in plan.determinants:
                wanted = "determinant"
            letter = "b" if node in variable else "k"
            names[node] = table.take(wanted or f"{letter}_{len(steps[node in variable]) + 1}")
            steps[node in variable].append(node)
    return SolveListing(
        plan,
        tuple(node for _, _, node in plan.entries),
        tuple(factors),
        tuple(steps[False]),
        tuple(steps[True]),
        names,
    )


def _depending_on(plan: SolvePlan, inputs: Iterable[int]) -> set[int]:
    """Return the nodes that depend on any of the inputs."""
    found = set(inputs)
    for node, content in enumerate(plan.nodes):
        if not found.isdisjoint(operands_of(content)):
            found.add(node)
    return found


def _needed(plan: SolvePlan, outputs: Sequence[int]) -> set[int]:
    """Return the nodes that the outputs depend on, themselves included."""
    found = set(outputs)
    for node in range(len(plan.nodes) - 1, -1, -1):
        if node in found:
            found |= set(operands_of(plan.nodes[node]))
    return found


def _count_uses(plan: SolvePlan, needed: set[int]) -> Counter[int]:
    """Count how often each value is used; a changed sign is not a value, a result is a use."""
    signs = {node for node in needed if plan.nodes[node][0] == "neg"}
    uses = Counter(k for node in needed - signs for k in _signless_operands(plan, node))
    return uses + Counter(plan.nodes[node][1] for node in plan.solution if node in signs)


def _signless_operands(plan: SolvePlan, node: int) -> list[int]:
    """Return the operands of a node; of a changed sign, what it changes."""
    found = operands_of(plan.nodes[node])
    return [plan.nodes[k][1] if plan.nodes[k][0] == "neg" else k for k in found]


def explained(code: InlineProgram, plan: SolvePlan) -> list[str]:
    """Return lines of a comment that say how the system is taken apart."""
    equations = code.program.equations
    coordinates = [item.name for item in code.program.coordinates]
    pivots = [f"{coordinates[item.column]} by {equations[item.row]}" for item in plan.pivots]
    lines = wrapped(["eliminated:", *pivots]) if pivots else []
    for block in plan.blocks:
        rows = ", ".join(equations[row] for row in block.rows)
        columns = ", ".join(coordinates[column] for column in block.columns)
        lines.append(f"block: {columns} by {rows}")
    return [line.replace("eliminated:,", "eliminated:").rstrip(",") for line in lines]


def components(plan: SolvePlan, node: int) -> list[int]:
    """Return the nodes of all components of the solution that a node is one of, in order."""
    _, _, size, _, *operands = plan.nodes[node]
    same = [
        k
        for k, content in enumerate(plan.nodes)
        if content[:3] == ("linear", "solve", size) and list(content[4:]) == operands
    ]
    return sorted(same, key=lambda k: int(plan.nodes[k][3]))
