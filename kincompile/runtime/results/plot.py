"""Columns of a solution over time or over each other, drawn by matplotlib where it is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import STILL
from kincompile.errors import package_of_extra
from kincompile.html import figure_html
from kincompile.runtime.results.columns import ANGLE_UNITS, TIME_UNIT, titled

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

MOST_SETS = 8
"""Parameter sets up to which each has an entry in the legend; of more a bar shows the colours."""

SET_COLOURS = "viridis"
"""Colours of parameter sets, in the order of their values."""

MARKED = 24
"""Points at equal times on a path, at least."""

GAP, EVENT = "0.88", "tab:red"
"""Colours of the times without a solution, and of events."""


def plot_columns(
    solution: MotionTable, names: Sequence[str], x: str | None, ax: Axes | None, angle_unit: str
) -> Axes:
    """Draw columns of a solution over time or another column, as `Solution.plot` describes."""
    with package_of_extra("matplotlib", "plot"):
        from matplotlib import pyplot as plt
    across = None if x is None else solution.column(x).shown(angle_unit)
    panels = _by_unit(solution, names, angle_unit)
    if ax is not None:
        _draw_panel(ax, solution, [column for panel in panels for column in panel], across)
        return ax
    size = (6.4, 5.6) if _is_path(panels[0], across) else _size_of(panels)
    figure = plt.figure(figsize=size, layout="constrained")
    return _draw_panels(figure, solution, panels, across)


def plot_html(solution: MotionTable) -> str:
    """Return the first plot as HTML; "" where matplotlib is not installed."""
    panels = _by_unit(solution, ())
    shown = "outputs" if panels[0][0].name in solution.observed.names else "coordinates"
    title = f"the {shown} of {solution.name} over time"
    return figure_html(
        title, _size_of(panels), lambda figure: _draw_panels(figure, solution, panels, None)
    )


def _size_of(panels: Panels) -> tuple[float, float]:
    """Return width and height of a figure [inch]."""
    return 7.2, 1.2 + 2.4 * len(panels)


def _by_unit(solution: MotionTable, names: Sequence[str], angle_unit: str = "rad") -> Panels:
    """Return the named columns in their order, grouped by unit."""
    panels: dict[str, list[Column]] = {}
    for name in names or _shown_first(solution):
        column = solution.column(name).shown(angle_unit)
        panels.setdefault(column.unit, []).append(column)
    return list(panels.values())


def _shown_first(solution: MotionTable) -> Sequence[str]:
    """Return the outputs that move, else the coordinates that do; all where nothing moves."""
    sizes: dict[str, float] = {}
    moving = {}
    for name in solution.names:
        column = solution.column(name)
        values = column.values[np.isfinite(column.values)]
        size = sizes.get(column.unit, 0.0)
        sizes[column.unit] = max(size, float(np.max(np.abs(values), initial=0.0)))
        moving[name] = float(np.ptp(values)) if values.size else 0.0
    found = [name for name in moving if moving[name] > STILL * sizes[solution.column(name).unit]]
    outputs = [name for name in found if name in solution.observed.names]
    return outputs or found or solution.coordinates


def _is_path(columns: Sequence[Column], across: Column | None) -> bool:
    """Say whether columns over another one are the path of a point: a length over a length."""
    units = {column.unit for column in columns}
    return across is not None and units == {across.unit} and across.unit not in ("", *ANGLE_UNITS)


def _draw_panels(
    figure: Figure, solution: MotionTable, panels: Panels, across: Column | None
) -> Axes:
    """Draw into an empty figure, one plot below the other, and return the first."""
    plots = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for ax, columns in zip(plots, panels, strict=True):
        _draw_panel(ax, solution, columns, across)
        ax.label_outer()
    figure.suptitle(solution.name)
    first: Axes = plots[0]
    return first


def _draw_panel(
    ax: Axes, solution: MotionTable, columns: Sequence[Column], across: Column | None
) -> None:
    """Draw columns into one plot, with units, events, and the times without a solution."""
    units = list(dict.fromkeys(column.unit for column in columns))
    for k, column in enumerate(columns):
        name = column.name if len(units) == 1 else column.title
        _draw_curves(ax, solution, column, across, k, name)
    ax.grid(alpha=0.3)
    ax.set_xlabel(titled("t", TIME_UNIT) if across is None else across.title)
    ax.set_ylabel(columns[0].title if len(columns) == 1 else ", ".join(units))
    if across is None:
        _mark_times(ax, solution)
    elif _is_path(columns, across):
        ax.set_aspect("equal", adjustable="datalim")
    count = len(solution.q) if solution.q.ndim > 2 else 1
    if count > MOST_SETS:
        _add_colour_bar(ax, solution)
    _add_legend(ax, len(columns) * (1 if count > MOST_SETS else count))


def _draw_curves(
    ax: Axes, solution: MotionTable, column: Column, across: Column | None, k: int, name: str
) -> None:
    """Draw a column, of variants a curve each; over another column with dots at equal times."""
    rows = np.atleast_2d(np.where(solution.good, column.values, np.nan))
    over = np.broadcast_to(solution.t if across is None else across.values, rows.shape)
    # A line needs two points; one that stands alone is drawn as a dot.
    marker, every = ("" if solution.t.size > 1 else "o"), 1
    if across is not None and solution.t.size > 2:
        marker, every = ".", max(1, (solution.t.size - 1) // MARKED)
    looks = _looks(solution, name, k)
    for x, y, look in zip(over, rows, looks, strict=True):
        ax.plot(x, y, marker=marker, markevery=every, **look)


def _looks(solution: MotionTable, name: str, k: int) -> list[dict[str, Any]]:
    """Return colour, line style and label of the curves of column k, one for each variant."""
    if solution.q.ndim == 2:
        style = LINES[k // COLOURS % len(LINES)]
        return [{"color": f"C{k % COLOURS}", "linestyle": style, "label": name}]
    colours = _colours(solution)
    style = LINES[k % len(LINES)]
    if len(colours) > MOST_SETS:
        labels = [name, *["_"] * (len(colours) - 1)]
    else:
        labels = [f"{name}, {text}" for text in _set_names(solution)]
    return [
        {"color": colour, "linestyle": style, "label": label}
        for colour, label in zip(colours, labels, strict=True)
    ]


def _set_names(solution: MotionTable) -> list[str]:
    """Return what tells each variant from the others: the values of its parameters."""
    axes = [(name, values.tolist()) for name, values in solution.variants.items()]
    return [
        ", ".join(
            f"{name} = {values[k]:.4g} {solution.units.get(name, '')}".rstrip()
            for name, values in axes
        )
        for k in range(len(solution.q))
    ]


def _shades(solution: MotionTable) -> tuple[str, NDArray[np.float64]]:
    """Return what the colours of variants stand for: the one parameter, or their numbers."""
    axes = solution.variants
    if len(axes) > 1:
        return "variant", np.arange(len(solution.q), dtype=np.float64)
    ((name, values),) = axes.items()
    return titled(name, solution.units.get(name, "")), np.asarray(values, dtype=np.float64)


def _colours(solution: MotionTable) -> list[Any]:
    """Return the colour of each variant."""
    from matplotlib import colormaps

    values = _shades(solution)[1]
    parts = (values - values.min()) / (np.ptp(values) or 1.0)
    return [colormaps[SET_COLOURS](0.9 * part) for part in parts.tolist()]


def _add_colour_bar(ax: Axes, solution: MotionTable) -> None:
    """Show which colours stand for which values of the parameter."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    label, values = _shades(solution)
    order = np.argsort(values)
    colours = _colours(solution)
    shades = LinearSegmentedColormap.from_list("sets", [colours[k] for k in order.tolist()])
    shown = ScalarMappable(Normalize(float(values.min()), float(values.max())), shades)
    ax.figure.colorbar(shown, ax=ax, label=label)


