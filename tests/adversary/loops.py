"""Random loops in space whose motion is known in closed form, by vectors.

A crank leads a rod with a ball at either end (or a body on a ball and a cross), the rod a rocker
on a hinge or a slider on a guide, that the next rod, and so on; all axes point anywhere. A stage
closes in one of two ways, which a motion keeps until the rod is stretched. Nothing here comes from
kincompile but the constraints with which the mechanism is written down.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial

Array = NDArray[Any]
SAMPLES = 40
"""Positions between two times, by which turns are counted and a stretched rod is seen."""


def unit(random: np.random.Generator) -> Array:
    """Return a direction that points anywhere."""
    v: Array = random.normal(size=3)
    return v / float(np.linalg.norm(v))


def beside(random: np.random.Generator, axis: Array) -> Array:
    """Return a direction at a right angle to another."""
    v: Array = np.cross(axis, unit(random))
    return v / float(np.linalg.norm(v))


@dataclass(frozen=True)
class Rocker:
    """A follower on a hinge: its end is at `origin` + A(angle) `arm`."""

    origin: Array
    axis: Array
    arm: Array
    length: float

    def place(self, angle: Array, point: Array) -> Array:
        """Return where a point of it is, given by its way from the origin at angle 0."""
        along = (point @ self.axis) * self.axis
        across = point - along
        c, s = np.cos(angle)[:, np.newaxis], np.sin(angle)[:, np.newaxis]
        places: Array = self.origin + along + c * across + s * np.cross(self.axis, across)
        return places

    def closed(self, pin: Array, sign: int) -> tuple[Array, Array]:
        """Return its angle for places of the pin at the rod's other end, and how far it is off."""
        way = pin - self.origin
        along = (self.arm @ self.axis) * self.axis
        across = self.arm - along
        x, y = way @ across, way @ np.cross(self.axis, across)
        squares = self.arm @ self.arm + np.sum(way**2, axis=1) - self.length**2
        part = (squares / 2 - way @ along) / np.hypot(x, y)
        return np.arctan2(y, x) + sign * np.arccos(np.clip(part, -1, 1)), 1 - abs(part)


@dataclass(frozen=True)
class Slider:
    """A follower on a guide: its end is at `origin` + way `axis`."""

    origin: Array
    axis: Array
    arm: Array
    length: float

    def place(self, way: Array, point: Array) -> Array:
        """Return where a point of it is, given by its way from the origin at way 0."""
        places: Array = self.origin + point + way[:, np.newaxis] * self.axis
        return places

    def closed(self, pin: Array, sign: int) -> tuple[Array, Array]:
        """Return its way for places of the pin at the rod's other end, and how far it is off."""
        gap = self.origin + self.arm - pin
        half = gap @ self.axis
        rest = half**2 - np.sum(gap**2, axis=1) + self.length**2
        return -half + sign * np.sqrt(np.maximum(rest, 0)), rest / self.length**2


@dataclass(frozen=True)
class Loop:
    """A crank, its followers, and for each the pin that leads it and whether the rod is a body."""

    crank: Rocker
    stages: tuple[Rocker | Slider, ...]
    pins: tuple[Array, ...]
    has_body: tuple[bool, ...]
    frames: tuple[Rotation, ...]
    speed: float


def random_loop(random: np.random.Generator) -> Loop:
    """Return a loop of one to three stages, all lengths about 1."""
    axis = unit(random)
    origin = random.uniform(-1, 1, 3)
    crank = Rocker(origin, axis, 0.4 * beside(random, axis) + 0.2 * axis, 0.0)
    stages: list[Rocker | Slider] = []
    pins = [crank.arm]
    last: Rocker | Slider = crank
    for _ in range(random.integers(1, 4)):
        pin = last.place(np.zeros(1), pins[-1])[0]
        axis, length = unit(random), random.uniform(1.0, 2.0)
        across = beside(random, axis)
        kind = Rocker if random.integers(0, 3) else Slider
        # The end can go this way, and the rod pushes it there: not stretched at the start.
        way = np.cross(axis, across) if kind is Rocker else axis
        rod = unit(random)
        while abs(rod @ way) < 0.4:
            rod = unit(random)
        end = pin + length * rod
        arm = random.uniform(0.7, 1.5) * across + random.uniform(-0.5, 0.5) * axis
        last = kind(end - arm, axis, arm, length)
        stages.append(last)
        pins.append(arm + random.uniform(-0.3, 0.3, 3))
    bodies = tuple(bool(item) for item in random.integers(0, 2, len(stages)))
    count = 1 + len(stages) + sum(bodies)
    frames = tuple(
        Rotation.random(random_state=int(random.integers(1 << 30))) for _ in range(count)
    )
    speed = float(random.uniform(0.5, 2) * random.choice((-1, 1)))
    return Loop(crank, tuple(stages), tuple(pins), bodies, frames, speed)


