"""Columns of a solution over time, drawn by matplotlib where that is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import package_of_extra
from kincompile.runtime.results.columns import TIME_UNIT, titled
from kincompile.runtime.results.html import figure_html

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import TypeAlias

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from kincompile.runtime.results.columns import Column, MotionTable

    Panels: TypeAlias = list[list[Column]]

COLOURS = 10
"""Colours in matplotlib's cycle; further columns have another line style."""

LINES = ("-", "--", ":", "-.")
"""Line styles, one for each pass through the colours."""

MOST_NAMED = 30
"""Columns up to which each has an entry in the legend."""

MOST_INSIDE = 6
"""Entries up to which the legend stands inside the plot."""

GAP, EVENT = "0.88", "tab:red"
"""Colours of the times without a solution, and of events."""


def plot_columns(
    solution: MotionTable, names: Sequence[str], ax: Axes | None, angle_unit: str
) -> Axes:
    """Draw columns of a solution over time, as `Solution.plot` describes."""
    with package_of_extra("matplotlib", "plot"):
        from matplotlib import pyplot as plt
    panels = _by_unit(solution, names, angle_unit)
    if ax is not None:
        _draw_panel(ax, solution, [column for panel in panels for column in panel])
        return ax
    figure = plt.figure(figsize=_size_of(panels), layout="constrained")
    return _draw_panels(figure, solution, panels)


def plot_html(solution: MotionTable) -> str:
    """Return the plot of all coordinates as HTML; "" where matplotlib is not installed."""
    panels = _by_unit(solution, ())
    title = f"the coordinates of {solution.name} over time"
    return figure_html(
        title, _size_of(panels), lambda figure: _draw_panels(figure, solution, panels)
    )


def _size_of(panels: Panels) -> tuple[float, float]:
    """Return width and height of a figure [inch]."""
    return 7.2, 1.2 + 2.4 * len(panels)


def _by_unit(solution: MotionTable, names: Sequence[str], angle_unit: str = "rad") -> Panels:
    """Return the named columns in their order, grouped by unit; all coordinates without a name."""
    panels: dict[str, list[Column]] = {}
    for name in names or solution.coordinates:
        column = solution.column(name).shown(angle_unit)
        panels.setdefault(column.unit, []).append(column)
    return list(panels.values())


def _draw_panels(figure: Figure, solution: MotionTable, panels: Panels) -> Axes:
    """Draw into an empty figure, one plot below the other, and return the first."""
    plots = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for ax, columns in zip(plots, panels, strict=True):
        _draw_panel(ax, solution, columns)
        ax.label_outer()
    figure.suptitle(solution.name)
    first: Axes = plots[0]
    return first


def _draw_panel(ax: Axes, solution: MotionTable, columns: Sequence[Column]) -> None:
    """Draw columns into one plot, with units, events, and the times without a solution."""
    units = list(dict.fromkeys(column.unit for column in columns))
    good = solution.good
    # A line needs two points; one that stands alone is drawn as a dot.
    marker = "" if solution.t.size > 1 else "o"
    for k, column in enumerate(columns):
        lines = ax.plot(
            solution.t,
            np.where(good, column.values, np.nan).T,
            LINES[k // COLOURS % len(LINES)],
            color=f"C{k % COLOURS}",
            marker=marker,
        )
        lines[0].set_label(column.name if len(units) == 1 else column.title)
    ax.grid(alpha=0.3)
    ax.set_xlabel(titled("t", TIME_UNIT))
    ax.set_ylabel(columns[0].title if len(columns) == 1 else ", ".join(units))
    _mark_gaps(ax, solution.t, good)
    for event in solution.events:
        text = f"{event.kind} at t = {event.t:.4g}"
        ax.axvline(event.t, color=EVENT, linestyle="--", linewidth=1, label=text)
    _add_legend(ax, len(columns))


def _mark_gaps(ax: Axes, t: NDArray[np.float64], good: NDArray[np.bool_]) -> None:
    """Shade the times at which there is no solution, of no variant where there are some."""
    if good.all():
        return
    label = f"no solution: {np.count_nonzero(~good)} of {good.size} points"
    for first, last in _runs(np.any(~good.reshape(-1, t.size), axis=0)):
        ax.axvspan(t[max(first - 1, 0)], t[last], color=GAP, zorder=0, label=label)
        label = "_"  # names the first of the spans only
    if label != "_":  # variants of which some go on at all times
        ax.plot([], [], " ", label=label)


def _runs(flags: NDArray[np.bool_]) -> Iterable[tuple[int, int]]:
    """Return the first and the last index of each run of set flags."""
    steps = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return [(int(first), int(stop) - 1) for first, stop in steps.reshape(-1, 2)]


def _add_legend(ax: Axes, columns: int) -> None:
    """Put the legend where it covers nothing; very many columns are counted, not named."""
    handles, labels = ax.get_legend_handles_labels()
    if columns > MOST_NAMED:
        ax.set_ylabel(f"{columns} columns, {ax.get_ylabel()}".rstrip(", "))
        handles, labels = handles[columns:], labels[columns:]
    if len(handles) <= 1 == columns:
        return
    if len(handles) > MOST_INSIDE:
        ax.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
    elif handles:
        ax.legend(handles, labels, fontsize="small")
