"""The joints of a mechanism in numbers: their points in frames, and the marks drawn from them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.model.arguments import Kind
from kincompile.model.bodies import GROUND
from kincompile.model.expressions import (
    alpha,
    as_expression,
    depends_on,
    evaluate,
    symbol_names,
)
from kincompile.model.joints import Revolute
from kincompile.view.live_numbers import LiveNumber, length_of
from kincompile.view.marks import GROUND_FRAME, Contour, FramePoint, Pin, Rail, Slider, Span, Wheel

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.model.expressions import Scalar, Scalars
    from kincompile.model.points import BodyPoint
    from kincompile.model.resolve import Joint
    from kincompile.view.marks import Array, BodyFrame, Point

PROFILE_POINTS = 180
"""Points of a cam profile: its chords are within 1.5e-4 of its radius."""

BARREL = 0.85
"""Part of a cylinder's shortest length that its barrel has."""

PITCH_LINE = ("s_P", "s_Q")
"""Symbols of the points between which a rack is drawn."""


@dataclass(frozen=True)
class Geometry:
    """The joints of a mechanism, with what turns their attributes into numbers."""

    joints: Sequence[Joint]
    values: Mapping[str, float]  # parameters by name
    frames: Mapping[str, BodyFrame]
    q: Array  # shape (N, n): positions that rails must fit; all finite

    @cached_property
    def _code(self) -> tuple[Graph, Converter]:
        """The code of live numbers, and what writes it."""
        graph = Graph()
        return graph, Converter(graph, graph.input)

    def number(self, value: Scalar, **others: float) -> float:
        """Return the number of an expression of parameters; zero where it has none.

        Of an expression that depends on some, or on others by name, it is a live one.
        """
        expression, known = as_expression(value), {**self.values, **others}
        number = evaluate(expression, known) or 0.0
        names = symbol_names(expression)
        if not names or not names <= known.keys():
            return number
        graph, converter = self._code
        return LiveNumber.of(number, graph, converter.convert(expression))

    def numbers(self, vector: Scalars) -> Point:
        """Return the numbers of a point or a direction."""
        return tuple(map(self.number, vector))

    def frame_of(self, joint: Joint, symbol: str) -> BodyFrame:
        """Return the frame in which a point or a direction of a joint is fixed.

        What completes a triad, and is no argument, has the index of its body.
        """
        owner = joint.written.owners().get(symbol, symbol[-1])
        if owner == GROUND.name:
            return GROUND_FRAME
        arguments = joint.written.arguments().values()
        symbols = [item.symbol for item in arguments if item.kind is Kind.BODY]
        return self.frames.get(joint.bodies[symbols.index(owner)].name, GROUND_FRAME)

    def point(self, joint: Joint, symbol: str) -> FramePoint:
        """Return a point of a joint, in the frame of its body."""
        return FramePoint(self.frame_of(joint, symbol), self.numbers(joint.points[symbol]))

    def on_body(self, point: BodyPoint) -> FramePoint:
        """Return a named point of a body, in its frame."""
        frame = self.frames.get(point.body.name, GROUND_FRAME)
        return FramePoint(frame, self.numbers(point.local))

    def points(self, joints: Iterable[Joint]) -> list[FramePoint]:
        """Return every point that joints hold; the pitch line of a rack is drawn as such."""
        return [
            self.point(joint, item.symbol)
            for joint in joints
            for item in joint.written.arguments().values()
            if item.kind is Kind.POINT and item.symbol not in PITCH_LINE
        ]

    def distances(self, joint: Joint) -> tuple[float, ...]:
        """Return the lengths of a joint that must be positive, but functions of time."""
        arguments = joint.written.arguments().values()
        scalars = (joint.scalars[x.symbol] for x in arguments if x.kind is Kind.DISTANCE)
        return tuple(self.number(value) for value in scalars if not depends_on(value, ("t",)))

    @cached_property
    def bearings(self) -> dict[BodyFrame, FramePoint]:
        """The point of each frame's first revolute joint, one with the ground first."""
        revolutes = [joint for joint in self.joints if isinstance(joint.written, Revolute)]
        revolutes.sort(key=lambda joint: not _is_on_ground(joint))
        found: dict[BodyFrame, FramePoint] = {}
        for point in self.points(revolutes):
            found.setdefault(point.frame, point)
        return found

    @cached_property
    def blocks(self) -> frozenset[BodyFrame]:
        """The frames with one point for all joints, in a revolute joint of moving bodies."""
        points: dict[BodyFrame, set[Point]] = {}
        for item in self.points(self.joints):
            points.setdefault(item.frame, set()).add(item.point)
        pinned = self.points(
            joint
            for joint in self.joints
            if isinstance(joint.written, Revolute) and not _is_on_ground(joint)
        )
        return frozenset(item.frame for item in pinned if len(points[item.frame]) == 1)


