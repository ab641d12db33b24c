"""The text of a data file, TOML or JSON, as nested values with their lines.

Nothing in a data file is run. Python's own readers give the values and no places; the lines are
looked up in the text when a message needs them, so that a good file does not pay for them.
"""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from kincompile.errors import ModelError
from kincompile.files.content import decoded
from kincompile.files.data_lines import JSON_TEXT, LITERAL, LONG_TEXTS, TEXT, json_lines, toml_lines
from kincompile.names import escaped, shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from kincompile.files.data_lines import Address

MAX_VALUES = 500_000
"""Values in a file; a mechanism of 10,000 bodies has about half of this."""
MAX_LINES = 500_000
"""Lines in a file, comments too: Python's reader of TOML takes two microseconds for each."""
MAX_NESTING = 32
"""Lists and tables within each other."""
MAX_KEY_PARTS = 4
"""Parts of a dotted key: Python's reader of TOML takes time and memory with their square."""
MAX_PROBLEMS = 50
"""Problems that are listed; a broken file can have one a line."""

_FOREIGN = re.compile(
    rf"(?P<key>{TEXT}(?=\s*+:))|{TEXT}?|"
    + r"(?P<fraction>(?<![\w.])-?\d{1,40}+(?:\.\d{1,40}+)?\s*+/\s*+"
    r"-?\d{1,40}+(?:\.\d{1,40}+)?)(?=\s*[,\]}])"
)
_PART = rf"(?>[\w-]++|{TEXT}|{LITERAL})"
_TOML_OUTLINE = re.compile(
    LONG_TEXTS + r'|(?P<unclosed>"""|' + r"''')|"
    rf"(?P<key>{_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{MAX_KEY_PARTS}}})|{_PART}|"
    r"#[^\n]*+|(?P<open>[\[{])|(?P<close>[\]}])",
    re.DOTALL,
)
_JSON_OUTLINE = re.compile(JSON_TEXT + r"?|(?P<open>[\[{])|(?P<close>[\]}])", re.DOTALL)
"""What opens and closes; texts are passed over, each character a bounded number of times."""
_DIGITS = re.compile(r"(?<![\d_])[\d_]{1000}")
"""A number that Python's readers refuse for its length, or take much memory for."""


@dataclass(frozen=True)
class Document:
    """A data file."""

    file: str
    text: str
    data: Any  # its values: dicts, lists, texts, numbers, truth values
    is_toml: bool  # whether it is TOML; JSON otherwise

    @cached_property
    def lines(self) -> Mapping[Address, int]:
        """The line of each value by its address, the keys and indices that lead to it."""
        return toml_lines(self.text) if self.is_toml else dict(json_lines(self.text))

    def line(self, address: Sequence[str | int]) -> int:
        """Return the line of a value; of one that is missing, that of what it is missing in."""
        address = tuple(address)
        while address and address not in self.lines:
            address = address[:-1]
        return self.lines.get(address, 1)

    def problem(self, address: Sequence[str | int], text: str) -> str:
        """Return a message with file and line."""
        return f"{self.file}, line {self.line(address)}: {text}"


def listed_problems(problems: Sequence[str]) -> ModelError:
    """Return the error that lists problems, the first of very many."""
    unique = list(dict.fromkeys(problems))
    is_rest = len(unique) > MAX_PROBLEMS
    more = [f"and more: these are the first {MAX_PROBLEMS}"] if is_rest else []
    return ModelError(unique[:MAX_PROBLEMS] + more)


def _check_bounds(path: Path, text: str, outline: re.Pattern[str]) -> None:
    """Refuse what would take a reader much time or memory, before it begins.

    Raises
    ------
    ModelError
        If the text has too many values or lines, numbers of too many digits, keys of too many
        parts, lists too deep in each other, or a text of several lines that does not end; with the
        line.
    """
    if sum(text.count(mark) for mark in ",=[{") > MAX_VALUES:
        raise ModelError(f"{escaped(path)}: the file has more than {MAX_VALUES:,} values")
    if text.count("\n") > MAX_LINES:
        raise ModelError(f"{escaped(path)}: the file has more than {MAX_LINES:,} lines")
    if digits := _DIGITS.search(text):
        raise _problem(path, text, digits.start(), "a number has thousands of digits")
    depth = 0
    for found in outline.finditer(text):
        kind, problem = found.lastgroup, ""
        if kind is None:
            continue
        depth += (kind == "open") - (kind == "close")
        if depth > MAX_NESTING:
            problem = f"the file is nested too deeply, more than {MAX_NESTING} levels"
        elif kind == "unclosed":
            problem = f"this is not TOML: this {found[0]} opens a text that is never closed"
        elif kind == "key":
            problem = f"the key {shown(found[0])} has more than {MAX_KEY_PARTS} parts"
        if problem:
            raise _problem(path, text, found.start(), problem)


