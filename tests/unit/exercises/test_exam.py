"""Exams: sheets without solutions, a key, and marks from a table of what was written on them."""

import csv
import math
import re
import shutil
import subprocess
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc
from kincompile.exercises.blanks import choose_blanks
from kincompile.exercises.kit import ExerciseKit


def arm() -> kc.Mechanism:
    """Return a pendulum that turns at a rate that changes."""
    m = kc.Mechanism("arm", end=2)
    arm = m.body("arm", guess=(2.0, 0.0, 0.0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (-2.0, 0)))
    m.add(kc.AbsoluteAngle("turn", arm, 0.3 + kc.t + kc.t**2 / 4))
    return m


@pytest.fixture(scope="module")
def made() -> ExerciseKit:
    """Return an exam of three sheets."""
    kit: ExerciseKit = kc.exercise(arm(), 3, 5, exam=True)
    return kit


@pytest.fixture(scope="module")
def written(made: ExerciseKit, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the exam as it is written."""
    return made.write(tmp_path_factory.mktemp("exam") / "exam")


@pytest.fixture
def folder(written: Path, tmp_path: Path) -> Path:
    """Return a copy of it, to be filled."""
    return shutil.copytree(written, tmp_path / "exam")


def by_hand(made: ExerciseKit, k: int) -> list[float]:
    """Return the values of the four blanks of a sheet: those of a point on a circle."""
    state = made.states[k]
    x, y = (made.variants[k].system().Phi.diff(name)[0] for name in ("x_arm", "y_arm"))
    assert (x, y) == (-1, 0)  # Phi is minus the point's position
    pin: Any = made.variants[k].constraints[0]
    length = -pin.point_j[0]
    phi, w = state["phi_arm"], state["phi_arm_dot"]
    return [
        -length * math.sin(phi), length * math.cos(phi),
        length * w**2 * math.cos(phi), length * w**2 * math.sin(phi),
    ]  # fmt: skip


def answered(folder: Path, *rows: list[str]) -> Any:
    """Return the marks of what was written on the sheets."""
    lines = ["sheet;B1;B2;B3;B4", *(";".join([str(k), *row]) for k, row in enumerate(rows, 1))]
    (folder / "answers.csv").write_text("\n".join(lines), encoding="utf-8-sig")
    return kc.mark(folder)


def test_that_an_exam_has_sheets_a_key_and_a_table_to_fill(made: ExerciseKit, folder: Path) -> None:
    found = {str(item.relative_to(folder)) for item in folder.rglob("*.*")}
    sheets = {f"students/{k}/sheet.html" for k in ("01", "02", "03")}
    models = {f"instructor/models/{k}.toml" for k in ("01", "02", "03")}
    rest = {
        "students/sheets.html",
        "students/sheets.tex",
        "instructor/solutions.html",
        "instructor/blanks.json",
    }
    assert found == sheets | models | rest | {"answers.csv"}
    text = (folder / "answers.csv").read_text(encoding="utf-8")
    assert text == "sheet,B1,B2,B3,B4\n01,,,,\n02,,,,\n03,,,,\n"
    assert len({str(state) for state in made.states}) == 3
    page = (folder / "students" / "sheets.html").read_text(encoding="utf-8")
    sheets_of = re.split(r'<section id="sheet-', page)[1:]
    parts = [text.split("-tasks")[-1] for text in sheets_of]
    boxes = [(text.count('"box wide-box"'), text.count('"box"')) for text in parts]
    assert boxes == [(4, 4)] * 3  # formulas and values
    anchors = re.findall(r' id="([^"]+)"', page)
    assert len(anchors) == len(set(anchors)) > 9


def test_that_the_key_has_the_values_and_sheets_have_none(made: ExerciseKit, folder: Path) -> None:
    key = (folder / "instructor" / "solutions.html").read_text(encoding="utf-8")
    given = [item.read_text(encoding="utf-8") for item in (folder / "students").rglob("*.*")]
    for k in range(3):
        system = made.variants[k].system()
        values = by_hand(made, k)
        assert [float(x) for x in made.values[k]] == pytest.approx(values, rel=5e-3)
        for x, text in zip(values, made.values[k], strict=True):
            assert text == f"{x:#.3g}"
            assert f"<td>{text}</td>" in key
            assert not [page for page in given if f">{text}<" in page or f"& {text} " in page]
        for item in made.blanks[k]:
            entry = str(item.answer(system.Phi_q, system.gamma))
            assert not [page for page in given if entry in page]
    formulas = re.findall(r"<td>B\d</td><td>.*?</td><td>(<math>.*?</math>)</td>", key)
    assert len(formulas) == 12
    assert not [x for x in formulas for page in given if x in page]
    assert not [page for page in given if "Hint" in page]


def test_that_nothing_is_asked_for_that_is_zero_all_the_way() -> None:
    """Of such a gamma every answer that is zero there would be right."""
    m = kc.Mechanism("slide", end=2)
    arm = m.body("arm", guess=(0.0, 0.0, 0.3))
    block = m.body("block", guess=(1.0, 0.3, 0.3))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.Translational("way", arm, (0, 0), (1, 0), block, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("turn", arm, 0.3 + kc.t / 2))
    m.add(kc.TranslationalDistance("feed", arm, (0, 0), (1, 0), block, (0, 0), 1 + kc.t**2))
    system = m.system()
    row = system.equations.index("way.parallel")
    parallel = "gamma", row  # (w_j - w_i)^2 sin(phi_i - phi_j)
    assert parallel in {(x.quantity, x.row) for x in choose_blanks(system, 2)}
    assert parallel not in {(x.quantity, x.row) for x in kc.exercise(m, 1, 2).blanks[0]}
    kit = kc.exercise(m, 2, 2, exam=True)
    assert parallel not in {(x.quantity, x.row) for x in kit.blanks[0]}
    assert [x.name for x in kit.blanks[1]] == [f"B{k}" for k in range(1, len(kit.blanks[1]) + 1)]
    assert all(float(value) for own in kit.values for value in own)
    written = [f"{value:g}" for state in kit.states for value in state.values()]
    assert not [x for x in written if x == "-0" or "e-" in x]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_that_pdflatex_sets_the_sheets(folder: Path) -> None:
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "sheets.tex"]
    place = folder / "students"
    done = subprocess.run(command, cwd=place, capture_output=True, check=False, text=True)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
    text = (place / "sheets.tex").read_text(encoding="utf-8")
    assert re.findall(r"\\section\{.*?\{Sheet (\d+): ", text) == ["01", "02", "03"]
    assert text.count(r"\fillin{64mm}") == 12


def test_that_the_same_seed_gives_the_same_sheets(made: ExerciseKit) -> None:
    again = kc.exercise(arm(), 1, 5, exam=True).files()
    path = "students/01/sheet.html"
    assert again[path] == made.files()[path]
    assert kc.exercise(arm(), 1, 6, exam=True).files()[path] != again[path]


def test_that_numbers_and_formulas_on_paper_are_marked(made: ExerciseKit, folder: Path) -> None:
    first, second = (by_hand(made, k) for k in (0, 1))
    numbers = [f"{x:.3g}".replace(".", ",") for x in first]
    system = made.variants[1].system()
    formulas = [str(x.answer(system.Phi_q, system.gamma)) for x in made.blanks[1]]
    swapped = f"{-second[1]:.4g}"  # a cosine for the sine
    marks = answered(
        folder,
        numbers,
        [swapped, f"{-second[1]:.3g}", formulas[2], f"{second[3] * 1.02:.5g}"],
        ["", "", "", ""],
    )
    rows = list(csv.DictReader(StringIO(marks.to_csv())))
    assert [row["points"] for row in rows] == ["4", "1", "0"]
    assert [rows[1][f"B{k}"] for k in (1, 2, 3, 4)] == ["0", "0", "1", "0"]
    assert "B2: the value has the wrong sign" in rows[1]["reasons"]
    assert "B4: the value is not that of the entry at the state given" in rows[1]["reasons"]
    assert "B1: the value is that of a slip: sine and cosine are swapped" in rows[1]["reasons"]
    assert rows[2]["reasons"] == "B1, B2, B3, B4: nothing handed in"
    assert "sign" in marks.statistics().kinds


def test_that_digits_of_an_exam_are_the_teachers_to_choose(made: ExerciseKit, folder: Path) -> None:
    answered(folder, [f"{x:.2g}" for x in by_hand(made, 0)])
    points = [
        sum(item.points for item in kc.mark(folder, digits=digits).students["01"])
        for digits in (1, 2, 5)
    ]
    assert points == [4, 4, 0]


def test_that_a_table_of_answers_is_of_these_sheets(folder: Path) -> None:
    path = folder / "answers.csv"
    path.write_text("sheet,B1\n9,1\n", encoding="utf-8")
    with pytest.raises(kc.InputError, match="line 2: sheet 9 is no sheet of this exercise"):
        kc.mark(folder)
    path.write_text("sheet,B1\n1,1/0\n2,wobble\n3,\n", encoding="utf-8")
    marks = kc.mark(folder).students
    assert [marks[x][0].kind for x in ("02", "03")] == ["not read", "not filled"]
    assert marks["01"][0].points == 0


def test_that_an_exam_has_no_mistakes_to_find() -> None:
    with pytest.raises(kc.InputError, match="give one of both"):
        kc.exercise(arm(), exam=True, mistakes=True)
