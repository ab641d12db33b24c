"""Pages of results: of tolerances with their plots, of a fit with the mechanism that was found."""

from __future__ import annotations

import warnings
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.compiler import compile as compile_model
from kincompile.design.fitted import DIMENSIONS, KEPT, REACHED
from kincompile.design.tolerance_analysis import TITLES
from kincompile.errors import KincompileWarning
from kincompile.html import framed_html
from kincompile.report.document import Chapter, Manuscript, table, text
from kincompile.report.plot import Layer, plot_svg
from kincompile.report.to_html import as_html
from kincompile.runtime.results.columns import titled
from kincompile.runtime.solve import solve
from kincompile.view.gallery import Drawn, side_by_side
from kincompile.view.page import page

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.design.fitted import Fit
    from kincompile.design.tolerance_analysis import ToleranceAnalysis
    from kincompile.model.mechanism import Mechanism
    from kincompile.runtime.results.solution import Solution

WANTED: dict[str, Any] = {"colour": "var(--numeric)", "name": "wanted"}
"""How a plot shows what was wanted."""

ON_FRONT: dict[str, Any] = {"colour": "var(--numeric)", "name": "on the front"}
"""How a plot shows the designs that no other surpasses in all."""

FRONT = "On the front are the designs that no other surpasses in all: error, size and limits."

HEIGHT = "900px"
"""Of the page of a mechanism within the page of its fit."""


def tolerance_page(found: ToleranceAnalysis) -> str:
    """Return the page of tolerances as one HTML file, which needs no network."""
    chapters = []
    for column in found.columns:
        at = found.widest(column)
        said = [text(line.strip()) for line in found.summary(column, at)]
        rows = table(TITLES, found.rows(column, at))
        chapters.append(Chapter(column, (column,), (*said, rows)))
    plots = "\n".join(
        f"<h3>{column}</h3><p>{found.plots_svg(column)}</p>" for column in found.columns
    )
    manuscript = Manuscript(found.name, found.headline(), tuple(chapters))
    return as_html(manuscript, "Tolerances of", after=plots)


def fit_page(found: Fit) -> str:
    """Return the page of a fit as one HTML file: tables, plots, and the mechanism, which moves."""
    chapters = [
        Chapter("effort", ("How it was found",), (text(found.effort()),)),
        Chapter("dimensions", ("Dimensions",), (table(DIMENSIONS, found.dimensions()),)),
        Chapter("targets", ("What is reached",), (table(REACHED, found.targets()),)),
    ]
    if found.limits:
        chapters.append(Chapter("limits", ("Limits",), (table(KEPT, found.kept()),)))
    if found.others:
        rows = table(found.designs_titles(), found.designs())
        chapters.append(Chapter("designs", ("Designs",), (text(FRONT), rows)))
    name, model = found.model.name, found.model
    motion = _motion(model)
    plots = "\n".join((*_over_time(found, motion), *_paths(found, motion)))
    moving = f"<h2>{name}</h2>{framed_html(page(model, motion).html, name, HEIGHT)}"
    manuscript = Manuscript(name, found.message, tuple(chapters))
    beside = _side_by_side(found, motion) if found.others else ""
    return as_html(manuscript, "Synthesis of", after=f"<p>{plots}</p>{beside}{moving}")


def _motion(model: Mechanism) -> Solution:
    """Return the motion of a model; the fit has said its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", KincompileWarning)
        return solve(compile_model(model), np.linspace(0, model.end, model.points))


def _side_by_side(found: Fit, first: Solution) -> str:
    """Return the designs as they move, in one scale, and the errors and sizes of all."""
    designs, shown = (found, *found.others), []
    motions = [first, *(_motion(item.model) for item in found.others)]
    for number, (item, motion) in enumerate(zip(designs, motions, strict=True), 1):
        said, system = f"error {item.error:.4g}, size {item.size:.4g}", item.model.system()
        guess = np.array([x.guess for x in system.coordinates])
        shown.append(Drawn(f"Design {number}", said, system, motion, guess))
    name = f"Designs of {escape(found.model.name)}"
    layers = [
        Layer("dots", np.array([x.size for x in some]), np.array([x.error for x in some]), **how)
        for some, how in ((designs, {}), (found.front, ON_FRONT))
    ]
    plot = plot_svg(
        "Error and size of the designs", titled("size", found.model.length_unit), "error", layers
    )
    return f"<h2>Designs</h2><p>{plot}</p>{framed_html(side_by_side(name, shown), name, HEIGHT)}"


def _over_time(found: Fit, motion: Solution) -> Iterator[str]:
    """Yield a plot of each column with targets: what was found, and what was wanted.

    What is asked of a whole motion, as a dwell or a time ratio, has no values over time.
    """
    for name in dict.fromkeys(x.column for x in found.reached if x.column in motion.units):
        items = [item for item in found.reached if item.column == name]
        # Of angles the turn that was found.
        wanted = np.array([(item.t, item.got - item.off) for item in items]).T
        title = titled(name, items[0].unit)
        layers = Layer("line", motion.t, motion[name]), Layer("dots", *wanted, **WANTED)
        yield plot_svg(f"{title} over time, and what was wanted", "t [s]", title, layers)


def _paths(found: Fit, motion: Solution) -> Iterator[str]:
    """Yield the path of each point whose two coordinates have targets, in one scale."""
    wanted = {(item.column, item.t): item for item in found.reached}
    points = (name.removeprefix("x_") for name, _ in wanted if name.startswith("x_"))
    for point in dict.fromkeys(points):
        names = f"x_{point}", f"y_{point}"
        times = [t for name, t in wanted if name == names[0] and (names[1], t) in wanted]
        if not times:
            continue
        x, y = (np.array([wanted[name, t].wanted for t in times]) for name in names)
        path = Layer("line", motion[names[0]], motion[names[1]])
        layers = path, Layer("dots", x, y, **WANTED)
        across, up = (titled(name, motion.units.get(name, "")) for name in names)
        yield plot_svg(f"Path of {point}, and what was wanted", across, up, layers, is_true=True)
