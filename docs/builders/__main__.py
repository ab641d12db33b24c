"""`python -m docs.builders WHAT [FOLDER]`: write pictures, pages, short lines or the course kit."""

from __future__ import annotations

import sys

from docs.builders import api, course, fields, joints, lessons, notebooks, pictures, wrap
from docs.builders.places import DOCS, ROOT, write

WRITERS = {
    "pictures": lambda: write(
        DOCS / "images", {**joints.pictures(), **lessons.sketches(), **pictures.drawn()}
    ),
    "joints": lambda: write(DOCS, {"joints.md": joints.page()}),
    "api": lambda: write(DOCS, {api.PAGE: api.page()}),
    "fields": lambda: write(DOCS, {fields.PAGE: fields.page()}),
    "notebooks": lambda: write(notebooks.FOLDER, notebooks.notebooks()),
    "wrap": lambda: write(
        ROOT, {str(path): wrap.wrapped(path.read_text("utf-8")) for path in wrap.pages()}
    ),
    "course": lambda: course.make(sys.argv[2:]),
}

if __name__ == "__main__":
    WRITERS[sys.argv[1]]()
