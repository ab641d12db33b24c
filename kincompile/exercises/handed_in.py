"""What is handed in through a course's own system: whose sheet it is, and its marks.

Every grader calls `marked`; nothing that a student handed in is run or imported.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from kincompile.exercises.gradebooks import CANVAS, SHEET, read_roster
from kincompile.exercises.marking import MOST_BYTES, marks_of, read_key
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from kincompile.exercises.graded import Mark
    from kincompile.exercises.marking import Key

ROSTER = "roster.csv"
"""Who has which sheet, beside the folder of the instructor."""

IDENTITY = {*CANVAS["SIS User ID"], *CANVAS["SIS Login ID"]}
"""Columns of a roster that belong to one student alone."""

_SHEET = re.compile(r"\s*sheet\s*=\s*0*(\d{1,6})\s*", re.IGNORECASE)


def marked(
    folder: Path, lines: Sequence[str], who: Iterable[str] = (), problem: str = ""
) -> tuple[Mark, ...]:
    """Return the marks of what a student handed in.

    Parameters
    ----------
    folder
        It has the folder of the instructor, and ``roster.csv`` where there is one.
    lines
        ``B1 = ...``, and ``sheet = 01`` where there are several sheets and no roster.
    who
        What the system knows of the student: address, user name, number.
    problem
        What is wrong with the whole of it.

    Raises
    ------
    InputError
        If the folder is no exercise, or the roster cannot be used.
    """
    key = read_key(folder)
    student, missed = _student_of(folder, key, lines, [str(x).strip().lower() for x in who if x])
    problem = problem or missed
    return marks_of(folder, key, student, [] if problem else lines, problem)


def _student_of(
    folder: Path, key: Key, lines: Sequence[str], who: Sequence[str]
) -> tuple[str, str]:
    """Return the sheet that is marked, and why there is none: then it is the first."""
    students = list(key.blanks)
    roster = read_roster(folder / ROSTER, students) if (folder / ROSTER).exists() else {}
    known = {
        student: {text.lower() for name, text in own.items() if name in IDENTITY and text}
        for student, own in roster.items()
    }
    if any(known.values()):  # the roster decides, whatever a hand-in says
        own = [student for student, names in known.items() if names.intersection(who)]
        if len(own) == 1:
            return own[0], ""
        name = listed(who) if who else "you"
        return students[0], f"{ROSTER} has no sheet for {name}; ask your teacher to add it"
    if len(students) == 1:
        return students[0], ""
    numbers = {int(found[1]) for line in lines if (found := _SHEET.fullmatch(line))}
    said = [student for student in students if int(student) in numbers]
    if len(said) == 1:
        return said[0], ""
    return students[0], f"no sheet is named; write the line {SHEET} = N, with your number"


def raw_lines(cells: Iterable[Any]) -> tuple[list[str], str]:
    """Return the lines of the raw cells of a notebook, and what is wrong with them."""
    text = "\n".join(str(cell["source"]) for cell in cells if cell["cell_type"] == "raw")
    if len(text) > MOST_BYTES:
        return [], f"the answers have more than {MOST_BYTES:,} bytes"
    return text.splitlines(), ""
