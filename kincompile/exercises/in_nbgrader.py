"""The preprocessor of nbgrader that marks a notebook: its text is marked, its code is not run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nbformat.v4 import new_output
from nbgrader.preprocessors import Execute
from nbgrader.utils import is_grade
from traitlets import Dict

from kincompile.exercises.handed_in import marked, raw_lines

PREPROCESSORS = [
    "kincompile.exercises.in_nbgrader.MarkFormulas",
    *(
        f"nbgrader.preprocessors.{name}"
        for name in ("IgnorePattern", "LimitOutput", "SaveAutoGrades", "AssignLatePenalties")
    ),
    "nbgrader.preprocessors.CheckCellMetadata",
]
"""Those of nbgrader's autograde, with this one in the place of Execute."""


class MarkFormulas(Execute):  # type: ignore[misc]
    """Marks the notebooks of exercises; those of other assignments are executed as ever."""

    exercises = Dict(help="Folder that kincompile exercise wrote, by assignment.").tag(config=True)

    def preprocess(self, nb: Any, resources: Any, *rest: Any) -> tuple[Any, Any]:
        """Give the test of each blank an error as its output where it is not right."""
        own = resources["nbgrader"]
        if own["assignment"] not in self.exercises:
            done: tuple[Any, Any] = super().preprocess(nb, resources, *rest)
            return done
        lines, problem = raw_lines(nb.cells)
        found = marked(Path(self.exercises[own["assignment"]]), lines, [own["student"]], problem)
        wrong = {item.blank.name: item.reason for item in found if not item.points}
        for cell in nb.cells:
            if cell.cell_type != "code":
                continue
            cell.outputs, cell.execution_count = [], None  # whatever a student put there
            name = cell.metadata.get("nbgrader", {}).get("grade_id")
            if is_grade(cell) and name in wrong:
                said = {"ename": name, "evalue": wrong[name], "traceback": [wrong[name]]}
                cell.outputs = [new_output("error", **said)]
        return nb, resources
