"""The NumPy target for large mechanisms: one function a group of constraints, arrays in a file.

The text of the module depends on the number of groups, not on the number of constraints; the arrays
are in ``<name>.npz`` beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.emitters.evaluators import input_names, inputs_read, schedule
from kincompile.emitters.lines import indented, wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.numpy.target import (
    RESERVED,
    function_body,
    public_functions,
    support,
)
from kincompile.emitters.numpy.text import NUMPY, list_texts, solvability_text, tuple_text
from kincompile.emitters.printer import Printer
from kincompile.emitters.target import Emitted
from kincompile.ir.graph import pruned
from kincompile.ir.inline import ConstraintRows, Entry, InlineProgram
from kincompile.quantities import FORMAT, functions, kernels_apart, pattern_of, states_of
from kincompile.report.templates import fill
from kincompile.structure.blocks import BlockForm

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.emitters.evaluators import Listing
    from kincompile.ir.graph import Node
    from kincompile.ir.grouping import FrameGroup, Group, GroupedProgram
    from kincompile.ir.program import Program
    from kincompile.quantities import Quantity


DEPENDENT = 1e-12
"""Pivot, in the scales of its equation and coordinate, up to which it is a rounding error."""

LARGEST_JUDGED = 40
"""Equations of a block up to which a pivot that small says that they are dependent."""


def emit_grouped(grouped: GroupedProgram) -> Emitted:
    """Return a program as a NumPy module with a companion file of arrays."""
    program, module = grouped.program, _Module(grouped)
    for quantity in program.quantities:
        module.add_places(quantity)
    groups = [line for item in grouped.groups for line in module.group(item)]
    frames = [module.frames(item) for item in grouped.frames]
    module.code += ["", "", *module.values("values", grouped.values, "q")]
    if grouped.moving:
        module.code += ["", "", *module.values("moving", grouped.moving, "q, q_dot")]
    blocks = _blocks(module)
    data = _data(module, frames, groups, is_planned=bool(blocks))
    arrays = _constants(program) | module.arrays | blocks
    files = {f"{program.name}.py": fill("numpy/grouped.py.jinja", data)}
    return Emitted(program.name, files, _small(arrays), program.unsolvable)


def _blocks(module: _Module) -> dict[str, NDArray[Any]]:
    """Return the arrays of the block triangular form; nothing where equations are dependent."""
    size = len(module.program.equations)
    if size != len(module.program.coordinates):
        return {}
    rows, columns = module.arrays["pattern"].T
    form = BlockForm.of(rows, columns, size)
    if form is None or _are_dependent(form, module.arrays["constants"], module.varies):
        return {}
    names = ("blocks.rows", "blocks.columns", "blocks.sizes", "blocks.varies")
    return dict(zip(names, (*form.order(), module.varies), strict=True))


def _are_dependent(
    form: BlockForm, constants: NDArray[np.float64], varies: NDArray[np.bool_]
) -> bool:
    """Return whether a block is singular with any numbers in place of those that vary.

    Blocks alone: along a chain of them pivots may shrink without end. So may those of a large one.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    size, inner = form.of_row.size, form.is_inner()
    values = np.where(varies, np.random.default_rng(0).uniform(1, 2, varies.size), constants)
    for places in (form.rows, form.columns):  # each equation and coordinate in its own scale
        largest = np.zeros(size)
        np.maximum.at(largest, places, np.abs(values))
        values = values / np.where(largest > 0, largest, 1.0)[places]
    try:
        entries = values[inner], (form.rows[inner], form.columns[inner])
        factors = splu(csc_array(entries, shape=(size, size)))
    except RuntimeError:
        return True
    pivots = factors.U.diagonal()[factors.perm_c]
    is_small = np.bincount(form.of_row)[form.of_column] <= LARGEST_JUDGED
    return bool((np.abs(pivots[is_small]) <= DEPENDENT).any())


def _constants(program: Program) -> dict[str, NDArray[Any]]:
    """Return names and numbers of the mechanism, as arrays."""
    columns_of = [(body.columns.start, len(body.columns)) for body in program.bodies]
    arrays: dict[str, NDArray[Any]] = {
        "coordinates": _text([item.name for item in program.coordinates]),
        "units": _text([item.unit for item in program.coordinates]),
        "equations": _text(program.equations),
        "bodies": _text([body.name for body in program.bodies]),
        "body_columns": np.array(columns_of, dtype=np.intp).reshape(-1, 2),
        "guess": np.array([item.guess for item in program.coordinates]),
    }
    for name, spline in program.tables.items():
        arrays[f"{name}.breaks"] = np.array(spline.breaks)
        arrays[f"{name}.coefficients"] = np.array(spline.coefficients)
    return arrays


