"""The course: formulas are right, mistakes are found, and what `make course` writes is whole."""

import json
import re
import shutil
import subprocess
import sys
from unicodedata import normalize

import pytest

import kincompile as kc
from docs.builders import beamer, course, lessons, notebooks
from docs.builders.lessons import Lesson

ROOT = lessons.FOLDER.parents[1]
EACH = pytest.mark.parametrize("lesson", [*map(Lesson, lessons.NAMES)], ids=lessons.NAMES)


def compared(lesson, stated):
    """Return what the checker says of a formula that a lesson prints."""
    given = {stated.quantity: stated.matrix}
    if stated.constraint:
        given["constraint"] = stated.constraint
    return kc.compare(lesson.model, **given)


def test_that_the_lessons_cover_planar_kinematics_as_the_book_has_it():
    books = " ".join(Lesson(name).book for name in lessons.NAMES)
    sections = [f"3.{k}" for k in range(1, 8)] + ["2.6", "4.5"]
    assert len(lessons.NAMES) >= 14
    assert [section for section in sections if section not in books] == []


@EACH
def test_that_a_lesson_has_its_parts_in_order(lesson):
    wanted = [
        "Sketch",
        "Constraints",
        "The model",
        "Motion",
        "Find the mistake",
        "Questions",
        "Answers",
    ]
    headings = re.findall(r"^## (.*)$", lesson.text, re.MULTILINE)
    assert [item for item in headings if item in wanted] == wanted
    assert lesson.goal.startswith("You can ")
    questions, answers = lesson.text.split("## Questions")[1].split("## Answers")
    numbers = [re.findall(r"^\d+\.", part, re.MULTILINE) for part in (questions, answers)]
    assert numbers[0] == numbers[1] != []


@EACH
def test_that_formulas_are_right_and_the_mistake_is_named_as_the_lesson_says(lesson):
    kinds = [stated.kind for stated in lesson.stated]
    assert kinds.count("mistake") == 1
    assert kinds.count("formula") >= 1
    for stated in lesson.stated:
        report = compared(lesson, stated)
        assert report.equal is (stated.kind == "formula"), report
        if stated.kind == "mistake":
            said = [f"*The mistake.* `{x.label}`: {x.diagnoses[0].text}" for x in report.different]
            answers = " ".join(lesson.text.split("## Answers")[1].split())
            assert any(sentence in answers for sentence in said), said


def test_that_a_formula_with_a_slip_would_be_found():
    lesson = Lesson("02_pendulum")
    stated = lesson.stated[1]
    assert compared(lesson, stated).equal
    slip = stated.matrix.replace(r"-\sin", r"\sin")
    assert not kc.compare(lesson.model, **{stated.quantity: slip}).equal


def test_that_the_museum_has_slides_and_answers():
    museum = Lesson("museum")
    assert course.slides(museum).count("<section>") == museum.text.count("\n## ") + 1
    questions, answers = museum.text.split("## Questions")[1].split("## Answers")
    assert len(re.findall(r"^\d+\.", questions, re.M)) == len(re.findall(r"^\d+\.", answers, re.M))
    cases = re.findall(r"^## \d+\. .*\n\n\*(.*?)\*", museum.text, re.MULTILINE)
    assert len(cases) == 8  # each with where it came from


@EACH
def test_that_slides_are_one_file_with_a_slide_for_each_heading(lesson):
    page = course.slides(lesson)
    assert page.count("<section>") == lesson.text.count("\n## ") + 1
    assert page.count("<math") == lesson.text.count("```math")
    assert 'src="live.html"' in page
    found = re.findall(r'(?:src|href)="(?!data:|live\.html|\.\./\w+/page\.html)', page)
    assert found == []