def _mark_times(ax: Axes, solution: MotionTable) -> None:
    """Mark events, and the times without a solution."""
    _mark_gaps(ax, solution.t, solution.good)
    for event in solution.events:
        text = f"{event.kind} at t = {event.t:.4g}"
        ax.axvline(event.t, color=EVENT, linestyle="--", linewidth=1, label=text)


def _mark_gaps(ax: Axes, t: NDArray[np.float64], good: NDArray[np.bool_]) -> None:
    """Shade the times at which there is no solution, of no variant where there are some."""
    if good.all():
        return
    label = f"no solution: {np.count_nonzero(~good)} of {good.size} points"
    for first, last in runs(np.any(~good.reshape(-1, t.size), axis=0)):
        ax.axvspan(t[max(first - 1, 0)], t[last], color=GAP, zorder=0, label=label)
        label = "_"  # names the first of the spans only
    if label != "_":  # variants of which some go on at all times
        ax.plot([], [], " ", label=label)


def runs(flags: NDArray[np.bool_]) -> Iterable[tuple[int, int]]:
    """Return the first and the last index of each run of set flags."""
    steps = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return [(int(first), int(stop) - 1) for first, stop in steps.reshape(-1, 2)]


def _add_legend(ax: Axes, curves: int) -> None:
    """Put the legend where it covers nothing; very many curves are counted, not named."""
    handles, labels = ax.get_legend_handles_labels()
    if curves > MOST_NAMED:
        ax.set_ylabel(f"{curves} columns, {ax.get_ylabel()}".rstrip(", "))
        handles, labels = handles[curves:], labels[curves:]
    if len(handles) <= 1 == curves:
        return
    if len(handles) > MOST_INSIDE:
        ax.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
    elif handles:
        ax.legend(handles, labels, fontsize="small")
