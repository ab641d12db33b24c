"""The program by groups: constraints of one type and one shape run together as arrays.

Two constraints are of one shape when the same attributes are zero and the same bodies are the
ground. A group has one piece of straight-line code, folded for its shape, and index arrays that say
where its inputs come from and where its results go. Its size does not depend on the number of
constraints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.ir.graph import Graph, Node, number_of, operands_of
from kincompile.ir.interpret import Placed, by_kernel
from kincompile.ir.program import FrameEntry
from kincompile.names import rate
from kincompile.quantities import quantity_named

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.program import FrameKernel, Instance, Program
    from kincompile.quantities import Quantity

    Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Source:
    """Where an input of a group comes from."""

    # ``"q"``, ``"q_dot"``, ``"q_ddot"``, ``"number"`` (an attribute), ``"value"`` (computed from t,
    # p and coordinates), ``"moving"`` (computed from rates too), or an entry of the frames of
    # bodies, as ``"frame_1.c"``.
    kind: str
    index: Index  # index for each constraint, into the vector of that kind


@dataclass(frozen=True, slots=True)
class Group:
    """Constraints that run together."""

    name: str  # name of the code, for instance ``Revolute_2``
    sample: Instance  # the first of them
    nodes: tuple[Node, ...]  # its code, folded for the shape of the group
    inputs: Mapping[str, Source]  # where each input that is left comes from
    # By quantity ``(row, column, node)``, as in the kernel, without what is on the ground or zero.
    outputs: Mapping[str, tuple[tuple[int, int, int], ...]]
    placed: Placed  # where their entries stand
    hints: Mapping[int, str]

    @property
    def size(self) -> int:
        """Number of constraints."""
        return len(self.placed.columns)

    def number(self, node: int) -> Any:
        """Return the number a node stands for, None where it is not a plain number."""
        return number_of(self.nodes, node)


@dataclass(frozen=True, slots=True)
class FrameGroup:
    """Bodies of one kind, whose frames are computed together."""

    name: str  # name of the code, for instance ``frame_1``
    kernel: FrameKernel
    columns: Index  # columns of each body's coordinates, shape (coordinates, L)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the sources that its entries are."""
        return tuple(f"{self.name}.{symbol}" for symbol in self.kernel.symbols)


