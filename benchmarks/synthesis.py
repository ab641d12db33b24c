"""Published cases of synthesis, beside pylinkage's optimizer.

``python -m benchmarks.synthesis`` fits a four-bar to five points with prescribed crank angles, to
the function y = x^1.5 on 1..4 and to Hoeken's straight line. Limits are the best published errors.
A four-bar in any place, of ten parameters, is fitted to closed paths from five seeds each, and to
nine points without times, which only few four-bars meet.
Five poses of a crank-rocker go to `kc.synthesis` and to pylinkage's `motion_generation`.
pylinkage's particle swarm gets the same five points, bounds and limits; its positions are those of
the closed form in plain floats, which is faster than any linkage of its own.
"""

from __future__ import annotations

import cmath
import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

import kincompile as kc
from benchmarks import machine
from benchmarks.peers.common import Skipped, optional, require
from benchmarks.tables import Target, print_table, print_targets

if TYPE_CHECKING:
    from collections.abc import Sequence

POINTS = ((3, 3), (2.759, 3.363), (2.372, 3.663), (1.890, 3.862), (1.355, 3.943))
ANGLES = tuple(math.radians(angle) for angle in (30, 45, 60, 75, 90))
BEST_PATH, BEST_FUNCTION, BEST_LINE = 7.4157513068e-7, 1.05040439537708, 0.00243843327159
"""Sum of squares; largest error [deg]; deviation from a line, relative to its length."""

LENGTHS = ("r1", "r2", "r3", "r4")
LARGEST, SMALLEST = 50.0, 0.1


@dataclass(frozen=True, slots=True)
class Row:
    """What one way has reached: error, evaluations and processor time [s]."""

    what: str
    error: float
    evaluations: str
    seconds: float

    def cells(self) -> list[str]:
        """Return the cells of the table."""
        return [self.what, f"{self.error:.6g}", self.evaluations, f"{self.seconds:.2f}"]


