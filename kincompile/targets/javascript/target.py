"""The JavaScript target: one file with Phi, Phi_q, nu and gamma of one point.

It runs as a classic script in a page, which needs no server and no network, and under node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile import quantities
from kincompile.targets.headings import constants
from kincompile.targets.javascript.dialect import JAVASCRIPT
from kincompile.targets.lines import indented, wrapped
from kincompile.targets.naming import NameTable
from kincompile.targets.statements import Statements
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.quantities import Quantity
    from kincompile.targets.evaluators import Listing
    from kincompile.targets.printer import Printer

DIALECT = JAVASCRIPT

WRITE = Statements("//", "const {}", "{}[{}]", "{}[{}][{}]")

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
    "p", "require_length", "square", "spline", "DEFAULTS", "N_COORDINATES", "N_EQUATIONS",
)  # fmt: skip
"""Names that the functions use."""

TAKEN_BY_ENVIRONMENT = (
    *STANDARD, "console", "document", "exports", "location", "module", "require", "top", "window",
)  # fmt: skip
"""Names that a page or node does not let a script declare, or needs itself."""


def evaluators(given: Sequence[Quantity]) -> dict[str, tuple[str, ...]]:
    """Return the functions: one a quantity."""
    return quantities.singles(given)


def function(name: str, code: InlineProgram, listing: Listing, printer: Printer) -> list[str]:
    """Return the lines of a function of one point."""
    quantity = quantities.quantity_named(name)
    vectors = quantity.states
    body = [f'require_length("{vector}", {vector}, N_COORDINATES);' for vector in vectors]
    body.append('require_length("p", p, DEFAULTS.length);')
    body += WRITE.inputs(code.program, listing)
    body += WRITE.frames(listing, printer) + WRITE.steps(listing, printer)
    body.append(f"const {name} = {_zeros(name, code.program)};")
    body += WRITE.results(name, code, printer)
    return [
        "",
        f"// {quantity.about}",
        f"function {name}({', '.join(vectors)}, t, p = DEFAULTS) {{",
        *(f"    {line}" for line in body),
        f"    return {name};",
        "}",
    ]


def files(
    code: InlineProgram, functions: Mapping[str, list[str]], called: Collection[str]
) -> Mapping[str, str]:
    """Return the .js file."""
    program = code.program
    text = indented(line for lines in functions.values() for line in lines)
    units = {item.name: item.unit for item in program.coordinates}
    units |= {item.name: item.unit for item in program.parameters}
    units |= {item.name: item.unit for item in program.outputs}
    data = {
        **constants(code, 2, "[{}, {}]"),
        "units": indented(wrapped(f'"{name}": "{unit}"' for name, unit in units.items()), 2),
        "header": WRITE.heading(code),
        "variable": NameTable((*KEYWORDS, *TAKEN_BY_ENVIRONMENT)).take(program.name),
        "tables": indented(_tables(program)),
        "has_square": "square(" in text,
        "functions": text,
        "returned": "".join(f", {name}" for name in functions),
    }
    return {f"{program.name}.js": fill("javascript/module.js.jinja", data)}


def _zeros(quantity: str, program: Program) -> str:
    """Return a vector or a matrix of zeros, to be filled."""
    rows, *columns = program.shape_of(quantities.quantity_named(quantity))
    if columns:
        return f"Array.from({{ length: {rows} }}, () => new Array({columns[0]}).fill(0))"
    return f"new Array({rows}).fill(0)"


def _tables(program: Program) -> list[str]:
    """Return the tables of splines."""
    lines = []
    for name, spline in program.tables.items():
        lines += [f"const {name} = {{", "    breaks: ["]
        lines += [f"        {line}" for line in wrapped(repr(x) for x in spline.breaks)]
        lines += ["    ],", "    pieces: ["]
        lines += [f"        [{', '.join(map(repr, row))}]," for row in spline.coefficients]
        lines += ["    ],", "};"]
    return lines