class _Module:
    """The code and the arrays of a module, while they are written."""

    def __init__(self, grouped: GroupedProgram) -> None:
        self.grouped, self.program = grouped, grouped.program
        self.code: list[str] = []  # lines of the functions
        self.called: set[str] = set()  # elementary functions that they call
        # What goes into the companion file.
        self.arrays: dict[str, NDArray[Any]] = {"numbers": grouped.numbers}
        # Which entries of Phi_q, (nnz,), are not plain numbers.
        self.varies: NDArray[np.bool_] = np.empty(0, dtype=bool)

    def add_places(self, quantity: Quantity) -> None:
        """Write down where each group's entries of a quantity stand, and those that never change.

        An entry of a matrix stands in its pattern; plain numbers are not computed by the groups.
        """
        entries, values = self.grouped.entries(quantity)
        numbers, computed = entries[:, 0], np.full(values.size, True)
        if quantity.is_matrix:
            width, computed = self.program.shape_of(quantity)[1], np.isnan(values)
            whole, numbers = np.unique(entries @ (width, 1), return_inverse=True)
            constants = np.zeros(whole.size)
            np.add.at(constants, numbers[~computed], values[~computed])
            name = pattern_of(quantity)
            self.arrays[_array_of(name)] = np.stack(divmod(whole, width), axis=1)
            self.arrays[_array_of(name, "constants")] = constants
            if quantity.name == "Phi_q":
                self.varies = np.full(whole.size, False)
                self.varies[numbers[computed]] = True
        start = 0
        for item in self.grouped.groups:
            end = start + len(item.outputs[quantity.name]) * item.size
            own = numbers[start:end][computed[start:end]]
            self.arrays[f"{item.name}.{quantity.name}"] = own.reshape(-1, item.size)
            start = end

    def group(self, item: Group) -> list[str]:
        """Write the functions of a group; return the lines of its entry in the module's table."""
        table = NameTable((*RESERVED, *self.program.tables))
        names = {name: table.take(name) for name in item.inputs}
        entries = {
            name: tuple(Entry(*entry) for entry in own) for name, own in item.outputs.items()
        }
        code = self._inline(item.nodes, entries, item.hints)
        lines = [f'Group("{item.name}", {{']
        lines += [f'    "{names[name]}": "{source.kind}",' for name, source in item.inputs.items()]
        lines.append("}, {")
        for name, source in item.inputs.items():
            self.arrays[f"{item.name}.{names[name]}"] = source.index
        # Of right sides alone, because Phi_q is then at hand.
        for kernel, computed in kernels_apart(self.program.quantities).items():
            if not any(item.outputs[name] for name in computed):
                continue
            listing, body = self._body(code, computed, names, table)
            read = [names[name] for name in item.inputs if name in listing.inputs]
            what = f'{kernel} of {item.size} constraints like "{item.sample.name}"'
            self._function(f"_{item.name}_{kernel}", read, what, body)
            quoted = "".join(f'"{name}", ' for name in read)
            lines.append(f'    "{kernel}": (_{item.name}_{kernel}, ({quoted})),')
        return [*lines, "}),"]

    def frames(self, item: FrameGroup) -> str:
        """Write the function of the frames of a kind of body; return its line in the table."""
        kernel, table = item.kernel, NameTable(RESERVED)
        names = {k: table.take(letter) for k, letter in enumerate(kernel.letters)}
        read = [k for k in names if ("input", k) in kernel.nodes]
        entries = tuple(Entry(k, 0, node) for k, node in enumerate(kernel.entries))
        hints = dict(zip(kernel.entries, kernel.symbols, strict=True))
        code = self._inline(kernel.nodes, {"frame": entries}, hints, (kernel.entries,))
        _, body = self._body(code, ("frame",), names, table)
        what = f"{', '.join(kernel.symbols)} of the frames of {item.columns.shape[1]} bodies"
        self._function(f"_{item.name}", [names[k] for k in read], what, body)
        self.arrays[f"{item.name}.columns"] = item.columns[read]
        kinds = ", ".join(f'"{kind}"' for kind in item.kinds)
        return f'Frames("{item.name}", _{item.name}, ({kinds},)),'

    def values(self, name: str, wanted: Sequence[int], states: str) -> list[str]:
        """Return the function of values that depend on t, p and coordinates, or rates too."""
        program = self.program
        nodes, new = pruned(program.values, wanted)
        table = NameTable((*RESERVED, *program.tables))
        names = input_names(program, table, {node[1] for node in nodes if node[0] == "input"})
        entries = tuple(Entry(k, 0, new[node]) for k, node in enumerate(wanted))
        code = self._inline(tuple(nodes), {name: entries}, {})
        listing, body = self._body(code, (name,), names, table)
        unpack = [f"{name} = {vector}[{k}]" for vector, k, name in inputs_read(program, listing)]
        return [f"def _{name}(f, {states}, t, p):", *(f"    {line}" for line in (*unpack, *body))]

    def _inline(
        self,
        nodes: tuple[Node, ...],
        entries: Mapping[str, tuple[Entry, ...]],
        hints: Mapping[int, str],
        frames: tuple[tuple[int, ...], ...] = (),
    ) -> InlineProgram:
        """Return code as that of one constraint, which is not named in it."""
        rows = ConstraintRows(self.program.parts[0], entries)
        return InlineProgram(self.program, nodes, (rows,), hints, frames)

    def _body(
        self,
        code: InlineProgram,
        computed: Sequence[str],
        names: Mapping[Any, str],
        table: NameTable,
    ) -> tuple[Listing, list[str]]:
        """Return the listing and the lines of a function."""
        listing = schedule(code, computed, names, table)
        self.called |= set(listing.functions)
        printer = Printer(NUMPY, code.nodes, listing.names)
        return listing, function_body(code, listing, printer, "plain")

    def _function(self, name: str, read: Sequence[str], what: str, body: Sequence[str]) -> None:
        """Write a function."""
        self.code += ["", "", f"def {name}({', '.join(('f', *read))}):", f'    """{what}."""']
        self.code += [f"    {line}" for line in body]