@dataclass(frozen=True, slots=True)
class JointGeometry:
    """A joint with its attributes as numbers."""

    joint: Joint
    mechanism: Geometry

    @property
    def name(self) -> str:
        """Name of the constraint."""
        return self.joint.name

    @property
    def is_driver(self) -> bool:
        """Whether its value is a function of time."""
        return self.joint.is_driver

    def point(self, symbol: str) -> FramePoint:
        """Return a point of the constraint, in the frame of its body."""
        return self.mechanism.point(self.joint, symbol)

    def unit(self, symbol: str) -> Point:
        """Return a direction of the constraint, of length one."""
        x, y = self.mechanism.numbers(self.joint.points[symbol])
        length = length_of(x, y) or 1.0
        return x / length, y / length

    def number(self, symbol: str) -> float:
        """Return a scalar attribute."""
        return self.mechanism.number(self.joint.scalars[symbol])

    def constant(self, symbol: str) -> float | None:
        """Return a scalar attribute, None where it is a function of time."""
        return None if depends_on(self.joint.scalars[symbol], ("t",)) else self.number(symbol)

    def bearing(self) -> FramePoint:
        """Return where the last moving body is held: a turning drive is drawn there."""
        frames = (self.mechanism.frames.get(body.name) for body in reversed(self.joint.bodies))
        frame = next(frame for frame in frames if frame is not None)
        return self.mechanism.bearings.get(frame, FramePoint(frame, (0.0, 0.0)))

    def pin(self, first: FramePoint, second: FramePoint) -> Pin:
        """Return the pin of two points, one on the ground first."""
        if second.frame == GROUND_FRAME:
            first, second = second, first
        return Pin(self.name, first, second)

    def span(self, first: str, second: str, style: str) -> Span:
        """Return the line between two points; a barrel is as long as it can be in the motion."""
        start, end = self.point(first), self.point(second)
        apart = distances(start.at(self.mechanism.q), end.at(self.mechanism.q))
        barrel = BARREL * float(apart.min()) if style == "cylinder" else 0.0
        return Span(self.name, start, end, style, barrel)

    def slider(self, place: FramePoint, axis: Point, guide: BodyFrame | None = None) -> Slider:
        """Return a block, along an axis of its own frame or of its guide's."""
        return Slider(self.name, place, axis, place.frame if guide is None else guide)

    def wheel(self, centre: str, radius: str, theta: str) -> Wheel:
        """Return a gear; a negative radius is an internal one."""
        size = self.number(radius)
        return Wheel(self.name, self.point(centre), abs(size), self.number(theta), size < 0)

    def profile(self, centre: str, rho: str, style: str) -> Contour:
        """Return the curve of radius rho(alpha) about a centre."""
        place = self.point(centre)
        x, y = map(float, place.point)
        points, radius = [], self.joint.profiles[rho]
        for angle in np.linspace(0, 2 * np.pi, PROFILE_POINTS, endpoint=False).tolist():
            length = evaluate(radius, {**self.mechanism.values, alpha.name: angle}) or 0.0
            points.append((x + length * math.cos(angle), y + length * math.sin(angle)))
        live = self.mechanism.number(radius, **{alpha.name: 0.0})
        return Contour(self.name, place.frame, tuple(points), style, place.point, live)

    def rail(
        self,
        base: FramePoint,
        axis: Point,
        follower: FramePoint,
        *,
        style: str = "",
        offset: float = 0.0,
        at_least: tuple[float, ...] = (),
    ) -> Rail:
        """Return a straight rail as long as the motion of its follower.

        Parameters
        ----------
        base, axis
            A point of the line and its direction, of length one, in the frame of `base`.
        follower
            What slides or rolls on it.
        style
            As for `Rail`; without, a guide on the ground, and a slot of a body.
        """
        ways = along(self.mechanism.q, base, axis, follower)
        ends = [float(ways.min()), float(ways.max()), *at_least]
        start = (base.point[0] - offset * axis[1], base.point[1] + offset * axis[0])
        frame, reach = base.frame, (min(ends), max(ends))
        style = style or ("guide" if frame == GROUND_FRAME else "slot")
        return Rail(self.name, frame, start, axis, style, follower, at_least, reach)


def _is_on_ground(joint: Joint) -> bool:
    return any(body.is_ground for body in joint.bodies)


def along(q: Array, base: FramePoint, axis: Point, follower: FramePoint) -> Array:
    """Return the distance of the follower along the axis, shape (N,)."""
    start = base.at(q)
    ahead = tuple(x + u for x, u in zip(base.point, axis, strict=True))
    tip = FramePoint(base.frame, ahead)
    apart, direction = follower.at(q) - start, tip.at(q) - start
    return np.asarray(np.sum(apart * direction, axis=-1), dtype=np.float64)


def distances(start: Array, end: Array) -> Array:
    """Return how far points are from each other, shape (N,)."""
    return np.asarray(functools.reduce(np.hypot, (end - start).T), dtype=np.float64)
