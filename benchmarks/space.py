"""Whole analyses in space, beside plain C and CasADi's generated C, and building.

`python -m benchmarks.space [points]` prints a table per mechanism. The peers get the same joints,
with the triads that kincompile chooses, and the driver in the sine form; the lengths are numbers.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

import kincompile as kc
from benchmarks import analysis, machine
from benchmarks.linkages import GROUND, POINTS, Constraint, Linkage
from benchmarks.peers import casadi_peer, plain_c
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn
from kincompile import spatial
from kincompile.space.triads import with_triads

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from benchmarks.timing import Timing

BUILDERS: analysis.Builders = {
    analysis.NUMPY: lambda linkage: analysis.kincompile(linkage, "numpy"),
    analysis.C: lambda linkage: analysis.kincompile(linkage, "c"),
    analysis.PLAIN: lambda linkage: plain_c.PlainC(linkage).analysis(is_predicted=False),
    analysis.PREDICTED: lambda linkage: plain_c.PlainC(linkage).analysis(is_predicted=True),
    analysis.GENERATED: casadi_peer.generated,
}
BUILDING_ROUNDS = 15
START = (1.0, 0.0, 0.0, 0.0)
TURNED = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
"""All is turned by this matrix: no axis is one of the world's."""


@dataclass(frozen=True, slots=True)
class SpatialLinkage(Linkage):
    """A mechanism in space; its bodies' frames are parallel to the ground's at the start.

    Kinds of constraints: "revolute" (value is the axis), "universal" (the axes of i and j),
    "spherical", "distance", and "turn" (axis, cross and C(library, t, p)).
    """

    def mechanism(self) -> kc.Mechanism:
        """Return the mechanism as a user of kincompile writes it."""
        m = spatial.Mechanism(self.name)
        p = [m.parameter(name, value) for name, value in self.parameters.items()]
        guesses = np.reshape(self.guess, (-1, 7))
        bodies = [m.body(name, g[:3]) for name, g in zip(self.bodies, guesses, strict=True)]
        for number, c in enumerate(self.constraints(p)):
            name, i = f"{c.kind}_{number}", bodies[c.i]
            j = m.ground if c.j == GROUND else bodies[c.j]
            if c.kind == "revolute":
                m.add(spatial.Revolute(name, j, c.s_j, c.value, i, c.s_i, c.value))
            elif c.kind == "universal":
                m.add(spatial.Universal(name, i, c.s_i, c.value[0], j, c.s_j, c.value[1]))
            elif c.kind == "spherical":
                m.add(spatial.Spherical(name, i, c.s_i, j, c.s_j))
            elif c.kind == "distance":
                m.add(spatial.Distance(name, i, c.s_i, j, c.s_j, c.value))
            else:
                h, f, angle = c.value
                m.add(spatial.RelativeRotation(name, j, h, f, i, h, f, angle(sympy, kc.t, p)))
        return m

    def residual(self, library: Any, q: Any, t: Any, p: Sequence[Any]) -> list[Any]:
        """Return the rows of Phi, the norm rows last."""
        rows: list[Any] = []
        for c in self.constraints(p):
            first, second = _point(q, c.i, c.s_i), _point(q, c.j, c.s_j)
            d = [a - b for a, b in zip(first, second, strict=True)]
            if c.kind == "distance":
                rows.append(_dot(d, d) - c.value**2)
            elif c.kind == "turn":
                h, f, angle = c.value
                f, g, _ = _triad(h, f)
                turned, value = _turned(q, c.i, f), angle(library, t, p)
                sine, cosine = (_dot(_turned(q, c.j, v), turned) for v in (g, f))
                rows.append(sine * library.cos(value) - cosine * library.sin(value))
            else:
                rows += d
            if c.kind == "revolute":
                h = _turned(q, c.i, c.value)
                rows += [_dot(_turned(q, c.j, side), h) for side in _triad(c.value)[:2]]
            elif c.kind == "universal":
                rows.append(_dot(_turned(q, c.i, c.value[0]), _turned(q, c.j, c.value[1])))
        for k in range(len(self.bodies)):
            e = q[7 * k + 3 : 7 * k + 7]
            rows.append(_dot(e, e) - 1)
        return rows


def _triad(h: Sequence[float], f: Sequence[float] = ()) -> list[list[float]]:
    """Return the triad that kincompile has about an axis."""
    found = with_triads({"h_i": tuple(h), **({"f_i": tuple(f)} if len(f) else {})}, {})
    return [[float(item) for item in found[f"{letter}_i"]] for letter in "fgh"]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _turned(q: Any, body: int, s: Sequence[float]) -> list[Any]:
    """Return A s with A = (e0^2 - e^T e) I + 2 e e^T + 2 e0 e~, of the ground s itself."""
    if body == GROUND:
        return list(s)
    e0, e = q[7 * body + 3], q[7 * body + 4 : 7 * body + 7]
    size, along = e0 * e0 - _dot(e, e), 2 * _dot(e, s)
    across = [e[k - 2] * s[k - 1] - e[k - 1] * s[k - 2] for k in range(3)]
    return [size * s[k] + along * e[k] + 2 * e0 * across[k] for k in range(3)]


def _point(q: Any, body: int, s: Sequence[float]) -> list[Any]:
    if body == GROUND:
        return list(s)
    return [q[7 * body + k] + v for k, v in enumerate(_turned(q, body, s))]


