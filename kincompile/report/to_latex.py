"""A derivation as a LaTeX document, for pdflatex with the packages that every Debian has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.calculus.expressions import Symbol, VectorSymbol
from kincompile.report.document import CrossReference, Verbatim
from kincompile.report.picture import FILL
from kincompile.report.renderer import Renderer
from kincompile.report.templates import fill
from kincompile.report.tex import TexPrinter, escape

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.report.document import Chapter, Display, Manuscript, Pattern, Run, Table
    from kincompile.report.formulas import Formula
    from kincompile.report.picture import Picture, PicturePath

HEADINGS = ("section", "subsection", "subsubsection")

ROWS_TOGETHER = 24
"""Rows of a table that stay on one page; a longer table is split."""

LONGEST_CELL = 300
"""Characters of LaTeX in a cell above which its lines are broken."""

MOST_PARAGRAPHS = 5
"""Columns up to which lines in cells are broken; a wider table is shrunk instead."""


def as_tex(document: Manuscript, title: str = "Derivation of", *, is_exam: bool = False) -> str:
    """Return a document as LaTeX; of an exam each section begins a page, and heads its pages."""
    renderer = _LatexRenderer(document, is_exam)
    data = {
        "title": rf"{title} \texttt{{{escape(document.name)}}}",
        "is_exam": is_exam,
        "summary": escape(document.summary),
        "body": "\n".join(line for item in document.sections for line in renderer.section(item, 0)),
    }
    return fill("report/document.tex.jinja", data)


class _LatexRenderer(Renderer):
    def __init__(self, document: Manuscript, is_exam: bool) -> None:
        self._is_exam = is_exam
        self._printer = TexPrinter(document.abbreviations, is_breakable=True)

    def heading(self, section: Chapter, depth: int) -> Iterator[str]:
        level = rf" \level{{{section.level}}}" if section.level else ""
        plain = "".join(escape(_plain(run)) for run in section.title)
        heading = HEADINGS[min(depth, len(HEADINGS) - 1)]
        title = rf"\texorpdfstring{{{self.runs(section.title)}{level}}}{{{plain}}}"
        if self._is_exam and 0 < depth < len(HEADINGS):
            yield r"\together"
        yield rf"\{heading}{{{title}}}"
        yield _target(section.anchor)

    def _paragraph(self, text: str) -> Iterator[str]:
        yield f"{text}\n"

    def _display(self, block: Display) -> Iterator[str]:
        pieces = self._printer.pieces(block.formula)
        target = _target(block.anchor) if block.anchor else ""
        yield rf"\formula{{{target}%"
        for piece in pieces:  # no line is broken within a matrix
            yield rf"\{'block' if 'bmatrix' in piece else 'piece'}{{{piece}}}%"
        yield "}"
        if block.source is not None:
            lines = r" \\ ".join(escape(line) for line in block.source.text.split("\n"))
            yield rf"\source{{{block.source.number}}}{{{lines}}}"

    def _table(self, table: Table) -> Iterator[str]:
        if table.folded:
            yield f"{escape(table.folded)}:\n"
        header = [self.runs(cell) for cell in table.header]
        for first in range(0, len(table.rows), ROWS_TOGETHER):
            rows = table.rows[first : first + ROWS_TOGETHER]
            yield from _tabular(header, [[self.runs(cell) for cell in row] for row in rows])

    def _pattern(self, pattern: Pattern) -> Iterator[str]:
        header = [rf"\rotatebox{{90}}{{{self._verbatim(name)}}}" for name in pattern.columns]
        rows = []
        for row, name in enumerate(pattern.rows):
            anchors = (pattern.entries.get((row, column)) for column in range(len(header)))
            marks = ("" if item is None else _hyperlink(item, r"$\bullet$") for item in anchors)
            rows.append([self._verbatim(name), *marks])
        yield from _tabular(["", *header], rows)

    def _figure(self, picture: Picture) -> Iterator[str]:
        yield rf"\drawn{{\begin{{picture}}({picture.width:.0f},{picture.height:.0f})%"
        yield r"\put(0,0){\pdfliteral{q 1 J 1 j"
        yield from (_drawn(path) for path in picture.paths)
        yield "Q}}%"
        for label in picture.labels:
            node = VectorSymbol(label.name) if label.is_vector else Symbol(label.name)
            symbol = self._printer.math(node)
            at = f"({label.x:.1f},{label.y:.1f})"
            yield rf"\put{at}{{\makebox(0,0){{\small ${symbol}$}}}}%"
        yield r"\end{picture}}"

    def _verbatim(self, text: str) -> str:
        return rf"\texttt{{{escape(text)}}}"

    def _math(self, formula: Formula) -> str:
        return f"${self._printer.math(formula)}$"

    def _link(self, link: CrossReference) -> str:
        return _hyperlink(link.anchor, self.run(link.content))

    def _box(self, is_wide: bool) -> str:
        return rf"\fillin{{{64 if is_wide else 28}mm}}"

    def _prose(self, text: str) -> str:
        return escape(text)


def _drawn(path: PicturePath) -> str:
    """Return a path in the operators of PDF; what is faint or pale is mixed with white."""
    points = np.asarray(path.points).tolist()
    corners = " l ".join(f"{x:.1f} {y:.1f}" for x, y in points[1:])
    way = f"{points[0][0]:.1f} {points[0][1]:.1f} m {corners} l"
    strength = path.opacity * (FILL if path.is_pale else 1)
    fill = f"{_mixed(path.fill, strength)} rg" if path.fill else ""
    line = f"{_mixed(path.stroke, path.opacity)} RG {path.width} w" if path.stroke else ""
    paint = {(True, True): "b", (True, False): "h f", (False, True): "S"}
    dash = {"--": "[5 4] 0 d", ":": "[1 3] 0 d", "": "[] 0 d"}[path.dash]
    return f"{fill} {line} {dash} {way} {paint[bool(path.fill), bool(path.stroke)]}"


def _mixed(colour: str, strength: float) -> str:
    """Return a colour on white as three numbers from 0 to 1."""
    parts = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return " ".join(f"{1 - strength * (1 - part):.3f}" for part in parts)


def _plain(run: Run) -> str:
    """Return a run as plain text, for the bookmarks of a PDF."""
    match run:
        case Verbatim(text):
            return text
        case CrossReference(_, content):
            return _plain(content)
        case str():
            return run
    return ""


def _target(anchor: str) -> str:
    return rf"\hypertarget{{{anchor}}}{{}}"


def _hyperlink(anchor: str, content: str) -> str:
    return rf"\hyperlink{{{anchor}}}{{{content}}}"


def _tabular(header: list[str], rows: list[list[str]]) -> Iterator[str]:
    """Yield a table, as wide as its cells, or as wide as the page with broken lines."""
    sizes = [max(len(row[k]) for row in (header, *rows)) for k in range(len(header))]
    is_wide = max(sizes) > LONGEST_CELL and len(header) <= MOST_PARAGRAPHS
    columns = _shares(sizes) if is_wide else "l" * len(header)
    frame = r"\par" if is_wide else r"\fitted"
    yield rf"{frame}{{\begin{{tabular}}{{{columns}}}"
    yield rf"{' & '.join(header)} \\ \hline"
    yield from (rf"{' & '.join(row)} \\" for row in rows)
    yield r"\end{tabular}}"


def _shares(sizes: list[int]) -> str:
    """Return columns that share the width of the page in proportion to their contents."""
    weights = [min(max(size, 100), LONGEST_CELL) for size in sizes]
    shares = (0.84 * weight / sum(weights) for weight in weights)
    return "".join(
        rf">{{\raggedright\arraybackslash}}p{{{share:.3f}\linewidth}}" for share in shares
    )
