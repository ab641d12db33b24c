"""The course kit: each lesson of docs/course as slides, with its mechanism live, and exercises."""

from __future__ import annotations

import argparse
import re
import tempfile
from base64 import b64encode
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, cast

from markdown_it import MarkdownIt

import kincompile as kc
from docs.builders.places import DOCS, write
from kincompile.report.document import Figure
from kincompile.report.figure import standalone_svg

if TYPE_CHECKING:
    from kincompile.model.mechanism import Mechanism

LESSONS = tuple(path.stem for path in sorted((DOCS / "course").glob("[0-9]_*.md")))

MUSEUM = "museum"
"""The lesson without a mechanism of its own: mistakes of real Jacobians."""

MODEL = re.compile(r"^<!-- file: (\S+) -->\n```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
LIVE = re.compile(r"^<!-- live: \w+ -->$", re.MULTILINE)
"""Where a lesson shows its mechanism in motion."""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body>
{body}
</body>
</html>
"""


def text_of(lesson: str) -> str:
    """Return the text of a lesson."""
    return (DOCS / "course" / f"{lesson}.md").read_text(encoding="utf-8")


def title(lesson: str) -> str:
    """Return the heading of a lesson."""
    return text_of(lesson).partition("\n")[0].removeprefix("# ")


def model_file(lesson: str) -> tuple[str, str]:
    """Return name and text of the model of a lesson."""
    (found,) = MODEL.findall(text_of(lesson))
    name, text = found
    return name, text


def model_of(lesson: str) -> Mechanism:
    """Return the mechanism of a lesson."""
    name, text = model_file(lesson)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_text(text, encoding="utf-8")
        model = kc.read_model(path)
    return cast("Mechanism", model)


def sketches() -> dict[str, str]:
    """Return the sketch of each lesson, the mechanism with the axes of its bodies."""
    found = {}
    for lesson in LESSONS:
        blocks = kc.derivation(model_of(lesson)).sections[0].blocks
        (figure,) = (item for item in blocks if isinstance(item, Figure))
        found[f"lesson_{lesson}.svg"] = standalone_svg(figure.picture)
    return found


def make(arguments: list[str]) -> None:
    """Write the kit into a folder, for a number of students."""
    parser = argparse.ArgumentParser(prog="python -m docs.builders course")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--students", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    for lesson in LESSONS:
        _write_lesson(given.folder / lesson, lesson, given.students, given.seed)
    folder, model = given.folder / MUSEUM, model_of(LESSONS[-1])
    write(folder, {"slides.html": slides(MUSEUM)})
    kc.exercise(model, given.students, given.seed, mistakes=True).write(folder / "exercise")
    write(given.folder, {"index.html": _index()})


def _write_lesson(folder: Path, lesson: str, students: int, seed: int) -> None:
    name, text = model_file(lesson)
    model = model_of(lesson)
    write(folder, {name: text, "slides.html": slides(lesson)})
    kc.page(model).write(folder / "live.html")
    derivation = kc.derivation(model)
    derivation.write(folder / "derivation.html")
    derivation.write(folder / "derivation.slides.html")
    kc.exercise(model, students, seed).write(folder / "exercise")


def slides(lesson: str) -> str:
    """Return a lesson as slides: one for each heading."""
    text = LIVE.sub(
        '<iframe src="live.html" title="The mechanism, live"></iframe>', text_of(lesson)
    )
    text = re.sub(r"^<!-- file: (\S+) -->$", r"`\1`", text, flags=re.MULTILINE)
    text = re.sub(r"!\[(.*?)\]\(\.\./(images/\S+)\)", _image, text)
    printer = MarkdownIt("commonmark", {"html": True}).enable("table")
    parts = re.split(r"^(?=## )", text, flags=re.MULTILINE)
    body = "\n".join(f"<section>{printer.render(part)}</section>" for part in parts)
    style = (DOCS / "static" / "slides.css").read_text(encoding="utf-8")
    return PAGE.format(title=escape(title(lesson)), style=style, body=body + SCRIPT)


SCRIPT = """
<script>
addEventListener("keydown", (event) => {
  const step = { ArrowRight: 1, PageDown: 1, ArrowLeft: -1, PageUp: -1 }[event.key];
  if (!step) return;
  event.preventDefault();
  scrollBy({ top: step * innerHeight, behavior: "smooth" });
});
</script>
"""
"""Arrow keys go from slide to slide."""


def _image(match: re.Match[str]) -> str:
    """Return a picture of docs/images as one that the page holds."""
    data = b64encode((DOCS / match[2]).read_bytes()).decode()
    return f'<img alt="{escape(match[1])}" src="data:image/svg+xml;base64,{data}">'


def _index() -> str:
    """Return the page that links what the kit has."""
    style = (DOCS / "static" / "slides.css").read_text(encoding="utf-8")
    body = "\n".join(_entry(lesson) for lesson in (*LESSONS, MUSEUM))
    return PAGE.format(title="Course", style=style, body=f"<main><h1>Course</h1>{body}</main>")


def _entry(lesson: str) -> str:
    links = {"slides.html": "slides"}
    if lesson != MUSEUM:
        links |= {
            "live.html": "live",
            "derivation.slides.html": "derivation as slides",
            "derivation.html": "derivation",
        }
    links |= {
        "exercise/students/01/exercise.html": "exercise of student 01",
        "exercise/instructor/solutions.html": "solutions",
    }
    shown = " · ".join(f'<a href="{lesson}/{file}">{what}</a>' for file, what in links.items())
    return f"<h2>{escape(title(lesson))}</h2><p>{shown}</p>"
