"""The Rust target: one file, a module with the quantities of a mechanism, and its motion."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from kincompile import criteria, quantities
from kincompile.emitters.lines import indented, quoted, wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.planned_solve import schedule_solve
from kincompile.emitters.printer import ELEMENTARY
from kincompile.emitters.rust.dialect import RUST
from kincompile.emitters.rust.functions import (
    WRITE,
    kernel,
    kernels,
    single,
    solve_functions,
    vectors,
)
from kincompile.emitters.rust.march import RustSolver
from kincompile.emitters.templates import fill
from kincompile.solver.reader import solver, start
from kincompile.solver.vocabulary import (
    CONSTANTS,
    COUNTS,
    CRITERIA,
    START_COUNTS,
    START_CRITERIA,
    STATUSES,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from kincompile.emitters.evaluators import Listing
    from kincompile.emitters.printer import Printer
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

evaluators = kernels
"""The functions of a point."""


def function(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the lines of a function of a point."""
    return kernel(name, code, listing, printer)


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
        "tables": indented(_tables(program), 0),
        "fields": indented(fields),
        "values": indented(values, 3),
        "march": "" if listing is None else fill("rust/march.rs.jinja", _march(program)),
    }
    return {f"{module}.rs": fill("rust/module.rs.jinja", data)}


def _constants(code: InlineProgram) -> list[str]:
    """Return the constant arrays of the module."""
    program = code.program
    lists = {
        "COORDINATES": ("&str", quoted(x.name for x in program.coordinates)),
        "EQUATIONS": ("&str", quoted(program.equations)),
        "PARAMETERS": ("&str", quoted(x.name for x in program.parameters)),
        "OUTPUTS": ("&str", quoted(x.name for x in program.outputs)),
        "DEFAULTS": ("f64", wrapped(repr(x.default) for x in program.parameters)),
        "GUESS": ("f64", wrapped(repr(x.guess) for x in program.coordinates)),
    }
    sizes = [program.coordinates, program.equations, program.parameters, program.outputs]
    counts = [*map(len, sizes), len(program.parameters), len(program.coordinates)]
    lines = []
    for (name, (kind, rows)), size in zip(lists.items(), counts, strict=True):
        lines += _array(name, kind, size, rows)
    for quantity in program.quantities:
        if quantity.is_matrix:
            places = code.pattern(quantity.name)
            rows = wrapped(f"[{i}, {j}]" for i, j in places)
            name = "PATTERN" if quantity.name == "Phi_q" else f"PATTERN_{quantity.name}"
            lines += _array(name, "[usize; 2]", len(places), rows)
    return lines


def _array(name: str, kind: str, size: int, rows: Iterable[str]) -> list[str]:
    return [f"pub const {name}: [{kind}; {size}] = [", *(f"    {x}" for x in rows), "];"]


def _truths(values: Iterable[bool]) -> Iterable[str]:
    return wrapped(str(x).lower() for x in values)


def _tables(program: Program) -> list[str]:
    """Return the tables of splines."""
    lines = []
    for name, spline in program.tables.items():
        lines += [f"static {name}: Spline = Spline {{", "    breaks: &["]
        lines += [f"        {line}" for line in wrapped(repr(x) for x in spline.breaks)]
        lines += ["    ],", "    pieces: &["]
        lines += [f"        &[{', '.join(map(repr, row))}]," for row in spline.coefficients]
        lines += ["    ],", "};"]
    return lines


@cache
def _solver() -> str:
    """Return the printed start and march, which are the same for every mechanism."""
    return RustSolver(start()).text() + "\n" + RustSolver(solver()).text()


def _march(program: Program) -> dict[str, Any]:
    """Return the solver, and what it judges by."""
    units = [item.unit for item in program.coordinates]
    columns = [body.columns for body in program.bodies]
    n, m = len(program.coordinates), len(program.equations)
    probe = criteria.probe_of(max(n, m)).tolist()
    tables = _array("ANGULAR", "bool", n, _truths(criteria.turning(units, columns)))
    repeats = (x in program.redundant for x in program.equations)
    tables += _array("IS_REDUNDANT", "bool", m, _truths(repeats))
    tables += _array("PROBE", "f64", len(probe), wrapped(map(repr, probe)))
    tables += _array("MAY_TURN", "bool", n, _truths(criteria.may_turn(units, columns)))
    tables += _array("COVER", "usize", n, wrapped(map(str, criteria.first_of_cover(n, columns))))
    numbers = [f"const {x}: f64 = {getattr(criteria, x)!r};" for x in (*CRITERIA, *START_CRITERIA)]
    numbers += [f"const {x}: usize = {getattr(criteria, x)};" for x in (*COUNTS, *START_COUNTS)]
    numbers += [f"pub const {x}: usize = {number};" for x, number in STATUSES.items()]
    return {
        "tables": indented(tables, 0).replace("pub const", "const"),
        "numbers": indented(numbers, 0),
        "solver": _solver(),
    }
