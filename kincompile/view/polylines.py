"""The marks of a drawing as lines and areas that move with q, for matplotlib and for figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InternalError
from kincompile.view import marks
from kincompile.view.marks import BodyFrame, Mark, in_ground, shape_of
from kincompile.view.shapes import LOOKS, SHAPES, Look, Stroke

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array

CIRCLE = np.stack([f(np.radians(np.arange(0, 360, 2))) for f in (np.cos, np.sin)], axis=-1)
"""A circle of radius one, every two degrees."""

ARC = np.radians(15)
"""Largest angle between the points of a small arc."""


@dataclass(frozen=True, slots=True)
class Polyline:
    """A stroke of a mark, in a drawing with marks of a size."""

    stroke: Stroke
    mark: Mark
    size: float

    @property
    def look(self) -> Look:
        """What it is drawn like."""
        return LOOKS[self.stroke.look]

    @property
    def is_area(self) -> bool:
        """Whether it is closed and filled."""
        return self.stroke.is_area

    @property
    def frame(self) -> BodyFrame:
        """The frame whose colour it has."""
        return owner(self.mark, self.stroke.on)

    def at(self, q: Array) -> Array:
        """Return where its points are, shape (k, 2), at a position q of shape (n,).

        NaN interrupts a line.
        """
        if not self.stroke.corners:
            curve = _curve(self.mark, q, self.stroke.grow * self.size)
            return curve if self.is_area else np.concatenate((curve, curve[:1]))
        start, along, length = _axes(self.mark, self.stroke.on, q)
        part, ahead, left = self._corners(length).T[..., None]
        ahead, left = ahead * self.size, left * self.size
        if self.stroke.on == "circle":
            return _around(ahead, left, start, along, length, self.stroke.every * self.size)
        return np.asarray(start + (part * length + ahead) * along + left * _left_of(along))

    def _corners(self, length: float) -> Array:
        """Return the corners, repeated along a line; each a part, and sizes ahead and left."""
        corners = np.array([corner or (np.nan,) * 3 for corner in self.stroke.corners])
        every = self.stroke.every
        if not every or self.stroke.on == "circle":
            return corners
        feet = np.arange(every / 2, max(length / self.size, every), every)
        return np.concatenate([corners + np.array((0, foot, 0)) for foot in feet])


def polylines(drawn: Drawing) -> list[Polyline]:
    """Return the lines and areas of a drawing, from back to front."""
    return [polyline for mark in drawn.marks for polyline in of_mark(mark, drawn.size)]


def of_mark(mark: Mark, size: float) -> Iterable[Polyline]:
    """Return the lines and areas of a mark, in a drawing with marks of a size."""
    return [Polyline(stroke, mark, size) for stroke in SHAPES[shape_of(mark)]]


def pieces(points: Array) -> list[Array]:
    """Return the pieces of a line that NaN interrupts."""
    gaps = np.isnan(points).any(axis=1)
    kept = (piece[~np.isnan(piece).any(axis=1)] for piece in np.split(points, np.flatnonzero(gaps)))
    return [piece for piece in kept if len(piece) > 1]


def owner(mark: Mark, on: str) -> BodyFrame:
    """Return the frame whose colour a stroke of a mark has."""
    match mark:
        case marks.Pin() | marks.Span():
            return mark.first.frame if on in ("first", "barrel") else mark.second.frame
        case marks.Slider() | marks.Wheel() | marks.Drive() | marks.Dot() | marks.Symbol():
            return mark.place.frame
    return mark.frame


def _left_of(direction: Array) -> Array:
    return np.array((-direction[1], direction[0]))


def _axes(mark: Mark, on: str, q: Array) -> tuple[Array, Array, float]:
    """Return origin, direction of length one, and length, of the line that a stroke is drawn on."""
    match mark:
        case marks.Rail():
            return _between(*(in_ground(q, mark.frame, end) for end in (mark.start, mark.end)))
        case marks.Span() if on == "barrel":
            start, along, length = _between(mark.first.at(q), mark.second.at(q))
            return start, along, min(mark.barrel, length)
        case marks.Span():
            return _between(mark.first.at(q), mark.second.at(q))
        case marks.Pin() if on == "line":
            return _between(mark.first.at(q), mark.second.at(q))
        case marks.Wheel():
            theta = np.array((np.cos(mark.theta), np.sin(mark.theta)))
            centre, frame = np.array(mark.place.point), mark.place.frame
            return _between(*in_ground(q, frame, np.array((centre, centre + mark.radius * theta))))
        case marks.Slider():
            tip = in_ground(q, mark.guide, np.array(((0.0, 0.0), mark.axis)))
            return mark.place.at(q), tip[1] - tip[0], 0.0
        case marks.Drive() if mark.axis is not None:
            return mark.place.at(q), np.array(mark.axis), 0.0
        case marks.Pin():
            place = mark.first if on == "first" else mark.second
        case marks.Drive() | marks.Dot():
            place = mark.place
        case _:
            raise InternalError(f"{type(mark).__name__} has no axes of its own")
    return place.at(q), np.array((1.0, 0.0)), 0.0


def _between(start: Array, end: Array) -> tuple[Array, Array, float]:
    """Return a point, the direction to another one, and how far that is."""
    length = float(np.hypot(*(end - start)))
    return start, (end - start) / length if length else np.array((1.0, 0.0)), length


def _curve(mark: Mark, q: Array, grow: float) -> Array:
    """Return a closed curve, widened: of a wheel, its circle, of a link, its hull."""
    match mark:
        case marks.Wheel():
            points = np.array(mark.place.point) + (mark.radius + grow) * CIRCLE
            return in_ground(q, mark.place.frame, points)
        case marks.Hull():
            points = _rounded(np.array(mark.points), grow)
        case marks.Polygon():
            points = np.array(mark.points)
        case marks.Contour():
            points = np.array(mark.points)
            # Along the bisectors of its corners, which of a smooth curve are its normals.
            along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
            lengths = np.hypot(*along.T)[:, None]
            points = points + grow * np.stack((along[:, 1], -along[:, 0]), axis=-1) / lengths
        case _:
            raise InternalError(f"{type(mark).__name__} has no closed curve")
    return in_ground(q, mark.frame, points)


def _rounded(points: Array, radius: float) -> Array:
    """Return the corners of a convex polygon, counterclockwise, at a distance, with arcs."""
    if len(points) == 1:
        return np.asarray(points + radius * CIRCLE[::8])
    found = []
    for before, corner, after in zip(
        np.roll(points, 1, axis=0), points, np.roll(points, -1, axis=0), strict=True
    ):
        (x0, y0), (x1, y1) = corner - before, after - corner
        first = np.arctan2(-x0, y0)
        turn = np.arctan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1) % (2 * np.pi)
        angles = first + turn * np.linspace(0, 1, 2 + int(turn / ARC))
        found.append(corner + radius * np.stack((np.cos(angles), np.sin(angles)), axis=-1))
    return np.concatenate(found)


def _around(
    ahead: Array, out: Array, centre: Array, along: Array, radius: float, every: float
) -> Array:
    """Return corners, sideways and to the outside of a circle, repeated around it."""
    count = max(8, round(2 * np.pi * radius / every))
    first = np.arctan2(along[1], along[0])
    angles = first + 2 * np.pi * np.arange(count)[:, None] / count
    outward = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    sideways = np.stack((-np.sin(angles), np.cos(angles)), axis=-1)
    return np.asarray(centre + (radius + out) * outward + ahead * sideways).reshape(-1, 2)
