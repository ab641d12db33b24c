"""A large program by block types: each type is a small mechanism that many blocks are instances of.

The blocks of the block triangular form that have the same constraints, joined in the same way, are
of one type. A type is code like any other program: its coordinates are those of a block and behind
them those of earlier blocks that it reads, its equations are those of the block, its parameters
are the attributes and the values of t and p that differ from block to block.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from heapq import heapify, heappop, heappush
from typing import TYPE_CHECKING

import numpy as np

from kincompile.ir.elimination import jacobian_entries, plan_entries
from kincompile.ir.graph import Graph, operands_of
from kincompile.ir.inline import Entry, InlineProgram, Section
from kincompile.model.bodies import Parameter
from kincompile.names import rate
from kincompile.structure.stages import Chain, Lanes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.grouping import Group, GroupedProgram, Source
    from kincompile.structure.stages import Stage

    Index = NDArray[np.intp]

LARGEST_TYPES = 400
"""Equations of all types together up to which their code is worth a compiler's time."""

WIDE = 4
"""Blocks from which on a step of a chain is solved side by side."""


@dataclass(frozen=True, slots=True)
class BlockType:
    """The code of equal blocks.

    Attributes
    ----------
    code
        Its equations in its coordinates: first those it determines, then those it reads.
    plan
        How it is solved for those it determines; None where its equations are dependent.
    own
        Number of coordinates it determines, and of equations.
    numbers, values
        How many of its parameters are attributes, and how many are computed from t and p.
    """

    code: InlineProgram
    plan: SolvePlan | None
    own: int
    numbers: int
    values: int

    def coupled(self) -> list[int]:
        """Return the coordinates of earlier blocks that the equations depend on."""
        return sorted({column for _, column in self.code.pattern() if column >= self.own})


@dataclass(frozen=True, slots=True)
class Run:
    """Blocks of one type that are solved together, or one after the other.

    Attributes
    ----------
    type
        Number of their type.
    is_chain
        Whether a block may need those before it.
    columns : ndarray of int, shape (coordinates, L)
        Coordinates of each block, in the order of the type.
    numbers : ndarray, shape (numbers, L)
        Attributes.
    values : ndarray of int, shape (values, L)
        Numbers of the computed values.
    """

    type: int
    is_chain: bool
    columns: Index
    numbers: NDArray[np.float64]
    values: Index

    def of(self, lanes: Index | slice, *, is_chain: bool) -> Run:
        """Return some of the blocks."""
        columns, numbers, values = self.columns, self.numbers, self.values
        return Run(self.type, is_chain, columns[:, lanes], numbers[:, lanes], values[:, lanes])


def block_types(
    grouped: GroupedProgram, stages: Sequence[Stage]
) -> tuple[tuple[BlockType, ...], tuple[Run, ...]] | None:
    """Arrange a program by block types.

    Parameters
    ----------
    grouped
        The program by groups.
    stages
        Its order of solution.

    Returns
    -------
    types, runs
        The types, and the runs in the order of solution; None where some equations do not split
        into blocks, or are dependent, the blocks have too little in common, or what a profile gives
        at a contact is computed outside of them.
    """
    if _follows_contacts(grouped):
        return None
    finder = _Finder(grouped)
    runs: list[Run] = []
    for stage in stages:
        if isinstance(stage, Lanes):
            runs += finder.runs(stage)
        elif isinstance(stage, Chain):
            runs += _in_order([run for part in stage.parts for run in finder.runs(part)], finder)
        else:
            return None
        if sum(item.own for item in finder.types) > LARGEST_TYPES:
            return None
    if any(item.plan is None for item in finder.types):
        return None
    return tuple(finder.types), tuple(runs)


def _follows_contacts(grouped: GroupedProgram) -> bool:
    """Say whether a computed value depends on coordinates."""
    nodes, stack = grouped.program.values, list(grouped.values)
    coordinates = {item.name for item in grouped.program.coordinates}
    found: set[int] = set()
    while stack:
        node = stack.pop()
        if node not in found:
            found.add(node)
            stack += operands_of(nodes[node])
    return any(nodes[k][0] == "input" and nodes[k][1] in coordinates for k in found)


