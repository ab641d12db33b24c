"""The lessons of the course, one file of docs/course each: text, model, formulas, a mistake.

Below the heading a line says where the book has it, and the goal: `*Haug 3.3.* You can ...`. A
program after `<!-- file: NAME -->` is the model. A formula after `<!-- formula: QUANTITY JOINT -->`
is what the compiler derives, and one after `<!-- mistake: ... -->` has a slip; tests compare both.
`<!-- live: NAME -->` is where the mechanism is shown in motion.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, cast

import kincompile as kc
from docs.builders.places import DOCS
from kincompile.report.document import Figure
from kincompile.report.figure import standalone_svg

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.model.mechanism import Mechanism

FOLDER = DOCS / "course"
NAMES = tuple(path.stem for path in sorted(FOLDER.glob("[0-9][0-9]_*.md")))
OTHERS = ("museum", "project")
"""Texts without a mechanism of their own: real mistakes, and the week of the project."""

MODEL = re.compile(r"^<!-- file: (\S+) -->\n```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
LIVE = re.compile(r"^<!-- live: (\w+) -->$", re.MULTILINE)
HEAD = re.compile(r"^\*Haug (.*?)\.\* (.*)$", re.MULTILINE)
MATH = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)
STATED = re.compile(
    r"^<!-- (formula|mistake): (\w+) ?([^\n]*?) ?-->\n```math\n(.*?)^```$", re.MULTILINE | re.DOTALL
)
SYLLABUS = "<!-- syllabus -->"
INDEX = re.compile(r"(?<![^\W_])([^\W\d_][\u0307\u0308]?|\))_([A-Za-z]+)\b")
"""A letter or a bracket with an index, in prose: r_i, but not phi_crank."""


@dataclass(frozen=True, slots=True)
class Stated:
    """A formula that a lesson prints.

    Attributes
    ----------
    kind
        `formula`, or `mistake` where one entry is wrong.
    quantity, constraint
        What it is, of which constraint; of the whole system where that is empty.
    matrix
        The right side, in LaTeX.
    """

    kind: str
    quantity: str
    constraint: str
    matrix: str


@dataclass(frozen=True)
class Lesson:
    """A lesson by the name of its file."""

    name: str

    @cached_property
    def text(self) -> str:
        """All of it, in Markdown."""
        return (FOLDER / f"{self.name}.md").read_text(encoding="utf-8")

    @property
    def title(self) -> str:
        """Its heading."""
        return self.text.partition("\n")[0].removeprefix("# ")

    @property
    def book(self) -> str:
        """Sections of the book."""
        return self._head[1]

    @property
    def goal(self) -> str:
        """What a student can do afterwards."""
        return self._head[2]

    @property
    def _head(self) -> re.Match[str]:
        found = HEAD.search(self.text)
        if found is None:
            raise ValueError(f"{self.name}: the line *Haug ...* with the goal is missing")
        return found

    @property
    def model_file(self) -> tuple[str, str]:
        """Name and text of the model."""
        (found,) = MODEL.findall(self.text)
        name, text = found
        return name, text

    @cached_property
    def model(self) -> Mechanism:
        """The mechanism."""
        name, text = self.model_file
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, name)
            path.write_text(text, encoding="utf-8")
            return cast("Mechanism", kc.read_model(path))

    @property
    def stated(self) -> list[Stated]:
        """The formulas that it prints."""
        return [
            Stated(kind, quantity, constraint, self._named(matrix[matrix.index(r"\begin") :]))
            for kind, quantity, constraint, matrix in STATED.findall(self.text)
        ]

    def _named(self, matrix: str) -> str:
        """Return a formula with the name of the place of contact, of which a lesson has one."""
        names = [x.name for x in self.model.system().coordinates if x.name.startswith("alpha_")]
        return matrix.replace(r"\alpha", names[0]) if names else matrix


def sketches() -> dict[str, str]:
    """Return the sketch of each lesson, the mechanism with the axes of its bodies."""
    found = {}
    for name in NAMES:
        blocks = kc.derivation(Lesson(name).model).sections[0].blocks
        (figure,) = (item for item in blocks if isinstance(item, Figure))
        found[f"lesson_{name}.svg"] = standalone_svg(figure.picture)
    return found


def syllabus(names: Iterable[str] = NAMES) -> str:
    """Return the table of lessons: number and title, sections of the book, goal."""
    rows = [f"| [{x.title}]({x.name}.md) | {x.book} | {x.goal} |" for x in map(Lesson, names)]
    return "\n".join(["| lesson | Haug | goal |", "| --- | --- | --- |", *rows])
