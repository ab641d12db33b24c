"""A mechanism at a position as DXF, for CAD: in the unit of the model, a layer for each body."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import package_of_extra
from kincompile.view.marks import GROUND_FRAME, Contour, Polygon
from kincompile.view.polylines import Polyline, pieces, polylines
from kincompile.view.shapes import HUES
from kincompile.view.worlds import drawn_by, in_view

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array
    from kincompile.view.solids import Solid

VERSION = "R2010"
"""Version of the files: one that every CAD program of today reads."""

UNITS = {
    "m": 6, "mm": 4, "cm": 5, "dm": 14, "km": 7, "um": 13, "µm": 13, "nm": 12, "in": 1, "inch": 1,
    "ft": 2, "yd": 10,
}  # fmt: skip
"""The number that DXF has for units of length as $INSUNITS."""

SPECIAL = ("ground", "joints", "paths")
"""Layers beside those of bodies."""

CLOSE = 1e-5
"""Difference, in sizes of marks, up to which the sides of an arc are equal: marks have 6 digits."""

FLATTEST, STEEPEST = 1e-3, np.radians(16)
"""Turns from side to side of an arc; those of marks are of at most 15 degrees."""


def as_dxf(drawn: Drawing, q: Array, length_unit: str, paths: Iterable[Array] = ()) -> str:
    """Return a mechanism as the text of a DXF file.

    Circles and arcs of marks are true ones; the centre of a pin's circle is where the joint is. A
    mechanism in space is faces and lines.

    Parameters
    ----------
    length_unit
        The unit of length; one that DXF does not know is left open ($INSUNITS 0).
    paths
        Lines on the layer of paths, each of shape (k, 2), in space (k, 3).

    Raises
    ------
    UnsupportedError
        If ezdxf is not installed.
    """
    with package_of_extra("ezdxf", "dxf"):
        import ezdxf.filemanagement
    document = ezdxf.filemanagement.new(
        VERSION, setup=["linetypes"], units=UNITS.get(length_unit, 0)
    )
    layers = _layers(document, drawn)
    drawn_by("DXF", drawn.dimension)(document.modelspace(), drawn, q, layers, paths)
    text = io.StringIO()
    document.write(text)
    return text.getvalue()


def add_strokes(
    space: Any, drawn: Drawing, q: Array, layers: Sequence[str], paths: Iterable[Array]
) -> None:
    """Add the strokes of a mechanism in the plane."""
    for item in polylines(drawn):
        points = item.at(q)
        if item.stroke.look == "gap" and np.ptp(points, axis=0).max() <= 1e-3 * drawn.size:
            continue
        line = "DASHED" if item.look.dash else "BYLAYER"
        attributes = {"layer": _layer(item, layers), "linetype": line}
        is_drawn = not isinstance(item.mark, Polygon | Contour)
        for piece, is_closed in _pieces(points, item.is_area):
            _add(space, piece, is_closed, CLOSE * drawn.size if is_drawn else 0.0, attributes)
    for path in paths:
        for piece, _ in _pieces(path, False):
            _add(space, piece, False, 0.0, {"layer": layers[-1]})


def add_solids(
    space: Any, drawn: Drawing, q: Array, layers: Sequence[str], paths: Iterable[Array]
) -> None:
    """Add the faces and lines of a mechanism in space."""
    for item, part in in_view("solid_picture").all_parts(drawn, q):
        attributes = {"layer": _layer(item, layers)}
        if part.normal is None:
            space.add_polyline3d(part.points.tolist(), dxfattribs=attributes)
            continue
        first, *others = part.points.tolist()
        for k in range(0, len(others) - 1, 2):
            space.add_3dface([first, *others[k : k + 3]], dxfattribs=attributes)
    for path in paths:
        for piece, _ in _pieces(path, False):
            space.add_polyline3d(piece.tolist(), dxfattribs={"layer": layers[-1]})


def _layers(document: Any, drawn: Drawing) -> list[str]:
    """Add a layer for each body, then those for the ground, joints and paths; return their names.

    DXF does not tell capital letters from small ones: what has a name already gets a mark.
    """
    names: list[str] = []
    for name in (*drawn.bodies, *SPECIAL):
        own = name
        while own.lower() in {"0", *(other.lower() for other in names)}:
            own += "_"
        names.append(own)
        layer = document.layers.add(own)
        if len(names) <= len(drawn.bodies):
            hue = HUES["light"][(len(names) - 1) % len(HUES["light"])]
            layer.rgb = tuple(int(hue[k : k + 2], 16) for k in (1, 3, 5))
    return names


def _layer(item: Polyline | Solid, layers: Sequence[str]) -> str:
    """Return the layer of a stroke: of its body, of the ground, or of what joins them."""
    if item.look.line not in ("", "quiet"):
        return layers[-2]
    if item.frame == GROUND_FRAME:
        return layers[-3]
    return layers[item.frame.index] if not item.look.line else layers[-2]


def _pieces(points: Array, is_area: bool) -> list[tuple[Array, bool]]:
    """Return the pieces of a line that NaN interrupts, each with whether it is closed."""
    if is_area:
        return [(points, True)]
    found = ((kept, len(kept) > 2 and bool((kept[0] == kept[-1]).all())) for kept in pieces(points))
    return [(kept[:-1] if is_closed else kept, is_closed) for kept, is_closed in found]


def _add(
    space: Any, points: Array, is_closed: bool, tolerance: float, attributes: dict[str, str]
) -> None:
    """Add a line or a closed curve; with a tolerance, what is a circle or an arc becomes one."""
    vertices = _with_arcs(points, is_closed, tolerance)
    if not vertices:
        centre = points.mean(axis=0)
        radius = float(np.hypot(*(points - centre).T).mean())
        space.add_circle(centre.tolist(), radius, dxfattribs=attributes)
    elif len(vertices) == 2 and not is_closed and not vertices[0][2]:
        space.add_line(vertices[0][:2], vertices[1][:2], dxfattribs=attributes)
    else:
        space.add_lwpolyline(vertices, "xyb", close=is_closed, dxfattribs=attributes)


def _with_arcs(
    points: Array, is_closed: bool, tolerance: float
) -> list[tuple[float, float, float]]:
    """Return corners, each with the bulge of what follows: the tangent of a quarter of an arc.

    Sides of one length that turn by one angle are an arc. Nothing is returned for a whole circle.
    """
    sides = np.diff(points, axis=0, append=points[:1])[: len(points) if is_closed else -1]
    lengths, angles = np.hypot(*sides.T), np.arctan2(sides[:, 1], sides[:, 0])
    turns = (np.diff(angles) + np.pi) % (2 * np.pi) - np.pi
    found, first = [], 0
    while first < len(sides):
        last = first
        while last + 1 < len(sides) and _goes_on(lengths, turns, first, last, tolerance):
            last += 1
        if is_closed and last - first + 1 == len(points):
            return []
        turn = float(turns[first:last].mean()) * (last - first + 1) if last > first else 0.0
        found.append((float(points[first, 0]), float(points[first, 1]), float(np.tan(turn / 4))))
        first = last + 1
    if not is_closed:
        found.append((float(points[-1, 0]), float(points[-1, 1]), 0.0))
    return found


def _goes_on(lengths: Array, turns: Array, first: int, last: int, tolerance: float) -> bool:
    """Return whether the side after the last continues the arc from the first on."""
    turn, expected = turns[last], turns[first]
    return bool(
        tolerance > 0
        and abs(lengths[last + 1] - lengths[first]) <= tolerance
        and FLATTEST < abs(turn) < STEEPEST
        and abs(turn - expected) * lengths[first] <= 2 * tolerance
    )
