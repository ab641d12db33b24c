"""Columns of a solution over time, drawn by matplotlib where that is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import missing_package
from kincompile.names import column_name
from kincompile.runtime.results.figures import figure_html
from kincompile.runtime.results.labelled import TIME_UNIT

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from kincompile.runtime.results.labelled import LabelledViews

COLOURS = 10
"""Colours of a cycle of matplotlib's; columns beyond them are drawn with another kind of line."""

LINES = ("-", "--", ":", "-.")
"""Kinds of line, one for each time that the colours are used up."""

MOST_NAMED = 30
"""Columns up to which each has an entry in the legend."""

MOST_INSIDE = 6
"""Entries up to which the legend stands inside of the plot."""

GAP, EVENT = "0.88", "tab:red"
"""Colours of the times without a solution, and of events."""


def plot_columns(solution: LabelledViews, names: Sequence[str], ax: Axes | None) -> Axes:
    """Draw columns of a solution over time; `Solution.plot` says how."""
    try:
        from matplotlib import pyplot as plt
    except ImportError:
        raise missing_package("matplotlib", "plot") from None
    columns = columns_by_unit(solution, names)
    if ax is not None:
        draw_columns(ax, solution, [name for group in columns.values() for name in group])
        return ax
    figure = plt.figure(figsize=_size_of(columns), layout="constrained")
    return draw_panels(figure, solution, columns)


def plot_html(solution: LabelledViews) -> str:
    """Return the plot of all coordinates as HTML; "" where matplotlib is not installed."""
    columns = columns_by_unit(solution, ())
    title = f"the coordinates of {solution.name} over time"
    return figure_html(
        title, _size_of(columns), lambda figure: draw_panels(figure, solution, columns)
    )


def _size_of(columns: Mapping[str, object]) -> tuple[float, float]:
    """Return width and height of a figure [inch]."""
    return 7.2, 1.2 + 2.4 * len(columns)


def draw_panels(figure: Figure, solution: LabelledViews, columns: dict[str, list[str]]) -> Axes:
    """Draw columns into a figure, a panel for each unit, and return the first panel.

    Parameters
    ----------
    figure
        An empty figure.
    solution
        The motion.
    columns
        Names of columns by unit.
    """
    panels = figure.subplots(len(columns), sharex=True, squeeze=False)[:, 0]
    for panel, group in zip(panels, columns.values(), strict=True):
        draw_columns(panel, solution, group)
        panel.label_outer()
    figure.suptitle(solution.name)
    first: Axes = panels[0]
    return first


def columns_by_unit(solution: LabelledViews, names: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns that are meant, in their order, by unit; all coordinates without any.

    Raises
    ------
    InputError
        If there is no such column.
    """
    known = solution.labelled_columns()
    groups: dict[str, list[str]] = {}
    for name in names or solution.coordinates:
        solution[name]  # says which names there are, if this is none
        column = column_name(name)
        groups.setdefault(known[column][0], []).append(column)
    return groups


def draw_columns(ax: Axes, solution: LabelledViews, names: Sequence[str]) -> None:
    """Draw columns into one plot, with units, events, and the times without a solution."""
    known = solution.labelled_columns()
    units = list(dict.fromkeys(known[name][0] for name in names))
    good = solution.status == 0
    # A line needs two points; one that stands alone is drawn as a dot.
    marker = "" if solution.t.size > 1 else "o"
    for k, name in enumerate(names):
        unit, values = known[name]
        lines = ax.plot(
            solution.t,
            np.where(good, values, np.nan).T,
            LINES[k // COLOURS % len(LINES)],
            color=f"C{k % COLOURS}",
            marker=marker,
        )
        lines[0].set_label(name if len(units) == 1 else _with_unit(name, unit))
    ax.grid(alpha=0.3)
    ax.set_xlabel(_with_unit("t", TIME_UNIT))
    ax.set_ylabel(_with_unit(names[0], units[0]) if len(names) == 1 else ", ".join(units))
    _mark_gaps(ax, solution.t, good)
    for event in solution.events:
        text = f"{event.kind} at t = {event.t:.4g}"
        ax.axvline(event.t, color=EVENT, linestyle="--", linewidth=1, label=text)
    _name(ax, len(names))


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


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


def _name(ax: Axes, columns: int) -> None:
    """Put the legend where it covers nothing; of very many columns it gives the number only."""
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
