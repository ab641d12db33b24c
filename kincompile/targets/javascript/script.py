"""The JavaScript target: one file with Phi, Phi_q, nu and gamma of one point.

It runs as a classic script in a page, which needs no server and no network, and under node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile import quantities
from kincompile.names import rate
from kincompile.quantities import FORMAT, functions
from kincompile.targets.functions import Listing, inputs_read, schedule
from kincompile.targets.headings import header, place, title
from kincompile.targets.layout import assigned, indented, quoted, wrapped
from kincompile.targets.naming import NameTable
from kincompile.targets.printers import JavaScriptPrinter
from kincompile.targets.target import Emitted
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.quantities import Quantity

KEYWORDS = (
    "arguments", "await", "break", "case", "catch", "class", "const", "continue", "debugger",
    "default", "delete", "do", "else", "enum", "eval", "export", "extends", "false", "finally",
    "for", "function", "if", "implements", "import", "in", "instanceof", "interface", "let", "new",
    "null", "package", "private", "protected", "public", "return", "static", "super", "switch",
    "this", "throw", "true", "try", "typeof", "undefined", "var", "void", "while", "with", "yield",
    "NaN", "Infinity",
)  # fmt: skip
"""Words of the language, and names that it does not let be declared."""

RESERVED = (
    *KEYWORDS, "q", "q_dot", "t", "p", "Array", "Math", "require_length", "square",
    "spline", "DEFAULTS", "N_COORDINATES",
)  # fmt: skip
"""Names that the functions use."""

TAKEN_BY_ENVIRONMENT = (
    "document", "exports", "location", "module", "require", "top", "window",
)  # fmt: skip
"""Names that a page or node does not let a script declare."""


def emit_javascript(code: InlineProgram) -> Emitted:
    """Return a program as one .js file.

    Raises
    ------
    UnsupportedError
        If a function does not exist in JavaScript.
    """
    program = code.program
    table = NameTable((*RESERVED, *functions(), *program.tables))
    wanted = [item.name for item in program.coordinates]
    wanted += [rate(name) for name in wanted] + [item.name for item in program.parameters]
    names = {"t": "t", **{name: table.take(name) for name in wanted}}
    lines: list[str] = []
    for quantity in quantities.QUANTITIES:
        listing = schedule(code, (quantity.name,), names, table)
        lines += ["", *_function(quantity, code, listing, names)]
    text = indented(lines)
    data = {
        **_constants(code),
        "returned": "".join(f", {item.name}" for item in quantities.QUANTITIES),
        "header": "\n".join(f"// {line}".rstrip() for line in header(code)),
        "variable": NameTable((*KEYWORDS, *TAKEN_BY_ENVIRONMENT)).take(program.name),
        "tables": indented(_tables(program)),
        "has_square": "square(" in text,
        "functions": text,
    }
    source = fill("javascript/module.js.jinja", data)
    return Emitted(program.name, {f"{program.name}.js": source})


def _constants(code: InlineProgram) -> dict[str, object]:
    """Return the constants of the file: names, units, numbers and the pattern of Phi_q."""
    program = code.program
    units = {item.name: item.unit for item in program.coordinates}
    units |= {item.name: item.unit for item in program.parameters}
    return {
        "name": program.name,
        "format": FORMAT,
        "fingerprint": program.fingerprint,
        "n": len(program.coordinates),
        "m": len(program.equations),
        "k": len(program.parameters),
        "coordinates": indented(quoted(item.name for item in program.coordinates), 2),
        "equations": indented(quoted(program.equations), 2),
        "parameters": indented(quoted(item.name for item in program.parameters), 2),
        "units": indented(wrapped(f'"{name}": "{unit}"' for name, unit in units.items()), 2),
        "defaults": indented(wrapped(repr(item.default) for item in program.parameters), 2),
        "guess": indented(wrapped(repr(item.guess) for item in program.coordinates), 2),
        "pattern": indented(wrapped(f"[{row}, {column}]" for row, column in code.pattern()), 2),
    }


def _function(
    quantity: Quantity, code: InlineProgram, listing: Listing, names: Mapping[str, str]
) -> list[str]:
    """Return the lines of one function."""
    vectors = [name for name in quantity.arguments if name in ("q", "q_dot")]
    checks = [f'require_length("{vector}", {vector}, N_COORDINATES);' for vector in vectors]
    checks.append('require_length("p", p, DEFAULTS.length);')
    inputs = [
        f"const {names[member]} = {vector}[{k}];"
        for vector, k, member in inputs_read(code.program, listing)
    ]
    body = [*checks, *inputs, *_body(quantity, code, listing), f"return {quantity.name};"]
    return [
        f"// {quantity.about}",
        f"function {quantity.name}({', '.join(vectors)}, t, p = DEFAULTS) {{",
        *(f"    {line}" for line in body),
        "}",
    ]


def _body(quantity: Quantity, code: InlineProgram, listing: Listing) -> list[str]:
    """Return the statements of a function, its inputs named."""
    printer = JavaScriptPrinter(code.nodes, listing.names)
    lines = ["// body frames: A = [[c, -s], [s, c]]"] if listing.frames else []
    for frame in listing.frames:
        for item in frame.values:
            lines += assigned(f"const {item.name}", printer.text(item.node, own=True))
    for section, assignments in listing.steps:
        lines.append(f"// {title(section)}")
        for item in assignments:
            lines += assigned(f"const {item.name}", printer.text(item.node, own=True))
    lines.append(f"const {quantity.name} = {_zeros(quantity, code.program)};")
    for section in code.sections:
        # Zeros are there already.
        entries = [
            entry for entry in section.entries[quantity.name] if code.number(entry.node) != 0
        ]
        lines += [f"// {title(section)}"] if entries else []
        for entry in entries:
            column = f"[{entry.column}]" if quantity.is_matrix else ""
            text = assigned(f"{quantity.name}[{entry.row}]{column}", printer.text(entry.node))
            where = place(quantity.name, entry, code)
            text[-1] += f"  // {where}" if where else ""
            lines += text
    return lines


def _zeros(quantity: Quantity, program: Program) -> str:
    """Return a vector or a matrix of zeros, to be filled."""
    rows, *columns = program.shape_of(quantity)
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
