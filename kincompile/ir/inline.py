"""The program written out: all instances in one graph, where equal values of the mechanism meet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from kincompile.ir.graph import Constant, Graph, Node, number_of
from kincompile.ir.program import Function
from kincompile.names import multiplier, rate, solved
from kincompile.quantities import TOGETHER, quantity_named

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from kincompile.ir.program import Hint, Instance, Program
    from kincompile.quantities import Rows


SOLVED: tuple[tuple[str, Rows, Callable[[str], str]], ...] = (
    ("accelerations", "coordinates", solved),
    ("multipliers", "equations", multiplier),
)
"""Unknowns of the equations of motion, what they belong to, and what they are called."""


def input_name(row: int, column: int) -> str:
    """Return what the code of a solve calls an entry of Phi_q."""
    return f"Phi_q[{row}, {column}]"


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of a result: its place in the emitted array, and the node that computes it."""

    row: int
    column: int
    node: int

    @property
    def name(self) -> str:
        """What the code of a solve calls an entry of Phi_q."""
        return input_name(self.row, self.column)


@dataclass(frozen=True, slots=True)
class ConstraintRows:
    """The rows of one constraint, of one output or of one load."""

    instance: Instance
    # Entries by quantity, row by row; of a matrix those that are not identically zero. The last
    # constraint has those to which several contribute.
    entries: Mapping[str, tuple[Entry, ...]]


@dataclass(frozen=True, slots=True)
class InlineProgram:
    """One graph for the whole mechanism."""

    program: Program
    nodes: tuple[Node, ...]
    # One a constraint, in order of rows, then one an output, then one a load.
    sections: tuple[ConstraintRows, ...]
    hints: Mapping[int, str]
    # What the frames of bodies give, a tuple of nodes a body.
    frames: tuple[tuple[int, ...], ...] = ()

    @property
    def constraints(self) -> tuple[ConstraintRows, ...]:
        """The sections of constraints alone."""
        return self.sections[: len(self.program.instances)]

    def entries(self, quantity: str) -> list[Entry]:
        """Return the entries of a quantity, row by row."""
        return [entry for section in self.sections for entry in section.entries[quantity]]

    def pattern(self, quantity: str = "Phi_q") -> tuple[tuple[int, int], ...]:
        """Return row and column of each entry of a matrix not identically zero, row by row."""
        return tuple((entry.row, entry.column) for entry in self.entries(quantity))

    def number(self, node: int) -> Constant | None:
        """Return the number a node stands for, None where it is not a plain number."""
        return number_of(self.nodes, node)


def inline(program: Program) -> InlineProgram:
    """Write a program out as one graph."""
    graph = Graph(program.values)
    hints: dict[int, str] = {}
    for body in program.bodies:
        hints.update(zip(body.entries, body.labels, strict=True))
    for item in program.coordinates:
        hints[graph.square(graph.input(rate(item.name)))] = f"{rate(item.name)}_sq"
    sections: list[ConstraintRows] = []
    shared: dict[str, dict[tuple[int, int], int]] = {}
    for instance in program.parts:
        kernel = instance.kernel
        inputs = dict(zip(kernel.inputs, instance.bindings, strict=True))
        new = graph.instantiate(kernel.nodes, inputs)
        named = [
            (node, _function_name(item, instance))
            for item, node in inputs.items()
            if isinstance(item, Function)
        ]
        named += [
            (new[node], rate(instance.rows[row].name, order))
            for order, quantity in enumerate(TOGETHER["observe"])
            for row, _, node in kernel.outputs.get(quantity, ())
        ]
        named += [
            (new[node], name_of(program.names_of(kind)[row]))
            for quantity, kind, name_of in SOLVED
            for row, _, node in kernel.outputs.get(quantity, ())
        ]
        named += [(new[hint.node], _vector_name(hint, instance)) for hint in kernel.hints]
        for node, name in named:
            # A call is named by its function and argument.
            if graph.nodes[node][0] not in ("neg", "const", "input", "call"):
                hints.setdefault(node, name)
        entries = _entries(program, instance, new, graph, shared)
        sections.append(ConstraintRows(instance, entries))
    for quantity, complete in _sums(program, graph, shared).items():
        # A sum is complete where the last has contributed.
        giving = [k for k, x in enumerate(sections) if quantity in x.instance.kernel.outputs]
        last = giving[-1] if giving else -1
        own = {**sections[last].entries, quantity: complete}
        sections[last] = replace(sections[last], entries=own)
    frames = tuple(sorted(body.entries for body in program.bodies))
    return InlineProgram(program, tuple(graph.nodes), tuple(sections), hints, frames)


def _entries(
    program: Program,
    instance: Instance,
    new: list[int],
    graph: Graph,
    shared: dict[str, dict[tuple[int, int], int]],
) -> dict[str, tuple[Entry, ...]]:
    """Return the entries of a constraint's own rows; what it adds to others goes into `shared`."""
    entries = {}
    for quantity in program.quantities:
        is_own = quantity.rows != "coordinates" and not quantity.adds
        found = {} if is_own else shared.setdefault(quantity.name, {})
        for row, column, node in instance.kernel.outputs.get(quantity.name, ()):
            place = instance.place(quantity, row, column)
            if place is None or (quantity.is_matrix and graph.value_of(new[node]) == 0):
                continue
            before = found.get(place) if quantity.adds else None
            found[place] = new[node] if before is None else graph.add(before, new[node])
        entries[quantity.name] = _sorted(found) if is_own else ()
    return entries


def _sorted(found: Mapping[tuple[int, int], int]) -> tuple[Entry, ...]:
    return tuple(Entry(*place, node) for place, node in sorted(found.items()))


def _sums(
    program: Program, graph: Graph, shared: Mapping[str, dict[tuple[int, int], int]]
) -> dict[str, tuple[Entry, ...]]:
    """Return the entries to which several constraints may contribute; a vector has all its rows."""
    sums = {}
    for name, found in shared.items():
        quantity = quantity_named(name)
        if not quantity.is_matrix:
            for row in range(len(program.names_of(quantity.rows))):
                found.setdefault((row, 0), graph.const(0))
        sums[name] = _sorted(found)
    return sums


def _vector_name(hint: Hint, instance: Instance) -> str:
    """Return the name of a vector component.

    ``B_crank_x`` is A s of joint B on the crank, ``B_crank_w2_x`` the same times the square of the
    angular velocity, ``B_axis_crank_x`` an axis, ``B_d_x`` the vector d, ``B_u_cam_x`` the unit
    vector towards the contact on a cam.
    """
    body = "" if hint.owner is None else instance.bodies[hint.owner]
    return f"{instance.name}_{hint.stem.format(body)}"


def _function_name(item: Function, instance: Instance) -> str:
    """Return the name of a driver's value or of a cam's radius, or of one of their derivatives.

    ``lift_C_dot`` is the rate of the driver C(t) of ``lift``, ``contact_rho_cam_1`` the first
    derivative of the radius of the cam by the polar angle.
    """
    if item.body is None:
        return f"{instance.name}_{item.symbol}{('', '_dot', '_ddot')[item.order]}"
    ending = f"_{item.order}" if item.order else ""
    return f"{instance.name}_rho_{instance.bodies[item.body]}{ending}"
