"""A mechanism at one position, drawn by matplotlib from the description of its shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from kincompile.errors import InputError, package_of_extra
from kincompile.model.mechanism import system_of
from kincompile.names import listed, suggestion
from kincompile.report.picture import FILL
from kincompile.runtime.results.columns import titled
from kincompile.view.drawing import drawing
from kincompile.view.labels import SIDES, Name, around, box_of, leader, placed
from kincompile.view.picture import colour_of
from kincompile.view.polylines import polylines
from kincompile.view.worlds import PLANE, PROJECTIONS, drawn_by

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import FramePoint
    from kincompile.view.polylines import Polyline

FONT, GAP, RADIUS = 8.3, 4.0, 5.0
"""Height of names, their distance from what they name, and the room of a joint [points]."""

NAME: dict[str, Any] = {
    "textcoords": "offset points",
    "fontsize": FONT,
    "ha": "center",
    "va": "center",
    "zorder": 10,
    "bbox": {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1},
}
"""Style of the name of a joint, on a pale ground."""


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
        Where to draw, in space axes with ``projection="3d"``; without it a new figure.
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
        ax = axes_of(plt.figure(layout="constrained"), drawn)
        ax.set_title(drawn.name)
    draw(ax, model, drawn, position[None])
    labels = {dot.name: dot.place for dot in drawn.dots}
    if names:
        labels |= {joint.name: joint.place for joint in drawn.joints if joint.place is not None}
    write_names(ax, drawn, _together(drawn.size, labels, position), position[None])
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


MOST_SHIFTS = {2: None, 3: 2 * len(SIDES)}
"""Places of a name that are compared, by dimension: a view that turns has no leader lines."""


def axes_of(figure: Figure, drawn: Drawing) -> Axes:
    """Return the axes of a new figure, those of space where the mechanism moves there."""
    return figure.add_subplot(projection=PROJECTIONS[drawn.dimension])


def draw(
    ax: Axes,
    model: Mechanism | ConstraintSystem,
    drawn: Drawing,
    q: NDArray[np.float64],
) -> Callable[[NDArray[np.float64]], None]:
    """Draw a mechanism at the first of the positions q, and return what moves it to another.

    The limits of the plot hold all positions, shape (N, n).
    """
    in_axes: Callable[..., Callable[[NDArray[np.float64]], None]]
    in_axes = drawn_by("plot", drawn.dimension)
    return in_axes(ax, model.system().length_unit, drawn, q)


def draw_in_plane(
    ax: Axes, unit: str, drawn: Drawing, q: NDArray[np.float64]
) -> Callable[[NDArray[np.float64]], None]:
    """Draw a mechanism at the first of positions q, shape (N, n); return what moves it."""
    x_low, x_high, y_low, y_high = drawn.extent(q)
    artists = [
        (polyline, _artist(ax, polyline, q[0], order))
        for order, polyline in enumerate(polylines(drawn))
    ]
    ax.set_aspect("equal")
    # Stands and arrows reach up to four sizes beyond their places, of which the extent has two.
    room = 2 * drawn.size
    ax.set_xlim(x_low - room, x_high + room)
    ax.set_ylim(y_low - room, y_high + room)
    ax.set_xlabel(titled("x", unit))
    ax.set_ylabel(titled("y", unit))

    def move(position: NDArray[np.float64]) -> None:
        for polyline, artist in artists:
            points = polyline.at(position)
            if polyline.is_area:
                artist.set_xy(points)
            else:
                artist.set_data(*points.T)

    return move


def write_names(
    ax: Axes, drawn: Drawing, labels: Mapping[str, FramePoint], q: NDArray[np.float64]
) -> Callable[[NDArray[np.float64]], None]:
    """Write names beside places at the first of positions q, shape (N, n); return what moves them.

    They overlap least over all positions, and keep their ways from their places.
    """
    ax.apply_aspect()
    if not labels:
        return lambda position: None
    page = 72 / ax.figure.dpi * np.asarray(ax.get_window_extent().get_points())
    names = []
    for name, place in labels.items():
        box = box_of(name, FONT)
        shifts = around(box, GAP)[: MOST_SHIFTS[drawn.dimension]]
        names.append(Name(_on_paper(ax, place.at(q)), box, shifts))
    joints = [_on_paper(ax, place.at(q)) for place in (*drawn.places, *labels.values())]
    found = placed(names, np.stack(joints, axis=1), RADIUS, page)
    moves = [
        (_written(ax, name, place.at(q[0]), shift), place)
        for (name, place), shift in zip(labels.items(), found, strict=True)
    ]

    def move(position: NDArray[np.float64]) -> None:
        for put, place in moves:
            put(place.at(position).tolist())

    return move


def _on_paper(ax: Axes, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where points are, shape (N, 2) [points]; in space, as it is first seen."""
    seen = SEEN[points.shape[-1]](ax, points)
    return np.asarray(72 / ax.figure.dpi * ax.transData.transform(seen))


