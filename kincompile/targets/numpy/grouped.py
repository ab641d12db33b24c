"""The NumPy target for large mechanisms: one function a group of constraints, arrays in a file.

The text of the module depends on the number of groups and of classes of equal blocks, not on the
number of constraints; the arrays are in ``<name>.npz`` beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import UnsupportedError
from kincompile.ir.inline import ConstraintRows, Entry, InlineProgram
from kincompile.quantities import FORMAT, kernels
from kincompile.targets.evaluators import input_names, inputs_read, schedule
from kincompile.targets.lines import indented, wrapped
from kincompile.targets.naming import NameTable
from kincompile.targets.numpy.dialect import NUMPY
from kincompile.targets.numpy.grouped_solve import (
    plan_solving,
    solving_arrays,
    solving_code,
    solving_table,
)
from kincompile.targets.numpy.target import (
    RESERVED,
    function_body,
    public_functions,
    support,
)
from kincompile.targets.numpy.text import solvability_text, tuple_text
from kincompile.targets.printer import Printer
from kincompile.targets.target import Emitted
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.grouping import Group, GroupedProgram
    from kincompile.ir.program import Program


def emit_grouped(grouped: GroupedProgram) -> Emitted:
    """Return a program as a NumPy module with a companion file of arrays."""
    program = grouped.program
    arrays: dict[str, NDArray[Any]] = {
        "numbers": grouped.numbers,
        "angles": np.array(grouped.angles, dtype=np.intp),
    }
    rows, columns, constants, order = pattern_of(grouped)
    arrays["pattern"] = np.stack((rows, columns), axis=1)
    arrays["constants"] = np.nan_to_num(constants)
    arrays["coordinates"] = _text([item.name for item in program.coordinates])
    arrays["units"] = _text([item.unit for item in program.coordinates])
    arrays["equations"] = _text(program.equations)
    for name, spline in program.tables.items():
        arrays[f"{name}.breaks"] = np.array(spline.breaks)
        arrays[f"{name}.coefficients"] = np.array(spline.coefficients)
    arrays["bodies"] = _text([body.name for body in program.bodies])
    columns_of = [(body.columns.start, len(body.columns)) for body in program.bodies]
    arrays["body_columns"] = np.array(columns_of, dtype=np.intp).reshape(-1, 2)
    arrays["guess"] = np.array([item.guess for item in program.coordinates])
    code: list[str] = []
    called: set[str] = set()
    tables = [_group_code(item, grouped, arrays, code, called) for item in grouped.groups]
    _entry_numbers(grouped, order, arrays)
    code += ["", "", *_values_code(grouped, called)]
    stages = plan_solving(program, rows, columns, constants)
    arrays |= solving_arrays(stages)
    code += solving_code(stages, program)
    source = fill(
        "numpy/grouped.py.jinja",
        _data(grouped, code, tables, solving_table(stages), sorted(called), len(rows)),
    )
    files = {f"{program.name}.py": source}
    return Emitted(program.name, files, _small(arrays), program.unsolvable)


def pattern_of(
    grouped: GroupedProgram,
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64], NDArray[np.intp]]:
    """Return rows, columns and constants of Phi_q row by row, and the order of its entries."""
    rows, columns, constants = [], [], []
    for item in grouped.groups:
        for row, column, node in item.outputs["Phi_q"]:
            value = item.number(node)
            rows.append(item.rows + row)
            columns.append(item.columns[:, column])
            constants.append(np.full(item.rows.size, np.nan if value is None else float(value)))
    found = [np.concatenate(parts) for parts in (rows, columns, constants)]
    order = np.lexsort((found[1], found[0]))
    return found[0][order], found[1][order], found[2][order], order


def _entry_numbers(
    grouped: GroupedProgram, order: NDArray[np.intp], arrays: dict[str, NDArray[Any]]
) -> None:
    """Write down where each group's varying entries of Phi_q stand in the pattern."""
    place = np.empty(order.size, dtype=np.intp)
    place[order] = np.arange(order.size)
    start = 0
    for item in grouped.groups:
        count = item.rows.size
        kept = []
        for _, _, node in item.outputs["Phi_q"]:
            if item.number(node) is None:
                kept.append(place[start : start + count])
            start += count
        arrays[f"{item.name}.entries"] = np.array(kept, dtype=np.intp).reshape(-1, count)


