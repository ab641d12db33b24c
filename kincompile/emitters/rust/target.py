"""The Rust target: one file, a module with the quantities of a mechanism, and its motion."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from kincompile import quantities
from kincompile.emitters.constants import items, named_lists, splines
from kincompile.emitters.lines import indented, wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.planned_solve import schedule_solve
from kincompile.emitters.printer import ELEMENTARY
from kincompile.emitters.rust.functions import (
    RUST,
    WRITE,
    kernel,
    single,
    solve_functions,
    vectors,
)
from kincompile.emitters.rust.march import BASES, RustSolver
from kincompile.emitters.solver_tables import NUMBERS, solver_tables
from kincompile.report.templates import fill
from kincompile.solver.reader import solver, start
from kincompile.solver.vocabulary import CONSTANTS, STATUSES

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program

DIALECT = RUST

KEYWORDS = (
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "Self", "self", "static", "struct", "super", "trait", "true", "try", "type",
    "typeof", "union", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
)  # fmt: skip
"""Words of the language, and words that it keeps for later."""

CRATES = ("main", "lib", "std", "core", "alloc")
"""Files of a program, and what every crate has: no names of a module beside them."""

OWN = (
    "NAME", "FINGERPRINT", "FACTORS", "COORDINATES", "EQUATIONS", "PARAMETERS", "OUTPUTS",
    "N_COORDINATES", "N_EQUATIONS", "N_PARAMETERS", "DEFAULTS", "GUESS", *CONSTANTS,
    *(f"PATTERN_{x.name}" for x in quantities.QUANTITIES if x.is_matrix),
)  # fmt: skip
"""Constants of the module, which no variable may be called."""

RESERVED: tuple[str, ...] = (
    *KEYWORDS, *OWN, *ELEMENTARY, *quantities.singles(quantities.QUANTITIES), "_", "f64", "usize",
    "bool", "str", "std", "core", "None", "Some", "Ok", "Err", "q", "q_dot", "q_ddot", "t", "p",
    "at", "F", "right", "to", "determinants", "square", "spline", "block_solve",
    "block_determinant", "matrix", "Point",
)  # fmt: skip
"""Names that the functions use."""

evaluators = quantities.kernels_apart
"""The functions of a point."""

function = kernel
"""One of them."""


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the .rs file."""
    program, listing = code.program, schedule_solve(code, RESERVED)
    module = NameTable((*KEYWORDS, *CRATES)).take(program.name)
    lines = [line for own in functions.values() for line in own]
    for quantity in program.quantities:
        lines += single(quantity, code)
    lines += [] if listing is None else solve_functions(code, listing)
    text = indented(lines, 0)
    fields, values = vectors(code)
    data = WRITE.facts(code, listing, text) | {
        "module": module,
        "header": WRITE.heading(code).replace("// ", "//! ").replace("//\n", "//!\n"),
        "constants": indented(_constants(code), 0),
        "splines": splines_of(program),
        "fields": indented(fields),
        "values": indented(values, 3),
        "march": "" if listing is None else fill("rust/march.rs.jinja", _march(program)),
    }
    return {f"{module}.rs": fill("rust/module.rs.jinja", data)}


def splines_of(program: Program) -> str:
    """Return the tables of splines with what evaluates them; none where there are none."""
    if not program.tables:
        return ""
    tables = indented(splines(program, "static {}: Spline = Spline {{", "&["), 0)
    return fill("rust/spline.rs.jinja", {"tables": tables}).rstrip()


def _constants(code: InlineProgram) -> list[str]:
    """Return the constant arrays of the module."""
    lines = []
    for name, own in named_lists(code.program).items():
        lines += _array(name, "f64" if name in ("DEFAULTS", "GUESS") else "&str", own)
    for quantity in code.program.quantities:
        if quantity.is_matrix:
            places = [f"[{i}, {j}]" for i, j in code.pattern(quantity.name)]
            lines += _array(quantities.pattern_of(quantity), "[usize; 2]", places)
    return lines


def _array(name: str, kind: str, own: Sequence[str]) -> list[str]:
    head = f"pub const {name}: [{kind}; {len(own)}] = ["
    return [head, *(f"    {x}" for x in wrapped(own)), "];"]


@cache
def _solver() -> str:
    """Return the printed start and march, which are the same for every mechanism."""
    return RustSolver(start()).text() + "\n" + RustSolver(solver()).text()


def _march(program: Program) -> dict[str, Any]:
    """Return the solver, and what it judges by."""
    tables, numbers = [], []
    for name, values in solver_tables(program).items():
        tables += _array(name, BASES[CONSTANTS[name].base], items(values))
    for name, value in NUMBERS.items():
        numbers.append(f"const {name}: {BASES[CONSTANTS[name].base]} = {value!r};")
    numbers += [f"pub const {x}: usize = {number};" for x, number in STATUSES.items()]
    return {
        "tables": indented(tables, 0).replace("pub const", "const"),
        "numbers": indented(numbers, 0),
        "solver": _solver(),
    }