def _public(program: Program, nonzeros: int) -> Iterator[str]:
    """Yield the public functions: of the quantities, and of those that are given together."""
    for quantity, name, lines in public_functions(program, nonzeros):
        yield from lines
        yield _call((name,), quantity.states) + "[0]\n\n"
    for name, own in functions(program.quantities).items():
        if len(own) > 1:
            states = states_of(own)
            yield f"def {name}({', '.join(states)}, t, p=DEFAULTS):"
            yield f'    """{", ".join(own[:-1])} and {own[-1]} in one go."""'
            yield _call(own, states) + "\n\n"


def _call(names: Sequence[str], states: Sequence[str]) -> str:
    """Return the line that evaluates quantities."""
    wanted = ", ".join(f'"{name}"' for name in names)
    end = "," if len(names) == 1 else ""
    return f"    return _evaluate(({wanted}{end}), t, p, {', '.join(states)})"


def _data(
    module: _Module, frames: Sequence[str], groups: Sequence[str], *, is_planned: bool
) -> dict[str, Any]:
    """Return what goes into the template, by slot."""
    program, nonzeros = module.program, len(module.arrays["pattern"])
    lists = list_texts(program)
    return {
        "title": program.name,
        "name": program.name,
        "format": FORMAT,
        "fingerprint": program.fingerprint,
        "n": len(program.coordinates),
        "m": len(program.equations),
        "nonzeros": nonzeros,
        "k": len(program.parameters),
        "has_outputs": bool(program.outputs),
        "has_moving": bool(module.grouped.moving),
        "loads": tuple_text(f'"{item.name}"' for item in program.loads),
        "output_units": indented(
            wrapped(f'"{item.name}": "{item.unit}"' for item in program.outputs)
        ),
        "solvability": solvability_text(program),
        "is_planned": is_planned,
        "parameter_units": indented(
            wrapped(f'"{item.name}": "{item.unit}"' for item in program.parameters)
        ),
        "tables": "\n".join(
            f'{name} = _data["{name}.breaks"], _data["{name}.coefficients"]'
            for name in program.tables
        ),
        **{name: lists[name] for name in ("outputs", "parameters", "defaults")},
        "kernels": "\n".join(module.code),
        "functions": "\n".join(_public(program, nonzeros)),
        "patterns": "\n".join(_patterns(program)),
        "quantities": indented(_results(program)),
        "kernel_table": indented(
            f"{name!r}: {given}," for name, given in kernels_apart(program.quantities).items()
        ),
        "frames": indented(frames),
        "groups": indented(groups),
        **support(program, {*module.called, "where"}, has_large_blocks=True),
    }


def _patterns(program: Program) -> Iterator[str]:
    """Yield the lines that read the patterns of matrices."""
    for name in (pattern_of(item) for item in program.quantities if item.is_matrix):
        yield f'{name} = np.array(_data["{_array_of(name)}"], dtype=int)'


def _array_of(pattern: str, word: str = "pattern") -> str:
    """Return the array that a pattern, or another word of its matrix, is read from."""
    return pattern.replace("PATTERN", word, 1)


def _results(program: Program) -> Iterator[str]:
    """Yield the lines of the table of quantities."""
    for item in program.quantities:
        shape = ", ".join(map(str, program.shape_of(item)))
        own = "None" if item.rows == "equations" and not item.adds else "0.0"
        if item.is_matrix:
            own = f'_data["{_array_of(pattern_of(item), "constants")}"], {pattern_of(item)}'
        shape += "" if item.is_matrix else ","
        yield f'"{item.name}": Quantity(({shape}), {item.adds}, {own}),'


def _text(names: Sequence[str]) -> NDArray[np.uint8]:
    """Return names as bytes, a line each."""
    return np.frombuffer("\n".join(names).encode(), dtype=np.uint8)


def _small(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the arrays in the order of their names, indices in as few bytes as they need."""
    return {
        name: values.astype(np.int32) if values.dtype.kind == "i" else values
        for name, values in sorted(arrays.items())
    }
