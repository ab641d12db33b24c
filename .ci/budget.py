"""Counts the package and fails above `budget.toml`, so that it grows only where someone says so.

Code lines are those without blank lines, comments and docstrings. What a new joint, target or field
touches is measured by one that is there: the files of the package that name it. What something is
judged by belongs into `criteria.py`: numbers of the solver's folders that do not are counted.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

Table = dict[str, dict[str, float]]
ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "kincompile"
TEMPLATES = ROOT / "templates"
LAYOUT = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENDMARKER,
}  # fmt: skip
IMPORTS = (ast.Import, ast.ImportFrom)
PLAIN = {0.0, 0.5, 1.0, 2.0}
"""Numbers within a function that are arithmetic, and no threshold."""
PICTURES = {"plot.py"}
"""Modules whose numbers are sizes of a picture."""


@cache
def source_of(path: Path) -> str:
    """Return the text of a file."""
    return path.read_text(encoding="utf-8")


@cache
def tokens_of(path: Path) -> list[tokenize.TokenInfo]:
    """Return the tokens of a module that are code; a docstring is left out."""
    text = source_of(path)
    docstrings = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    every = tokenize.generate_tokens(io.StringIO(text).readline)
    return [item for item in every if item.type not in LAYOUT and item.start[0] not in docstrings]


def code_lines(path: Path) -> int:
    """Return how many lines of a module hold code."""
    spans = (range(item.start[0], item.end[0] + 1) for item in tokens_of(path))
    return len({line for span in spans for line in span})


SPACE = re.compile(
    r"len\([^()]*\.axes\)|\b(is_spatial|_?is_in_space|in_space|words\.count|frame\.size|on_request)\b|"
    r"\b(SPACE|PLANE|SPATIAL|PLANAR|SpatialBody|SpatialFrame|PlaneFrame)\b|'xyz'"
)
"""How a test asks whether it is in the plane or in space."""


def branches_on_space(path: Path) -> int:
    """Return how many branches of a module ask for the dimension."""
    found = 0
    for node in ast.walk(ast.parse(source_of(path))):
        tests = [node.test] if isinstance(node, ast.If | ast.IfExp) else getattr(node, "ifs", [])
        found += sum(SPACE.search(ast.unparse(test)) is not None for test in tests)
    return found


def import_lines(path: Path) -> int:
    """Return how many lines of a module are import statements."""
    nodes = (node for node in ast.walk(ast.parse(source_of(path))) if isinstance(node, IMPORTS))
    return sum((node.end_lineno or node.lineno) - node.lineno + 1 for node in nodes)


def names_it(path: Path, word: str) -> bool:
    """Return whether the code of a module holds a word, as a name or within a text."""
    kinds = (tokenize.NAME, tokenize.STRING)
    pattern = re.compile(rf"\b{word}\b")
    return any(item.type in kinds and pattern.search(item.string) for item in tokens_of(path))


def is_float(node: ast.AST) -> bool:
    """Return whether a node is a number with a point or an exponent."""
    return isinstance(node, ast.Constant) and isinstance(node.value, float)


def thresholds(path: Path) -> int:
    """Return how many numbers with a point a module has, under a name at its top or within.

    A tuple under one name counts once. Calls and tables at the top are data, as of a polynomial.
    """
    tree, count = ast.parse(source_of(path)), 0
    named: set[ast.AST] = set()
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value:
            named.update(node for node in ast.walk(node) if is_float(node))
            several = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple)
            values = getattr(node.value, "elts", [node.value]) if several else [node.value]
            own = [item for item in values if not isinstance(item, ast.Call | ast.Dict)]
            count += sum(any(map(is_float, ast.walk(item))) for item in own)
    others = (node for node in ast.walk(tree) if is_float(node) and node not in named)
    return count + sum(node.value not in PLAIN for node in others)  # type: ignore[attr-defined]


def folder_of(path: Path, root: Path) -> str:
    """Return the folder directly below a root that a file is in; "." is the root itself."""
    parts = path.relative_to(root).parts
    return parts[0] if len(parts) > 1 else "."


def counted(words: Iterable[str], rooms: Iterable[str] = ()) -> Table:
    """Return what there is, in the tables of the budget: of words, and of rooms with thresholds."""
    modules = sorted(PACKAGE.rglob("*.py"))
    code: Counter[str] = Counter()
    for path in modules:
        code[folder_of(path, PACKAGE)] += code_lines(path)
    templates: Counter[str] = Counter()
    for path in sorted(item for item in TEMPLATES.rglob("*.*") if item.is_file()):
        templates[folder_of(path, TEMPLATES)] += source_of(path).count("\n")
    raw = sum(source_of(path).count("\n") for path in modules)
    share = round(100 * sum(map(import_lines, modules)) / raw, 1)
    return {
        "package": {"code lines": code.total(), "raw lines": raw, "percent of imports": share},
        "code lines": dict(code),
        "template lines": dict(templates),
        "branches": {"on space": sum(map(branches_on_space, modules))},
        "thresholds": {
            room: sum(
                thresholds(path)
                for path in modules
                if folder_of(path, PACKAGE) == room and path.name not in PICTURES
            )
            for room in rooms
        },
        "files that name": {word: sum(names_it(x, word) for x in modules) for word in words},
    }


def compared(found: Table, budget: Table) -> tuple[list[str], list[str]]:
    """Return the lines of a report, and what is above the budget; a folder without one is."""
    lines, above = [], []
    for table, most in budget.items():
        lines.append(f"{table:24} is  at most")
        for name in sorted({*most, *found[table]}):
            here, there = found[table].get(name, 0), most.get(name, 0)
            lines.append(f"  {name:20}{here:7} {there:8}{'  ABOVE' * (here > there)}")
            above += [f"{table}, {name}: {here}, at most {there}"] * (here > there)
    return lines, above


def main() -> int:
    """Print what there is beside what there may be; return 1 where anything is above."""
    budget = tomllib.loads(source_of(Path(__file__).with_name("budget.toml")))
    counts = counted(budget["files that name"], budget["thresholds"])
    lines, above = compared(counts, budget)
    print(*lines, *(f"Above the budget: {item}" for item in above), sep="\n")
    if above:
        print("Delete what the change made dead. What an issue needs besides is raised in")
        print(".ci/budget.toml, by at most 1,000 code lines, and the commit says why.")
    return bool(above)


if __name__ == "__main__":
    sys.exit(main())
