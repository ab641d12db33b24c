"""The Octave target, which is MATLAB too: functions of Phi, Phi_q, nu, gamma, and of the motion.

This is the shape in which courses write them: column vectors, rows that count from 1, and a
function that solves position, velocity and acceleration over time with Newton's method. No toolbox.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from kincompile import criteria, quantities
from kincompile.emitters.constants import items
from kincompile.emitters.lines import indented, pieces, wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.octave.march import PLACES, OctaveSolver
from kincompile.emitters.planned_solve import schedule_determinants
from kincompile.emitters.printer import ATOM, ELEMENTARY, POWER, Dialect, Printer
from kincompile.emitters.solve_statements import factorization
from kincompile.emitters.solver_tables import NUMBERS, solver_tables
from kincompile.emitters.statements import Statements
from kincompile.errors import InputError, UnsupportedError
from kincompile.ir.elimination import plan_solve, sizes_of
from kincompile.report.templates import fill
from kincompile.solver.reader import start
from kincompile.solver.vocabulary import STATUSES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.planned_solve import BlockCall
    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.model.spline import SplineTable

# Complex for some real numbers, where the other targets have NaN.
PARTIAL = ("asin", "acos", "acosh", "atanh", "log", "sqrt", "pow")

NAMES = {name: name for name in ELEMENTARY} | {"pow": "power"}
"""Octave's names of the elementary functions."""

DIALECT = Dialect(
    "Octave",
    {name: f"{own}({{}})" for name, own in NAMES.items()}
    | {name: f"in_reals({NAMES[name]}({{}}))" for name in PARTIAL},
    square=("{}^2", (ATOM,), POWER),
    select="either({}, {}, {})",
    table="{mechanism}_{}({}, {})",
    signs={"&": "&&", "|": "||", "!=": "~="},
)
"""How Octave and MATLAB write expressions; `either` and `in_reals` are the template's."""

WRITE = Statements("%", "{}", "{}({})", "{}({}, {})", "[c, -s; s, c]", first=1, continued=" ...")

LONGEST_NAME = 63
"""Longest name; MATLAB truncates longer ones."""

KEYWORDS = (
    "break", "case", "catch", "classdef", "continue", "do", "else", "elseif", "end", "endif",
    "endfor", "endfunction", "endwhile", "endswitch", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "until", "while",
    "unwind_protect", "unwind_protect_cleanup",
)  # fmt: skip
"""Words of MATLAB and of Octave."""

CALLED = (
    *NAMES.values(), "abs", "accumarray", "all", "any", "det", "diag", "double", "either", "error",
    "eye", "false", "find", "floor", "in_reals", "Inf", "isempty", "isfinite", "isnan", "isreal",
    "linspace", "max", "min", "mod", "NaN", "nargin", "norm", "numel", "ode45", "odeset", "ones",
    "pi", "pinv", "polyval", "qr", "single", "size", "sqrt", "sum", "svd", "true", "zeros",
)  # fmt: skip
"""Functions that the files call; one of such a name would be called in their place."""

CONSTANTS = ("ans", "e", "i", "I", "j", "J", "NA")
"""And others that a user may write beside them."""

GIVEN = ("LAMBDA", "Q", "Q_ddot", "Q_dot", "T", "drift", "names", "p", "q")
"""What the function of the motion takes and gives."""

RESERVED: tuple[str, ...] = (
    *KEYWORDS, *CALLED, *quantities.singles(quantities.QUANTITIES), "q", "q_dot", "q_ddot", "t",
    "p",
)  # fmt: skip
"""Names that the functions use."""


evaluators = quantities.singles
"""The functions: one a quantity."""


def function(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the lines of a function; refuse names longer than MATLAB reads."""
    require_short(listing.names.values())
    rows, columns = (*code.program.shape_of(quantities.quantity_named(name)), 1)[:2]
    lines = WRITE.inputs(code.program, listing)
    values = WRITE.frames(listing, printer) + WRITE.steps(listing, printer)
    zeros = f"{name} = zeros({rows}, {columns});"
    results = WRITE.results(name, code, printer)
    return [*lines, *values, *([""] if values else []), zeros, *results]


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the .m files, the motion first; refuse names longer than MATLAB reads."""
    program = code.program
    name = NameTable((*KEYWORDS, *CALLED, *CONSTANTS, *GIVEN)).take(program.name)
    found = {name: _motion(code, name)}
    if not program.unsolvable and not program.motion:
        found[f"{program.name}_assemble"] = _assembly(code)
    for name, lines in functions.items():
        found[f"{program.name}_{name}"] = _function_file(name, code, "\n".join(lines))
    found |= splines_of(program)
    require_short(found)
    return {f"{name}.m": text for name, text in found.items()}


def require_short(names: Iterable[str]) -> None:
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
        "functions": called_in(body),
    }
    return fill("octave/function.m.jinja", data).rstrip("\n") + "\n"


def called_in(body: str) -> str:
    """Return the functions of the templates that a body calls."""
    own = ("either", "in_reals")
    return "".join(fill(f"octave/{name}.m.jinja", {}) for name in own if f"{name}(" in body)


def _column(items: Iterable[tuple[str, float | None]], level: int) -> str:
    """Return named numbers as the lines of a column vector."""
    return "\n".join(f"{'    ' * level}{value!r}  % {name}" for name, value in items)


def splines_of(program: Program) -> dict[str, str]:
    """Return the functions of tables by name."""
    names = {f"{program.name}_{name}": spline for name, spline in program.tables.items()}
    return {name: _spline(name, spline) for name, spline in names.items()}


