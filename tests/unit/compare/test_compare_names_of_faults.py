"""Mistakes seen in hand-ins and in published codes have a name, beside what is right."""

from collections.abc import Callable
from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.checker.report import Report

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")
Models = dict[str, Callable[[], kc.Mechanism]]

t = kc.t
w_i, w_j = sympy.symbols("phi_i_dot phi_j_dot")
C = sympy.Symbol("reach") + sympy.Symbol("l") * sympy.sin(sympy.Symbol("omega") * t)
RATES = {sympy.Symbol(f"{x}_{b}_dot"): sympy.Symbol(f"{x}_{b}") for x in "xy" for b in "ij"}
POSITIONS = {position: rate for rate, position in RATES.items()}


def beside_right(model: kc.Mechanism, strict: bool = False, **wrong: Any) -> Report:
    """Compare a hand-in that is right but for some quantities."""
    given = {name: getattr(model, name) for name in QUANTITIES}
    report: Report = kc.compare(model, **{**given, **wrong}, strict=strict)
    return report


def named(report: Report) -> set[str]:
    """Return the names of all faults; none of the right quantities may have one."""
    return {item.kind for entry in report.different for item in entry.diagnoses}


@pytest.mark.parametrize("kind", ["AbsoluteX", "RelativeY", "AbsoluteAngle", "RelativeAngle"])
def test_a_derivative_of_the_driver_taken_for_another(kind: str, joint_types: Models) -> None:
    model = joint_types[kind]()
    orders = [C, C.diff(t), C.diff(t, 2)]
    for quantity, right, wrong in (("nu", 1, 0), ("nu", 1, 2), ("gamma", 2, 1)):
        changed = getattr(model, quantity).applyfunc(
            lambda e, a=orders[right], b=orders[wrong]: e - a + b
        )
        report = beside_right(model, **{quantity: changed})
        assert named(report) == {"derivatives of a function mixed"}
        assert {entry.quantity for entry in report.different} == {quantity}


@pytest.mark.parametrize("kind", ["Distance", "AbsoluteDistance"])
def test_the_chain_rule_of_a_squared_length(kind: str, joint_types: Models) -> None:
    model = joint_types[kind]()
    report = beside_right(model, nu=sympy.Matrix([C.diff(t)]))
    assert named(report) == {"follows from another Phi"}
    assert "the length instead of its square" in report.to_text()
    report = beside_right(model, nu=sympy.Matrix([2 * C.diff(t)]))
    assert named(report) == {"chain-rule factor missing"}


def test_positions_for_velocities_in_the_translational_joint(joint_types: Models) -> None:
    model = joint_types["Translational"]()
    for changed in (RATES, POSITIONS):
        gamma = model.gamma.subs(changed, simultaneous=True)
        report = beside_right(model, gamma=gamma)
        assert named(report) == {"position and velocity mixed"}
        assert {entry.row for entry in report.different} == {"K.normal"}


@pytest.mark.slow
def test_the_square_of_a_difference_of_squares(joint_types: Models) -> None:
    model = joint_types["Translational"]()
    normal, parallel = model.gamma
    factor = sympy.cancel(sympy.expand(parallel) / (w_j - w_i) ** 2)
    for wrong in ((w_j**2 - w_i**2) ** 2, w_j**2 - w_i**2, w_j**2 + w_i**2):
        gamma = sympy.Matrix([normal, factor * wrong])
        report = beside_right(model, strict=True, gamma=gamma)
        assert "w_j^2 - w_i^2 for (w_j - w_i)^2" in named(report)


@pytest.mark.every(5)
@pytest.mark.parametrize(
    "kind", ["Translational", "RackAndPinion", "CamFlatFollower", "Revolute", "PointFollower"]
)
def test_rows_of_gamma_that_are_swapped(kind: str, joint_types: Models) -> None:
    model = joint_types[kind]()
    report = beside_right(model, gamma=model.gamma[::-1, :])
    assert named(report) == {"rows swapped"}


