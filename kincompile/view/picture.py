"""A mechanism at one position as a still picture: paths and labels, for HTML and LaTeX.

The paths are the polylines that matplotlib draws. Vectors with their names may be drawn over them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.report.picture import INDEX, SYMBOL, Picture, PictureLabel, PicturePath
from kincompile.view.labels import Name, around, box_of, leader, placed
from kincompile.view.marks import GROUND_FRAME, moves_with
from kincompile.view.polylines import Polyline, of_mark, pieces
from kincompile.view.shapes import GROUND_COLOUR, HUES
from kincompile.view.worlds import PLANE, drawn_by

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array, BodyFrame, Mark

WIDTH, TALLEST = 480.0, 340.0
"""Largest sides of a picture [points]."""

MARGIN = 24.0
"""Room around it for labels [points]."""

FAINT = 0.25
"""Opacity of what a picture is not about."""

MOST_FAINT = 12
"""Bodies up to which those that a picture is not about are shown."""

HEAD, THICK = 7.0, 1.4
"""Length of the head of a vector, and width of its line [points]."""

GAP = 1.5
"""Distance of a label from its vector [points]."""

RADIUS = 8.0
"""Room around a pin that labels leave free [points]."""

THIN = 0.6
"""Width of the line from a label to its vector [points]."""

ALONG = (0.5, 0.65, 0.35, 0.8, 0.2)
"""Where a label may stand beside its vector, in parts of it, the best place first."""


@dataclass(frozen=True, slots=True)
class Arrow:
    """A vector to be drawn, in the axes of the ground."""

    name: str  # name of its symbol, such as ``"s_i"``
    start: Array
    end: Array
    frame: BodyFrame  # the frame whose colour it has
    is_vector: bool = True  # whether its symbol is bold; an axis of a frame is not
    is_direction: bool = False  # whether it is drawn at a length of its own


def picture(
    drawn: Drawing,
    q: Array,
    title: str,
    arrows: Sequence[Arrow] = (),
    focus: Iterable[BodyFrame] | None = None,
) -> Picture:
    """Draw a mechanism.

    Parameters
    ----------
    q : ndarray, shape (n,)
        The position.
    arrows
        Vectors over it.
    focus
        Frames that the picture is about; what moves with others is faint, in space left out. All
        by default.
    """
    made: Picture = drawn_by("picture", drawn.dimension)(drawn, q, title, arrows, focus)
    return made


def picture_in_plane(
    drawn: Drawing,
    q: Array,
    title: str,
    arrows: Sequence[Arrow],
    focus: Iterable[BodyFrame] | None,
) -> Picture:
    """Draw a mechanism in the plane; `picture` says what is given."""
    left, right, low, high = drawn.extent(q)
    ends = [np.stack((arrow.start, arrow.end)) for arrow in arrows]
    scale = Scale([np.array(((left, low), (right, high))), *ends])
    shown = None if focus is None else {*focus, GROUND_FRAME}
    paths = [
        path
        for mark in drawn.marks
        if shown is None or len(drawn.bodies) <= MOST_FAINT or moves_with(mark) <= shown
        for polyline in of_mark(mark, drawn.size)
        for path in _paths(polyline, q, scale, opacity_of(mark, shown))
    ]
    pins = [scale.at(place.at(q)) for place in drawn.places]
    return composed(title, scale, paths, zip(arrows, ends, strict=True), pins)


def composed(
    title: str,
    scale: Scale,
    paths: Iterable[PicturePath],
    arrows: Iterable[tuple[Arrow, Array]] = (),
    pins: Iterable[Array] = (),
) -> Picture:
    """Return a picture of paths, and over them vectors with their ends before they are scaled.

    Labels keep away from pins, which are points of the picture.
    """
    ways = [(arrow, scale.at(ends[0]), scale.at(ends[1])) for arrow, ends in arrows]
    names = [Name(_named(*way)[None], size_of(way[0].name), _shifts(*way)) for way in ways]
    drawn = [start + np.linspace(0, 1, 12)[:, None] * (end - start) for _, start, end in ways]
    page = np.array(((0.0, 0.0), (scale.width, scale.height)))
    joints, lines = np.reshape([*pins], (1, -1, 2)), np.reshape(drawn, (1, -1, 2))
    shown, labels = list(paths), list[PictureLabel]()
    shifts = placed(names, joints, RADIUS, page, lines)
    for (arrow, start, end), name, shift in zip(ways, names, shifts, strict=True):
        middle, colour = name.places[0] + shift, colour_of(arrow.frame)
        line = leader(_nearest(start, end, middle), middle, name.size)
        shown += _arrow(arrow, start, end)
        if line is not None:
            shown.append(PicturePath(line, colour, "", THIN))
        x, y = middle.tolist()
        labels.append(PictureLabel(x, y, arrow.name, colour, arrow.is_vector))
    return Picture(title, scale.width, scale.height, tuple(shown), tuple(labels))


def _nearest(start: Array, end: Array, point: Array) -> Array:
    """Return the point of a line that is nearest to another point."""
    length, along = _way(start, end)
    return np.asarray(start + np.clip((point - start) @ along, 0, length) * along)


class Scale:
    """From the lengths of a model to points of a picture that shows some points."""

    def __init__(
        self,
        shown: Sequence[Array],
        most: tuple[float, float] = (WIDTH, TALLEST),
        margin: float = MARGIN,
    ) -> None:
        points = np.concatenate(shown) if shown else np.array([[-1.0, -1.0], [1.0, 1.0]])
        self._margin, self._low = margin, np.nanmin(points, axis=0)
        wide, tall = np.nanmax(points, axis=0) - self._low
        self.factor = min((most[0] - 2 * margin) / wide, (most[1] - 2 * margin) / tall)
        self.width = self.factor * float(wide) + 2 * margin
        self.height = self.factor * float(tall) + 2 * margin

    def at(self, points: Array) -> Array:
        """Return where points are on the picture."""
        return np.asarray(self._margin + self.factor * (points - self._low), dtype=np.float64)


def opacity_of(mark: Mark, shown: set[BodyFrame] | None) -> float:
    """Return the opacity of a mark where a picture is about some frames; None for all."""
    return 1.0 if shown is None or moves_with(mark) <= shown else FAINT


def colour_of(frame: BodyFrame) -> str:
    """Return the colour of a body, or of the ground."""
    return (
        GROUND_COLOUR if frame == GROUND_FRAME else HUES["light"][frame.index % len(HUES["light"])]
    )


def _paths(polyline: Polyline, q: Array, scale: Scale, opacity: float) -> Iterable[PicturePath]:
    look, points = polyline.look, scale.at(polyline.at(q))
    colour = look.colour or colour_of(polyline.frame)
    if polyline.is_area:
        fill = look.area or colour
        yield PicturePath(points, colour, fill, look.width, opacity, is_pale=not look.area)
        return
    for piece in pieces(points):
        yield PicturePath(piece, colour, "", look.width, opacity, dash=look.dash)


def _arrow(arrow: Arrow, start: Array, end: Array) -> tuple[PicturePath, PicturePath]:
    """Return line and head of a vector between two points of the picture."""
    colour, length, along = colour_of(arrow.frame), *_way(start, end)
    left = np.array((-along[1], along[0]))
    head = min(HEAD, 0.6 * length)
    neck = end - head * along
    corners = np.stack((end, neck + 0.38 * head * left, neck - 0.38 * head * left))
    line = PicturePath(np.stack((start, neck)), colour, "", THICK)
    return line, PicturePath(corners, "", colour, 0.0)


def _way(start: Array, end: Array) -> tuple[float, Array]:
    """Return length and direction; to the right where the viewer looks along a vector."""
    length = float(np.hypot(*(end - start)))
    return length, (end - start) / length if length > 1e-6 * WIDTH else np.array((1.0, 0.0))


def _shifts(arrow: Arrow, start: Array, end: Array) -> Array:
    """Return where the name of a vector may be from its middle; that of an axis is at its end.

    So is that of a direction in space, where six of them may begin at one point.
    """
    _, along = _way(start, end)
    aside, size = np.array((-along[1], along[0])), size_of(arrow.name)

    def beyond(way: Array) -> Array:
        return way * (float(np.abs(way) @ size) / 2 + GAP)

    sides = (beyond(aside), beyond(-aside))
    if not arrow.is_vector or (arrow.is_direction and len(arrow.start) > PLANE):
        found = [end + shift for shift in (beyond(along), *sides)]
    else:
        found = [start + part * (end - start) + shift for part in ALONG for shift in sides]
    anchor = _named(arrow, start, end)
    return np.concatenate((np.stack(found) - anchor, around(size, GAP)))


def _named(arrow: Arrow, start: Array, end: Array) -> Array:
    """Return the point of a vector that its name belongs to."""
    return (start + end) / 2 if arrow.is_vector and not arrow.is_direction else end


def size_of(name: str) -> Array:
    """Return the size of a symbol, whose index is smaller, and which may have a prime."""
    letter, _, index = name.partition("_")
    wide = box_of(letter, SYMBOL)[0] + box_of(index, INDEX * SYMBOL)[0] + SYMBOL / 4
    return np.array((wide, 1.2 * SYMBOL))
