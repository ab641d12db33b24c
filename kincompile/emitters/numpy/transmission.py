"""A transmission in Python: one module, of floats and lists."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from kincompile.emitters.lines import indented
from kincompile.emitters.numpy.march import PythonSolver
from kincompile.emitters.numpy.target import function_body, support, tables
from kincompile.emitters.numpy.text import tuple_text
from kincompile.emitters.transmission import NUMBERS, statuses
from kincompile.report.templates import fill
from kincompile.solver.nodes import LANE
from kincompile.solver.reader import transmission

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.emitters.transmission import Transmission
    from kincompile.solver.nodes import Type

RESERVED = ("f", "u", "q", "p")
"""Names that the functions use besides those of the target."""


class _Solver(PythonSolver):
    """Prints the text with names that begin with an underscore."""

    calls: Mapping[str, str] = {**PythonSolver.calls, "evaluate": "_evaluate"}  # a constant

    @staticmethod
    def named(name: str) -> str:
        """Return the name of a constant."""
        return {"NOTHING": "math.nan"}.get(name, f"_{name}")

    def zero(self, kind: Type) -> str:
        """Return the first value of a field or of rows."""
        match [self.named(x) for x in kind.dims if x != LANE]:
            case [rows, columns]:
                return f"[[0.0] * {columns} for _ in range({rows})]"
        return super().zero(kind)


def files(of: Transmission) -> Mapping[str, str]:
    """Return the module."""
    listing = of.listing
    read = [
        f"{listing.input_names[name]} = {vector}[{k}]"
        for name, (vector, k) in of.of.read.items()
        if name in listing.inputs
    ]
    body = [*read, *function_body(of.of.code, listing, of.printer, "packed")]
    text = "\n".join(body)
    program = of.of.code.program
    parts = support(program, listing.functions, has_large_blocks=False)
    constants = [f"_{x} = {n}" for x, n in of.sizes.items()]
    constants += [f"_{x} = {tuple_text(map(repr, own))}" for x, own in of.tables.items()]
    constants += [f"_{x} = {value!r}" for x, value in NUMBERS.items()]
    data = {
        "header": "\n".join(of.about()),
        "names": "\n".join(f"{x} = {tuple_text(own)}" for x, own in of.names.items()),
        **{x: tuple_text(map(repr, map(float, getattr(of, x)))) for x in ("p", "u", "q")},
        "size": repr(of.of.size),
        "statuses": "\n".join(f"{x} = _{x} = {n}" for x, n in statuses().items()),
        "constants": "\n".join(constants),
        "of_math": [x for x in ("pi", "nan") if re.search(rf"\b{x}\b", text)],
        "tables": "\n".join(tables(program)),
        "elementary": parts["elementary"].partition("\n\n\n")[2],
        "body": indented(body),
        "solver": _Solver(transmission()).text(),
    }
    return {f"{of.name}_transmission.py": fill("numpy/transmission.py.jinja", data)}
