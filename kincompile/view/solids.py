"""The marks of a drawing in space as flat facets, balls and lines, as `space.js` on a page."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol

import numpy as np

from kincompile.errors import InternalError
from kincompile.view import marks
from kincompile.view.body_shapes import convex_chain
from kincompile.view.marks import ends_of, in_ground, shape_of
from kincompile.view.polylines import owner
from kincompile.view.solid_shapes import SOLID_LOOKS, SOLIDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array, BodyFrame, Mark, Point
    from kincompile.view.shapes import Look
    from kincompile.view.solid_shapes import Piece

LONGEST = 8.0
"""Length of the longest facet of a solid, in sizes: what is nearer is drawn later."""

BALL = 7
"""Facets of a ball from pole to pole."""

FLAT = 1e-6
"""Part of a body's size up to which points are in a plane or on a line."""


class Places(Protocol):
    """Where points and directions of frames are."""

    def at(self, frame: BodyFrame, point: Point) -> Array:
        """Return where a point of a frame is."""

    def along(self, frame: BodyFrame, vector: Point) -> Array:
        """Return a direction of a frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Position:
    """Where they are in the ground at a position q, shape (n,)."""

    q: Array

    def at(self, frame: BodyFrame, point: Point) -> Array:
        """Return where a point of a frame is."""
        return in_ground(self.q, frame, point)

    def along(self, frame: BodyFrame, vector: Point) -> Array:
        """Return a direction of a frame."""
        return self.at(frame, vector) - self.at(frame, (0.0, 0.0, 0.0))


class InFrame:
    """Where they are in their own frames."""

    def at(self, frame: BodyFrame, point: Point) -> Array:
        """Return where a point of a frame is."""
        del frame
        return np.array(point, dtype=np.float64)

    along = at


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part of a mark in space."""

    points: Array  # shape (k, 3): the corners of a flat facet, or of a line; of a ball its centre
    # shape (3,): of a facet, to its outside; None of a line and of a ball.
    normal: Array | None = None
    is_flat: bool = False  # whether a facet is seen from both sides
    is_rim: bool = False  # whether the edges of a facet are edges of the solid
    radius: float = 0.0  # of a ball, else zero


@dataclass(frozen=True, slots=True)
class Solid:
    """A piece of a mark, in a drawing with marks of a size."""

    piece: Piece
    mark: Mark
    size: float

    @property
    def look(self) -> Look:
        """What it is drawn like."""
        return SOLID_LOOKS[self.piece.look]

    @property
    def frame(self) -> BodyFrame:
        """The frame whose colour it has."""
        return owner(self.mark, self.piece.on)

    def parts(self, places: Places) -> list[Part]:
        """Return its parts where they are."""
        piece, mark = self.piece, self.mark
        if isinstance(mark, marks.Hull) and piece.on == "points":
            faces, _ = wires(mark.points)
            return [
                Part(
                    np.array([places.at(mark.frame, point) for point in points]),
                    places.along(mark.frame, normal),
                    is_rim=True,
                )
                for points, normal in faces
            ]
        if piece.is_ball and isinstance(mark, marks.Symbol | marks.Dot):
            centre = places.at(mark.place.frame, mark.place.point)
            return [Part(centre[None], radius=piece.grow * self.size)]
        return [part for line in _lines(mark, piece.on, places) for part in self._on(line)]

    def _on(self, line: _Line) -> Iterator[Part]:
        piece = self.piece
        corners = np.array(piece.corners, dtype=np.float64)
        if not piece.sides:
            yield _flat(corners, line, piece, self.size)
            return
        feet = [0.0]
        if piece.every:
            feet = np.arange(piece.every / 2, line.length / self.size, piece.every).tolist()
        for foot in feet:
            yield from _turned(corners + np.array((0.0, foot, 0.0)), line, self.size, piece.sides)


def solids(drawn: Drawing) -> list[Solid]:
    """Return the pieces of a drawing in space."""
    return [
        Solid(piece, mark, drawn.size) for mark in drawn.marks for piece in SOLIDS[shape_of(mark)]
    ]


