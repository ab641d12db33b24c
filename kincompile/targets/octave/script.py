"""The Octave target, which is MATLAB too: a function each for Phi, Phi_q, nu, gamma, and a script.

This is the shape in which courses write them: column vectors, rows that count from 1, and a script
that solves position, velocity and acceleration over time with Newton's method. No toolbox.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from kincompile import quantities
from kincompile.errors import InputError, UnsupportedError
from kincompile.names import rate
from kincompile.quantities import functions
from kincompile.targets.functions import Listing, inputs_read, schedule
from kincompile.targets.headings import header, place, title
from kincompile.targets.layout import broken
from kincompile.targets.naming import NameTable
from kincompile.targets.printers import OCTAVE_FUNCTIONS, OctavePrinter
from kincompile.targets.target import Emitted
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.model.spline import SplineTable
    from kincompile.quantities import Quantity

LONGEST_NAME = 63
"""Characters of a name; MATLAB drops those behind them."""

KEYWORDS = (
    "break", "case", "catch", "classdef", "continue", "do", "else", "elseif", "end", "endif",
    "endfor", "endfunction", "endwhile", "endswitch", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "until", "while",
    "unwind_protect", "unwind_protect_cleanup",
)  # fmt: skip
"""Words of MATLAB and of Octave."""

RESERVED = (
    *KEYWORDS, *OCTAVE_FUNCTIONS.values(), "q", "q_dot", "t", "p", "pi", "zeros", "nargin",
    "either", "in_reals", "NaN", "isreal",
)  # fmt: skip
"""Names that the functions use."""


def emit_octave(code: InlineProgram) -> Emitted:
    """Return a program as .m files, the script first.

    Raises
    ------
    UnsupportedError
        If a name is longer than MATLAB reads, or a function does not exist there.
    InputError
        If the mechanism's time grid is none.
    """
    program = code.program
    spline_names = {name: f"{program.name}_{name}" for name in program.tables}
    table = NameTable((*RESERVED, *functions(), program.name, *spline_names.values()))
    wanted = [item.name for item in program.coordinates]
    wanted += [rate(name) for name in wanted] + [item.name for item in program.parameters]
    names = {"t": "t", **{name: table.take(name) for name in wanted}}
    files = {f"{program.name}.m": _script(code)}
    for quantity in quantities.QUANTITIES:
        listing = schedule(code, (quantity.name,), names, table)
        files[f"{program.name}_{quantity.name}.m"] = _function(quantity, code, listing, names)
        _require_short(listing.names.values())
    for name, spline in program.tables.items():
        files[f"{spline_names[name]}.m"] = _spline(spline_names[name], spline)
    _require_short(name.removesuffix(".m") for name in files)
    return Emitted(program.name, files)


def _require_short(names: Iterable[str]) -> None:
    """Refuse a name that MATLAB would take for another."""
    long = [name for name in names if len(name) > LONGEST_NAME]
    if long:
        raise UnsupportedError(
            f"MATLAB reads {LONGEST_NAME} characters of a name, and {long[0]!r} has {len(long[0])};"
            " give shorter names to the mechanism, its bodies and its constraints"
        )


def _function(
    quantity: Quantity, code: InlineProgram, listing: Listing, names: Mapping[str, str]
) -> str:
    """Return the file of one function."""
    program = code.program
    body = [*_inputs(program, listing, names), *_body(quantity, code, listing)]
    text = "\n".join(body)
    data = {
        "result": quantity.name,
        "quantity": quantity.name,
        "name": program.name,
        "arguments": ", ".join(quantity.arguments),
        "n_arguments": len(quantity.arguments),
        "about": quantity.about if quantity.is_matrix else f"{quantity.about[:-1]}, a column.",
        "header": _header(code),
        "fingerprint": program.fingerprint,
        "defaults": _column(((item.name, item.default) for item in program.parameters), 2),
        "body": text,
        "functions": "".join(
            fill(f"octave/{name}.m.jinja", {})
            for name in ("either", "in_reals")
            if f"{name}(" in text
        ),
    }
    return fill("octave/function.m.jinja", data).rstrip("\n") + "\n"


def _header(code: InlineProgram) -> str:
    return "\n".join(f"% {line}".rstrip() for line in header(code, first=1))


def _column(items: Iterable[tuple[str, float | None]], level: int) -> str:
    """Return named numbers as the lines of a column vector."""
    return "\n".join(f"{'    ' * level}{value!r}  % {name}" for name, value in items)


def _inputs(program: Program, listing: Listing, names: Mapping[str, str]) -> list[str]:
    """Return the lines that name the inputs that are read."""
    return [
        f"{names[member]} = {vector}({k + 1});"
        for vector, k, member in inputs_read(program, listing)
    ]


def _body(quantity: Quantity, code: InlineProgram, listing: Listing) -> list[str]:
    """Return the statements of a function, its inputs named."""
    printer = OctavePrinter(code.nodes, listing.names, code.program.name)
    lines = ["% body frames: A = [c, -s; s, c]"] if listing.frames else []
    for frame in listing.frames:
        for item in frame.values:
            lines += _assigned(item.name, printer.text(item.node, own=True))
    for section, assignments in listing.steps:
        lines.append(f"% {title(section, first=1)}")
        for item in assignments:
            lines += _assigned(item.name, printer.text(item.node, own=True))
    rows, columns = (*code.program.shape_of(quantity), 1)[:2]
    lines += ["", f"{quantity.name} = zeros({rows}, {columns});"]
    for section in code.sections:
        # Of a vector the zeros are there already.
        entries = [
            entry for entry in section.entries[quantity.name] if code.number(entry.node) != 0
        ]
        lines += [f"% {title(section, first=1)}"] if entries else []
        for entry in entries:
            column = f", {entry.column + 1}" if quantity.is_matrix else ""
            where = place(quantity.name, entry, code)
            left = f"{quantity.name}({entry.row + 1}{column})"
            assigned = _assigned(left, printer.text(entry.node))
            assigned[-1] += f"  % {where}" if where else ""
            lines += assigned
    return lines if lines[0] else lines[1:]


def _assigned(left: str, text: str) -> list[str]:
    """Return an assignment, a long one continued with indentation."""
    first, *rest = broken(text)
    lines = [f"{left} = {first}", *(f"    {line}" for line in rest)]
    return [*(f"{line} ..." for line in lines[:-1]), f"{lines[-1]};"]


def _spline(name: str, spline: SplineTable) -> str:
    """Return the file of a table."""
    pieces = (", ".join(map(repr, row)) for row in spline.coefficients)
    data = {
        "name": name,
        "breaks": "\n".join(f"        {x!r}" for x in spline.breaks),
        "pieces": "\n".join(f"        {row}" for row in pieces),
    }
    return fill("octave/spline.m.jinja", data)


def _script(code: InlineProgram) -> str:
    """Return the script that solves the motion."""
    program = code.program
    try:
        end, points = float(program.end), int(program.points)
    except (TypeError, ValueError):
        end, points = math.nan, 0
    if not math.isfinite(end) or points < 1:
        raise InputError(
            f"end = {program.end!r}, points = {program.points!r}: give a finite time, and at least "
            "one point"
        )
    data = {
        "name": program.name,
        "header": _header(code),
        "n": len(program.coordinates),
        "end": repr(end),
        "points": points,
        "defaults": _column(((item.name, item.default) for item in program.parameters), 1),
        "guess": _column(((item.name, item.guess) for item in program.coordinates), 1),
    }
    return fill("octave/script.m.jinja", data)
