"""`kc.exercise`: pages and hand-in files for students, solutions and a key for the instructor."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile.errors import InputError
from kincompile.exercises.blanks import Blank, choose_blanks
from kincompile.exercises.sheet import sheet, solutions
from kincompile.exercises.variants import Choices, variants
from kincompile.model.mechanism import Mechanism
from kincompile.names import rate
from kincompile.report.to_html import as_html

if TYPE_CHECKING:
    import os

    from kincompile.model.system import ConstraintSystem

FORMAT = 1
"""Version of what `mark` reads."""

STUDENTS, HAND_IN = "students", "hand_in.txt"
"""Folder of the students, and the file that each of them fills."""

INSTRUCTOR, MODELS, BLANKS = "instructor", "models", "blanks.json"
"""Folder of the instructor, in it that of the variants and what the blanks are."""

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
        What is to be filled, the same for all.
    variants
        The mechanism of each student.
    """

    name: str
    blanks: tuple[Blank, ...]
    variants: tuple[Mechanism, ...]

    @property
    def students(self) -> tuple[str, ...]:
        """Names of the students' folders: 01, 02, ..."""
        digits = max(2, len(str(len(self.variants))))
        return tuple(f"{k:0{digits}}" for k in range(1, len(self.variants) + 1))

    def files(self) -> dict[str, str]:
        """Return the text of every file by its path; the same for the same seed."""
        systems = [item.system() for item in self.variants]
        found: dict[str, str] = {}
        for student, system in zip(self.students, systems, strict=True):
            folder = f"{STUDENTS}/{student}"
            page = sheet(system, self.blanks, student)
            found[f"{folder}/exercise.html"] = as_html(page, "Exercise")
            found[f"{folder}/{HAND_IN}"] = self._hand_in(student, system)
            found[f"{INSTRUCTOR}/{MODELS}/{student}.toml"] = system.to_toml()
        page = solutions(self.name, systems, self.blanks, self.students)
        found[f"{INSTRUCTOR}/solutions.html"] = as_html(page, "Solutions of")
        blanks = {"format": FORMAT, "blanks": [asdict(item) for item in self.blanks]}
        found[f"{INSTRUCTOR}/{BLANKS}"] = json.dumps(blanks, indent=1) + "\n"
        return found

    def write(self, folder: str | os.PathLike[str]) -> Path:
        """Write the kit to a new folder, whole or not at all, and return the folder.

        Raises
        ------
        InputError
            If the folder exists and is not empty, or cannot be made.
        """
        target = Path(folder)
        require_new_folder(target)
        try:
            draft = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.resolve().parent))
            try:
                for path, content in self.files().items():
                    file = draft / path
                    file.parent.mkdir(parents=True, exist_ok=True)
                    file.write_bytes(content.encode())
                draft.chmod(0o755)
                draft.replace(target)
            finally:
                shutil.rmtree(draft, ignore_errors=True)
        except OSError as error:
            raise InputError(
                f"cannot write {target}: {error.strerror}; name another one"
            ) from error
        return target

    def _hand_in(self, student: str, system: ConstraintSystem) -> str:
        body = system.bodies[0]
        last = body.coordinates[-1]
        turned = f"sin({last})" if body.kind.units[-1] == "rad" else last
        lines = [
            f"# {self.name}, student {student}. Write a formula after each = sign, for instance",
            f"#   B1 = -0.25*{turned}*{rate(last)}**2",
            "# Lines with # are comments. An empty blank has no points.",
            "",
        ]
        lines += [
            line for item in self.blanks for line in (f"# {item.label(system)}", f"{item.name} =")
        ]
        return "\n".join(lines) + "\n"

    def __repr__(self) -> str:
        """Return name and sizes."""
        return f"<ExerciseKit {self.name!r}: {self.sizes}>"

    @property
    def sizes(self) -> str:
        """How many students and blanks it has, in words."""
        return f"{len(self.variants)} students, {len(self.blanks)} blanks"


def exercise(
    model: Mechanism,
    students: int = 1,
    seed: int = 0,
    *,
    signs: bool = False,
    lengths: bool = False,
) -> ExerciseKit:
    """Make an exercise: for each student a variant of a mechanism with entries to derive by hand.

    Each variant has other numbers for the parameters (for points and distances, where there are no
    parameters), assembles and moves through its motion. Six entries of Phi_q and three of gamma
    are blanks, of all joints in turn.

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
    if not isinstance(model, Mechanism):
        raise InputError(
            f"{getattr(model, 'name', model)} is no mechanism of bodies and joints, which an "
            "exercise needs: it is a system of free equations"
        )
    wanted: Any = students  # whatever its type says
    if not isinstance(wanted, int) or not 1 <= wanted <= MOST_STUDENTS:
        raise InputError(f"{students!r} students: give a number from 1 to {MOST_STUDENTS}")
    made = variants(model, students, seed, Choices(signs, lengths))
    blanks = choose_blanks(made[0].system(), seed)
    return ExerciseKit(model.name, blanks, tuple(made))


def require_new_folder(folder: Path) -> None:
    """Refuse a folder that exists and is not empty, or whose place does not exist."""
    if folder.is_dir() and not any(folder.iterdir()):
        return
    if folder.exists():
        raise InputError(f"{folder} exists: name a new folder, so that no hand-in is overwritten")
    if not folder.resolve().parent.is_dir():
        raise InputError(f"cannot write {folder}: the folder {folder.parent} does not exist")