@EACH
def test_that_the_frames_of_beamer_are_those_of_the_slides(lesson):
    text = beamer.beamer(lesson)
    assert text.count(r"\begin{frame}") == lesson.text.count("\n## ") + 1
    assert text.count(r"\[ ") == lesson.text.count("```math")
    assert text.count(r"\begin{picture}") == 1
    letters = {x for x in normalize("NFD", text) if not x.isascii()}
    assert letters <= {*beamer.LETTERS, *beamer.DOTTED}  # else pdflatex stops


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
@pytest.mark.parametrize("name", ["06_composite", "13_singular"])
def test_that_pdflatex_sets_the_slides(name, tmp_path):
    (tmp_path / "slides.tex").write_text(beamer.beamer(Lesson(name)), encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "slides.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout.decode(errors="replace")[-2000:]
    assert b"Missing character" not in done.stdout


BROWSER = """
import asyncio, ast, io, json, subprocess, sys, threading, types
from pathlib import Path

def refuse(*given, **named):
    raise OSError("emscripten does not support processes")

subprocess.Popen = refuse
threading.Thread.start = refuse
for name in ("resource", "fcntl", "multiprocessing", "_posixsubprocess"):
    sys.modules[name] = None
installed = []
async def install(wheel):
    installed.append(wheel)
sys.modules["micropip"] = types.SimpleNamespace(install=install)
own, sys.platform = sys.platform, "emscripten"  # for the first cell: SciPy looks at it too
names = {"__name__": "notebook"}
for cell in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))["cells"]:
    text = "".join(cell["source"])
    if cell["cell_type"] != "code":
        continue
    first, _, rest = text.partition("\\n")
    if first.startswith("%%writefile "):
        Path(first.split()[1]).write_text(rest, encoding="utf-8")
        continue
    code = compile(text, "cell", "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
    waiting = eval(code, names)
    if waiting is not None:
        asyncio.run(waiting)
    sys.platform = own
print(installed)
"""
"""Runs a notebook as a browser does: no compiler, no processes, no threads, no limits of Unix."""


@pytest.mark.parametrize("name", ["03_absolute", "16_dynamics", "project"])
def test_that_a_notebook_runs_without_a_compiler_processes_or_threads(name, tmp_path):
    (tmp_path / "notebook.ipynb").write_text(notebooks.of_lesson(Lesson(name).text), "utf-8")
    command = [sys.executable, "-c", BROWSER, "notebook.ipynb"]
    done = subprocess.run(
        command, cwd=tmp_path, env={"PATH": "", "HOME": str(tmp_path), "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    wheel = f"kincompile-{kc.__version__}-py3-none-any.whl"
    assert done.stdout.splitlines()[-1] == f"['emfs:../{wheel}']"


@EACH
def test_that_notebooks_are_those_of_jupyter_and_without_links_to_what_is_not_there(lesson):
    book = json.loads(notebooks.of_lesson(lesson.text))
    shown = "".join("".join(cell["source"]) for cell in book["cells"])
    assert shown.count("$$") == 2 * lesson.text.count("```math")
    assert not re.search(r"\]\([^)]*\.md", shown)
    assert "!kincompile" not in shown  # a browser has no command line


@pytest.mark.slow
def test_that_the_kit_is_whole_and_its_links_lead_somewhere(tmp_path):
    chosen = ["01", "03"]
    given = [str(tmp_path / "course"), "--students", "2", "--seed", "5", "--mistakes"]
    course.make([*given, "--lessons", *chosen])
    index = tmp_path / "course" / "index.html"
    links = re.findall(r'href="([^"]+)"', index.read_text(encoding="utf-8"))
    assert len(links) == 12 * len(chosen) + 3 * len(lessons.OTHERS)
    assert [link for link in links if not (index.parent / link).is_file()] == []
    for folder in sorted(index.parent.glob("[0-9]*")):
        (model,) = folder.glob("*.py")
        assert kc.read_model(model).name == model.stem
        for kit in ("exercise", "mistakes"):
            students = sorted((folder / kit / "students").iterdir())
            assert [item.name for item in students] == ["01", "02"]
            assert "not filled" in str(kc.mark(folder / kit))


@EACH
def test_that_each_lesson_makes_an_exercise(lesson):
    assert len(kc.exercise(lesson.model, 1, 3).blanks[0]) >= 2
