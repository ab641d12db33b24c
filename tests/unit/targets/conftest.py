"""Emitted modules with something of everything: parameters, drivers, cams, tables, constants."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc


def rich_mechanism() -> kc.Mechanism:
    """Return two bodies and a cam's contact: 7 coordinates, entries that vary and that do not."""
    m = kc.Mechanism("rich")
    a, b = m.parameter("a", 0.4, unit="m"), m.parameter("b", 1.3)
    crank, rod = m.body("crank", guess=(0.1, 0.2, 0.3)), m.body("rod", guess=(1, 0, a))
    m.add(kc.Revolute("A", m.ground, (0, 0.1), crank, (-a / 2, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, b * kc.t + a * sympy.sin(kc.t)))
    m.add(kc.Distance("link", crank, (a, 0.2), rod, (0.1, -0.3), b + 0.1 * kc.t**2))
    rho = 1 + a * sympy.cos(2 * kc.alpha)
    m.add(kc.CamFlatFollower("cam", crank, (0, 0), rho, rod, (0.2, 0), (0, 1), guess=0.4))
    m.add(kc.Equation("free", rod.x * sympy.exp(-rod.y) - b))
    return m


def table_mechanism() -> kc.Mechanism:
    """Return a pin on a tabulated profile."""
    m = kc.Mechanism("tabled")
    pin = m.body("pin")
    angles = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    table = (angles, 1 + 0.2 * np.cos(angles) + 0.05 * np.sin(3 * angles))
    m.add(kc.PointFollower("slot", pin, (0.1, 0.2), m.ground, (0, 0), table, guess=0.3))
    m.add(kc.AbsoluteAngle("turn", pin, 0))
    m.add(kc.Equation("drive", sympy.Symbol("alpha_slot") - kc.t))
    return m


@pytest.fixture(scope="session")
def rich_model() -> kc.Mechanism:
    """The mechanism of `rich`."""
    return rich_mechanism()


@pytest.fixture(scope="session", params=["inline", "grouped"])
def form(request: pytest.FixtureRequest) -> str:
    """Both forms of a module keep the same contract."""
    return str(request.param)


@pytest.fixture(scope="session")
def rich(form: str) -> Any:
    """A module with two parameters."""
    return kc.compile(rich_mechanism(), form=form)


@pytest.fixture(scope="session")
def written_out() -> Any:
    """The module of `rich` whose constraints are written out one by one."""
    return kc.compile(rich_mechanism(), form="inline")


@pytest.fixture(scope="session")
def tabled_model() -> kc.Mechanism:
    """The mechanism of `tabled`."""
    return table_mechanism()


@pytest.fixture(scope="session")
def tabled(form: str) -> Any:
    """A module without parameters, with a spline."""
    return kc.compile(table_mechanism(), form=form)


@pytest.fixture(scope="session")
def risky(form: str) -> Any:
    """A module whose functions have limited domains."""
    x, y, z = sympy.symbols("x y z")
    equations = [sympy.sqrt(x - 2) - y, sympy.log(y) + 1 / z, sympy.exp(z) - x ** sympy.Float(1.5)]
    return kc.compile(kc.ConstraintSystem("risky", "x y z", equations), form=form)
