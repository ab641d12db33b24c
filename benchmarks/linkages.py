"""The mechanisms of the whole analyses, each as one table that all contenders read.

A table is a list of constraints between bodies in full coordinates (x, y, phi each). Its points may
be numbers or symbols, so the same table gives a kincompile mechanism, the equations of SymPy,
CasADi and JAX, and the numbers of a hand-written loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

import kincompile as kc

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Vector = NDArray[np.float64]
    Point = Sequence[Any]

GROUND = -1
POINTS = 10_000


class Constraint(NamedTuple):
    """A row or two of Phi: its kind, bodies by number, points on them, and a prescribed value.

    Kinds: "revolute" (points meet), "height" (y of body i), "angle" (phi of body i), "drive" (phi
    of body i is value * t), "gear" (phi of body j turns by -value times that of body i), "rolling"
    (the same for gears of radii value, by their centres), "follow" (phi of body j is that of i).
    """

    kind: str
    i: int
    s_i: Point = (0, 0)
    j: int = GROUND
    s_j: Point = (0, 0)
    value: Any = 0


@dataclass(frozen=True, slots=True)
class Linkage:
    """A mechanism with a motor that turns steadily.

    Attributes
    ----------
    name : str
        A valid name in C and Python.
    parameters : dict
        Names and values; the last is the motor's speed [rad/s].
    bodies : tuple of str
        Names.
    guess : tuple of float
        Where Newton starts at t = 0, x [m], y [m], phi [rad] per body.
    constraints
        The table, as a function of the parameters' values or symbols.
    """

    name: str
    parameters: dict[str, float]
    bodies: tuple[str, ...]
    guess: tuple[float, ...]
    constraints: Callable[[Sequence[Any]], list[Constraint]]

    @property
    def values(self) -> Vector:
        """The parameters' values, shape (k,)."""
        return np.array(list(self.parameters.values()))

    def times(self, points: int) -> Vector:
        """Return equally spaced times of one revolution, shape (points,)."""
        omega = list(self.parameters.values())[-1]
        return np.linspace(0.0, 2 * math.pi / omega, points)

    def mechanism(self) -> kc.Mechanism:
        """Return the mechanism as a user of kincompile writes it, parameters as symbols."""
        m = kc.Mechanism(self.name)
        p = [m.parameter(name, value) for name, value in self.parameters.items()]
        guesses = np.reshape(self.guess, (-1, 3)).tolist()
        bodies = [m.body(name, guess=g) for name, g in zip(self.bodies, guesses, strict=True)]
        for number, c in enumerate(self.constraints(p)):
            name, body = f"{c.kind}_{number}", bodies[c.i]
            other = m.ground if c.j == GROUND else bodies[c.j]
            if c.kind == "revolute":
                m.add(kc.Revolute(name, body, c.s_i, other, c.s_j))
            elif c.kind == "height":
                m.add(kc.AbsoluteY(name, body, (0, 0), c.value))
            elif c.kind == "angle":
                m.add(kc.AbsoluteAngle(name, body, c.value))
            else:
                m.add(kc.AbsoluteAngle(name, body, c.value * kc.t))
        return m

    def residual(self, library: Any, q: Any, t: Any, p: Sequence[Any]) -> list[Any]:
        """Return the rows of Phi, with cos and sin of a library: SymPy, CasADi, JAX or NumPy."""
        rows: list[Any] = []
        for c in self.constraints(p):
            if c.kind == "revolute":
                first, second = _point(library, q, c.i, c.s_i), _point(library, q, c.j, c.s_j)
                rows += [first[0] - second[0], first[1] - second[1]]
            elif c.kind == "height":
                rows.append(q[3 * c.i + 1] - c.value)
            elif c.kind == "angle":
                rows.append(q[3 * c.i + 2] - c.value)
            elif c.kind == "gear":
                rows.append(q[3 * c.j + 2] + c.value * q[3 * c.i + 2])
            elif c.kind == "rolling":
                rows.append(_rolling(library, q, c))
            elif c.kind == "follow":
                rows.append(q[3 * c.j + 2] - q[3 * c.i + 2])
            else:
                rows.append(q[3 * c.i + 2] - c.value * t)
        return rows


