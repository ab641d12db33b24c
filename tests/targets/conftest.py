"""Every mechanism of the suite on every target: each target runs all of them in one process.

The fixture `target` gives, for each target in turn, what its code says of the mechanisms, at the
same states. `expected` is evaluated by mpmath with 40 digits: Phi as SymPy has it, the others as
SymPy derives them from Phi, where there are no tables; in space they are differences of Phi, with
120 digits.
"""

import json
import math
import os
import re
import shutil
import subprocess
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.model.expressions import SMOOTH
from kincompile.model.laws import RISES, MotionLaw
from kincompile.model.spline import PeriodicSpline
from kincompile.runtime.engine.code import code_of
from tests.targets import golden_rows

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("*.py"))
SPACE = sorted(EXAMPLES[0].with_name("space").glob("*.py"))
STATES = 4
STEP = 30
"""Digits of a step of differences: of 120, 60 are lost in a second one, and its error is 1e-60."""
QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")
CONSTANTS = (
    "NAME", "FORMAT", "FINGERPRINT", "N_COORDINATES", "N_EQUATIONS", "COORDINATES", "EQUATIONS",
    "PARAMETERS", "UNITS", "DEFAULTS", "GUESS", "PATTERN",
)  # fmt: skip
NODE = shutil.which("node") or shutil.which("nodejs")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
OCTAVE = shutil.which("octave-cli")
RUSTC = shutil.which("rustc")

x, y = sympy.symbols("x y")
P = sympy.Piecewise


@dataclass(frozen=True)
class Case:
    """A mechanism and states off its manifold; the first has the default parameters."""

    model: Any
    q: Any
    q_dot: Any
    t: Any
    p: Any

    @classmethod
    def of(cls, model: Any, q: Any, t: Any = None, spread: float = 1.0) -> "Case":
        """Return a case with seeded rates, times and parameters, which spread by so much."""
        rng = np.random.default_rng(20240717)
        rows = np.asarray(q, dtype=float)
        t = rng.uniform(0.1, 0.9, len(rows)) if t is None else t
        defaults = np.array([item.default for item in model.system().parameters])
        p = defaults * rng.uniform(0.8, 1.25, (len(rows), defaults.size)) ** spread
        p[0] = defaults
        return cls(model, rows, rng.uniform(-2, 2, rows.shape), np.asarray(t, dtype=float), p)

    @cached_property
    def module(self) -> Any:
        """The NumPy module, written out."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kc.RedundantConstraintWarning)
            return kc.compile(self.model, form="inline")

    @cached_property
    def derived(self) -> dict[str, Any]:
        """Phi, and what SymPy derives from it: Phi_q, nu and gamma."""
        Phi, q, q_dot = self.model.Phi, self.model.q, self.model.q_dot
        Phi_q, Phi_t = jacobian(Phi, q), Phi.diff(kc.t)
        gamma = -jacobian(Phi_q * q_dot, q) * q_dot
        gamma -= 2 * Phi_q.diff(kc.t) * q_dot + Phi_t.diff(kc.t)
        return {"Phi": Phi, "Phi_q": Phi_q, "nu": -Phi_t, "gamma": gamma}

    @cached_property
    def expected(self) -> dict[str, Any]:
        """Phi, Phi_q, nu and gamma of all states, (states, m) and (states, m, n)."""
        if isinstance(self.model, spatial.Mechanism):
            return self.differences()
        return {name: self.evaluate(matrix) for name, matrix in self.derived.items()}

    def differences(self) -> dict[str, Any]:
        """Return Phi and differences of it: SymPy's gamma in space has 10^4 operations and more."""
        function, h = self.function(self.model.Phi), mpmath.mpf(10) ** -STEP
        found: dict[str, Any] = {name: [] for name in QUANTITIES}
        with mpmath.workdps(4 * STEP):
            exact = np.vectorize(mpmath.mpf, otypes=[object])
            for q, q_dot, t, p in zip(self.q, self.q_dot, self.t, self.p, strict=True):
                q, q_dot, t, p = (exact(np.array(item).tolist()) for item in (q, q_dot, t, p))

                def along(step: Any, rate: Any, q: Any = q, t: Any = t, p: Any = p) -> Any:
                    rows = function(*(q + step), *(0 * q), t + rate, *p)
                    return np.array(rows, dtype=object)[:, 0]

                def slope(step: Any, rate: Any, along: Any = along) -> Any:
                    return (along(step, rate) - along(-step, -rate)) / (2 * h)

                Phi, eye, step = along(0, 0), h * np.eye(len(q), dtype=int), h * q_dot
                found["Phi"].append(Phi)
                found["Phi_q"].append(np.transpose([slope(column, 0) for column in eye]))
                found["nu"].append(-slope(0 * q, h))
                found["gamma"].append((2 * Phi - along(step, h) - along(-step, -h)) / h**2)
        return {name: np.array(values).astype(float) for name, values in found.items()}

    def evaluate(self, matrix: Any) -> Any:
        """Evaluate a SymPy matrix in every state; a single column loses its last axis."""
        function = self.function(matrix)
        with mpmath.workdps(40):
            values = []
            for state in zip(self.q, self.q_dot, self.t[:, np.newaxis], self.p, strict=True):
                given = [mpmath.mpf(value) for value in np.concatenate(state).tolist()]
                values.append([[float(entry) for entry in row] for row in function(*given)])
        array = np.array(values)
        return array[..., 0] if matrix.shape[1] == 1 else array

    def function(self, matrix: Any) -> Callable[..., Any]:
        """Return a SymPy matrix as a function of q, q_dot, t and p in mpmath's numbers."""
        names = [item.name for item in self.model.system().parameters]
        symbols = [*self.model.q, *self.model.q_dot, kc.t, *map(sympy.Symbol, names)]
        matrix = matrix.replace(lambda e: isinstance(e, MotionLaw), lambda e: e.in_pieces())
        # A symbol may have the name of a function.
        dummies = [sympy.Dummy() for _ in symbols]
        matrix = matrix.xreplace(dict(zip(symbols, dummies, strict=True)))
        tables = {f"table_{k}": type(item) for k, item in enumerate(matrix.atoms(PeriodicSpline))}
        splines = {key: lambda a, f=f: f.table(float(a), f.order) for key, f in tables.items()}
        for key, item in tables.items():
            matrix = matrix.replace(item, sympy.Function(key))
        function: Callable[..., Any] = sympy.lambdify(
            dummies, matrix.tolist(), modules=[splines, "mpmath"]
        )
        return function

    def points(self) -> list[list[Any]]:
        """Return the states one by one, as lists of numbers."""
        states = zip(self.q, self.q_dot, self.t, self.p, strict=True)
        return [[value.tolist() for value in state] for state in states]