@pytest.mark.slow
def test_two_of_three_rows_that_are_swapped(joint_types: Models) -> None:
    model = joint_types["CamFollower"]()
    report = beside_right(model, gamma=model.gamma[[0, 2, 1], :])
    assert named(report) == {"rows swapped"}
    assert "rows 2 and 3 are swapped" in report.to_text()


@pytest.mark.parametrize(
    ("kind", "rates"),
    [
        ("PointFollower", "alpha_K_dot phi_j_dot"),
        ("CamFlatFollower", "alpha_K_dot phi_i_dot"),
        ("CamFollower", "alpha_i_K_dot phi_i_dot"),
        ("CamFollower", "alpha_j_K_dot phi_j_dot"),
        ("RackAndPinion", "phi_i_dot phi_i_dot"),
    ],
)
@pytest.mark.parametrize(
    ("factor", "name"),
    [(0, "missing term"), (-1, "sign"), (sympy.Rational(1, 2), "factor 2 or 1/2")],
)
@pytest.mark.slow
def test_the_part_of_gamma_with_a_product_of_rates(
    kind: str, rates: str, factor: Any, name: str, joint_types: Models
) -> None:
    model = joint_types[kind]()
    first, second = sympy.symbols(rates)
    part = model.gamma.applyfunc(
        lambda e: first * second * sympy.diff(e, first, second) / (2 if first == second else 1)
    )
    report = beside_right(model, gamma=model.gamma - (1 - factor) * part)
    assert name in named(report)
    assert f"the part with {'w_i^2' if first == second else 'alpha'}" in report.to_text()


def pendulum(driver: Any) -> kc.Mechanism:
    m = kc.Mechanism("pendulum")
    bob = m.body("bob", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", bob, (-1, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bob, driver))
    return m


@pytest.mark.parametrize("factor", [sympy.pi / 180, 180 / sympy.pi])
def test_a_driver_in_degrees(factor: Any) -> None:
    model = pendulum(3 * t**2)
    wrong = pendulum(factor * 3 * t**2)
    for quantity in ("Phi", "nu", "gamma"):
        given = {quantity: getattr(wrong, quantity)}
        assert named(beside_right(model, **given)) == {"driver in degrees"}


@pytest.mark.parametrize("offset", [1, -1])
def test_rows_that_stand_one_place_from_their_own(offset: int) -> None:
    model = pendulum(3 * t**2)
    gamma = list(model.gamma)
    moved = [0, *gamma[:-1]] if offset > 0 else [*gamma[1:], 0]
    report = beside_right(model, gamma=moved)
    assert named(report) == {"rows offset by one"}
    assert {entry.quantity for entry in report.different} == {"gamma"}


def test_a_matrix_that_is_transposed() -> None:
    model = pendulum(3 * t**2)
    assert named(beside_right(model, Phi_q=model.Phi_q.T)) == {"matrix transposed"}
    assert named(kc.compare(model, Phi_q=model.Phi_q.T)) == {"matrix transposed"}


def test_that_a_row_of_phi_q_may_not_have_another_sign_than_phi(joint_types: Models) -> None:
    model = joint_types["Translational"]()
    Phi_q = model.Phi_q.as_mutable()
    Phi_q[0, :] = -Phi_q[0, :]
    report = beside_right(model, Phi_q=Phi_q)
    assert named(report) == {"sign"}
    assert "all its entries have the wrong sign" in report.to_text()


def test_that_a_transposed_rotation_and_its_sign_are_one_fault(joint_types: Models) -> None:
    model = joint_types["AbsoluteX"]()
    sine = sympy.sin(sympy.Symbol("phi_i"))
    report = beside_right(model, Phi=model.Phi.subs(sine, -sine))
    assert named(report) == {"rotation transposed"}
    assert "a term has the wrong sign, as where A_i is transposed" in report.to_text()
