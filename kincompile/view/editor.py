"""The editor: one HTML file in which a mechanism is drawn, solved and saved, without a server."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kincompile.emitters.javascript.kernels import kernels_script
from kincompile.errors import ModelError
from kincompile.files.files import read_model
from kincompile.html import framed_html
from kincompile.model.mechanism import Mechanism
from kincompile.report.templates import fill, read
from kincompile.runtime.singular.events import SENTENCES
from kincompile.view.modules import joined
from kincompile.view.page import FRAME_HEIGHT, write_html
from kincompile.view.page_data import as_json
from kincompile.view.shapes import tables

if TYPE_CHECKING:
    from kincompile.model.system import ConstraintSystem

MODULES = (
    "draw.js", "plane.js", "formula.js", "toml.js", "sketched.js", "sparse.js", "bound.js",
    "edits.js", "history.js", "editing.js", "model_marks.js", "python_text.js", "board.js",
    "save.js", "editor.js",
)  # fmt: skip
"""The modules of the editor, in order; of those of the page it has what draws marks."""

LARGEST_FILE = 1_000_000
"""Bytes of a file that the editor opens."""


@dataclass(frozen=True, slots=True)
class Editor:
    """An editor that is ready to be written.

    Attributes
    ----------
    html
        The whole page: kernels, style sheets and scripts. It loads nothing else.
    """

    html: str

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the editor to a file, in one step, and return its path.

        Raises
        ------
        InputError
            When the name does not end in .html or .htm, or the file cannot be written.
        """
        return write_html(path, self.html)

    def _repr_html_(self) -> str:
        return framed_html(self.html, "editor", FRAME_HEIGHT)

    def __repr__(self) -> str:
        """Return the size."""
        return f"<Editor: {len(self.html) / 1e6:.2f} MB>"


def editor(
    model: Mechanism | ConstraintSystem | str | os.PathLike[str] | None = None,
) -> Editor:
    """Return a page in which a mechanism in the plane is drawn, moves at once and is saved.

    Parameters
    ----------
    model
        A model that is open in it, or the path of one. A model file stays as it is written.

    Raises
    ------
    ModelError
        If the model cannot be used as written, or a file cannot hold it.
    """
    data = {
        "file": _text_of(model),
        "tables": tables(),
        "sentences": dict(SENTENCES),
        "largest": LARGEST_FILE,
    }
    slots = {
        "title": "kincompile editor",
        "style": read("view/style.css") + read("view/editor.css"),
        "data": as_json(data),
        "scripts": [kernels_script(), joined(MODULES)],
    }
    return Editor(fill("view/editor.html.jinja", slots))


def _text_of(model: Mechanism | ConstraintSystem | str | os.PathLike[str] | None) -> str:
    """Return a model as the text of a file: as it is written, where it is one."""
    if model is None:
        return ""
    if isinstance(model, str | os.PathLike):
        path, read = Path(model), read_model(model)
    else:
        path, read = Path(), model
    if type(read) is not Mechanism:
        raise ModelError(
            f"{read.name} is no mechanism in the plane: the editor draws no other. Show it in "
            "motion with `kincompile view`, or kc.page."
        )
    return path.read_text("utf-8") if path.suffix in (".toml", ".json") else read.to_toml()
