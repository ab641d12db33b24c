"""The plugin of otter-grader that marks a notebook: its text is marked, its code is not run."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from nbformat.v4 import new_code_cell, new_notebook
from otter.plugins import AbstractOtterPlugin

from kincompile.exercises.handed_in import marked, raw_lines
from kincompile.exercises.in_gradescope import users_of


class Marks(AbstractOtterPlugin):  # type: ignore[misc]
    """Gives the tests of otter the marks of a notebook in its place."""

    def before_grading(self, _: Any) -> None:
        """Remove what came with the notebook, before otter reads a log or Python imports it."""
        kept = Path(self.submission_path)
        for item in kept.parent.iterdir():
            if item == kept or (item.name == "tests" and not item.is_symlink()):
                continue
            if item.is_dir() and not item.is_symlink():
                shutil.rmtree(item)
            else:
                item.unlink()

    def before_execution(self, submission: Any) -> Any:
        """Return a notebook with the marks, which the tests read, and nothing of the student's."""
        folder = Path(self.submission_path).parents[1] / "source" / "files"
        lines, problem = raw_lines(submission["cells"])
        found = marked(folder, lines, users_of(self.submission_metadata), problem)
        marks = {item.blank.name: (item.points, item.reason) for item in found}
        return new_notebook(cells=[new_code_cell(f"marks = {marks!r}")])
