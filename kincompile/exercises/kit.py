"""`kc.exercise`: pages and hand-in files for students, solutions and a key for the instructor."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from kincompile.errors import InputError
from kincompile.exercises.blanks import PLACE, Blank, choose_blanks
from kincompile.exercises.sheet import sheet, solutions, together
from kincompile.exercises.systems import files_for
from kincompile.exercises.variants import Choices, variants
from kincompile.model.mechanism import Mechanism
from kincompile.names import rate
from kincompile.report.to_html import as_html
from kincompile.report.to_latex import as_tex
from kincompile.writing import write_folder

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    from kincompile.exercises.blanks import State
    from kincompile.exercises.mistakes import Mistake
    from kincompile.model.system import ConstraintSystem
    from kincompile.report.document import Manuscript

FORMAT = 2
"""Version of what `mark` reads."""

STUDENTS, HAND_IN = "students", "hand_in.txt"
"""Folder of the students, and the file that each of them fills."""

INSTRUCTOR, MODELS, BLANKS = "instructor", "models", "blanks.json"
"""Folder of the instructor, in it that of the variants and what the blanks are."""

ANSWERS = "answers.csv"
"""What was written on the sheets of an exam, as the instructor types it in."""

MOST_STUDENTS = 500
"""Students of one kit."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ExerciseKit:
    """Variants of a mechanism with blanks to fill, ready to be written.

    Attributes
    ----------
    name
        Name of the mechanism.
    blanks
        What each student is to fill.
    variants
        The mechanism of each student, or the free equations.
    mistakes
        The Jacobians with a slip of each student; none where entries are to be derived.
    states, values
        Of an exam the state of each sheet, and the values of its blanks there, as text.
    """

    name: str
    blanks: tuple[tuple[Blank, ...], ...]
    variants: tuple[Mechanism | ConstraintSystem, ...]
    mistakes: tuple[tuple[Mistake, ...], ...]
    states: tuple[State, ...] = ()
    values: tuple[Sequence[str], ...] = ()

    @property
    def students(self) -> tuple[str, ...]:
        """Names of the students' folders: 01, 02, ..."""
        digits = max(2, len(str(len(self.variants))))
        return tuple(f"{k:0{digits}}" for k in range(1, len(self.variants) + 1))

    @property
    def systems(self) -> tuple[ConstraintSystem, ...]:
        """The equations of each student."""
        return tuple(item.system() for item in self.variants)

    def files(self, system: str | None = None) -> dict[str, str]:
        """Return the text of every file by its path; the same for the same seed.

        With a system, as for `write`, the files that it takes.
        """
        found = self._files()
        return found if system is None else files_for(system, self, found)

    def _files(self) -> dict[str, str]:
        systems = self.systems
        found: dict[str, str] = {}
        pages: dict[str, Manuscript] = {}
        states = self.states or (None,) * len(systems)
        for student, system, blanks, slips, state in zip(
            self.students, systems, self.blanks, self.mistakes, states, strict=True
        ):
            folder = f"{STUDENTS}/{student}"
            page = pages[student] = sheet(system, blanks, slips, student, state)
            if state is None:
                found[f"{folder}/exercise.html"] = as_html(page, "Exercise", "exercise")
                found[f"{folder}/{HAND_IN}"] = self._hand_in(student, system, blanks)
            else:
                own_page = together(self.name, {student: page})
                found[f"{folder}/sheet.html"] = as_html(own_page, "Exam", "exam sheets")
            found[f"{INSTRUCTOR}/{MODELS}/{student}.toml"] = system.to_toml()
        if self.states:
            page = together(self.name, pages)
            found[f"{STUDENTS}/sheets.html"] = as_html(page, "Exam", "exam sheets")
            found[f"{STUDENTS}/sheets.tex"] = as_tex(page, "Exam", is_exam=True)
            names = [item.name for item in self.blanks[0]]
            lines = [",".join(("sheet", *names)), *(x + "," * len(names) for x in self.students)]
            found[ANSWERS] = "\n".join(lines) + "\n"
        page = solutions(self.name, systems, self.blanks, self.mistakes, self.students, self.values)
        found[f"{INSTRUCTOR}/solutions.html"] = as_html(page, "Solutions of", "key")
        blanks_of = {
            student: [{**asdict(item), "question": _question(item, own, system)} for item in own]
            for student, own, system in zip(self.students, self.blanks, systems, strict=True)
        }
        key: dict[str, Any] = {"format": FORMAT, "name": self.name, "blanks": blanks_of}
        key |= {"states": dict(zip(self.students, self.states, strict=True))} if self.states else {}
        found[f"{INSTRUCTOR}/{BLANKS}"] = json.dumps(key, indent=1) + "\n"
        return found

    def write(self, folder: str | os.PathLike[str], system: str | None = None) -> Path:
        """Write the kit to a new folder, whole or not at all, and return the folder.

        Parameters
        ----------
        folder
            What to write.
        system
            What the course is taught with: ``"gradescope"``, ``"moodle"``, ``"nbgrader"``,
            ``"otter"`` or ``"prairielearn"``. None for files that `mark` reads.

        Raises
        ------
        InputError
            If the folder exists and is not empty, or cannot be made, or there is no such system.
        UnsupportedError
            If STACK of Moodle cannot ask for a blank.
        """
        return write_folder(folder, lambda: self.files(system))

    def _hand_in(self, student: str, system: ConstraintSystem, blanks: Sequence[Blank]) -> str:
        last = system.bodies[0].coordinates[-1] if system.bodies else system.coordinates[0].name
        turned = f"sin({last})" if system.ground.kind.units[-1] == "rad" else last
        lines = [
            f"# {self.name}, student {student}. Write a formula after each = sign, for instance"
        ]
        if any(item.quantity == PLACE for item in blanks):
            entry = f"{system.equations[0]}, {system.coordinates[0].name}"
            lines += [f"#   P1 = {entry}", f"#   B1 = -0.25*{turned}"]
        else:
            forms = {"Phi_q": f"-0.25*{turned}", "gamma": f"-0.25*{turned}*{rate(last)}^2"}
            first = {item.quantity: item.name for item in reversed(blanks)}
            lines += [f"#   {first[x]} = {form}" for x, form in forms.items() if x in first]
        lines += ["# Lines with # are comments. An empty blank has no points.", ""]
        for item in blanks:
            lines += [f"# {_question(item, blanks, system)}", f"{item.name} ="]
        return "\n".join(lines) + "\n"

    def __repr__(self) -> str:
        """Return name and sizes."""
        return f"<ExerciseKit {self.name!r}: {self.sizes}>"

    @property
    def sizes(self) -> str:
        """How many students and blanks it has, in words."""
        return f"{len(self.variants)} students, {len(self.blanks[0])} blanks"


