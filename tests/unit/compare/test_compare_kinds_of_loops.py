"""Maps of loops that are not square, have redundant rows, held freedoms, velocities, or a file.

The right formulas are closed forms; slips in them are found, and nothing else is called wrong.
"""

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from click.testing import CliRunner

import kincompile as kc
from kincompile.checker import hand_file
from kincompile.checker.report import Report
from kincompile.checker.transmission_reference import TransmissionReference
from kincompile.cli import cli
from tests import transmission_models as models

B, T, P = "phi_coupler", "motor", "phi_rocker"
OF_ROCKER = f"a*sin({B} - {T})/(c*sin({B} - {P}))"
OF_COUPLER = f"a*sin({P} - {T})/(b*sin({B} - {P}))"


def parallelogram() -> kc.Mechanism:
    """Return three equal cranks, of which one is redundant, and a pendulum that no output sees."""
    m = kc.Mechanism("parallelogram")
    r = m.parameter("r", 0.05, "m")
    end = 0.05 * math.cos(1.2), 0.05 * math.sin(1.2)
    cranks = [m.body(f"crank_{k}", (0.1 * k, 0, 1.2)) for k in range(3)]
    bar, pendulum = m.body("bar", (*end, 0)), m.body("pendulum", (*end, -1))
    for k, crank in enumerate(cranks):
        m.add(kc.Revolute(f"A{k}", m.ground, (0.1 * k, 0), crank, (0, 0)))
        m.add(kc.Revolute(f"B{k}", crank, (r, 0), bar, (0.1 * k, 0)))
    m.add(kc.Revolute("C", bar, (0, 0), pendulum, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", cranks[0], 1.2))
    m.point("end", bar, (0.05, 0.02))
    return m


@cache
def reference(name: str) -> TransmissionReference:
    model, inputs, outputs = {
        "four_bar": (models.crank_rocker, ["motor"], ["rocker.phi", "coupler.phi"]),
        "parallelogram": (parallelogram, ["motor"], ["end", "crank_2.phi"]),
        "five_bar": (models.five_bar, ["motor_1", "motor_2"], ["end"]),
        "half": (models.five_bar, ["motor_1", "motor_2"], ["x_end"]),
        "spin": (models.ankle, ["left", "right"], ["pitch", "omega_x_foot"]),
    }[name]
    return TransmissionReference(kc.transmission(model(), inputs, outputs))


def function(name: str) -> Any:
    return reference(name).f


def compared(name: str, **given: Any) -> Report:
    report: Report = kc.compare(reference(name), **given)
    return report


def said(report: Report) -> dict[str, str]:
    """Return the first sentence about each entry that is wrong."""
    return {entry.label: entry.diagnoses[0].text for entry in report.different}


ROUND = ["r*cos(motor) + 0.05", "r*sin(motor) + 0.02", "motor"]
SLOPES = [["-r*sin(motor)"], ["r*cos(motor)"], [1]]
RATES = [["-r*cos(motor)*motor_dot"], ["-r*sin(motor)*motor_dot"], [0]]
EFFORT = ["-r*sin(motor)*tau_x1 + r*cos(motor)*tau_x2 + tau_phi_crank_2"]


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_redundant_rows_and_held_freedoms_change_nothing() -> None:
    assert function("parallelogram").held == ("phi_pendulum",)
    report = compared("parallelogram", J=SLOPES, J_dot=RATES, effort=EFFORT, x=ROUND)
    assert report.verdict == "equal", report.to_text()
    wrong = compared(
        "parallelogram",
        J=[["r*sin(motor)"], *SLOPES[1:]],
        J_dot=[RATES[0], ["-r*sin(motor)"], RATES[2]],
        effort=[EFFORT[0].replace("+ tau_phi", "- tau_phi")],
        x=[ROUND[0], "r*cos(motor) + 0.02", "180/pi*motor"],
    )
    texts = said(wrong)
    assert texts["J[x_end, motor]"] == "the entry has the wrong sign."
    assert texts["J_dot[y_end, motor]"] == "a factor motor_dot is missing in the entry."
    assert texts["effort[motor]"].startswith("the term with tau_phi_crank_2 has the wrong sign")
    assert "sine and cosine are swapped" in texts["x[y_end]"]
    assert "degrees stand for radians" in texts["x[phi_crank_2]"]
    assert len(texts) == 5


def test_a_loop_with_more_outputs_than_inputs() -> None:
    effort = f"{OF_ROCKER}*tau_x1 + {OF_COUPLER}*tau_x2"
    report = compared("four_bar", J=[[OF_ROCKER], [OF_COUPLER]], effort=[effort], x=[P, B])
    assert report.verdict == "equal", report.to_text()
    report = compared("four_bar", J=[[OF_ROCKER, OF_COUPLER]], effort=[effort])
    assert report.equal
    assert report.conventions[0].kind == "transpose"
    report = compared("four_bar", effort=[f"{OF_COUPLER}*tau_x1 + {OF_ROCKER}*tau_x2"])
    assert "the columns of tau_phi_rocker and tau_phi_coupler are exchanged" in str(said(report))
    wrong = effort.replace(" + ", " - ")
    report = compared("four_bar", J=[[OF_ROCKER], [f"-{OF_COUPLER}"]], effort=[wrong])
    assert "it is J^T of your J, which is wrong" in said(report)["effort[motor]"]
    with pytest.raises(kc.InputError, match="expected 1 rows, one for each of motor"):
        compared("four_bar", effort=["tau_motor", "tau_motor"])


def test_a_loop_with_fewer_outputs_than_inputs() -> None:
    f = function("half")
    report = compared("half", J=f.J, J_dot=f.J_dot, effort=f.effort, x=f)
    assert report.verdict == "equal", report.to_text()
    report = compared("half", effort=["tau_x1*u1", "tau_x1*u2"])
    assert [entry.label for entry in report.different] == ["effort[motor_1]", "effort[motor_2]"]


def test_that_orders_of_one_hand_in_belong_together() -> None:
    """Alone each order is a convention; beside a right J another one is a mistake."""
    f = function("five_bar")
    u = f.home.u + np.array([[0, 0], [-0.1, 0.05], [0.1, 0.1]])
    u_dot, tau = np.full((3, 2), [0.3, -0.7]), np.full((3, 2), [2.0, 5.0])
    at = {"states": {"u": u, "u_dot": u_dot, "tau_x": tau}}
    slopes, rates, effort, x = f.J(u), f.J_dot(u, u_dot), f.effort(u, tau), f(u)
    for alone in ({"effort": effort[:, ::-1]}, {"J_dot": rates[:, ::-1]}, {"x": x[:, ::-1]}):
        assert [item.kind for item in compared("five_bar", **alone, **at).conventions] == [
            "order of rows"
        ]
        report = compared("five_bar", J=slopes, **alone, **at)
        assert {entry.quantity for entry in report.different} == set(alone)
        assert all("are exchanged" in text for text in said(report).values())
        if "effort" in alone:
            assert "J is right" in said(report)["effort[motor_1]"]
    turned = {"J": slopes[:, ::-1, ::-1], "J_dot": rates[:, ::-1, ::-1], "x": x[:, ::-1]}
    assert compared("five_bar", **turned, effort=effort[:, ::-1], **at).equal
    assert compared("five_bar", J=slopes[:, ::-1, ::-1], effort=effort, x=x, **at).equal


def test_that_efforts_of_a_load_belong_to_a_wrong_jacobian_with_their_sign() -> None:
    effort = [f"-({OF_ROCKER}*tau_x1 - {OF_COUPLER}*tau_x2)"]
    report = compared(
        "four_bar",
        J=[[OF_ROCKER], [f"-{OF_COUPLER}"]],
        effort=effort,
        conventions={"effort": "load"},
    )
    assert "it is J^T of your J, which is wrong" in said(report)["effort[motor]"]


def test_the_inverse_as_a_function_of_its_own() -> None:
    g = function("five_bar").inverse
    report = kc.compare(g, J=g.J, J_dot=g.J_dot, effort=g.effort, x=g)
    assert report.verdict == "equal", report.to_text()
    rows = []
    for u, side in (("u_motor_1", "0.059"), ("u_motor_2", "-0.059")):
        dx, dy = f"(x_end + ({side}) - 0.09*cos({u}))", f"(y_end - 0.09*sin({u}))"
        across = f"(0.09*({dy}*cos({u}) - {dx}*sin({u})))"
        rows.append([f"{dx}/{across}", f"{dy}/{across}"])
    assert kc.compare(g, J=rows).verdict == "equal"
    wrong = [rows[0], [rows[1][0], rows[1][1].replace("sin(u_motor_2))/", "cos(u_motor_2))/")]]
    assert [entry.label for entry in kc.compare(g, J=wrong).different] == ["J[u_motor_2, y_end]"]


def test_that_velocities_have_a_jacobian_and_no_x() -> None:
    f = function("spin")
    report = compared("spin", J=f.J, effort=f.effort)
    assert report.verdict == "equal", report.to_text()
    u = f.home.u + np.array([[0, 0], [0.005, -0.01]])
    report = compared("spin", J=f.J(u) * [[1], [-1]], states={"u": u})
    assert set(said(report)) == {"J[omega_x_foot, left]", "J[omega_x_foot, right]"}
    assert "the row of omega_x_foot has the wrong sign" in str(said(report))
    with pytest.raises(kc.InputError, match="velocities in it, omega_x_foot"):
        compared("spin", x=f)


def test_that_a_wider_matrix_may_have_its_rows_and_columns_in_any_order() -> None:
    """Eight by eight, with zeros and equal entries: more orders than can be tried."""
    names = [f"m_{k}" for k in range(8)], [f"x_{k}" for k in range(8)]
    numbers = np.random.default_rng(3).integers(0, 3, (8, 8)) / 4 + 2 * np.eye(8)
    u, x = (sympy.symbols(own) for own in names)
    equations = list(sympy.Matrix(x) - sympy.Matrix(numbers) * sympy.Matrix(u))
    f = kc.transmission(kc.ConstraintSystem("gears", [*u, *x], equations), *names)
    rows, columns = (np.random.default_rng(seed).permutation(8) for seed in (4, 5))
    report = kc.compare(f, J=numbers[rows][:, columns])
    assert report.equal, report.to_text()
    assert [item.kind for item in report.conventions] == ["order of rows", "order of columns"]
    wrong = numbers[rows][:, columns]
    wrong[2, 3] += 1
    report = kc.compare(f, J=wrong)
    assert [entry.label for entry in report.different] == [f"J[x_{rows[2]}, m_{columns[3]}]"]


def test_that_the_table_of_a_model_says_of_what_a_hand_file_is(tmp_path: Path) -> None:
    model, hand = tmp_path / "drive.toml", tmp_path / "hand.txt"
    table = '\n[transmission]\ninputs = ["m_1", "m_2"]\noutputs = ["x_1", "x_2"]\n'
    model.write_text(models.remote_drive().to_toml() + table, encoding="utf-8")
    run = CliRunner()
    for line, code, words in [
        ("J = [1/100 0; -1/150 -1/90]", 0, "Verdict: equal."),
        ("J = [-1/150 -1/90; 1/100 0]", 0, "the rows have another order: x_2, x_1"),
        ("J = [1/100 0; 1/150 -1/90]", 1, "J[x_2, m_1]: different"),
        ("effort = [tau_x1/100 - tau_x2/150; -tau_x2/90]", 0, "Verdict: equal."),
        ("effort = [-tau_x2/90; tau_x1/100 - tau_x2/150]\nJ = [1/100 0; -1/150 -1/90]", 1,
         "rows of m_1 and m_2 are exchanged"),
        ("transmission = m_1, m_2 : x_2\nJ = [-1/150 -1/90]", 0, "Verdict: equal."),
        ("J = [1 2 3]", 2, "J is 1 x 3"),
    ]:  # fmt: skip
        hand.write_text(line, encoding="utf-8")
        result = run.invoke(cli, ["compare", str(model), str(hand)])
        assert result.exit_code == code, result.output
        assert words in result.output


def test_that_a_hand_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, hand = tmp_path / "drive.toml", tmp_path / "hand.txt"
    model.write_text(models.remote_drive().to_toml(), encoding="utf-8")
    hand.write_text("transmission = m_1, m_2 : x_1, x_2\nJ = [1/100 0; -1/150 -1/90]", "utf-8")
    read, own = [], vars(hand_file)["file_content"]

    def counted(*given: Any, **options: Any) -> Any:
        read.append(given)
        return own(*given, **options)

    monkeypatch.setattr(hand_file, "file_content", counted)
    assert CliRunner().invoke(cli, ["compare", str(model), str(hand)]).exit_code == 0
    assert len(read) == 1
