"""Random chains of dyads whose motion is known in closed form, by complex numbers.

A crank is followed by dyads: two links with three pins (RRR), a link with a slider (RRP), a swing
in whose slot a pin runs, a gear that rolls on a body that turns about the ground. Each dyad closes
in one of two ways, which a motion keeps until the dyad is stretched. Nothing here comes from
kincompile but the constraints with which the mechanism is written down.
"""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy
from numpy.typing import NDArray

import kincompile as kc

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[Any]

SAMPLES = 60
"""Positions between two times, by which turns are counted and a stretched dyad is seen."""


@dataclass(frozen=True)
class Placement:
    """Where a chain lies: its unit of length, how it is turned, and its place in sizes."""

    scale: float = 1.0
    turn: float = 0.0
    origin: complex = 0j

    def __call__(self, point: complex) -> tuple[float, float]:
        """Return where a point of the ground lies."""
        placed = self.scale * (self.origin + cmath.exp(1j * self.turn) * point)
        return placed.real, placed.imag


@dataclass(frozen=True)
class Link:
    """A body: its name, the angle of its frame behind the line that leads it, and a point."""

    name: str
    lag: float
    offset: complex


@dataclass
class Chain:
    """A random chain; all lengths in its own unit, about 1.

    Attributes
    ----------
    theta
        The angle of the crank as a function of time, for arrays and for SymPy.
    links
        The bodies in order.
    steps
        Gives from positions of pins so far those of one dyad: its bodies' leading points and
        directions, and how far from stretched it is.
    write
        Adds the joints of each dyad to a mechanism.
    """

    theta: Callable[[Any, Any], Any]
    links: list[Link] = field(default_factory=list)
    steps: list[Callable[..., Any]] = field(default_factory=list)
    write: list[Callable[..., Any]] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)


def random_chain(random: np.random.Generator, kinds: list[str]) -> Chain:
    """Return a chain with these dyads, assembled at t = 0."""
    start, speed = random.uniform(-3, 3), random.choice((-1, 1)) * random.uniform(0.5, 2)
    swing = random.choice((0.0, 0.3))

    def theta(t: Any, sin: Any) -> Any:
        return start + speed * t + swing * sin(t)

    chain = Chain(theta, kinds=kinds)
    crank = _link(random, chain)
    radius = float(random.uniform(0.3, 0.7))

    def first(t: Array, poses: dict[str, Any], closing: dict[str, Any]) -> Array:
        poses[crank.name] = np.zeros(t.size, complex), theta(t, np.sin)
        return np.ones(t.size)

    def write_first(m: kc.Mechanism, at: Placement) -> None:
        m.add(kc.Revolute("O", m.ground, at(0), crank.name, _local(crank, 0, at)))
        angle = theta(m.parameter("rate", 1.0) * kc.t, sympy.sin)
        m.add(kc.AbsoluteAngle("motor", crank.name, angle + at.turn - crank.lag))

    chain.steps.append(first)
    chain.write.append(write_first)
    body, point = crank, radius * cmath.exp(1j * float(random.uniform(-1, 1)))
    turning = (crank, 0j)
    for number, kind in enumerate(kinds):
        add = {"RRR": _rrr, "RRP": _rrp, "slot": _slot, "gear": _gear}[kind]
        body, point, turning = add(random, chain, number, body, point, turning)
    return chain


def _link(random: np.random.Generator, chain: Chain) -> Link:
    """Return a new body, whose frame lies and is turned anyhow."""
    lag = float(random.choice((0.0, random.uniform(-3, 3))))
    offset = complex(*random.uniform(-0.4, 0.4, 2))
    chain.links.append(Link(f"body{len(chain.links)}", lag, offset))
    return chain.links[-1]


def _local(link: Link, point: complex, at: Placement) -> tuple[float, float]:
    """Return a point in a body's own frame, given from its leading point along its line."""
    local = at.scale * (link.offset + point * cmath.exp(1j * link.lag))
    return local.real, local.imag


def _at(poses: dict[str, Any], link: Link, point: complex) -> Array:
    """Return where a point of a body is, over time."""
    place, direction = poses[link.name]
    return np.asarray(place + point * np.exp(1j * direction))


def _now(chain: Chain) -> dict[str, Any]:
    """Return the pose of all bodies at t = 0, as the dyads so far give it."""
    return poses_of(chain, np.zeros(1), {})[0]