def four_bar(name: str, **defaults: float) -> kc.Mechanism:
    """Return a four-bar whose crank angle is t, with the point P on its coupler."""
    m = kc.Mechanism(name, end=2 * math.pi, points=73)
    given = {"r1": 3.7, "r2": 2.0, "r3": 4.0, "r4": 2.7, "u": 1.7, "v": 1.7} | defaults
    r1, r2, r3, r4, u, v = (m.parameter(key, value, "m") for key, value in given.items())
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (1.7, 1, 0.8))
    rocker = m.body("rocker", (r1, 0, 1.9))
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (r2, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (r3, 0), rocker, (r4, 0)))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, (r1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    m.point("P", rod, (u, v))
    return m


def timed(*asked: Any, **options: Any) -> tuple[kc.Fit, float]:
    """Return a fit and its processor time [s], which a machine shared with others tells."""
    begun = time.process_time()
    return kc.fit(*asked, **options), time.process_time() - begun


def row_of(what: str, found: kc.Fit, error: float, seconds: float) -> Row:
    """Return the row of a fit."""
    counts = found.counts
    evaluations = f"{counts.motions} motions, {counts.sampled} sets"
    return Row(what, error, evaluations, seconds)


def path() -> Row:
    """Fit five points with prescribed crank angles; the crank is the shortest, by Grashof."""
    r1, r2, r3, r4 = sympy.symbols(LENGTHS)
    spare = (r1 + r4 - r3 - r2, r1 + r3 - r4 - r2, r3 + r4 - r1 - r2, r1 - r2, r3 - r2, r4 - r2)
    limits = [kc.targets.limit(item, least=0) for item in spare]
    size = dict.fromkeys(LENGTHS, (SMALLEST, LARGEST))
    bounds = size | dict.fromkeys(("u", "v"), (-LARGEST, LARGEST))
    target = kc.targets.path("P", POINTS, ANGLES)
    found, seconds = timed(four_bar("five_points"), [target, *limits], bounds=bounds)
    return row_of("`kc.fit`", found, found.error, seconds)


def function() -> Row:
    """Fit the rocker to y = x^1.5 at 61 points: input 20 to 110 degrees, output 40 to 130."""
    x = np.linspace(1, 4, 61)
    theta, phi = (np.radians(a + b * 90) for a, b in ((20, (x - 1) / 3), (40, (x**1.5 - 1) / 7)))
    m = four_bar("freudenstein", r1=1.0, r2=0.6, r3=0.8, r4=0.6)
    bounds = dict.fromkeys(("r2", "r3", "r4"), (0.2, 2.0))
    target = kc.targets.value("rocker.phi", phi, theta)
    found, seconds = timed(m, target, bounds=bounds, samples=256)
    largest = max(abs(item.off) for item in found.reached)
    return row_of("function, largest error [deg]", found, math.degrees(largest), seconds)


def line() -> Row:
    """Fit a straight line of length 4 over half a turn of a crank of 1: Hoeken's case."""
    angles = np.linspace(math.pi / 2, 3 * math.pi / 2, 37)
    m = four_bar("line", r1=2.0, r2=1.0, r3=2.5, r4=2.5, u=5.0, v=0.0)
    bounds = {"r1": (1.5, 3), "r3": (2, 4), "r4": (2, 4), "u": (4, 7), "v": (-1, 1)}
    straight = kc.targets.value("P.y", np.full(37, 4.0), angles)
    ends = kc.targets.value("P.x", [4.0, 0.0], angles[[0, -1]])
    found, seconds = timed(m, [straight, ends], bounds=bounds, samples=256)
    fine = kc.solve(kc.compile(found.model), np.linspace(angles[0], angles[-1], 1001))
    error = float(np.ptp(fine["P.y"]) / np.ptp(fine["P.x"]))
    return row_of("line, deviation by length", found, error, seconds)


class Swarm:
    """pylinkage's particle swarm on the five points."""

    def __init__(self) -> None:
        self.evaluations = 0

    def get_coords(self) -> list[tuple[float, float]]:
        """Return no joints: the objective knows them."""
        return []

    def error(self, linkage: Any, sizes: Sequence[float], positions: Any) -> float:
        """Return the sum of squares, or a large number where there is no such crank-rocker."""
        del linkage, positions
        self.evaluations += 1
        r1, r2, r3, r4, u, v = sizes
        if r2 > min(r1, r3, r4) or r2 + max(r1, r3, r4) > r1 + r3 + r4 - max(r1, r3, r4):
            return 1e6
        errors = []
        for side in (1, -1):
            total = 0.0
            for angle, (x, y) in zip(ANGLES, POINTS, strict=True):
                pin = cmath.rect(r2, angle)
                across = r1 - pin
                length = abs(across)
                cosine = (r3 * r3 + length * length - r4 * r4) / (2 * r3 * length)
                if abs(cosine) > 1:
                    return 1e6
                coupler = cmath.rect(1, cmath.phase(across) + side * math.acos(cosine))
                total += abs(pin + coupler * complex(u, v) - complex(x, y)) ** 2
            errors.append(total)
        return min(errors)


def anywhere(name: str, is_timed: bool) -> kc.Mechanism:
    """Return a four-bar in any place, with the point P on its coupler; s is where it starts."""
    m = kc.Mechanism(name, end=2 * math.pi, points=73)
    names = (*LENGTHS, "u", "v", "x0", "y0", "a", *(("s",) if is_timed else ()))
    given = (3.7, 1.0, 4.0, 2.7, 1.7, 1.7, 0.0, 0.0, 0.0, 0.0)
    p = {key: m.parameter(key, value) for key, value in zip(names, given, strict=False)}
    x, y, r1, a = p["x0"], p["y0"], p["r1"], p["a"]
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (1.7, 1, 0.8))
    rocker = m.body("rocker", (3.7, 0, 1.9))
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (x, y)))
    m.add(kc.Revolute("B", crank, (p["r2"], 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (p["r3"], 0), rocker, (p["r4"], 0)))
    end = x + r1 * sympy.cos(a), y + r1 * sympy.sin(a)
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, end))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t + p.get("s", 0)))
    m.point("P", rod, (p["u"], p["v"]))
    return m


@dataclass(frozen=True, slots=True)
class Case:
    """A published path: its points, whether the crank turns equally between them, bounds."""

    name: str
    points: Any
    is_timed: bool
    lengths: tuple[float, float]
    places: tuple[float, float]
    best: float  # the best error that is known to us
    options: dict[str, int] | None = None

    def fitted(self, seed: int) -> tuple[kc.Fit, float]:
        """Return a fit of a four-bar in any place, and its processor time [s]."""
        turn = (0.0, 2 * math.pi)
        bounds = dict.fromkeys(LENGTHS, self.lengths) | {"a": turn}
        bounds |= dict.fromkeys(("u", "v", "x0", "y0"), self.places)
        steps = 2 * math.pi * np.arange(len(self.points)) / len(self.points)
        target = kc.targets.path("P", self.points, steps if self.is_timed else None)
        has_start = self.is_timed or self.options is not None
        if has_start:
            bounds["s"] = turn
        model = anywhere("any_four_bar", has_start)
        return timed(model, target, bounds=bounds, seed=seed, **(self.options or {}))


