"""The program written out: all instances in one graph, where equal values of the mechanism meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.ir.graph import Constant, Graph, Node, number_of
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.ir.program import Instance, Program

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of a result: its place in the emitted array, and the node that computes it."""

    row: int
    column: int
    node: int


@dataclass(frozen=True, slots=True)
class Section:
    """The rows of one constraint.

    Attributes
    ----------
    text
        The constraint in words, kept because printing its arguments takes its time.
    entries
        Entries by quantity; of Phi_q those that are not identically zero, row by row.
    """

    instance: Instance
    text: str
    entries: Mapping[str, tuple[Entry, ...]]


@dataclass(frozen=True, slots=True)
class InlineProgram:
    """One graph for the whole mechanism.

    Attributes
    ----------
    nodes
        The code.
    sections
        One a constraint, in order of rows.
    hints
        Speaking names of nodes.
    """

    program: Program
    nodes: tuple[Node, ...]
    sections: tuple[Section, ...]
    hints: Mapping[int, str]

    def pattern(self) -> tuple[tuple[int, int], ...]:
        """Return row and column of each entry of Phi_q not identically zero, row by row."""
        return tuple(
            (entry.row, entry.column)
            for section in self.sections
            for entry in section.entries["Phi_q"]
        )

    def number(self, node: int) -> Constant | None:
        """Return the number a node stands for, None where it is not a plain number."""
        return number_of(self.nodes, node)


def inline(program: Program) -> InlineProgram:
    """Write a program out as one graph."""
    graph = Graph(program.values)
    hints: dict[int, str] = {}
    for body, column in program.frames:
        angle = graph.input(program.coordinates[column].name)
        hints[graph.call("cos", angle)] = f"c_{body}"
        hints[graph.call("sin", angle)] = f"s_{body}"
    for item in program.coordinates:
        hints[graph.square(graph.input(rate(item.name)))] = f"{rate(item.name)}_sq"
    sections = []
    for instance in program.instances:
        kernel = instance.kernel
        inputs = dict(zip(kernel.inputs, instance.bindings, strict=True))
        new = graph.instantiate(kernel.nodes, inputs)
        spoken = [(inputs[name], _spoken_value(name, instance)) for name in inputs]
        spoken += [(new[node], _spoken(stem, instance)) for node, stem in kernel.hints]
        for node, said in spoken:
            # A hint on a call says that it is the cosine or sine of a body frame.
            if said and graph.nodes[node][0] not in ("neg", "const", "input", "call"):
                hints.setdefault(node, said)
        sections.append(Section(instance, instance.constraint.text, _entries(instance, new, graph)))
    return InlineProgram(program, tuple(graph.nodes), tuple(sections), hints)


def _entries(instance: Instance, new: list[int], graph: Graph) -> dict[str, tuple[Entry, ...]]:
    first, kernel = instance.first_row, instance.kernel
    Phi_q = []
    for row, local, node in kernel.Phi_q:
        column = instance.columns[local]
        if column is not None and graph.value_of(new[node]) != 0:
            Phi_q.append(Entry(first + row, column, new[node]))
    vectors = {"Phi": kernel.Phi, "nu": kernel.nu, "gamma": kernel.gamma}
    entries = {
        name: tuple(Entry(first + row, 0, new[node]) for row, node in enumerate(nodes))
        for name, nodes in vectors.items()
    }
    return {**entries, "Phi_q": tuple(sorted(Phi_q, key=lambda entry: (entry.row, entry.column)))}


def _spoken(stem: str, instance: Instance) -> str:
    """Return the name of a vector component.

    ``B_crank_x`` is A s of joint B on the crank, ``B_crank_w2_x`` the same times the square of the
    angular velocity, ``B_axis_crank_x`` an axis, ``B_d_x`` the vector d, ``B_u_cam_x`` the unit
    vector towards the contact on a cam. The stem is the textbook's symbol and the component:
    ``s_i.x``, ``s_i w2.x``, ``v_j.y``, ``d_dot.x``, ``u_i.x``.
    """
    vector, axis = stem.split(".")
    symbol, *factor = vector.split()
    letter, _, index = symbol.partition("_")
    if index in ("i", "j") and letter in ("s", "v", "u"):
        body = instance.bodies["ij".index(index)]
        symbol = {"s": body, "v": f"axis_{body}", "u": f"u_{body}"}[letter]
    return "_".join((instance.name, symbol, *factor, axis))


def _spoken_value(name: str, instance: Instance) -> str | None:
    """Return the name of a driver's value or of a cam's radius, or of one of their derivatives.

    ``lift_C_dot`` is the rate of the driver C(t) of ``lift``, ``contact_rho_cam_1`` the first
    derivative of the radius of the cam by the polar angle.
    """
    symbol, order = name.rstrip("'"), name.count("'")
    if symbol == "C":
        return f"{instance.name}_C{('', '_dot', '_ddot')[order]}"
    if symbol in ("rho_i", "rho_j"):
        body = instance.bodies["ij".index(symbol[-1])]
        return f"{instance.name}_rho_{body}{f'_{order}' if order else ''}"
    return None
