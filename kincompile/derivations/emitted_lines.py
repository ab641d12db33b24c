"""The lines of the emitted module that compute each entry, found in its syntax tree."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from kincompile.quantities import OF_EQUATIONS, kernels
from kincompile.report.document import SourceLine

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kincompile.ir.inline import Entry, InlineProgram

EntryKey = tuple[str, int, int]
"""A quantity, a row and a column; the column of a vector is 0."""


def emitted_lines(code: InlineProgram, source: str) -> dict[EntryKey, SourceLine]:
    """Return the lines of the emitted module that compute each entry of Phi, Phi_q, nu and gamma.

    Entries without a line of their own, in code that treats many constraints at once, are absent.
    """
    tree = ast.parse(source)
    lines = source.splitlines()
    functions = {item.name: item for item in tree.body if isinstance(item, ast.FunctionDef)}
    found: dict[EntryKey, SourceLine] = {}
    for kernel, computed in kernels(OF_EQUATIONS).items():
        if kernel == "kinematics":  # repeats the others
            continue
        entries = {name: code.entries(name) for name in computed}
        if "Phi_q" in entries:
            found |= _constant_lines(tree, entries["Phi_q"])
            entries["Phi_q"] = [x for x in entries["Phi_q"] if code.number(x.node) is None]
        function = functions.get(f"_{kernel}")
        if function is not None:
            keys = [(name, x.row, x.column) for name, own in entries.items() for x in own]
            found |= _lines(keys, function, lines)
    return found


def _lines(
    keys: Sequence[EntryKey], function: ast.FunctionDef, lines: Sequence[str]
) -> dict[EntryKey, SourceLine]:
    returned = function.body[-1]
    if not (isinstance(returned, ast.Return) and isinstance(returned.value, ast.Tuple)):
        return {}
    elements = returned.value.elts
    if len(elements) != len(keys):
        return {}
    definitions = _definitions(function)
    return {
        key: _source_line(element, definitions, lines)
        for key, element in zip(keys, elements, strict=True)
    }


def _definitions(function: ast.FunctionDef) -> dict[str, ast.Assign]:
    """Return the statements that compute a value with a name of its own."""
    return {
        name.id: statement
        for statement in function.body
        if isinstance(statement, ast.Assign) and not _is_input(statement)
        for name in ast.walk(statement.targets[0])
        if isinstance(name, ast.Name)
    }


def _is_input(statement: ast.Assign) -> bool:
    """Return whether a statement only gives names to what the function was given."""
    values = [statement.value]
    if isinstance(statement.value, ast.Tuple):
        values = statement.value.elts
    is_vector = isinstance(statement.targets[0], ast.Tuple) and isinstance(values[0], ast.Name)
    return is_vector or all(isinstance(value, ast.Attribute | ast.Subscript) for value in values)


def _source_line(
    element: ast.expr, definitions: dict[str, ast.Assign], lines: Sequence[str]
) -> SourceLine:
    needed = {statement.lineno: statement for statement in _needed(element, definitions)}
    statements = [needed[number] for number in sorted(needed)]
    text = [*(_text(item, lines) for item in statements), _text(element, lines)]
    return SourceLine(element.lineno, "\n".join(text))


def _needed(element: ast.AST, definitions: dict[str, ast.Assign]) -> Iterator[ast.Assign]:
    for node in ast.walk(element):
        if isinstance(node, ast.Name) and node.id in definitions:
            statement = definitions[node.id]
            yield statement
            yield from _needed(statement.value, definitions)


def _text(node: ast.stmt | ast.expr, lines: Sequence[str]) -> str:
    last = node.end_lineno or node.lineno
    return " ".join(line.strip() for line in lines[node.lineno - 1 : last])


def _constant_lines(tree: ast.Module, entries: Sequence[Entry]) -> dict[EntryKey, SourceLine]:
    """Return the lines of the constant entries of Phi_q: the numbers of `_CONSTANTS`."""
    for node in tree.body:
        match node:
            case ast.Assign([ast.Name("_CONSTANTS")], ast.Dict(keys, values)):
                found = {}
                for key, value in zip(keys, values, strict=True):
                    number = ast.literal_eval(key) if key else -1
                    entry, text = entries[number], f"_CONSTANTS[{number}] = {ast.unparse(value)}"
                    found["Phi_q", entry.row, entry.column] = SourceLine(value.lineno, text)
                return found
    return {}
