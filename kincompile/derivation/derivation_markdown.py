"""A derivation as Markdown: for GitHub, and in the dialect of notebooks.

GitHub takes formulas in fences and in backquotes with dollar signs: that way no underscore or
backslash in them is read as Markdown. A notebook takes dollar signs alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.derivation.document import Code, Display, Link, Math, Pattern, Table, Text, Verbatim
from kincompile.derivation.tex import TexPrinter

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.derivation.document import Block, Document, Run, Runs, Section, SourceLine

SPECIAL = str.maketrans({character: f"\\{character}" for character in "\\`*_{}[]<>#|$~"})


@dataclass(frozen=True, slots=True)
class Dialect:
    """How formulas are marked: on lines of their own, and within a line."""

    before: str
    after: str
    inline: str


GITHUB = Dialect("```math", "```", "$`{}`$")
NOTEBOOK = Dialect("$$", "$$", "${}$")


def as_markdown(document: Document) -> str:
    """Return a document as Markdown for GitHub."""
    renderer = MarkdownRenderer(document, GITHUB)
    lines = [f"# Derivation of `{document.name}`", "", escape(document.summary), ""]
    for section in document.sections:
        lines += renderer.section(section, 2)
    return "\n".join(lines).rstrip() + "\n"


def escape(text: str) -> str:
    """Return plain text as Markdown."""
    return text.translate(SPECIAL)


class MarkdownRenderer:
    """Prints sections, blocks and runs in a dialect."""

    def __init__(self, document: Document, dialect: Dialect) -> None:
        self._printer = TexPrinter(document.abbreviations)
        self._dialect = dialect

    def section(self, section: Section, depth: int) -> Iterator[str]:
        """Yield the lines of a section and its parts."""
        yield from self.heading(section, depth)
        for block in section.blocks:
            yield from self.block(block)
        for inner in section.sections:
            yield from self.section(inner, depth + 1)

    def heading(self, section: Section, depth: int) -> Iterator[str]:
        """Yield the title of a section."""
        level = f" *({section.level})*" if section.level else ""
        yield _anchor(section.anchor)
        yield ""
        yield f"{'#' * depth} {self._runs(section.title)}{level}"
        yield ""

    def block(self, block: Block) -> Iterator[str]:
        """Yield the lines of a block; code is a matter of notebooks."""
        match block:
            case Text(runs):
                yield from (self._runs(runs), "")
            case Display():
                yield from self._display(block)
            case Table():
                yield from self._table(block)
            case Pattern():
                yield from _pattern(block)
            case Code():
                return

    def _display(self, block: Display) -> Iterator[str]:
        if block.anchor:
            yield from (_anchor(block.anchor), "")
        pieces = " ".join(self._printer.pieces(block.formula))
        yield from (self._dialect.before, pieces, self._dialect.after, "")
        if block.source is not None:
            yield from _source(block.source)

    def _table(self, table: Table) -> Iterator[str]:
        if table.folded:
            yield from (f"{escape(table.folded)}:", "")
        yield _line([self._runs(cell) for cell in table.header])
        yield _line(["---"] * len(table.header))
        yield from (_line([self._runs(cell) for cell in row]) for row in table.rows)
        yield ""

    def _runs(self, runs: Runs) -> str:
        return "".join(self._run(run) for run in runs)

    def _run(self, run: Run) -> str:
        match run:
            case Verbatim(text):
                return f"`{text}`"
            case Math(formula):
                return self._dialect.inline.format(self._printer.math(formula))
            case Link(anchor, Math() as content):
                # A formula inside the brackets of a link is not understood everywhere.
                return f"{self._run(content)} [\N{DOWNWARDS ARROW}](#{anchor})"
            case Link(anchor, content):
                return f"[{self._run(content)}](#{anchor})"
        return escape(str(run))


def _anchor(anchor: str) -> str:
    return f'<a id="{anchor}"></a>'


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _source(source: SourceLine) -> Iterator[str]:
    yield f"Line {source.number} of the emitted module:"
    yield ""
    yield from ("```python", source.text, "```", "")


def _pattern(pattern: Pattern) -> Iterator[str]:
    yield _line(["", *(f"`{name}`" for name in pattern.columns)])
    yield _line(["---", *([":-:"] * len(pattern.columns))])
    for row, name in enumerate(pattern.rows):
        places = (pattern.entries.get((row, column)) for column in range(len(pattern.columns)))
        marks = ("" if anchor is None else f"[\N{BLACK SQUARE}](#{anchor})" for anchor in places)
        yield _line([f"`{name}`", *marks])
    yield ""
