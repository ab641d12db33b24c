"""A mechanism at one position, drawn by matplotlib from the description of its shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError, package_of_extra
from kincompile.model.mechanism import system_of
from kincompile.names import listed, suggestion
from kincompile.runtime.results.columns import titled
from kincompile.view.drawing import drawing
from kincompile.view.marks import GROUND_FRAME
from kincompile.view.polylines import polylines
from kincompile.view.shapes import FILL, GROUND_COLOUR

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import FramePoint
    from kincompile.view.polylines import Polyline

NAME: dict[str, Any] = {
    "xytext": (9, 9),
    "textcoords": "offset points",
    "fontsize": "small",
    "zorder": 10,
    "bbox": {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1},
}
"""Style of the name of a joint: beside it, on a pale ground."""


def plot_mechanism(
    model: Mechanism | ConstraintSystem,
    q: ArrayLike | None = None,
    ax: Axes | None = None,
    p: Mapping[str, float] | None = None,
    *,
    names: bool = False,
) -> Axes:
    """Draw a mechanism at a position.

    A joint whose two points are apart, as they may be at the guess, has a red line between them.

    Parameters
    ----------
    model
        A mechanism, or a system with bodies.
    q : array_like, shape (n,), optional
        The position, such as a row of ``solution.q``; without it the guess.
    ax : matplotlib.axes.Axes, optional
        Where to draw; without it a new figure.
    p : mapping, optional
        Values of parameters by name, such as ``solution.parameters``; others have their defaults.
    names
        Whether the names of the constraints are written at their places; those of points are.

    Returns
    -------
    matplotlib.axes.Axes
        With equal scales of x and y, in the unit of length of the model.

    Raises
    ------
    ModelError
        If the model cannot be used as written.
    InputError
        If it has no bodies, `q` is not a finite position of it, or it has no such parameter.
    UnsupportedError
        If matplotlib is not installed.
    """
    with package_of_extra("matplotlib", "plot"):
        from matplotlib import pyplot as plt
    position = position_of(model, q)
    drawn = drawing(model, checked_parameters(model, p), position)
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
        ax.set_title(drawn.name)
    draw(ax, model, drawn, position[None])
    labels = {dot.name: dot.place for dot in drawn.dots}
    if names:
        labels |= {joint.name: joint.place for joint in drawn.joints if joint.place is not None}
    _write_names(ax, drawn.size, labels, position)
    return ax


def position_of(model: Mechanism | ConstraintSystem, q: ArrayLike | None) -> NDArray[np.float64]:
    """Return a checked position, shape (n,), of a model that can be drawn.

    Raises
    ------
    InputError
        If there is nothing to draw, or `q` is not a finite position.
    """
    system = require_bodies(system_of(model))
    names = [item.name for item in system.coordinates]
    if q is None:
        return np.array([item.guess for item in system.coordinates], dtype=np.float64)
    position = np.asarray(q, dtype=np.float64)
    if position.shape != (len(names),):
        raise InputError(
            f"q has the shape {position.shape}, but a position of {system.name} has the shape "
            f"({len(names)},): {listed(names)}. Give one row of solution.q."
        )
    if not np.isfinite(position).all():
        missing = [name for name, value in zip(names, position, strict=True) if value != value]
        raise InputError(
            f"q is not finite ({listed(missing or names)}): no position was found there. Give a "
            "row of solution.q where solution.status is 0."
        )
    return position


def require_bodies(system: ConstraintSystem) -> ConstraintSystem:
    """Return a system after checking that it has bodies.

    Raises
    ------
    InputError
        If it has none, so that there is nothing to draw.
    """
    if not system.bodies:
        raise InputError(
            f"{system.name} has no bodies, so there is nothing to draw: it is a system of free "
            "equations. solution.plot() shows its coordinates over time."
        )
    return system


def checked_parameters(
    model: Mechanism | ConstraintSystem, p: Mapping[str, float] | None
) -> dict[str, float]:
    """Return the given parameters after checking that the model has them.

    Raises
    ------
    InputError
        If the model has no parameter of such a name.
    """
    known = [item.name for item in model.system().parameters]
    for name in p or {}:
        if name not in known:
            raise InputError(
                f"{model.name} has no parameter {name!r}{suggestion(name, known)}; parameters "
                f"are: {listed(known)}."
            )
    return dict(p or {})


def draw(
    ax: Axes,
    model: Mechanism | ConstraintSystem,
    drawn: Drawing,
    q: NDArray[np.float64],
) -> list[tuple[Polyline, Any]]:
    """Draw all polylines at the first of the positions q, and return each with its artist.

    The limits of the plot hold all positions, shape (N, n).
    """
    x_low, x_high, y_low, y_high = drawn.extent(q)
    artists = [
        (polyline, _artist(ax, polyline, q[0], order))
        for order, polyline in enumerate(polylines(drawn))
    ]
    unit = model.system().length_unit
    ax.set_aspect("equal")
    # Stands and arrows reach up to four sizes beyond their places, of which the extent has two.
    room = 2 * drawn.size
    ax.set_xlim(x_low - room, x_high + room)
    ax.set_ylim(y_low - room, y_high + room)
    ax.set_xlabel(titled("x", unit))
    ax.set_ylabel(titled("y", unit))
    return artists


def move(artists: list[tuple[Polyline, Any]], q: NDArray[np.float64]) -> None:
    """Move the artists that `draw` returned to a position, shape (n,)."""
    for polyline, artist in artists:
        points = polyline.at(q)
        if polyline.is_area:
            artist.set_xy(points)
        else:
            artist.set_data(*points.T)


def _artist(ax: Axes, polyline: Polyline, q: NDArray[np.float64], order: int) -> Any:
    """Return the artist of a polyline."""
    look, points = polyline.look, polyline.at(q)
    is_ground = polyline.frame == GROUND_FRAME
    colour = look.colour or (GROUND_COLOUR if is_ground else f"C{polyline.frame.index % 10}")
    style: dict[str, Any] = {"linewidth": look.width, "zorder": 2 + order * 1e-3}
    if polyline.is_area:
        face = look.area or (colour, FILL)
        (area,) = ax.fill(*points.T, edgecolor=colour, facecolor=face, **style)
        return area
    style |= {"linestyle": look.dash or "-", "solid_capstyle": "round"}
    (line,) = ax.plot(*points.T, color=colour, **style)
    return line


def _write_names(
    ax: Axes, size: float, labels: Mapping[str, FramePoint], q: NDArray[np.float64]
) -> None:
    """Write names at their places; those of one place together."""
    at: dict[tuple[float, float], list[str]] = {}
    for name, place in labels.items():
        x, y = place.at(q)
        step = size * 1e-3
        at.setdefault((round(x / step) * step, round(y / step) * step), []).append(name)
    for corner, names in at.items():
        text = ax.annotate(", ".join(names), corner, **NAME)
        text.set_in_layout(False)  # a long name may leave the plot, but must not shrink it
