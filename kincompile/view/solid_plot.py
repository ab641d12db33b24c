"""A mechanism in space drawn by matplotlib, in axes of three dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.report.picture import FILL
from kincompile.runtime.results.columns import titled
from kincompile.view.marks import GROUND_FRAME
from kincompile.view.shapes import GROUND_COLOUR, mixed
from kincompile.view.solid_picture import (
    ISOMETRIC,
    PLATE,
    RIM,
    SEAM,
    VIEWS,
    all_parts,
    shade,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array
    from kincompile.view.solids import Part, Solid

AXES = "xyz"


def draw_in_space(ax: Any, unit: str, drawn: Drawing, q: Array) -> Callable[[Array], None]:
    """Draw a mechanism at the first of positions q, shape (N, n); return what moves it to another.

    Raises
    ------
    InputError
        If the axes are those of a plane.
    """
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    if ax.name != "3d":
        raise InputError(
            f"{drawn.name} moves in space, and ax has two dimensions: give axes made with "
            'projection="3d", or none'
        )
    start = np.zeros((1, 3, 3))  # a collection of nothing has no limits
    faces = ax.add_collection3d(Poly3DCollection(start, zsort="average"))
    lines = ax.add_collection3d(Line3DCollection(start))
    _set_limits(ax, unit, drawn, q)

    def move(position: Array) -> None:
        areas, strokes = _seen(drawn, position)
        faces.set_verts(_alike([points for points, *_ in areas]))
        faces.set_facecolor([face for _, face, *_ in areas])
        faces.set_edgecolor([edge for *_, edge, _ in areas])
        faces.set_linewidth([width for *_, width in areas])
        lines.set_segments(_alike([points for points, *_ in strokes]))
        lines.set_color([colour for _, colour, *_ in strokes])
        lines.set_linewidth([width for *_, width, _ in strokes])
        lines.set_linestyle([dash or "-" for *_, dash in strokes])

    move(q[0])
    return move


def _alike(chains: list[Array]) -> list[Array]:
    """Return chains of one length, the last points repeated: matplotlib fills up with anything."""
    most = max(map(len, chains), default=0)
    return [np.pad(points, ((0, most - len(points)), (0, 0)), mode="edge") for points in chains]


def _set_limits(ax: Any, unit: str, drawn: Drawing, q: Array) -> None:
    limits = np.reshape(drawn.extent(q), (3, 2))
    for letter, ends in zip(AXES, limits, strict=True):
        getattr(ax, f"set_{letter}lim")(*ends)
        getattr(ax, f"set_{letter}label")(titled(letter, unit))
    ax.set_box_aspect(np.ptp(limits, axis=1))
    azimuth, height = np.degrees(VIEWS["isometric"])
    ax.view_init(elev=height, azim=azimuth)
    ax.locator_params(nbins=5)


def _seen(
    drawn: Drawing, q: Array
) -> tuple[list[tuple[Array, Any, Any, float]], list[tuple[Array, str, float, str]]]:
    """Return areas, each with its face, edge and width, and lines with colour, width and dash."""
    areas: list[tuple[Array, Any, Any, float]] = []
    lines: list[tuple[Array, str, float, str]] = []
    for solid, part in all_parts(drawn, q):
        look, colour = solid.look, _colour(solid)
        if part.normal is None:
            lines.append((part.points, colour, look.width, look.dash))
        else:
            areas.append(_area(solid, part, part.normal, colour))
    return areas, lines


def _area(solid: Solid, part: Part, normal: Array, colour: str) -> tuple[Array, Any, Any, float]:
    """Return a facet with the colours of face and edge, and the width of the edge."""
    from matplotlib.colors import to_rgba

    if solid.piece.is_ball:
        face = solid.look.area or mixed(colour, FILL)
    else:
        face = colour if part.is_flat else shade(colour, normal, ISOMETRIC)
    opacity = PLATE if solid.piece.look == "plate" else 1.0
    edge, width = (colour, RIM * solid.look.width) if part.is_rim else (face, SEAM)
    return part.points, to_rgba(face, opacity), to_rgba(edge), width


def _colour(solid: Solid) -> str:
    from matplotlib.colors import to_hex

    if solid.look.colour:
        return solid.look.colour
    frame = solid.frame
    return GROUND_COLOUR if frame == GROUND_FRAME else to_hex(f"C{frame.index % 10}")
