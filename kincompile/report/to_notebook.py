"""A derivation as a Jupyter notebook: the page, and code that recomputes its numbers.

The code is the emitted module, so the notebook needs NumPy and nothing else.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kincompile.report.document import NotebookCode
from kincompile.report.to_markdown import NOTEBOOK, MarkdownRenderer, escape

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TypeAlias

    from kincompile.report.document import Chapter, Manuscript

    Cell: TypeAlias = dict[str, object]

FORMAT, MINOR_FORMAT = 4, 5
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def as_notebook(document: Manuscript) -> str:
    """Return a document as a notebook, the text of an .ipynb file."""
    renderer = MarkdownRenderer(document, NOTEBOOK)
    found = [*_preface(document)]
    for section in document.sections:
        found += _section_cells(renderer, section)
    # Ids must be there and differ; numbers make the same notebook the same text.
    cells = [{"id": f"cell-{k}", **cell} for k, cell in enumerate(found)]
    notebook = {
        "cells": cells,
        "metadata": {"kernelspec": KERNEL, "language_info": {"name": "python"}},
        "nbformat": FORMAT,
        "nbformat_minor": MINOR_FORMAT,
    }
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def _preface(document: Manuscript) -> Iterator[Cell]:
    yield _markdown([f"# Derivation of `{document.name}`", "", escape(document.summary)])
    yield _markdown(["The module that kincompile emits. It is plain NumPy; run it first."])
    yield _code(document.source)
    yield _markdown(["The state at which the numbers below are taken."])
    yield _code(document.state)


def _section_cells(renderer: MarkdownRenderer, section: Chapter, depth: int = 0) -> Iterator[Cell]:
    lines = list(renderer.heading(section, depth))
    for block in section.blocks:
        if isinstance(block, NotebookCode):
            if lines:
                yield _markdown(lines)
            yield _code(block.text)
            lines = []
        else:
            lines += renderer.block(block)
    if lines:
        yield _markdown(lines)
    for inner in section.sections:
        yield from _section_cells(renderer, inner, depth + 1)


def _markdown(lines: list[str]) -> Cell:
    return {"cell_type": "markdown", "metadata": {}, "source": "\n".join(lines).rstrip()}


def _code(text: str) -> Cell:
    return {
        "cell_type": "code", "execution_count": None, "metadata": {}, "outputs": [],
        "source": text.rstrip(),
    }  # fmt: skip