@dataclass(frozen=True, slots=True)
class GroupedProgram:
    """A program by groups."""

    program: Program
    groups: tuple[Group, ...]  # the groups, in the order of their first constraint
    numbers: NDArray[np.float64]  # attributes that are plain numbers, shape (K,)
    values: tuple[int, ...]  # nodes of `program.values` that depend on t, p or coordinates
    moving: tuple[int, ...]  # those that depend on rates too
    frames: tuple[FrameGroup, ...]  # the bodies, by kind

    def pattern(self) -> NDArray[np.intp]:
        """Return row and column of every entry of Phi_q, shape (nnz, 2), group by group."""
        return self.entries(quantity_named("Phi_q"))[0]

    def entries(self, quantity: Quantity) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Return row and column of every entry, shape (entries, 2), group by group, and its value.

        The value is NaN where it is not a plain number.
        """
        places, values = [np.empty((0, 2), dtype=np.intp)], [np.empty(0)]
        for item in self.groups:
            for row, column, node in item.outputs[quantity.name]:
                value = item.number(node)
                places.append(np.stack(item.placed.entry(quantity, row, column), axis=1))
                values.append(np.full(item.size, np.nan if value is None else float(value)))
        return np.concatenate(places), np.concatenate(values)


KINDS = ("q", "q_dot", "q_ddot", "number", "value", "moving")
"""Kinds of sources; entries of frames follow."""

Q_DOT, NUMBER, VALUE, MOVING = 1, 3, 4, 5


@dataclass(frozen=True, slots=True)
class _Nodes:
    """Kind and index of every node of `program.values`, and its number where it is a plain one."""

    kinds: tuple[str, ...]  # kinds of sources
    kind: Index  # (nodes,): position in `kinds`
    # (nodes,): index into the vector of that kind; for computed values the node itself
    index: Index
    number: NDArray[np.float64]  # (nodes,): NaN where a node is not a plain number
    # (nodes,): equal where nodes are computed by the same operations, whatever the names and
    # numbers
    structure: Index


def _classify(program: Program, groups: Sequence[FrameGroup]) -> _Nodes:
    names = [item.name for item in program.coordinates]
    orders = range(3 if program.observers else 2)
    places = {rate(name, order): (order, k) for order in orders for k, name in enumerate(names)}
    kinds = (*KINDS, *(kind for item in groups for kind in item.kinds))
    frames: dict[int, tuple[int, int]] = {}
    first = len(KINDS)
    for item in groups:
        bodies = (body for body in program.bodies if body.kernel is item.kernel)
        for k, body in enumerate(bodies):
            frames |= {node: (first + entry, k) for entry, node in enumerate(body.entries)}
        first += len(item.kinds)
    nodes = program.values
    # Lists, since single entries of arrays cost ten times as much.
    kinds_of = [VALUE] * len(nodes)
    index = list(range(len(nodes)))
    number = [math.nan] * len(nodes)

    def is_moving(node: int) -> bool:
        return any(kinds_of[k] in (Q_DOT, MOVING) for k in operands_of(nodes[node]))

    for node, content in enumerate(nodes):
        operation = content[0]
        if operation == "input" and content[1] in places:
            kinds_of[node], index[node] = places[content[1]]
        elif operation == "const":
            number[node] = content[1]
        elif operation == "neg":
            number[node] = -number[content[1]]
        elif node in frames:
            kinds_of[node], index[node] = frames[node]
        if program.loads and kinds_of[node] == VALUE and is_moving(node):
            kinds_of[node] = MOVING
    kind, numbers = np.array(kinds_of), np.array(number, dtype=float)
    kind[~np.isnan(numbers)] = NUMBER
    structure = _structures(nodes, kind, len(kinds))
    return _Nodes(kinds, kind, np.array(index), numbers, structure)


def _structures(nodes: Sequence[Node], kind: Index, first: int) -> Index:
    """Return a number for the structure of each node: its kind, or from `first` on."""
    structure = kind.tolist()
    known: dict[tuple[Any, ...], int] = {}
    for node in np.flatnonzero(kind == VALUE).tolist():
        content = nodes[node]
        operands = operands_of(content)
        if operands:
            literals = content[1 : len(content) - len(operands)]
            key = (content[0], literals, *(structure[k] for k in operands))
            structure[node] = known.setdefault(key, first + len(known))
    return np.array(structure)


def group(program: Program) -> GroupedProgram:
    """Arrange a program by groups."""
    frames = _frame_groups(program)
    nodes = _classify(program, frames)
    builder = _Builder(nodes, program)
    groups: list[Group] = []
    for _, instances in by_kernel(program):
        groups += builder.groups(instances)
    groups.sort(key=lambda item: int(item.placed.rows["equations"][0]))
    return GroupedProgram(
        program,
        tuple(groups),
        np.array(builder.numbers),
        tuple(builder.values["value"]),
        tuple(builder.values["moving"]),
        frames,
    )


def _frame_groups(program: Program) -> tuple[FrameGroup, ...]:
    """Return the bodies of each kind."""
    columns: dict[int, tuple[FrameKernel, list[range]]] = {}
    for body in program.bodies:
        columns.setdefault(id(body.kernel), (body.kernel, []))[1].append(body.columns)
    return tuple(
        FrameGroup(f"frame_{k}", kernel, np.array(own, dtype=np.intp).T)
        for k, (kernel, own) in enumerate(columns.values(), 1)
    )


@dataclass(frozen=True, slots=True)
class _Sources:
    """The inputs of a group while its code is made."""

    by_name: dict[str, Source] = field(default_factory=dict)  # where each comes from
    # Node in the group's code by the values that it stands for, as bytes.
    known: dict[bytes, int] = field(default_factory=dict)


ARITHMETIC = frozenset({"add", "sub", "mul", "div", "neg", "square"})
"""Operations whose operands are nodes and nothing else."""

FEW = 8
"""Different values up to which each is computed by itself, before all groups."""


class _Builder:
    """Makes groups, and collects the numbers and computed values that they read."""

    def __init__(self, nodes: _Nodes, program: Program) -> None:
        self._nodes, self._code = nodes, program.values
        self._quantities = program.quantities
        self._counts: dict[str, int] = {}
        self.numbers: list[float] = []
        self.values: dict[str, dict[int, int]] = {"value": {}, "moving": {}}

    def groups(self, instances: list[Instance]) -> list[Group]:
        """Split the constraints of one kernel by their shape."""
        bindings = np.array([instance.bindings for instance in instances])
        placed = Placed.of(instances)
        numbers = self._nodes.number[bindings]
        # What shapes the code: attributes that are zero, and the ground, whose cosine is one.
        of_frame = np.array([isinstance(item, FrameEntry) for item in instances[0].kernel.inputs])
        shapes = np.where((numbers == 0) | ((numbers == 1) & of_frame), numbers, -1)
        expressions = np.stack([self._expressions(nodes) for nodes in bindings.T], axis=1)
        expressions = expressions[:, expressions.any(axis=0)]
        # One byte string a constraint compares faster than a row of numbers.
        key = np.concatenate((shapes, placed.columns < 0, expressions), axis=1).astype(np.int32)
        whole = key.view(f"V{key.itemsize * key.shape[1]}").reshape(-1)
        _, which = np.unique(whole, return_inverse=True)
        found = []
        for number in dict.fromkeys(which.tolist()):
            members = np.flatnonzero(which == number)
            sample = instances[members[0]]
            found.append(self._group(sample, bindings[members], placed.some(members)))
        return found

    def _expressions(self, nodes: Index) -> Index:
        """Return the structure of each constraint's expression, where many of them share few."""
        structures = np.zeros_like(nodes)
        is_value = self._nodes.kind[nodes] == VALUE
        if is_value.any():
            structures[is_value] = self._nodes.structure[nodes[is_value]]
            if FEW * np.unique(structures).size > np.unique(nodes).size:
                structures[:] = 0
        return structures

    def _group(self, sample: Instance, bindings: Index, placed: Placed) -> Group:
        kernel = sample.kernel
        graph, sources = Graph(), _Sources()
        inputs = {
            item: self._input(item if isinstance(item, str) else item.name, nodes, graph, sources)
            for item, nodes in zip(kernel.inputs, bindings.T, strict=True)
        }
        new = graph.instantiate(kernel.nodes, inputs)
        self._counts[kernel.name] = self._counts.get(kernel.name, 0) + 1
        return Group(
            f"{kernel.name}_{self._counts[kernel.name]}",
            sample,
            tuple(graph.nodes),
            sources.by_name,
            {
                quantity.name: tuple(
                    (row, column, new[node])
                    for row, column, node in kernel.outputs.get(quantity.name, ())
                    if sample.place(quantity, row, column) is not None
                    and not (quantity.is_matrix and graph.value_of(new[node]) == 0)
                )
                for quantity in self._quantities
            },
            placed,
            {
                new[hint.node]: hint.name
                for hint in kernel.hints
                if graph.nodes[new[hint.node]][0] not in ("neg", "const", "input")
            },
        )

    def _input(self, name: str, nodes: Index, graph: Graph, sources: _Sources) -> int:
        """Return the node of an input in a group's code.

        It is a number where all constraints have the same. Where many constraints have expressions
        of their own that begin with the same operation, drivers for instance, the operation is one
        of the group, and its operands are the inputs.
        """
        key = nodes.tobytes()
        if key not in sources.known:
            numbers = self._nodes.number[nodes]
            if (numbers == numbers[0]).all():  # not so where it is no number
                sources.known[key] = graph.const(float(numbers[0]))
            elif (operation := self._shared_operation(nodes)) is not None:
                operands = [
                    self._input(f"{name}_{k}", column, graph, sources)
                    for k, column in enumerate(self._operands(nodes))
                ]
                sources.known[key] = graph.apply(operation, operands)
            else:
                sources.known[key] = graph.input(name)
                sources.by_name[name] = self._source(nodes)
        return sources.known[key]

    def _shared_operation(self, nodes: Index) -> tuple[str, ...] | None:
        """Return the operation, with the function's name, that computes each of many values."""
        is_value = self._nodes.kind[nodes] == VALUE
        if not is_value.all() or np.unique(nodes).size <= FEW:
            return None
        found = {self._operation(node) for node in nodes.tolist()}
        return found.pop() if len(found) == 1 else None

    def _operation(self, node: int) -> tuple[str, ...] | None:
        operation, *operands = self._code[node]
        if operation == "call":
            return operation, operands[0]
        return (operation,) if operation in ARITHMETIC else None

    def _operands(self, nodes: Index) -> Index:
        """Return the operands of nodes of one operation, a row an operand."""
        return np.array([operands_of(self._code[node]) for node in nodes.tolist()]).T.copy()

    def _source(self, nodes: Index) -> Source:
        """Return where an input comes from; numbers here and expressions there are all computed."""
        kinds = np.unique(self._nodes.kind[nodes])
        mixed = "moving" if MOVING in kinds or Q_DOT in kinds else "value"
        kind = self._nodes.kinds[kinds[0]] if kinds.size == 1 else mixed
        if kind == "number":
            first = len(self.numbers)
            self.numbers += self._nodes.number[nodes].tolist()
            return Source(kind, np.arange(first, len(self.numbers)))
        if kind in self.values:
            known = self.values[kind]
            places = [known.setdefault(node, len(known)) for node in nodes.tolist()]
            return Source(kind, np.array(places))
        return Source(kind, self._nodes.index[nodes])
