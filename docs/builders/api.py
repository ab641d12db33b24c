"""docs/api.md: the public names, each with a sentence and its stability, from the list of names."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import kincompile as kc
from kincompile import spatial
from kincompile.space.catalogue import CONSTRAINTS as IN_SPACE

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

PAGE = "api.md"
HEAD = """# Stability of the public names

How each is called: [names.md](names.md). This page is made of the lines of
`kincompile/__init__.pyi`, where a name is marked, and of the first sentences of docstrings.

- **stable**: a name, its arguments and what it returns keep their meaning. What must change is
  deprecated first: for one minor version the old form works and warns, with what to write instead.
- **provisional**: works and is tested; its form may change with a minor version, and CHANGELOG.md
  says so.
- **deprecated**: no name.

Names that are not here, and modules below `kincompile.`, are internal. Emitted modules have a
contract of their own, with a number: [contract.md](contract.md). The commands and the model files
are stable.
"""
CONSTANTS = {
    "t": "The time.",
    "pi": "The number.",
    "alpha": "The polar angle of a cam's profile.",
    "deg": "One degree, in the radians in which every angle is counted.",
}


def page() -> str:
    """Return docs/api.md."""
    stub = Path(str(kc.__file__)).with_suffix(".pyi").read_text(encoding="utf-8")
    lines = re.findall(r"^from (\S+) import (\w+) as \w+(?: +# (.*))?$", stub, re.MULTILINE)
    kinds = {name: kind for _, name, kind in lines}
    errors = {name for module, name, _ in lines if module.endswith(".errors")}
    results = {name for name, kind in kinds.items() if "result" in kind}
    types = set(kc.__all__) - set(kinds)
    typed = set(kinds) - errors - results
    spaces = [*IN_SPACE, *_in_space()]
    parts = (
        ("What is called", _table(kc, typed, kinds)),
        ("Joints, drivers and cams", _table(kc, types, kinds)),
        ("What calls return", _table(kc, results, kinds)),
        ("Errors and warnings", _table(kc, errors, kinds)),
        ("In space: `kincompile.spatial`", _table(spatial, spaces, {})),
    )
    return HEAD + "".join(f"\n## {title}\n\n{table}" for title, table in parts)


def _in_space() -> Iterator[str]:
    """Return the names of `kincompile.spatial` that are no types of constraints."""
    text = inspect.getsource(spatial)
    yield from re.findall(r"^from \S+ import (\w+) as \w+", text, re.MULTILINE)
    yield from re.findall(r"^def (\w+)", text, re.MULTILINE)


def _table(home: Any, names: Iterable[str], kinds: dict[str, str]) -> str:
    rows = [
        f"| `{name}` | {_sentence(name, getattr(home, name))} "
        f"| {'provisional' if 'provisional' in kinds.get(name, '') else 'stable'} |\n"
        for name in sorted(set(names), key=lambda name: (name.lower(), name))
    ]
    return "| Name | What it is | Stability |\n| --- | --- | --- |\n" + "".join(rows)


def _sentence(name: str, value: Any) -> str:
    """Return the first sentence of a docstring, in one line."""
    said = CONSTANTS.get(name) or (inspect.getdoc(value) or "").split("\n\n")[0]
    return " ".join(said.replace("``", "`").replace("|", "\\|").split())
