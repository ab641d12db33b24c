"""A mechanism in space as a still picture: its solids, seen from one of the standard views."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.report.picture import FILL, PicturePath
from kincompile.view.marks import GROUND_FRAME, Dot, Hull, Polygon, moves_with
from kincompile.view.picture import GAP, MARGIN, Scale, colour_of, composed, size_of
from kincompile.view.polylines import pieces
from kincompile.view.shapes import HUES, INKS, mixed
from kincompile.view.solids import Position, facets_of, solids

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from kincompile.report.picture import Picture
    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array, BodyFrame, Mark
    from kincompile.view.picture import Arrow
    from kincompile.view.solids import Part, Solid

VIEWS: dict[str, tuple[float, float]] = {
    "isometric": (-math.pi / 4, math.atan(math.sqrt(0.5))),
    "front": (-math.pi / 2, 0.0),
    "side": (0.0, 0.0),
    "top": (-math.pi / 2, math.pi / 2),
}
"""The standard views: azimuth of the viewer, and how high it stands [rad]."""

LIGHT = np.array((-0.42, 0.55, 0.72))
"""Where light comes from: to the right, up, and towards the viewer."""

PLATE = 0.55
"""Opacity of the faces of a body, behind which joints are seen."""

RIM = 0.6
"""Part of a line's width that the edges of solids have."""

SEAM = 0.4
"""Width of the line in its own colour around a facet of a round solid, which closes seams."""

CIRCLE = np.stack([f(np.radians(np.arange(0, 360, 10))) for f in (np.cos, np.sin)], axis=-1)
"""A ball of radius one."""


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A direction of view, without perspective."""

    axes: Array  # shape (3, 3): unit vectors to the right, up, and towards the viewer

    @classmethod
    def named(cls, view: str) -> Camera:
        """Return one of the standard views."""
        azimuth, height = VIEWS[view]
        c, s, a, b = math.cos(azimuth), math.sin(azimuth), math.cos(height), math.sin(height)
        return cls(np.array(((-s, c, 0), (-b * c, -b * s, a), (a * c, a * s, b))))

    def seen(self, points: Array) -> Array:
        """Return points of space to the right, up, and towards the viewer."""
        return np.asarray(points @ self.axes.T)


ISOMETRIC = Camera.named("isometric")


def picture_in_space(
    drawn: Drawing,
    q: Array,
    title: str,
    arrows: Sequence[Arrow],
    focus: Iterable[BodyFrame] | None,
) -> Picture:
    """Draw a mechanism in space; `picture` says what is given."""
    ends = [ISOMETRIC.seen(np.stack((arrow.start, arrow.end)))[:, :2] for arrow in arrows]
    about = _about(drawn, focus) if focus else drawn
    seen = seen_paths(about, q, ISOMETRIC)
    margin = max([MARGIN, *(GAP + size_of(arrow.name)[0] for arrow in arrows)])
    scale = Scale([*(path.points for path in seen), *ends], margin=margin)
    shown = (dataclasses.replace(path, points=scale.at(path.points)) for path in seen)
    pins = [scale.at(ISOMETRIC.seen(place.at(q))[:2]) for place in about.places]
    return composed(title, scale, shown, zip(arrows, ends, strict=True), pins)


def _about(drawn: Drawing, focus: Iterable[BodyFrame]) -> Drawing:
    """Return a drawing of some bodies, and of what joins them with each other and the ground."""
    shown = {*focus, GROUND_FRAME}
    joined: dict[object, set[BodyFrame]] = {}
    for mark in drawn.marks:
        joined.setdefault(_joint_of(mark), set()).update(moves_with(mark))
    marks = tuple(mark for mark in drawn.marks if joined[_joint_of(mark)] <= shown)
    return dataclasses.replace(drawn, marks=marks)


def _joint_of(mark: Mark) -> object:
    """Return the name of the joint that a mark shows, or the mark of a body itself."""
    return mark if isinstance(mark, Hull | Polygon | Dot) else mark.joint


def seen_paths(drawn: Drawing, q: Array, camera: Camera) -> list[PicturePath]:
    """Return what is seen of a mechanism from back to front, in lengths of the model."""
    position, found = Position(q), []
    for solid in solids(drawn):
        for part in solid.parts(position):
            if is_visible(solid, part, camera):
                points = camera.seen(part.points)
                depth = float(points[:, 2].mean()) + part.radius
                found.append((depth, _path(solid, part, camera, points[:, :2])))
    # What differs by rounding errors alone keeps its order, on every processor.
    farthest = max((abs(depth) for depth, _ in found), default=0.0) or 1.0
    return [path for _, path in sorted(found, key=lambda item: round(item[0] / farthest, 9))]


def all_parts(drawn: Drawing, q: Array) -> Iterator[tuple[Solid, Part]]:
    """Yield facets and lines of a mechanism, balls as facets, without gaps that are closed."""
    position = Position(q)
    for solid in solids(drawn):
        for part in solid.parts(position):
            if part.normal is not None or part.radius:
                yield from ((solid, facet) for facet in facets_of(part))
            elif not is_gap(solid, part):
                yield solid, part


def is_visible(solid: Solid, part: Part, camera: Camera) -> bool:
    """Return whether a part is towards the viewer, and no gap of a joint that is closed."""
    if part.normal is not None and not part.is_flat:
        return bool(part.normal @ camera.axes[2] > 0)
    return not is_gap(solid, part)


def is_gap(solid: Solid, part: Part) -> bool:
    """Return whether a part is the line between two points that coincide."""
    way = np.ptp(part.points, axis=0)
    return solid.piece.look == "gap" and bool(np.max(way) <= 1e-3 * solid.size)


def _path(solid: Solid, part: Part, camera: Camera, points: Array) -> PicturePath:
    look, line = solid.look, solid.look.colour or colour_of(solid.frame)
    if part.radius:
        face = look.area or mixed(line, FILL)
        return PicturePath(points + part.radius * CIRCLE, line, face, look.width)
    if part.normal is None:
        return PicturePath(points, line, "", look.width, dash=look.dash)
    face = (look.area or line) if part.is_flat else shade(line, part.normal, camera)
    width = RIM * look.width if part.is_rim else SEAM
    opacity = PLATE if solid.piece.look == "plate" else 1.0
    return PicturePath(points, line if part.is_rim else face, face, width, opacity)


def shade(colour: str, normal: Array, camera: Camera) -> str:
    """Return the colour of a facet in the light, which on white paper makes it paler."""
    lit = max(0.0, float(camera.seen(normal) @ LIGHT))
    return mixed(colour, 0.85 - 0.6 * lit)


def trace(index: int, points: Array) -> Iterator[PicturePath]:
    """Yield a path in a colour of its own, on a rim of paper."""
    hues = HUES["light"]
    for piece in pieces(points):
        yield PicturePath(piece, INKS["paper"], "", 3.0)
        yield PicturePath(piece, hues[(index + 4) % len(hues)], "", 1.5)
