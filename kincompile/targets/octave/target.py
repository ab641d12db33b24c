"""The Octave target, which is MATLAB too: functions of Phi, Phi_q, nu, gamma, and a script.

This is the shape in which courses write them: column vectors, rows that count from 1, and a script
that solves position, velocity and acceleration over time with Newton's method. No toolbox.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from kincompile import criteria, quantities
from kincompile.errors import InputError, UnsupportedError
from kincompile.ir.elimination import jacobian_entries
from kincompile.structure.blocks import parts_of
from kincompile.targets.lines import indented, pieces
from kincompile.targets.naming import NameTable
from kincompile.targets.octave.dialect import NAMES, OCTAVE
from kincompile.targets.statements import Statements
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.model.spline import SplineTable
    from kincompile.targets.evaluators import Listing
    from kincompile.targets.printer import Printer

DIALECT = OCTAVE

WRITE = Statements("%", "{}", "{}({})", "{}({}, {})", "[c, -s; s, c]", first=1, continued=" ...")

LONGEST_NAME = 63
"""Longest name; MATLAB truncates longer ones."""

CRITERIA = (
    "ASTRAY", "AS_NEAR", "BEND", "CONSTANT", "FAR", "FOLDED", "LARGEST_ANGLE", "MAX_CORRECTIONS",
    "MAX_ITERATIONS", "MIRRORED", "MIRROR_STEP", "MOST_MIRRORED", "MOST_TURNED", "NEAR_ANGLE",
    "NEAR_PART", "NUDGE", "RESIDUAL_FACTOR", "RESTARTS", "ROUNDING", "SAME_POSITION", "SETTLED",
    "SHORTEST_STEP", "SMALL_PART", "STEEP", "SUFFICIENT", "TOLERANCE", "WILD",
)  # fmt: skip
"""The numbers of `criteria` that a start is judged by."""

KEYWORDS = (
    "break", "case", "catch", "classdef", "continue", "do", "else", "elseif", "end", "endif",
    "endfor", "endfunction", "endwhile", "endswitch", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "until", "while",
    "unwind_protect", "unwind_protect_cleanup",
)  # fmt: skip
"""Words of MATLAB and of Octave."""

CALLED = (
    *NAMES.values(), "abs", "all", "any", "circshift", "deal", "det", "diag", "double", "either",
    "eps", "error", "eye", "false", "find", "in_reals", "Inf", "isempty", "isfinite", "isnan",
    "isreal", "linspace", "max", "min", "mod", "NaN", "nargin", "norm", "num2cell", "numel",
    "ode45", "odeset", "pi", "pinv", "polyval", "rcond", "round", "sign", "single", "size",
    "sortrows", "sqrt", "sum", "svd", "true", "zeros",
)  # fmt: skip
"""Functions that the files call; a script of such a name would be called in their place."""

RESERVED: tuple[str, ...] = (
    *KEYWORDS, *CALLED, *quantities.singles(quantities.QUANTITIES), "q", "q_dot", "q_ddot", "t",
    "p",
)  # fmt: skip
"""Names that the functions use."""


evaluators = quantities.singles
"""The functions: one a quantity."""


def function(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the lines of a function; refuse names longer than MATLAB reads."""
    _require_short(listing.names.values())
    rows, columns = (*code.program.shape_of(quantities.quantity_named(name)), 1)[:2]
    lines = WRITE.inputs(code.program, listing)
    values = WRITE.frames(listing, printer) + WRITE.steps(listing, printer)
    zeros = f"{name} = zeros({rows}, {columns});"
    results = WRITE.results(name, code, printer)
    return [*lines, *values, *([""] if values else []), zeros, *results]


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the .m files, the script first; refuse names longer than MATLAB reads."""
    program = code.program
    found = {NameTable((*KEYWORDS, *CALLED)).take(program.name): _script(code)}
    if not program.unsolvable and not program.motion:
        found[f"{program.name}_assemble"] = _assembly(code)
    for name, lines in functions.items():
        found[f"{program.name}_{name}"] = _function_file(name, code, "\n".join(lines))
    for name, spline in program.tables.items():
        found[f"{program.name}_{name}"] = _spline(f"{program.name}_{name}", spline)
    _require_short(found)
    return {f"{name}.m": text for name, text in found.items()}


def _require_short(names: Iterable[str]) -> None:
    """Refuse a name that MATLAB would take for another."""
    long = [name for name in names if len(name) > LONGEST_NAME]
    if long:
        raise UnsupportedError(
            f"MATLAB reads {LONGEST_NAME} characters of a name, and {long[0]!r} has {len(long[0])};"
            " give shorter names to the mechanism, its bodies and its constraints"
        )


def _function_file(name: str, code: InlineProgram, body: str) -> str:
    """Return the file of one function."""
    program = code.program
    quantity = quantities.quantity_named(name)
    shape = "" if quantity.is_matrix else ", a column"
    data = {
        "quantity": name,
        "name": program.name,
        "arguments": ", ".join(quantity.reads),
        "n_arguments": len(quantity.reads),
        "about": f"{quantity.about[:-1]}{shape}.",
        "header": WRITE.header(code),
        "fingerprint": program.fingerprint,
        "defaults": _column(((item.name, item.default) for item in program.parameters), 2),
        "body": body,
        "functions": "".join(
            fill(f"octave/{own}.m.jinja", {}) for own in ("either", "in_reals") if f"{own}(" in body
        ),
    }
    return fill("octave/function.m.jinja", data).rstrip("\n") + "\n"


def _column(items: Iterable[tuple[str, float | None]], level: int) -> str:
    """Return named numbers as the lines of a column vector."""
    return "\n".join(f"{'    ' * level}{value!r}  % {name}" for name, value in items)


def _spline(name: str, spline: SplineTable) -> str:
    """Return the file of a table."""
    pieces = (", ".join(map(repr, row)) for row in spline.coefficients)
    data = {
        "name": name,
        "breaks": "\n".join(f"        {x!r}" for x in spline.breaks),
        "pieces": "\n".join(f"        {row}" for row in pieces),
    }
    return fill("octave/spline.m.jinja", data)


def _literal(text: str) -> str:
    """Return a string and the sign that the next line goes on with it."""
    return "'" + text.replace("'", "''") + "' ..."


def _numbers(places: Iterable[int]) -> str:
    """Return numbers of rows or columns, which count from 1."""
    return f"[{', '.join(str(k + 1) for k in places)}]"


def _turning(program: Program) -> list[int]:
    """Return the coordinates that may turn: angles, and free ones whose unit is not known."""
    owned = {column for body in program.bodies for column in body.columns}
    units = [item.unit for item in program.coordinates]
    return [k for k, unit in enumerate(units) if unit == "rad" or not (unit or k in owned)]


def _independent(program: Program) -> list[int]:
    """Return the rows that determine the motion: all but those that repeat others."""
    return [k for k, name in enumerate(program.equations) if name not in program.redundant]


def _blocks(code: InlineProgram) -> list[str]:
    """Return rows and columns of the blocks whose determinant may change its sign."""
    rows = {row: k for k, row in enumerate(_independent(code.program))}
    entries = [(rows[i], j, number) for i, j, number in jacobian_entries(code) if i in rows]
    constant = {(row, column) for row, column, number in entries if number is not None}
    size = len(rows), len(code.program.coordinates)
    blocks = parts_of([entry[:2] for entry in entries], size).blocks
    return [
        f"{_numbers(block.rows)}, {_numbers(block.columns)};"
        for block in blocks
        if (block.rows[0], block.columns[0]) not in constant or len(block.rows) > 1
    ]


def _script(code: InlineProgram) -> str:
    """Return the script that solves the motion, or with equations of motion integrates it."""
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
    data: dict[str, object] = {
        "name": program.name,
        "header": WRITE.header(code),
        "n": len(program.coordinates),
        "end": repr(end),
        "points": points,
        "defaults": _column(((item.name, item.default) for item in program.parameters), 1),
        "guess": _column(((item.name, item.guess) for item in program.coordinates), 1),
    }
    if program.motion:
        return fill("octave/motion.m.jinja", {**data, "m": len(program.equations)})
    data |= {
        "unsolvable": indented(_literal(piece) for piece in pieces(program.unsolvable)),
        "has_redundant": bool(program.redundant),
        "AGREEMENT": repr(criteria.AGREEMENT),
    }
    return fill("octave/script.m.jinja", data)


def _assembly(code: InlineProgram) -> str:
    """Return the function that finds the position at the first time."""
    program = code.program
    units = (item.unit for item in program.coordinates)
    columns = (body.columns for body in program.bodies)
    angles = [k for k, turns in enumerate(criteria.turning(units, columns)) if turns]
    data = {
        "name": program.name,
        "fingerprint": program.fingerprint,
        "n": len(program.coordinates),
        "angles": _numbers(angles),
        "may_turn": _numbers(_turning(program)),
        "independent": _numbers(_independent(program)) if program.redundant else "",
        "blocks": "\n".join(f"    {line}" for line in _blocks(code)),
        **{name: repr(getattr(criteria, name)) for name in CRITERIA},
    }
    return fill("octave/assemble.m.jinja", data)
