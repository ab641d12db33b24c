"""A matrix as people write it, split into its elements, each with its place in the file.

Nested lists (``[[1, 0], [0, 1]]``) and the rows of MATLAB (``[1 0; 0 1]``, rows also on lines of
their own, ``...`` to continue one) are understood. The elements stay text: reading them is
`safe_expressions`' task.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.files.safe_expressions import ExpressionError, Place, unbalanced_bracket

if TYPE_CHECKING:
    from collections.abc import Callable

_OPERATORS = "+-*/^"


@dataclass(frozen=True, slots=True)
class Cell:
    """One element: its text, and where it begins in the file."""

    text: str
    place: Place


Rows = tuple[tuple[Cell, ...], ...]


def split_matrix(text: str, place: Place) -> Rows:
    """Split a matrix into rows of elements.

    Parameters
    ----------
    text
        For instance ``[[1, 0], [0, cos(phi)]]``, ``[1 0; 0 cos(phi)]`` or one expression.
    place
        Where the text begins in the file.

    Raises
    ------
    ExpressionError
        If brackets do not match, or an element is missing.
    """
    splitter = _Splitter(text, place)
    unmatched = unbalanced_bracket(text)
    if unmatched is not None:
        raise splitter.error(*unmatched)
    return splitter.rows()


class _Splitter:
    """One text; spans are pairs of offsets into it."""

    def __init__(self, text: str, place: Place) -> None:
        # Same length, so that offsets stay: x.*y, x./y, x.^y of MATLAB; its continued lines.
        self._text = re.sub(r"(?<![0-9])\.(?=[*/^])", " ", text)
        self._text = re.sub(r"\.\.\.[ \t]*\n", lambda found: " " * len(found[0]), self._text)
        self._place = place

    def rows(self) -> Rows:
        inner = self._inner(self._trimmed(0, len(self._text)))
        start, end = inner
        if self._text.startswith("[", start):
            spans = [self._inner(span) for span in self._nested(start, end)]
        else:
            spans = self._split(start, end, self._ends_row)
        return tuple(self._row(span) for span in spans)

    def error(self, problem: str, offset: int) -> ExpressionError:
        place = self._at(offset)
        return ExpressionError(problem, place.line, place.column)

    def _at(self, offset: int) -> Place:
        before = self._text[:offset]
        line = before.count("\n")
        first = self._place.column if line == 0 else 1
        return Place(self._place.line + line, offset - (before.rfind("\n") + 1) + first)

    def _trimmed(self, start: int, end: int) -> tuple[int, int]:
        while start < end and self._text[start].isspace():
            start += 1
        while end > start and self._text[end - 1].isspace():
            end -= 1
        return start, end

    def _inner(self, span: tuple[int, int]) -> tuple[int, int]:
        """Take off the brackets around a span."""
        start, end = self._trimmed(*span)
        if self._text.startswith("[", start) and self._closing(start) == end - 1:
            return self._trimmed(start + 1, end - 1)
        return start, end

    def _closing(self, start: int) -> int:
        depth = 0
        for k in range(start, len(self._text)):
            depth += (self._text[k] in "([") - (self._text[k] in ")]")
            if depth == 0:
                return k
        raise AssertionError("brackets were balanced before")

    def _nested(self, start: int, end: int) -> list[tuple[int, int]]:
        """Return the bracketed rows of a nested list."""
        spans = []
        k = start
        while k < end:
            if self._text[k] == "[":
                close = self._closing(k)
                spans.append((k, close + 1))
                k = close
            elif not (self._text[k].isspace() or self._text[k] in ",;"):
                raise self.error(
                    f"found {self._text[k]!r}, where the next row in brackets was expected", k
                )
            k += 1
        return spans

    def _row(self, span: tuple[int, int]) -> tuple[Cell, ...]:
        start, end = span
        spans = self._split(start, end, self._is_comma)
        if len(spans) == 1:
            spans = self._split(*spans[0], self._separates)
        return tuple(self._cell(*item) for item in spans)

    def _cell(self, start: int, end: int) -> Cell:
        start, end = self._trimmed(start, end)
        if start == end:
            raise self.error("an element is missing here", start)
        return Cell(self._text[start:end], self._at(start))

    def _split(
        self, start: int, end: int, is_end: Callable[[int, int], bool]
    ) -> list[tuple[int, int]]:
        """Split a span outside of brackets, where `is_end(offset, start)` says so."""
        spans = []
        depth, first = 0, start
        for k in range(start, end):
            depth += (self._text[k] in "([") - (self._text[k] in ")]")
            if depth == 0 and is_end(k, first):
                spans.append((first, k))
                first = k + 1
        rest = self._trimmed(first, end)
        if rest[0] < rest[1] or not spans:
            spans.append((first, end))
        return spans

    def _is_comma(self, k: int, first: int) -> bool:
        del first
        return self._text[k] == ","

    def _ends_row(self, k: int, first: int) -> bool:
        """Tell whether a row ends here: at a semicolon, or at a line end where it is complete."""
        if self._text[k] == ";":
            return True
        before = self._text[first:k].strip()
        return self._text[k] == "\n" and before != "" and before[-1] not in _OPERATORS + ",("

    def _separates(self, k: int, first: int) -> bool:
        """Tell whether a blank separates two elements, by the rule of MATLAB.

        ``a - b`` and ``a-b`` are one element, ``a -b`` is two.
        """
        if not self._text[k].isspace():
            return False
        before, after = self._text[first:k].rstrip(), self._text[k + 1 :]
        if not before or before[-1] in _OPERATORS or not after or after[0].isspace():
            return False
        if after[0] in "*/^":
            return False
        return not (after[0] in "+-" and after[1:2].isspace())
