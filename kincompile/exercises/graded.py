"""The mark of one blank: points, the reason, and how both are written."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.exercises.blanks import Blank

RIGHT, EMPTY, UNREAD = "right", "not filled", "not read"
ROUNDED = "a number was rounded"
"""What marks are besides faults of the checker's catalogue."""


@dataclass(frozen=True, slots=True)
class Mark:
    """Points of a blank, with the reason.

    Attributes
    ----------
    blank
        What was to be filled.
    points
        1 where it is right, else 0.
    reason
        ``"right"``, ``"not filled"``, or what is wrong, without the right formula; of an answer
        that is right but for rounding and has its point, what was rounded.
    kind
        The fault in a few words, as the checker's catalogue has it, for statistics.
    answer
        What was handed in.
    question
        What was asked, as the hand-in file has it; "" in exercises of earlier versions.
    """

    blank: Blank
    points: int
    reason: str
    kind: str
    answer: str = ""
    question: str = ""

    @property
    def is_read(self) -> bool:
        """Whether the answer could be read; one that could not is no wrong answer."""
        return self.kind != UNREAD


def reasons(marks: Sequence[Mark], *, is_read: bool) -> str:
    """Return what is said of blanks, each reason once after the names of its blanks."""
    blanks: dict[str, list[str]] = {}
    for item in marks:
        if item.reason != RIGHT and item.is_read is is_read:
            blanks.setdefault(item.reason, []).append(item.blank.name)
    return "; ".join(f"{', '.join(names)}: {reason}" for reason, names in blanks.items())


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Return rows as CSV."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def cell(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
