"""The JavaScript target: one file with the quantities of a mechanism, and its motion.

It runs as a classic script in a page, which needs no server and no network, and under node.
"""

from __future__ import annotations

import json
import re
from functools import cache
from typing import TYPE_CHECKING

from kincompile import criteria, quantities
from kincompile.emitters.constants import items, named_lists, splines
from kincompile.emitters.javascript.functions import (
    JAVASCRIPT,
    WRITE,
    kernel,
    single,
    solve_functions,
    vectors,
)
from kincompile.emitters.javascript.march import JavaScriptSolver
from kincompile.emitters.lines import indented, wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.planned_solve import schedule_solve
from kincompile.emitters.solver_tables import solver_tables
from kincompile.report.templates import fill, read
from kincompile.solver.reader import solver, start
from kincompile.solver.vocabulary import CAREFUL

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program

DIALECT = JAVASCRIPT

START, MARCH = "start", "march"
PARTS = ("linear.js", START, "position.js", MARCH, "march.js", "events.js")
"""The parts of the solver, in order: templates, and start and march, which are printed."""

KEYWORDS = (
    "arguments", "await", "break", "case", "catch", "class", "const", "continue", "debugger",
    "default", "delete", "do", "else", "enum", "eval", "export", "extends", "false", "finally",
    "for", "function", "if", "implements", "import", "in", "instanceof", "interface", "let", "new",
    "null", "package", "private", "protected", "public", "return", "static", "super", "switch",
    "this", "throw", "true", "try", "typeof", "undefined", "var", "void", "while", "with", "yield",
    "NaN", "Infinity",
)  # fmt: skip
"""Words of the language, and names that it does not let be declared."""

STANDARD = (
    "AggregateError", "Array", "ArrayBuffer", "Atomics", "BigInt", "BigInt64Array",
    "BigUint64Array", "Boolean", "DataView", "Date", "Error", "EvalError", "FinalizationRegistry",
    "Float32Array", "Float64Array", "Function", "Infinity", "Int16Array", "Int32Array",
    "Int8Array", "Intl", "Iterator", "JSON", "Map", "Math", "NaN", "Number", "Object", "Promise",
    "Proxy", "RangeError", "ReferenceError", "Reflect", "RegExp", "Set", "SharedArrayBuffer",
    "String", "Symbol", "SyntaxError", "TypeError", "URIError", "Uint16Array", "Uint32Array",
    "Uint8Array", "Uint8ClampedArray", "WeakMap", "WeakRef", "WeakSet", "WebAssembly",
    "decodeURI", "decodeURIComponent", "encodeURI", "encodeURIComponent", "escape", "eval",
    "globalThis", "isFinite", "isNaN", "parseFloat", "parseInt", "undefined", "unescape",
)  # fmt: skip
"""What the language brings along; a constant of such a name would hide it."""

RESERVED: tuple[str, ...] = (
    *KEYWORDS, *STANDARD, *quantities.singles(quantities.QUANTITIES), "q", "q_dot", "q_ddot", "t",
    "p", "at", "F", "right", "to", "determinants", "block_solve", "block_determinant", "evaluated",
    *(f"{name}_at" for name in (*quantities.singles(quantities.QUANTITIES), *quantities.TOGETHER)),
    "factor_at", "solve_at", "require_length", "square", "spline", "DEFAULTS", "N_COORDINATES",
    "N_EQUATIONS",
)  # fmt: skip
"""Names that the functions use."""

TAKEN_BY_ENVIRONMENT = (
    *STANDARD, "console", "document", "exports", "location", "module", "require", "top", "window",
)  # fmt: skip
"""Names that a page or node does not let a script declare, or needs itself."""


evaluators = quantities.kernels_apart
"""The functions of a point."""

