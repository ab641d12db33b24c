"""The joints of a mechanism that a page can pull, with the parameters that are theirs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.model.arguments import Kind
from kincompile.model.expressions import as_expression, as_sympy, in_radians, symbol_names
from kincompile.view.geometry import PITCH_LINE
from kincompile.view.marks import GROUND_FRAME, FramePoint

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from kincompile.model.expressions import Scalar
    from kincompile.model.resolve import Joint
    from kincompile.model.scope import Point
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.geometry import Geometry

    Places = Mapping[str, Mapping[str, Point]]
    Joined = tuple[str, FramePoint, list[Sequence[Scalar]]]

SAME_PLACE = 1e-9
"""How far two points of a joint may be apart and be one, relative to the largest coordinate."""


@dataclass(frozen=True, slots=True)
class Hand:
    """A joint, as something to pull."""

    name: str
    place: FramePoint
    own: tuple[int, ...]  # parameters that are its coordinates, or that its places depend on
    is_drawn: bool  # whether they are its coordinates in the drawing


def hands_of(system: ConstraintSystem, drawn: Places, geometry: Geometry) -> tuple[Hand, ...]:
    """Return the joints of a drawing, or of constraints where there is none, in their order."""
    names = [item.name for item in system.parameters]
    letters = "xyz"[: len(system.bodies[0].kind.axes)] if system.bodies else ""
    found = []
    for name, place, points in _drawn(drawn, geometry) or _held(system, geometry):
        coordinates = [item for x in letters if (item := f"{name}_{x}") in names]
        symbols = {symbol for point in points for part in point for symbol in _symbols(part)}
        own = coordinates or [item for item in names if item in symbols]
        found.append(Hand(name, place, tuple(map(names.index, own)), bool(coordinates)))
    return tuple(found)


def guess_of(system: ConstraintSystem, geometry: Geometry) -> tuple[float, ...]:
    """Return the guess (n,) at the parameters; a page computes again what depends on them."""
    guess = [item.guess for item in system.coordinates]
    for body, columns in zip(system.bodies, system.body_columns, strict=True):
        for column, value in zip(columns, body.guess, strict=True):
            if _symbols(value):
                guess[column] = geometry.number(in_radians(as_sympy(value)))
    return tuple(guess)


def _symbols(value: object) -> frozenset[str]:
    return frozenset(symbol_names(as_expression(value)))


def _drawn(drawn: Places, geometry: Geometry) -> list[Joined]:
    """Return each joint of a drawing with its place on its first body, and on all of them."""
    frames = geometry.frames
    found: dict[str, Joined] = {}
    for body, places in drawn.items():
        for joint, place in places.items():
            at = FramePoint(frames.get(body, GROUND_FRAME), geometry.numbers(place))
            found.setdefault(joint, (joint, at, []))[2].append(place)
    return list(found.values())


def _held(system: ConstraintSystem, geometry: Geometry) -> Iterator[Joined]:
    """Yield the points that constraints hold, two at one place together, and the named ones."""
    size = float(np.abs(geometry.q[:1]).max(initial=1.0))
    for joint in geometry.joints:
        ends = [(geometry.point(joint, symbol), joint.points[symbol]) for symbol in _points(joint)]
        places = [place.at(geometry.q[:1]) for place, _ in ends]
        if len(ends) == 2 and np.abs(places[1] - places[0]).max() <= SAME_PLACE * size:
            yield joint.name, ends[0][0], [point for _, point in ends]
        else:
            for place, point in ends:
                yield joint.name, place, [point]
    for item in system.body_points:
        yield item.name, geometry.on_body(item), [tuple(item.local)]


def _points(joint: Joint) -> Iterable[str]:
    arguments = joint.written.arguments().values()
    points = (item.symbol for item in arguments if item.kind is Kind.POINT)
    return [symbol for symbol in points if symbol not in PITCH_LINE]
