"""The functions of a PrairieLearn question's ``server.py``: a sheet a variant, and its marks."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from kincompile.exercises.marking import marks_of, read_key


def generate(data: dict[str, Any]) -> None:
    """Choose the sheet of a variant."""
    students = list(read_key(_folder(data)).blanks)
    data["params"]["sheet"] = students[int(data["variant_seed"]) % len(students)]


def grade(data: dict[str, Any]) -> None:
    """Mark what was submitted; what cannot be read is a format error, and uses up no attempt."""
    folder = _folder(data)
    # One line each, so that no answer fills another blank.
    lines = [
        f"{name} = {' '.join(str(text or '').split())}"
        for name, text in data["submitted_answers"].items()
    ]
    marks = marks_of(folder, read_key(folder), data["params"]["sheet"], lines)
    for item in marks:
        name = item.blank.name
        if not item.is_read:
            data["format_errors"][name] = escape(item.reason)
            continue
        data["partial_scores"][name] = {"score": item.points, "weight": 1}
        data["feedback"][name] = item.reason
    data["score"] = sum(item.points for item in marks) / len(marks)


def _folder(data: dict[str, Any]) -> Path:
    return Path(data["options"]["question_path"])