def _question(item: Blank, blanks: Sequence[Blank], system: ConstraintSystem) -> str:
    """Return what a blank asks; where a mistake is to be found, without its place."""
    if item.quantity == PLACE:
        return f"Phi_q of {item.constraint}: which entry is wrong?"
    if f"P{item.name[1:]}" in [other.name for other in blanks]:
        return "and what belongs there"
    return item.label(system)


def exercise(
    model: Mechanism | ConstraintSystem,
    students: int = 1,
    seed: int = 0,
    *,
    signs: bool = False,
    lengths: bool = False,
    mistakes: bool = False,
    exam: bool = False,
) -> ExerciseKit:
    """Make an exercise: for each student a variant of a mechanism with entries to derive by hand.

    Each variant has other numbers for the parameters (for points and distances, where there are no
    parameters), assembles and moves through its motion. Up to six entries of Phi_q and three of
    gamma are blanks, of all joints in turn; none that is zero wherever the constraints hold.

    Parameters
    ----------
    model
        The mechanism.
    students
        How many variants; all differ.
    seed
        The same seed gives the same files, byte by byte.
    signs
        Turn the frames of some bodies by half a turn, so that signs differ too.
    lengths
        Change points and distances that are given as numbers too.
    mistakes
        Find the mistake: three Jacobians of constraints are shown, each with one slip, other ones
        for each student. The blanks are its place and the right entry. Free equations, which have
        no variants, may be given too.
    exam
        Numbered sheets to be filled on paper: each has a state of its own, at which the entries
        are asked for as numbers too. What was written is typed into ``answers.csv``.

    Returns
    -------
    ExerciseKit
        ``.write(folder)`` writes pages, hand-in files, solutions and what `mark` reads.

    Raises
    ------
    ModelError
        If the model cannot be used as written.
    InputError
        If it is no mechanism with joints, or no variants are found that assemble.
    """
    if not isinstance(model, Mechanism) and not mistakes:
        raise InputError(
            f"{getattr(model, 'name', model)} is no mechanism of bodies and joints, which an "
            "exercise needs: it is a system of free equations"
        )
    if exam and mistakes:
        raise InputError("an exam has entries to derive, and no mistakes to find; give one of both")
    wanted: Any = students  # whatever its type says
    if not isinstance(wanted, int) or not 1 <= wanted <= MOST_STUDENTS:
        raise InputError(f"{students!r} students: give a number from 1 to {MOST_STUDENTS}")
    made: list[Any] = [model] * students
    if isinstance(model, Mechanism):
        made = [*variants(model, students, seed, Choices(signs, lengths))]
    if not mistakes:
        blanks = choose_blanks(made[0].system(), seed)
        states: Any = ()
        sheets = import_module("kincompile.exercises.exam")  # it loads the checker
        blanks = sheets.choose_questions(made[0], blanks)
        if exam:
            states = [
                sheets.choose_state(x, blanks, f"{seed}-{k}") for k, x in enumerate(made, start=1)
            ]
        of_all = (blanks,) * students, tuple(made), ((),) * students
        return ExerciseKit(model.name, *of_all, *map(tuple, zip(*states, strict=True)))
    drawing = import_module("kincompile.exercises.mistakes")  # it loads the checker
    slips = [
        drawing.choose_mistakes(x.system(), f"{seed}-{k}") for k, x in enumerate(made, start=1)
    ]
    filled = tuple(tuple(x for item in own for x in (item.place, item.entry)) for own in slips)
    return ExerciseKit(model.name, filled, tuple(made), tuple(slips))
