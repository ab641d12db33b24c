"""Derivatives by small rotations, Haug's r-omega form, against the golden rows."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.model.mechanism import system_of
from kincompile.model.small_rotations import turned_constraints, turned_rows
from tests.unit.spatial.test_golden_rows import CASES, GIVEN, Q_DOT, ROWS, Q, mechanism

COLUMNS = [
    f"{letter}_{body}" for body in "ij" for letter in ("x", "y", "z", "pi_xi", "pi_eta", "pi_zeta")
]


@pytest.mark.parametrize("name", CASES)
def test_that_the_calculus_gives_the_golden_rows(name: str) -> None:
    golden = ROWS[name]
    system = system_of(mechanism(CASES[name]()))
    symbols = [sympy.Symbol(item.name) for item in system.coordinates]
    numbers: dict[Any, float] = {kc.t: GIVEN["t"]} | dict(zip(symbols, Q, strict=True))
    for body in "ij":
        for axis, value in zip(("xi", "eta", "zeta"), GIVEN[f"omega_{body}"], strict=True):
            numbers[sympy.Symbol(f"omega_{axis}_{body}")] = value
    rates = [sympy.Symbol(f"{item}_dot") for item in symbols]
    numbers |= dict(zip(rates, Q_DOT, strict=True))
    rows = turned_rows(turned_constraints(system), system.bodies)
    assert len(rows) == (0 if name == "norm" else len(golden["Phi"]))
    for k, row in enumerate(rows):
        found = [float(sympy.sympify(row.Phi_q.get(c, 0)).xreplace(numbers)) for c in COLUMNS]
        r_i, r_j = golden["Phi_q"][k][:3], golden["Phi_q"][k][7:10]
        turns = golden["Phi_pi"][k]
        expected = [*r_i, *turns[:3], *r_j, *turns[3:]]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        gamma = float(sympy.sympify(row.gamma).xreplace(numbers))
        assert gamma == pytest.approx(golden["gamma_omega"][k], abs=1e-9)
