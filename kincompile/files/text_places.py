"""Where something stands in a text, by line and column."""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TextPlace:
    """Where a text begins in the file it comes from; line and column count from 1."""

    line: int = 1
    column: int = 1


class TextPlaces:
    """The places of the characters of a text; each is found by bisection."""

    def __init__(self, text: str, first: TextPlace | None = None) -> None:
        self._first = first or TextPlace()
        self._ends = [found.start() for found in re.finditer("\n", text)]

    def begin(self, line: int) -> int:
        """Return the offset of the first character of a line of the text."""
        return self._ends[line - 2] + 1 if line > 1 else 0

    def __getitem__(self, offset: int) -> TextPlace:
        """Return the place of the character with an offset."""
        lines = bisect_left(self._ends, offset)
        if not lines:
            return TextPlace(self._first.line, self._first.column + offset)
        return TextPlace(self._first.line + lines, offset - self._ends[lines - 1])
