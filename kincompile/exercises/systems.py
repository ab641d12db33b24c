"""Exercises for the systems that courses are taught with: what each writes, and who gets what."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol
from uuid import NAMESPACE_URL, uuid5

from kincompile.errors import InputError
from kincompile.exercises.moodle import moodle_xml
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.exercises.blanks import Blank, State
    from kincompile.model.system import ConstraintSystem

Files = dict[str, str]
"""Texts of files by their paths."""

KEY = "instructor/blanks.json", "instructor/models/"
"""What a grader needs: what is asked, and the mechanisms; the solutions are not in it."""


class Kit(Protocol):
    """What a writer is given of an exercise."""

    @property
    def name(self) -> str:
        """Name of the mechanism."""

    @property
    def students(self) -> Sequence[str]:
        """Numbers of the sheets."""

    @property
    def blanks(self) -> Sequence[Sequence[Blank]]:
        """What is asked on each sheet."""

    @property
    def systems(self) -> Sequence[ConstraintSystem]:
        """The equations of each sheet."""

    @property
    def states(self) -> Sequence[State]:
        """Of an exam the states at which numbers are asked for."""


@dataclass(frozen=True, slots=True)
class System:
    """A system of courses.

    Attributes
    ----------
    title
        Its name in sentences.
    write
        Makes its files of an exercise and of the files that every exercise has.
    students
        What students get, by the beginnings of paths; Moodle and PrairieLearn show it themselves.
    """

    title: str
    write: Callable[[Kit, Files], Files]
    students: tuple[str, ...]


def files_for(system: str, kit: Kit, files: Files) -> Files:
    """Return the files of an exercise for a system.

    Raises
    ------
    InputError
        If there is no such system, or it cannot say what the exercise asks.
    """
    if system not in SYSTEMS:
        raise InputError(f"there is no system {system!r}; give one of these: {listed(SYSTEMS)}")
    if kit.states and system != "moodle":
        raise InputError(
            f"an exam is for paper and for Moodle, and {SYSTEMS[system].title} marks formulas; "
            "leave out --exam"
        )
    return SYSTEMS[system].write(kit, files)


def _gradescope(kit: Kit, files: Files) -> Files:
    """Return hand-in files that say their sheet, and an autograder to zip."""
    found = {
        path: f"sheet = {path.split('/')[1]}\n{text}" if path.endswith("hand_in.txt") else text
        for path, text in files.items()
    }
    found |= _key(files, "autograder/") | {"autograder/roster.csv": _roster(kit)}
    found["autograder/setup.sh"] = SETUP
    found["autograder/run_autograder"] = RUN
    return found


def _otter(kit: Kit, files: Files) -> Files:
    """Return a notebook for all, and what `otter generate` makes an autograder of."""
    found = _without_hand_ins(files)
    found["students/hand_in.ipynb"] = _notebook(kit, files)
    found |= _key(files, "autograder/") | {"autograder/roster.csv": _roster(kit)}
    plugins = ["kincompile.exercises.in_otter.Marks"]
    found["autograder/otter_config.json"] = json.dumps({"plugins": plugins}) + "\n"
    found["autograder/requirements.txt"] = "--find-links /autograder/source/files\nkincompile\n"
    for item in kit.blanks[0]:
        found[f"autograder/tests/{item.name}.py"] = OTTER_TEST.format(name=item.name)
    return found


def _nbgrader(kit: Kit, files: Files) -> Files:
    """Return an assignment below ``source``, and the lines for the configuration."""
    source = f"source/{_identifier(kit.name)}"
    found = {path: text for path, text in files.items() if path.startswith("instructor/")}
    found |= {f"{source}/{student}.html": text for student, text in _pages(files).items()}
    tests = [_graded(item.name) for item in kit.blanks[0]]
    found[f"{source}/hand_in.ipynb"] = _notebook(kit, files, tests)
    found["roster.csv"] = _roster(kit)
    found["nbgrader_config.py"] = NBGRADER.format(assignment=_identifier(kit.name))
    return found


def _prairielearn(kit: Kit, files: Files) -> Files:
    """Return a question of which each variant is a sheet."""
    found = {path: text for path, text in files.items() if path.startswith("instructor/")}
    found |= _key(files, "question/")
    for student, text in _pages(files).items():
        found[f"question/clientFilesQuestion/{student}.html"] = text
    info = {
        "uuid": str(uuid5(NAMESPACE_URL, repr(sorted(_key(files, "").items())))),
        "title": f"Kinematics of {kit.name}",
        "topic": "Kinematics",
        "type": "v3",
    }
    found["question/info.json"] = json.dumps(info, indent=1) + "\n"
    names = [item.name for item in kit.blanks[0]]
    inputs, said = (
        "\n".join(form.format(name=x) for x in names) for form in (PL_INPUT, PL_FEEDBACK)
    )
    found["question/question.html"] = PL_QUESTION.format(inputs=inputs, feedback=said)
    found["question/server.py"] = PL_SERVER
    return found


def _moodle(kit: Kit, files: Files) -> Files:
    """Return a file of questions to import: numbers of an exam, else formulas for STACK."""
    found = {path: text for path, text in files.items() if path.startswith("instructor/")}
    asked = zip(_pages(files).items(), kit.systems, kit.blanks, strict=True)
    sheets = [(student, page, system, own) for (student, page), system, own in asked]
    found["instructor/moodle.xml"] = moodle_xml(kit.name, sheets, kit.states)
    return found


SYSTEMS: Mapping[str, System] = {
    "gradescope": System("Gradescope", _gradescope, ("students/",)),
    "moodle": System("Moodle", _moodle, ()),
    "nbgrader": System("nbgrader", _nbgrader, ("source/",)),
    "otter": System("otter-grader", _otter, ("students/",)),
    "prairielearn": System(
        "PrairieLearn", _prairielearn, ("question/clientFilesQuestion/", "question/question.html")
    ),
}
"""The one list of systems; docs/exercises.md has it as a table."""


def _key(files: Files, under: str) -> Files:
    """Return what a grader needs, for another folder."""
    return {under + path: text for path, text in files.items() if path.startswith(KEY)}


def _pages(files: Files) -> Files:
    """Return the page of each student by the number of the sheet."""
    found = {path: re.fullmatch(r"students/(\d+)/\w+\.html", path) for path in files}
    return {own[1]: files[path] for path, own in found.items() if own}


def _without_hand_ins(files: Files) -> Files:
    return {path: text for path, text in files.items() if not path.endswith("hand_in.txt")}


def _roster(kit: Kit) -> str:
    """Return a table for who has which sheet, to be filled."""
    rows = ["sheet,Email address,Username,ID number", *(f"{x},,," for x in kit.students)]
    return "\n".join(rows) + "\n"


def _identifier(name: str) -> str:
    """Return the name of an assignment, in letters that a path and a configuration bear."""
    return re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "exercise"


def _notebook(kit: Kit, files: Files, more: Sequence[dict[str, Any]] = ()) -> str:
    """Return the notebook that students fill: one for all, with what all their files share."""
    first, *others = (text for path, text in files.items() if path.endswith("hand_in.txt"))
    shared = [x for x in first.splitlines() if all(x in text.splitlines() for text in others)]
    sheet = kit.students[0] if len(kit.students) == 1 else ""
    answers = "\n".join([f"sheet = {sheet}", *shared])
    cells = [_cell("markdown", "intro", NOTEBOOK), _cell("raw", "answers", answers), *more]
    python = {"display_name": "Python 3", "language": "python", "name": "python3"}
    data = {"cells": cells, "metadata": {"kernelspec": python}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(data, indent=1) + "\n"


def _cell(kind: str, name: str, source: str, **more: Any) -> dict[str, Any]:
    return {"cell_type": kind, "id": name, "metadata": {}, "source": source, **more}


def _graded(name: str) -> dict[str, Any]:
    """Return the test of a blank in nbgrader, whose outcome the preprocessor writes."""
    own = {
        "grade": True, "grade_id": name, "locked": True, "points": 1, "schema_version": 3,
        "solution": False, "task": False,
    }  # fmt: skip
    made = _cell("code", name, UNMARKED.format(name=name), execution_count=None, outputs=[])
    return made | {"metadata": {"nbgrader": own}}


NOTEBOOK = """\
Your mechanism and what is asked are on your page, `NN.html` or `NN/exercise.html`, where NN is the
number of your sheet. Write that number and a formula after each `=` in the grey cell below.
Formulas are marked as text: no cell is run, and what you add elsewhere is not read."""

UNMARKED = """\
# {name} is marked when the notebook is graded.
### BEGIN HIDDEN TESTS
raise RuntimeError("not marked: nbgrader_config.py lacks the lines of the exercise")
### END HIDDEN TESTS"""
"""Where nbgrader runs this itself, there are no points; students do not get the hidden part."""

