"""A derivation as a LaTeX document, for pdflatex with the packages that every Debian has."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.derivation.document import Code, Display, Link, Math, Pattern, Table, Text, Verbatim
from kincompile.derivation.tex import TexPrinter, escape
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.derivation.document import Block, Document, Run, Runs, Section, SourceLine

HEADINGS = ("section", "subsection", "subsubsection")

ROWS_TOGETHER = 24
"""Rows of a table that stay on one page; a longer table is continued."""

LONGEST_CELL = 300
"""Characters of LaTeX in a cell from which on the lines in it are broken."""

MOST_PARAGRAPHS = 5
"""Columns up to which lines in cells are broken; a table with more is shrunk instead."""


def as_tex(document: Document) -> str:
    """Return a document as LaTeX."""
    renderer = _Renderer(document)
    data = {
        "title": rf"Derivation of \texttt{{{escape(document.name)}}}",
        "summary": escape(document.summary),
        "body": "\n".join(line for item in document.sections for line in renderer.section(item, 0)),
    }
    return fill("derivation/document.tex.jinja", data)


class _Renderer:
    """Prints sections, blocks and runs."""

    def __init__(self, document: Document) -> None:
        self._printer = TexPrinter(document.abbreviations, is_breakable=True)

    def section(self, section: Section, depth: int) -> Iterator[str]:
        level = rf" \level{{{section.level}}}" if section.level else ""
        title = self._runs(section.title)
        plain = "".join(escape(_plain(run)) for run in section.title)
        heading = HEADINGS[min(depth, len(HEADINGS) - 1)]
        yield rf"\{heading}{{\texorpdfstring{{{title}{level}}}{{{plain}}}}}"
        yield _target(section.anchor)
        for block in section.blocks:
            yield from self._block(block)
        for inner in section.sections:
            yield from self.section(inner, depth + 1)

    def _block(self, block: Block) -> Iterator[str]:
        match block:
            case Text(runs):
                yield f"{self._runs(runs)}\n"
            case Display():
                yield from self._display(block)
            case Table():
                yield from self._table(block)
            case Pattern():
                yield from _pattern(block)
            case Code():
                return

    def _display(self, block: Display) -> Iterator[str]:
        pieces = self._printer.pieces(block.formula)
        target = _target(block.anchor) if block.anchor else ""
        yield rf"\formula{{{target}%"
        yield from (rf"{_command(piece)}{{{piece}}}%" for piece in pieces)
        yield "}"
        if block.source is not None:
            yield _source(block.source)

    def _table(self, table: Table) -> Iterator[str]:
        if table.folded:
            yield f"{escape(table.folded)}:\n"
        header = [self._runs(cell) for cell in table.header]
        for first in range(0, len(table.rows), ROWS_TOGETHER):
            rows = table.rows[first : first + ROWS_TOGETHER]
            yield from _tabular(header, [[self._runs(cell) for cell in row] for row in rows])

    def _runs(self, runs: Runs) -> str:
        return "".join(self._run(run) for run in runs)

    def _run(self, run: Run) -> str:
        match run:
            case Verbatim(text):
                return rf"\texttt{{{escape(text)}}}"
            case Math(formula):
                return f"${self._printer.math(formula)}$"
            case Link(anchor, content):
                return rf"\hyperlink{{{anchor}}}{{{self._run(content)}}}"
        return escape(str(run))


def _plain(run: Run) -> str:
    """Return a run as plain text, for the bookmarks of a PDF."""
    match run:
        case Verbatim(text):
            return text
        case Link(_, content):
            return _plain(content)
        case str():
            return run
    return ""


def _command(piece: str) -> str:
    """Return what sets a piece of a formula: no line is broken within a matrix."""
    return r"\block" if "bmatrix" in piece else r"\piece"


def _target(anchor: str) -> str:
    return rf"\hypertarget{{{anchor}}}{{}}"


def _source(source: SourceLine) -> str:
    lines = r" \\ ".join(escape(line) for line in source.text.split("\n"))
    return rf"\source{{{source.number}}}{{{lines}}}"


def _tabular(header: list[str], rows: list[list[str]]) -> Iterator[str]:
    """Yield a table: as wide as its cells, or in paragraphs as wide as the page."""
    sizes = [max(len(row[k]) for row in (header, *rows)) for k in range(len(header))]
    is_wide = max(sizes) > LONGEST_CELL and len(header) <= MOST_PARAGRAPHS
    columns = _shares(sizes) if is_wide else "l" * len(header)
    frame = r"\par" if is_wide else r"\fitted"
    yield rf"{frame}{{\begin{{tabular}}{{{columns}}}"
    yield rf"{' & '.join(header)} \\ \hline"
    yield from (rf"{' & '.join(row)} \\" for row in rows)
    yield r"\end{tabular}}"


def _shares(sizes: list[int]) -> str:
    """Return columns that share the width of the page as their contents need it."""
    weights = [min(max(size, 100), LONGEST_CELL) for size in sizes]
    shares = (0.84 * weight / sum(weights) for weight in weights)
    return "".join(
        rf">{{\raggedright\arraybackslash}}p{{{share:.3f}\linewidth}}" for share in shares
    )


def _pattern(pattern: Pattern) -> Iterator[str]:
    names = [rf"\rotatebox{{90}}{{\texttt{{{escape(name)}}}}}" for name in pattern.columns]
    rows = []
    for row, name in enumerate(pattern.rows):
        marks = [_mark(pattern, row, column) for column in range(len(pattern.columns))]
        rows.append([rf"\texttt{{{escape(name)}}}", *marks])
    yield from _tabular(["", *names], rows)


def _mark(pattern: Pattern, row: int, column: int) -> str:
    anchor = pattern.entries.get((row, column))
    return "" if anchor is None else rf"\hyperlink{{{anchor}}}{{$\bullet$}}"
