"""The marks of bodies: the given outline, or the hull of the joint points."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from kincompile.view.marks import GROUND_FRAME, Hull, Polygon, Symbol, moves_with
from kincompile.view.worlds import PLANE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from kincompile.model.bodies import Body
    from kincompile.view.geometry import Geometry
    from kincompile.view.marks import BodyFrame, FramePoint, Mark, Point

ALONG_SHAFTS = ("hinge", "knuckles", "shaft")
"""Shapes in space about the axis of a shaft."""

SAME_POINT = 1e-9
"""Distance, relative to the coordinates, up to which two points of a body are one."""


MADE_OF: dict[int, Callable[[BodyFrame, Any], Polygon | Hull]] = {
    2: Polygon, 3: lambda frame, corners: Hull(frame, corners, corners, "shell"),
}  # fmt: skip
"""What an outline is drawn as, by the components of its corners."""


def outlines(bodies: Iterable[Body], geometry: Geometry) -> list[Polygon | Hull]:
    """Return the outlines of those bodies that have one.

    From back to front: the first body hides what slides in it, and the ground is behind all.
    """
    found: list[Polygon | Hull] = []
    for body in bodies:
        frame = geometry.frames.get(body.name, GROUND_FRAME)
        for _, solid in body.solids:
            corners: tuple[Point, ...] = tuple(map(geometry.numbers, solid))
            if corners:
                found.append(MADE_OF[len(corners[0])](frame, corners))
    return found[::-1]


def links(
    frames: Iterable[BodyFrame],
    attached: Iterable[FramePoint],
    marks: Sequence[Mark],
    dimension: int = PLANE,
) -> list[Hull | Symbol]:
    """Return the hulls of bodies without an outline; of one point only where no mark shows it.

    In space a body with one point, its origin, in a hinge is a stub of a shaft: the hinge hides it.

    Parameters
    ----------
    dimension
        2, or 3 in space, where a hull keeps all its points: its faces are found where it is drawn.
    """
    outlined = {mark.frame for mark in marks if isinstance(mark, Polygon | Hull)}
    shown = {frame for mark in marks for frame in moves_with(mark)}
    found: list[Hull | Symbol] = []
    for frame in sorted(set(frames) - outlined):
        own: list[Point] = [place.point for place in attached if place.frame == frame]
        own += [(0.0,) * dimension] if len(_distinct(own)) < 2 else []
        points = _distinct(own)
        if len(points) > 1 or frame not in shown:
            corners = convex_chain(points) if dimension == PLANE else tuple(points)
            found.append(Hull(frame, corners, tuple(own)))
        elif dimension > PLANE:
            turning = (x for x in marks if isinstance(x, Symbol) and x.shape in ALONG_SHAFTS)
            found += [replace(x, shape="stub") for x in turning if x.place.frame == frame][:1]
    return found


def _distinct(points: Iterable[Point]) -> list[Point]:
    found: list[Point] = []
    for point in points:
        here = tuple(map(float, point))
        tolerance = SAME_POINT * (1 + max(map(abs, here)))
        if all(
            max(abs(float(a) - x) for a, x in zip(other, here, strict=True)) > tolerance
            for other in found
        ):
            found.append(point)
    return found


def convex_chain(points: Iterable[Point]) -> tuple[Point, ...]:
    """Return the convex hull, counterclockwise; of points on a line the two ends.

    Andrew's monotone chain.
    """
    ordered = sorted(points)
    if len(ordered) < 3:
        return tuple(ordered)
    chains = []
    for chain in (ordered, ordered[::-1]):
        kept: list[Point] = []
        for point in chain:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0:
                kept.pop()
            kept.append(point)
        chains.append(kept[:-1])
    return tuple(itertools.chain(*chains))


def _turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the signed area of a triangle."""
    (ax, ay), (bx, by), (cx, cy) = (map(float, point) for point in (a, b, c))
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
