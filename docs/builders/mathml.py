"""Formulas of the site as MathML, which browsers draw without a script or a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from docutils.nodes import SkipNode

from docs.builders.formulas import as_mathml

if TYPE_CHECKING:
    from docutils.nodes import Element
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the renderer `mathml`."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(self: HTML5Translator, node: Element) -> None:
    self.body.append(as_mathml(node.astext()))
    raise SkipNode


def _display(self: HTML5Translator, node: Element) -> None:
    self.body.append(f'<div class="math" tabindex="0">{as_mathml(node.astext(), "block")}</div>')
    raise SkipNode