def jacobian(rows: Any, q: Any) -> Any:
    """Return the derivatives of rows by coordinates, of which each row has few."""
    return sympy.Matrix(
        len(rows), len(q), lambda i, j: rows[i].diff(q[j]) if rows[i].has(q[j]) else 0
    )


# ---- the mechanisms ------------------------------------------------------------------------------

ONE_ARGUMENT = [f for f in SMOOTH if f not in (P, PeriodicSpline, sympy.atan2, sympy.acosh)]
EXPRESSIONS = (
    *(function(x / 2) for function in ONE_ARGUMENT),
    sympy.acosh(1 + x**2), sympy.sqrt(1 + x**2), 1 / sympy.sqrt(4 + x * y),
    (1 + x) ** sympy.Rational(5, 3), (1 + x) ** sympy.Float(0.3) * sympy.pi**x,
    (x - y) ** 11 + x**-3, sympy.E**y - sympy.E, sympy.sin(x) * sympy.cos(2 * y), (3 + x) ** y,
    x / 3 + sympy.Rational(22, 7) * y, sympy.pi * x - 2 * sympy.pi / 3, -(x - y) / (-y),
    -(x**2), (-x) ** 2, -(x + y) / (x * y), x**7 - x**-2, sympy.Rational(1, 3) * kc.t,
    P((x**2, x < 0.5), (x - 0.25, True)), P((x**2 - y, x >= y), (x * y, True)),
    P((x, (x < 0.3) & (y > 0)), (y, (x > 0.6) | (y <= -0.5)), (1 + x, True)),
    P((x**2, (x < 1) & (y > 0)), (2 * x - 1, (x >= 2) | (y <= -1)), (x * y, True)),
    x * P((kc.t**2, kc.t < 0.2), (0.4 * kc.t - 0.04, True)),
    sympy.sin(P((P((x, y < 0), (2 * x, True)), x < 0.4), (y, True))),
    P((x**2, x < 0.5), (x - 0.25, x >= 0.5)), P((1 / x, sympy.Ne(x, 0)), (0, True)),
    P((x**2 - y, sympy.Eq(x, y)), (x * y, True)), P((x**2 - y, sympy.Ne(x, y)), (x * y, True)),
)  # fmt: skip
"""Every function that takes complex steps, relation, connective and kind of number."""