OTTER_TEST = """\
from otter.test_files import test_case

OK_FORMAT = False
name = "{name}"
points = 1


@test_case(name="{name}")
def test_{name}(marks):
    points, reason = marks["{name}"]
    assert points, reason
"""

NBGRADER = """\
# For another course, put these lines into its nbgrader_config.py, with the path of this folder.
from pathlib import Path

from kincompile.exercises.in_nbgrader import PREPROCESSORS

c = get_config()
c.MarkFormulas.exercises = {{"{assignment}": str(Path(__file__).resolve().parent)}}
c.Autograde.autograde_preprocessors = PREPROCESSORS
"""

SETUP = """\
#!/usr/bin/env bash
# Python 3.11 or newer; the wheel of kincompile lies beside this file.
set -e
apt-get update && apt-get install -y python3-venv
python3 -m venv /autograder/venv
/autograder/venv/bin/python -m pip install --find-links /autograder/source kincompile
"""

RUN = """\
#!/usr/bin/env bash
# -I: what a student hands in is not imported.
exec /autograder/venv/bin/python -I -m kincompile.exercises.in_gradescope
"""

PL_QUESTION = """\
<pl-question-panel>
<p><a href="{{{{options.client_files_question_url}}}}/{{{{params.sheet}}}}.html" target="_blank">
Your page</a> has the mechanism and what is asked. Write a formula for each blank.</p>
{inputs}
</pl-question-panel>
<pl-submission-panel>
{feedback}
</pl-submission-panel>
"""

PL_INPUT = """\
<p><pl-string-input answers-name="{name}" label="{name} =" size="60" allow-blank="true" \
remove-leading-trailing="true" show-help-text="false"></pl-string-input></p>"""

PL_FEEDBACK = """\
<p>{name}: <code>{{{{submitted_answers.{name}}}}}</code> {{{{feedback.{name}}}}}</p>"""

PL_SERVER = '''\
"""Marks formulas on the server; kincompile lies in serverFilesCourse, or is installed."""

from kincompile.exercises.in_prairielearn import generate, grade  # noqa: F401
'''