def tiles(types: Sequence[BlockType], runs: Sequence[Run], size: int) -> list[Run]:
    """Cut runs into tiles of so many blocks, in an order in which none needs a later one.

    Of the tiles that could come next it is the one with the first coordinates: tiles that read what
    others have just found follow them soon, while it is near.
    """
    found = [
        run.of(slice(start, start + size), is_chain=run.is_chain)
        for run in runs
        for start in range(0, run.columns.shape[1], size)
    ]
    owner = np.empty(sum(types[run.type].own * run.columns.shape[1] for run in runs), dtype=np.intp)
    for number, tile in enumerate(found):
        owner[tile.columns[: types[tile.type].own]] = number
    followers: list[list[int]] = [[] for _ in found]
    missing = [0] * len(found)
    for number, tile in enumerate(found):
        for before in set(owner[tile.columns[types[tile.type].coupled()]].ravel().tolist()):
            if before != number:
                followers[before].append(number)
                missing[number] += 1
    ready = [(int(tile.columns[0, 0]), k) for k, tile in enumerate(found) if missing[k] == 0]
    heapify(ready)
    order = []
    while ready:
        _, number = heappop(ready)
        order.append(found[number])
        for follower in followers[number]:
            missing[follower] -= 1
            if missing[follower] == 0:
                heappush(ready, (int(found[follower].columns[0, 0]), follower))
    return order


def _in_order(runs: Sequence[Run], finder: _Finder) -> list[Run]:
    """Arrange the blocks of a chain so that none comes before one that it needs."""
    which = np.concatenate([np.full(run.columns.shape[1], k) for k, run in enumerate(runs)])
    lane = np.concatenate([np.arange(run.columns.shape[1]) for run in runs])
    level = _levels(runs, finder)
    order = np.lexsort((lane, which, level))
    starts = np.flatnonzero(np.diff(level[order], prepend=-1) | np.diff(which[order], prepend=-1))
    steps: list[tuple[int, bool, list[Index]]] = []
    for members in np.split(order, starts[1:]):
        run = int(which[members[0]])
        if steps and steps[-1][0] == run and members.size < WIDE:
            steps[-1] = run, True, [*steps[-1][2], lane[members]]
        else:
            steps.append((run, False, [lane[members]]))
    return [
        runs[run].of(np.concatenate(parts), is_chain=is_chain) for run, is_chain, parts in steps
    ]


def _levels(runs: Sequence[Run], finder: _Finder) -> Index:
    """Return by how many steps each block of a chain comes after the first ones."""
    owner = np.full(len(finder.grouped.program.coordinates), -1, dtype=np.intp)
    heads, tails, start = [], [], 0
    for run in runs:
        count, own = run.columns.shape[1], finder.types[run.type].own
        owner[run.columns[:own]] = np.arange(start, start + count)
        start += count
    start = 0
    for run in runs:
        count, kind = run.columns.shape[1], finder.types[run.type]
        for slot in sorted({column for _, column in kind.code.pattern() if column >= kind.own}):
            tail = owner[run.columns[slot]]
            heads.append(np.flatnonzero(tail >= 0) + start)
            tails.append(tail[tail >= 0])
        start += count
    level, followers = [0] * start, [[] for _ in range(start)]  # type: tuple[list[int], list[list[int]]]
    head, tail = np.concatenate(heads), np.concatenate(tails)
    missing = np.bincount(head, minlength=start).tolist()
    for here, before in zip(head.tolist(), tail.tolist(), strict=True):
        followers[before].append(here)
    ready = [block for block, count in enumerate(missing) if count == 0]
    while ready:
        block = ready.pop()
        for here in followers[block]:
            level[here] = max(level[here], level[block] + 1)
            missing[here] -= 1
            if missing[here] == 0:
                ready.append(here)
    return np.array(level)