POINTS = [
    (0.37, 0.62), (0.81, -0.44), (0.22, 0.31), (0.55, -0.71), (0.5, 0.5), (1.0, 1.0), (1.5, -2.0),
    (1.9, 0.4),
]  # fmt: skip


def functions() -> Case:
    """Return all the expressions, at states on either side of their conditions."""
    names = [f"u{k}" for k in range(len(EXPRESSIONS))]
    left = [f - sympy.Symbol(name) for f, name in zip(EXPRESSIONS, names, strict=True)]
    m = kc.ConstraintSystem("functions", ["x", "y", *names], [*left, x - kc.t, y - kc.t])
    rest = np.random.default_rng(3).uniform(-1, 1, (len(POINTS), len(EXPRESSIONS)))
    times = np.where(np.arange(len(POINTS)) % 2, 0.1, 0.7)
    return Case.of(m, np.hstack((POINTS, rest)), times)


def strange() -> Case:
    """Return a mechanism with names of every language, a table, pieces in time and powers.

    The table is read on all its pieces, where they join, and beyond a turn.
    """
    m = kc.Mechanism("top")
    names = {"square": 0.3, "Math": 0.2, "end": 0.1, "sin": 0.15, "double": 1.1, "lambda": 0.9}
    square, shift, end, sin, double, factor = (m.parameter(*item) for item in names.items())
    cam, pin = m.body("new"), m.body("var", guess=(1, 0, 0))
    angles = [k * 0.7 for k in range(9)]
    table = (angles, [1 + 0.1 * np.cos(angle) for angle in angles])
    ramp = P((kc.t**2, kc.t < 0.5), (kc.t - sympy.Rational(1, 4), True))
    m.add(kc.Revolute("shaft", cam, (square, end), m.ground, (0, shift)))
    m.add(kc.PointFollower("slot", pin, (sin, 0), cam, (0, 0), table, guess=0.1))
    m.add(kc.AbsoluteAngle("still", pin, sympy.sqrt(1 + kc.t) + sympy.log(kc.t + shift)))
    m.add(kc.AbsoluteY("level", pin, (0, 0), -(sympy.atan2(kc.t, 2) ** sympy.Rational(3, 2))))
    m.add(kc.AbsoluteAngle("motor", cam, double * ramp + factor))
    alphas = [-20.0, -1e-17, 0.0, 0.7, 6.2, 6.3, 50.0, *np.linspace(-15, 15, 60)]
    q = np.random.default_rng(11).uniform(0.2, 1.2, (len(alphas), 7))
    q[:, -1] = alphas
    return Case.of(m, q)


# Names that some language or the text of some target uses itself.
AWKWARD = (
    "f", "p", "np", "q", "math", "q_dot", "J", "F", "b", "sin", "cos", "cos_sin", "where",
    "spline", "lambda", "None", "is", "Phi", "nu", "N_COORDINATES", "DEFAULTS", "values", "float",
    "x", "Exception", "print", "c_x", "sqrt", "a_2", "solve", "LANES", "ARRAYS", "double", "int",
    "lane", "at", "far", "exact", "right", "to", "PI", "N", "M", "K", "block", "square", "gamma",
    "y1", "NULL", "unix", "end", "new", "var", "Math", "zeros", "class", "arguments",
)  # fmt: skip


def awkward() -> Case:
    """Return equations with awkward names, of which every third is a parameter's, and `atan2`."""
    names = [name for k, name in enumerate(AWKWARD) if k % 3]
    parameters = {name: 1.5 + 0.25 * k for k, name in enumerate(AWKWARD[::3])}
    symbols, factors = sympy.symbols(names), sympy.symbols(list(parameters))
    equations = [
        symbol * (2 + sympy.sin(other)) + sympy.cos(symbol) ** 2 / 4 - factor * kc.t
        for symbol, other, factor in zip(
            symbols, symbols[1:] + symbols[:1], factors + factors, strict=False
        )
    ]
    equations[0] += sympy.atan2(symbols[0] - 1, symbols[1])
    m = kc.ConstraintSystem("struct", names, equations, parameters=parameters)
    return Case.of(m, np.random.default_rng(2).uniform(1, 2, (STATES, len(names))))