def _group_code(
    item: Group,
    grouped: GroupedProgram,
    arrays: dict[str, NDArray[Any]],
    code: list[str],
    called: set[str],
) -> list[str]:
    """Write the functions of a group; return the lines of its entry in the module's table."""
    table = NameTable((*RESERVED, *grouped.program.tables))
    names = {name: table.take(name) for name in item.inputs}
    sections = (ConstraintRows(item.sample, "", _local_entries(item)),)
    inline = InlineProgram(grouped.program, item.nodes, sections, item.hints)
    arrays[f"{item.name}.rows"] = item.rows
    lines = [f'Group("{item.name}", {len(item.outputs["Phi"])}, {{']
    lines += [f'    "{names[name]}": "{source.kind}",' for name, source in item.inputs.items()]
    lines.append("}, {")
    for name, source in item.inputs.items():
        arrays[f"{item.name}.{names[name]}"] = source.index
    for quantity in grouped.program.quantities:
        if quantity.rows == "coordinates":
            places = [item.columns[:, row] for row, _, _ in item.outputs[quantity.name]]
            shape = len(places), item.rows.size
            arrays[f"{item.name}.{quantity.name}"] = np.array(places, dtype=np.intp).reshape(shape)
    for function, computed in _kernels(grouped.program).items():
        listing = schedule(inline, computed, names, table)
        called |= set(listing.functions)
        read = [names[name] for name in item.inputs if name in listing.inputs]
        printer = Printer(NUMPY, inline.nodes, listing.names)
        body = function_body(inline, listing, printer, "plain")
        code += ["", "", f"def _{item.name}_{function}({', '.join(('f', *read))}):"]
        code += [f'    """{function} of {item.rows.size} constraints like "{item.sample.name}"."""']
        code += [f"    {line}" for line in body]
        quoted = "".join(f'"{name}", ' for name in read)
        lines.append(f'    "{function}": (_{item.name}_{function}, ({quoted})),')
    return [*lines, "}),"]


def _kernels(program: Program) -> dict[str, tuple[str, ...]]:
    """Return what is computed together; right sides alone, because Phi_q is then at hand."""
    found = kernels(program.quantities)
    del found["kinematics"]
    for quantity in program.quantities:
        if quantity.rows == "outputs" or (quantity.is_matrix and quantity.name != "Phi_q"):
            raise UnsupportedError(f"the grouped form has no {quantity.name}; use form='inline'")
    return found


def _public(program: Program, nonzeros: int) -> Iterator[str]:
    """Yield the public functions of the quantities."""
    for quantity, name, lines in public_functions(program, nonzeros):
        wanted = name.removeprefix("Phi_q_")
        states = ", ".join(quantity.states)
        yield from lines
        yield f'    return _evaluate(("{wanted}",), t, p, {states})[0]\n\n'


def _local_entries(item: Group) -> dict[str, tuple[Entry, ...]]:
    return {
        name: tuple(Entry(*output) for output in outputs) for name, outputs in item.outputs.items()
    }


def _values_code(grouped: GroupedProgram, called: set[str]) -> list[str]:
    """Return the function of the values that depend on t, p and contact parameters."""
    program = grouped.program
    table = NameTable((*RESERVED, *program.tables))
    names = input_names(program, table)
    sample = program.instances[0]
    entries = tuple(Entry(k, 0, node) for k, node in enumerate(grouped.values))
    inline = InlineProgram(
        program, program.values, (ConstraintRows(sample, "", {"values": entries}),), {}
    )
    listing = schedule(inline, ("values",), names, table)
    called |= set(listing.functions)
    unpack = [f"{name} = {vector}[{k}]" for vector, k, name in inputs_read(program, listing)]
    printer = Printer(NUMPY, inline.nodes, listing.names)
    body = function_body(inline, listing, printer, "plain")
    return ["def _values(f, q, t, p):", *(f"    {line}" for line in (*unpack, *body))]


def _data(
    grouped: GroupedProgram,
    code: list[str],
    tables: Sequence[list[str]],
    solving: Sequence[str],
    called: Sequence[str],
    nonzeros: int,
) -> dict[str, Any]:
    program = grouped.program
    return {
        "title": program.name,
        "name": program.name,
        "format": FORMAT,
        "fingerprint": program.fingerprint,
        "n": len(program.coordinates),
        "m": len(program.equations),
        "nonzeros": nonzeros,
        "k": len(program.parameters),
        "solvability": solvability_text(program),
        "is_planned": bool(solving),
        "parameters": tuple_text(f'"{item.name}"' for item in program.parameters),
        "parameter_units": indented(
            wrapped(f'"{item.name}": "{item.unit}"' for item in program.parameters)
        ),
        "tables": "\n".join(
            f'{name} = _data["{name}.breaks"], _data["{name}.coefficients"]'
            for name in program.tables
        ),
        "defaults": tuple_text((repr(item.default) for item in program.parameters), 62),
        "kernels": "\n".join(code),
        "functions": "\n".join(_public(program, nonzeros)),
        "sizes": indented(_sizes(program)),
        "groups": indented(line for lines in tables for line in lines),
        "stages": indented(solving),
        **support(called, has_frames=True, has_large_blocks=True),
    }


def _sizes(program: Program) -> list[str]:
    """Return the numbers of rows of the vectors; those whose rows are shared are sums."""
    rows = {"equations": "N_EQUATIONS", "coordinates": "N_COORDINATES"}
    vectors = [item for item in program.quantities if not item.is_matrix]
    sizes = [f'"{item.name}": {rows[item.rows]},' for item in vectors]
    return [*sizes, '"nonzeros": len(PATTERN),']


def _text(names: Sequence[str]) -> NDArray[np.uint8]:
    """Return names as bytes, a line each."""
    return np.frombuffer("\n".join(names).encode(), dtype=np.uint8)


def _small(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the arrays in the order of their names, indices in as few bytes as they need."""
    return {
        name: values.astype(np.int32) if values.dtype.kind == "i" else values
        for name, values in sorted(arrays.items())
    }
