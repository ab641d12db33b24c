"""Reading a hand file: matrices as people write them, in TOML, in JSON or line by line.

    Phi_q = [[1, 0, 0.25*cos(phi3)],
             [0, 1, 0.25*sin(phi3)]]
    gamma = [0.25*sin(phi3)*w^2; -0.25*cos(phi3)*w^2]
    w = phi3_dot

The file is data. It is parsed, never run; a mistake in it is reported with its line.
"""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile.compare.matrix_text import Cell, Rows, split_matrix
from kincompile.compare.reference import QUANTITIES
from kincompile.errors import InputError
from kincompile.files.safe_expressions import ExpressionError, Place
from kincompile.names import listed, suggestion

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping

MAX_BYTES = 2_000_000
_STATEMENT = re.compile(r"[ \t]*([A-Za-z_]\w*)[ \t]*=[ \t]*")
_SECTION = re.compile(r"[ \t]*\[[ \t]*([A-Za-z_]\w*)[ \t]*\][ \t;]*(?=\n|$)")
_QUOTES = ('"""', "'''", '"', "'")


@dataclass(frozen=True, slots=True)
class HandFile:
    """What a hand file says, still as text.

    Attributes
    ----------
    name
        Name of the file.
    quantities
        Rows of elements by quantity: Phi, Phi_q, nu, gamma.
    aliases
        The author's own names, each with its expression.
    constraint
        The constraint that is checked alone, or None.
    """

    name: str
    quantities: Mapping[str, Rows]
    aliases: Mapping[str, Cell]
    constraint: str | None = None


@dataclass
class _Draft:
    """What has been read so far, and the problems found."""

    name: str
    quantities: dict[str, Rows] = field(default_factory=dict)
    aliases: dict[str, Cell] = field(default_factory=dict)
    constraint: str | None = None
    problems: list[str] = field(default_factory=list)

    def problem(self, place: Place, text: str) -> None:
        self.problems.append(f"{self.name}, line {place.line}, column {place.column}: {text}")

    def add_matrix(self, name: str, text: str, place: Place) -> None:
        """Add a quantity written as text."""
        if name in self.quantities:
            self.problem(place, f"{name} is given twice; keep one of them")
        try:
            self.quantities[name] = split_matrix(text, place)
        except ExpressionError as error:
            self.problem(Place(error.line, error.column), f"{name}: {error.problem}")

    def add_alias(self, name: str, text: str, place: Place) -> None:
        """Add an alias."""
        if name in self.aliases:
            self.problem(place, f"{name!r} is given twice; keep one of them")
        self.aliases[name] = Cell(text, place)

    def unknown(self, name: str, place: Place) -> None:
        """Report a key that means nothing."""
        keys = (*QUANTITIES, "constraint", "aliases")
        hint = suggestion(name, keys)
        self.problem(place, f"there is no quantity {name!r}{hint}; expected: {listed(keys)}")

    def finished(self) -> HandFile:
        """Return the file, or raise all the problems at once."""
        if not self.problems and not self.quantities:
            self.problem(
                Place(), f"the file compares nothing; give at least one of: {listed(QUANTITIES)}"
            )
        if self.problems:
            raise InputError(self.problems)
        return HandFile(self.name, self.quantities, self.aliases, self.constraint)


def read_hand_file(path: str | os.PathLike[str]) -> HandFile:
    """Read a hand file.

    Parameters
    ----------
    path
        A ``.json`` or ``.toml`` file with the keys Phi, Phi_q, nu, gamma (each a text as one writes
        it, or lists of numbers and texts), constraint (a name) and aliases (a table of names and
        expressions); or any other text file with lines ``Name = [[...], ...]``, where further names
        are aliases.

    Raises
    ------
    InputError
        If the file cannot be read, or is not of this form; every problem with its line.
    """
    file = Path(path)
    text = _text(file)
    suffix = file.suffix.lower()
    if suffix == ".json":
        return _from_data(file.name, text, _json(file.name, text))
    if suffix == ".toml":
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            return _from_lines_or(file.name, text, str(error))
        return _from_data(file.name, text, data)
    return _from_lines(file.name, text)


def _text(file: Path) -> str:
    try:
        if file.stat().st_size > MAX_BYTES:
            raise InputError(f"{file} has more than {MAX_BYTES} bytes; a hand file is short.")
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{file} is not a text in UTF-8; save it as plain text.") from error
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror}. Check the path.") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _json(name: str, text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{name}, line {error.lineno}, column {error.colno}: {error.msg}; this is not JSON. "
            "Matrices are texts or lists of numbers and texts in quotes."
        ) from error
    except RecursionError as error:
        raise InputError(f"{name}: the file is nested too deeply.") from error


def _from_lines_or(name: str, text: str, toml_problem: str) -> HandFile:
    """Read matrices without quotes, which TOML forbids and people write."""
    try:
        return _from_lines(name, text)
    except InputError as error:
        raise InputError([*error.problems, f"{name} is not TOML either: {toml_problem}"]) from error