def laws() -> Case:
    """Return all motion laws, their first derivatives and a table, at times on all their pieces."""
    names = ("T", "h", "T_0")
    duration, h, begin = sympy.symbols(names)
    rises = [
        law((kc.t - begin) / duration, *((sympy.Rational(2, 5),) if law.nargs == {2} else ()))
        for law in RISES.values()
    ]
    table = kc.motion.table([0.1, 0.4, 0.5, 0.9], [1, 2, -1, 0.5], velocities=(0.7, -0.3))
    values = [*(h * rise for rise in rises), *(rise.diff(kc.t) for rise in rises[:-2]), table]
    system = kc.ConstraintSystem(
        "laws",
        [f"u{k}" for k in range(len(values))],
        [
            kc.Equation(f"e{k}", sympy.Symbol(f"u{k}") - value, corners=True)
            for k, value in enumerate(values)
        ],
        parameters=dict(zip(names, (0.8, 1.5, 0.1), strict=True)),
    )
    times = [-0.1, 0.1, 0.2, *np.linspace(0.0, 1.2, 60)]
    return Case.of(
        system, np.random.default_rng(2).uniform(-1, 1, (len(times), len(values))), times
    )


def domain() -> Case:
    """Return an arm whose driver has no value at the state, which is before the time 0."""
    m = kc.Mechanism("domain")
    m.add(kc.AbsoluteAngle("root", m.body("arm"), sympy.sqrt(kc.t)))
    m.add(kc.AbsoluteX("x", "arm", (0, 0), 0))
    m.add(kc.AbsoluteY("y", "arm", (0, 0), 0))
    return Case.of(m, np.zeros((1, 3)), [-1.0])


def slider(name: str, **drivers: Any) -> Case:
    """Return a slider-crank with drivers of bodies: it has one degree of freedom."""
    m = kc.Mechanism(name)
    radius = m.parameter("radius", 0.4)
    m.add(kc.Revolute("A", m.ground, (0, 0), m.body("crank"), (-radius, 0.1)))
    m.add(kc.Revolute("B", "crank", (radius, 0), m.body("rod"), (-1, 0)))
    m.add(kc.AbsoluteY("C", "rod", (1, 0), sympy.sin(kc.t) / 9))
    for body, angle in drivers.items():
        m.add(kc.AbsoluteAngle(f"{body}_motor", body, angle))
    return Case.of(m, np.random.default_rng(5).uniform(-1, 1, (STATES, 6)))


def repeated() -> Case:
    """Return a driven rod whose bearing is written twice: equations that agree."""
    m = kc.Mechanism("repeated")
    rod = m.body("rod", guess=(1, 0, 0))
    for name in ("pin", "again"):
        m.add(kc.Revolute(name, m.ground, (0, 0), rod, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t**2))
    return Case.of(m, np.random.default_rng(6).uniform(-1, 1, (STATES, 3)))


def hinged() -> Case:
    """Return a body on a skew hinge in space, driven."""
    m = spatial.Mechanism("hinged")
    arm, axis = m.body("arm", (0.3, 0.1, 0.2)), (0.48, 0.6, 0.64)
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0.5), axis, arm, (0.1, 0.2, 0.3), axis))
    m.add(spatial.RelativeRotation("motor", m.ground, axis, (1, 0, 0), arm, axis, (0, 1, 0), kc.t))
    return Case.of(m, np.random.default_rng(8).uniform(-1, 1, (STATES, 7)))


def in_space() -> Case:
    """Return two bodies with every spatial constraint, the first state the golden one."""
    q = golden_rows.Q
    random = np.random.default_rng(7).uniform(-1, 1, (STATES - 1, q.size))
    case = Case.of(golden_rows.mechanism(), [q, *random], [0.4, 0.2, 0.5, 0.8])
    case.q_dot[0] = golden_rows.Q_DOT
    return case


OWN: dict[str, Callable[[], Case]] = {
    "functions": functions,
    "top": strange,
    "struct": awkward,
    "domain": domain,
    "laws": laws,
    "repeated": repeated,
    "undriven": partial(slider, "undriven"),
    "hinged": hinged,
    "golden": in_space,
    "driven_twice": partial(slider, "driven_twice", crank=kc.t**2, rod=3 * kc.t + 1),
}


