"""Derivatives by small rotations, Haug's r-omega form, against the golden rows."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.model.mechanism import system_of
from kincompile.model.small_rotations import turned_constraints, turned_rows
from tests.unit.spatial.test_golden_rows import (
    CASES,
    GIVEN,
    Q_DOT,
    ROWS,
    Q,
    at_angle,
    golden_rows,
    mechanism,
)

AXES = ("xi", "eta", "zeta")
COLUMNS = [
    f"{letter}_{body}" for body in "ij" for letter in ("x", "y", "z", "pi_xi", "pi_eta", "pi_zeta")
]


@pytest.mark.parametrize("name", CASES)
def test_that_the_calculus_gives_the_golden_rows(name: str) -> None:
    golden = ROWS[name]
    system = system_of(mechanism(CASES[name]()))
    symbols = [sympy.Symbol(item.name) for item in system.coordinates]
    values, rates = at_angle(name, Q, 0.3), at_angle(name, Q_DOT, -0.7)
    numbers: dict[Any, float] = {kc.t: GIVEN["t"]} | dict(zip(symbols, values, strict=True))
    for body in "ij":
        for axis, value in zip(AXES, GIVEN[f"omega_{body}"], strict=True):
            numbers[sympy.Symbol(f"omega_{axis}_{body}")] = value
    numbers |= dict(zip([sympy.Symbol(f"{item}_dot") for item in symbols], rates, strict=True))
    rows = turned_rows(turned_constraints(system), system.bodies)
    if name == "norm":
        assert not rows
        return
    columns = [*COLUMNS, *(item.name for item in system.coordinates[14:])]
    cells = [[number(row.Phi_q.get(key, 0), numbers) for key in columns] for row in rows]
    Phi_q = golden_rows(name, np.array(cells))
    np.testing.assert_allclose(Phi_q[:, :12], by_turns(golden), rtol=0, atol=1e-9)
    np.testing.assert_allclose(Phi_q[:, 12:], 0, rtol=0, atol=1e-15)
    gamma = golden_rows(name, np.array([number(row.gamma, numbers) for row in rows]))
    np.testing.assert_allclose(gamma, golden["gamma_omega"], rtol=0, atol=1e-9)


def number(expression: Any, numbers: dict[Any, float]) -> float:
    return float(sympy.sympify(expression).xreplace(numbers))


def by_turns(golden: dict[str, Any]) -> Any:
    """Return golden rows in the columns of r and pi'."""
    rows, turns = np.array(golden["Phi_q"]), np.array(golden["Phi_pi"])
    return np.hstack([rows[:, :3], turns[:, :3], rows[:, 7:10], turns[:, 3:]])


E0, E1, E2, E3 = P = sympy.symbols("e0_rod e1_rod e2_rod e3_rod")
OMEGA = sympy.Matrix(sympy.symbols([f"omega_{axis}_rod" for axis in AXES]))
POINT, DIRECTION = (-0.1, 0.2, 0.3), (0.6, 0, 0.8)
S, H = sympy.Matrix(POINT), sympy.Matrix(DIRECTION)
Y_AXIS = np.eye(3)[1]


def tilde(v: Any) -> Any:
    return sympy.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rotation() -> Any:
    e = sympy.Matrix(P[1:])
    return (E0**2 - e.dot(e)) * sympy.eye(3) + 2 * e * e.T + 2 * E0 * tilde(e)


A = rotation()


def pendulum() -> spatial.Mechanism:
    """A rod on a ball joint whose direction h keeps an angle with y: two constraints."""
    m = spatial.Mechanism("pendulum")
    rod = m.body("rod", (0.1, 0.2, -0.3))
    m.add(spatial.Spherical("A", m.ground, (0, 0, 0), rod, POINT))
    m.add(spatial.Dot1("dial", m.ground, Y_AXIS, rod, DIRECTION, kc.t**2 / 9))
    return m


def by_hand(change: Any = None) -> dict[str, Any]:
    """Return the r-omega form of the pendulum as a student writes it, perhaps with a slip."""
    terms = {
        "Phi_pi of A": -A * tilde(S),
        "Phi_pi of dial": -(A * tilde(H))[1, :],
        "gamma of A": -A * tilde(OMEGA) * tilde(OMEGA) * S,
        "gamma of dial": -(A * tilde(OMEGA) * tilde(OMEGA) * H)[1:2, :],
    }
    terms |= change or {}
    upper = sympy.eye(3).row_join(terms["Phi_pi of A"])
    Phi_q = upper.col_join(sympy.zeros(1, 3).row_join(terms["Phi_pi of dial"]))
    gamma = terms["gamma of A"].col_join(
        terms["gamma of dial"] + sympy.Matrix([sympy.Rational(2, 9)])
    )
    return {"Phi_q": Phi_q, "nu": sympy.Matrix([0, 0, 0, 2 * kc.t / 9]), "gamma": gamma}


def test_that_a_hand_in_of_small_rotations_is_equal() -> None:
    report = kc.compare(pendulum(), **by_hand())
    assert report.equal
    assert {entry.verdict for entry in report.entries} <= {"equal", "equal up to convention"}
    assert report.entries[3].column == "pi_xi_rod"
    assert "no norm rows" in str(report)


def test_that_gamma_alone_shows_its_form() -> None:
    report = kc.compare(pendulum(), gamma=by_hand()["gamma"])
    assert report.equal
    assert report.conventions[0].kind == "r-omega form"


@pytest.mark.parametrize("constraint", ["A", "dial"])
def test_that_one_constraint_is_compared_alone(constraint: str) -> None:
    rows = slice(0, 3) if constraint == "A" else slice(3, 4)
    given = {name: item[rows, :] for name, item in by_hand().items()}
    assert kc.compare(pendulum(), **given, constraint=constraint).equal


def test_that_global_axes_are_a_convention_where_they_are_everywhere() -> None:
    given = by_hand({"Phi_pi of A": -tilde(A * S), "Phi_pi of dial": -tilde(A * H)[1, :]})
    report = kc.compare(pendulum(), **given)
    assert report.equal
    assert report.conventions[0].kind == "global omega"
    assert report.entries[3].column == "pi_x_rod"
    assert not kc.compare(pendulum(), **given, strict=True).equal
    assert not kc.compare(pendulum(), **given, conventions={"form": "r-omega"}).equal


SPATIAL_OMEGA = A * OMEGA
SLIPS = {
    "the small rotations are about the global axes": {"Phi_pi of A": -tilde(A * S)},
    "the global omega_j stands where omega_j' of the body belongs": {
        "gamma of A": -A * tilde(SPATIAL_OMEGA) * tilde(SPATIAL_OMEGA) * S
    },
    "A_j is transposed": {"Phi_pi of A": -A.T * tilde(S)},
    "the sign of s_j~ is wrong in A_j s_j~": {"Phi_pi of A": A * tilde(S)},
    "is twice what it should be": {"Phi_pi of A": -2 * A * tilde(S)},
    "the factor omega_j'~ is missing": {"gamma of A": -A * tilde(OMEGA) * S},
    "the sign of a_j~ is wrong": {"Phi_pi of dial": (A * tilde(H))[1, :]},
}


@pytest.mark.parametrize("named", SLIPS)
def test_that_slips_with_small_rotations_are_named(named: str) -> None:
    report = kc.compare(pendulum(), **by_hand(SLIPS[named]))
    assert not report.equal
    assert named in str(report)