def _point(library: Any, q: Any, body: int, s: Point) -> Point:
    """Return r + A s, of a point on the ground s itself."""
    if body == GROUND:
        return s
    x, y, phi = q[3 * body], q[3 * body + 1], q[3 * body + 2]
    c_phi, s_phi = library.cos(phi), library.sin(phi)
    return x + c_phi * s[0] - s_phi * s[1], y + s_phi * s[0] + c_phi * s[1]


def _rolling(library: Any, q: Any, c: Constraint) -> Any:
    """Return the equation of `kc.Gear` (Haug, section 3.4), the gears beside each other."""
    first, second = _point(library, q, c.i, c.s_i), _point(library, q, c.j, c.s_j)
    rolled = c.value[0] * q[3 * c.i + 2] + c.value[1] * q[3 * c.j + 2]
    theta = rolled / (c.value[0] + c.value[1])
    d_x, d_y = second[0] - first[0], second[1] - first[1]
    return d_y * library.cos(theta) - d_x * library.sin(theta)


def _four_bar(p: Sequence[Any]) -> list[Constraint]:
    a, b, c, d, omega = p
    return [
        Constraint("revolute", 0, (-a / 2, 0)),
        Constraint("revolute", 0, (a / 2, 0), 1, (-b / 2, 0)),
        Constraint("revolute", 1, (b / 2, 0), 2, (-c / 2, 0)),
        Constraint("revolute", 2, (c / 2, 0), GROUND, (d, 0)),
        Constraint("drive", 0, value=omega),
    ]


def _slider_crank(p: Sequence[Any]) -> list[Constraint]:
    a, b, omega = p
    return [
        Constraint("revolute", 0, (-a / 2, 0)),
        Constraint("revolute", 0, (a / 2, 0), 1, (-b / 2, 0)),
        Constraint("revolute", 1, (b / 2, 0), 2),
        Constraint("height", 2),
        Constraint("angle", 2),
        Constraint("drive", 0, value=omega),
    ]


def _six_bar(p: Sequence[Any]) -> list[Constraint]:
    """Return Watt's first chain: a dyad between points of the coupler and of the rocker."""
    a, b, c, d, e, f, g, h, omega = p
    return [
        *_four_bar((a, b, c, d, omega)),
        Constraint("revolute", 1, (0, e), 3, (-g / 2, 0)),
        Constraint("revolute", 2, (0, f), 4, (-h / 2, 0)),
        Constraint("revolute", 3, (g / 2, 0), 4, (h / 2, 0)),
    ]


_LENGTHS = {"a": 10.0, "b": 26.0, "c": 18.0, "d": 20.0}
_FOUR_BAR_GUESS = (5.0, 0.0, 0.0, 21.3, 6.4, 0.52, 26.3, 6.4, 3.94)

FOUR_BAR = Linkage(
    "four_bar",
    {**_LENGTHS, "omega": 1.5},
    ("crank", "coupler", "rocker"),
    _FOUR_BAR_GUESS,
    _four_bar,
)
SLIDER_CRANK = Linkage(
    "slider_crank",
    {"a": 0.12, "b": 0.26, "omega": 2 * math.pi},
    ("crank", "rod", "slider"),
    (0.06, 0.0, 0.0, 0.25, 0.0, 0.0, 0.38, 0.0, 0.0),
    _slider_crank,
)
SIX_BAR = Linkage(
    "six_bar",
    {**_LENGTHS, "e": 5.0, "f": 3.0, "g": 16.0, "h": 15.0, "omega": 1.5},
    ("crank", "coupler", "rocker", "link", "output"),
    (*_FOUR_BAR_GUESS, 25.8, 14.7, 0.52, 30.6, 11.5, 1.28),
    _six_bar,
)
LINKAGES = (FOUR_BAR, SLIDER_CRANK, SIX_BAR)
