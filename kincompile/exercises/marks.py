"""The marks of a class: points and reasons of each blank, as a table."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING

from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from pathlib import Path

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
    """

    blank: Blank
    points: int
    reason: str
    kind: str
    answer: str = ""

    @property
    def is_read(self) -> bool:
        """Whether the answer could be read; one that could not is no wrong answer."""
        return self.kind != UNREAD


@dataclass(frozen=True, slots=True)
class Marks:
    """The marks of all students of an exercise.

    Attributes
    ----------
    folder
        The exercise.
    students
        The marks of each student by name; none where nothing was handed in.
    """

    folder: Path
    students: Mapping[str, tuple[Mark, ...]]

    def to_csv(self) -> str:
        """Return a table: a line a student, with points, those of each blank, and reasons.

        A blank that cannot be read has ``?``, and its reason stands in a column of its own.
        """
        blanks = next(iter(self.students.values()))
        rows = StringIO()
        table = csv.writer(rows, lineterminator="\n")
        names = [item.blank.name for item in blanks]
        table.writerow(["student", "points", "of", *names, "reasons", "not read"])
        for student, marks in self.students.items():
            points = [item.points if item.is_read else "?" for item in marks]
            table.writerow([
                cell(student), sum(item.points for item in marks), len(marks), *points,
                *(cell(_reasons(marks, is_read)) for is_read in (True, False)),
            ])  # fmt: skip
        return rows.getvalue()

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the table to a file, in one step."""
        return write_atomically(path, self.to_csv())


def _reasons(marks: Sequence[Mark], is_read: bool) -> str:
    """Return what is said of blanks, each reason once after the names of its blanks."""
    blanks: dict[str, list[str]] = {}
    for item in marks:
        if item.reason != RIGHT and item.is_read is is_read:
            blanks.setdefault(item.reason, []).append(item.blank.name)
    return "; ".join(f"{', '.join(names)}: {reason}" for reason, names in blanks.items())


def cell(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