# ---- lines and what is turned about them ----


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """A line that a piece is beside: a direction, one at a right angle, and a length."""

    start: Array
    axis: Array
    aside: Array
    length: float = 0.0


def _lines(mark: Mark, on: str, places: Places) -> list[_Line]:
    match mark:
        case marks.Hull():
            _, edges = wires(mark.points)
            return [
                _between(places.at(mark.frame, first), places.at(mark.frame, last))
                for first, last in edges
            ]
        case marks.Span():
            start, end = (places.at(to.frame, to.point) for to in (mark.first, mark.second))
            line = _between(start, end, mark.barrel if on == "barrel" else np.inf)
            return [_from(line, mark.barrel) if on == "stem" else line]
        case marks.Drive():
            axis = np.array(mark.axis, dtype=np.float64)
            return [_Line(places.at(mark.place.frame, mark.place.point), axis, beside(axis))]
        case marks.Symbol():
            frame = mark.place.frame
            axis, aside = (places.along(frame, vector) for vector in (mark.axis, mark.cross))
            if on != "reach":
                return [_Line(places.at(frame, mark.place.point), axis, aside)]
            first, last = mark.reach
            return [_Line(places.at(frame, ends_of(mark)[0]), axis, aside, last - first)]
    raise InternalError(f"{type(mark).__name__} is no mark of space")


def facets_of(part: Part) -> list[Part]:
    """Return a facet as it is, and a ball as facets; a line has none."""
    if part.normal is not None:
        return [part]
    if not part.radius:
        return []
    angles = np.linspace(0, np.pi, BALL + 1)
    corners = np.stack((np.zeros_like(angles), -np.cos(angles), np.sin(angles)), axis=-1)
    line = _Line(part.points[0], *np.eye(3)[[2, 0]])
    return [*_turned(np.round(corners, 12), line, part.radius, 2 * BALL)]


def _between(start: Array, end: Array, most: float = np.inf) -> _Line:
    way = end - start
    length = float(np.linalg.norm(way))
    axis = way / length if length else np.array((0.0, 0.0, 1.0))
    return _Line(start, axis, beside(axis), min(length, most))


def _from(line: _Line, far: float) -> _Line:
    """Return the rest of a line, from a length on."""
    far = min(far, line.length)
    return replace(line, start=line.start + far * line.axis, length=line.length - far)


def beside(axis: Array) -> Array:
    """Return a unit vector at a right angle: to the coordinate axis that is farthest from it."""
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return _unit(across)


def _flat(corners: Array, line: _Line, piece: Piece, size: float) -> Part:
    """Return a line, or a flat area: beside an axis, or across it."""
    along, left = line.axis, line.aside
    if piece.on == "turn":
        along, left = line.aside, np.cross(line.axis, line.aside)
    far = corners[:, 0] * line.length + corners[:, 1] * size
    points = line.start + far[:, None] * along + corners[:, 2:] * size * left
    if not piece.is_area:
        return Part(points)
    return Part(points, np.cross(along, left), is_flat=True, is_rim=True)


def _turned(corners: Array, line: _Line, size: float, sides: int) -> Iterator[Part]:
    """Yield the facets of a solid: corners turned about a line."""
    angles = (np.pi / 4 if sides == 4 else 0.0) + 2 * np.pi * np.arange(sides) / sides
    third = np.cross(line.axis, line.aside)
    circle = np.cos(angles)[:, None] * line.aside + np.sin(angles)[:, None] * third
    between = circle + np.roll(circle, -1, axis=0)

    def ring(far: float, out: float) -> Array:
        return np.asarray(line.start + far * line.axis + out * circle)

    places = zip(
        corners[:, 0] * line.length + corners[:, 1] * size, corners[:, 2] * size, strict=True
    )
    for (low, inner), (high, outer) in itertools.pairwise(places):
        if low == high:  # an end: one polygon
            is_end = inner > outer
            points = ring(low, max(inner, outer))
            yield Part(
                points if is_end else points[::-1], line.axis if is_end else -line.axis, is_rim=True
            )
            continue
        count = max(1, int(np.ceil((high - low) / (LONGEST * size)))) if inner == outer else 1
        rings = [
            ring(low + part * (high - low), inner + part * (outer - inner))
            for part in np.arange(count + 1) / count
        ]
        normals = between / 2 + (inner - outer) / (high - low) * line.axis
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        for lower, upper in itertools.pairwise(rings):
            for k in range(sides):
                corner = (k + 1) % sides
                yield Part(np.stack((lower[k], lower[corner], upper[corner], upper[k])), normals[k])


