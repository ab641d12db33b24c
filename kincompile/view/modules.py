"""The scripts of pages: ES modules in `templates/view`, joined to one script without imports."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

from kincompile.errors import TemplateError
from kincompile.report.templates import read

if TYPE_CHECKING:
    from collections.abc import Iterable

WORLDS = {2: "plane.js", 3: "space.js"}
"""The module that draws in the plane or in space, by dimension."""

WORLD = "#world"
"""What modules import it as; `package.json` beside them names it for node and tsc."""

IMPORT = re.compile(
    rf"^import {{ \w+(?:, \w+)* }} from '(?:\./(\w+\.js)|{WORLD})';\n", re.MULTILINE
)
EXPORT = re.compile(r"^export (?=(?:async function|function|class|const|let) )", re.MULTILINE)
LEFT = re.compile(r"(?:^|[;/])[ ]*((?:import|export)\b.*)", re.MULTILINE)


@cache
def modules_of(entry: str, dimension: int) -> tuple[str, ...]:
    """Return the modules that one imports and itself, in the order in which they are evaluated."""
    found: dict[str, bool] = {}  # whether all that a module imports is there

    def visit(name: str) -> None:
        if name in found:
            return
        found[name] = False
        for wanted in IMPORT.findall(read(f"view/{name}")):
            visit(wanted or WORLDS[dimension])
        found[name] = found.pop(name) or True

    visit(entry)
    return tuple(found)


def joined(names: Iterable[str]) -> str:
    """Return modules as one script; their names are unique, and stay in reach of a console.

    Raises
    ------
    TemplateError
        When an import or an export is of a form that cannot be left out.
    """
    return "'use strict';\n" + "\n".join(map(without_imports, names))


@cache
def without_imports(name: str) -> str:
    """Return the text of a module without its imports and the word `export`."""
    text = EXPORT.sub("", IMPORT.sub("", read(f"view/{name}")))
    if left := LEFT.search(text):
        raise TemplateError(
            f"view/{name} has {left[1]!r}: import names on one line, as in import {{ a, b }} from "
            "'./c.js', and export where a name is declared"
        )
    return text