def _rrr(random, chain, number, body, point, turning):
    """Add two links between a point of a body and a pin of the ground."""
    from_pin = complex(_at(_now(chain), body, point)[0])
    centre = from_pin + complex(*random.uniform(-2.2, 2.2, 2))
    middle = from_pin + random.uniform(0.7, 2) * cmath.exp(1j * float(random.uniform(-3, 3)))
    length, other = abs(middle - from_pin), abs(middle - centre)
    side = 1.0 if ((middle - from_pin) / (centre - from_pin)).imag > 0 else -1.0
    rod, rocker = _link(random, chain), _link(random, chain)

    def step(t, poses, closing):
        pin = _at(poses, body, point)
        way = centre - pin
        distance = np.abs(way)
        along = (distance**2 + length**2 - other**2) / (2 * distance)
        stretched = 1 - (along / length) ** 2
        across = length * np.sqrt(np.maximum(stretched, 0)) * closing.get(number, side)
        joint = pin + way / distance * (along + 1j * across)
        poses[rod.name] = pin, np.angle(joint - pin)
        poses[rocker.name] = np.full(t.size, centre), np.angle(joint - centre)
        return np.where(distance > 1e-3, stretched, -1.0)

    def write(m, at):
        m.add(kc.Revolute(f"A{number}", body.name, _local(body, point, at), rod.name,
                          _local(rod, 0, at)))  # fmt: skip
        m.add(kc.Revolute(f"B{number}", rod.name, _local(rod, length, at), rocker.name,
                          _local(rocker, other, at)))  # fmt: skip
        m.add(kc.Revolute(f"C{number}", m.ground, at(centre), rocker.name, _local(rocker, 0, at)))

    chain.steps.append(step)
    chain.write.append(write)
    return rocker, complex(*random.uniform(-1, 1, 2)) + 0.3, (rocker, centre)


def _rrp(random, chain, number, body, point, turning):
    """Add a link between a point of a body and a slider on a line of the ground."""
    from_pin = complex(_at(_now(chain), body, point)[0])
    place = from_pin + random.uniform(0.8, 2) * cmath.exp(1j * float(random.uniform(-3, 3)))
    angle = float(random.uniform(-3, 3))
    axis, length = cmath.exp(1j * angle), abs(place - from_pin)
    side = 1.0 if ((place - from_pin) / axis).real > 0 else -1.0
    rod, slider = _link(random, chain), _link(random, chain)

    def step(t, poses, closing):
        pin = _at(poses, body, point)
        seen = (pin - place) / axis
        stretched = 1 - (seen.imag / length) ** 2
        reach = length * np.sqrt(np.maximum(stretched, 0)) * closing.get(number, side)
        joint = place + axis * (seen.real + reach)
        poses[rod.name] = pin, np.angle(joint - pin)
        poses[slider.name] = joint, np.full(t.size, angle + closing.get((number, "turned"), 0.0))
        return stretched

    def write(m, at):
        turned = axis * cmath.exp(1j * at.turn)
        own = cmath.exp(1j * slider.lag)
        m.add(kc.Revolute(f"A{number}", body.name, _local(body, point, at), rod.name,
                          _local(rod, 0, at)))  # fmt: skip
        m.add(kc.Revolute(f"B{number}", rod.name, _local(rod, length, at), slider.name,
                          _local(slider, 0, at)))  # fmt: skip
        m.add(
            kc.Translational(
                f"C{number}",
                m.ground,
                at(place),
                (turned.real, turned.imag),
                slider.name,
                _local(slider, 0, at),
                (own.real, own.imag),
            )
        )

    chain.steps.append(step)
    chain.write.append(write)
    return slider, complex(*random.uniform(-0.5, 0.5, 2)), turning


def _slot(random, chain, number, body, point, turning):
    """Add a swing about a pin of the ground, with a slot for a point of a body."""
    from_pin = complex(_at(_now(chain), body, point)[0])
    centre = from_pin + random.uniform(0.9, 2.2) * cmath.exp(1j * float(random.uniform(-3, 3)))
    aside = float(random.choice((0.0, random.uniform(-0.3, 0.3))))
    swing = _link(random, chain)

    def step(t, poses, closing):
        way = _at(poses, body, point) - centre
        distance = np.maximum(np.abs(way), 1e-9)
        part = aside / distance
        angle = np.angle(way) - np.arcsin(np.clip(part, -1, 1))
        if closing.get(number, 1.0) < 0:
            angle = np.angle(way) + np.pi + np.arcsin(np.clip(part, -1, 1))
        poses[swing.name] = np.full(t.size, centre), angle
        return np.where(distance > 0.02, 1 - part**2, -1.0) * np.minimum(distance, 1) ** 2

    def write(m, at):
        own = cmath.exp(1j * swing.lag)
        m.add(kc.Revolute(f"A{number}", m.ground, at(centre), swing.name, _local(swing, 0, at)))
        m.add(kc.RevoluteTranslational(f"B{number}", swing.name, _local(swing, 0, at),
                                       (own.real, own.imag), body.name, _local(body, point, at),
                                       aside * at.scale))  # fmt: skip

    chain.steps.append(step)
    chain.write.append(write)
    return swing, complex(*random.uniform(-0.8, 0.8, 2)) + 0.5, (swing, centre)


