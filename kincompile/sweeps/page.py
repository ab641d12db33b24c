"""The page of a sweep: what was swept, how it ended, tables and plots of what is kept."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from kincompile.report.document import Chapter, Manuscript, Verbatim, table, text
from kincompile.report.plot import Layer, plot_svg
from kincompile.report.to_html import as_html
from kincompile.runtime.results.columns import shown_unit, titled
from kincompile.sweeps.overview import HEADER, overview
from kincompile.sweeps.result import explained

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.report.document import Block, Table
    from kincompile.sweeps.overview import Found, Overview
    from kincompile.sweeps.result import Sweep

MOST_AXES = 4
"""Swept parameters over which a measure is plotted."""


def sweep_page(sweep: Sweep, angle_unit: str = "rad") -> str:
    """Return the page of a sweep as one HTML file, which needs no network.

    Angles are in ``"rad"`` or ``"deg"``.
    """
    seen = overview(sweep)
    drawn = (_plots(item, seen, angle_unit) for item in seen.found)
    plots = "\n".join((*chain.from_iterable(drawn), *_failed(seen, angle_unit)))
    chapters = (
        Chapter("found", ("What was found",), (table(HEADER, _rows(seen, angle_unit)),)),
        Chapter("statuses", ("How it ended",), _statuses(sweep)),
        Chapter("parameters", ("Parameters",), (_parameters(sweep, angle_unit),)),
        Chapter("plots", ("Plots",), (text(_said_of_plots(seen)),)),
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


def _said_of_plots(seen: Overview) -> str:
    """Return what stands above the plots."""
    some = f"{len(seen.samples):,} of {seen.sweep.contents.plan.grid.variants:,} variants"
    return f"Measures of {some}; of columns least, mean and greatest value over time, of all."


def _plots(item: Found, seen: Overview, angle_unit: str) -> Iterator[str]:
    """Yield the plots of a column, or of a measure over each swept parameter, as SVG."""
    unit, factor = shown_unit(item.kept.unit, angle_unit)
    title = titled(item.kept.name, unit)
    contents = seen.sweep.contents
    if not item.kept.measure:
        low, high = (np.where(np.isfinite(x), factor * x, np.nan) for x in (item.low, item.high))
        band = Layer("band", contents.t, low, high)
        mean = Layer("line", contents.t, factor * item.means)
        yield plot_svg(f"{title} over time", "t [s]", title, (band, mean))
        return
    for k, name in enumerate(list(contents.plan.sweep)[:MOST_AXES]):
        own, own_factor = shown_unit(contents.units[name], angle_unit)
        values = own_factor * seen.samples[:, k], factor * seen.measured[item.kept.name]
        over = titled(name, own)
        yield plot_svg(f"{title} over {over}", over, title, (Layer("dots", *values),))


def _failed(seen: Overview, angle_unit: str) -> Iterator[str]:
    """Yield a plot of where in the parameters motions failed, where any did."""
    if seen.is_good.all() or seen.samples.shape[1] < 2:
        return
    contents = seen.sweep.contents
    named = [(name, *shown_unit(contents.units[name], angle_unit)) for name in contents.plan.sweep]
    x, y = (factor * seen.samples[:, k] for k, (_, _, factor) in enumerate(named[:2]))
    found = Layer("dots", x[seen.is_good], y[seen.is_good], None, "var(--quiet)", "found")
    failed = Layer("dots", x[~seen.is_good], y[~seen.is_good], None, "var(--numeric)", "failed")
    across, up = (titled(*item[:2]) for item in named[:2])
    yield plot_svg("Where motions failed", across, up, (found, failed))
