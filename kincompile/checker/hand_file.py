"""Reading a hand file: matrices as people write them, in TOML, in JSON or line by line.

    Phi_q = [[1, 0, 0.25*cos(phi3)],
             [0, 1, 0.25*sin(phi3)]]
    gamma = [0.25*sin(phi3)*w^2; -0.25*cos(phi3)*w^2]
    w = phi3_dot

The file is data. It is parsed, never run; a mistake in it is reported with its line.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.checker.matrix_text import Cell, Rows, split_matrix
from kincompile.checker.notation import plain
from kincompile.checker.reference import COMPARED, OF_TRANSMISSIONS
from kincompile.errors import InputError, ModelError
from kincompile.files.content import decoded, file_content
from kincompile.files.data_text import MAX_PROBLEMS, read_json, read_toml
from kincompile.files.formula_text import ExpressionError
from kincompile.files.text_places import TextPlace, TextPlaces
from kincompile.names import escaped, listed, shown, suggestion, transmission_ends

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from kincompile.files.data_lines import Address
    from kincompile.files.data_text import Document

MAX_BYTES = 1_000_000
"""Largest hand file; Phi_q of 300 coordinates has a third of this."""
ALL = (*COMPARED, *OF_TRANSMISSIONS)
ENDS = ("inputs", "outputs")
Ends = tuple[list[str], list[str]]
_STATEMENT = re.compile(r"[ \t]*([A-Za-z_]\w*)[ \t]*=[ \t]*")
_SECTION = re.compile(r"[ \t]*\[[ \t]*([A-Za-z_]\w*)[ \t]*\][ \t;]*(?=\n|$)")
_QUOTES = ('"""', "'''", '"', "'")


@dataclass(frozen=True, slots=True)
class HandFile:
    """The content of a hand file, still as text."""

    name: str
    quantities: Mapping[str, Rows]  # rows of elements by quantity
    aliases: Mapping[str, Cell]  # the author's own names, each with its expression
    constraint: str | None
    conventions: Mapping[str, str]  # the author's conventions
    transmission: Ends | None = None  # inputs and outputs, where it is of a transmission


