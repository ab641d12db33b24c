"""A constraint's attributes as numbers, placed in frames, and the marks that follow from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.model.arguments import Kind
from kincompile.model.bodies import GROUND
from kincompile.model.expressions import alpha, as_expression, depends_on, evaluate
from kincompile.view.marks import GROUND_FRAME, Pin, Place, Point, Profile, Rail, Span, Wheel

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import TypeAlias

    from numpy.typing import NDArray

    from kincompile.model.expressions import Scalar
    from kincompile.model.resolve import Joint

    Array: TypeAlias = NDArray[np.float64]

PROFILE_POINTS = 180
"""Points of a cam profile: its chords are within 1.5e-4 of its radius."""


def world(q: Array, place: Place) -> Array:
    """Return where a place is, shape (N, 2), at positions q of shape (N, n)."""
    xi, eta = place.point
    if place.frame == GROUND_FRAME:
        return np.broadcast_to((xi, eta), (len(q), 2))
    x, y, phi = q[:, 3 * place.frame : 3 * place.frame + 3].T
    c, s = np.cos(phi), np.sin(phi)
    return np.stack((x + c * xi - s * eta, y + s * xi + c * eta), axis=-1)


@dataclass(frozen=True, slots=True)
class Scene:
    """What the constraints of a mechanism share.

    Attributes
    ----------
    values
        Parameters by name.
    frames
        Index of each body by name.
    q : ndarray, shape (N, n)
        Positions that rails must fit; all finite.
    bearings
        The point of each frame at which it first hangs on the ground or on another body.
    blocks
        The frames of bodies that are one point to all their joints, and pinned to a moving body.
    """

    values: Mapping[str, float]
    frames: Mapping[str, int]
    q: Array
    bearings: Mapping[int, Place]
    blocks: frozenset[int]


@dataclass(frozen=True, slots=True)
class Placed:
    """A joint with its attributes as numbers.

    Attributes
    ----------
    joint
        The resolved constraint.
    scene
        What it shares with the others.
    """

    joint: Joint
    scene: Scene

    @property
    def name(self) -> str:
        """Name of the constraint."""
        return self.joint.name

    @property
    def is_driver(self) -> bool:
        """Whether its value is a function of time."""
        return self.joint.is_driver

    def place(self, symbol: str) -> Place:
        """Return a point of the constraint, in the frame of its body."""
        point = number_pair(self.joint.points[symbol], self.scene.values)
        return Place(frame_of(self.joint, symbol, self.scene.frames), point)

    def unit(self, symbol: str) -> Point:
        """Return a direction of the constraint, of length one."""
        x, y = number_pair(self.joint.points[symbol], self.scene.values)
        length = math.hypot(x, y) or 1.0
        return x / length, y / length

    def number(self, symbol: str) -> float:
        """Return a scalar attribute."""
        return number(self.joint.scalars[symbol], self.scene.values)

    def constant(self, symbol: str) -> float | None:
        """Return a scalar attribute, None where it is a function of time."""
        return None if depends_on(self.joint.scalars[symbol], ("t",)) else self.number(symbol)

    def bearing(self) -> Place:
        """Return where the constraint's last body is held: the place of a turning drive."""
        frame = self.scene.frames.get(self.joint.bodies[-1].name, GROUND_FRAME)
        if frame == GROUND_FRAME:
            frame = self.scene.frames[self.joint.bodies[0].name]
        return self.scene.bearings.get(frame, Place(frame, (0.0, 0.0)))

    def pin(self, first: Place, second: Place) -> Pin:
        """Return the pin of two points, one on the ground first."""
        if second.frame == GROUND_FRAME:
            first, second = second, first
        return Pin(self.name, first, second)

    def span(self, first: str, second: str, style: str) -> Span:
        """Return the line between two points."""
        return Span(self.name, self.place(first), self.place(second), style)

    def wheel(self, centre: str, radius: str, theta: str) -> Wheel:
        """Return a gear; a negative radius is an internal one."""
        size = self.number(radius)
        return Wheel(self.name, self.place(centre), abs(size), self.number(theta), size < 0)

    def profile(self, centre: str, rho: str, style: str) -> Profile:
        """Return the curve of radius rho(alpha) about a centre."""
        place = self.place(centre)
        angles = np.linspace(0, 2 * np.pi, PROFILE_POINTS, endpoint=False).tolist()
        radius = self.joint.profiles[rho]
        points = []
        for angle in angles:
            length = number(radius, {**self.scene.values, alpha.name: angle})
            x, y = place.point
            points.append((x + length * math.cos(angle), y + length * math.sin(angle)))
        return Profile(self.name, place.frame, tuple(points), style)

    def rail(
        self,
        base: Place,
        axis: Point,
        follower: Place,
        *,
        style: str = "guide",
        offset: float = 0.0,
        at_least: tuple[float, float] | None = None,
    ) -> Rail:
        """Return a straight rail, as long as the motion of what follows it asks for.

        Parameters
        ----------
        base, axis
            A point of the line and its direction, of length one, in the frame of `base`.
        follower
            What slides or rolls on it.
        style
            As for `Rail`.
        offset
            Distance of the rail from the line, to its left.
        at_least
            Interval along the axis that it covers in any case.
        """
        along = _along(self.scene.q, base, axis, follower)
        ends = [along.min(), along.max(), *(at_least or ())]
        x, y = base.point[0] - offset * axis[1], base.point[1] + offset * axis[0]
        low, high = float(min(ends)), float(max(ends))
        start = (x + low * axis[0], y + low * axis[1])
        end = (x + high * axis[0], y + high * axis[1])
        return Rail(self.name, base.frame, start, end, axis, style)


def number(value: Scalar, values: Mapping[str, float]) -> float:
    """Return the number of an expression of parameters; zero where it has none."""
    return evaluate(as_expression(value), dict(values)) or 0.0


def number_pair(pair: tuple[Scalar, Scalar], values: Mapping[str, float]) -> Point:
    """Return the numbers of a point or a direction."""
    return number(pair[0], values), number(pair[1], values)


def frame_of(joint: Joint, symbol: str, frames: Mapping[str, int]) -> int:
    """Return the frame that a point of a joint is fixed in."""
    owner = joint.written.owners()[symbol]
    if owner == GROUND.name:
        return GROUND_FRAME
    arguments = joint.written.arguments().values()
    symbols = [item.symbol for item in arguments if item.kind is Kind.BODY]
    return frames.get(joint.bodies[symbols.index(owner)].name, GROUND_FRAME)


def _along(q: Array, base: Place, axis: Point, follower: Place) -> Array:
    """Return how far along the axis the follower is, shape (N,)."""
    apart = world(q, follower) - world(q, base)
    tip = Place(base.frame, (base.point[0] + axis[0], base.point[1] + axis[1]))
    direction = world(q, tip) - world(q, base)
    return np.asarray(np.sum(apart * direction, axis=-1), dtype=np.float64)
