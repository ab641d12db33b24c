"""Whole analyses in space, beside plain C and CasADi's generated C, and building.

`python -m benchmarks.space [points] [names]` prints a table per mechanism. The peers get the same
joints, with the triads that kincompile chooses, and the driver in the sine form; the lengths are
numbers. All C but that of `kc.compile(m, target="c")` is compiled once by gcc -O3, with the same
flags, and what that takes is not counted.
"""

from __future__ import annotations

import ctypes
import resource
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

import kincompile as kc
from benchmarks import analysis, machine
from benchmarks.linkages import GROUND, POINTS, Constraint, Linkage
from benchmarks.peers import casadi_peer, plain_c
from benchmarks.peers.common import MAX_ITERATIONS, TOLERANCE, Skipped, compiled_c
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn
from kincompile import spatial
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.native import points
from kincompile.runtime.problem import problem
from kincompile.space.triads import with_triads

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from benchmarks.peers.common import Analysis, Motion, Vector
    from benchmarks.timing import Timing

EMITTED = "kincompile, emitted C, gcc -O3"
LARGE = ("-D_WHOLE_REGISTERS", "-fno-inline-functions", "-fno-ipa-cp-clone")
"""Flags of docs/in_c.md for large mechanisms: they save gcc's time alone."""


def emitted(linkage: Linkage) -> Analysis:
    """Return the march of emitted C, compiled as docs/in_c.md says; what gcc takes is printed.

    In-process `kc.compile(m, target="c")` takes points of a large mechanism one by one, so that a
    first motion does not wait for gcc.
    """
    module = kc.compile(linkage.mechanism())
    code, first = code_of(module), kc.solve(module, 0.0, throw=True).q[0].copy()
    size = problem(code, code.defaults, first, 0.0).size
    start = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    with tempfile.TemporaryDirectory() as folder:
        files = kc.emit(linkage.mechanism(), "c").files
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        library = compiled_c(Path(folder) / f"{code.name}.c", *LARGE)
    took = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - start
    print(
        f"gcc took {took:.1f} s for {code.name}, of {len(files[f'{code.name}.c']):,} characters.\n"
    )
    march = getattr(library, f"{code.name}_march")
    march.restype = ctypes.c_size_t

    def analyse(times: Vector) -> Motion:
        states, residual = np.empty((3, first.size, times.size)), np.empty(times.size)
        status, iterations = np.empty((2, times.size), np.intc)
        given = (x.ctypes.data for x in (times, code.defaults, first))
        motion = points.Motion(times.size, *given, size, TOLERANCE, MAX_ITERATIONS)
        motion.q, motion.q_dot, motion.q_ddot = map(points.numbers_of_batch, states)
        said = (x.ctypes.data for x in (residual, status, iterations))
        motion.residual, motion.status, motion.iterations = said
        if march(ctypes.byref(motion)) < times.size:
            raise Skipped("the march did not reach the end")
        q, q_dot, q_ddot = (state.T for state in states)
        return q, q_dot, q_ddot

    return analyse