def _problem(path: Path, text: str, offset: int, problem: str) -> ModelError:
    line = text.count("\n", 0, offset) + 1
    return ModelError(f"{escaped(path)}, line {line}: {problem}")


def read_toml(path: Path, content: bytes) -> Document:
    """Read TOML.

    Raises
    ------
    ModelError
        If it is not TOML; the message has the line.
    """
    text = decoded(path, content)
    _check_bounds(path, text, _TOML_OUTLINE)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, line = _toml_problem(str(error), text)
        raise ModelError(f"{escaped(path)}, line {line}: this is not TOML: {what}") from None
    return Document(escaped(path), text, data, is_toml=True)


def _toml_problem(message: str, text: str) -> tuple[str, int]:
    """Return the message of tomllib, and the line."""
    found = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", message, re.DOTALL)
    if found is None:
        return message.replace(" (at end of document)", ", the file ends here"), (
            text.rstrip().count("\n") + 1
        )
    return f"{escaped(found[1][:200])}, column {found[3]}", int(found[2])


def read_json(path: Path, content: bytes, words: Mapping[str, str] | None = None) -> Document:
    """Read JSON.

    Parameters
    ----------
    words
        Of a foreign format its keys, by their lower case: they are read without regard to case, and
        a number may be written 187/255, which is read as a text. None for JSON itself.

    Raises
    ------
    ModelError
        If it is not JSON, has too many values, gives a key twice, or a number is not finite; with
        the line.
    """
    text = decoded(path, content)
    _check_bounds(path, text, _JSON_OUTLINE)
    if words is not None:
        # Four quotes for a key with its text, without those inside a text.
        if text.count('"') - text.count('\\"') > 4 * MAX_VALUES:
            raise ModelError(f"{escaped(path)}: the file has more than {2 * MAX_VALUES:,} texts")
        text = _FOREIGN.sub(lambda found: _native(found, words), text)
    repeated: list[str] = []
    try:
        data = json.loads(
            text,
            object_pairs_hook=lambda pairs: _only_once(pairs, repeated),
            parse_constant=lambda name: _NotFinite(name),
        )
    except json.JSONDecodeError as error:
        raise ModelError(
            f"{escaped(path)}, line {error.lineno}: this is not JSON: {error.msg}, "
            f"column {error.colno}"
        ) from None
    document = Document(escaped(path), text, data, is_toml=False)
    if repeated:
        raise listed_problems(_repetitions(document))
    return document


class _NotFinite(float):
    """NaN or Infinity, which JSON does not have and Python's reader takes."""

    def __new__(cls, name: str) -> _NotFinite:
        return super().__new__(cls, name.replace("Infinity", "inf"))


def _native(found: re.Match[str], words: Mapping[str, str]) -> str:
    """Return a key as it is known here, which is as long; a fraction as a text."""
    if found["key"] is not None:
        return f'"{words.get(found[0][1:-1].lower(), found[0][1:-1])}"'
    return found[0] if found["fraction"] is None else f'"{found[0]}"'


def _only_once(pairs: list[tuple[str, Any]], repeated: list[str]) -> dict[str, Any]:
    """Return an object, and note the keys that it has twice."""
    values = dict(pairs)
    if len(values) < len(pairs):
        repeated += [key for key, _ in pairs]
    return values


def _repetitions(document: Document) -> list[str]:
    first: dict[Address, int] = {}
    problems = []
    for address, line in json_lines(document.text):
        if address in first and isinstance(address[-1], str):
            problems.append(
                f"{document.file}, line {line}: the key {shown(address[-1])} is given a second "
                f"time, after line {first[address]}; keep one of them"
            )
        first.setdefault(address, line)
    return problems
