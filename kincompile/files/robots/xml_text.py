"""The text of an XML file as elements with their lines.

A document type may declare entities, which grow or name other files, so it is refused at once.
Nothing is fetched, and what is read is bounded before effort is spent.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from xml.parsers import expat

from kincompile.errors import ModelError
from kincompile.files.content import decoded
from kincompile.files.data_text import listed_problems
from kincompile.names import escaped, shown

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MOST_ELEMENTS, MOST_LEVELS = 100_000, 200
"""Elements of a file, and elements within each other."""
LONGEST_NAME = 200
"""Characters of a name."""
LARGEST = 1e9
"""Largest number: no robot has lengths, angles or masses beyond it."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


@dataclass(slots=True)
class Element:
    """An element, with the line where it begins."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def all(self, *tags: str) -> Iterator[Element]:
        """Yield the children with these tags."""
        return (child for child in self.children if child.tag in tags)

    def one(self, *tags: str) -> Element | None:
        """Return the first child with one of these tags."""
        return next(self.all(*tags), None)


def read_xml(path: Path, content: bytes) -> Element:
    """Return the root element of an XML file.

    Raises
    ------
    ModelError
        If it is not XML, has a document type, or is too large or too deep; with the line.
    """
    text = decoded(path, content)
    parser = expat.ParserCreate()
    stack = [Element("", {}, 1)]
    count = 0

    def refuse(problem: str) -> None:
        raise ModelError(f"{escaped(path)}, line {parser.CurrentLineNumber}: {problem}")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1 + len(attributes)
        if count > MOST_ELEMENTS:
            refuse(f"the file has more than {MOST_ELEMENTS:,} elements and attributes")
        if len(stack) > MOST_LEVELS:
            refuse(f"the file is nested too deeply, more than {MOST_LEVELS} levels")
        if len(attributes.get("name", "")) > LONGEST_NAME:
            refuse(f"a name has more than {LONGEST_NAME} characters; shorten it")
        element = Element(tag, attributes, parser.CurrentLineNumber)
        stack[-1].children.append(element)
        stack.append(element)

    def document_type(*given: Any) -> None:
        del given
        refuse("a document type (<!DOCTYPE ...>) is not read; remove it, and its entities")

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda tag: stack.pop()
    parser.StartDoctypeDeclHandler = document_type
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        what = expat.ErrorString(error.code)
        raise ModelError(
            f"{escaped(path)}, line {error.lineno}: this is not XML: {what}; correct it there"
        ) from None
    return stack[0].children[0]


class XmlReader:
    """Reads attributes of elements; problems are collected, with file and line."""

    def __init__(self, path: Path) -> None:
        self.file = escaped(path)
        self.problems: list[str] = []

    def problem(self, line: int, text: str) -> None:
        """Note what is wrong at a line."""
        self.problems.append(f"{self.file}, line {line}: {text}")

    def raise_problems(self) -> None:
        """Raise what was noted.

        Raises
        ------
        ModelError
            If there are problems.
        """
        if self.problems:
            raise listed_problems(self.problems)

    def name(self, element: Element, key: str = "name") -> str:
        """Return a name, "" with a problem where it is missing."""
        found = element.attributes.get(key, "").strip()
        if not found:
            self.problem(element.line, f'<{element.tag}> has no {key}; write {key}="..."')
        return found

    def numbers(
        self, element: Element | None, key: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return as many numbers as the default has; the default where there is no attribute."""
        given = None if element is None else element.attributes.get(key)
        if element is None or given is None:
            return default
        words = given.split()
        where, count = f"{key} of <{element.tag}>", len(default)
        if len(words) != count:
            self.problem(element.line, f"{where} is {shown(given)}: give {count} numbers")
            return default
        for word in words:
            value = float(word) if _NUMBER.fullmatch(word) and len(word) < 60 else math.nan
            if not abs(value) <= LARGEST:
                what = "a number" if math.isnan(value) else f"a number of at most {LARGEST:g}"
                self.problem(
                    element.line, f"{where} is {shown(given)}: {shown(word)} is not {what}"
                )
                return default
        return tuple(map(float, words))

    def number(self, element: Element | None, key: str, default: float) -> float:
        """Return a number."""
        return self.numbers(element, key, (default,))[0]

    def direction(
        self, element: Element | None, key: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return a unit vector."""
        given = self.numbers(element, key, default)
        length = math.hypot(*given)
        if element is not None and length < 1e-9:
            text = "the axis is zero; give a direction, such as 0 0 1"
            self.problem(element.line, text)
            return default
        return tuple(x / length for x in given)
