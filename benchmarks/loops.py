"""Many four-bar loops, each with its own lengths: geared crank to crank, or in a driven chain.

Both as a user of kincompile writes them and as a table for the others; beside them the motion by
trigonometry, so that answers can be checked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc
from benchmarks.linkages import GROUND, Constraint, Linkage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Vector = NDArray[np.float64]

OMEGA = 1.5
DISTANCE = 5.0
RADII = (2.0, 3.0)
GUESS_DIGITS = 3


@dataclass(frozen=True, slots=True)
class Loops:
    """N loops; the first crank has a motor.

    Attributes
    ----------
    scales : ndarray, shape (N,)
        Sizes of the loops.
    is_chain : bool
        Whether each crank turns with the rocker before it; otherwise it is geared to the crank
        before it, slower and faster by turns.
    """

    scales: Vector
    is_chain: bool

    @classmethod
    def of(cls, count: int, *, is_chain: bool) -> Loops:
        """Return loops of sizes between 1 and 1.1."""
        return cls(1 + 0.1 * np.random.default_rng(1).random(count), is_chain)

    def mechanism(self) -> kc.Mechanism:
        """Return the loops as a user of kincompile writes them."""
        m = kc.Mechanism("loops")
        ground, guesses = m.ground, np.reshape(self.guess(), (-1, 3, 3)).tolist()
        before = None
        for k, (scale, guess) in enumerate(zip(self.scales.tolist(), guesses, strict=True)):
            a, b, c, d = _lengths(scale)
            x, end = DISTANCE * k, DISTANCE * k + d
            crank, coupler, rocker = (
                m.body(f"{name}{k}", place)
                for name, place in zip(("crank", "coupler", "rocker"), guess, strict=True)
            )
            m.add(kc.Revolute(f"A{k}", ground, (x, 0), crank, (-a / 2, 0)))
            m.add(kc.Revolute(f"B{k}", crank, (a / 2, 0), coupler, (-b / 2, 0)))
            m.add(kc.Revolute(f"C{k}", coupler, (b / 2, 0), rocker, (-c / 2, 0)))
            m.add(kc.Revolute(f"D{k}", rocker, (c / 2, 0), ground, (end, 0)))
            if before is None:
                m.add(kc.AbsoluteAngle("motor", crank, OMEGA * kc.t))
            elif self.is_chain:
                m.add(kc.RelativeAngle(f"E{k}", before[1], crank, 0))
            else:
                at, other_at = (-before[2] / 2, 0), (-a / 2, 0)
                radius, other = _radii(k)
                m.add(kc.Gear(f"G{k}", before[0], at, radius, 0, crank, other_at, other, math.pi))
            before = crank, rocker, a
        return m

    def table(self, *, is_rolling: bool = False) -> Linkage:
        """Return the same as a table.

        Gears are a ratio of angles, as one writes it who knows that the centres do not move; with
        `is_rolling` they are the equation that `kc.Gear` has, for centres anywhere.
        """
        constraints = [Constraint("drive", 0, value=OMEGA)]
        for k, scale in enumerate(self.scales.tolist()):
            a, b, c, d = _lengths(scale)
            crank, x = 3 * k, DISTANCE * k
            constraints += [
                Constraint("revolute", crank, (-a / 2, 0), GROUND, (x, 0)),
                Constraint("revolute", crank, (a / 2, 0), crank + 1, (-b / 2, 0)),
                Constraint("revolute", crank + 1, (b / 2, 0), crank + 2, (-c / 2, 0)),
                Constraint("revolute", crank + 2, (c / 2, 0), GROUND, (x + d, 0)),
            ]
            if k and self.is_chain:
                constraints.append(Constraint("follow", crank - 1, j=crank))
            elif k and is_rolling:
                at, before_at = (-a / 2, 0), (-float(self.scales[k - 1]) / 2, 0)
                radii = _radii(k)
                constraints.append(Constraint("rolling", crank - 3, before_at, crank, at, radii))
            elif k:
                constraints.append(Constraint("gear", crank - 3, j=crank, value=_ratio(k)))
        bodies = tuple(f"body{k}" for k in range(3 * len(self.scales)))
        return Linkage("loops", {}, bodies, tuple(self.guess()), lambda p: constraints)

    def guess(self) -> Vector:
        """Return the position at t = 0, rounded."""
        return np.round(self.position(0.0), GUESS_DIGITS)

    def position(self, t: float) -> Vector:
        """Return the position by trigonometry, shape (9 N,)."""
        angle, result = OMEGA * t, np.empty((len(self.scales), 9))
        for k, scale in enumerate(self.scales.tolist()):
            if k and not self.is_chain:
                angle *= -_ratio(k)
            result[k] = _loop(angle, scale, DISTANCE * k)
            if self.is_chain:
                angle = float(result[k, 8])
        return result.ravel()


def _ratio(k: int) -> float:
    """Return how much faster crank k turns than the one before it."""
    radius, other = _radii(k)
    return radius / other


def _radii(k: int) -> tuple[float, ...]:
    """Return the radii of the gears on crank k - 1 and on crank k."""
    return RADII if k % 2 else RADII[::-1]


def _lengths(scale: float) -> tuple[float, float, float, float]:
    return scale, 2.6 * scale, 1.8 * scale, 2.0 * scale


def _loop(angle: float, scale: float, x: float) -> list[float]:
    """Return the nine coordinates of a loop: C is where two circles meet, above the line B D."""
    a, b, c, d = _lengths(scale)
    at_b = x + a * math.cos(angle), a * math.sin(angle)
    dx, dy = x + d - at_b[0], -at_b[1]
    square = dx * dx + dy * dy
    along = (square + b * b - c * c) / (2 * square)
    across = math.sqrt(b * b / square - along * along)
    at_c = at_b[0] + along * dx - across * dy, at_b[1] + along * dy + across * dx
    coupler = math.atan2(at_c[1] - at_b[1], at_c[0] - at_b[0])
    # The rocker never points along the positive x axis: its angle lies between 0 and 2 pi.
    rocker = math.atan2(-at_c[1], x + d - at_c[0]) % (2 * math.pi)
    return [
        *((x + at_b[0]) / 2, at_b[1] / 2, angle),
        *((at_b[0] + at_c[0]) / 2, (at_b[1] + at_c[1]) / 2, coupler),
        *((at_c[0] + x + d) / 2, at_c[1] / 2, rocker),
    ]