BUILDERS: analysis.Builders = {
    analysis.NUMPY: lambda linkage: analysis.kincompile(linkage, "numpy"),
    EMITTED: emitted,
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
    "spherical", "distance", "slide" (axis, cross of i, cross of j), "plane" (the normal on i),
    "reach" (axis of i, C(library, t, p)) and "turn" (axis, cross and C(library, t, p)).
    """

    def mechanism(self) -> kc.Mechanism:
        """Return the mechanism as a user of kincompile writes it."""
        m = spatial.Mechanism(self.name)
        p = [m.parameter(name, value) for name, value in self.parameters.items()]
        guesses = np.reshape(self.guess, (-1, 7))
        bodies = [m.body(name, g[:3]) for name, g in zip(self.bodies, guesses, strict=True)]
        for number, c in enumerate(self.constraints(p)):
            name = f"{c.kind}_{number}"
            i, j = (m.ground if k == GROUND else bodies[k] for k in (c.i, c.j))
            if c.kind == "revolute":
                m.add(spatial.Revolute(name, j, c.s_j, c.value, i, c.s_i, c.value))
            elif c.kind == "universal":
                m.add(spatial.Universal(name, i, c.s_i, c.value[0], j, c.s_j, c.value[1]))
            elif c.kind == "spherical":
                m.add(spatial.Spherical(name, i, c.s_i, j, c.s_j))
            elif c.kind == "distance":
                m.add(spatial.Distance(name, i, c.s_i, j, c.s_j, c.value))
            elif c.kind == "slide":
                h, f_i, f_j = c.value
                m.add(spatial.Translational(name, i, c.s_i, h, f_i, j, c.s_j, h, f_j))
            elif c.kind == "plane":
                m.add(spatial.InPlane(name, i, c.s_i, c.value, j, c.s_j))
            elif c.kind == "reach":
                h, reach = c.value
                value = reach(sympy, kc.t, p)
                m.add(spatial.RelativeTranslation(name, i, c.s_i, h, j, c.s_j, value))
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
            elif c.kind == "plane":
                rows.append(_dot(_turned(q, c.i, c.value), d))
            elif c.kind == "reach":
                h, reach = c.value
                rows.append(-_dot(_turned(q, c.i, h), d) - reach(library, t, p))
            elif c.kind == "slide":
                h, f_i, f_j = c.value
                sides = [_turned(q, c.i, side) for side in _triad(h, f_i)[:2]]
                along = _turned(q, c.j, h)
                rows += [_dot(side, along) for side in sides] + [_dot(side, d) for side in sides]
                rows.append(_dot(sides[0], _turned(q, c.j, f_j)))
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
        return self.between(kind, i, name, j, name, value)

    def between(
        self, kind: str, i: int, name_i: str, j: int, name_j: str, value: Any
    ) -> Constraint:
        return Constraint(kind, i, self.local(i, name_i), j, self.local(j, name_j), value)

    def far(self, start: str, end: str) -> float:
        return float(np.linalg.norm(self._points[end] - self._points[start]))

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
    length = drawing.far("tie_ball", "rack")

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
            drawing.between("distance", 2, "tie_ball", GROUND, "rack", length),
            drawing.joint("turn", 0, "lower_front", value=swing),
        ]

    bodies = ("lower_arm", "upper_arm", "carrier")
    return SpatialLinkage("double_wishbone", {"omega": 1.5}, bodies, drawing.guess(), constraints)


def _around(count: int, radius: float, height: float, shift: float = 0.0) -> list[Any]:
    """Return places around the z axis; every second one goes so far ahead, the others back."""
    angles = 2 * np.pi * np.arange(count) / count + shift * (-1.0) ** np.arange(count)
    return [np.array([radius * np.cos(a), radius * np.sin(a), height]) for a in angles]


def _delta() -> SpatialLinkage:
    """Return a Delta robot: three arms that swing, and pairs of rods to a platform."""
    points: dict[str, Any] = {"platform": (0, 0, -0.5)}
    for k, out in enumerate(_around(3, 1.0, 0.0)):
        across = np.array([-out[1], out[0], 0.0])
        points |= {f"hinge_{k}": 0.2 * out, f"pin_{k}": 0.2 * out + across, f"out_{k}": 1.2 * out}
        for side, shift in (("a", 0.04), ("b", -0.04)):
            points[f"elbow_{k}{side}"] = 0.4 * out + shift * across + (0, 0, -0.15)
            points[f"ball_{k}{side}"] = 0.05 * out + shift * across + (0, 0, -0.5)
    drawing = _Drawing(points, ("platform", "hinge_0", "hinge_1", "hinge_2"))
    rods = []
    for k in range(3):
        for side in "ab":
            elbow, ball = (f"{name}_{k}{side}" for name in ("elbow", "ball"))
            ends = drawing.local(k + 1, elbow), drawing.local(0, ball)
            rods.append(
                Constraint("distance", k + 1, ends[0], 0, ends[1], drawing.far(elbow, ball))
            )

    def constraints(p: Sequence[Any]) -> list[Constraint]:
        del p
        found = list(rods)
        for k in range(3):
            pin, out = (
                drawing.axis(f"hinge_{k}", f"pin_{k}"),
                drawing.axis("platform", f"hinge_{k}"),
            )
            out = (np.array(out) - np.dot(out, pin) * np.array(pin)).tolist()
            swing = pin, out, lambda library, t, p, k=k: (0.2 + 0.05 * k) * library.sin(p[0] * t)
            found.append(drawing.joint("revolute", k + 1, f"hinge_{k}", value=pin))
            found.append(drawing.joint("turn", k + 1, f"hinge_{k}", value=swing))
        return found

    bodies = ("platform", "arm_1", "arm_2", "arm_3")
    return SpatialLinkage("delta", {"omega": 1.5}, bodies, drawing.guess(), constraints)


def _platform() -> SpatialLinkage:
    """Return a Stewart-Gough platform of thirteen bodies: six legs, a cylinder and a rod each."""
    feet, balls = _around(6, 0.6, 0.0, 0.3), _around(6, 0.35, 0.7, -0.2)
    points = {"platform": (0.0, 0.0, 0.7)}
    points |= {f"foot_{k}": tuple(x) for k, x in enumerate(feet)}
    points |= {f"ball_{k}": tuple(x) for k, x in enumerate(balls)}
    legs = [(f"foot_{k}", f"ball_{k}") for k in range(6)]
    drawing = _Drawing(points, ("platform", *(end for leg in legs for end in leg)))

    def constraints(p: Sequence[Any]) -> list[Constraint]:
        del p
        found = []
        for k, (foot, ball) in enumerate(legs):
            cylinder, rod, along = 2 * k + 1, 2 * k + 2, drawing.axis(foot, ball)
            side = np.cross(along, TURNED[:, 2])
            side /= np.linalg.norm(side)
            across = np.cross(along, side).tolist()
            length = drawing.far(foot, ball)

            def reach(library: Any, t: Any, p: Any, length: float = length, k: int = k) -> Any:
                return length + (0.03 + 0.01 * (k % 3)) * library.sin(p[0] * t)

            slide = along, side.tolist(), across
            found += [
                drawing.joint("universal", cylinder, foot, value=(across, side.tolist())),
                drawing.between("slide", cylinder, foot, rod, ball, slide),
                drawing.joint("spherical", rod, ball, 0),
                drawing.between("reach", cylinder, foot, rod, ball, (along, reach)),
            ]
        return found

    bodies = ("platform", *(f"{name}_{k}" for k in range(6) for name in ("cylinder", "rod")))
    return SpatialLinkage("platform", {"omega": 1.5}, bodies, drawing.guess(), constraints)


def _pump() -> SpatialLinkage:
    """Return a pump of fourteen bodies: pistons that slide in a rotor, on an inclined plate."""
    tilt = np.radians(15)
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    heads = [x - (0, 0, x @ normal / normal[2]) for x in _around(13, 0.05, 0.0)]
    points: dict[str, Any] = {"rotor": (0, 0, 0), "up": (0, 0, 1), "side": (1, 0, 0)}
    points |= {"across": (0, 1, 0), "normal": normal}
    points |= {f"head_{k}": tuple(x) for k, x in enumerate(heads)}
    names = tuple(f"head_{k}" for k in range(13))
    drawing = _Drawing(points, ("rotor", *names))
    up, side, across, plate = (
        drawing.axis("rotor", name) for name in ("up", "side", "across", "normal")
    )

    def constraints(p: Sequence[Any]) -> list[Constraint]:
        del p
        turn = up, side, lambda _, t, p: p[0] * t
        found = [
            drawing.joint("revolute", 0, "rotor", value=up),
            drawing.joint("turn", 0, "rotor", value=turn),
        ]
        for k, name in enumerate(names):
            found.append(drawing.joint("slide", 0, name, k + 1, (up, side, across)))
            place = drawing.local(k + 1, name)
            found.append(
                Constraint("plane", GROUND, drawing.local(GROUND, "rotor"), k + 1, place, plate)
            )
        return found

    bodies = ("rotor", *(f"piston_{k}" for k in range(13)))
    return SpatialLinkage("pump", {"omega": 1.5}, bodies, drawing.guess(), constraints)


LINKAGES = (_rssr(), _double_wishbone(), _delta(), _platform(), _pump())


LIMITS = {
    "rssr": (analysis.PLAIN, 0.8, 0.2),
    "double_wishbone": (analysis.PLAIN, 0.8, 0.2),
    "platform": (analysis.GENERATED, 0.9, 0.3),
    "pump": (analysis.GENERATED, 0.9, 0.3),
}
"""The contender beside which NumPy and emitted C may take at most such parts of its time."""
A_COORDINATE = ("delta", "double_wishbone", 1.5)
"""Emitted C for the one may take so many times as long a coordinate as for the other."""


def main(count: int, names: Sequence[str]) -> None:
    """Measure and print."""
    before, targets, a_coordinate = machine.load(), list[Target](), dict[str, float]()
    for linkage in LINKAGES:
        if names and linkage.name not in names:
            continue
        analyses, skipped = analysis.build(linkage, count, BUILDERS)
        times = analysis.measure(analyses, linkage.times(count))
        print_table(
            f"{linkage.name}, {count} points, {len(linkage.guess)} coordinates",
            ("contender", "ms, median (least)", "x plain C"),
            analysis.rows(times, skipped),
        )
        targets += list(reached(linkage, times))
        a_coordinate[linkage.name] = times[EMITTED].median / len(linkage.guess)
    one, other, limit = A_COORDINATE
    if {one, other} <= a_coordinate.keys():
        ratio = a_coordinate[one] / a_coordinate[other]
        targets.append(Target(f"C a coordinate: {one} / {other}", ratio, "at most", limit))
    print_targets("Whole analyses in space: what was to be reached, ratios of medians", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def reached(linkage: Linkage, times: dict[str, Timing]) -> Iterator[Target]:
    """Compare with what was to be reached."""
    peer, *limits = LIMITS.get(linkage.name, (analysis.PLAIN,))
    for name, limit in zip((analysis.NUMPY, EMITTED), limits, strict=False):
        if peer in times:
            ratio = times[name].median / times[peer].median
            yield Target(f"{linkage.name}: {name} / {peer}", ratio, "at most", limit)
    if linkage.name not in ("rssr", "double_wishbone"):
        return
    mechanism = linkage.mechanism()
    built = in_turn({"build": lambda: kc.compile(mechanism)}, calls=1, rounds=BUILDING_ROUNDS)
    ms = built["build"].median * 1e3
    yield Target(f"{linkage.name}: building, ms", ms, "at most", 60.0)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else POINTS, sys.argv[2:])