@pytest.fixture(scope="session")
def case_named(example_named) -> Callable[[str], Case]:
    """Return the function that gives a case by name: an example, or a mechanism of the suite."""

    @cache
    def found(name: str) -> Case:
        if name in OWN:
            return OWN[name]()
        example = example_named(name)
        rng = np.random.default_rng(20240717)
        rows = rng.integers(example.solution.t.size, size=STATES)
        size = 1 + np.abs(example.solution.q).max(axis=0)
        q = example.solution.q[rows] + 0.3 * size * rng.uniform(-1, 1, (STATES, size.size))
        # The sides of one of its triangles nearly lie in a line: others would not meet.
        spread = 0.01 if name == "klann" else 1.0
        return Case.of(example.model, q, example.solution.t[rows], spread)

    return found


NAMES = [*(path.stem for path in EXAMPLES), *OWN]


MORE = ("double_wishbone", "golden", "jansen", "klann", "shaper", "swing_and_dwell")
"""Cases that only the exhaustive run has."""


def marked_name(name: str) -> Any:
    """Return a case as a parameter."""
    return pytest.param(name, marks=[pytest.mark.slow] if name in MORE else [])


@pytest.fixture(params=[marked_name(name) for name in NAMES if name != "domain"])
def name(request) -> str:
    """Return the name of each case in turn, but for the one without a value."""
    return str(request.param)


# ---- the targets ---------------------------------------------------------------------------------

Results = dict[str, dict[str, Any]]
"""Quantities, and whatever else a target tells, by case."""

WRONG = (("Phi", "q", 2, 9), ("gamma", "q_dot", 1, 9), ("Phi_q", "p", 0, 5))
"""Calls of the four-bar with a vector of the wrong length: function, vector, length, right one."""


def interpreted(cases: dict[str, Case], folder: Path) -> Results:
    """Evaluate by the interpreter of the program, each state by itself."""
    del folder
    found = {}
    for name, case in cases.items():
        program = lower(case.model.system())
        states = zip(case.q, case.q_dot, case.t, case.p, strict=True)
        with np.errstate(all="ignore"):
            rows = [interpret(program, *state)[: len(QUANTITIES)] for state in states]
        found[name] = dict(zip(QUANTITIES, map(np.array, zip(*rows, strict=True)), strict=True))
    return found


def loaded(**options: str) -> Callable[[dict[str, Case], Path], Results]:
    """Return the function that evaluates by modules compiled with options, on a batch."""

    def run(cases: dict[str, Case], folder: Path) -> Results:
        del folder
        found = {}
        for name, case in cases.items():
            module = kc.compile(case.model, **options)
            values = module.kinematics(case.q, case.q_dot, case.t, case.p)
            found[name] = dict(zip(QUANTITIES, values, strict=True)) | {"module": module}
            found[name]["constants"] = {item: getattr(module, item) for item in CONSTANTS}
            if options.get("form") == "grouped":  # another program, with a fingerprint of its own
                del found[name]["constants"]["FINGERPRINT"]
            if name == "four_bar":
                found[name]["refused"] = [refusal(module, *wrong) for wrong in WRONG]
        return found

    return run


def in_library(take: Callable[[], Any], digits: int = 15) -> Any:
    """Return the function that evaluates by `lanes`, on arrays or numbers of a library."""

    def run(cases: dict[str, Case], folder: Path) -> Results:
        del folder
        xp = take()
        with mpmath.workdps(digits), np.errstate(all="ignore"):
            return {name: by_lanes(case, xp) for name, case in cases.items()}

    return run


def by_lanes(case: Case, xp: Any) -> dict[str, Any]:
    """Return the quantities of all states: arrays in one go, numbers state by state."""
    module, states = case.module, (case.q, case.q_dot, case.t[:, np.newaxis], case.p)
    lanes = module.lanes(xp)
    if not hasattr(xp, "asarray"):
        exact = [np.vectorize(xp.mpf, otypes=[object])(part) for part in states]
        rows = [kinematics(module, lanes, *(part[k] for part in exact)) for k in range(len(case.t))]
        return {x: np.array([row[x][0] for row in rows]) for x in QUANTITIES}
    return kinematics(module, lanes, *([xp.asarray(x) for x in part.T.copy()] for part in states))


