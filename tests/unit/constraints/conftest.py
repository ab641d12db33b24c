"""Every constraint type beside an oracle that knows its Phi alone, written by hand (`by_hand`).

The oracle shares neither code nor notation with the compiler. Its derivatives are differences:
Phi_q central, nu = -dPhi/dt, and gamma = -d^2/ds^2 Phi(q + s q_dot, t + s), exact because
q_ddot = 0 on that line.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray

import kincompile as kc
from kincompile.ir.inline import inline
from kincompile.ir.lower import lower
from kincompile.model.spline import SplineTable, fit
from kincompile.runtime.load import from_source
from kincompile.structure.counting import unmatched
from tests.by_hand import BY_HAND, mp

Array = NDArray[np.float64]
Quantities = tuple[Array, Array, Array, Array]

STEP = mp.mpf(10) ** -12

T0 = 0.4  # the time of every state; the flat driver has C' = 0 there

GENERIC = {
    "s_i": (0.31, -0.22), "s_j": (-0.47, 0.53), "v_i": (0.8, 0.5), "v_j": (-0.3, 0.9),
    "c": (0.4, -0.6), "s_P": (0.21, -0.17), "s_Q": (0.93, 0.34), "R_i": 0.55, "R_j": 0.85,
    "theta_i": 0.23, "theta_j": -0.37, "driver": (1.7, 0.3, 2.0),
    "rho_i": (1.1, 0.25, 0.15), "rho_j": (0.7, 0.2, -0.1),
}  # fmt: skip
ZEROS = {
    "s_i": (0.0, 0.0), "s_j": (0.0, 0.0), "v_i": (1.0, 0.0), "v_j": (0.0, 1.0), "c": (0.0, 0.0),
    "s_P": (0.0, 0.0), "s_Q": (1.0, 0.0), "theta_i": 0.0, "theta_j": 0.0,
}  # fmt: skip


def generic_driver(t: Any, sin: Any, c0: Any, c1: Any, c2: Any) -> Any:
    return c0 + c1 * sin(c2 * t)


def flat_driver(t: Any, sin: Any, c0: Any, c1: Any, c2: Any) -> Any:
    """At T0 its first derivative is zero and its second is not."""
    del sin
    return c0 + c1 * (t - T0) ** 2 + c2 * (t - T0) ** 3


def constant(t: Any, sin: Any, c0: Any, c1: Any, c2: Any) -> Any:
    del t, sin, c1, c2
    return c0


def radius(alpha: Any, functions: Any, c0: Any, c1: Any, c2: Any) -> Any:
    return c0 + c1 * functions.cos(alpha) + c2 * functions.sin(2 * alpha)


def slope(alpha: Any, functions: Any, c0: Any, c1: Any, c2: Any) -> Any:
    """Return the derivative of `radius`, by hand."""
    del c0
    return -c1 * functions.sin(alpha) + 2 * c2 * functions.cos(2 * alpha)


def tabulated(values: Any) -> tuple[Array, Array]:
    """Return a radius as a table over one revolution."""
    angles = np.linspace(-1, 2 * np.pi - 1, 24, endpoint=False)
    return angles, radius(angles, np, *values)


@cache
def fitted(values: tuple[float, ...]) -> SplineTable:
    return fit(*tabulated(values))


def exact_spline(values: Any, alpha: Any) -> tuple[Any, Any]:
    """Return the tabulated radius and its derivative with 40 digits, piece by piece."""
    table = fitted(values)
    first, last = mp.mpf(table.breaks[0]), mp.mpf(table.breaks[-1])
    place = first + (alpha - first) % (last - first)
    piece = max(k for k, start in enumerate(table.breaks[:-1]) if start <= place)
    powers = [mp.mpf(c) for c in table.coefficients[piece]]
    rho, slant = mp.polyval(powers, place - mp.mpf(table.breaks[piece]), derivative=True)
    return rho, slant


# ---- the constraints as a user writes them -------------------------------------------------------

BUILD: dict[str, Callable[[Any], Any]] = {
    "AbsoluteX": lambda a: kc.AbsoluteX("k", a.i, a.s_i, a.C),
    "AbsoluteY": lambda a: kc.AbsoluteY("k", a.i, a.s_i, a.C),
    "AbsoluteAngle": lambda a: kc.AbsoluteAngle("k", a.i, a.C),
    "AbsoluteDistance": lambda a: kc.AbsoluteDistance("k", a.i, a.s_i, a.c, a.C),
    "RelativeX": lambda a: kc.RelativeX("k", a.i, a.s_i, a.j, a.s_j, a.C),
    "RelativeY": lambda a: kc.RelativeY("k", a.i, a.s_i, a.j, a.s_j, a.C),
    "RelativeAngle": lambda a: kc.RelativeAngle("k", a.i, a.j, a.C),
    "Distance": lambda a: kc.Distance("k", a.i, a.s_i, a.j, a.s_j, a.C),
    "Revolute": lambda a: kc.Revolute("k", a.i, a.s_i, a.j, a.s_j),
    "Translational": lambda a: kc.Translational("k", a.i, a.s_i, a.v_i, a.j, a.s_j, a.v_j),
    "RevoluteTranslational": lambda a: kc.RevoluteTranslational(
        "k", a.i, a.s_i, a.v_i, a.j, a.s_j, a.C
    ),
    "TranslationalDistance": lambda a: kc.TranslationalDistance(
        "k", a.i, a.s_i, a.v_i, a.j, a.s_j, a.C
    ),
    "Gear": lambda a: kc.Gear("k", a.i, a.s_i, a.R_i, a.theta_i, a.j, a.s_j, a.R_j, a.theta_j),
    "RackAndPinion": lambda a: kc.RackAndPinion(
        "k", a.i, a.s_P, a.s_Q, a.theta_i, a.j, a.s_j, a.R_j, a.theta_j
    ),
    "CamFollower": lambda a: kc.CamFollower("k", a.i, a.s_i, a.rho_i, a.j, a.s_j, a.rho_j),
    "CamFlatFollower": lambda a: kc.CamFlatFollower("k", a.i, a.s_i, a.rho_i, a.j, a.s_j, a.v_j),
    "PointFollower": lambda a: kc.PointFollower("k", a.i, a.s_i, a.j, a.s_j, a.rho_j),
    "Equation": lambda a: kc.Equation(
        "k", a.i.x * sympy.sin(a.j.phi) - a.C * a.j.y**2, sympy.exp(a.i.phi * a.j.x / 4) - a.C
    ),
}
ABSOLUTE = tuple(name for name in BUILD if name.startswith("Absolute"))
WITH_VALUE = (
    *ABSOLUTE, "RelativeX", "RelativeY", "RelativeAngle", "Distance", "RevoluteTranslational",
    "TranslationalDistance", "Equation",
)  # fmt: skip
PROFILES = {
    "CamFollower": ("rho_i", "rho_j"), "CamFlatFollower": ("rho_i",), "PointFollower": ("rho_j",),
}  # fmt: skip


# ---- one constraint in a mechanism, and the same by hand -----------------------------------------


@dataclass(frozen=True)
class Case:
    """A constraint type with its attributes, bodies and driver."""

    kind: str
    values: Any
    driver: Callable[..., Any] = generic_driver
    ground: str = ""
    as_parameters: bool = False
    as_table: bool = False

    @cached_property
    def free(self) -> list[int]:
        """Places of the coordinates among x_i, y_i, phi_i, x_j, y_j, phi_j, alpha, ..."""
        held = {"": (), "i": (0, 1, 2), "j": (3, 4, 5)}[self.ground]
        last = 3 if self.kind in ABSOLUTE else 6 + len(PROFILES.get(self.kind, ()))
        return [k for k in range(last) if k not in held]

    @cached_property
    def mechanism(self) -> kc.Mechanism:
        """The constraint first, and coordinates held by equations until the system is square."""
        m = kc.Mechanism("bench")
        a = SimpleNamespace(i=m.ground, j=m.ground)
        if self.ground != "i":
            a.i = m.body("i")
        if self.ground != "j" and self.kind not in ABSOLUTE:
            a.j = m.body("j")
        given = {key: self._given(m, key, value) for key, value in self.values.items()}
        vars(a).update(given)
        a.C = self.driver(kc.t, sympy.sin, *given["driver"])
        for key in ("rho_i", "rho_j"):
            rho = tabulated(given[key]) if self.as_table else radius(kc.alpha, sympy, *given[key])
            setattr(a, key, rho)
        m.add(BUILD[self.kind](a))
        system = m.system()
        _, coordinates = unmatched(system, inline(lower(system)).pattern())
        for name in coordinates:
            m.add(kc.Equation(f"hold_{name}", sympy.Symbol(name)))
        return m

    def _given(self, m: kc.Mechanism, key: str, value: Any) -> Any:
        """Return an attribute as numbers, or as parameters whose defaults are other numbers."""
        if not self.as_parameters:
            return value
        if isinstance(value, tuple):
            return tuple(m.parameter(f"{key}{n}", x + 0.125) for n, x in enumerate(value))
        return m.parameter(key, value + 0.125)

    @cached_property
    def p(self) -> Array:
        """Parameters: the values that the oracle knows."""
        if not self.as_parameters:
            return np.zeros(0)
        return np.hstack([np.atleast_1d(value) for value in self.values.values()])

    @cached_property
    def source(self) -> str:
        """Text of the emitted module."""
        return str(kc.emit(self.mechanism).source)

    @cached_property
    def module(self) -> ModuleType:
        """The emitted module."""
        return from_source(self.source, "bench")

    @cached_property
    def rows(self) -> int:
        """Number of equations of the constraint; the rest hold coordinates."""
        return len(BY_HAND[self.kind](self._world([mp.mpf(0)] * len(self.free), mp.mpf(0))))

    @cached_property
    def exact(self) -> dict[str, Any]:
        """The attributes with 40 digits, points and axes as numbers of the complex plane."""
        found = {}
        for key, value in self.values.items():
            numbers = [mp.mpf(x) for x in np.atleast_1d(value).tolist()]
            found[key] = {1: lambda x: x, 2: mp.mpc, 3: lambda *x: x}[len(numbers)](*numbers)
        return found

    def _world(self, q: Any, t: Any) -> SimpleNamespace:
        full = [mp.mpf(0)] * 8
        for place, value in zip(self.free, q, strict=True):
            full[place] = value
        w = SimpleNamespace(**self.exact, phi_i=full[2], phi_j=full[5])
        w.A_i, w.A_j = mp.expj(full[2]), mp.expj(full[5])
        w.r_i, w.r_j = mp.mpc(full[0], full[1]), mp.mpc(full[3], full[4])
        w.C = self.driver(t, mp.sin, *self.exact["driver"])
        for alpha, key in zip(full[6:], PROFILES.get(self.kind, ()), strict=False):
            exact = self.exact[key]
            if self.as_table:
                rho, slant = exact_spline(self.values[key], alpha)
            else:
                rho, slant = radius(alpha, mp, *exact), slope(alpha, mp, *exact)
            setattr(w, f"a{key[3:]}", rho * mp.expj(alpha))
            setattr(w, f"g{key[3:]}", (slant + 1j * rho) * mp.expj(alpha))
        return w

    def Phi(self, q: Any, t: Any) -> list[Any]:
        """Return Phi, by hand, with 40 digits."""
        return BY_HAND[self.kind](self._world(q, t))

    def oracle(self, q: Array, q_dot: Array, t: float) -> Quantities:
        """Return Phi, Phi_q, nu and gamma at one state, from Phi alone."""
        at, rates, now = [mp.mpf(x) for x in q], [mp.mpf(x) for x in q_dot], mp.mpf(t)

        def along(direction: list[Any], dt: Any, s: Any) -> list[Any]:
            return self.Phi([x + s * d for x, d in zip(at, direction, strict=True)], now + s * dt)

        def rise(direction: list[Any], dt: int) -> list[float]:
            ends = zip(along(direction, dt, STEP), along(direction, dt, -STEP), strict=True)
            return [float((a - b) / (2 * STEP)) for a, b in ends]

        here = self.Phi(at, now)
        columns = [rise([int(k == column) for k in range(len(q))], 0) for column in range(len(q))]
        nu = [-x for x in rise([0] * len(q), 1)]
        bend = zip(along(rates, 1, STEP), here, along(rates, 1, -STEP), strict=True)
        gamma = [float(-(a - 2 * b + c) / STEP**2) for a, b, c in bend]
        return (
            np.array([float(x) for x in here]), np.array(columns).T, np.array(nu), np.array(gamma),
        )  # fmt: skip

    @cached_property
    def states(self) -> list[tuple[Array, Array]]:
        """Two seeded states off the manifold and one on it, positions and rates."""
        rng = np.random.default_rng(20240611)
        found = [(rng.uniform(-1.3, 1.3, 8), rng.uniform(-1.5, 1.5, 8)) for _ in range(2)]
        states = [(q[self.free], q_dot[self.free]) for q, q_dot in found]
        return [*states, self.on_manifold(*states[0])]

    def on_manifold(self, q: Array, q_dot: Array) -> tuple[Array, Array]:
        """Return the consistent state that Gauss-Newton finds, and the nearest rates."""
        rows = slice(0, self.rows)
        size = 1.0
        while size > 1e-14:
            Phi, Phi_q = self.module.position(q, T0, self.p)
            step = np.linalg.pinv(Phi_q[rows]) @ Phi[rows]
            size = float(np.abs(step).max())
            q = q - step / max(1.0, 2 * size)
        Phi_q, nu = self.module.velocity(q, T0, self.p)
        return q, q_dot + np.linalg.pinv(Phi_q[rows]) @ (nu[rows] - Phi_q[rows] @ q_dot)

    @cached_property
    def expected(self) -> list[Quantities]:
        """What the oracle says at each of the states."""
        return [self.oracle(q, q_dot, T0) for q, q_dot in self.states]

    def deviation(self, evaluate: Callable[..., Quantities]) -> float:
        """Return the largest deviation from the oracle over all states, relative to 1 + |value|.

        `evaluate(q, q_dot, t, p)` gives the four quantities of the whole system.
        """
        worst = 0.0
        for (q, q_dot), expected in zip(self.states, self.expected, strict=True):
            for found, known in zip(evaluate(q, q_dot, T0, self.p), expected, strict=True):
                error = np.abs(found[: self.rows] - known) / (1 + np.abs(known))
                worst = max(worst, np.inf if np.isnan(error).any() else float(error.max()))
        return worst


def variants(kind: str) -> Iterator[tuple[str, Case]]:
    """Yield the cases of a constraint type by name: one thing is varied at a time."""
    plain = Case(kind, GENERIC)
    yield "generic", plain
    yield "zeros", replace(plain, values=GENERIC | ZEROS)
    yield "parameters", replace(plain, as_parameters=True)
    if kind in WITH_VALUE:
        yield "constant", replace(plain, driver=constant)
        yield "flat", replace(plain, driver=flat_driver)
    if kind not in (*ABSOLUTE, "Equation"):
        yield "ground_i", replace(plain, ground="i")
        yield "ground_j", replace(plain, ground="j")
    if kind in PROFILES:
        yield "table", replace(plain, as_table=True)
    if kind == "Gear":
        yield "internal", replace(plain, values=GENERIC | {"R_i": -0.55})


CASES: Mapping[str, Case] = {
    f"{kind}-{name}": case for kind in BUILD for name, case in variants(kind)
}


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    """Each constraint type in each variant."""
    return CASES[request.param]


@pytest.fixture(params=BUILD)
def generic_case(request: pytest.FixtureRequest) -> Case:
    """Each constraint type with all attributes generic."""
    return CASES[f"{request.param}-generic"]


@pytest.fixture
def kinds() -> tuple[str, ...]:
    """Names of the constraint types that have an oracle."""
    return tuple(BUILD)


@pytest.fixture
def case_of() -> Callable[..., Case]:
    """Return what gives a case of one's own: the type's generic one with some things changed."""

    @cache
    def make(kind: str, **changes: Any) -> Case:
        return replace(CASES[f"{kind}-generic"], **changes)

    return make


@pytest.fixture(
    params=[name for name in CASES if name.split("-")[1] in ("generic", "ground_i", "ground_j")]
)
def grounded_case(request: pytest.FixtureRequest) -> Case:
    """Each constraint type between two bodies, and with the ground in place of each."""
    return CASES[request.param]


@pytest.fixture
def flat() -> Callable[..., Any]:
    """A driver whose first derivative is zero at the time of the states, its second is not."""
    return flat_driver
