"""The page that a student is handed back: what is right, what is wrong, what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.exercises.graded import EMPTY, RIGHT, UNREAD
from kincompile.exercises.statistics import outcome
from kincompile.report import document as doc

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.exercises.graded import Mark

ADVICE = {
    "wrong": "Go through the hints of the question on your page, derive the entry again, and "
    "compare it with your answer with the sentence above in mind.",
    UNREAD: "This is not counted as wrong. Write it as said above, and ask for it to be marked "
    "again.",
}
"""What to do with an answer."""


def feedback(name: str, student: str, marks: Sequence[Mark]) -> doc.Manuscript:
    """Return the page of one student; it has no right formulas but the student's own."""
    groups = {key: [item for item in marks if outcome(item) == key] for key in (
        RIGHT, "wrong", UNREAD, EMPTY,
    )}  # fmt: skip
    chapters = []
    if own := groups["wrong"]:
        parts = tuple(_part(item) for item in own)
        chapters.append(doc.Chapter("wrong", ("What is wrong",), (), parts))
    if own := groups[UNREAD]:
        parts = tuple(_part(item) for item in own)
        chapters.append(doc.Chapter("unread", ("What was not read",), (), parts))
    if own := groups[EMPTY]:
        names = ", ".join(item.blank.name for item in own)
        reasons = dict.fromkeys(item.reason for item in own)
        block = doc.text(f"{names}: {'; '.join(reasons)}.")
        chapters.append(doc.Chapter("empty", ("What is not filled",), (block,)))
    if own := groups[RIGHT]:
        rows: list[tuple[doc.Run | doc.Runs, ...]] = [
            (item.blank.name, item.question, doc.Verbatim(item.answer)) for item in own
        ]
        shown = doc.table(("question", "entry", "your answer"), rows)
        notes = [doc.text(f"{x.blank.name}: {x.reason}.") for x in own if x.reason != RIGHT]
        chapters.append(doc.Chapter("right", ("What is right",), (shown, *notes)))
    points = sum(item.points for item in marks)
    summary = f"Student {student}: {points} of {len(marks)} points."
    if groups[UNREAD]:
        summary += f" Not read, and not counted as wrong: {len(groups[UNREAD])}."
    return doc.Manuscript(name, summary, tuple(chapters))


def _part(mark: Mark) -> doc.Chapter:
    """Return the question, the answer, the reason and what to do."""
    blocks = [doc.text("Your answer: ", doc.Verbatim(mark.answer))] if mark.answer else []
    blocks += [doc.text(_sentence(mark.reason)), doc.text(ADVICE[outcome(mark)])]
    title = f"{mark.blank.name}: {mark.question}" if mark.question else mark.blank.name
    return doc.Chapter(f"answer-{mark.blank.name}", (title,), tuple(blocks))


def _sentence(reason: str) -> str:
    """Return a reason as a sentence."""
    end = "" if reason.endswith(".") else "."
    return f"{reason[:1].upper()}{reason[1:]}{end}"
