"""The part of a derivation on masses and loads: its numbers are those of the module and of D1."""

from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial
from kincompile.calculus.expressions import Expression
from kincompile.report.document import Display, Math, Table, Verbatim
from kincompile.report.formulas import Equated
from tests.unit.dynamics.test_inverse import slider_crank


@pytest.fixture(scope="module")
def model():
    m = slider_crank()
    crank, slider = m.bodies[0], m.bodies[2]
    m.add(kc.Spring("spring", m.ground, (0.6, 0.02), slider, (0, 0), 200, 0.3, 5))
    m.add(kc.HingeFriction("dry", m.ground, crank, 0.2))
    m.add(kc.Torque("drag", crank, -0.1 * crank.phi_dot))
    return m


@pytest.fixture(scope="module")
def loads(model) -> dict[str, Any]:
    """Return the sections of loads by anchor."""
    page = kc.derivation(model, 0.15)
    (chapter,) = (item for item in page.sections if item.anchor == "loads")
    return {item.anchor: item for item in chapter.sections}


def numbers(table: Any) -> dict[str, float]:
    """Return the last cells of a table by the names in its first."""
    return {
        ", ".join(run.text for run in row[0] if isinstance(run, Verbatim)): row[-1][0].formula.value
        for row in table.rows
    }


def symbol_of(table: Any) -> str:
    """Return the quantity that a table is of."""
    letter: str = table.header[1][0].formula.letter
    return letter


def test_that_what_loads_add_sums_up_to_q_and_m(model, loads):
    module = kc.compile(model)
    solution = kc.solve(module, [0.15])
    known = {
        "Q": module.Q(solution.q[0], solution.q_dot[0], 0.15),
        "M": np.triu(module.M(solution.q[0], 0.15)),
    }
    places = {name: k for k, name in enumerate(module.COORDINATES)}
    found = {name: np.zeros_like(value) for name, value in known.items()}
    for anchor, section in loads.items():
        if anchor == "motion":
            continue
        tables: Any = section.sections[3].blocks
        for table in tables:
            assert isinstance(table, Table)
            symbol = symbol_of(table)
            for names, value in numbers(table).items():
                found[symbol][tuple(places[name] for name in names.split(", "))] += value
    for name, value in known.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-12, atol=1e-12)


def test_that_the_multipliers_are_those_of_inverse_dynamics(model, loads):
    solution = kc.solve(kc.compile(model), [0.15])
    found = kc.forces(solution)
    table = next(item for item in loads["motion"].blocks if isinstance(item, Table))
    shown = numbers(table)
    assert tuple(shown) == solution.equations
    np.testing.assert_allclose(list(shown.values()), found.multipliers[0], rtol=1e-9, atol=1e-9)


def test_that_work_and_energy_are_shown_as_they_were_written(loads):
    energy, work = loads["load-crank"].sections[1].blocks
    assert isinstance(energy, Display)
    assert isinstance(energy.formula, Equated)
    assert isinstance(energy.formula.parts[1], Expression)
    page = kc.derivation(slider_crank()).to_markdown()
    assert r"\delta W {} = ( m \, \mathbf{g} )^{T} \delta (" in page
    assert "## Masses and loads" in page
    assert work != energy
    title = loads["load-spring"].title
    assert title == ("Spring ", Verbatim("spring"))
    symbols = [row[1][0] for row in loads["load-spring"].sections[0].blocks[0].rows]
    assert all(isinstance(item, Math) for item in symbols)


def test_that_a_mechanism_without_loads_has_no_such_part():
    bare = kc.Mechanism("bare")
    bar = bare.body("bar")
    bare.add(kc.Revolute("O", bare.ground, (0, 0), bar, (0, 0)))
    bare.add(kc.AbsoluteAngle("motor", bar, kc.t))
    assert "loads" not in [item.anchor for item in kc.derivation(bare).sections]


@pytest.mark.slow
def test_that_a_couple_about_a_hinge_reads_as_one():
    """In space torque and rate have names, and the root of friction is one."""
    m = spatial.Mechanism("hinge")
    body, z, x = m.body("wheel", mass=1, inertia=(1, 1, 1)), (0, 0, 1), (1, 0, 0)
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), z, body, (0, 0, 0), z))
    m.add(spatial.TorsionSpring("clock", m.ground, z, x, body, z, x, 3, damping=0.1))
    m.add(spatial.HingeFriction("dry", m.ground, z, body, z, 0.2))
    text = kc.derivation(m).to_markdown()
    assert r"\tau {} = {} - k \, ( \theta - {\phi}_{0} ) {} - c \, \omega {} - F" in text
    assert r"\frac{1}{\sqrt{{\omega}^{2} + {{v}_{0}}^{2}}}" in text
    assert "Root" not in text
