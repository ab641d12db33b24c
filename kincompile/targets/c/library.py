"""The C target: one .c and one .h file that need a C99 compiler and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile import criteria
from kincompile.ir.elimination import LARGEST_CLOSED_FORM, plan_solve
from kincompile.names import rate
from kincompile.targets.c.functions import evaluator, solve_functions
from kincompile.targets.functions import EVALUATORS, schedule
from kincompile.targets.headings import header
from kincompile.targets.layout import wrapped
from kincompile.targets.naming import NameTable
from kincompile.targets.printers import C_FUNCTIONS
from kincompile.targets.solving import schedule_solve
from kincompile.targets.target import Emitted
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.targets.solving import SolveListing

LANES = 32
"""Points in a block: enough for the widest registers, few enough for the nearest cache."""

CRITERIA = (
    "KINK", "MAX_CORRECTIONS", "MAX_SUBSTEPS", "NEARLY_SINGULAR", "NO_SIZE", "RESIDUAL_FACTOR",
    "ROUNDING", "SMALL_ERROR", "SMALLEST_PART", "SMOOTH", "TOO_NEAR",
)  # fmt: skip
"""The numbers of `criteria` that the march judges by."""

KEYWORDS = (
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else",
    "enum", "extern", "float", "for", "goto", "if", "inline", "int", "long", "register",
    "restrict", "return", "short", "signed", "sizeof", "static", "struct", "switch", "typedef",
    "union", "unsigned", "void", "volatile", "while", "asm", "typeof", "bool",
    "true", "false", "nullptr", "constexpr", "alignas", "alignof", "static_assert", "thread_local",
    "linux", "unix", "NULL", "NAN", "INFINITY", "HUGE_VAL", "M_E", "M_PI",
)  # fmt: skip
"""Words of C and of later standards, and macros of headers and compilers."""

RESERVED = (
    *KEYWORDS, "at", "lane", "t", "far", "exact", "F", "right", "to", "PI", "LANES",
    "square", "cos_sin", "cosine", "sine", "spline", "block_solve", "block_determinant",
    *C_FUNCTIONS,
)  # fmt: skip
"""Names that the functions of a mechanism use."""


def emit_c(code: InlineProgram) -> Emitted:
    """Return a program as C99 source and header.

    Raises
    ------
    UnsupportedError
        If the program calls a function that C does not have.
    """
    program = code.program
    plan = plan_solve(code)
    listing = None
    if plan is not None:
        listing = schedule_solve(code, plan, NameTable(RESERVED))
    about = _about(code, listing)
    body = [_block(code, listing), fill("c/batch.c.jinja", _only(about, "name", "is_planned"))]
    if listing is not None:
        body.append(fill("c/march.c.jinja", {**_only(about, "name", "NAME"), **_scales(program)}))
    data = {**_without(about, "NAME"), **_tables(code, listing), "body": "".join(body)}
    source = fill("c/module.c.jinja", data)
    guard = f"{program.name.upper()}_H"
    head = fill("c/module.h.jinja", {**about, "guard": guard})
    return Emitted(program.name, {f"{program.name}.c": source, f"{program.name}.h": head})


def _about(code: InlineProgram, listing: SolveListing | None) -> dict[str, Any]:
    """Return what source and header both say."""
    program = code.program
    return {
        "name": program.name,
        "NAME": program.name.upper(),
        "header": "\n".join(f"// {line}".rstrip() for line in header(code)),
        "n": len(program.coordinates),
        "m": len(program.equations),
        "k": len(program.parameters),
        "nonzeros": len(code.pattern()),
        "is_planned": listing is not None,
    }


def _only(data: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: data[key] for key in keys}


def _without(data: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in data.items() if key not in keys}


def _tables(code: InlineProgram, listing: SolveListing | None) -> dict[str, Any]:
    """Return the constants of the source file: names, numbers and the pattern of Phi_q."""
    program = code.program
    values = [
        code.number(entry.node) for section in code.sections for entry in section.entries["Phi_q"]
    ]
    constants = [
        f"{{{k}, {float(value)!r}}}" for k, value in enumerate(values) if value is not None
    ]
    varying = [str(k) for k, value in enumerate(values) if value is None]
    nu, gamma = _computed_rows(code, "nu"), _computed_rows(code, "gamma")
    return {
        "nu": _array_lines(nu),
        "n_nu": len(nu),
        "gamma": _array_lines(gamma),
        "n_gamma": len(gamma),
        "lanes": LANES,
        "n_factors": 0 if listing is None else len(listing.factors),
        "n_blocks": 0 if listing is None else len(listing.plan.determinants),
        "fingerprint": program.fingerprint,
        "defaults": _array_lines([repr(item.default) for item in program.parameters]),
        "guess": _array_lines([repr(item.guess) for item in program.coordinates]),
        "pattern": _array_lines([f"{{{row}, {column}}}" for row, column in code.pattern()]),
        "constants": _array_lines(constants, "{0, 0.0}"),
        "n_constants": len(constants),
        "varying": _array_lines(varying),
        "n_varying": len(varying),
    }


def _computed_rows(code: InlineProgram, quantity: str) -> list[str]:
    """Return the rows of a vector that are not plain numbers."""
    entries = [entry for section in code.sections for entry in section.entries[quantity]]
    return [str(entry.row) for entry in entries if code.number(entry.node) is None]


def _array_lines(items: Sequence[str], placeholder: str = "0") -> str:
    """Return the lines of an array; C has no empty ones."""
    return "\n".join(f"    {line}" for line in wrapped(items or [placeholder]))


def _block(code: InlineProgram, listing: SolveListing | None) -> str:
    """Return the functions that work on a block of points, and what they need."""
    program = code.program
    table = NameTable((*RESERVED, *program.tables))
    wanted = [item.name for item in program.coordinates]
    wanted += [rate(name) for name in wanted] + [item.name for item in program.parameters]
    names = {"t": "t", **{name: table.take(name) for name in wanted}}
    lines: list[str] = []
    called: set[str] = set()
    for name, quantities in EVALUATORS.items():
        scheduled = schedule(code, quantities, names, table)
        called |= set(scheduled.functions)
        lines += ["", *evaluator(name, code, scheduled, names)]
    largest = 0
    if listing is not None:
        lines += ["", *solve_functions(code, listing)]
        largest = max((len(block.rows) for block in listing.plan.blocks), default=0)
    data = {
        "is_planned": listing is not None,
        "elementary": _elementary(program, called, largest),
        "functions": "\n".join(lines),
    }
    return fill("c/block.c.jinja", data)


def _elementary(program: Program, called: Collection[str], largest: int) -> str:
    """Return what the code calls: functions of angles, splines, the solve of blocks of a size."""
    data = {
        "has_cosine": "cos" in called,
        "has_sine": "sin" in called,
        "tables": "\n\n".join(_splines(program)),
        "order": max(
            (len(row) for item in program.tables.values() for row in item.coefficients), default=0
        ),
        "largest_block": largest if largest > LARGEST_CLOSED_FORM else 0,
    }
    return fill("c/elementary.c.jinja", data)


def _splines(program: Program) -> Iterable[str]:
    """Return the tables of splines."""
    for name, spline in program.tables.items():
        rows = [f"{{{', '.join(repr(x) for x in row)}}}" for row in spline.coefficients]
        lines = [f"static const double {name}_breaks[] = {{"]
        lines += [f"    {line}" for line in wrapped([repr(x) for x in spline.breaks])]
        lines += ["};", f"static const double {name}_pieces[][{len(spline.coefficients[0])}] = {{"]
        lines += [f"    {row}," for row in rows]
        lines += ["};", f"static const spline_table {name} = {{"]
        lines += [f"    {len(rows)}, {name}_breaks, {name}_pieces,", "};"]
        yield "\n".join(lines)


def _scales(program: Program) -> dict[str, str]:
    """Return what tells large from small in a march: kinds of coordinates, and the criteria."""
    angular = [str(int(item.unit == "rad")) for item in program.coordinates]
    probe = [repr(value) for value in criteria.probe_of(len(angular)).tolist()]
    numbers = {name: repr(getattr(criteria, name)) for name in CRITERIA}
    return {"angular": _array_lines(angular), "probe": _array_lines(probe), **numbers}