def _spline(name: str, spline: SplineTable) -> str:
    """Return the function of a table."""
    pieces = (", ".join(map(repr, row)) for row in spline.coefficients)
    data = {
        "name": name,
        "breaks": "\n".join(f"        {x!r}" for x in spline.breaks),
        "pieces": "\n".join(f"        {row}" for row in pieces),
    }
    return fill("octave/spline.m.jinja", data)


def _literal(text: str) -> str:
    """Return a string with the sign of continuation after it."""
    return "'" + text.replace("'", "''") + "' ..."


def _determinants(code: InlineProgram) -> tuple[list[str], int]:
    """Return the statements that take Phi_q to the determinants that tell branches apart.

    And how many these are.
    """
    plan = None if code.program.redundant else plan_solve(code)
    if plan is None:
        return [], 0  # nothing but the independent rows has a determinant
    table = NameTable((*RESERVED, "determinants"))
    # Names of bodies and constraints could be too long for MATLAB.
    names = {node: table.take(f"a_{row + 1}_{column + 1}") for row, column, node in plan.entries}
    listing = schedule_determinants(plan, names, table)
    printer = Printer(DIALECT, plan.nodes, names, code.program.name)
    lines = factorization(WRITE, code, listing, printer, _block_call)
    return lines, len(plan.determinants)


def _block_call(step: BlockCall, printer: Printer) -> list[str]:
    """Return the statement that takes the determinant of a large block."""
    rows = [step.matrix[k : k + step.size] for k in range(0, len(step.matrix), step.size)]
    lines = [", ".join(map(printer.text, row)) for row in rows]
    return [f"{step.names[0]} = det([", *(f"    {line}" for line in lines), "]);"]


def _motion(code: InlineProgram, function: str) -> str:
    """Return the function that solves the motion, or with equations of motion integrates it."""
    program, names = code.program, code.program.names_of("coordinates")
    data: dict[str, object] = {
        "name": program.name,
        "function": function,
        "header": WRITE.header(code),
        "n": len(names),
        "first": names[0],
        "given": _given(code).rstrip("\n"),
    }
    if program.motion:
        numbers = ("ASSEMBLED", "RANK", "ROUNDING", "TOLERANCE")
        data |= {"m": len(program.equations), **_criteria(numbers)}
        return fill("octave/dynamics.m.jinja", data)
    data |= _criteria((
        "MAX_ITERATIONS", "RESIDUAL_FACTOR", "ROUNDING", "SINGULAR_SENSITIVITY", "STEEP",
        "TOLERANCE",
    ))  # fmt: skip
    data |= {
        "unsolvable": indented(_literal(piece) for piece in pieces(program.unsolvable)),
        "has_redundant": bool(program.redundant),
        "part": repr(criteria.AGREEMENT if program.redundant else criteria.SOLVED),
    }
    return fill("octave/motion.m.jinja", data)


def _given(code: InlineProgram) -> str:
    """Return the statements that take what a caller leaves out from the model."""
    program, names = code.program, code.program.names_of("coordinates")
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
        "end": repr(end),
        "points": points,
        "defaults": _column(((item.name, item.default) for item in program.parameters), 2),
        "guess": _column(((item.name, item.guess) for item in program.coordinates), 2),
        "names": "\n".join(_rows(f"'{name}'" for name in names)),
        "scale": _column(zip(names, sizes_of(code).scales.values(), strict=True), 1),
    }
    return fill("octave/given.m.jinja", data)


def _criteria(names: Iterable[str]) -> dict[str, str]:
    """Return numbers by which is judged, by name."""
    return {name: repr(getattr(criteria, name)) for name in names}


def _assembly(code: InlineProgram) -> str:
    """Return the function that finds the position at the first time, by the printed start."""
    program, (determinants, blocks) = code.program, _determinants(code)
    n, m = len(program.coordinates), len(program.equations)
    sizes = {
        "N": n, "M": m, "NONZEROS": len(code.pattern()), "BLOCKS": blocks,
        "TALL": m + n, "WIDE": n + 1,
    }  # fmt: skip
    data = {
        "name": program.name,
        "fingerprint": program.fingerprint,
        "n": n,
        "m": m,
        "tables": "\n".join(_tables(code)),
        "blocks": blocks,
        "determinants": "\n".join(determinants),
        "functions": called_in("\n".join(determinants)),
        "solver": OctaveSolver(start(), {**sizes, **STATUSES, **NUMBERS}).text(),
        "CONVERGED": STATUSES["CONVERGED"],
        **_criteria(("CONSTANT", "MAX_ITERATIONS", "SMALL_PART", "TOLERANCE")),
    }
    return fill("octave/assemble.m.jinja", data).rstrip("\n") + "\n"


def _tables(code: InlineProgram) -> Iterable[str]:
    """Yield the lines that give the start its tables, as columns; places count from 1."""
    pattern = [f"{row + 1} {column + 1}" for row, column in code.pattern()]
    for name, values in solver_tables(code.program).items():
        first = name in PLACES
        yield from _table(name, items(x + first if first else x for x in values))
    yield from _table("PATTERN", pattern)


def _table(name: str, rows: Iterable[str]) -> Iterable[str]:
    """Yield the lines of a table with rows."""
    yield f"s.{name} = ["
    yield from _rows(rows)
    yield "];"


def _rows(items: Iterable[str]) -> Iterable[str]:
    """Return the lines of a column, between its brackets."""
    return (f"    {line.replace(',', ';')}" for line in wrapped(items))
