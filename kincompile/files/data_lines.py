"""The line of each value in a TOML or JSON text.

The texts have been read before, so they are known to be well formed: what is scanned here is their
outline, strings, brackets, keys and line ends.
"""

from __future__ import annotations

import json
import re
import tomllib
from typing import TYPE_CHECKING

from kincompile.files.text_places import TextPlaces

if TYPE_CHECKING:
    from collections.abc import Iterator

Address = tuple[str | int, ...]
"""The keys and indices that lead to a value, for instance ``("bodies", 0, "guess")``."""

# Possessive: a text of some megabytes, matched otherwise, would take a hundred times its memory.
JSON_TEXT = r'"[^"\\]*+(?:\\.[^"\\]*+)*+"'
TEXT = r'"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+"'
LITERAL = r"'[^'\n]*+'"
LONG_TEXTS = r'"""(?:[^\\]|\\.)*?"{3,5}|' + r"'''.*?'{3,5}"
"""Texts in quotes, of JSON and the four kinds of TOML."""

_TOKEN = re.compile(
    rf"{LONG_TEXTS}|{TEXT}|{LITERAL}|" + r"#[^\n]*|\n|[\[\]{},:=.]|[^\s\[\]{},:=.#\"']+", re.DOTALL
)
_JSON_TOKEN = re.compile(JSON_TEXT + r'|[\[\]{},:]|[^\s\[\]{},:"]+', re.DOTALL)


def json_lines(text: str) -> Iterator[tuple[Address, int]]:
    """Yield the address and line of each value of a JSON text, in order; a key twice if it is."""
    places = TextPlaces(text)
    outline = _Outline(())
    for found in _JSON_TOKEN.finditer(text):
        place = outline.take(found[0], ":")
        if place is not None:
            yield place, places[found.start()].line


class _Outline:
    """Follows brackets, keys and commas through one value."""

    def __init__(self, base: Address) -> None:
        self._stack: list[list[str | int | None]] = []
        self._base = base
        self._key: list[str] = []

    @property
    def depth(self) -> int:
        """How many brackets are open."""
        return len(self._stack)

    def take(self, token: str, separator: str) -> Address | None:
        """Return the address of the value that a token begins, None where it begins none."""
        inside = self._stack[-1] if self._stack else None
        if token in ("}", "]"):
            if inside is not None:
                self._stack.pop()
            return None
        if token == "," and inside is not None:
            inside[1] = inside[1] + 1 if isinstance(inside[1], int) else None
            return None
        if inside is not None and inside[0] == "{" and inside[1] is None:
            return self._take_key(token, separator, inside)
        address = (*self._base, *(key for _, key in self._stack if key is not None))
        if token in ("{", "["):
            self._stack.append([token, None if token == "{" else 0])
        return address

    def _take_key(
        self, token: str, separator: str, inside: list[str | int | None]
    ) -> Address | None:
        """Collect a key; it is complete at the separator."""
        if token == separator:
            inside[1], self._key = ".".join(self._key), []
        elif token != ".":
            self._key.append(_unquoted(token))
        return None


def toml_lines(text: str) -> dict[Address, int]:
    """Return the line of each value of a TOML text by its address."""
    return dict(_TomlScan(text).run())


class _TomlScan:
    """Goes through the statements of a TOML text: table headers and ``key = value``."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._places = TextPlaces(text)
        self._counts: dict[Address, int] = {}
        self._table: Address = ()

    def run(self) -> Iterator[tuple[Address, int]]:
        """Yield address and line of each value, in order."""
        statement: list[str] = []
        outline: _Outline | None = None
        for found in _TOKEN.finditer(self._text):
            token = found[0]
            if token[0] == "#" or (token == "\n" and outline is not None and outline.depth):
                continue
            if token == "\n":
                yield from self._header(statement, found.start())
                statement, outline = [], None
            elif outline is not None:
                place = outline.take(token, "=")
                if place is not None:
                    yield place, self._places[found.start()].line
            elif token == "=" and statement[:1] != ["["]:
                outline = _Outline((*self._table, *_key(statement)))
            else:
                statement.append(token)
        yield from self._header(statement, len(self._text))

    def _header(self, statement: list[str], end: int) -> Iterator[tuple[Address, int]]:
        """Enter the table that a statement ``[a.b]`` or ``[[a.b]]`` opens."""
        if statement[:1] != ["["]:
            return
        is_array = statement[1:2] == ["["]
        *above, last = _key([token for token in statement if token not in ("[", "]")])
        address: Address = ()
        for part in above:
            address = self._entered((*address, part))
        address = (*address, last)
        if is_array:
            self._counts[address] = self._counts.get(address, -1) + 1
        self._table = self._entered(address)
        yield self._table, self._places[end].line

    def _entered(self, address: Address) -> Address:
        """Return the address of a table; of an array of tables, that of its last one."""
        return (*address, self._counts[address]) if address in self._counts else address


def _key(tokens: list[str]) -> list[str]:
    return [_unquoted(token) for token in tokens if token != "."]


def _unquoted(token: str) -> str:
    if token[0] == '"':
        try:
            return str(json.loads(token))
        except ValueError:  # escapes of TOML that JSON does not have
            return str(tomllib.loads(f"x = {token}")["x"])
    return token[1:-1] if token[0] == "'" else token
