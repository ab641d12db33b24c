"""A derivation as one self-contained HTML page: MathML and a style sheet, no script, no network."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from kincompile.derivation.document import Code, Display, Link, Math, Pattern, Table, Text, Verbatim
from kincompile.derivation.mathml import MathMLPrinter
from kincompile.derivation.pattern_svg import pattern_svg
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from kincompile.derivation.document import Block, Document, Run, Runs, Section, SourceLine

DEEPEST_IN_CONTENTS = 2
"""Sections below this depth, the nine steps, are left out of the list of contents."""


def as_html(document: Document) -> str:
    """Return a document as an HTML page."""
    renderer = _Renderer(document)
    title = f"Derivation of {document.name}"
    data = {
        "title": escape(title),
        "heading": f"Derivation of <code>{escape(document.name)}</code>",
        "summary": escape(document.summary),
        "contents": "\n".join(renderer.contents(document.sections)),
        "main": "\n".join(line for item in document.sections for line in renderer.section(item, 2)),
    }
    return fill("derivation/page.html.jinja", data)


class _Renderer:
    """Prints sections, blocks and runs."""

    def __init__(self, document: Document) -> None:
        self._printer = MathMLPrinter(document.abbreviations)

    def contents(self, sections: tuple[Section, ...], depth: int = 1) -> list[str]:
        lines = ["<ol>"]
        for item in sections:
            lines.append(f'<li><a href="#{escape(item.anchor)}">{self._runs(item.title)}</a>')
            if depth < DEEPEST_IN_CONTENTS and item.sections:
                lines += self.contents(item.sections, depth + 1)
            lines.append("</li>")
        return [*lines, "</ol>"]

    def section(self, section: Section, depth: int) -> list[str]:
        tag = f"h{depth}"
        level = f'<span class="level {section.level}">{section.level}</span>'
        lines = [
            f'<section id="{escape(section.anchor)}">',
            f"<{tag}>{self._runs(section.title)}{level if section.level else ''}</{tag}>",
        ]
        for block in section.blocks:
            lines += self._block(block)
        for inner in section.sections:
            lines += self.section(inner, depth + 1)
        return [*lines, "</section>"]

    def _block(self, block: Block) -> list[str]:
        match block:
            case Text(runs):
                return [f"<p>{self._runs(runs)}</p>"]
            case Display():
                return self._display(block)
            case Table():
                return self._table(block)
            case Pattern():
                return ['<div class="wide">', pattern_svg(block), "</div>"]
            case Code():
                return []
        raise TypeError(f"cannot print {block!r}")

    def _display(self, block: Display) -> list[str]:
        anchor = f' id="{escape(block.anchor)}"' if block.anchor else ""
        lines = [f'<div class="eq wide"{anchor}>{self._printer.display(block.formula)}</div>']
        return lines if block.source is None else [*lines, _source(block.source)]

    def _table(self, table: Table) -> list[str]:
        header = "".join(f"<th>{self._runs(cell)}</th>" for cell in table.header)
        rows = [
            f"<tr>{''.join(f'<td>{self._runs(cell)}</td>' for cell in row)}</tr>"
            for row in table.rows
        ]
        lines = [
            '<div class="wide"><table>',
            f"<thead><tr>{header}</tr></thead><tbody>",
            *rows,
            "</tbody></table></div>",
        ]
        if not table.folded:
            return lines
        return [f"<details><summary>{escape(table.folded)}</summary>", *lines, "</details>"]

    def _runs(self, runs: Runs) -> str:
        return "".join(self._run(run) for run in runs)

    def _run(self, run: Run) -> str:
        match run:
            case Verbatim(text):
                return f"<code>{escape(text)}</code>"
            case Math(formula):
                return self._printer.math(formula)
            case Link(anchor, content):
                return f'<a href="#{escape(anchor)}">{self._run(content)}</a>'
        return escape(str(run))


def _source(source: SourceLine) -> str:
    """Return the emitted code of an entry: its line, and what that line needs."""
    *before, last = source.text.split("\n")
    shown = f"<code>{escape(last)}</code>"
    label = f"line {source.number}"
    if not before:
        return f'<p class="src">{label}: {shown}</p>'
    code = escape("\n".join(before))
    return f'<details class="src"><summary>{label}: {shown}</summary><pre>{code}</pre></details>'