def angle(loop: Loop, t: Any, sin: Any = np.sin) -> Any:
    """Return the angle of the crank."""
    return loop.speed * t + 0.2 * sin(t)


def motion(loop: Loop, t: Array, signs: tuple[int, ...]) -> tuple[list[Array], Array]:
    """Return the coordinate of each follower, counted on, and the least margin up to each time."""
    steps = np.linspace(0, 1, SAMPLES, endpoint=False)
    fine = np.append((t[:-1, np.newaxis] + np.diff(t)[:, np.newaxis] * steps).ravel(), t[-1])
    here = angle(loop, fine)
    last: Rocker | Slider = loop.crank
    found, margin = [], np.ones(fine.size)
    for stage, pin, sign in zip(loop.stages, loop.pins, signs, strict=False):
        here, left = stage.closed(last.place(here, pin), sign)
        here = np.unwrap(here) if isinstance(stage, Rocker) else here
        margin, last = np.minimum(margin, left), stage
        found.append(here[::SAMPLES])
    return found, np.minimum.accumulate(margin)[::SAMPLES]


def mechanism(loop: Loop, scale: float, noise: float, random: np.random.Generator) -> Any:
    """Return the loop as a mechanism, in some unit of length, with a guess that is off by noise."""
    m = spatial.Mechanism("loop")
    frames = iter(loop.frames)

    def body(name: str, place: Array) -> tuple[Any, Rotation]:
        turn = next(frames)
        off = Rotation.from_rotvec(random.uniform(-noise, noise, 3))
        return m.body(name, scale * (place + random.uniform(-noise, noise, 3)), off * turn), turn

    def hinge(name: str, part: Rocker, item: Any, turn: Rotation) -> None:
        own = turn.inv().apply(part.axis)
        place = scale * part.origin
        m.add(spatial.Revolute(name, m.ground, place, part.axis, item, (0, 0, 0), own))

    crank, turn = body("crank", loop.crank.origin)
    hinge("hinge", loop.crank, crank, turn)
    axis, own = loop.crank.axis, turn.inv().apply(loop.crank.axis)
    cross, local = loop.crank.arm, turn.inv().apply(loop.crank.arm)
    driven = angle(loop, kc.t, sympy.sin)
    m.add(spatial.RelativeRotation("motor", m.ground, axis, cross, crank, own, local, driven))
    last, lead = (crank, turn), loop.crank.origin
    for k, (part, pin) in enumerate(zip(loop.stages, loop.pins, strict=False)):
        name = f"follower_{k}"
        follower, turn = body(name, part.origin)
        if isinstance(part, Rocker):
            hinge(f"hinge_{k}", part, follower, turn)
        else:
            cross = beside(random, part.axis)
            guide = (m.ground, scale * part.origin, part.axis, cross)
            local = [turn.inv().apply(v) for v in (part.axis, np.cross(part.axis, cross))]
            m.add(spatial.Translational(f"guide_{k}", *guide, follower, (0, 0, 0), *local))
        start, end = scale * last[1].inv().apply(pin), scale * turn.inv().apply(part.arm)
        if loop.has_body[k]:
            way = part.origin + part.arm - lead - pin
            rod, frame = body(f"rod_{k}", lead + pin)
            arm = np.cross(way, unit(random))
            m.add(spatial.Spherical(f"ball_{k}", last[0], start, rod, (0, 0, 0)))
            own = (rod, scale * frame.inv().apply(way), frame.inv().apply(arm))
            other = turn.inv().apply(np.cross(arm, way))
            m.add(spatial.Universal(f"cross_{k}", *own, follower, end, other))
        else:
            rod_length = scale * part.length
            m.add(spatial.Distance(f"rod_{k}", last[0], start, follower, end, rod_length))
        last, lead = (follower, turn), part.origin
    return m