def _from_lines(name: str, text: str) -> HandFile:
    """Read statements ``name = value``, each as many lines long as its brackets need."""
    draft = _Draft(name)
    for statement in _statements(text, draft):
        if statement.name in QUANTITIES:
            draft.add_matrix(statement.name, statement.value, statement.place)
        elif statement.section is None and statement.name == "constraint":
            draft.constraint = statement.value.strip()
        elif statement.section != "aliases" and statement.value.lstrip().startswith("["):
            draft.unknown(statement.name, statement.place)
        else:
            draft.add_alias(statement.name, statement.value.strip(), statement.place)
    return draft.finished()


@dataclass(frozen=True, slots=True)
class _Statement:
    section: str | None
    name: str
    value: str
    place: Place


def _statements(text: str, draft: _Draft) -> Iterator[_Statement]:
    text = _without_comments(text)
    section: str | None = None
    offset = 0
    while offset < len(text):
        line_end = _line_end(text, offset)
        if not text[offset:line_end].strip(" \t;"):
            offset = line_end + 1
        elif header := _SECTION.match(text, offset):
            section = header[1]
            offset = header.end()
        elif found := _STATEMENT.match(text, offset):
            start = found.end()
            end = _value_end(text, start)
            value = _without_quotes(text[start:end]).rstrip("; \t\n")
            yield _Statement(section, found[1], value, _place(text, start))
            offset = end
        else:
            draft.problem(
                _place(text, offset),
                f"expected 'name = value', found {text[offset:line_end].strip()[:40]!r}; names are "
                f"{listed(QUANTITIES)}, and your own for aliases",
            )
            offset = line_end + 1


def _without_comments(text: str) -> str:
    """Blank out what follows # or %, keeping every offset."""
    return re.sub(r"[#%][^\n]*", lambda found: " " * len(found[0]), text)


def _without_quotes(value: str) -> str:
    """Blank out quotes, keeping every offset."""
    return re.sub(r"[\"']", " ", value)


def _line_end(text: str, offset: int) -> int:
    end = text.find("\n", offset)
    return len(text) if end < 0 else end


def _value_end(text: str, start: int) -> int:
    """Return where a value ends: at its closing quote, or where its last line ends."""
    for quote in _QUOTES:
        if text.startswith(quote, start):
            close = text.find(quote, start + len(quote))
            return len(text) if close < 0 else close + len(quote)
    depth = 0
    for k in range(start, len(text)):
        depth += (text[k] in "([") - (text[k] in ")]")
        if text[k] == "\n" and depth <= 0 and not text[start:k].rstrip().endswith("..."):
            return k
        if depth > 0 and text[k] == "\n" and _STATEMENT.match(text, k + 1):
            # The next statement begins: the bracket was forgotten, and is reported for this one.
            return k
    return len(text)


def _place(text: str, offset: int) -> Place:
    before = text[:offset]
    return Place(before.count("\n") + 1, offset - (before.rfind("\n") + 1) + 1)


def _from_data(name: str, text: str, data: Any) -> HandFile:
    """Take the values of TOML or JSON; a text is found again in the file for its place."""
    draft = _Draft(name)
    if not isinstance(data, dict):
        raise InputError(f"{name}: expected names and values, not {type(data).__name__}.")
    for key, value in data.items():
        locate = _Locator(text, key)
        if key in QUANTITIES:
            _add_data(draft, key, value, locate)
        elif key == "constraint" and isinstance(value, str):
            draft.constraint = value
        elif key == "aliases" and isinstance(value, dict):
            for alias, expression in value.items():
                inner = _Locator(text, alias)
                draft.add_alias(alias, str(expression), inner.place(str(expression)))
        else:
            draft.unknown(key, locate.place(""))
    return draft.finished()


def _add_data(draft: _Draft, name: str, value: Any, locate: _Locator) -> None:
    if isinstance(value, str):
        draft.add_matrix(name, value, locate.place(value))
        return
    rows = value if isinstance(value, list) else [value]
    if not any(isinstance(row, list) for row in rows):
        if any(isinstance(row, str) and row.strip().startswith("[") for row in rows):
            # A list of rows, each a text of its own.
            draft.add_matrix(name, "[" + ",\n".join(map(str, rows)) + "]", locate.place(""))
            return
        rows = [[row] for row in rows]
    cells = []
    for row in rows:
        elements = row if isinstance(row, list) else [row]
        wrong = [item for item in elements if not _is_element(item)]
        if wrong:
            draft.problem(
                locate.place(""),
                f"{name}: {wrong[0]!r} is not an element; expected a number or a text",
            )
            return
        cells.append(tuple(Cell(str(item), locate.place(str(item))) for item in elements))
    draft.quantities[name] = tuple(cells)


def _is_element(item: Any) -> bool:
    return isinstance(item, str | int | float) and not isinstance(item, bool)


class _Locator:
    """Finds the texts of one key again in the file, one after the other."""

    def __init__(self, text: str, key: str) -> None:
        self._text = text
        found = re.search(rf"(?m)^[\s{{,]*[\"']?{re.escape(key)}[\"']?\s*[=:]", text)
        self._cursor = found.end() if found else 0

    def place(self, fragment: str) -> Place:
        """Return where a fragment begins; where it is written differently, the last place."""
        found = self._text.find(fragment, self._cursor) if fragment else -1
        if found >= 0:
            self._cursor = found
        return _place(self._text, self._cursor)
