"""The pattern of Phi_q, drawn by matplotlib: rows and columns named, blocks outlined."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compiler import inspect
from kincompile.errors import InputError, package_of_extra
from kincompile.tables import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.report import Inspection

MOST_LABELS = 60
"""Largest number of names along a side; of more rows, every second or third is named."""

UNKNOWN, KNOWN, OUTLINE = "tab:blue", "lightsteelblue", "tab:orange"
"""Colours of entries whose coordinate their step solves for, of other entries, of blocks."""


def plot_sparsity(
    model: Mechanism | ConstraintSystem, ax: Axes | None = None, *, order: str = "solution"
) -> Axes:
    """Draw which entries of Phi_q are not identically zero, with the names of rows and columns.

    Parameters
    ----------
    model
        A mechanism or a system, also one that cannot be compiled yet.
    ax : matplotlib.axes.Axes, optional
        Where to draw; without it a new figure.
    order : {"solution", "written"}
        ``"solution"`` puts rows and columns in the order in which they are solved, and outlines
        the blocks on the diagonal: each needs the results of earlier ones only. Equations and
        coordinates that belong to no block are last. ``"written"`` is the order of the model.

    Returns
    -------
    matplotlib.axes.Axes
        Entry (row, column) is the square about that point.

    Raises
    ------
    ModelError
        If the model cannot be used as written.
    InputError
        If there is no such order.
    UnsupportedError
        If matplotlib is not installed.
    """
    with package_of_extra("matplotlib", "plot"):
        from matplotlib import pyplot as plt
        from matplotlib.collections import PolyCollection
    if order not in ("solution", "written"):
        raise InputError(f"there is no order {order!r}; orders are: solution, written")
    found = inspect(model)
    pattern = _ordered(found, by_step=order == "solution")
    if ax is None:
        # A fifth of an inch for each name, as far as a page goes.
        sides = [min(3 + len(names) / 5, 14) for names in (pattern.columns, pattern.rows)]
        _, ax = plt.subplots(figsize=tuple(sides), layout="constrained")
    for chosen, colour, label in (
        (pattern.is_unknown, UNKNOWN, "solved for in its step"),
        (~pattern.is_unknown, KNOWN, "known by then"),
    ):
        squares = list(_squares(pattern.entries[chosen]))
        ax.add_collection(PolyCollection(squares, color=colour, linewidth=0.4, label=label))
    if order == "solution":
        _outline_blocks(ax, found)
    _name_sides(ax, pattern, set(found.redundant + found.conflicting))
    sizes = f"{len(pattern.rows)} x {len(pattern.columns)}"
    ax.set_title(f"{found.name}: Phi_q, {sizes}, {len(found.pattern)} entries")
    return ax


@dataclass(frozen=True, slots=True)
class _Pattern:
    """The pattern in the order in which it is drawn."""

    # rows, columns: names, from top to bottom and from left to right.
    rows: Sequence[str]
    columns: Sequence[str]
    entries: NDArray[np.intp]
    # shape (nnz,): whether the coordinate is solved for in the step of the equation.
    is_unknown: NDArray[np.bool_]


def _ordered(found: Inspection, *, by_step: bool) -> _Pattern:
    """Return the pattern in the order of solution, or as it was written."""
    equations, coordinates = found.equations, [item.name for item in found.coordinates]
    row_step = {name: k for k, block in enumerate(found.blocks) for name in block.equations}
    column_step = {name: k for k, block in enumerate(found.blocks) for name in block.coordinates}
    rows = _sorted(equations, row_step) if by_step else equations
    columns = _sorted(coordinates, column_step) if by_step else coordinates
    pairs = [(equations[row], coordinates[column]) for row, column in found.pattern]
    row_number = {name: k for k, name in enumerate(rows)}
    column_number = {name: k for k, name in enumerate(columns)}
    entries = [(row_number[row], column_number[column]) for row, column in pairs]
    return _Pattern(
        rows,
        columns,
        np.array(entries, dtype=np.intp),
        np.array([row_step.get(row, -1) == column_step.get(column, -2) for row, column in pairs]),
    )


def _sorted(names: Sequence[str], step: Mapping[str, int]) -> list[str]:
    """Return names in the order of their steps, those without a step last."""
    return sorted(names, key=lambda name: step.get(name, len(names)))


def _squares(entries: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the corners (x, y) of a square about each entry, shape (k, 4, 2)."""
    corners = np.array(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)))
    return entries[:, None, ::-1] + 0.9 * corners


def _outline_blocks(ax: Axes, found: Inspection) -> None:
    start = -0.5
    width = min(1.5, 60 / len(found.coordinates))  # points; not to hide the entries of many
    for k, block in enumerate(found.blocks):
        end = start + len(block.equations)
        frame = [(start, start), (end, start), (end, end), (start, end), (start, start)]
        label = "_" if k else f"{counted(len(found.blocks), 'block')}, top to bottom"
        ax.plot(*zip(*frame, strict=True), color=OUTLINE, linewidth=width, label=label)
        start = end


def _name_sides(ax: Axes, pattern: _Pattern, dependent: set[str]) -> None:
    """Write the names of rows and columns; those of dependent equations are red."""
    for axis, names in ((ax.yaxis, pattern.rows), (ax.xaxis, pattern.columns)):
        step = math.ceil(len(names) / MOST_LABELS)
        ticks = range(0, len(names), step)
        axis.set_ticks(ticks, [names[k] for k in ticks], fontsize=8)
        for label in axis.get_ticklabels():
            label.set_color("red" if label.get_text() in dependent else "black")
    ax.xaxis.tick_top()
    ax.tick_params(axis="x", rotation=90)
    ax.set_aspect("equal")
    ax.set_xlim(-0.7, len(pattern.columns) - 0.3)
    ax.set_ylim(len(pattern.rows) - 0.3, -0.7)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small")
