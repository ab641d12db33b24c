"""A derivation as one self-contained HTML page: MathML and a style sheet, no script, no network."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from kincompile.report.figure import as_svg
from kincompile.report.mathml import MathMLPrinter
from kincompile.report.renderer import Renderer
from kincompile.report.svg import element, label
from kincompile.report.templates import fill, read

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.report import document as doc
    from kincompile.report.formulas import Formula
    from kincompile.report.picture import Picture

DEEPEST_IN_CONTENTS = 2
"""Depth of the list of contents, which leaves out the nine steps."""

CELL = 18
"""Side of a cell of a pattern [pixels]."""

CHARACTER = 6.8
"""Width of a character of a pattern's labels, in a monospaced font of 11 pixels."""


def as_html(
    document: doc.Manuscript, title: str = "Derivation of", kind: str = "", after: str = ""
) -> str:
    """Return a document as an HTML page; the title stands before its name.

    The kind is the class of the page's body: ``"slides"``, which keys turn, or none. What comes
    `after` the sections is HTML: plots.
    """
    renderer = _HtmlRenderer(document)
    data = {
        "kind": kind,
        "style": read("report/math.css") + read("report/page.css").rstrip(),
        "title": escape(f"{title} {document.name}"),
        "script": read("report/slides.js") if kind == "slides" else "",
        "heading": f"{escape(title)} <code>{escape(document.name)}</code>",
        "summary": escape(document.summary),
        "contents": "\n".join(renderer.contents(document.sections)),
        "main": "\n".join(
            [*(line for item in document.sections for line in renderer.section(item, 0)), after]
        ),
    }
    return fill("report/page.html.jinja", data)


class _HtmlRenderer(Renderer):
    def __init__(self, document: doc.Manuscript) -> None:
        self._printer = MathMLPrinter(document.abbreviations)

    def contents(self, sections: tuple[doc.Chapter, ...], depth: int = 1) -> Iterator[str]:
        yield "<ol>"
        for item in sections:
            yield f'<li><a href="#{escape(item.anchor)}">{self.runs(item.title)}</a>'
            if depth < DEEPEST_IN_CONTENTS and item.sections:
                yield from self.contents(item.sections, depth + 1)
            yield "</li>"
        yield "</ol>"

    def section(self, section: doc.Chapter, depth: int) -> Iterator[str]:
        yield from super().section(section, depth)
        yield "</details></section>" if section.is_folded else "</section>"

    def heading(self, section: doc.Chapter, depth: int) -> Iterator[str]:
        level = f'<span class="level {section.level}">{section.level}</span>'
        title = self.runs(section.title) + (level if section.level else "")
        heading = f"<h{depth + 2}>{title}</h{depth + 2}>"
        yield f'<section id="{escape(section.anchor)}">'
        yield f"<details><summary>{heading}</summary>" if section.is_folded else heading

    def _paragraph(self, text: str) -> Iterator[str]:
        yield f"<p>{text}</p>"

    def _display(self, block: doc.Display) -> Iterator[str]:
        anchor = f' id="{escape(block.anchor)}"' if block.anchor else ""
        formula = self._printer.display(block.formula)
        yield f'<div class="eq wide" tabindex="0"{anchor}>{formula}</div>'
        if block.source is not None:
            yield _source(block.source)

    def _table(self, table: doc.Table) -> Iterator[str]:
        if table.folded:
            yield f"<details><summary>{escape(table.folded)}</summary>"
        header = "".join(f"<th>{self.runs(cell)}</th>" for cell in table.header)
        yield '<div class="wide" tabindex="0"><table>'
        yield f"<thead><tr>{header}</tr></thead><tbody>"
        for row in table.rows:
            yield f"<tr>{''.join(f'<td>{self.runs(cell)}</td>' for cell in row)}</tr>"
        yield "</tbody></table></div>"
        if table.folded:
            yield "</details>"

    def _pattern(self, pattern: doc.Pattern) -> Iterator[str]:
        yield from ('<div class="wide" tabindex="0">', _pattern_svg(pattern), "</div>")

    def _figure(self, picture: Picture) -> Iterator[str]:
        yield f"<figure>{as_svg(picture)}</figure>"

    def _verbatim(self, text: str) -> str:
        return f"<code>{escape(text)}</code>"

    def _math(self, formula: Formula) -> str:
        return self._printer.math(formula)

    def _link(self, link: doc.CrossReference) -> str:
        content, anchor = self.run(link.content), escape(link.anchor)
        # A formula is no name that is read out.
        name = f' aria-label="{anchor.replace("-", " ")}"' if content.startswith("<math") else ""
        return f'<a href="#{anchor}"{name}>{content}</a>'

    def _box(self, is_wide: bool) -> str:
        return f'<span class="box{" wide-box" if is_wide else ""}"></span>'

    def _prose(self, text: str) -> str:
        return escape(text)


def _source(source: doc.SourceLine) -> str:
    *before, last = source.text.split("\n")
    shown = f"line {source.number}: <code>{escape(last)}</code>"
    if not before:
        return f'<p class="src">{shown}</p>'
    code = escape("\n".join(before))
    return f'<details class="src"><summary>{shown}</summary><pre>{code}</pre></details>'


def _pattern_svg(pattern: doc.Pattern) -> str:
    """Return a picture; a filled square is an entry that can differ from zero, and a link."""
    left = 10 + CHARACTER * max(map(len, pattern.rows), default=0)
    top = 10 + CHARACTER * max(map(len, pattern.columns), default=0)
    length = CELL * len(pattern.columns)
    width, height = left + length + 4, top + CELL * len(pattern.rows) + 4
    bands = (
        element(
            "rect", class_=f"band{k % 2}", x=f"{left:.0f}", y=f"{top + CELL * first:.0f}",
            width=length, height=CELL * count,
        )
        for k, (first, count) in enumerate(pattern.bands)
    )  # fmt: skip
    rows = (
        label(name, x=f"{left - 5:.0f}", y=f"{top + CELL * (k + 0.72):.1f}", text_anchor="end")
        for k, name in enumerate(pattern.rows)
    )
    columns = (
        label(
            name, transform=f"translate({left + CELL * (k + 0.72):.1f} {top - 5:.0f}) rotate(-90)"
        )
        for k, name in enumerate(pattern.columns)
    )
    entries = (
        element(
            "a", _cell(row, column, left, top), href=f"#{escape(anchor)}",
            aria_label=f"{pattern.rows[row]} by {pattern.columns[column]}",
        )
        for (row, column), anchor in pattern.entries.items()
    )  # fmt: skip
    return element(
        "svg", "".join((*bands, *rows, *columns, *entries)), class_="pattern",
        viewBox=f"0 0 {width:.0f} {height:.0f}", width=f"{width:.0f}", height=f"{height:.0f}",
        role="group", aria_label="Pattern of the Jacobian",
    )  # fmt: skip


def _cell(row: int, column: int, left: float, top: float) -> str:
    return element(
        "rect", class_="entry", x=f"{left + CELL * column + 2:.0f}",
        y=f"{top + CELL * row + 2:.0f}", width=CELL - 4, height=CELL - 4,
    )  # fmt: skip
