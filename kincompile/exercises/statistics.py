"""Which fault a class made how often, question by question: as text, as a table, as a page."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.exercises.graded import EMPTY, RIGHT, UNREAD, cell, csv_text
from kincompile.report import document as doc
from kincompile.tables import indented, table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.exercises.graded import Mark

OUTCOMES = (RIGHT, "wrong", UNREAD, EMPTY)
"""What an answer may be."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """How often each question was answered how, and each fault made.

    Attributes
    ----------
    name
        The exercise.
    students
        How many students handed something in, and how many there are.
    questions
        What each blank asks, by its name; "" where that differs from student to student.
    outcomes
        How often a question had an outcome, by both.
    faults
        How often a fault was made in a question, by both.
    """

    name: str
    students: tuple[int, int]
    questions: dict[str, str]
    outcomes: Counter[tuple[str, str]]
    faults: Counter[tuple[str, str]]

    @property
    def kinds(self) -> list[str]:
        """The faults, the most frequent first."""
        totals: Counter[str] = Counter()
        for (kind, _), count in self.faults.items():
            totals[kind] += count
        return sorted(totals, key=lambda kind: (-totals[kind], kind))

    @property
    def summary(self) -> str:
        """How many handed in, and the mean of their points."""
        handed_in, every = self.students
        points = sum(self.outcomes[name, RIGHT] for name in self.questions)
        mean = f"; mean {points / handed_in:.2f} of {len(self.questions)}" if handed_in else ""
        return f"{handed_in} of {every} students handed in{mean}."

    def rows_of_questions(self) -> list[list[str]]:
        """Return a row for each question: name, what is asked, and how often each outcome."""
        return [
            [name, text, *(str(self.outcomes[name, item]) for item in OUTCOMES)]
            for name, text in self.questions.items()
        ]

    def rows_of_faults(self) -> list[list[str]]:
        """Return a row for each fault: how often in all, and in each question."""
        rows = []
        for kind in self.kinds:
            counts = [self.faults[kind, name] for name in self.questions]
            rows.append([kind, str(sum(counts)), *map(str, counts)])
        return rows

    @property
    def headers(self) -> tuple[list[str], list[str]]:
        """The titles of both tables."""
        return ["question", "entry", *OUTCOMES], ["fault", "in all", *self.questions]

    def to_text(self) -> str:
        """Return both tables as text."""
        lines = [self.summary, ""]
        rows = (self.rows_of_questions(), self.rows_of_faults())
        for header, own in zip(self.headers, rows, strict=True):
            if own:
                lines += [*indented(table(header, own, right=header[-len(own[0]) + 1 :])), ""]
        return "\n".join(lines[:-1]) + "\n"

    def to_csv(self) -> str:
        """Return a line for each question and each fault made in it."""
        rows: list[list[object]] = [["question", "entry", "what", "times"]]
        for name, asked in self.questions.items():
            own = [(item, self.outcomes[name, item]) for item in OUTCOMES]
            own += [(f"fault: {kind}", self.faults[kind, name]) for kind in self.kinds]
            rows += [[name, cell(asked), what, times] for what, times in own]
        return csv_text(rows)

    def page(self) -> doc.Manuscript:
        """Return both tables as a page."""
        (questions, faults), rows = self.headers, (self.rows_of_questions(), self.rows_of_faults())
        chapters = [
            doc.Chapter(anchor, (title,), (doc.table(tuple(header), [tuple(x) for x in own]),))
            for anchor, title, header, own in (
                ("questions", "By question", questions, rows[0]),
                ("faults", "Which fault how often", faults, rows[1]),
            )
            if own
        ]
        return doc.Manuscript(self.name, self.summary, tuple(chapters))


def statistics(name: str, students: Mapping[str, Sequence[Mark]]) -> Statistics:
    """Count the outcomes and faults of a class."""
    every = list(students.values())
    questions: dict[str, str] = {}
    for own in zip(*every, strict=True):
        texts = {item.question for item in own}
        questions[own[0].blank.name] = texts.pop() if len(texts) == 1 else ""
    outcomes: Counter[tuple[str, str]] = Counter()
    faults: Counter[tuple[str, str]] = Counter()
    for marks in every:
        for item in marks:
            outcomes[item.blank.name, outcome(item)] += 1
            if outcome(item) == "wrong":
                faults[item.kind, item.blank.name] += 1
    handed_in = sum(has_handed_in(own) for own in every)
    return Statistics(name, (handed_in, len(every)), questions, outcomes, faults)


def outcome(mark: Mark) -> str:
    """Return what an answer is, one of `OUTCOMES`."""
    return mark.kind if mark.kind in OUTCOMES else "wrong"


def has_handed_in(marks: Sequence[Mark]) -> bool:
    """Return whether a student filled anything."""
    return any(item.kind != EMPTY for item in marks)
