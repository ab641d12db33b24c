"""J, J_dot, effort and x of transmissions, derived by hand, and slips in them as people make them.

The right formulas are those of `transmission_cases.md` (closed forms), not of the code.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.checker.report import Report
from kincompile.checker.transmission_reference import TransmissionReference
from kincompile.cli import cli
from tests import transmission_models as models

# T1a: with theta of the crank, beta of the coupler and psi of the rocker, loop differentiated.
B, T, P = "phi_coupler", "motor", "phi_rocker"
FOUR_BAR = f"a*sin({B} - {T})/(c*sin({B} - {P}))"
FOUR_BAR_DOT = (
    f"a/c*(cos({B} - {T})*({B}_dot - {T}_dot)/sin({B} - {P})"
    f" - sin({B} - {T})*cos({B} - {P})*({B}_dot - {P}_dot)/sin({B} - {P})**2)"
)
# T6: d is the distal link; d^T (x_dot - l u_dot n) = 0 with n across the proximal one.
ENDS = {"left": ("motor_1", "-0.059"), "right": ("motor_2", "0.059")}


def five_bar_row(u: str, x: str) -> list[str]:
    dx, dy = f"(x_end - ({x}) - 0.09*cos({u}))", f"(y_end - 0.09*sin({u}))"
    across = f"(0.09*({dy}*cos({u}) - {dx}*sin({u})))"
    return [f"{dx}/{across}", f"{dy}/{across}"]


FIVE_BAR_INVERSE = [five_bar_row(*ENDS[side]) for side in ("left", "right")]


def five_bar_jacobian(u: Any, x: Any) -> Any:
    """Return dx/du of T6 from the rows by numbers."""
    rows = []
    for angle, end in zip(u, (-0.059, 0.059), strict=True):
        d = x - [end + 0.09 * np.cos(angle), 0.09 * np.sin(angle)]
        rows.append(d / (0.09 * (d[1] * np.cos(angle) - d[0] * np.sin(angle))))
    return np.linalg.inv(rows)


def turned(angle: float) -> Any:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def ankle_inverse(x: Any) -> Any:
    """Return du/dx of T3-SPU: direction of the rod times lever."""
    pitch, roll = x
    c, s = np.cos(pitch), np.sin(pitch)
    shank = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    shank = shank @ [[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]]
    rows = []
    for side in (1, -1):
        lever = shank @ (-0.052, side * 0.034, 0.015)
        rod = lever - (-0.045, side * 0.036, 0.24)
        axes = ((0, 1, 0), (c, 0, -s))
        rows.append([rod @ np.cross(axis, lever) / np.linalg.norm(rod) for axis in axes])
    return np.array(rows)


def ankle_jacobian(u: Any, x: Any) -> Any:
    del u
    return np.linalg.inv(ankle_inverse(x))


@cache
def reference(name: str) -> TransmissionReference:
    model, inputs, outputs = {
        "four_bar": (models.crank_rocker, ["motor"], ["rocker.phi"]),
        "ankle": (models.ankle, ["left", "right"], ["pitch", "roll"]),
        "five_bar": (models.five_bar, ["motor_1", "motor_2"], ["end"]),
        "differential": (models.differential, ["m_1", "m_2"], ["x_1", "x_2"]),
        "remote_drive": (models.remote_drive, ["m_1", "m_2"], ["x_1", "x_2"]),
    }[name]
    return TransmissionReference(kc.transmission(model(), inputs, outputs))


def compared(name: str, **given: Any) -> Report:
    report: Report = kc.compare(reference(name), **given)
    return report


def named(report: Report, *words: str) -> bool:
    """Return whether one sentence holds all words."""
    assert not report.equal, report.to_text()
    texts = {item.text for entry in report.different for item in entry.diagnoses}
    return any(all(word in text for word in words) for text in texts)


JD = np.array([[1 / 200, -1 / 240], [1 / 150, 1 / 180]])

RIGHT: list[tuple[str, dict[str, Any]]] = [
    ("four_bar", {"J": f"[[{FOUR_BAR}]]", "J_dot": f"[[{FOUR_BAR_DOT}]]"}),
    ("four_bar", {"J": [[FOUR_BAR]], "effort": [f"{FOUR_BAR}*tau_phi_rocker"]}),
    ("four_bar", {"J": [[f"1/({FOUR_BAR})"]]}),
    ("four_bar", {"x": ["phi_rocker"]}),
    ("four_bar", {"x": ["phi_rocker - 2*pi"]}),
    ("five_bar", {"J": lambda u, x: five_bar_jacobian(u, x)}),
    ("five_bar", {"J": FIVE_BAR_INVERSE}),
    ("five_bar", {"J": FIVE_BAR_INVERSE[::-1]}),
    ("five_bar", {"J": [row[::-1] for row in FIVE_BAR_INVERSE]}),
    ("five_bar", {"J": [list(row) for row in zip(*FIVE_BAR_INVERSE, strict=True)]}),
    ("ankle", {"J": ankle_jacobian}),
    ("ankle", {"J": lambda angles: ankle_inverse(angles)}),
    ("ankle", {"J": lambda x: ankle_inverse(x).T}),
    ("ankle", {"J": ankle_jacobian, "effort": lambda u, x, tau_x: ankle_jacobian(u, x).T @ tau_x}),
    ("differential", {"J": [[1 / 200, -1 / 240], [1 / 150, 1 / 180]]}),
    ("differential", {"J": [["1/200", "-1/240"], ["1/150", "1/180"]],
                      "effort": ["(tau_x_1/2 + tau_x_2/1.5)/100", "-(tau_x_1/2 - tau_x_2/1.5)/120"],
                      "x": ["(m_1/50 - m_2/60)/4 + 0.1", "(m_1/50 + m_2/60)/3 - 0.2"]}),
    ("differential", {"effort": ["2*(50*tau_m_1 - 60*tau_m_2)", "1.5*(50*tau_m_1 + 60*tau_m_2)"]}),
]  # fmt: skip


@pytest.mark.every(5)
@pytest.mark.parametrize(("name", "given"), RIGHT)
def test_that_no_right_formula_is_called_wrong(name: str, given: dict[str, Any]) -> None:
    report = compared(name, **given)
    assert report.equal, report.to_text()


WRONG: list[tuple[str, dict[str, Any], tuple[str, ...]]] = [
    ("four_bar", {"J": [[f"-{FOUR_BAR}"]]}, ("J has the wrong sign",)),
    ("four_bar", {"J": [[f"2*{FOUR_BAR}"]]}, ("twice",)),
    ("four_bar", {"J": [[FOUR_BAR.replace("a*", "")]]}, ("factor a is missing",)),
    ("four_bar", {"J": [[FOUR_BAR.replace("a*sin", "a*cos")]]}, ("cos", "sin")),
    ("four_bar", {"J": [[FOUR_BAR.replace(f"{B} - {P}", f"{T} - {P}")]]}, (B, T, "belongs")),
    ("four_bar", {"J": [[f"pi/180*{FOUR_BAR}"]]}, ("pi/180", "degrees")),
    ("four_bar", {"J": [[FOUR_BAR.replace("a*", "b*")]]}, ("b stands where a belongs",)),
    ("four_bar", {"J": [[FOUR_BAR]], "J_dot": [[FOUR_BAR_DOT.replace(f" - {P}_dot", "")]]},
     ("term of the chain rule", f"{P}_dot", "missing")),
    ("five_bar", {"J": [FIVE_BAR_INVERSE[0], FIVE_BAR_INVERSE[1][::-1]]},
     ("columns of x_end and y_end are exchanged", "row of motor_2")),
    ("five_bar", {"J": [FIVE_BAR_INVERSE[0], [f"-{item}" for item in FIVE_BAR_INVERSE[1]]]},
     ("row of motor_2", "wrong sign")),
    ("five_bar", {"J": [[FIVE_BAR_INVERSE[0][0].replace("cos(motor_1)", "cos(motor_2)", 1),
                         FIVE_BAR_INVERSE[0][1]], FIVE_BAR_INVERSE[1]]},
     ("motor_2", "motor_1", "belongs")),
    ("ankle", {"J": lambda u, x: ankle_jacobian(u, x) * [[1], [-1]]},
     ("row of roll", "wrong sign")),
    ("ankle", {"J": lambda u, x: np.pi / 180 * ankle_jacobian(u, x)}, ("pi/180",)),
    ("ankle", {"J": lambda u, x: np.diag([1, np.cos(x[0])]) @ ankle_jacobian(u, x)},
     ("cos(pitch) is too much", "row of roll")),
    ("ankle", {"effort": lambda u, x, tau_x: ankle_jacobian(u, x) @ tau_x},
     ("J stands where J^T belongs", "energy is not conserved")),
    ("ankle", {"effort": lambda u, x, tau_x: ankle_inverse(x) @ tau_x},
     ("inverse of J stands where J^T belongs",)),
    ("five_bar", {"J": [[item.replace("motor_1", "motor_2") for item in row]
                        for row in FIVE_BAR_INVERSE]},
     ("motor_2 stands where motor_1 belongs, throughout",)),
    ("five_bar", {"J": lambda u, x: five_bar_jacobian(u[::-1], x)}, ("each other's place",)),
    ("five_bar", {"J": lambda u, x: five_bar_jacobian(np.radians(u), x)},
     ("degrees are taken for radians",)),
    ("five_bar", {"J": lambda u, x: turned(u[0]) @ five_bar_jacobian(u, x)},
     ("another frame, turned by motor_1",)),
    ("five_bar", {"J": lambda u, x: five_bar_jacobian(u, x) * [1, -1]},
     ("column of motor_2 has the wrong sign",)),
    ("five_bar", {"J": lambda u, x: five_bar_jacobian(u, x)[[[0, 1], [1, 0]], [[0], [1]]].T},
     ("rows of x_end and y_end are exchanged in the column of motor_2",)),
    ("four_bar", {"x": ["-phi_rocker"]}, ("x has the wrong sign",)),
    ("four_bar", {"x": lambda u: reference("four_bar").f.assemblies(u)[1]},
     ("another assembly", "branch")),
    ("differential", {"effort": lambda u, tau_x: -JD.T @ tau_x}, ("wrong sign", "load")),
    # ros2_control before PR 1837 (issue 1746), and the table in the header of its differential.
    ("remote_drive", {"effort": ["tau_x_1/100", "-(tau_x_1 + tau_x_2/1.5)/60"]},
     ("energy is not conserved: effort is not J^T of the velocities",)),
    ("differential", {"x": ["(m_1/50 - m_2/60)/4 + 0.1", "(m_1/50 + m_2/60)/4 - 0.2"]},
     ("all terms but the constant is 3/4 times",)),
    ("differential", {"effort": ["(tau_x_1/2 + tau_x_2/1.5)/100", "(tau_x_1/2 - tau_x_2/1.5)/100"]},
     ("-6/5 times",)),
    ("differential", {"effort": ["2*(50*tau_m_1 - 60*tau_m_2)", "1.5*(50*tau_m_1 - 60*tau_m_2)"]},
     ("the term with tau_m_2 has the wrong sign",)),
]  # fmt: skip


@pytest.mark.every(5)
@pytest.mark.parametrize(("name", "given", "words"), WRONG)
def test_that_a_slip_is_found_and_named(
    name: str, given: dict[str, Any], words: tuple[str, ...]
) -> None:
    report = compared(name, **given)
    assert named(report, *words), report.to_text()


def test_that_what_is_right_beside_what_is_wrong_is_said_to_be_right() -> None:
    right, wrong = [["1/100", "0"], ["-1/150", "-1/90"]], [["1/100", "0"], ["1/150", "-1/90"]]
    effort = ["tau_x1/100 - tau_x2/150", "-tau_x2/90"]
    report = compared("remote_drive", J=wrong, effort=effort)
    assert [entry.label for entry in report.different] == ["J[x_2, m_1]"]
    assert named(report, "wrong sign", "energy is not conserved", "effort is right")
    report = compared("remote_drive", J=right, effort=["tau_x1/100", effort[1]])
    assert [entry.label for entry in report.different] == ["effort[m_1]"]
    assert named(report, "energy is not conserved", "J is right")
    report = compared("remote_drive", J=wrong, effort=["tau_x1/100 + tau_x2/150", effort[1]])
    assert named(report, "it is J^T of your J, which is wrong: energy is conserved")


def test_that_another_matrix_or_order_is_said() -> None:
    report = compared("five_bar", J=[row[::-1] for row in FIVE_BAR_INVERSE[::-1]])
    assert report.equal
    assert [item.kind for item in report.conventions] == [
        "du/dx", "order of rows", "order of columns",
    ]  # fmt: skip
    assert "this is the inverse of J" in report.conventions[0].text
    for stated in ({"conventions": {"J": "dx/du"}}, {"strict": True}):
        assert named(compared("five_bar", J=FIVE_BAR_INVERSE, **stated), "this is the inverse of J")
    assert compared("five_bar", J=FIVE_BAR_INVERSE, conventions={"J": "du/dx"}).equal
    turned = [list(row) for row in zip(*FIVE_BAR_INVERSE, strict=True)]
    stated = {"conventions": {"J": "du/dx"}}
    assert named(compared("five_bar", J=turned, **stated), "transpose of the inverse of J")


def test_that_a_load_on_the_outputs_is_a_convention_that_is_stated() -> None:
    given = {"effort": lambda u, tau_x: -JD.T @ tau_x}
    assert not compared("differential", **given).equal
    assert compared("differential", **given, conventions={"effort": "load"}).equal


def test_that_arrays_belong_to_the_states_that_are_given() -> None:
    f = reference("five_bar").f
    u = f.home.u + np.array([[0, 0], [-0.1, 0.05]])
    values = f.at(u).J
    assert compared("five_bar", J=values, states={"u": u}).equal
    values[:, 0, 1] *= -1
    assert named(compared("five_bar", J=values, states={"u": u}), "wrong sign")


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("ankle", {"J": "[1, 2, 3]"}, ["J is 1 x 3", "2 x 2", "pitch", "left"]),
        ("ankle", {"effort": "[tau_left]"}, ["effort is 1 x 1", "left"]),
        ("ankle", {"J": "[[1, ptich], [2, 3]]"}, ["no 'ptich'", "pitch"]),
        ("ankle", {"J": lambda u: u[5]}, ["IndexError", "u = [", "array of real numbers"]),
        ("ankle", {"J": lambda u: [["a", 1], [2, 3]]}, ["ValueError", "J"]),
        ("ankle", {"J": lambda a, b, c, d: a}, ["4 arguments", "tau_x"]),
        ("ankle", {"Phi_q": "[1]"}, ["Phi_q", "compare them with the model itself"]),
        ("ankle", {}, ["nothing to compare", "J_dot"]),
        ("ankle", {"J": "[1]", "constraint": "left"}, ["leave constraint out"]),
        ("ankle", {"J": "[1]", "conventions": {"J": "inverse"}}, ["du/dx"]),
        ("ankle", {"J": np.eye(2), "states": {"q": [1, 2]}}, ["give 'u'"]),
        ("ankle", {"J": np.eye(2), "states": {"u": [0.9, 0.9]}}, ["not reached"]),
    ],
)  # fmt: skip
def test_that_what_cannot_be_compared_is_refused(
    name: str, given: dict[str, Any], words: list[str]
) -> None:
    with pytest.raises(kc.InputError) as caught:
        compared(name, **given)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_that_a_mechanism_has_no_jacobian_of_a_transmission() -> None:
    with pytest.raises(kc.InputError, match=r"kc\.transmission"):
        kc.compare(models.crank_rocker(), J="[1]")


def test_that_a_value_that_is_not_finite_is_named() -> None:
    assert named(compared("four_bar", J="[1/(motor - phi_crank)]"), "no finite value")


def test_that_hand_files_name_inputs_and_outputs(tmp_path: Path) -> None:
    model = tmp_path / "drive.toml"
    model.write_text(models.remote_drive().to_toml(), encoding="utf-8")
    ends = "m_1, m_2 : x_1, x_2"
    lines = "J = [r 0; -r/1.5 -1/90]\neffort = [r*tau_x1 - tau_x2/150; -tau_x2/90]\nr = 1/100\n"
    data = 'J = [["1/100", 0], ["-1/150", "-1/90"]]\n'
    table = '[transmission]\ninputs = ["m_1", "m_2"]\noutputs = ["x_1", "x_2"]\n'
    run = CliRunner()
    for name, text, options, code in [
        ("a.txt", f"transmission = {ends}\nr = 1/100\n{lines[: lines.index('r = ')]}", [], 0),
        ("b.toml", f'transmission = "{ends}"\n{data}', [], 0),
        ("c.toml", f"{data}{table}", [], 0),
        ("d.txt", "J = [[1/100, 0], [-1/150, -1/90]]", ["--transmission", ends], 0),
        ("e.txt", "J = [[1/100, 0], [1/150, -1/90]]", ["--transmission", ends], 1),
        ("f.txt", "J = [[1/100, 0], [1/150, -1/90]]", [], 2),
        ("g.txt", "transmission = m_1\nJ = [1]", [], 2),
        ("h.txt", "J = 1/100\nPhi = [x_1 - J*m_1 - 0.1; 3/2*(x_2 + 0.2) + m_2/60 + J*m_1]", [], 0),
    ]:
        (tmp_path / name).write_text(text, encoding="utf-8")
        result = run.invoke(cli, ["compare", str(model), str(tmp_path / name), *options])
        assert result.exit_code == code, (name, result.output)
