"""What outputs and their two derivatives cost: as ratios, in one process.

``python -m benchmarks.outputs`` prints what compiling with outputs takes of the time without, and
solving 10,000 times with a coupler point's acceleration; the limits are 1.3 and 1.25.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc

if TYPE_CHECKING:
    from collections.abc import Callable

POINTS = 10_000
ROUNDS = 40


def four_bar(asked: str = "") -> kc.Mechanism:
    """Return a four-bar that goes round, with what is asked of it in words of `ASKED`."""
    r, c, e, d = 1.0, 3.0, 2.5, 3.2
    away = abs(d - r)
    tilt = math.acos((c**2 + away**2 - e**2) / (2 * c * away))
    end = r + c * np.exp(1j * tilt)
    m = kc.Mechanism("four_bar")
    crank = m.body("crank", (0, 0, 0))
    rod = m.body("rod", (r, 0, tilt))
    rocker = m.body("rocker", (d, 0, float(np.angle(end - d))))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (r, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (c, 0), rocker, (e, 0)))
    m.add(kc.Revolute("C", m.ground, (d, 0), rocker, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t))
    if asked:
        p = m.point("P", rod, (1.5, 1.2))
    if asked not in ("", "point"):
        s = m.point("Q", rocker, (1.0, 0.5))
    if "distance" in asked:
        m.output("d", kc.outputs.distance(p, s), None)
    if "inclination" in asked:
        m.output("a", kc.outputs.angle(rod, (p, s)), "rad")
    if "transmission angle" in asked:
        m.output("mu", kc.outputs.transmission_angle(p, s, (d, 0)), "rad")
    return m


ASKED = (
    "point", "two points", "distance", "inclination", "transmission angle",
    "distance, inclination, transmission angle",
)  # fmt: skip
"""What is asked of the four-bar; but the first all ask for both points, four outputs, too."""


def ratio(one: Callable[[], object], other: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Return the process time of one call by that of another: the least of several, in turn."""
    least = [math.inf, math.inf]
    for _ in range(rounds):
        for k, call in enumerate((one, other)):
            start = time.process_time()
            call()
            least[k] = min(least[k], time.process_time() - start)
    return least[0] / least[1]


def solving(target: str) -> float:
    """Return what the motion takes with the point's acceleration, by that without the point."""
    t = np.linspace(0, 1, POINTS)
    with_point, without = (kc.compile(four_bar(x), target=target) for x in ("point", ""))
    return ratio(lambda: kc.solve(with_point, t)["P.x_ddot"], lambda: kc.solve(without, t))


def compiling(asked: str) -> float:
    """Return what compiling takes with outputs, by that without; the mechanisms are there."""
    rounds = ROUNDS // 2
    models = iter([four_bar(asked) for _ in range(rounds)])
    without = iter([four_bar() for _ in range(rounds)])
    return ratio(lambda: kc.compile(next(models)), lambda: kc.compile(next(without)), rounds)


if __name__ == "__main__":
    for target in ("numpy", "c"):
        print(f"solving {POINTS} points, {target}: {solving(target):.3f} (limit 1.25)")
    for asked in ASKED:
        print(f"compiling, {asked}: {compiling(asked):.3f} (limit 1.3)")