CLOSED = (
    (0.5, 1.1), (0.4, 1.1), (0.3, 1.1), (0.2, 1.0), (0.1, 0.9), (0.05, 0.75), (0.02, 0.6),
    (0.0, 0.5), (0.0, 0.4), (0.03, 0.3), (0.1, 0.25), (0.15, 0.2), (0.2, 0.3), (0.3, 0.4),
    (0.4, 0.5), (0.5, 0.7), (0.6, 0.9), (0.6, 1.0),
)  # fmt: skip
LINE = tuple((20.0, 20.0 + 5 * k) for k in range(6))
ELLIPSE = (
    (20, 10), (17.66, 15.142), (11.736, 17.878), (5, 16.928), (0.60307, 12.736),
    (0.60307, 7.2638), (5, 3.0718), (11.736, 2.1215), (17.66, 4.8577), (20, 10),
)  # fmt: skip
NINE = (
    (0.25, 0), (0.52, 0.1), (0.8, 0.7), (1.2, 1.0), (1.4, 1.3), (1.1, 1.48), (0.7, 1.4),
    (0.2, 1.0), (0.02, 0.4),
)  # fmt: skip
CASES = (
    Case("18 points, closed", CLOSED, True, (0.05, 50), (-50, 50), 0.0090289),
    Case("6 points on a line", LINE, False, (5, 60), (-60, 60), 1e-12),
    Case("10 points of an ellipse", ELLIPSE, False, (5, 80), (-80, 80), 4.85e-4),
)
NINE_POINTS = Case(
    "9 points", NINE, False, (0.1, 5), (-5, 5), 1e-8, {"samples": 24576, "starts": 128}
)


def swarm() -> Row:
    """Let pylinkage's optimizer, with its own settings, look for the five points."""
    require(optional("pylinkage"), "pylinkage")
    from pylinkage.optimization import particle_swarm_optimization

    own, begun = Swarm(), time.process_time()
    low, high = [SMALLEST] * 4 + [-LARGEST] * 2, [LARGEST] * 6
    found = particle_swarm_optimization(
        own.error, own, dimensions=6, bounds=(low, high), order_relation=min, verbose=False
    )
    error = float(found.scores["score"][0])
    return Row(
        "pylinkage particle swarm", error, f"{own.evaluations} motions", time.process_time() - begun
    )


def coupler_poses() -> Any:
    """Return five poses (5, 3) of the coupler of a crank-rocker 2 : 4 : 2.7 : 3.7."""
    module = kc.compile(four_bar("crank_rocker"))
    motion = kc.solve(module, np.radians([10, 40, 80, 120, 150]))
    return np.column_stack([motion[name] for name in ("P.x", "P.y", "rod.phi")])


def all_four_bars(poses: Any) -> tuple[list[str], float]:
    """Return the row of `kc.synthesis`, and how far its best linkage is from the poses."""
    begun = time.process_time()
    found = kc.synthesis.four_bars(poses)
    working = [item for item in found if item.passage and item.passage.works]
    worst = max(item.passage.deviation for item in working if item.passage)
    seconds = f"{time.process_time() - begun:.2f}"
    return ["`kc.synthesis`", f"{len(found)}", f"{len(working)}", f"{worst:.1e}", seconds], worst


def theirs(poses: Any) -> list[str]:
    """Return the row of pylinkage, which tests no motion."""
    require(optional("pylinkage"), "pylinkage")
    from pylinkage.synthesis import Pose, motion_generation

    begun = time.process_time()
    given = [Pose(*row) for row in poses.tolist()]
    found = motion_generation(given, max_solutions=None, require_grashof=False)
    seconds = f"{time.process_time() - begun:.2f}"
    return ["pylinkage", f"{len(found.solutions)}", "", "", seconds]


def main() -> None:
    """Measure and print."""
    before = machine.load()
    ours, others = path(), [function(), line()]
    poses = coupler_poses()
    exact, off = all_four_bars(poses)
    rows, five = [ours], [exact]
    try:
        rows.append(swarm())
        five.append(theirs(poses))
    except Skipped as reason:
        print(f"pylinkage is left out: {reason}")
    heads = ("case", "error", "evaluations", "processor s")
    print_table("Five points with prescribed angles", heads, (row.cells() for row in rows))
    heads_of_five = ("five poses", "four-bars", "work", "off the poses", "processor s")
    print_table("Five poses of a crank-rocker, crank at 10 to 150 degrees", heads_of_five, five)
    print_table("Function and straight line", heads, (row.cells() for row in others))
    runs = [(case, seed, *case.fitted(seed)) for case in CASES for seed in range(5)]
    runs.append((NINE_POINTS, 0, *NINE_POINTS.fitted(0)))
    paths = [
        row_of(f"{case.name}, seed {seed}", found, found.error, seconds)
        for case, seed, found, seconds in runs
    ]
    print_table("A four-bar in any place", heads, (row.cells() for row in paths))
    targets = [
        *(
            Target(f"{case.name}, worst seed", max(own), "at most", case.best)
            for case in (*CASES, NINE_POINTS)
            if (own := [found.error for one, _, found, _ in runs if one is case])
        ),
        Target(
            "processor time of a path, at most", max(x[3] for x in runs[:-1]), "at most", 5.0, "s"
        ),
        Target("five points, sum of squares", ours.error, "at most", BEST_PATH * (1 + 1e-9)),
        Target("function, largest error", others[0].error, "at most", BEST_FUNCTION, "deg"),
        Target("line, deviation by length", others[1].error, "at most", BEST_LINE),
        Target("five poses, off them", off, "at most", 1e-9),
    ]
    print_targets("Synthesis: best published", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


if __name__ == "__main__":
    main()