def _gear(random, chain, number, body, point, turning):
    """Add a gear that rolls on a body which turns about a pin of the ground."""
    driving, centre = turning
    radius, own_radius = random.uniform(0.4, 1.2, 2).tolist()
    line = float(random.uniform(-3, 3))
    its_centre = centre + (radius + own_radius) * cmath.exp(1j * line)
    wheel = _link(random, chain)

    def step(t, poses, closing):
        angle = np.unwrap(poses[driving.name][1])
        # Where the wheels roll on each other both arcs are alike.
        rolled = -(angle - line) * radius / own_radius
        half_turns = closing.get(number, 0.0) * (radius + own_radius) / own_radius
        poses[wheel.name] = np.full(t.size, its_centre), line + np.pi + rolled + half_turns
        return np.ones(t.size)

    def write(m, at):
        m.add(kc.Revolute(f"A{number}", m.ground, at(its_centre), wheel.name,
                          _local(wheel, 0, at)))  # fmt: skip
        m.add(kc.Gear(f"B{number}", driving.name, _local(driving, 0, at), radius * at.scale,
                      driving.lag, wheel.name, _local(wheel, 0, at), own_radius * at.scale,
                      wheel.lag))  # fmt: skip

    chain.steps.append(step)
    chain.write.append(write)
    return wheel, complex(*random.uniform(-0.5, 0.5, 2)) + 0.2, (wheel, its_centre)


def poses_of(
    chain: Chain, t: Array, closing: dict[Any, float]
) -> tuple[dict[str, tuple[Array, Array]], Array]:
    """Return the leading point and direction of each body, and how far from stretched it all is.

    `closing` says which way a dyad is closed, where it is not the way of the chain's start.
    """
    poses: dict[str, tuple[Array, Array]] = {}
    margins = [step(t, poses, closing) for step in chain.steps]
    return poses, np.min(margins, axis=0)


def coordinates(chain: Chain, at: Placement, poses: dict[str, tuple[Array, Array]]) -> Array:
    """Return q (N, n) of poses; angles without jumps along them."""
    turned, columns = cmath.exp(1j * at.turn), []
    for link in chain.links:
        place, direction = poses[link.name]
        phi = np.unwrap(direction) - link.lag + at.turn
        origin = at.scale * (at.origin + turned * place)
        origin = origin - at.scale * link.offset * np.exp(1j * phi)
        columns += [origin.real, origin.imag, phi]
    return np.array(columns).T


def mechanism(chain: Chain, at: Placement, guess: Array) -> kc.Mechanism:
    """Return a chain as a mechanism, with a guess (n,)."""
    m = kc.Mechanism("chain")
    for link, start in zip(chain.links, guess.reshape(-1, 3).tolist(), strict=True):
        m.body(link.name, guess=start)
    for write in chain.write:
        write(m, at)
    return m


@dataclass(frozen=True)
class Motion:
    """A motion in closed form: q (N, n), and the least distance of a dyad from stretched so far."""

    q: Array
    margin: Array


def motion(chain: Chain, at: Placement, t: Array, closing: dict[Any, float]) -> Motion:
    """Return the motion at times, from the first one on without a jump."""
    parts = [np.linspace(a, b, SAMPLES, endpoint=False) for a, b in itertools.pairwise(t)]
    fine = np.concatenate([*parts, t[-1:]])
    poses, margin = poses_of(chain, fine, closing)
    index = np.arange(len(t)) * SAMPLES
    least = np.minimum.accumulate(margin)
    return Motion(coordinates(chain, at, poses)[index], least[index])


def reach(found: Array, known: Array, scale: float) -> Array:
    """Return the largest difference of positions (N, n) in radians and sizes, at each time (N,)."""
    difference = np.abs(found - known)
    difference.reshape(-1, 3)[:, :2] /= scale
    return np.asarray(np.max(np.nan_to_num(difference, nan=np.inf), axis=-1))


def closings(chain: Chain) -> list[dict[Any, float]]:
    """Return the ways in which the dyads may be closed, with the sliders either way round."""
    found: list[dict[Any, float]] = [{}]
    for number, kind in enumerate(chain.kinds):
        turns = (0.0, math.pi) if kind == "RRP" else (0.0,)
        if kind == "gear":
            continue
        found = [
            {**each, number: side, (number, "turned"): turn}
            for each in found for side in (1.0, -1.0) for turn in turns
        ]  # fmt: skip
    return found
