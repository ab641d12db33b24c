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
from kincompile.files.data_lines import json_lines, toml_lines

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from kincompile.files.data_lines import Address

MAX_BYTES = 16_000_000
"""Largest data file; a mechanism of 10,000 bodies has a quarter of this."""
MAX_PROBLEMS = 50
"""Problems that are listed; a broken file can have one a line."""

_FRACTION = re.compile(
    r'"(?:[^"\\\n]|\\.)*"|(?P<fraction>-?\d+(?:\.\d+)?\s*/\s*-?\d+(?:\.\d+)?)(?=\s*[,\]}])'
)


@dataclass(frozen=True)
class Document:
    """A data file.

    Attributes
    ----------
    file
        Its name, for messages.
    text
        Its text.
    data
        Its values: dicts, lists, texts, numbers, truth values.
    is_toml
        Whether it is TOML; JSON otherwise.
    """

    file: str
    text: str
    data: Any
    is_toml: bool

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
    rest = len(unique) - MAX_PROBLEMS
    return ModelError(unique[:MAX_PROBLEMS] + ([f"and {rest} more problems"] if rest > 0 else []))


def decoded(path: Path, content: bytes) -> str:
    """Return the text of a data file.

    Raises
    ------
    ModelError
        If it is too large, or not UTF-8.
    """
    if len(content) > MAX_BYTES:
        raise ModelError(
            f"{path}: the file has more than {MAX_BYTES:,} bytes, too many for a model"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ModelError(
            f"{path}, line {line}: this is not text in UTF-8 (byte 0x{content[error.start]:02x}); "
            "save the file as UTF-8"
        ) from None


def read_toml(path: Path, content: bytes) -> Document:
    """Read TOML.

    Raises
    ------
    ModelError
        If it is not TOML; the message has the line.
    """
    text = decoded(path, content)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, line = _toml_problem(str(error), text)
        raise ModelError(f"{path}, line {line}: this is not TOML: {what}") from None
    except RecursionError:
        raise ModelError(f"{path}, line 1: the file is nested too deeply") from None
    except ValueError:
        raise _too_long(path, text) from None
    return Document(str(path), text, data, is_toml=True)


def _too_long(path: Path, text: str) -> ModelError:
    """Return the error of a number that Python's readers refuse for its length."""
    digits = re.search(r"[\d_]{1000}", text)
    line = text[: digits.start() if digits else 0].count("\n") + 1
    return ModelError(f"{path}, line {line}: a number has thousands of digits")


def _toml_problem(message: str, text: str) -> tuple[str, int]:
    """Return the message of tomllib, and the line."""
    found = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", message, re.DOTALL)
    if found is None:
        return message.replace(" (at end of document)", ", the file ends here"), (
            text.rstrip().count("\n") + 1
        )
    return f"{found[1]}, column {found[3]}", int(found[2])


def read_json(path: Path, content: bytes, *, has_fractions: bool = False) -> Document:
    """Read JSON.

    Parameters
    ----------
    path, content
        The file, and its content.
    has_fractions
        Whether a number may be written 187/255; it is read as a text.

    Raises
    ------
    ModelError
        If it is not JSON, a key is given twice, or a number is not finite; with the line.
    """
    text = decoded(path, content)
    if has_fractions:
        text = _FRACTION.sub(_quoted, text)
    repeated: list[str] = []
    try:
        data = json.loads(
            text,
            object_pairs_hook=lambda pairs: _only_once(pairs, repeated),
            parse_constant=lambda name: _NotFinite(name),
        )
    except json.JSONDecodeError as error:
        raise ModelError(
            f"{path}, line {error.lineno}: this is not JSON: {error.msg}, column {error.colno}"
        ) from None
    except RecursionError:
        raise ModelError(f"{path}, line 1: the file is nested too deeply") from None
    except ValueError:
        raise _too_long(path, text) from None
    document = Document(str(path), text, data, is_toml=False)
    if repeated:
        raise listed_problems(_repetitions(document))
    return document


class _NotFinite(float):
    """NaN or Infinity, which JSON does not have and Python's reader takes."""

    def __new__(cls, name: str) -> _NotFinite:
        return super().__new__(cls, name.replace("Infinity", "inf"))


def _quoted(found: re.Match[str]) -> str:
    return found[0] if found["fraction"] is None else f'"{found[0]}"'


def _only_once(pairs: list[tuple[str, Any]], repeated: list[str]) -> dict[str, Any]:
    """Return an object, and note the keys that it has twice."""
    values = dict(pairs)
    if len(values) < len(pairs):
        repeated += [key for key, _ in pairs]
    return values


def _repetitions(document: Document) -> list[str]:
    """Return a message for each key that an object has twice."""
    first: dict[Address, int] = {}
    problems = []
    for address, line in json_lines(document.text):
        if address in first and isinstance(address[-1], str):
            problems.append(
                f"{document.file}, line {line}: the key {address[-1]!r} is given a second time, "
                f"after line {first[address]}; keep one of them"
            )
        first.setdefault(address, line)
    return problems