class _Finder:
    """Finds the types of blocks; blocks of different stages may be of one type."""

    def __init__(self, grouped: GroupedProgram) -> None:
        self.grouped = grouped
        self.types: list[BlockType] = []
        self._known: dict[tuple[bytes, ...], int] = {}
        self._angles = np.array(grouped.angles, dtype=np.intp)
        self._is_angle = np.array([item.unit == "rad" for item in grouped.program.coordinates])
        self._writer = _Writer(grouped)
        size, first = len(grouped.program.equations), 0
        # Of each equation: its group, the number of its constraint, and which row of that it is.
        self._group, self._constraint, self._row = np.empty((3, size), dtype=np.intp)
        self._first: list[int] = []
        for number, item in enumerate(grouped.groups):
            self._first.append(first)
            for row in range(len(item.Phi)):
                self._group[item.rows + row], self._row[item.rows + row] = number, row
                self._constraint[item.rows + row] = first + np.arange(item.rows.size)
            first += item.rows.size

    def runs(self, stage: Lanes) -> list[Run]:
        """Split equal blocks by type."""
        constraint = self._constraint[stage.rows]
        # Rows of one constraint: for each the first of them.
        first = (constraint[:, np.newaxis] == constraint).argmax(axis=1)
        joined = np.concatenate((self._group[stage.rows], self._row[stage.rows], first))
        found = []
        for lanes in _equal(joined):
            rows, own = stage.rows[:, lanes], stage.columns[:, lanes]
            parts = self._parts(rows, first[:, lanes[0]].tolist())
            reads = np.array([index for part in parts for index in part.reads(self._angles)])
            slots = _slots(reads, own)
            for same in _equal(np.concatenate((slots, self._is_angle[own]))):
                columns = _columns(reads[:, same], slots[:, same[0]], own[:, same])
                marks = joined[:, lanes[0]], slots[:, same[0]], self._is_angle[own[:, same[0]]]
                key = tuple(mark.tobytes() for mark in marks)
                here = [part.of(same) for part in parts]
                if key not in self._known:
                    self._known[key] = len(self.types)
                    self.types.append(self._writer.write(here, rows[:, same[0]], columns[:, 0]))
                numbers, values = (_stacked(here, kind, same.size) for kind in ("number", "value"))
                found.append(
                    Run(self._known[key], False, columns, self.grouped.numbers[numbers], values)
                )
        return found

    def _parts(self, rows: Index, first: Sequence[int]) -> list[_Part]:
        """Return the constraints of blocks that are joined alike."""
        parts = []
        for start in sorted(set(first)):
            group = int(self._group[rows[start, 0]])
            own = {int(self._row[rows[k, 0]]): k for k, mark in enumerate(first) if mark == start}
            members = self._constraint[rows[start]] - self._first[group]
            parts.append(_Part.of_rows(self.grouped.groups[group], own, members))
        return parts


@dataclass(frozen=True, slots=True)
class _Part:
    """What a block has of a constraint.

    Attributes
    ----------
    group
        The constraint's group.
    rows
        Rows of the block by row of the constraint.
    members : ndarray of int, shape (L,)
        Which of the group's constraints it is, for each block.
    inputs
        The inputs that these rows read.
    """

    group: Group
    rows: Mapping[int, int]
    members: Index
    inputs: Mapping[str, Source]

    @classmethod
    def of_rows(cls, group: Group, rows: Mapping[int, int], members: Index) -> _Part:
        """Find the inputs that the rows read."""
        stack = [vector[row] for vector in (group.Phi, group.nu, group.gamma) for row in rows]
        stack += [node for row, _, node in group.Phi_q if row in rows]
        found: set[int] = set()
        while stack:
            node = stack.pop()
            if node not in found:
                found.add(node)
                stack += operands_of(group.nodes[node])
        read = {group.nodes[node][1] for node in found if group.nodes[node][0] == "input"}
        inputs = {name: source for name, source in group.inputs.items() if name in read}
        return cls(group, rows, members, inputs)

    def of(self, lanes: Index) -> _Part:
        """Return the part of some of the blocks."""
        return replace(self, members=self.members[lanes])

    def entries(self) -> Iterator[tuple[int, int, int]]:
        """Give row in the block, column of the constraint and node of the entries of Phi_q."""
        for row, column, node in self.group.Phi_q:
            if row in self.rows:
                yield self.rows[row], column, node

    def reads(self, angles: Index) -> Iterator[Index]:
        """Give the coordinates that are read, (L,) each: by inputs, and by columns of Phi_q."""
        for source in self.inputs.values():
            index = source.index
            if source.kind in ("cos", "sin"):
                index = angles[index]
            if source.kind not in ("number", "value"):
                yield index[self.members]
        for _, column, _ in self.entries():
            yield self.group.columns[self.members, column]


def _equal(marks: Index) -> Iterator[Index]:
    """Give the positions of equal columns, for each kind of them, in order of appearance."""
    _, first, which = np.unique(marks, axis=1, return_index=True, return_inverse=True)
    for kind in np.argsort(first).tolist():
        yield np.flatnonzero(which.reshape(-1) == kind)


def _slots(reads: Index, own: Index) -> Index:
    """Return the place of each coordinate read among those of its block, the others behind."""
    slots = np.full(reads.shape, -1)
    for k, column in enumerate(own):
        slots[reads == column] = k
    following = np.full(own.shape[1], len(own))
    for k in range(len(reads)):
        is_new = slots[k] < 0
        slots = np.where(is_new & (reads == reads[k]), following, slots)
        following += is_new
    return slots


