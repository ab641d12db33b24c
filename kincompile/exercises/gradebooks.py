"""Tables that the gradebooks of Moodle and Canvas import, with the names of a class.

Moodle asks at import which column says who a student is, which is a grade and which is feedback
(docs.moodle.org, Grade import). Canvas wants its own columns in their order, Student, ID, SIS User
ID, SIS Login ID, Section, then a column an assignment, and a second line with the points possible
(the importer of Canvas: lib/gradebook_importer.rb).
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.errors import InputError
from kincompile.exercises.graded import cell, csv_text, reasons
from kincompile.exercises.statistics import has_handed_in
from kincompile.files.content import decoded, file_content
from kincompile.names import listed

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.exercises.graded import Mark

MOST_BYTES = 5_000_000
"""Size of a roster above which it is not read."""

SHEET = "sheet"
"""The column of a roster with the number of a student's folder or sheet."""

MOODLE = {
    "First name": ("first name", "firstname"),
    "Last name": ("last name", "lastname", "surname"),
    "ID number": ("id number", "idnumber"),
    "Email address": ("email address", "email"),
    "Username": ("username",),
}
"""Columns by which Moodle may be asked to find a student, with their names in a roster."""

CANVAS = {
    "Student": ("student", "name"),
    "ID": ("id", "canvas id"),
    "SIS User ID": ("sis user id", *MOODLE["ID number"]),
    "SIS Login ID": ("sis login id", *MOODLE["Username"], *MOODLE["Email address"]),
    "Section": ("section",),
}
"""The columns of Canvas, in its order, with their names in a roster."""

Roster = dict[str, dict[str, str]]
"""What a roster has of each student, by the student's number."""


def read_roster(path: str | os.PathLike[str], students: Iterable[str]) -> Roster:
    """Read a table of students, with commas or semicolons, such as a gradebook exports.

    Raises
    ------
    InputError
        If it cannot be read, has no column ``sheet``, or a number twice or of no student.
    """
    file = Path(path)
    lines = decoded(file, file_content(file, MOST_BYTES)).lstrip("\ufeff").splitlines()
    header = lines[0] if lines else ""
    comma = ";" if header.count(";") > header.count(",") else ","
    by_number = {_number(item): item for item in students}
    found: Roster = {}
    try:
        rows = list(csv.reader(lines, delimiter=comma, strict=True))
    except csv.Error as error:
        raise InputError(f"{file} is no table: {error}; save it as CSV in UTF-8") from error
    names = [item.strip().lower() for item in rows[0]] if rows else []
    if SHEET not in names:
        raise InputError(
            f"{file} has no column {SHEET!r}: add one with the number of each student's folder or "
            "sheet"
        )
    for number, row in enumerate(rows[1:], 2):
        own = {name: text.strip() for name, text in zip(names, row, strict=False)}
        if not own.get(SHEET):
            continue  # as the line of points in an export of Canvas
        student = by_number.get(_number(own[SHEET]))
        if student is None or student in found:
            what = "is no sheet of this exercise" if student is None else "stands there twice"
            raise InputError(f"{file}, line {number}: sheet {own[SHEET]} {what}; mend the file")
        found[student] = own
    return found


def _number(student: str) -> str:
    return student.strip().lstrip("0")


def gradebooks(
    students: Mapping[str, Sequence[Mark]], roster: Roster | None, title: str
) -> dict[str, str]:
    """Return the tables for Moodle and for Canvas by their names.

    Without a roster the number of a student stands for all that is known. Who handed nothing in has
    no grade, which neither gradebook takes for a zero.

    Raises
    ------
    InputError
        If someone handed in who is not in the roster.
    """
    if roster is None:
        roster = {x: {"id number": x, "student": x, SHEET: x} for x in students}
    if left := [x for x, own in students.items() if has_handed_in(own) and x not in roster]:
        raise InputError(f"the roster has no line for sheets with answers: {listed(left)}; add it")
    known = {name for own in roster.values() for name, text in own.items() if text}
    moodle = {name: names for name, names in MOODLE.items() if known & set(names)}
    is_canvas = any(known & set(names) for names in CANVAS.values())
    if not moodle and not is_canvas:
        raise InputError(
            "the roster has no column by which a gradebook knows a student; add one, for instance "
            f"{listed(MOODLE)}"
        )
    grades = {x: _grade(students[x]) for x in roster}
    found = {}
    if moodle:
        rows: list[list[object]] = [[*moodle, cell(title), cell(f"{title} (feedback)")]]
        rows += [
            [*_named(own, moodle), grades[x], cell(_feedback(students[x]))]
            for x, own in roster.items()
        ]
        found["moodle.csv"] = csv_text(rows)
    if is_canvas:
        points = len(next(iter(students.values())))
        rows = [[*CANVAS, cell(title)]]
        rows.append(["    Points Possible", *[""] * (len(CANVAS) - 1), points])
        rows += [[*_named(_with_name(own), CANVAS), grades[x]] for x, own in roster.items()]
        found["canvas.csv"] = csv_text(rows)
    return found


def _grade(own: Sequence[Mark]) -> int | str:
    return sum(item.points for item in own) if has_handed_in(own) else ""


def _feedback(own: Sequence[Mark]) -> str:
    return "; ".join(filter(None, (reasons(own, is_read=x) for x in (True, False))))


def _named(own: Mapping[str, str], columns: Mapping[str, Sequence[str]]) -> list[str]:
    """Return what a roster has of a student in the columns of a gradebook."""
    return [
        cell(next((own[name] for name in names if own.get(name)), "")) for names in columns.values()
    ]


def _with_name(own: Mapping[str, str]) -> dict[str, str]:
    """Return a line of a roster with the name in one, as Canvas has it."""
    parts = _named(own, {name: MOODLE[name] for name in ("Last name", "First name")})
    return {"name": ", ".join(filter(None, parts)) or own[SHEET], **own}