class _Draft:
    """The part of a hand file that has been read, and the problems found."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._quantities: dict[str, Rows] = {}
        self._aliases: dict[str, Cell] = {}
        self._problems: list[str] = []
        self.constraint: str | None = None
        self.conventions: dict[str, str] = {}
        self.transmission: Ends | None = None
        self._ends: dict[str, list[str]] = {}

    def problem(self, place: TextPlace, text: str) -> None:
        """Add a problem; very many end the reading."""
        self._problems.append(f"{self._name}, line {place.line}, column {place.column}: {text}")
        if len(self._problems) == MAX_PROBLEMS:
            raise InputError([*self._problems, "and perhaps more: mend these first"])

    def add_matrix(self, name: str, value: str | Rows, place: TextPlace) -> None:
        """Add a quantity."""
        if name in self._quantities:
            self.problem(place, f"{name} is given twice; keep one of them")
        try:
            self._quantities[name] = split_matrix(value, place) if isinstance(value, str) else value
        except ExpressionError as error:
            self.problem(TextPlace(error.line, error.column), f"{name}: {error.problem}")

    def add_alias(self, name: str, text: str, place: TextPlace) -> None:
        """Add an alias."""
        if name in self._aliases:
            self.problem(place, f"{shown(name)} is given twice; keep one of them")
        self._aliases[name] = Cell(text, place)

    def add_transmission(self, value: str, place: TextPlace) -> None:
        """Add the names of inputs and outputs."""
        self.transmission = transmission_ends(value)
        if self.transmission is None:
            self.problem(
                place,
                f"transmission = {shown(value)} is not of the form INPUTS:OUTPUTS; write names "
                "with commas, as left,right:pitch,roll",
            )

    def add_end(self, name: str, names: list[str], place: TextPlace) -> None:
        """Add the names of inputs, or those of outputs."""
        if name not in ENDS or not all(names):
            self.problem(place, f"transmission has {shown(name)}: it has names of {listed(ENDS)}")
            return
        self._ends[name] = names
        if len(self._ends) == len(ENDS):
            self.transmission = self._ends["inputs"], self._ends["outputs"]

    def unknown(self, name: str, place: TextPlace) -> None:
        """Add the problem of a key that means nothing."""
        keys = (*ALL, "constraint", "transmission", "aliases", "conventions")
        hint = suggestion(name, keys)
        self.problem(place, f"there is no quantity {shown(name)}{hint}; expected: {listed(keys)}")

    def finished(self) -> HandFile:
        """Return the file, or raise all the problems at once."""
        if not self._problems and not self._quantities:
            self.problem(
                TextPlace(),
                f"the file compares nothing; give at least one of: {listed(ALL)}",
            )
        if self._problems:
            raise InputError(self._problems)
        return HandFile(
            self._name, self._quantities, self._aliases, self.constraint, self.conventions,
            self.transmission,
        )  # fmt: skip


def read_hand_file(path: str | os.PathLike[str]) -> HandFile:
    """Read a hand file.

    Parameters
    ----------
    path
        A ``.json`` or ``.toml`` file with the keys Phi, Phi_q, nu, gamma, M, Q, or J, J_dot,
        effort, x (each a text as one writes it, or lists of numbers and texts), constraint (a
        name), transmission (``"left,right:pitch,roll"``, or a table of inputs and outputs), aliases
        (a table of names and expressions) and conventions (``nu = "Phi_t"``, ``gamma = "left
        side"``); or any other text file with lines ``Name = [[...], ...]``, where further names are
        aliases. In lines, J and x without brackets are names of the author's own.

    Raises
    ------
    InputError
        If the file cannot be read, or is not of this form; every problem with its line.
    """
    file = Path(path)
    try:
        content = file_content(file, MAX_BYTES, follows_links=False)
        suffix = file.suffix.lower()
        if suffix == ".json":
            return _from_json(file, content)
        return _from_toml(file, content) if suffix == ".toml" else _from_lines(file, content)
    except ModelError as error:
        raise InputError(error.problems) from error


def _from_json(file: Path, content: bytes) -> HandFile:
    try:
        document = read_json(file, content)
    except ModelError as error:
        raise ModelError(f"{error}; in JSON a formula stands in quotes") from None
    return _from_data(file.name, document)


def _from_toml(file: Path, content: bytes) -> HandFile:
    """Read TOML, or matrices without quotes, which TOML forbids and people write."""
    try:
        return _from_data(file.name, read_toml(file, content))
    except ModelError as error:
        toml_problems = error.problems
    try:
        return _from_lines(file, content)
    except InputError as error:
        raise InputError([*error.problems, *toml_problems]) from error


def _from_lines(file: Path, content: bytes) -> HandFile:
    """Read statements ``name = value``, each as many lines long as its brackets need."""
    draft = _Draft(escaped(file.name))
    text = decoded(file, content).replace("\r\n", "\n").replace("\r", "\n")
    # Comments and quotes are blanked out, so that every offset stays.
    text = plain(re.sub(r"[#%][^\n]*", lambda found: " " * len(found[0]), text))
    places = TextPlaces(text)
    section: str | None = None
    offset = 0
    while offset < len(text):
        end = text.find("\n", offset)
        line = text[offset : end if end >= 0 else None]
        if header := _SECTION.match(text, offset):
            section = header[1]
            offset = header.end()
        elif found := _STATEMENT.match(text, offset):
            start, offset = found.end(), _value_end(text, found.end())
            if offset < 0:
                draft.problem(places[start], f"the quotes {text[start]} are never closed")
                break
            value = re.sub(r"[\"']", " ", text[start:offset]).rstrip("; \t\n")
            _add_statement(draft, section, found[1], value, places[start])
        else:
            if line.strip(" \t;"):
                draft.problem(
                    places[offset],
                    f"expected 'name = value', found {line.strip()[:40]!r}; names are "
                    f"{listed(ALL)}, and your own for aliases",
                )
            offset += len(line) + 1
    return draft.finished()


def _add_statement(
    draft: _Draft, section: str | None, name: str, value: str, place: TextPlace
) -> None:
    is_list = value.lstrip().startswith("[")
    if section == "conventions":
        draft.conventions[name] = value.strip()
    elif section == "transmission":
        names = [item.strip() for item in value.strip(" \t\n[]").split(",")]
        draft.add_end(name, names, place)
    elif name in COMPARED or (section is None and name in OF_TRANSMISSIONS and is_list):
        draft.add_matrix(name, value, place)
    elif section is None and name == "transmission":
        draft.add_transmission(value, place)
    elif section is None and name == "constraint":
        draft.constraint = value.strip()
    elif section != "aliases" and is_list:
        draft.unknown(name, place)
    else:
        draft.add_alias(name, value.strip(), place)


def _value_end(text: str, start: int) -> int:
    """Return where a value ends, by its quotes or brackets; -1 if its quotes are never closed."""
    for quote in _QUOTES:
        if text.startswith(quote, start):
            close = text.find(quote, start + len(quote))
            return close if close < 0 else close + len(quote)
    depth = 0
    for k in range(start, len(text)):
        depth += (text[k] in "([") - (text[k] in ")]")
        if text[k] == "\n" and depth <= 0 and not text[start:k].rstrip().endswith("..."):
            return k
        if depth > 0 and text[k] == "\n" and _STATEMENT.match(text, k + 1):
            # The next statement begins: the bracket was forgotten, and is reported for this one.
            return k
    return len(text)


def _from_data(name: str, document: Document) -> HandFile:
    """Read the values of TOML or JSON; a text is found again in the file for its place."""
    draft = _Draft(escaped(name))
    if not isinstance(document.data, dict):
        raise ModelError(
            document.problem((), f"expected names and values, not {shown(document.data)}")
        )
    places = TextPlaces(document.text)
    for key, value in document.data.items():
        locate = _Locator(document, places, (key,))
        if key in ALL:
            _add_data(draft, key, value, locate)
        elif key == "transmission" and isinstance(value, str):
            draft.add_transmission(value, locate.place(value))
        elif key == "transmission" and isinstance(value, dict):
            for end, names in value.items():
                own = names if isinstance(names, list) else [names]
                draft.add_end(end, [str(item).strip() for item in own], locate.place(""))
        elif key == "constraint" and isinstance(value, str):
            draft.constraint = value
        elif key == "conventions" and isinstance(value, dict):
            draft.conventions |= {name: str(text) for name, text in value.items()}
        elif key == "aliases" and isinstance(value, dict):
            for alias, expression in value.items():
                written = str(expression)
                place = _Locator(document, places, (key, alias)).place(written)
                draft.add_alias(alias, written, place)
        else:
            draft.unknown(key, locate.place(""))
    return draft.finished()


def _add_data(draft: _Draft, name: str, value: object, locate: _Locator) -> None:
    """Add a quantity given as a text, as a list of rows that are texts, or as lists of elements."""
    if isinstance(value, str):
        draft.add_matrix(name, value, locate.place(value))
        return
    rows = value if isinstance(value, list) else [value]
    is_flat = not any(isinstance(row, list) for row in rows)
    if is_flat and any(isinstance(row, str) and row.strip().startswith("[") for row in rows):
        draft.add_matrix(name, "[" + ",\n".join(map(str, rows)) + "]", locate.place(""))
        return
    cells = []
    for row in rows:
        elements = row if isinstance(row, list) else [row]
        for item in elements:
            if not isinstance(item, str | int | float) or isinstance(item, bool):
                text = f"{name}: {shown(item)} is not an element; expected a number or a text"
                draft.problem(locate.place(""), text)
                return
        cells.append(tuple(Cell(str(item), locate.place(str(item))) for item in elements))
    draft.add_matrix(name, tuple(cells), locate.place(""))


class _Locator:
    """Finds the texts of one key again in the file, one after the other."""

    def __init__(self, document: Document, places: TextPlaces, address: Address) -> None:
        self._text = document.text
        self._places = places
        key = str(address[-1])
        begin = places.begin(document.line(address))
        found = self._text.find(key, begin)
        self._cursor = begin if found < 0 else found + len(key)

    def place(self, fragment: str) -> TextPlace:
        """Return where a fragment begins; the last place if it is not found."""
        found = self._text.find(fragment, self._cursor) if fragment else -1
        if found >= 0:
            self._cursor = found
        return self._places[self._cursor]