def _projected(ax: Any, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points of space as axes show them, shape (N, 2)."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    return np.stack(proj_transform(*points.T, ax.get_proj())[:2], axis=-1)


SEEN: dict[int, Callable[[Any, NDArray[np.float64]], NDArray[np.float64]]] = {
    2: lambda _, points: points, 3: _projected,
}  # fmt: skip
"""Points as axes show them, by their components."""


def _written(
    ax: Axes, name: str, place: NDArray[np.float64], shift: NDArray[np.float64]
) -> Callable[[Sequence[float]], None]:
    """Write a name whose middle is beside a place [points]; return what moves it to another."""
    if len(place) > PLANE:
        from matplotlib.transforms import ScaledTranslation

        way = ScaledTranslation(
            shift[0] / 72, shift[1] / 72, cast("Any", ax.figure).dpi_scale_trans
        )
        style = {"fontsize": FONT, "ha": "center", "va": "center", "zorder": 10}
        written = cast("Any", ax).text(*place, name, transform=ax.transData + way, **style)
        written.set_in_layout(False)
        put: Callable[[Sequence[float]], None] = written.set_position_3d
        return put
    line = leader(np.zeros(2), shift, box_of(name, FONT))
    arrow = None if line is None else {"arrowstyle": "-", "linewidth": 0.6, "color": "0.4"}
    text = ax.annotate(name, (place[0], place[1]), xytext=tuple(shift), arrowprops=arrow, **NAME)
    text.set_in_layout(False)  # a long name may leave the plot, but must not shrink it

    def moved(to: Sequence[float]) -> None:
        text.xy = (to[0], to[1])

    return moved


def _artist(ax: Axes, polyline: Polyline, q: NDArray[np.float64], order: int) -> Any:
    look, points = polyline.look, polyline.at(q)
    colour = look.colour or colour_of(polyline.frame)
    style: dict[str, Any] = {"linewidth": look.width, "zorder": 2 + order * 1e-3}
    if polyline.is_area:
        face = look.area or (colour, FILL)
        (area,) = ax.fill(*points.T, edgecolor=colour, facecolor=face, **style)
        return area
    style |= {"linestyle": look.dash or "-", "solid_capstyle": "round"}
    (line,) = ax.plot(*points.T, color=colour, **style)
    return line


def _together(
    size: float, labels: Mapping[str, FramePoint], q: NDArray[np.float64]
) -> dict[str, FramePoint]:
    """Return names with their places, those of one place together."""
    at: dict[tuple[float, ...], dict[str, FramePoint]] = {}
    for name, place in labels.items():
        step = size * 1e-3
        corner = tuple(round(x / step) * step for x in place.at(q).tolist())
        at.setdefault(corner, {})[name] = place
    return {", ".join(names): next(iter(names.values())) for names in at.values()}
