"""On which side a mechanism is drawn, and on which it was found: a start's branch in words."""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import ZERO
from kincompile.names import listed
from kincompile.runtime.engine.code import DRIVERS, JOINTS, POINTS
from kincompile.runtime.singular.events import DOUBTS, involved
from kincompile.tables import pose

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.march import Outcome
    from kincompile.runtime.problem import Problem

SIDES = "right", "left"
GROUND = "ground"


def doubt(equations: Problem, guess: Array, outcome: Outcome, t: float) -> str:
    """Say that the position found from a guess (n,) may not be the one that is meant, if so."""
    if outcome.position is None:
        return ""
    said, bodies, sides, found = [], "", "", outcome.position.q
    if outcome.left_branch:
        said.append(DOUBTS["strays"])
        sides = _drawn_and_found(equations, guess, found, t)
    if outcome.other is not None:
        said.append(DOUBTS["other"])
        away = (outcome.other.q - found) / equations.reference
        bodies = listed(involved(equations.code, away))
    named = {"t": f"{t:.10g}", "bodies": bodies, "sides": sides}
    return ". ".join(x.format(**named) for x in said) + DOUBTS["remedy"] if said else ""


def _drawn_and_found(equations: Problem, guess: Array, found: Array, t: float) -> str:
    """Say how a position (n,) differs from the guess (n,) that it was found from.

    A pin of two links changes its side of the line between another pin of each. Where no pin does,
    the body that lies farthest from its guess is named.
    """
    said = "; ".join(_changed(equations, np.array([guess, found]), t))
    return f" ({said or _farthest(equations, guess, found)})"


def _changed(equations: Problem, q: Array, t: float) -> Iterator[str]:
    """Yield the pins that are on another side in the second position than in the first, (2, n)."""
    code = equations.code
    if not (code.has(POINTS) and code.has(JOINTS) and code.has(DRIVERS)):
        return
    joints = code.request(JOINTS)
    driven = {name for name, *_ in code.request(DRIVERS)(t, equations.p)}
    led = {GROUND, *(body for name in driven for body in joints[name])}
    drawn, came = (_Pins(equations, place, t) for place in q)
    for pin, (first, second) in _ends({name: joints[name] for name in drawn.rows}).items():
        sides = [pins.side(pin, first, second) for pins in (drawn, came)]
        # Where a driver leads a link, its guess shows no side.
        if led.isdisjoint(joints[pin]) and sides[0] * sides[1] < 0:
            here, there = (SIDES[side > 0] for side in sides)
            yield f"{pin} is drawn {here} of the line {first} {second}, and found {there} of it"


class _Pins:
    """The pins of a mechanism in the plane at a position, on either of their bodies."""

    def __init__(self, equations: Problem, q: Array, t: float) -> None:
        code, rates = equations.code, np.zeros_like(q)
        points, self.joints = code.points(), code.request(JOINTS)
        self.rows: dict[str, int] = {}
        if not points.outputs or any(count != 3 for _, _, count in code.bodies):
            return  # no point is known, or in space, where there are no sides
        self.Phi = np.asarray(code.position(q, t, equations.p)[0])
        self.values = np.asarray(points.observe(q, rates, rates, t, equations.p)[0])
        self.columns = {name: k for k, name in enumerate(points.outputs)}
        known = {name: row for row, name in enumerate(code.equations)}
        pins = (name for name in self.joints if f"{name}.y" in known)
        self.rows = {x: known[f"{x}.x"] for x in pins if f"x_{x}" in self.columns}

    def on(self, pin: str, body: str) -> Array:
        """Return where the point of a body is that is held at a pin."""
        first = self.columns[f"x_{pin}"]
        place, (one, other) = self.values[first : first + 2], self.joints[pin][:2]
        apart = self.Phi[self.rows[pin] : self.rows[pin] + 2]
        owner = other if one == GROUND else one
        if body == owner:
            return place
        return np.asarray(place - apart if owner == one else place + apart)

    def side(self, pin: str, first: str, second: str) -> int:
        """Return 1 where a pin is left of the line of two others of its bodies, -1 right of it."""
        one, other = self.joints[pin][:2]
        a, b = self.on(pin, one) - self.on(first, one), self.on(pin, other) - self.on(second, other)
        turned = float(a[0] * b[1] - a[1] * b[0])
        least = ZERO * float(np.linalg.norm(a) * np.linalg.norm(b))
        return 0 if abs(turned) <= least else round(math.copysign(1, turned))


def _ends(joints: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, str]]:
    """Return of each pin another pin of its first body, and one of its second."""
    found = {}
    for pin, pair in joints.items():
        first, second = (
            [name for name, held in joints.items() if body in held and name != pin]
            for body in pair[:2]
        )
        ends = next((ends for ends in product(first, second) if ends[0] != ends[1]), None)
        if ends is not None:
            found[pin] = ends
    return found


def _farthest(equations: Problem, guess: Array, found: Array) -> str:
    """Return where the body is that lies farthest from its guess, and where it was drawn."""
    code = equations.code
    away = np.abs(found - guess) / equations.reference
    places = {name: slice(first, first + count) for name, first, count in code.bodies}
    if not places:
        name = code.coordinates[int(away.argmax())]
        k = code.coordinates.index(name)
        return f"{name} is {guess[k]:.4g} in the guess, and was found at {found[k]:.4g}"
    body = max(places, key=lambda name: float(away[places[name]].max()))
    drawn, came = (pose(q[places[body]].tolist()) for q in (guess, found))
    return f"{body} is drawn {drawn}, and found {came}"