def kinematics(module: Any, lanes: Any, q: Any, q_dot: Any, t: Any, p: Any) -> dict[str, Any]:
    """Return the quantities, of shape (N, ...), of the functions of `lanes`."""
    m, n = len(module.EQUATIONS), len(module.COORDINATES)
    values = {
        "Phi": lanes["position"](q, t[0], p),
        "nu": lanes["nu"](q, t[0], p),
        "gamma": lanes["gamma"](q, q_dot, t[0], p),
    }
    whole = lanes["kinematics"](q, q_dot, t[0], p)
    for name, own in values.items():  # kinematics is all of it once more
        start = {"Phi": 0, "nu": len(whole) - 2 * m, "gamma": len(whole) - m}[name]
        for a, b in zip(own, whole[start:], strict=False):
            np.testing.assert_allclose(number(a), number(b), rtol=1e-12, atol=1e-12)
    count = np.shape(t[0])[0] if np.shape(t[0]) else 1
    columns = {x: [np.broadcast_to(number(v), count) for v in own] for x, own in values.items()}
    varying = iter(columns["Phi"][m:])
    Phi_q = np.zeros((count, m, n))
    for i, j, constant in code_of(module).entries:
        Phi_q[:, i, j] = next(varying) if constant is None else constant
    columns["Phi"] = columns["Phi"][:m]
    found = {name: np.stack(own, axis=-1).reshape(count, m) for name, own in columns.items()}
    return {**found, "Phi_q": Phi_q}


def number(value: Any) -> Any:
    """Return a value in double precision; outside a domain mpmath has a complex one."""
    return np.float64(math.nan if isinstance(value, mpmath.mpc) else value)


def array_api_strict() -> Any:
    """Return the library that has the array API standard and nothing else."""
    import array_api_strict as xp

    return xp


def jax_numpy() -> Any:
    """Return JAX in double precision."""
    import jax

    jax.config.update("jax_enable_x64", True)
    return jax.numpy


def refusal(module: Any, function: str, vector: str, length: int, right: int) -> str:
    """Return what a module says of a vector of the wrong length."""
    del right
    given = {"q": module.GUESS, "q_dot": module.GUESS, "t": 0.0, "p": module.DEFAULTS}
    given[vector] = np.ones(length)
    if function != "gamma":
        del given["q_dot"]
    with pytest.raises(kc.InputError) as caught:
        getattr(module, function)(**given)
    return str(caught.value)


def in_octave(cases: dict[str, Case], folder: Path) -> Results:
    """Evaluate by Octave; of an example take the motion, too."""
    lines = []
    for name, case in cases.items():
        kc.emit(case.model, "octave").write(folder)
        for k, state in enumerate(case.points()):
            q, q_dot, t, p = (json.dumps(value) for value in state)
            lines.append(f"q = {q}'; q_dot = {q_dot}'; t = {t}; p = {p}';")
            for quantity in QUANTITIES:
                arguments = "q, q_dot, t" if quantity == "gamma" else "q, t"
                arguments += ", p" if k else ""
                lines.append(f"show('{name}.{quantity}', {name}_{quantity}({arguments})');")
        if name not in OWN:
            shown = ("T", "Q", "Q_dot", "Q_ddot")
            lines += [
                f"[{', '.join(shown)}] = {name}();",
                *(f"show('{name}.{value}', {value});" for value in shown),
            ]
    found: Results = {}
    for key, rows in run_octave(folder, lines).items():
        name, quantity = key.split(".")
        m = len(rows[0])
        is_matrix = quantity == "Phi_q"
        shape = (len(rows), -1, cases[name].q.shape[1]) if is_matrix else (len(rows), m)
        found.setdefault(name, {})[quantity] = np.array(rows).reshape(shape)
    return found