function = kernel
"""One of them."""


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the .js file."""
    program, listing = code.program, schedule_solve(code, RESERVED)
    lines = [line for own in functions.values() for line in own]
    for quantity in program.quantities:
        lines += single(quantity, code)
    lines += [] if listing is None else solve_functions(code, listing)
    text = indented(lines)
    units = {item.name: item.unit for item in program.coordinates}
    units |= {item.name: item.unit for item in program.parameters}
    units |= {item.name: item.unit for item in program.outputs}
    data = WRITE.facts(code, listing, text) | {
        "format": quantities.FORMAT,
        "lists": {name: indented(lines, 2) for name, lines in _lists(code).items()},
        "units": indented(wrapped(f'"{name}": "{unit}"' for name, unit in units.items()), 2),
        "corners": str(program.corners).lower(),
        "matrices": indented(_matrices(code), 2),
        "variable": variable_of(program.name),
        "tables": indented(splines(program, "const {} = {{", "[")),
        "table_names": ", ".join(program.tables),
        "spline": spline_function(),
        "vectors": indented(vectors(code), 3),
        "solver": "" if listing is None else _solver(program),
        "returned": indented(
            wrapped(
                [*(item.name for item in program.quantities), *(f"{name}_at" for name in functions)]
            ),
            2,
        ),
    }
    return {f"{program.name}.js": fill("javascript/module.js.jinja", data)}


def variable_of(name: str) -> str:
    """Return the variable that a script of a name declares."""
    return NameTable((*KEYWORDS, *TAKEN_BY_ENVIRONMENT)).take(name)


def ends(main: str) -> Mapping[str, str]:
    """Return what a script has at its end in a file of another ending: an ES module exports."""
    return {".mjs": f"\nexport default {variable_of(main.removesuffix('.js'))};\n"}


def spline_function() -> str:
    """Return the function that evaluates a table."""
    return indented(fill("javascript/spline.js", {}).rstrip().split("\n"))


def _solver(program: Program) -> str:
    """Return the script that solves for the motion."""
    tables = []
    for name, values in solver_tables(program).items():
        tables += [f"const {name} = [", *indented(wrapped(items(values))).split("\n"), "];"]
    return solver_text(tables)


def solver_text(tables: list[str]) -> str:
    """Return the solver with lines that declare its tables, or with tables that are there."""
    slots = _parts() | {"tables": indented(tables)}
    return indented(fill("javascript/solver.js.jinja", slots).rstrip().split("\n"))


@cache
def _parts() -> dict[str, str]:
    """Return what is the same for every mechanism: the parts, and the criteria that they use."""
    printed = {
        START: "/* ---- a position from a guess ---- */\n\n" + JavaScriptSolver(start()).text(),
        MARCH: "/* ---- from time to time ---- */\n\n" + JavaScriptSolver(solver(CAREFUL)).text(),
    }
    parts = "\n".join(printed.get(x) or read(f"javascript/{x}") for x in PARTS)
    used = set(re.findall(r"\b[A-Z_]+\b", parts)) & vars(criteria).keys()
    numbers = wrapped(f"{name} = {json.dumps(getattr(criteria, name))}" for name in sorted(used))
    text = "\n".join(f"        {line}" for line in numbers).strip().rstrip(",")
    return {"criteria": text, "parts": indented(parts.rstrip().split("\n"))}


def _lists(code: InlineProgram) -> dict[str, list[str]]:
    """Return the lines of the module's constant arrays, by name."""
    program, lists = code.program, named_lists(code.program)
    lists["OUTPUTS"] = lists.pop("OUTPUTS")
    lists["BODIES"] = [f'["{x.name}", {x.columns.start}, {len(x.columns)}]' for x in program.bodies]
    lists["PATTERN"] = [f"[{row}, {column}]" for row, column in code.pattern()]
    if program.redundant:
        lists["REDUNDANT"] = [f'"{name}"' for name in program.redundant]
    return {name: wrapped(own) for name, own in lists.items()}


def _matrices(code: InlineProgram) -> list[str]:
    """Return rows, columns and pattern of each matrix, by name."""
    lines = []
    for quantity in code.program.quantities:
        if quantity.is_matrix:
            rows, columns = code.program.shape_of(quantity)
            places = wrapped(f"[{i}, {j}]" for i, j in code.pattern(quantity.name))
            pattern = ["pattern: [", *(f"    {line}" for line in places), "],"]
            pattern = ["pattern: PATTERN,"] if quantity.name == "Phi_q" else pattern
            own = [f"rows: {rows}, columns: {columns},", *pattern]
            lines += [f"{quantity.name}: {{", *(f"    {line}" for line in own), "},"]
    return lines