# ---- the hull of a body's points ----


@lru_cache(maxsize=1000)
def wires(
    points: tuple[Point, ...],
) -> tuple[list[tuple[list[Point], Point]], list[tuple[Point, Point]]]:
    """Return the faces of the convex hull of points, each with its normal, and its edges.

    Faces are counterclockwise, seen from outside. Of points in a plane there are both sides of it,
    of points on a line no face and one edge, between its ends.
    """
    places = np.array(points, dtype=np.float64)
    faces = _faces(places)
    if not faces:
        return [], [_ends(points, places)] if len(points) > 1 else []
    found = []
    edges: dict[tuple[int, int], tuple[Point, Point]] = {}
    for on, normal in faces:
        right = beside(normal)
        flat = places[list(on)] @ np.stack((right, np.cross(normal, right)), axis=-1)
        index = {(x, y): k for k, (x, y) in zip(on, flat.tolist(), strict=True)}
        loop = [index[x, y] for x, y in convex_chain(index)]
        for first, last in zip(loop, loop[1:] + loop[:1], strict=True):
            low, high = sorted((first, last))
            edges[low, high] = points[low], points[high]
        found.append(([points[k] for k in loop], tuple(normal.tolist())))
    return found, list(edges.values())


def _faces(places: Array) -> list[tuple[tuple[int, ...], Array]]:
    """Return the points of each face of a hull, by number, and its normal to the outside.

    Points nearer to each other, to a line or to a plane than `FLAT` of their size are one, on it.
    """
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    near = FLAT * float(np.max(apart[0], initial=0.0))
    own = np.flatnonzero(~np.tril(apart <= near, -1).any(axis=1))
    corners = _spanning(places[own] - places[0], near)
    if len(corners) < 3:
        return []
    if len(corners) == 3:
        first, *others = places[own[corners]]
        normal = _unit(np.cross(*(others - first)))
        return [(tuple(own.tolist()), normal), (tuple(own.tolist()), -normal)]
    found: list[tuple[frozenset[int], Array]] = []
    for triangle, normal in _triangles(places[own]):
        corners = own[triangle].tolist()
        if any(on.issuperset(corners) and normal @ other > 0 for on, other in found):
            continue
        ways = (places[own] - places[corners[0]]) @ normal
        found.append((frozenset(own[np.abs(ways) <= near].tolist()), normal))
    return sorted(((tuple(sorted(on)), normal) for on, normal in found), key=lambda face: face[0])


def _spanning(places: Array, near: float) -> list[int]:
    """Return up to four points, each the farthest from what those before it span."""
    found, axes = [0], np.zeros((0, 3))
    while len(found) < 4:
        ways = places - places[0]
        ways -= ways @ axes.T @ axes
        far = np.linalg.norm(ways, axis=1)
        if not far.max() > near:
            break
        found.append(int(np.argmax(far)))
        axes = np.vstack((axes, ways[found[-1]] / far.max()))
    return found


def _triangles(places: Array) -> Iterator[tuple[list[int], Array]]:
    """Yield triangles of a hull, with their normals to the outside, the largest first."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(places - places[0])
    first, second, third = np.moveaxis(places[hull.simplices], 1, 0)
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    for k in np.argsort(-areas, kind="stable"):
        yield hull.simplices[k].tolist(), hull.equations[k, :3]


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _ends(points: Sequence[Point], places: Array) -> tuple[Point, Point]:

    def farthest(start: int) -> int:
        return int(np.argmax(np.linalg.norm(places - places[start], axis=1)))

    end = farthest(0)
    return points[farthest(end)], points[end]