def run_octave(folder: Path, lines: list[str]) -> dict[str, list[list[float]]]:
    """Run code in a folder and return what `show` printed, as lists of numbers by name."""
    (folder / "show.m").write_text(
        "function show(name, values)\nprintf('%s', name);\nprintf(' %.17g', values);\n"
        "printf('\\n');\nend\n",
        encoding="utf-8",
    )
    (folder / "all_of_it.m").write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = subprocess.run(
        [str(OCTAVE), "--norc", "--no-history", "--no-window-system", "--quiet", "all_of_it.m"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, list[list[float]]] = {}
    for line in done.stdout.splitlines():
        name, *numbers = line.split()
        found.setdefault(name, []).append([float(number) for number in numbers])
    return found


# Evaluates the models of a page, or of node, at their states; JSON has no NaN.
EVALUATE = """((models, points, wrong) => JSON.stringify(
  Object.fromEntries(Object.entries(models).map(([name, model]) => [name, {
    constants: model,
    quantities: points[name].map(([q, q_dot, t, p], k) => ({
      Phi: k ? model.Phi(q, t, p) : model.Phi(q, t),
      Phi_q: k ? model.Phi_q(q, t, p) : model.Phi_q(q, t),
      nu: k ? model.nu(q, t, p) : model.nu(q, t),
      gamma: k ? model.gamma(q, q_dot, t, p) : model.gamma(q, q_dot, t),
    })),
    refused: name !== "four_bar" ? [] : wrong.map(([f, vector, length]) => {
      const given = { q: model.GUESS, q_dot: model.GUESS, p: model.DEFAULTS };
      given[vector] = new Array(length).fill(1);
      const rates = f === "gamma" ? [given.q_dot] : [];
      try { model[f](given.q, ...rates, 0, given.p); } catch (error) { return String(error); }
    }),
  }])),
  (key, value) => typeof value === "number" && !isFinite(value) ? String(value) : value,
))"""


def in_javascript(run: Callable[[Path, dict[str, str], str], str]) -> Any:
    """Return the function that evaluates by one of the homes of JavaScript."""

    def evaluated(cases: dict[str, Case], folder: Path) -> Results:
        variables = {}
        for name, case in cases.items():
            source = kc.emit(case.model, "javascript").source
            (folder / f"{name}.js").write_text(source, encoding="utf-8")
            declared = re.search(r"it declares (\w+)\.", source)
            assert declared is not None
            variables[name] = declared[1]
        points = {name: case.points() for name, case in cases.items()}
        models = ", ".join(f'"{name}": {variable}' for name, variable in variables.items())
        arguments = f"{{ {models} }}, {json.dumps(points)}, {json.dumps(WRONG)}"
        found: Results = {}
        for name, item in json.loads(run(folder, variables, f"{EVALUATE}({arguments})")).items():
            rows = item.pop("quantities")
            for quantity in QUANTITIES:
                values = np.array([row[quantity] for row in rows], dtype=object)
                item[quantity] = values.astype(float)
            found[name] = item
        return found

    return evaluated


def in_node(folder: Path, variables: dict[str, str], expression: str) -> str:
    """Return what an expression gives under node, which takes the files by `require`."""
    lines = [f"const {item} = require('./{name}.js');" for name, item in variables.items()]
    (folder / "all_of_it.js").write_text("\n".join([*lines, f"console.log({expression});"]))
    done = subprocess.run(
        [str(NODE), "all_of_it.js"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def in_chromium(folder: Path, variables: dict[str, str], expression: str) -> str:
    """Return what an expression gives in a page that has the files as its scripts."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    scripts = "".join(f"<script src={name}.js></script>" for name in variables)
    (folder / "page.html").write_text(f"<!doctype html>{scripts}")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        page.goto((folder / "page.html").as_uri())
        result = str(page.evaluate(expression))
        browser.close()
    return result


# Prints the quantities of a module at states, which are read from numbers in order.
SHOWN = """macro_rules! shown {
    ($m:ident, $name:expr, $line:expr) => {
        let mut numbers = $line.split(" ").peekable();
        while numbers.peek().is_some() {
            let mut take = || numbers.next().unwrap().parse::<f64>().unwrap();
            let (mut q, mut q_dot) = ([0.0; $m::N_COORDINATES], [0.0; $m::N_COORDINATES]);
            let mut p = [0.0; $m::N_PARAMETERS];
            q.iter_mut().for_each(|x| *x = take());
            q_dot.iter_mut().for_each(|x| *x = take());
            let t = take();
            p.iter_mut().for_each(|x| *x = take());
            println!("{} Phi {:?}", $name, $m::Phi(&q, t, &p));
            println!("{} Phi_q {:?}", $name, $m::Phi_q(&q, t, &p).concat());
            println!("{} nu {:?}", $name, $m::nu(&q, t, &p));
            println!("{} gamma {:?}", $name, $m::gamma(&q, &q_dot, t, &p));
        }
    };
}
"""


def in_rust(cases: dict[str, Case], folder: Path) -> Results:
    """Evaluate by one program, of which every case is a module."""
    modules, calls, given = [], [], []
    for k, (name, case) in enumerate(cases.items()):
        (folder / f"case_{k}.rs").write_text(kc.emit(case.model, "rust").source, encoding="utf-8")
        modules.append(f"mod case_{k};")
        calls.append(f'shown!(case_{k}, "{name}", lines.next().unwrap());')
        states = (np.concatenate([np.ravel(x) for x in state]) for state in case.points())
        given.append(" ".join(repr(x) for state in states for x in state.tolist()))
    read = "let mut text = String::new(); std::io::stdin().read_to_string(&mut text).unwrap();"
    main = ["use std::io::Read;", "fn main() {", read, "let mut lines = text.lines();", *calls, "}"]
    found: Results = {}
    for line in run_rust(folder, "\n".join([*modules, SHOWN, *main]), "\n".join(given)):
        name, quantity, numbers = line.split(" ", 2)
        values = [float(x) for x in numbers.strip("[]").split(", ")]
        shape = (-1, cases[name].q.shape[1]) if quantity == "Phi_q" else (-1,)
        found.setdefault(name, {}).setdefault(quantity, []).append(np.reshape(values, shape))
    return {name: {x: np.array(rows) for x, rows in own.items()} for name, own in found.items()}


def run_rust(folder: Path, main: str, given: str = "") -> list[str]:
    """Build a program in a folder, without a warning, and return the lines that it prints."""
    if RUSTC is None:
        pytest.skip(NEEDED["rust"][1])
    (folder / "main.rs").write_text(main, encoding="utf-8")
    build = (RUSTC, "--edition", "2021", "-D", "warnings", "main.rs")
    for command in (build, (str(folder / "main"),)):
        done = subprocess.run(
            command, cwd=folder, input=given, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


RUNNERS = {
    "interpreter": interpreted,
    "numpy": loaded(form="inline"),
    "grouped": loaded(form="grouped"),
    "c": loaded(target="c"),
    "array_api_strict": in_library(array_api_strict),
    "jax": in_library(jax_numpy),
    "mpmath": in_library(lambda: mpmath.mp, 40),
    "octave": in_octave,
    "rust": in_rust,
    "node": in_javascript(in_node),
    "chromium": in_javascript(in_chromium),
}
NEEDED = {
    "octave": (OCTAVE, "octave-cli is not installed (Debian: octave)"),
    "rust": (RUSTC, "rustc is not installed (Debian: rustc)"),
    "node": (NODE, "node is not installed (Debian: nodejs)"),
    "chromium": (CHROMIUM, "Chromium is not installed"),
}


def marked(names: Any) -> list[Any]:
    """Return targets as parameters of a test; what runs in a browser is slow."""
    slow = pytest.mark.slow
    marks = {"chromium": [slow, pytest.mark.browser], "rust": [slow], "jax": [slow]}
    return [pytest.param(name, marks=marks.get(name, [])) for name in names]


LIBRARIES = ("array_api_strict", "jax", "mpmath")
MODULES = [x for x in RUNNERS if x not in ("interpreter", "octave", "rust", *LIBRARIES)]
"""Targets whose file is a module, with constants, and checks of its arguments."""


@pytest.fixture(scope="session")
def results_of(request, case_named, tmp_path_factory) -> Callable[[str], Results]:
    """Return the function that runs all cases on a target, once a session."""

    @cache
    def found(target: str) -> Results:
        program, reason = NEEDED.get(target, (os.name, ""))
        if program is None:
            pytest.skip(reason)
        if target == "c":
            request.getfixturevalue("quick_compiler")
        is_quick = request.config.option.markexpr == "not slow"
        names = [name for name in NAMES if not (is_quick and name in MORE)]
        cases = {name: case_named(name) for name in names}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kc.RedundantConstraintWarning)
            results: Results = RUNNERS[target](cases, tmp_path_factory.mktemp(target))
        return results

    return found


@pytest.fixture(scope="module", params=marked(RUNNERS))
def target(request, results_of) -> Results:
    """Return what each target says of all cases."""
    results: Results = results_of(request.param)
    return results


@pytest.fixture(scope="module", params=marked(MODULES))
def emitted_module(request, results_of) -> Results:
    """Return what each target says of all cases whose file is a module."""
    found: Results = results_of(request.param)
    return found


@pytest.fixture(params=WRONG, ids=lambda item: item[0])
def refused(request, emitted_module) -> tuple[str, int, int, str]:
    """Return the vector of a wrong call, its length, the right one, and what the module says."""
    messages = emitted_module["four_bar"]["refused"]
    return (*request.param[1:], messages[WRONG.index(request.param)])


@pytest.fixture(scope="module", params=["numpy", "grouped", "c"])
def module_of(request, results_of) -> Callable[[str], Any]:
    """Return the function that gives a case's module, of each target that can be loaded."""
    results = results_of(request.param)
    return lambda name: results[name]["module"]


@pytest.fixture
def octave(tmp_path) -> Callable[[list[str]], dict[str, list[list[float]]]]:
    """Return the function that runs lines in a folder of their own, and gives what they show."""
    if OCTAVE is None:
        pytest.skip(NEEDED["octave"][1])
    return partial(run_octave, tmp_path)
