"""The page of a sweep: what was swept, how it ended, tables and plots of what is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.errors import install_command
from kincompile.html import figure_html
from kincompile.report.document import Chapter, Manuscript, Verbatim, table, text
from kincompile.report.to_html import as_html
from kincompile.runtime.results.columns import shown_unit, titled
from kincompile.sweeps.overview import HEADER, overview
from kincompile.sweeps.result import explained

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from kincompile.report.document import Block, Table
    from kincompile.runtime.engine.code import Array
    from kincompile.sweeps.overview import Found, Overview
    from kincompile.sweeps.result import Sweep

WIDTH, HEIGHT = 4.2, 3.0
"""Size of a plot [inch]."""

MOST_AXES = 4
"""Swept parameters over which a measure is plotted."""


def sweep_page(sweep: Sweep, angle_unit: str = "rad") -> str:
    """Return the page of a sweep as one HTML file, which needs no network.

    Plots are there where matplotlib is installed; angles are in ``"rad"`` or ``"deg"``.
    """
    seen = overview(sweep)
    plots = "\n".join(_plots(item, seen, angle_unit) for item in seen.found)
    plots += _failed(seen, angle_unit)
    chapters = (
        Chapter("found", ("What was found",), (table(HEADER, _rows(seen, angle_unit)),)),
        Chapter("statuses", ("How it ended",), _statuses(sweep)),
        Chapter("parameters", ("Parameters",), (_parameters(sweep, angle_unit),)),
        Chapter("plots", ("Plots",), (text(_said_of_plots(seen, plots)),)),
    )
    page = Manuscript(sweep.contents.name, str(sweep), chapters)
    return as_html(page, "Sweep of", after=plots)


def _rows(seen: Overview, angle_unit: str) -> list[tuple[str, ...]]:
    return [tuple(row) for row in seen.rows(angle_unit)]


def _statuses(sweep: Sweep) -> tuple[Block, ...]:
    """Return the count of each status, with the meaning of the failures."""
    counts = sweep.statuses()
    rows = [(name, f"{count:,}") for name, count in counts.items()]
    said = [text(Verbatim(name), f": {what}") for name, what in explained(counts).items()]
    return (table(("status", "how often"), rows), *said)


def _parameters(sweep: Sweep, angle_unit: str) -> Table:
    """Return the table of parameters: those that are swept, then the others."""
    plan, rows = sweep.contents.plan, []
    for name, value in zip(plan.parameters, plan.common.tolist(), strict=True):
        unit, factor = shown_unit(sweep.contents.units[name], angle_unit)
        if name in plan.sweep:
            values = factor * plan.sweep[name]
            span = f"{values.min():.6g} to {values.max():.6g}"
            rows.append((name, unit, span, f"{values.size:,}"))
        else:
            rows.append((name, unit, f"{factor * value:.6g}", "1"))
    return table(("parameter", "unit", "values", "how many"), rows)


def _said_of_plots(seen: Overview, plots: str) -> str:
    """Return what stands above the plots."""
    if not plots.strip():
        return f"{install_command('plot')} brings matplotlib, and the plots with it."
    some = f"{len(seen.samples):,} of {seen.sweep.contents.plan.grid.variants:,} variants"
    return f"Measures of {some}; of columns least, mean and greatest value over time, of all."


def _plots(item: Found, seen: Overview, angle_unit: str) -> str:
    """Return the plot of a column or a measure as HTML; "" without matplotlib."""
    unit, factor = shown_unit(item.kept.unit, angle_unit)
    title = titled(item.kept.name, unit)
    contents = seen.sweep.contents
    if not item.kept.measure:

        def draw_band(figure: Figure) -> None:
            ax = figure.subplots()
            ax.fill_between(contents.t, factor * item.low, factor * item.high, alpha=0.25, lw=0)
            ax.plot(contents.t, factor * item.means, lw=1.5)
            ax.set(xlabel="t [s]", ylabel=title)
            ax.grid(alpha=0.3)

        return figure_html(f"{title} over time", (WIDTH, HEIGHT), draw_band)
    names = list(contents.plan.sweep)[:MOST_AXES]

    def draw_dots(figure: Figure) -> None:
        panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
        for k, (ax, name) in enumerate(zip(panels, names, strict=True)):
            own, own_factor = shown_unit(contents.units[name], angle_unit)
            _dots(ax, own_factor * seen.samples[:, k], factor * seen.measured[item.kept.name])
            ax.set_xlabel(titled(name, own))
        panels[0].set_ylabel(title)

    return figure_html(f"{title} over parameters", (WIDTH * len(names), HEIGHT), draw_dots)


def _failed(seen: Overview, angle_unit: str) -> str:
    """Return a plot of where in the parameters motions failed; "" where none did."""
    if seen.is_good.all() or seen.samples.shape[1] < 2:
        return ""
    contents = seen.sweep.contents
    named = [(name, *shown_unit(contents.units[name], angle_unit)) for name in contents.plan.sweep]

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        x, y = (factor * seen.samples[:, k] for k, (_, _, factor) in enumerate(named[:2]))
        ax.plot(x[seen.is_good], y[seen.is_good], ".", ms=3, color="0.7", label="found")
        ax.plot(x[~seen.is_good], y[~seen.is_good], ".", ms=3, color="tab:red", label="failed")
        ax.set(xlabel=titled(*named[0][:2]), ylabel=titled(*named[1][:2]))
        ax.legend(fontsize="small")

    return figure_html("Where motions failed", (WIDTH, HEIGHT), draw)


def _dots(ax: Axes, x: Array, y: Array) -> None:
    """Draw a dot for each variant."""
    ax.plot(x, y, ".", ms=3)
    ax.grid(alpha=0.3)
