"""Exercises in the systems of courses: the same marks as by `kincompile mark`, and no solutions."""

import csv
import json
import os
import re
import runpy
import subprocess
import sys
import textwrap
import zipfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import sympy
from click.testing import CliRunner
from sympy.parsing.maxima import parse_maxima

import kincompile as kc
from kincompile.checker.reference import Reference
from kincompile.cli import cli
from kincompile.exercises import handed_in, in_gradescope, in_prairielearn, marking
from kincompile.exercises.systems import SYSTEMS
from kincompile.files import files
from tests.unit.exercises import hand_ins
from tests.unit.exercises.test_class import kit
from tests.unit.exercises.test_exam import arm
from tests.unit.exercises.test_exercise import by_hand, read

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def made() -> Any:
    """Return an exercise of three students."""
    return kit()


@pytest.fixture(params=SYSTEMS)
def system(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def answers_of(made: Any, k: int) -> dict[str, str]:
    """Return the right formulas of a sheet, by SymPy alone."""
    own = made.variants[k].system()
    return {x.name: str(by_hand(own, x.row, x.column)) for x in made.blanks[k]}


def readable(name: str, content: bytes) -> Iterator[str]:
    """Yield all text of a file: of the cells of notebooks, and of what zips hold, too."""
    if zipfile.is_zipfile(BytesIO(content)):
        with zipfile.ZipFile(BytesIO(content)) as archive:
            for member in archive.namelist():
                yield from readable(member, archive.read(member))
        return
    text = content.decode("utf-8", errors="replace")
    yield text
    if name.endswith(".ipynb"):
        for cell in json.loads(text)["cells"]:
            yield "".join(cell["source"]) + json.dumps(cell.get("outputs", ""))


def found_in(made: Any, files: dict[str, bytes]) -> list[tuple[str, str]]:
    """Return where a right formula stands, however its products and powers are written."""
    wanted = {
        re.sub(r"[\s*^]", "", text).lstrip("-")
        for k in range(len(made.variants))
        for own in [made.variants[k].system()]
        for item in made.blanks[k]
        for answer in (item.answer(own.Phi_q, own.gamma), by_hand(own, item.row, item.column))
        for text in (str(answer), str(sympy.nsimplify(answer, rational=True)))
    }
    return [
        (path, text)
        for path, content in files.items()
        for shown in readable(path, content)
        for text in wanted
        if text in re.sub(r"[\s*^]", "", shown)
    ]


def of_students(folder: Path, *starts: str) -> dict[str, bytes]:
    """Return the files of a folder whose paths begin so."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    names = {path.relative_to(folder).as_posix(): path for path in files}
    return {name: path.read_bytes() for name, path in names.items() if name.startswith(starts)}


def test_that_students_get_no_solutions(made: Any, system: str, tmp_path: Path) -> None:
    folder = made.write(tmp_path / "kit", system)
    own = of_students(folder, *SYSTEMS[system].students) if SYSTEMS[system].students else {}
    assert len(own) >= 3 * bool(SYSTEMS[system].students)
    assert not found_in(made, own)
    assert not [name for name in own if "instructor" in name or "solutions" in name]
    # The search does find what is there: alone, in a notebook, in a zip within a zip.
    answer = answers_of(made, 1)["B2"]
    cell = {"cell_type": "code", "source": ["x", answer], "outputs": []}
    inner, outer = BytesIO(), BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        archive.writestr("a.ipynb", json.dumps({"cells": [cell]}))
    with zipfile.ZipFile(outer, "w") as archive:
        archive.writestr("b.zip", inner.getvalue())
    assert found_in(made, {"c.zip": outer.getvalue()})
    if system == "moodle":
        assert len(found_in(made, of_students(folder, "instructor/moodle.xml"))) >= 12


def test_that_mistakes_are_kept_too(tmp_path: Path) -> None:
    made = kc.exercise(read("problem_3_5_6.toml"), 2, 3, mistakes=True)
    for system in ("otter", "nbgrader", "gradescope", "prairielearn"):
        written = made.files(system)
        starts = SYSTEMS[system].students
        texts = [text for path, text in written.items() if path.startswith(starts)]
        assert not [x for own in made.mistakes for x in own for text in texts if x.text in text]
    notebook = json.loads(made.files("otter")["students/hand_in.ipynb"])
    lines = notebook["cells"][1]["source"].splitlines()
    assert [x for x in lines if x.endswith("=")] == [f"{x}{k} =" for k in (1, 2, 3) for x in "PB"]
    with pytest.raises(kc.UnsupportedError, match=r"STACK cannot ask for P1 .* Use gradescope, nb"):
        made.files("moodle")


def test_that_what_a_system_cannot_say_is_refused(made: Any, tmp_path: Path) -> None:
    with pytest.raises(kc.InputError, match="no system 'canvas'; give one of these: gradescope"):
        made.write(tmp_path / "kit", "canvas")
    exam = kc.exercise(arm(), 1, 5, exam=True)
    with pytest.raises(kc.InputError, match="PrairieLearn marks formulas; leave out --exam"):
        exam.write(tmp_path / "kit", "prairielearn")
    m = kc.Mechanism("arm")
    body = m.body("arm", guess=(0.3, 1.9, 1.4))
    m.add(kc.Revolute("pin", m.ground, (0, 0), body, (-2.0, 0)))
    m.add(kc.AbsoluteX("turn", body, (0, 0), kc.motion.table([0, 0.5, 1], [0.3, 0.6, 0.9])))
    asked = kc.exercise(m, 1, 1)
    with pytest.raises(kc.UnsupportedError, match="for B5 of turn: C_turn'' is not among the func"):
        asked.write(tmp_path / "kit", "moodle")
    assert not list(tmp_path.iterdir())


def test_that_the_docs_list_the_systems_and_the_command_writes_them(
    system: str, tmp_path: Path
) -> None:
    text = (ROOT / "docs" / "exercises.md").read_text(encoding="utf-8")
    assert re.search(rf"^\| {SYSTEMS[system].title} \| `--for {system}` \|", text, re.MULTILINE)
    folder, again = tmp_path / "a", tmp_path / "b"
    for target in (folder, again):
        model = str(ROOT / "examples" / "inverted_slider_crank.toml")
        options = ["-o", str(target), "--seed", "3", "--for", system]
        done = CliRunner().invoke(cli, ["exercise", model, *options], catch_exceptions=False)
        assert done.exit_code == 0, done.output
    assert of_students(folder, "") == of_students(again, "")  # the same seed, the same bytes
    assert (folder / "instructor" / "solutions.html").exists()


# Whose sheet a hand-in is.

RIGHT, NONE = "right", "not filled"


def first_mark(folder: Path, lines: list[str], *who: str) -> str:
    return handed_in.marked(folder, lines, who)[0].reason


def test_that_a_roster_decides_whose_sheet_it_is(made: Any, tmp_path: Path) -> None:
    folder = made.write(tmp_path / "kit", "gradescope") / "autograder"
    lines = [f"B1 = {answers_of(made, 1)['B1']}"]
    assert first_mark(folder, ["sheet = 2", *lines]) == RIGHT
    assert first_mark(folder, ["Sheet=002", *lines]) == RIGHT
    assert first_mark(folder, ["sheet = 1", *lines]) != RIGHT
    for named in ([], ["sheet = 1", "sheet = 2"], ["sheet = 9"]):
        assert "no sheet is named" in first_mark(folder, [*named, *lines])
    roster = "sheet,First name,Email address\n1,Jo,jo@x.org\n2,jo@x.org,Ann@x.org\n"
    (folder / "roster.csv").write_text(roster, encoding="utf-8")
    assert first_mark(folder, ["sheet = 1", *lines], "ann@X.org") == RIGHT
    assert first_mark(folder, ["sheet = 2", *lines], "jo@x.org") != RIGHT
    assert "no sheet for eve@x.org" in first_mark(folder, ["sheet = 2", *lines], "eve@x.org")
    assert "no sheet for you" in first_mark(folder, ["sheet = 2", *lines])


# PrairieLearn, by a stub of its data.


def test_that_a_question_of_prairielearn_marks_on_the_server(made: Any, tmp_path: Path) -> None:
    question = made.write(tmp_path / "kit", "prairielearn") / "question"
    info = json.loads((question / "info.json").read_text(encoding="utf-8"))
    assert (info["type"], len(info["uuid"])) == ("v3", 36)
    html = (question / "question.html").read_text(encoding="utf-8")
    assert re.findall(r'answers-name="(\w+)"', html) == ["B1", "B2", "B3", "B4"]
    assert "correct-answer" not in html
    server = runpy.run_path(str(question / "server.py"))
    options = {"question_path": str(question)}
    data: dict[str, Any] = {"variant_seed": 7, "params": {}, "correct_answers": {}}
    data |= {"options": options, "format_errors": {}, "partial_scores": {}, "feedback": {}}
    server["generate"](data)
    assert data["params"] == {"sheet": "02"}
    assert (question / "clientFilesQuestion" / "02.html").exists()
    right = answers_of(made, 1)
    data["submitted_answers"] = {
        "B1": right["B1"], "B2": f"-({right['B2']})", "B3": "", "B4": f"0\nB3 = {right['B3']}",
    }  # fmt: skip
    server["grade"](data)
    assert data["score"] == 0.25
    scores = {name: item["score"] for name, item in data["partial_scores"].items()}
    assert scores == {"B1": 1, "B2": 0, "B3": 0}
    assert data["feedback"]["B2"] == "the entry has the wrong sign."
    assert data["feedback"]["B3"] == NONE  # what is typed into one blank fills no other
    assert data["format_errors"]["B4"].startswith("cannot be read: 0 B3 = ")
    data["submitted_answers"] = {"B1": "<b onclick=x>("}
    server["grade"](data)
    assert "<b" not in data["format_errors"]["B1"]
    json.dumps(data)
    assert data["correct_answers"] == {}


# Moodle: numbers in Cloze, by the rules of question/type/multianswer and question/type/numerical.

NUMBER = r"-?(?:(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)"
BOX = re.compile(r"\{([0-9]*):(?:NUMERICAL|NM):((?:[^~}]|\\[~}])+(?:~(?:[^~}]|\\[~}])+)*)\}")
CHOICE = re.compile(rf"(=|%(-?[0-9]+)%)?({NUMBER})(?::({NUMBER}))?(?:#(.*))?")


def cloze_points(text: str, typed: list[str]) -> list[tuple[float, str]]:
    """Return the fraction and the feedback that Moodle gives for numbers in the boxes."""
    found = []
    for box, number in zip(BOX.finditer(text), typed, strict=True):
        assert box[1] == "1"
        for choice in box[2].split("~"):
            own = CHOICE.fullmatch(choice)
            assert own is not None, choice
            answer, tolerance = float(own[3]), float(own[4] or 0)
            tolerance += 1e-14 * max(1, abs(answer))
            if abs(float(number) - answer) <= tolerance:
                found.append((1.0 if own[1] == "=" else int(own[2]) / 100, own[5] or ""))
                break
        else:
            found.append((0.0, ""))
    return found


def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mark without processes, with one reference a model, and the same answers once."""
    kept: dict[str, Reference] = {}

    def reference(path: Path) -> Reference:
        text = path.read_text(encoding="utf-8")
        if text not in kept:
            kept[text] = Reference(files.read(path).system())
        return kept[text]

    def model(path: Path) -> Any:
        return SimpleNamespace(system=lambda: reference(path))

    monkeypatch.setattr(marking, "read", model)
    monkeypatch.setattr(marking, "Reference", lambda found: found)
    marks: dict[Any, Any] = {}

    def work_of(work: Any, _: Any) -> Any:
        path, blanks, typed, *rest = work.args
        key = path.resolve(), tuple(x.name for x in blanks), tuple(typed.items()), str(rest)
        if key not in marks:  # an exporter that hands on another text is marked by it
            marks[key] = work()
        return marks[key]

    monkeypatch.setattr(marking, "within_budget", work_of)


def test_that_moodle_takes_the_numbers_that_mark_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_process(monkeypatch)
    exam = kc.exercise(arm(), 3, 5, exam=True)
    folder = exam.write(tmp_path / "exam")
    xml = exam.write(tmp_path / "moodle", "moodle") / "instructor" / "moodle.xml"
    questions = ET.parse(xml).getroot().findall("question[@type='cloze']")
    assert [x.findtext("name/text") for x in questions] == ["arm 01", "arm 02", "arm 03"]
    values = [
        [float(by_hand(own.system(), x.row, x.column).subs(state)) for x in blanks]
        for own, blanks, state in zip(exam.variants, exam.blanks, exam.states, strict=True)
    ]
    changes = (
        lambda x: f"{x:.3g}", lambda x: f"{x:.2g}", lambda x: f"{x:.6g}", lambda x: f"{-x:.3g}",
        lambda x: f"{1.01 * x:.5g}", lambda x: f"{0.997 * x:.5g}", lambda x: "0",
        lambda x: f"{float(f'{x:.3g}') + 10.0 ** (len(str(int(abs(x)))) - 3):.6g}",
    )  # fmt: skip
    seen = set()
    for change in changes:
        typed = [[change(x) for x in own] for own in values]
        rows = [["sheet", "B1", "B2", "B3", "B4"]]
        rows += [[str(k), *own] for k, own in enumerate(typed, 1)]
        with (folder / "answers.csv").open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerows(rows)
        marks = kc.mark(folder).students.values()
        for question, own, numbers in zip(questions, marks, typed, strict=True):
            given = cloze_points(str(question.findtext("questiontext/text")), numbers)
            assert [x for x, _ in given] == [item.points for item in own], numbers
            said = [text for _, text in given]
            assert [bool(x) for x in said] == ["wrong sign" in item.reason for item in own]
            seen |= {x for x, _ in given}
    assert seen == {0.0, 1.0}


# STACK: the response trees, with SymPy in the place of Maxima's AlgEquiv.


def stack_points(question: ET.Element, typed: dict[str, str]) -> dict[str, tuple[float, str]]:
    """Return the score and the feedback of each response tree."""
    text = str(question.findtext("questionvariables/text"))
    known = {k: parse_maxima(v) for k, v in re.findall(r"(\w+): ([^;]*);", text)}
    found = {}
    for tree in question.findall("prt"):
        nodes = {item.findtext("name"): item for item in tree.findall("node")}
        score, said, at = 0.0, "", "0"
        while at != "-1":
            node = nodes[at]
            assert node.findtext("answertest") == "AlgEquiv"
            name = str(node.findtext("sans"))
            right = str(node.findtext("tans"))
            sign = -1 if right.startswith("-") else 1
            apart = sympy.nsimplify(sympy.sympify(typed[name]), rational=True)
            is_equal = sympy.simplify(apart - sign * known[right.lstrip("-")]) == 0
            branch = "true" if is_equal else "false"
            score = float(str(node.findtext(f"{branch}score")))
            said = node.findtext(f"{branch}feedback/text") or ""
            at = str(node.findtext(f"{branch}nextnode"))
        found[str(tree.findtext("name"))] = score, said
    return found


def test_that_stack_asks_for_the_same_formulas(
    made: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_process(monkeypatch)
    folder = made.write(tmp_path / "kit")
    xml = made.write(tmp_path / "moodle", "moodle") / "instructor" / "moodle.xml"
    root = ET.parse(xml).getroot()
    assert root.tag == "quiz"
    assert root.findtext("question[@type='category']/category/text") == "$course$/top/arm"
    questions = root.findall("question[@type='stack']")
    assert len(questions) == 3
    for question in questions:
        shown = str(question.findtext("questiontext/text"))
        names = [item.findtext("name") for item in question.findall("input")]
        trees = [str(item.findtext("name")) for item in question.findall("prt")]
        assert names == [f"ansB{k}" for k in (1, 2, 3, 4)]  # letters, then digits, as STACK asks
        assert re.findall(r"\[\[(\w+):(\w+)\]\]", shown) == [
            pair
            for name, tree in zip(names, trees, strict=True)
            for pair in (("input", name), ("validation", name), ("feedback", tree))
        ]
        words = [str(x.findtext("allowwords")).split(",") for x in question.findall("input")]
        assert words == [["phi_arm"]] * 2 + [["phi_arm", "phi_arm_dot"]] * 2
        (file,) = question.findall("questiontext/file")
        assert (file.get("encoding"), file.get("path")) == ("base64", "/")
        assert "@@PLUGINFILE@@/" + str(file.get("name")) in shown
    for change in ("{}", "-({})", "2*({})", "({})*(sin(phi_arm)**2 + cos(phi_arm)**2)", "{} + 1"):
        for k, student in enumerate(made.students):
            typed = {name: change.format(text) for name, text in answers_of(made, k).items()}
            lines = [f"{name} = {text}\n" for name, text in typed.items()]
            path = folder / "students" / student / "hand_in.txt"
            path.write_text("".join(lines), encoding="utf-8")
            given = stack_points(questions[k], {f"ans{x}": text for x, text in typed.items()})
            marks = kc.mark(folder).students[student]
            assert [x for x, _ in given.values()] == [item.points for item in marks]
            assert {bool(text) for _, text in given.values()} == {change == "-({})"}


# The same 600 answers in every system that is graded in Python.


def by_gradescope(root: Path, sheet: str, text: str, _: list[str]) -> dict[str, tuple[int, str]]:
    path = root / "submission" / "hand_in.txt"
    path.write_text(f"sheet = {sheet}\n{text}", encoding="utf-8")
    in_gradescope.grade(root)
    results = json.loads((root / "results" / "results.json").read_text(encoding="utf-8"))
    return {
        item["name"].partition(":")[0]: (item["score"], item["output"]) for item in results["tests"]
    }


def by_prairielearn(
    root: Path, sheet: str, text: str, names: list[str]
) -> dict[str, tuple[int, str]]:
    typed = dict(line.split(" = ", 1) for line in text.splitlines())
    data: dict[str, Any] = {
        "options": {"question_path": str(root / "source")}, "params": {"sheet": sheet},
        "submitted_answers": typed, "format_errors": {}, "partial_scores": {}, "feedback": {},
    }  # fmt: skip
    in_prairielearn.grade(data)
    assert data["format_errors"] == {}
    assert data["score"] == sum(x["score"] for x in data["partial_scores"].values()) / len(names)
    return {x: (data["partial_scores"][x]["score"], data["feedback"][x]) for x in names}


def notebook_of(sheet: str, text: str) -> list[Any]:
    return [
        {"cell_type": "code", "source": "B1 = 1", "metadata": {}, "outputs": []},
        {"cell_type": "raw", "source": f"sheet = {sheet}\n{text}", "metadata": {}},
    ]


def by_otter(root: Path, sheet: str, text: str, _: list[str]) -> dict[str, tuple[int, str]]:
    from kincompile.exercises.in_otter import Marks

    plugin = Marks(str(root / "submission" / "a.ipynb"), {}, {})
    (cell,) = plugin.before_execution({"cells": notebook_of(sheet, text)})["cells"]
    scope: dict[str, Any] = {}
    exec(cell["source"], scope)
    return dict(scope["marks"])


def by_nbgrader(root: Path, sheet: str, text: str, names: list[str]) -> dict[str, tuple[int, str]]:
    from nbformat import from_dict
    from nbgrader.utils import determine_grade

    from kincompile.exercises.in_nbgrader import MarkFormulas

    cells = notebook_of(sheet, text)
    for name in names:
        own = {"grade": True, "grade_id": name, "points": 1, "solution": False}
        faked = [{"output_type": "execute_result", "data": {"text/plain": "1"}}]
        made = {"cell_type": "code", "source": "", "outputs": faked}
        cells.append({**made, "metadata": {"nbgrader": own}, "execution_count": 1})
    notebook = from_dict({"cells": cells, "metadata": {}})
    marker = MarkFormulas()
    marker.exercises = {"a": str(root / "source")}
    marker.preprocess(notebook, {"nbgrader": {"assignment": "a", "student": "ann"}})
    graded = notebook.cells[2:]
    said = [x.outputs[0]["evalue"] if x.outputs else "" for x in graded]
    points = [determine_grade(x)[0] for x in graded]
    return {x: (int(p), why) for x, p, why in zip(names, points, said, strict=True)}


# What otter imports warns of itself.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.slow
def test_that_600_answers_are_marked_alike_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_process(monkeypatch)
    points = hand_ins.write(tmp_path / "source")
    (tmp_path / "source" / "files").symlink_to(tmp_path / "source")
    for name in ("submission", "results"):
        (tmp_path / name).mkdir()
    (tmp_path / "submission_metadata.json").write_text("{}", encoding="utf-8")
    marks = kc.mark(tmp_path / "source").students
    assert [sum(len(marks[x]) for x in points if points[x] == worth) for worth in (1, 0)] == [
        300, 300,
    ]  # fmt: skip
    for sheet, own in marks.items():
        wanted = {item.blank.name: (item.points, item.reason) for item in own}
        assert {x for x, _ in wanted.values()} == {points[sheet]}, (sheet, own)
        text = (tmp_path / "source" / "students" / sheet / "hand_in.txt").read_text("utf-8")
        for system in (by_gradescope, by_prairielearn, by_otter, by_nbgrader):
            given = system(tmp_path, sheet, text, list(wanted))
            if system is by_nbgrader:  # what is right has no output
                given = {x: (p, why or wanted[x][1]) for x, (p, why) in given.items()}
            assert given == wanted, (system, sheet)


# From end to end, with the real packages.

ATTACK = """
import kincompile.exercises.handed_in as h, kincompile.exercises.marking as m, pathlib
pathlib.Path({mark!r}).write_text("ran")
h.marked = m.marks_of = lambda *a, **k: []
marks = {{f"B{{k}}": (1, "right") for k in range(9)}}
"""


def filled(path: Path, text: str, *, attack: str = "") -> str:
    """Return a notebook with the answers typed in, and code and outputs that a cheat adds."""
    data = json.loads(path.read_text(encoding="utf-8"))
    (raw,) = [cell for cell in data["cells"] if cell["cell_type"] == "raw"]
    raw["source"] = text
    if attack:
        output = {"output_type": "stream", "name": "stdout", "text": "1 of 1"}
        code = {"cell_type": "code", "id": "more", "metadata": {}, "execution_count": 1}
        data["cells"].insert(0, {**code, "source": attack, "outputs": [output]})
    return json.dumps(data)


def three(made: Any) -> list[str]:
    """Return hand-ins: all right, one wrong and one not read, none."""
    right, other = answers_of(made, 1), answers_of(made, 2)
    lines = [f"{name} = {text}" for name, text in other.items() if name not in ("B1", "B4")]
    return [
        "\n".join(["sheet = 2", *(f"{name} = {text}" for name, text in right.items())]),
        "\n".join(["sheet = 3", f"B1 = -({other['B1']})", "B4 = wobble(1)", *lines]),
        "sheet = 1\nB1 = 7",
    ]


OTTER = """
import json, os, sys
from otter.generate import main as generate
from otter.run import main as run

os.chdir("autograder")
generate(tests_dir="tests", output_path="../a.zip", files=["instructor", "roster.csv"])
os.chdir("..")
scores = []
for path in sys.argv[1:]:
    found = run(path, autograder="a.zip", output_dir=None, no_logo=True)
    cases = {name: found.get_result(name).test_case_results for name in found.test_files}
    scores.append({name: (found.get_score(name), own[0].message) for name, own in cases.items()})
print("\\n" + json.dumps(scores))
"""


def ran(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_that_otter_gives_the_points(made: Any, tmp_path: Path) -> None:
    folder = made.write(tmp_path / "kit", "otter")
    notebook = folder / "students" / "hand_in.ipynb"
    texts = three(made)
    for name, text in zip("ab", texts, strict=False):
        (tmp_path / f"{name}.ipynb").write_text(filled(notebook, text), encoding="utf-8")
    # The third is an archive with code, and with files named as those of the grader.
    attack = ATTACK.format(mark=str(tmp_path / "ran"))
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as archive:
        archive.writestr("hand_in.ipynb", filled(notebook, texts[2], attack=attack))
        for name in ("otter.py", "kincompile.py", "dill.py", "sitecustomize.py", "__init__.py"):
            archive.writestr(name, attack)
        archive.writestr("tests/B1.py", attack)
        archive.writestr(".OTTER_LOG", "cos\nsystem\n(S'touch ran'\ntR.")
    names = [str(tmp_path / name) for name in ("a.ipynb", "b.ipynb", "c.zip")]
    scores = json.loads(ran(folder, "-c", OTTER, *names).splitlines()[-1])
    points = [[own[f"B{k}"][0] for k in (1, 2, 3, 4)] for own in scores]
    assert points == [[1, 1, 1, 1], [0, 1, 1, 0], [0, 0, 0, 0]]
    assert "the entry has the wrong sign." in scores[1]["B1"][1]
    assert "cannot be read: wobble(1)" in scores[1]["B4"][1]
    assert not (tmp_path / "ran").exists()
    assert found_in(made, of_students(folder, "students/")) == []


@pytest.mark.slow
def test_that_nbgrader_gives_the_points(made: Any, tmp_path: Path) -> None:
    folder = made.write(tmp_path / "kit", "nbgrader")
    ran(folder, "-m", "nbgrader", "generate_assignment", "arm")
    release = folder / "release" / "arm"
    assert {item.name for item in release.iterdir()} == {
        "hand_in.ipynb", "01.html", "02.html", "03.html",
    }  # fmt: skip
    assert found_in(made, of_students(release, "")) == []
    assert "not marked" not in (release / "hand_in.ipynb").read_text(encoding="utf-8")
    attack = ATTACK.format(mark=str(tmp_path / "ran"))
    for student, text in zip(("ann", "bob", "eve"), three(made), strict=True):
        own = folder / "submitted" / student / "arm"
        own.mkdir(parents=True)
        notebook = filled(
            release / "hand_in.ipynb", text, attack=attack if student == "eve" else ""
        )
        if student == "eve":
            notebook = notebook.replace('"points": 1', '"points": 100')
            for name in ("kincompile.py", "nbgrader_config.py", "sitecustomize.py", "nbformat.py"):
                (own / name).write_text(attack, encoding="utf-8")
        (own / "hand_in.ipynb").write_text(notebook, encoding="utf-8")
    grades = textwrap.dedent("""
        import json
        from nbgrader.api import Gradebook
        from nbgrader.apps import AutogradeApp
        app = AutogradeApp()
        app.initialize(["arm"])
        app.start()
        with Gradebook("sqlite:///gradebook.db") as book:
            found = {
                item.student.id: {x.name: x.auto_score for x in item.notebooks[0].grades}
                for item in book.assignment_submissions("arm")
            }
        print("\\n" + json.dumps(found))
    """)
    found = json.loads(ran(folder, "-c", grades).splitlines()[-1])
    points = {name: [own[f"B{k}"] for k in (1, 2, 3, 4)] for name, own in found.items()}
    assert points == {"ann": [1, 1, 1, 1], "bob": [0, 1, 1, 0], "eve": [0, 0, 0, 0]}
    assert not (tmp_path / "ran").exists()
    graded = (folder / "autograded" / "bob" / "arm" / "hand_in.ipynb").read_text(encoding="utf-8")
    assert "the entry has the wrong sign." in graded
    assert graded.count("not marked: nbgrader_config.py lacks") == 4  # what would run without it
    assert "cannot be read: wobble(1)" in graded
