"""The autograder of Gradescope: ``python -I -m kincompile.exercises.in_gradescope``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile.checker.report import gradescope_json, gradescope_test
from kincompile.exercises.handed_in import marked
from kincompile.exercises.kit import HAND_IN
from kincompile.exercises.marking import hand_in_lines
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    from collections.abc import Mapping


def users_of(metadata: Mapping[str, Any]) -> list[str]:
    """Return what Gradescope's ``submission_metadata.json`` knows of those who hand in."""
    users = metadata.get("users", [])
    return [str(user[name]) for user in users for name in ("email", "sid") if user.get(name)]


def grade(root: Path) -> None:
    """Mark the hand-in below the folder of an autograder, and write its ``results.json``."""
    lines, problem = hand_in_lines(root / "submission" / HAND_IN)
    metadata = json.loads((root / "submission_metadata.json").read_text(encoding="utf-8"))
    marks = marked(root / "source", lines, users_of(metadata), problem)
    tests = [
        gradescope_test(f"{item.blank.name}: {item.question}", bool(item.points), item.reason)
        for item in marks
    ]
    output = f"{sum(item.points for item in marks)} of {len(marks)} points."
    write_atomically(root / "results" / "results.json", gradescope_json(output, tests))


if __name__ == "__main__":
    grade(Path("/autograder"))
