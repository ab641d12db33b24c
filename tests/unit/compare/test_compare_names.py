"""Names and signs as courses write them: numbered, in Greek, in LaTeX, complex, in degrees."""

from pathlib import Path

import pytest
import sympy

import kincompile as kc
from kincompile.checker.notation import plain
from kincompile.errors import InputError
from tests.pendulum import pendulum

MODEL = pendulum()


@pytest.mark.parametrize(
    "gamma",
    [
        "[-cos(phi1)*phi1_dot^2; -sin(phi_1)*phi1d^2; 2]",
        "[-cos(q3)*q3_dot^2; -sin(q_3)*q3d^2; 2]",
        "[-cos(φ1)*φ̇1²; -sin(φ₁)·φ̇₁²; 2]",
        "[\u2212cos(ϕ_bob)\u00d7φ̇_bob³÷φ̇_bob; -sin(φ_bob)·φ̇_bob²; 2]",
        r"\begin{pmatrix} -\cos\phi_1 \dot\phi_1^2 \\ -\sin\left(\phi_1\right) \dot{\phi}_1^{2} "
        r"\\ 2 \end{pmatrix}",
        r"[-\cos(\phi_{1}) \cdot \dot{\phi_1}^2, -"
        r"\frac{\sin(2\phi_1)}{2 \cos\phi_{bob}}\dot\phi_1^2, 2]",
        r"\left[\begin{matrix}- \dot{\phi}_{1}^{2} \cos{\left(\phi_{1} \right)}\\"
        r"- \dot{\phi}_{1}^{2} \sin{\left(\phi_{1} \right)}\\2\end{matrix}\right]",
        "[-(exp(I*phi1) + exp(-I*phi1))/2*phi1d^2, "
        "-(exp(1i*phi1) - exp(-1i*phi1))/(2*1i)*phi1d^2, 2]",
        "[-sin(phi1 + 90°)*phi1d^2, -cos(phi1 - 90 °)*phi1d^2, 2]",
    ],
)
def test_a_gamma_in_many_hands(gamma: str, tmp_path: Path) -> None:
    assert kc.compare(MODEL, gamma=gamma).equal
    assert not kc.compare(MODEL, gamma=gamma.replace("2", "3")).equal
    file = tmp_path / "hand.txt"
    file.write_text(f"\u03b3 = {gamma}\n", encoding="utf-8")
    assert kc.compare_file(MODEL, file).equal


def test_that_sympy_may_be_complex() -> None:
    phi = sympy.Symbol("phi1")
    e = sympy.exp(sympy.I * phi)
    assert kc.compare(MODEL, Phi=["x1", "y1", phi - kc.t**2]).different
    both = [sympy.Symbol("x1") - (e + 1 / e) / 2, sympy.Symbol("y1") - (e - 1 / e) / (2 * sympy.I)]
    assert kc.compare(MODEL, Phi=[*both, phi - kc.t**2]).equal
    with pytest.raises(InputError, match="is not real"):
        kc.compare(MODEL, Phi=["x1 - I", "y1", "phi1"])


def test_that_names_of_the_model_come_first() -> None:
    m = kc.Mechanism("taken")
    m.parameter("x1", 2.0)
    m.add(kc.AbsoluteX("at", m.body("arm"), (0, 0), sympy.Symbol("x1")))
    assert kc.compare(m, Phi="[x_arm - x1]").equal


def test_that_an_unknown_name_is_told_once() -> None:
    with pytest.raises(InputError) as caught:
        kc.compare(MODEL, Phi="[x2 + zeta, x2, zeta]", nu="[x2, 0, 0]", gamma="[0, 0, eta]")
    first, *rest = caught.value.problems
    assert first == (
        "Phi, line 1, column 2: there is no 'x2'; the names are: x_bob, y_bob, phi_bob, t, "
        "and rates such as x_bob_dot; bodies are numbered: 1 bob, so that x1 is x_bob; "
        "for a name of your own write a line 'name = formula'"
    )
    assert [len(item) < 80 for item in rest] == [True, True]
    assert ["zeta" in rest[0], "eta" in rest[1]] == [True, True]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a1[2]", "a1[2]"),
        (r"\frac{a}{\frac{b}{c}}", "((a)/(((b)/(c))))"),
        (r"\dot{x}_{rod} + \ddot\phi", "x_rod_dot + phi_ddot"),
        (r"\frac{\dot{x}_3}{2}", "((x_3_dot)/(2))"),
        ("x_{rod} - y_{rod}", "x_rod - y_rod"),
        ("0.5.*sin(a).^2./b + 2.**3", "0.5*sin(a)^2/b + 2.**3"),
        (r"\sin^2\phi_1", "(sin(phi_1))^(2)"),
        (r"\mathbf{\Phi}_{\mathbf{q}}", "Phi_q"),
        (r"[1 \phi_1]", "[1 phi_1]"),
    ],
)
def test_latex(text: str, expected: str) -> None:
    assert plain(text) == expected
