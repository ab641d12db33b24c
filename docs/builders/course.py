"""The course kit: each lesson of docs/course as a page, slides, a notebook, and exercises."""

from __future__ import annotations

import argparse
import re
from base64 import b64encode
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markdown_it import MarkdownIt
from markdown_it.common.utils import escapeHtml

import kincompile as kc
from docs.builders import beamer, lessons, notebooks
from docs.builders.formulas import as_mathml
from docs.builders.lessons import Lesson
from docs.builders.places import DOCS, ROOT, write

if TYPE_CHECKING:
    from collections.abc import Sequence

    from markdown_it.token import Token

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


LIVE = """<iframe src="live.html" title="The mechanism, live"></iframe>
<p class="paper">The mechanism in motion: open live.html.</p>"""
"""The mechanism on a screen, and what stands there on paper."""


def make(arguments: list[str]) -> None:
    """Write the kit into a folder, for a number of students."""
    parser = argparse.ArgumentParser(prog="python -m docs.builders course")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--students", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lessons", nargs="*", default=[""], help="how their names begin")
    parser.add_argument("--mistakes", action="store_true", help="slips for each student too")
    given = parser.parse_args(arguments)
    names = [name for name in lessons.NAMES if name.startswith(tuple(given.lessons))]
    for name in names:
        lesson, folder = Lesson(name), given.folder / name
        write_lesson(folder, lesson)
        kc.exercise(lesson.model, given.students, given.seed).write(folder / "exercise")
        if given.mistakes:
            kit = kc.exercise(lesson.model, given.students, given.seed, mistakes=True)
            kit.write(folder / "mistakes")
    for name in lessons.OTHERS:
        write(given.folder / name, _shown(Lesson(name)))
    write(given.folder, {"index.html": _index(names, given.mistakes)})


def write_lesson(folder: Path, lesson: Lesson) -> None:
    """Write what all students get of a lesson into a folder."""
    file, text = lesson.model_file
    model = lesson.model
    write(folder, {file: text, "slides.tex": beamer.beamer(lesson), **_shown(lesson)})
    kc.page(model).write(folder / "live.html")
    derivation = kc.derivation(model)
    derivation.write(folder / "derivation.html")
    derivation.write(folder / "derivation.slides.html")


def _shown(lesson: Lesson) -> dict[str, str]:
    """Return page, slides and notebook of a text."""
    text = notebooks.of_lesson(lesson.text)
    return {"page.html": page(lesson), "slides.html": slides(lesson), "notebook.ipynb": text}


def page(lesson: Lesson) -> str:
    """Return a lesson as a page to read."""
    return _filled(lesson.title, f"<main>{_as_html(lesson.text)}</main>")


def slides(lesson: Lesson) -> str:
    """Return a lesson as slides: one for each heading."""
    parts = re.split(r"^(?=## )", lesson.text, flags=re.MULTILINE)
    body = "\n".join(f"<section>{_as_html(part)}</section>" for part in parts)
    return _filled(lesson.title, body + SCRIPT)


def _as_html(text: str) -> str:
    """Return Markdown of docs/course as a part of a page that stands alone."""
    text = lessons.LIVE.sub(LIVE, text)
    text = lessons.MATH.sub(_formula, text)
    text = re.sub(r"^<!-- (?:file|excerpt): (\S+) -->$", r"`\1`", text, flags=re.MULTILINE)
    text = re.sub(r"^<!-- .*? -->\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"!\[(.*?)\]\(\.\./(images/\S+)\)", _image, text)
    text = re.sub(r"\]\((\w+)\.md\)", r"](../\1/page.html)", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\.md[^)]*\)", r"\1", text)  # the documentation stays behind
    reader = MarkdownIt("commonmark", {"html": True}).enable("table")
    reader.add_render_rule("text", _prose)
    return str(reader.render(text))


def _prose(_: Any, tokens: Sequence[Token], index: int, *given: object) -> str:
    """Return plain text; r_i has an index."""
    return lessons.INDEX.sub(r"\1<sub>\2</sub>", str(escapeHtml(tokens[index].content)))


def _formula(match: re.Match[str]) -> str:
    return f'<div class="math" tabindex="0">{as_mathml(match[1], "block")}</div>'


def _filled(title: str, body: str) -> str:
    style = (ROOT / "templates" / "report" / "math.css").read_text(encoding="utf-8")
    style += (DOCS / "static" / "slides.css").read_text(encoding="utf-8")
    return PAGE.format(title=escape(title), style=style, body=body)


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


def _index(names: list[str], has_mistakes: bool) -> str:
    """Return the page that links what the kit has: the syllabus, then every file."""
    table = re.sub(r"\]\((\w+)\.md\)", r"](\1/page.html)", lessons.syllabus(names))
    shown = MarkdownIt("commonmark").enable("table").render(f"# Course\n\n{table}")
    body = "\n".join(_entry(name, has_mistakes) for name in (*names, *lessons.OTHERS))
    return _filled("Course", f"<main>{shown}{body}</main>")


def _entry(name: str, has_mistakes: bool) -> str:
    links = {"page.html": "page", "slides.html": "slides", "notebook.ipynb": "notebook"}
    if name in lessons.NAMES:
        links |= {
            "slides.tex": "beamer",
            "live.html": "live",
            "derivation.slides.html": "derivation as slides",
            "derivation.html": "derivation",
            "exercise/students/01/exercise.html": "exercise of student 01",
            "exercise/instructor/solutions.html": "solutions",
        }
    if name in lessons.NAMES and has_mistakes:
        links |= {
            "mistakes/students/01/exercise.html": "find the mistake, student 01",
            "mistakes/instructor/solutions.html": "its solutions",
        }
    shown = " · ".join(f'<a href="{name}/{file}">{what}</a>' for file, what in links.items())
    return f"<h2>{escape(Lesson(name).title)}</h2><p>{shown}</p>"
