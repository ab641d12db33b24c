"""One function of the emitted module: which values get a name, in which order, what it returns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

from kincompile import quantities
from kincompile.emitters.schedule import Assignment, Scheduler
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Iterator, Mapping, Sequence

    from kincompile.emitters.naming import NameTable
    from kincompile.ir.inline import ConstraintRows, Entry, InlineProgram
    from kincompile.ir.program import Program


@dataclass(frozen=True, slots=True)
class UsedFrame:
    """What is used of a body's frame, the angle where that is its cosine and sine, and A."""

    angle: int | None
    values: tuple[Assignment, ...]
    formula: str


def frames_title(frames: Sequence[UsedFrame]) -> list[str]:
    """Return the comment that explains frames; empty without frames."""
    return [f"body frames: A = {frame.formula}" for frame in frames[:1]]


@dataclass(frozen=True, slots=True)
class Listing:
    """A function as straight-line code."""

    frames: tuple[UsedFrame, ...]  # body frames, first of all
    # Values that are used more than once, by the section that needs them first.
    steps: tuple[tuple[ConstraintRows, tuple[Assignment, ...]], ...]
    # Quantity by quantity: the entries of each section, in order.
    results: tuple[tuple[str, tuple[tuple[ConstraintRows, tuple[Entry, ...]], ...]], ...]
    inputs: frozenset[str]  # names of the inputs that are read, in the model
    input_names: Mapping[str, str]  # names of all inputs in the target, by those in the model
    functions: tuple[str, ...]  # names of the elementary functions that are called
    names: Mapping[int, str]  # names of all named nodes, inputs included


def varying(inline: InlineProgram, section: ConstraintRows, quantity: str) -> tuple[Entry, ...]:
    """Return the entries a function computes: of a matrix those that are not plain numbers."""
    entries = section.entries[quantity]
    if not entries or all(
        item.name != quantity or not item.is_matrix for item in quantities.QUANTITIES
    ):
        return entries
    return tuple(entry for entry in entries if inline.number(entry.node) is None)


def schedule(
    inline: InlineProgram,
    computed: Sequence[str],
    input_names: Mapping[str, str],
    table: NameTable,
) -> Listing:
    """Arrange the code of a function that returns the quantities `computed`.

    `input_names` are the target's names of coordinates, rates and parameters; `table` has names
    that are taken, and this function's own names do not leave it.
    """
    results = tuple(
        (name, tuple((section, varying(inline, section, name)) for section in inline.sections))
        for name in computed
    )
    starts = [
        [entry.node for _, rows in results for entry in rows[k][1]]
        for k in range(len(inline.sections))
    ]
    scheduler = Scheduler(inline.nodes, chain(*starts), {}, table.copy(), inline.hints)
    inputs = _name_inputs(inline, scheduler, input_names)
    frames = _frames(inline, scheduler)
    steps = tuple(
        (section, own)
        for section, nodes in zip(inline.sections, starts, strict=True)
        if (own := scheduler.assign(section.instance.name, scheduler.operands_first(nodes)))
    )
    functions = _functions(inline, scheduler.uses, frames)
    return Listing(frames, steps, results, inputs, input_names, functions, scheduler.names)


def _name_inputs(
    inline: InlineProgram, scheduler: Scheduler, input_names: Mapping[str, str]
) -> frozenset[str]:
    """Name the inputs that are read; return their names in the model."""
    nodes = [node for node in scheduler.uses if inline.nodes[node][0] == "input"]
    scheduler.names |= {node: input_names[inline.nodes[node][1]] for node in nodes}
    return frozenset(inline.nodes[node][1] for node in nodes)


def vectors(program: Program) -> dict[str, list[str]]:
    """Return the names of the elements of each vector that functions read."""
    coordinates = [item.name for item in program.coordinates]
    parameters = [item.name for item in program.parameters]
    orders = range(3 if program.observers else 2)
    states = {rate("q", k): [rate(name, k) for name in coordinates] for k in orders}
    return {**states, "p": parameters}


def input_names(
    program: Program, table: NameTable, read: Container[str] | None = None
) -> dict[str, str]:
    """Return the names of the inputs in a target, by the model's: all, or those that are read."""
    names = (name for members in vectors(program).values() for name in members)
    own = {name: table.take(name) for name in names if read is None or name in read}
    return {"t": "t", **own}


def inputs_read(program: Program, listing: Listing) -> Iterator[tuple[str, int, str]]:
    """Yield vector, index and name in the target of each input that is read, t apart."""
    for vector, members in vectors(program).items():
        for k, member in enumerate(members):
            if member in listing.inputs:
                yield vector, k, listing.input_names[member]


def _frames(inline: InlineProgram, scheduler: Scheduler) -> tuple[UsedFrame, ...]:
    """Return the frames of which something is used, and name that."""
    found, formula = [], inline.program.bodies[0].kernel.formula if inline.frames else ""
    for entries in inline.frames:
        used = [node for node in entries if node in scheduler.uses]
        parts = [node for node in scheduler.operands_first(used) if node not in used]
        shared = scheduler.assign("frame", parts)
        values = tuple(scheduler.name(node) for node in used)
        if values:
            found.append(UsedFrame(_angle(inline, values), (*shared, *values), formula))
    return tuple(found)


def _angle(inline: InlineProgram, values: Sequence[Assignment]) -> int | None:
    """Return the node whose cosine and sine the values are, None where they are something else."""
    calls = [inline.nodes[item.node] for item in values]
    if [call[:2] for call in calls] != [("call", "cos"), ("call", "sin")]:
        return None
    return calls[0][2] if calls[0][2] == calls[1][2] else None


def _functions(
    inline: InlineProgram, uses: Iterable[int], frames: tuple[UsedFrame, ...]
) -> tuple[str, ...]:
    """Return the names of the functions called; cosine and sine of a frame are one call."""
    pairs = [frame for frame in frames if frame.angle is not None]
    shared = {item.node for frame in pairs for item in frame.values}
    nodes = [inline.nodes[node] for node in uses if node not in shared]
    called = {node[1] for node in nodes if node[0] == "call"}
    called |= {"where" for node in nodes if node[0] == "select"}
    return tuple(sorted(called | ({"cos_sin"} if pairs else set())))