def _columns(reads: Index, slots: Index, own: Index) -> Index:
    """Return the coordinates of blocks in the order of their slots."""
    _, first = np.unique(slots, return_index=True)
    others = first[slots[first] >= len(own)]
    return np.concatenate((own, reads[others]))


def _stacked(parts: Sequence[_Part], kind: str, count: int) -> Index:
    """Return the indices of all inputs of a kind, shape (inputs, L)."""
    found = [
        source.index[part.members]
        for part in parts
        for source in part.inputs.values()
        if source.kind == kind
    ]
    return np.array(found, dtype=np.intp).reshape(-1, count)


@dataclass(frozen=True, slots=True)
class _Block:
    """The code of a block while it is being written.

    Attributes
    ----------
    slots
        Place of each coordinate of the system that it has.
    graph, hints
        The code.
    numbers, values
        Names of its parameters.
    """

    slots: Mapping[int, int]
    graph: Graph = field(default_factory=Graph)
    hints: dict[int, str] = field(default_factory=dict)
    numbers: list[str] = field(default_factory=list)
    values: list[str] = field(default_factory=list)


class _Writer:
    """Writes the first of equal blocks out as a program of its own."""

    def __init__(self, grouped: GroupedProgram) -> None:
        self._program, self._angles = grouped.program, grouped.angles
        self._instances = {item.first_row: item for item in grouped.program.instances}
        self._names = [item.name for item in grouped.program.coordinates]
        self._bodies = {column: body for body, column in grouped.program.frames}

    def write(self, parts: Sequence[_Part], rows: Index, columns: Index) -> BlockType:
        """Return the type of blocks that consist of these parts."""
        program = self._program
        block = _Block({column: slot for slot, column in enumerate(columns.tolist())})
        sections = tuple(self._section(part, block) for part in parts)
        of_block = replace(
            program,
            coordinates=tuple(program.coordinates[column] for column in columns.tolist()),
            equations=tuple(program.equations[row] for row in rows.tolist()),
            parameters=tuple(Parameter(name, 0.0) for name in (*block.numbers, *block.values)),
            frames=(),
            instances=tuple(section.instance for section in sections),
        )
        code = InlineProgram(of_block, tuple(block.graph.nodes), sections, block.hints)
        inner = [entry for entry in jacobian_entries(code) if entry[1] < rows.size]
        plan = plan_entries(rows.size, rows.size, inner)
        return BlockType(code, plan, rows.size, len(block.numbers), len(block.values))

    def _section(self, part: _Part, block: _Block) -> Section:
        """Return the rows of a constraint."""
        item, graph, member = part.group, block.graph, int(part.members[0])
        instance = self._instances[int(item.rows[member])]
        # What the rows do not read is copied too, and not looked at.
        bound = dict.fromkeys(item.inputs, graph.const(0))
        for name, source in part.inputs.items():
            # No name of a user's has a space.
            own = f"{instance.name} {name}"
            bound[name] = self._input(block, source.kind, int(source.index[member]), own)
        new = graph.instantiate(item.nodes, bound)
        for node, stem in item.hints.items():
            if graph.nodes[new[node]][0] not in ("neg", "const", "input", "call"):
                block.hints.setdefault(new[node], f"{instance.name}_{stem}")
        entries = {
            name: tuple(Entry(there, 0, new[vector[here]]) for here, there in part.rows.items())
            for name, vector in (("Phi", item.Phi), ("nu", item.nu), ("gamma", item.gamma))
        }
        Phi_q = [
            Entry(row, block.slots[int(item.columns[member, column])], new[node])
            for row, column, node in part.entries()
        ]
        entries["Phi_q"] = tuple(sorted(Phi_q, key=lambda entry: (entry.row, entry.column)))
        of_block = replace(instance, first_row=min(part.rows.values()))
        return Section(of_block, "and its like in the other blocks", entries)

    def _input(self, block: _Block, kind: str, index: int, own: str) -> int:
        """Return the node of an input; `own` is its name if it is a parameter of the block."""
        graph = block.graph
        if kind in ("cos", "sin"):
            column = self._angles[index]
            node = graph.call(kind, graph.input(self._names[column]))
            block.hints[node] = f"{kind[0]}_{self._bodies[column]}"
            return node
        if kind == "q":
            return graph.input(self._names[index])
        if kind == "q_dot":
            name = rate(self._names[index])
            block.hints[graph.square(graph.input(name))] = f"{name}_sq"
            return graph.input(name)
        (block.numbers if kind == "number" else block.values).append(own)
        return graph.input(own)
