"""The editor: one HTML file in which a mechanism is drawn, solved and saved, without a server."""

from __future__ import annotations

import json

from kincompile.emitters.javascript.kernels import kernels_script
from kincompile.report.templates import fill, read
from kincompile.runtime.singular.events import SENTENCES
from kincompile.view.modules import joined
from kincompile.view.shapes import tables

MODULES = (
    "draw.js", "plane.js", "formula.js", "toml.js", "sketched.js", "sparse.js", "bound.js",
    "edits.js", "editing.js", "model_marks.js", "python_text.js", "board.js", "editor.js",
)  # fmt: skip
"""The modules of the editor, in order."""

LARGEST_FILE = 1_000_000
"""Bytes of a file that the editor opens."""


def editor_page(text: str = "") -> str:
    """Return the editor as HTML, with a model file open in it, if there is one."""
    data = {
        "file": text,
        "tables": tables(),
        "sentences": dict(SENTENCES),
        "largest": LARGEST_FILE,
    }
    slots = {
        "title": "kincompile editor",
        "style": read("view/style.css") + read("view/editor.css"),
        "data": json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
        "scripts": [kernels_script(), joined(MODULES)],
    }
    return fill("view/editor.html.jinja", slots)
