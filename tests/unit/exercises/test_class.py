"""Marks of a class: feedback, statistics, and tables that gradebooks import."""

import csv
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli
from kincompile.exercises.kit import ExerciseKit

FILES = {
    "points.csv", "statistics.txt", "statistics.csv", "statistics.html", "moodle.csv", "canvas.csv",
}  # fmt: skip


def kit() -> ExerciseKit:
    """Return an exercise of three students about a pendulum of another length each."""
    m = kc.Mechanism("arm")
    arm = m.body("arm", guess=(2.0, 0.0, 0.0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (-2.0, 0)))
    m.add(kc.AbsoluteAngle("turn", arm, kc.t))
    made: ExerciseKit = kc.exercise(m, 3, 1)
    return made


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an exercise: 01 has a wrong sign and a formula that is not read, 03 nothing."""
    made = kit()
    path = made.write(tmp_path_factory.mktemp("class") / "kit")
    for student, variant in zip(made.students, made.variants, strict=True):
        pin: Any = variant.constraints[0]
        length = -pin.point_j[0]
        right = [f"-{length} sin(phi_arm)", f"{length} cos(phi_arm)"]
        answers = {"01": [f"{length} sin(phi_arm)", "wobble(<b>)"], "02": right, "03": []}[student]
        lines = [f"B{k} = {text}\n" for k, text in enumerate(answers, 1)]
        (path / "students" / student / "hand_in.txt").write_text("".join(lines), encoding="utf-8")
    return path


ROSTER = """Sheet;Student;ID;SIS Login ID;Section;Email address
;    Points Possible;;;;
2;Doe, Jane;77;jane;A;jane@example.org
1;=HYPERLINK("x");78;joe;A;joe@example.org
"""


def written(folder: Path, target: Path, *options: str) -> str:
    """Return what the command line prints when it writes the folder."""
    arguments = ["mark", str(folder), "-o", str(target), *options]
    done = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert done.stderr == f"Wrote {target}\n"
    return done.stdout


def test_that_a_folder_has_all_that_is_made_of_marks(folder: Path, tmp_path: Path) -> None:
    shown = written(folder, tmp_path / "marks")
    found = {str(x.relative_to(tmp_path / "marks")) for x in (tmp_path / "marks").rglob("*.*")}
    assert found == FILES | {f"feedback/{k}/feedback.html" for k in ("01", "02")}
    assert (tmp_path / "marks" / "statistics.txt").read_text(encoding="utf-8") == shown
    assert shown.startswith("2 of 3 students handed in; mean 1.00 of 4.\n")
    done = CliRunner().invoke(cli, ["mark", str(folder), "-o", str(tmp_path / "marks")])
    assert (done.exit_code, "name a new folder" in done.output) == (2, True)
    done = CliRunner().invoke(cli, ["mark", str(folder), "--title", "Homework 1"])
    assert (done.exit_code, "are for a folder" in done.output) == (2, True)


def test_that_statistics_count_outcomes_and_faults_by_question(folder: Path) -> None:
    counted = kc.mark(folder).statistics()
    rows = {row[0]: row[1:] for row in counted.rows_of_questions()}
    assert rows["B1"] == ["Phi_q[pin.x, phi_arm]", "1", "1", "0", "1"]
    assert rows["B2"] == ["Phi_q[pin.y, phi_arm]", "1", "0", "1", "1"]
    assert rows["B3"] == ["gamma[pin.x]", "0", "0", "0", "3"]
    assert counted.rows_of_faults() == [["sign", "1", "1", "0", "0", "0"]]
    lines = list(csv.reader(StringIO(counted.to_csv())))
    assert lines[0] == ["question", "entry", "what", "times"]
    assert ["B1", "Phi_q[pin.x, phi_arm]", "fault: sign", "1"] in lines


def test_that_feedback_says_what_is_wrong_and_no_solution(folder: Path) -> None:
    files = kc.mark(folder).files()
    page = files["feedback/01/feedback.html"]
    wrong, unread = page.split("What is wrong</h2>")[1].split("What was not read</h2>")
    assert "B1: Phi_q[pin.x, phi_arm]" in wrong
    assert "The entry has the wrong sign." in wrong
    assert "hints" in wrong
    assert "wobble(&lt;b&gt;)" in unread
    assert "<b>" not in page
    assert "Cannot be read: wobble(" in unread
    assert "Student 01: 0 of 4 points. Not read, and not counted as wrong: 1." in page
    for text in ("-2", "\N{MINUS SIGN}", "script"):  # the right entry has a minus
        assert text not in page.split("<main>")[1]
    assert "What is right</h2>" in files["feedback/02/feedback.html"]


def test_that_canvas_and_moodle_know_the_students_of_a_roster(folder: Path, tmp_path: Path) -> None:
    roster = tmp_path / "roster.csv"
    roster.write_text(ROSTER, encoding="utf-8-sig")
    written(folder, tmp_path / "marks", "--roster", str(roster), "--title", "Homework 1 (4711)")
    canvas, moodle = (
        list(csv.reader(StringIO((tmp_path / "marks" / name).read_text(encoding="utf-8"))))
        for name in ("canvas.csv", "moodle.csv")
    )
    columns = ["Student", "ID", "SIS User ID", "SIS Login ID", "Section", "Homework 1 (4711)"]
    assert canvas == [
        columns,
        ["    Points Possible", "", "", "", "", "4"],
        ["Doe, Jane", "77", "", "jane", "A", "2"],
        ['\'=HYPERLINK("x")', "78", "", "joe", "A", "0"],
    ]
    assert moodle[0] == ["Email address", "Homework 1 (4711)", "Homework 1 (4711) (feedback)"]
    assert moodle[1] == ["jane@example.org", "2", "B3, B4: not filled"]
    assert moodle[2][:2] == ["joe@example.org", "0"]
    assert "B1: the entry has the wrong sign." in moodle[2][2]


def test_that_without_a_roster_the_folder_is_the_name(folder: Path) -> None:
    files = kc.mark(folder).files(title="=1+1")
    moodle = list(csv.reader(StringIO(files["moodle.csv"])))
    assert moodle[0] == ["ID number", "'=1+1", "'=1+1 (feedback)"]
    assert [row[:2] for row in moodle[1:]] == [["01", "0"], ["02", "2"], ["03", ""]]
    assert files["canvas.csv"].splitlines()[2] == "01,,01,,,0"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name\nJane\n", "has no column 'sheet'"),
        ("sheet,name\n1,A\n01,B\n", "line 3: sheet 01 stands there twice"),
        ("sheet,name\n7,A\n", "line 2: sheet 7 is no sheet of this exercise"),
        ("sheet,name\n2,A\n", "no line for sheets with answers: 01"),
        ("sheet,shoe size\n1,44\n2,43\n", "has no column by which a gradebook knows a student"),
        ('sheet,name\n1,"A\n', "is no table"),
    ],
)
def test_that_a_roster_that_cannot_be_used_writes_nothing(
    folder: Path, tmp_path: Path, text: str, message: str
) -> None:
    roster = tmp_path / "roster.csv"
    roster.write_text(text, encoding="utf-8")
    with pytest.raises(kc.InputError, match=message):
        kc.mark(folder).write(tmp_path / "marks", roster)
    assert [item.name for item in tmp_path.iterdir()] == ["roster.csv"]
