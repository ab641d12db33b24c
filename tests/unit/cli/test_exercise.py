"""`kincompile exercise` and `kincompile mark`."""

from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def folder(kincompile: Any, pendulum: Path, tmp_path: Path) -> Path:
    """Return an exercise with two students."""
    path = tmp_path / "kit"
    result = kincompile("exercise", pendulum, "-o", path, "--students", 2, "--seed", 5, "--signs")
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr.startswith(f"Wrote {path}: 2 students")
    return path


def test_that_an_exercise_is_marked_to_stdout_or_a_file(
    kincompile: Any, folder: Path, tmp_path: Path
) -> None:
    result = kincompile("mark", folder)
    assert result.exit_code == 0
    assert result.stdout.splitlines()[0].startswith("student,points,of,B1")
    assert result.stdout.splitlines()[1].startswith("01,0,")
    table = tmp_path / "points.csv"
    assert kincompile("mark", folder, "-o", table).stderr == f"Wrote {table}\n"
    assert table.read_text(encoding="utf-8") == result.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("exercise", "MODEL", "-o", "FOLDER"), "name a new folder"),
        (("exercise", "MODEL", "-o", "new", "--students", 0), "0 students: give a number"),
        (("mark", "MODEL"), "is no exercise"),
        (("mark", "FOLDER", "-o", "nowhere/points.csv"), "the folder nowhere does not exist"),
    ],
)
def test_that_wrong_use_is_a_message(
    kincompile: Any, pendulum: Path, folder: Path, tmp_path: Path, monkeypatch: Any,
    arguments: tuple[object, ...], message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    places = {"MODEL": pendulum, "FOLDER": folder}
    result = kincompile(*(places.get(str(word), word) for word in arguments))
    assert result.exit_code == 2
    assert message in result.stderr
    assert sorted(tmp_path.iterdir()) == before
