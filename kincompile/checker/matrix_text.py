"""A matrix as people write it, split into its elements, each with its place in the file.

Nested lists (``[[1, 0], [0, 1]]``) and the rows of MATLAB (``[1 0; 0 1]``, rows also on lines of
their own, ``...`` to continue one) are understood. The elements stay text: `safe_expressions`
reads them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

from kincompile.checker.notation import plain
from kincompile.files.formula_text import ExpressionError, unbalanced_bracket
from kincompile.files.text_places import TextPlaces

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.files.text_places import TextPlace

_OPERATORS = "+-*/^"


@dataclass(frozen=True, slots=True)
class Cell:
    """One element: its text, and where it begins in the file."""

    text: str
    place: TextPlace


Rows = tuple[tuple[Cell, ...], ...]
Span = tuple[int, int]
"""Begin and end of a part of the text."""


def split_matrix(text: str, place: TextPlace) -> Rows:
    """Split a matrix into rows of elements.

    Parameters
    ----------
    text
        For instance ``[[1, 0], [0, cos(phi)]]``, ``[1 0; 0 cos(phi)]`` or one expression.

    Raises
    ------
    ExpressionError
        If brackets do not match, or an element is missing.
    """
    return _Splitter(plain(text), place).rows()


class _Splitter:
    def __init__(self, text: str, place: TextPlace) -> None:
        self._places = TextPlaces(text, place)
        # Same length, so that offsets stay: x.*y, x./y, x.^y of MATLAB; its continued lines.
        text = re.sub(r"(?<![0-9])\.(?=[*/^])", " ", text)
        self._text = re.sub(r"\.\.\.[ \t]*\n", lambda found: " " * len(found[0]), text)
        if unmatched := unbalanced_bracket(text):
            raise self._error(*unmatched)
        steps = ((character in "([") - (character in ")]") for character in text)
        # Number of brackets open before each character, and at the end.
        self._depth = list(accumulate(steps, initial=0))
        # Offset of the last character before each that is no blank; -1 where there is none.
        filled = (-1 if character.isspace() else k for k, character in enumerate(self._text))
        self._last = list(accumulate(filled, max, initial=-1))

    def rows(self) -> Rows:
        start, end = self._inner((0, len(self._text)))
        if self._text.startswith("[", start):
            spans = [self._inner(span) for span in self._bracketed_rows(start, end)]
        else:
            spans = self._split((start, end), self._ends_row)
        return tuple(self._row(span) for span in spans)

    def _error(self, problem: str, offset: int) -> ExpressionError:
        place = self._places[offset]
        return ExpressionError(problem, place.line, place.column)

    def _trimmed(self, span: Span) -> Span:
        text = self._text[slice(*span)]
        start = span[0] + len(text) - len(text.lstrip())
        return start, max(start, span[0] + len(text.rstrip()))

    def _inner(self, span: Span) -> Span:
        start, end = self._trimmed(span)
        if self._text.startswith("[", start) and self._after_bracket(start) == end:
            return self._trimmed((start + 1, end - 1))
        return start, end

    def _after_bracket(self, start: int) -> int:
        return self._depth.index(self._depth[start], start + 1)

    def _bracketed_rows(self, start: int, end: int) -> list[Span]:
        spans = []
        while start < end:
            if self._text[start] == "[":
                spans.append((start, self._after_bracket(start)))
                start = spans[-1][1]
            elif self._text[start].isspace() or self._text[start] in ",;":
                start += 1
            else:
                found = self._text[start]
                raise self._error(
                    f"found {found!r}, where the next row in brackets was expected", start
                )
        return spans

    def _row(self, span: Span) -> tuple[Cell, ...]:
        spans = self._split(span, lambda k, _: self._text[k] == ",")
        if len(spans) == 1:
            spans = self._split(spans[0], self._separates)
        return tuple(self._cell(self._trimmed(item)) for item in spans)

    def _cell(self, span: Span) -> Cell:
        start, end = span
        if start == end:
            raise self._error("an element is missing here", start)
        return Cell(self._text[start:end], self._places[start])

    def _split(self, span: Span, is_end: Callable[[int, int], bool]) -> list[Span]:
        """Split a span outside of brackets, wherever `is_end(offset, start of the part)` holds."""
        start, end = span
        spans: list[Span] = []
        level = self._depth[start]
        for k in range(start, end):
            if self._depth[k + 1] == level and is_end(k, start):
                spans.append((start, k))
                start = k + 1
        if not spans or self._text[start:end].strip():
            spans.append((start, end))
        return spans

    def _ends_row(self, k: int, first: int) -> bool:
        """Return whether a row ends here: at a semicolon, or at a line end if it is complete."""
        if self._text[k] == "\n":
            before = self._last_before(k, first)
            return before != "" and before not in _OPERATORS + ",("
        return self._text[k] == ";"

    def _separates(self, k: int, first: int) -> bool:
        """Return whether a blank separates two elements, by the rule of MATLAB.

        ``a - b`` and ``a-b`` are one element, ``a -b`` is two.
        """
        if not self._text[k].isspace():
            return False
        before, after = self._last_before(k, first), self._text[k + 1 : k + 3]
        if not before or not after or after[0].isspace():
            return False
        is_sign = after[0] in "+-" and not after[1:2].isspace()
        return before not in _OPERATORS and (after[0] not in _OPERATORS or is_sign)

    def _last_before(self, k: int, first: int) -> str:
        """Return the last character before `k` that is no blank, "" where a part has none yet."""
        return self._text[self._last[k]] if self._last[k] >= first else ""
