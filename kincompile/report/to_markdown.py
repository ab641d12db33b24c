"""A derivation as Markdown: for GitHub, and in the dialect of notebooks.

GitHub takes formulas in fences and in backquotes with dollar signs: that way no underscore or
backslash in them is read as Markdown. A notebook takes dollar signs alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.report import document as doc
from kincompile.report.figure import svg_address
from kincompile.report.renderer import Renderer
from kincompile.report.tex import TexPrinter

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from kincompile.report.formulas import Formula
    from kincompile.report.picture import Picture

SPECIAL = str.maketrans({character: f"\\{character}" for character in "\\`*_{}[]<>#|$~"})


@dataclass(frozen=True, slots=True)
class FormulaMarks:
    """The marks of formulas: around those on lines of their own, and within a line."""

    before: str
    after: str
    inline: str


GITHUB = FormulaMarks("```math", "```", "$`{}`$")
NOTEBOOK = FormulaMarks("$$", "$$", "${}$")


def as_markdown(document: doc.Manuscript) -> str:
    """Return a document as Markdown for GitHub."""
    renderer = MarkdownRenderer(document, GITHUB)
    lines = [f"# Derivation of `{document.name}`", "", escape(document.summary), ""]
    for section in document.sections:
        lines += renderer.section(section, 0)
    return "\n".join(lines).rstrip() + "\n"


def escape(text: str) -> str:
    """Return plain text as Markdown."""
    return text.translate(SPECIAL)


class MarkdownRenderer(Renderer):
    """Prints Markdown in a dialect."""

    def __init__(self, document: doc.Manuscript, dialect: FormulaMarks) -> None:
        self._printer = TexPrinter(document.abbreviations)
        self._dialect = dialect

    def heading(self, section: doc.Chapter, depth: int) -> Iterator[str]:
        """Yield the title of a section, after its anchor."""
        level = f" *({section.level})*" if section.level else ""
        title = f"{'#' * (depth + 2)} {self.runs(section.title)}{level}"
        yield from (_anchor(section.anchor), "", title, "")

    def _paragraph(self, text: str) -> Iterator[str]:
        yield from (text, "")

    def _display(self, block: doc.Display) -> Iterator[str]:
        if block.anchor:
            yield from (_anchor(block.anchor), "")
        pieces = " ".join(self._printer.pieces(block.formula))
        yield from (self._dialect.before, pieces, self._dialect.after, "")
        if block.source is not None:
            yield from (f"Line {block.source.number} of the emitted module:", "")
            yield from ("```python", block.source.text, "```", "")

    def _table(self, table: doc.Table) -> Iterator[str]:
        if table.folded:
            yield from (f"{escape(table.folded)}:", "")
        yield _line(map(self.runs, table.header))
        yield _line(["---"] * len(table.header))
        yield from (_line(map(self.runs, row)) for row in table.rows)
        yield ""

    def _pattern(self, pattern: doc.Pattern) -> Iterator[str]:
        yield _line(["", *(f"`{name}`" for name in pattern.columns)])
        yield _line(["---", *([":-:"] * len(pattern.columns))])
        for row, name in enumerate(pattern.rows):
            anchors = (pattern.entries.get((row, column)) for column in range(len(pattern.columns)))
            marks = ("" if item is None else f"[\N{BLACK SQUARE}](#{item})" for item in anchors)
            yield _line([f"`{name}`", *marks])
        yield ""

    def _figure(self, picture: Picture) -> Iterator[str]:
        """Yield nothing on GitHub, which shows no picture that is part of a text."""
        if self._dialect is NOTEBOOK:
            yield from (f"![{escape(picture.title)}]({svg_address(picture)})", "")

    def _verbatim(self, text: str) -> str:
        return f"`{text}`"

    def _math(self, formula: Formula) -> str:
        return self._dialect.inline.format(self._printer.math(formula))

    def _link(self, link: doc.CrossReference) -> str:
        content = self.run(link.content)
        if isinstance(link.content, doc.Math):
            # A formula inside the brackets of a link is not understood everywhere.
            return f"{content} [\N{DOWNWARDS ARROW}](#{link.anchor})"
        return f"[{content}](#{link.anchor})"

    def _prose(self, text: str) -> str:
        return escape(text)


def _anchor(anchor: str) -> str:
    return f'<a id="{anchor}"></a>'


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"