class _Drawing:
    """Places of points, turned, and the local coordinates that follow from them."""

    def __init__(
        self, points: dict[str, tuple[float, float, float]], origins: Sequence[str]
    ) -> None:
        self._points = {name: TURNED @ place for name, place in points.items()}
        self._origins = [self._points[name] for name in origins]

    def guess(self) -> tuple[float, ...]:
        return tuple(value for place in self._origins for value in (*place.tolist(), *START))

    def local(self, body: int, name: str) -> list[float]:
        origin = 0.0 if body == GROUND else self._origins[body]
        return (self._points[name] - origin).tolist()  # type: ignore[no-any-return]

    def joint(self, kind: str, i: int, name: str, j: int = GROUND, value: Any = 0) -> Constraint:
        return Constraint(kind, i, self.local(i, name), j, self.local(j, name), value)  # type: ignore[arg-type]

    def axis(self, start: str, end: str) -> list[float]:
        along = self._points[end] - self._points[start]
        return (along / np.linalg.norm(along)).tolist()  # type: ignore[no-any-return]


def _rssr() -> SpatialLinkage:
    """Return a crank that turns, a rod and a rocker, which a universal joint holds."""
    drawing = _Drawing(
        {
            "O": (0, 0, 0),
            "axis": (0, 0, 1),
            "cross": (1, 0, 0),
            "A": (0.1, 0, 0),
            "B": (0.4, 0.1, 0.3),
            "D": (0.45, 0.1, 0.0),
            "pin": (0.45, 1.1, 0.05),
        },
        ("O", "A", "D"),
    )
    rod, pin = drawing.axis("A", "B"), drawing.axis("D", "pin")
    side = np.cross(rod, pin)
    across = [(side / np.linalg.norm(side)).tolist(), pin]
    across[1] = (np.array(pin) - np.dot(pin, across[0]) * np.array(across[0])).tolist()

    def constraints(p: Sequence[Any]) -> list[Constraint]:
        del p
        turn = (
            drawing.axis("O", "axis"),
            drawing.axis("O", "cross"),
            lambda _, t, p: p[0] * t,
        )
        return [
            drawing.joint("revolute", 0, "O", value=turn[0]),
            drawing.joint("spherical", 0, "A", 1),
            drawing.joint("universal", 1, "B", 2, value=across),
            drawing.joint("revolute", 2, "D", value=pin),
            drawing.joint("turn", 0, "O", value=turn),
        ]

    bodies = ("crank", "rod", "rocker")
    return SpatialLinkage("rssr", {"omega": 1.5}, bodies, drawing.guess(), constraints)


def _double_wishbone() -> SpatialLinkage:
    """Return a wheel carrier on two arms and a tie rod; the lower arm swings."""
    drawing = _Drawing(
        {
            "lower_front": (0.1, 0.4, 0.0),
            "lower_rear": (-0.2, 0.42, 0.02),
            "lower_ball": (0.0, 0.8, -0.02),
            "upper_front": (0.08, 0.45, 0.3),
            "upper_rear": (-0.15, 0.47, 0.28),
            "upper_ball": (-0.02, 0.72, 0.33),
            "rack": (0.12, 0.4, 0.08),
            "tie_ball": (0.13, 0.76, 0.06),
        },
        ("lower_front", "upper_front", "lower_ball"),
    )
    lower, upper = (drawing.axis(f"{name}_front", f"{name}_rear") for name in ("lower", "upper"))
    tie = drawing.joint("distance", 2, "tie_ball").s_i
    length = float(
        np.linalg.norm(drawing.local(GROUND, "tie_ball") - np.array(drawing.local(GROUND, "rack")))
    )

    def constraints(p: Sequence[Any]) -> list[Constraint]:
        del p
        swing = (
            lower,
            drawing.axis("lower_front", "lower_ball"),
            lambda library, t, p: 0.3 * library.sin(p[0] * t),
        )
        return [
            drawing.joint("revolute", 0, "lower_front", value=lower),
            drawing.joint("revolute", 1, "upper_front", value=upper),
            drawing.joint("spherical", 0, "lower_ball", 2),
            drawing.joint("spherical", 1, "upper_ball", 2),
            Constraint("distance", 2, tie, GROUND, drawing.local(GROUND, "rack"), length),  # type: ignore[arg-type]
            drawing.joint("turn", 0, "lower_front", value=swing),
        ]

    bodies = ("lower_arm", "upper_arm", "carrier")
    return SpatialLinkage("double_wishbone", {"omega": 1.5}, bodies, drawing.guess(), constraints)


LINKAGES = (_rssr(), _double_wishbone())


def main(points: int) -> None:
    """Measure and print."""
    before, targets = machine.load(), []
    for linkage in LINKAGES:
        analyses, skipped = analysis.build(linkage, points, BUILDERS)
        times = analysis.measure(analyses, linkage.times(points))
        print_table(
            f"{linkage.name}, {points} points, {len(linkage.guess)} coordinates",
            ("contender", "ms, median (least)", "x plain C"),
            analysis.rows(times, skipped),
        )
        targets += list(reached(linkage, times))
    print_targets("Whole analyses in space: what was to be reached, ratios of medians", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def reached(linkage: Linkage, times: dict[str, Timing]) -> Iterator[Target]:
    """Compare with what was to be reached."""
    for name, limit in ((analysis.NUMPY, 0.8), (analysis.C, 0.2)):
        ratio = times[name].median / times[analysis.PLAIN].median
        yield Target(f"{linkage.name}: {name} / {analysis.PLAIN}", ratio, "at most", limit)
    mechanism = linkage.mechanism()
    built = in_turn({"build": lambda: kc.compile(mechanism)}, calls=1, rounds=BUILDING_ROUNDS)
    ms = built["build"].median * 1e3
    yield Target(f"{linkage.name}: building, ms", ms, "at most", 60.0)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else POINTS)
