"""The marks of a class: points and reasons of each blank, and what is made of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.exercises.feedback import feedback
from kincompile.exercises.gradebooks import gradebooks, read_roster
from kincompile.exercises.graded import cell, csv_text, reasons
from kincompile.exercises.statistics import has_handed_in, statistics
from kincompile.report.to_html import as_html
from kincompile.writing import write_atomically, write_folder

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from kincompile.exercises.graded import Mark
    from kincompile.exercises.statistics import Statistics


@dataclass(frozen=True, slots=True)
class Marks:
    """The marks of all students of an exercise.

    Attributes
    ----------
    folder
        The exercise.
    name
        Name of the mechanism.
    students
        The marks of each student by name.
    """

    folder: Path
    name: str
    students: Mapping[str, tuple[Mark, ...]]

    def to_csv(self) -> str:
        """Return a table: a line a student, with points, those of each blank, and reasons.

        A blank that cannot be read has ``?``, and its reason stands in a column of its own.
        """
        blanks = next(iter(self.students.values()))
        names = [item.blank.name for item in blanks]
        rows: list[list[object]] = [["student", "points", "of", *names, "reasons", "not read"]]
        for student, marks in self.students.items():
            points = [item.points if item.is_read else "?" for item in marks]
            rows.append([
                cell(student), sum(item.points for item in marks), len(marks), *points,
                *(cell(reasons(marks, is_read=is_read)) for is_read in (True, False)),
            ])  # fmt: skip
        return csv_text(rows)

    def statistics(self) -> Statistics:
        """Count outcomes and faults, by question: ``.to_text()``, ``.to_csv()``."""
        return statistics(self.name, self.students)

    def files(
        self, roster: str | os.PathLike[str] | None = None, title: str | None = None
    ) -> dict[str, str]:
        """Return the text of every file of the folder by its path; as for `write`."""
        known = None if roster is None else read_roster(roster, self.students)
        counted = self.statistics()
        found = {
            "points.csv": self.to_csv(),
            "statistics.txt": counted.to_text(),
            "statistics.csv": counted.to_csv(),
            "statistics.html": as_html(counted.page(), "Statistics of"),
            **gradebooks(self.students, known, title or self.name),
        }
        for student, own in self.students.items():
            if has_handed_in(own):
                page = feedback(self.name, student, own)
                found[f"feedback/{student}/feedback.html"] = as_html(page, "Feedback on")
        return found

    def write(
        self,
        path: str | os.PathLike[str],
        roster: str | os.PathLike[str] | None = None,
        title: str | None = None,
    ) -> Path:
        """Write the table, or a folder of points, statistics, feedback and gradebooks.

        Parameters
        ----------
        path
            A file, in one step; where it has no ending a new folder, whole or not at all.
        roster
            A table of the class with a column ``sheet``, the number of a student's folder, and
            those that a gradebook exports. Without it that number stands for the name.
        title
            The column of the gradebooks; the name of the mechanism where None.

        Raises
        ------
        InputError
            If it cannot be written, or the roster cannot be used.
        """
        if Path(path).suffix:
            return write_atomically(path, self.to_csv())
        return write_folder(path, lambda: self.files(roster, title))
