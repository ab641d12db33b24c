"""The C target for large mechanisms: the functions of each type of block, arrays in a file.

The text depends on the number of block types, not on the number of constraints; which coordinates
and attributes each block has is in ``<name>_c.npz`` beside it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import UnsupportedError
from kincompile.ir.block_types import block_types, tiles
from kincompile.ir.elimination import jacobian_entries
from kincompile.ir.inline import Entry, InlineProgram, Section
from kincompile.names import rate
from kincompile.structure.stages import plan_stages
from kincompile.targets.c.dialect import C
from kincompile.targets.c.functions import evaluator, solve_functions
from kincompile.targets.c.library import LANES, RESERVED, array_lines, elementary
from kincompile.targets.functions import inputs_read, schedule
from kincompile.targets.layout import assigned, indented, labelled
from kincompile.targets.naming import NameTable
from kincompile.targets.numpy.grouped import pattern_of
from kincompile.targets.printer import Printer
from kincompile.targets.solving import schedule_solve
from kincompile.targets.target import Emitted
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.block_types import BlockType, Run
    from kincompile.ir.grouping import GroupedProgram

FUNCTIONS: Mapping[str, tuple[str, ...]] = {
    "position": ("Phi", "Phi_q"),
    "nu": ("nu",),
    "gamma": ("gamma",),
}
"""What a type evaluates, and the quantities of each."""


@dataclass(frozen=True, slots=True)
class _Written:
    """A type as text.

    Attributes
    ----------
    text
        Its functions.
    called
        Elementary functions that they call.
    sizes
        Its numbers of coordinates, equations, entries of Phi_q, parameters, numbers kept of Phi_q
        and determinants.
    is_chain
        Whether blocks of the type may need each other.
    largest_block
        Equations of the largest block that its planned solve leaves.
    """

    text: str
    called: frozenset[str]
    sizes: Mapping[str, int]
    is_chain: bool
    largest_block: int


def emit_c_grouped(grouped: GroupedProgram) -> Emitted:
    """Return a large program as C99 source, header and a companion file of arrays.

    Raises
    ------
    UnsupportedError
        If the program does not split into equal blocks, or calls a function that C does not have.
    """
    split = split_into_types(grouped)
    if split is None:
        raise UnsupportedError(
            f"the equations of {grouped.program.name!r} do not split into blocks of few types, "
            "which is what the target 'c' writes for a large mechanism; use target='numpy'"
        )
    return emit_c_large(grouped, *split)


def split_into_types(
    grouped: GroupedProgram,
) -> tuple[tuple[BlockType, ...], tuple[Run, ...]] | None:
    """Return the block types of a program and their order of solution, None if it has none."""
    size = len(grouped.program.equations)
    if size != len(grouped.program.coordinates):
        return None
    rows, columns, constants, _ = pattern_of(grouped)
    stages = plan_stages(rows, columns, constants, size, shared=1)
    return None if stages is None else block_types(grouped, stages)


def emit_c_large(
    grouped: GroupedProgram, types: Sequence[BlockType], runs: Sequence[Run]
) -> Emitted:
    """Return a program by block types as C99 source, header and a companion file of arrays.

    Raises
    ------
    UnsupportedError
        If the program calls a function that C does not have.
    """
    program = grouped.program
    written = [_type(number, kind, runs) for number, kind in enumerate(types)]
    values, called = _values(grouped)
    called |= {name for item in written for name in item.called}
    largest = max(item.largest_block for item in written)
    companion = f"{program.name}_c.npz"
    about = {
        "name": program.name,
        "n": len(program.coordinates),
        "m": len(program.equations),
        "companion": companion,
    }
    sizes = {name: max(1, *(item.sizes[name] for item in written)) for name in written[0].sizes}
    source = {
        **about,
        **sizes,
        "values": len(grouped.values),
        # a vector, at most as many determinants, and the values
        "work": 2 * len(program.coordinates) + len(grouped.values),
        "lanes": LANES,
        "fingerprint": program.fingerprint,
        "defaults": array_lines([repr(item.default) for item in program.parameters]),
        "elementary": elementary(program, called, largest),
        "types": "".join(item.text for item in written),
        "table": "\n".join(
            _row(k, *pair) for k, pair in enumerate(zip(types, written, strict=True))
        ),
        "values_code": indented(values),
    }
    header = {
        **about,
        "NAME": program.name.upper(),
        "guard": f"{program.name.upper()}_H",
        "k": len(program.parameters),
    }
    files = {
        f"{program.name}.c": fill("c/large.c.jinja", source),
        f"{program.name}.h": fill("c/large.h.jinja", header),
    }
    return Emitted(program.name, files, _arrays(types, runs), companion)


def _type(number: int, kind: BlockType, runs: Sequence[Run]) -> _Written:
    """Write the functions of a type."""
    code, prefix, own = kind.code, f"type_{number}_", kind.own
    plan, program = kind.plan, code.program
    assert plan is not None  # or there were no types
    lines, called = _evaluators(kind, prefix)
    determined = program.coordinates[:own]
    square = dataclasses.replace(code, program=dataclasses.replace(program, coordinates=determined))
    solving = schedule_solve(square, plan, NameTable(RESERVED))
    lines += ["", *solve_functions(square, solving, prefix)]
    of_type = [run for run in runs if run.type == number]
    chains = [run for run in of_type if run.is_chain]
    data = {
        "number": number,
        "blocks": sum(run.columns.shape[1] for run in of_type),
        "about": "\n".join(f"// {line}" for line in _about(kind)),
        "is_angle": ", ".join(str(int(item.unit == "rad")) for item in determined),
        "functions": "\n".join(lines),
        "coupling": indented(_coupling(kind)),
        "own": own,
        "is_chain": bool(chains),
        **_chain(kind, chains),
    }
    sizes = {
        "slots": len(program.coordinates),
        "rows": own,
        "entries": len(code.pattern()),
        "parameters": len(program.parameters),
        "factors": len(solving.factors),
        "determinants": len(plan.determinants),
    }
    largest = max((len(block.rows) for block in plan.blocks), default=0)
    text = fill("c/block_type.c.jinja", data)
    return _Written(text, called, sizes, bool(chains), largest)


def _evaluators(kind: BlockType, prefix: str) -> tuple[list[str], frozenset[str]]:
    """Return the functions that evaluate Phi, Phi_q, nu and gamma, and what they call."""
    program = kind.code.program
    table = NameTable((*RESERVED, *program.tables))
    coordinates = [item.name for item in program.coordinates]
    wanted = [*coordinates, *(rate(name) for name in coordinates)]
    wanted += [item.name for item in program.parameters]
    names = {name: table.take(_identifier(name)) for name in wanted}
    lines: list[str] = []
    called: set[str] = set()
    for name, quantities in FUNCTIONS.items():
        listing = schedule(kind.code, quantities, names, table)
        called |= set(listing.functions)
        lines += ["", *evaluator(name, kind.code, listing, names, prefix)]
    return lines, frozenset(called)


def _chain(kind: BlockType, chains: Sequence[Run]) -> dict[str, Any]:
    """Return what the function of blocks that need each other consists of."""
    coupled, links = kind.coupled(), _links(kind, chains)
    start = [f"before[{k}] = all[at->columns[{slot}][first]];" for k, slot in enumerate(coupled)]
    handing_on = [f"before[{k}] = x[{slot}][lane];" for k, slot in enumerate(links)]
    return {
        "n_coupled": len(coupled),
        "taking": indented(_taking(kind), 2),
        "is_linked": bool(links),
        "start": indented(start, 1 if links else 2),
        "handing_on": indented(handing_on, 2),
    }


def _about(kind: BlockType) -> list[str]:
    """Return the lines that say what a block is made of."""
    program = kind.code.program
    names = [item.name for item in program.coordinates]
    lines = labelled("by", program.equations) + labelled("for", names[: kind.own])
    return lines + labelled("given", names[kind.own :]) if names[kind.own :] else lines


def _identifier(name: str) -> str:
    """Return a name that C accepts for a coordinate, a rate or a parameter of a block."""
    return name.replace(" ", "_").replace(".", "_").replace("'", "_prime")


def _coupling(kind: BlockType) -> list[str]:
    """Return the lines that take the columns of earlier blocks off the right side."""
    lines = [
        f"right[{row}][lane] -= {_entry(number, value)} * x[{column}][lane];"
        for number, (row, column, value) in enumerate(jacobian_entries(kind.code))
        if column >= kind.own
    ]
    if not lines:
        return ["(void)at, (void)right, (void)x, (void)lane;"]
    return lines if any("at->" in line for line in lines) else ["(void)at;", *lines]


def _taking(kind: BlockType) -> list[str]:
    """Return the lines that write down the columns of earlier blocks."""
    place = {column: k for k, column in enumerate(kind.coupled())}
    return [
        f"taken[{place[column]}][{row}][lane] = {_entry(number, value)};"
        for number, (row, column, value) in enumerate(jacobian_entries(kind.code))
        if column in place
    ]


def _links(kind: BlockType, chains: Sequence[Run]) -> list[int]:
    """Return what each coordinate taken over is in the block before, empty if it is not there."""
    links = []
    for slot in kind.coupled():
        same = [
            own
            for own in range(kind.own)
            if all((run.columns[slot, 1:] == run.columns[own, :-1]).all() for run in chains)
        ]
        links += same[:1]
    return links if len(links) == len(kind.coupled()) else []


def _entry(number: int, value: Any) -> str:
    """Return an entry of Phi_q as text: a plain number, or where it is."""
    return f"at->Phi_q[{number}][lane]" if value is None else f"({float(value)!r})"


def _row(number: int, kind: BlockType, written: _Written) -> str:
    """Return the entry of a type in the table of types."""
    sizes = written.sizes["slots"], kind.own, kind.numbers, kind.values
    numbers = ", ".join(map(str, (*sizes, written.sizes["determinants"])))
    functions = [f"type_{number}_{name}_of_block" for name in (*FUNCTIONS, "factor")]
    functions += [f"type_{number}_solve", f"type_{number}_follow" if written.is_chain else "NULL"]
    numbers += f", type_{number}_is_angle"
    return f"    {{{numbers},\n" + "\n".join(f"        {name}," for name in functions) + "\n    },"


def _values(grouped: GroupedProgram) -> tuple[list[str], set[str]]:
    """Return the code of the values that depend on t, p and contact parameters, and its calls."""
    program = grouped.program
    table = NameTable((*RESERVED, *program.tables, "p", "values"))
    wanted = [item.name for item in program.parameters]
    wanted += [item.name for item in program.coordinates]
    names = {"t": "t", **{name: table.take(name) for name in wanted}}
    entries = tuple(Entry(k, 0, node) for k, node in enumerate(grouped.values))
    sections = (Section(program.instances[0], "", {"values": entries}),)
    code = InlineProgram(program, program.values, sections, {})
    listing = schedule(code, ("values",), names, table)
    printer = Printer(C, code.nodes, listing.names)
    lines = ["(void)t, (void)p, (void)values;"]
    if {"cos", "sin"} & set(listing.functions):
        lines += ["const int exact = 1;", "int64_t far = 0;"]
    lines += [
        f"const double {names[member]} = {vector}[{k}];"
        for vector, k, member in inputs_read(program, listing)
    ]
    for _, assignments in listing.steps:
        for item in assignments:
            lines += assigned(f"const double {item.name}", printer.text(item.node, own=True))
    for entry in entries:
        lines += assigned(f"values[{entry.row}]", printer.text(entry.node))
    return lines, set(listing.functions)


def _arrays(types: Sequence[BlockType], runs: Sequence[Run]) -> dict[str, NDArray[Any]]:
    """Return the data of the blocks, tile by tile."""
    header: list[tuple[int, int, bool, bool]] = []
    columns, numbers, values = [], [], []
    for tile in tiles(types, runs, LANES):
        count = tile.columns.shape[1]
        is_regular = count > 2 and not np.diff(tile.columns, 2).any()
        header.append((tile.type, count, tile.is_chain, is_regular))
        first = tile.columns[:, :2] if is_regular else tile.columns
        columns.append((np.diff(first, prepend=0) if is_regular else first).reshape(-1))
        numbers.append(tile.numbers.reshape(-1))
        values.append(tile.values.reshape(-1))
    return {
        "columns": np.concatenate(columns).astype(np.int32),
        "numbers": np.concatenate(numbers),
        "tiles": np.array(header, dtype=np.int32),
        "values": np.concatenate(values).astype(np.int32),
    }
