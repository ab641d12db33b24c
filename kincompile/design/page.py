"""Pages of results: of tolerances with their plots, of a fit with the mechanism that was found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.design.fitted import DIMENSIONS, KEPT, REACHED
from kincompile.design.tolerance_analysis import TITLES
from kincompile.html import framed_html
from kincompile.report.document import Chapter, Manuscript, table, text
from kincompile.report.to_html import as_html
from kincompile.view.page import page

if TYPE_CHECKING:
    from kincompile.design.fitted import Fit
    from kincompile.design.tolerance_analysis import ToleranceAnalysis

HEIGHT = "900px"
"""Of the page of a mechanism within the page of its fit."""


def tolerance_page(found: ToleranceAnalysis) -> str:
    """Return the page of tolerances as one HTML file, which needs no network.

    Plots are there where matplotlib is installed.
    """
    chapters = []
    for column in found.columns:
        at = found.widest(column)
        said = [text(line.strip()) for line in found.summary(column, at)]
        rows = table(TITLES, found.rows(column, at))
        chapters.append(Chapter(column, (column,), (*said, rows)))
    plots = "\n".join(f"<h3>{column}</h3>{found.plots_html(column)}" for column in found.columns)
    manuscript = Manuscript(found.name, found.headline(), tuple(chapters))
    return as_html(manuscript, "Tolerances of", after=plots)


def fit_page(found: Fit) -> str:
    """Return the page of a fit as one HTML file: tables, and the mechanism, which moves."""
    chapters = [
        Chapter("effort", ("How it was found",), (text(found.effort()),)),
        Chapter("dimensions", ("Dimensions",), (table(DIMENSIONS, found.dimensions()),)),
        Chapter("targets", ("What is reached",), (table(REACHED, found.targets()),)),
    ]
    if found.limits:
        chapters.append(Chapter("limits", ("Limits",), (table(KEPT, found.kept()),)))
    name = found.model.name
    moving = f"<h2>{name}</h2>{framed_html(page(found.model).html, name, HEIGHT)}"
    manuscript = Manuscript(name, found.message, tuple(chapters))
    return as_html(manuscript, "Synthesis of", after=moving)
