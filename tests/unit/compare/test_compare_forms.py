"""Another Phi of the same constraint is right, and all that follows from it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.checker.report import Report

t = kc.t
QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")


def derived(equations: list[Any], coordinates: str) -> dict[str, sympy.Matrix]:
    """Differentiate by SymPy, apart from the compiler."""
    names = coordinates.split()
    q, q_dot = (sympy.Matrix([sympy.Symbol(name + end) for name in names]) for end in ("", "_dot"))
    Phi = sympy.Matrix(equations)
    velocity = Phi.jacobian(q) * q_dot + Phi.diff(t)
    gamma = -(velocity.jacobian(q) * q_dot + velocity.diff(t))
    return {"Phi": Phi, "Phi_q": Phi.jacobian(q), "nu": -Phi.diff(t), "gamma": gamma}


def press() -> kc.Mechanism:
    """Return a toggle press: a ram in a guide, driven by a cylinder."""
    m = kc.Mechanism("press", length_unit="mm")
    a = m.parameter("a", 200, unit="mm")
    upper, lower = m.body("upper", guess=(0, 0, -2)), m.body("lower", guess=(-70, -190, -1.2))
    ram = m.body("ram", guess=(0, -380, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), upper, (0, 0)))
    m.add(kc.Revolute("knee", upper, (a, 0), lower, (0, 0)))
    m.add(kc.Revolute("wrist", lower, (a, 0), ram, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (0, 1), ram, (0, 0), (0, 1)))
    m.add(kc.Distance("cylinder", m.ground, (-300, -190), upper, (a, 0), 230 + 60 * t))
    return m


MODEL = press()
UPPER = "x_upper y_upper phi_upper"
x, y, phi, a = sympy.symbols(f"{UPPER} a")
SQUARE = (x + a * sympy.cos(phi) + 300) ** 2 + (y + a * sympy.sin(phi) + 190) ** 2
LENGTH = derived([sympy.sqrt(SQUARE) - (230 + 60 * t)], UPPER)
HALF = derived([(SQUARE - (230 + 60 * t) ** 2) / (460 + 120 * t)], UPPER)


def cylinder(**given: Any) -> Report:
    report: Report = kc.compare(MODEL, constraint="cylinder", **given)
    return report


def texts(report: Report) -> list[str]:
    return [item.text for item in report.conventions]


def flagged(report: Report) -> list[str]:
    return [entry.quantity for entry in report.different]


@pytest.mark.parametrize("names", [QUANTITIES, QUANTITIES[1:], ("nu",), ("gamma",), ("Phi", "nu")])
def test_a_length_instead_of_its_square(names: tuple[str, ...]) -> None:
    report = cylinder(**{name: LENGTH[name] for name in names})
    assert report.verdict == "equal up to convention"
    assert texts(report) == ["cylinder: the length instead of its square."]
    assert not cylinder(**{name: LENGTH[name] for name in names}, strict=True).equal


def test_that_a_length_needs_its_own_rates() -> None:
    square = derived([SQUARE - (230 + 60 * t) ** 2], UPPER)
    report = cylinder(Phi=LENGTH["Phi"], Phi_q=LENGTH["Phi_q"], nu=square["nu"])
    assert flagged(report) == ["nu"]
    report = cylinder(Phi=square["Phi"], nu=LENGTH["nu"])
    assert flagged(report) == ["nu"]
    assert "the length instead of its square, and not to your Phi" in report.to_text()
    report = cylinder(Phi_q=2 * LENGTH["Phi_q"], nu=LENGTH["nu"])
    assert "half what it should be" in report.to_text()


@pytest.mark.parametrize("name", QUANTITIES[1:])
def test_that_a_sign_is_a_mistake_in_another_form_too(name: str) -> None:
    wrong = {**LENGTH, name: -LENGTH[name]}
    assert set(flagged(cylinder(**wrong))) == {name}


def test_that_phi_q_must_be_the_derivative_of_its_own_phi() -> None:
    report = cylinder(Phi=LENGTH["Phi"], Phi_q=HALF["Phi_q"], nu=LENGTH["nu"])
    assert (set(flagged(report)), report.verdict) == ({"Phi_q"}, "equal on the manifold")
    assert cylinder(**HALF).equal


@pytest.mark.slow
def test_that_a_function_may_have_another_form() -> None:
    def Phi(q: Any, t: float) -> list[float]:
        at = q[0] + 200 * np.cos(q[2]) + 300, q[1] + 200 * np.sin(q[2]) + 190
        return [float(np.hypot(*at)) - 230 - 60 * t]

    number = {a: 200}
    rest = {name: LENGTH[name].subs(number) for name in QUANTITIES[1:]}
    report = cylinder(Phi=Phi, **rest)
    assert texts(report)[0] == "cylinder: the length instead of its square."
    assert report.equal
    assert flagged(cylinder(Phi=Phi, **{**rest, "nu": [59]})) == ["nu"]


GUIDE = "x_ram y_ram phi_ram"
u, v, psi = sympy.symbols(GUIDE)


def guide(*equations: Any, **changes: Any) -> Report:
    given = {**derived(list(equations), GUIDE), **changes}
    report: Report = kc.compare(MODEL, constraint="guide", **given)
    return report


def test_an_angle_instead_of_its_sine() -> None:
    assert guide(u, psi).equal
    assert "an angle instead of its sine" in texts(guide(u, psi))[0]
    assert kc.compare(MODEL, Phi_q=[[-1, 0, 0], [0, 0, 1]], constraint="guide").equal
    assert kc.compare(MODEL, Phi_q=[[-1, 0, 0], [0, 0, -1]], constraint="guide").equal
    assert not kc.compare(MODEL, Phi_q=[[-1, 0, 0], [0, 1, 1]], constraint="guide").equal


def test_that_a_slip_is_no_other_equation_that_only_phi_q_shows(joint_types: Any) -> None:
    model = joint_types["Translational"]()
    e, f = sympy.symbols("e f")
    swapped = model.Phi.subs({e: f, f: e}, simultaneous=True)
    q = sympy.Matrix([sympy.Symbol(item.name) for item in model.system().coordinates])
    rows = [model.Phi[0], swapped[1]]  # v_i with xi and eta swapped in the parallel row
    Phi_q = sympy.Matrix(rows).jacobian(q)
    for strict in (False, True):
        report = kc.compare(model, Phi_q=Phi_q, strict=strict)
        assert {d.kind for e in report.different for d in e.diagnoses} == {"xi and eta swapped"}


@pytest.mark.slow
def test_that_an_angle_in_another_assembly_is_no_solution() -> None:
    assert not guide(u, psi - sympy.pi).equal
    assert not guide(u, psi**2).equal  # a double root: Phi_q vanishes where it holds


def test_rows_that_are_combined() -> None:
    assert guide(u * sympy.cos(psi) + v * sympy.sin(psi), psi).equal
    assert guide(u + sympy.sin(psi), u - 3 * sympy.tan(psi)).equal
    assert not guide(u + sympy.sin(psi), 2 * u + 2 * sympy.tan(psi)).equal  # one equation twice


COMBINE = sympy.Matrix([[1, 1], [1, -1]])
SINE, COSINE = (f(sympy.Symbol("phi_lower")) for f in (sympy.sin, sympy.cos))
TURN = sympy.Matrix([[COSINE, SINE], [-SINE, COSINE]])
ROW_SPACES = "only the row spaces of Phi_q agree"


def wrist(matrix: sympy.Matrix, *names: str, **changes: Any) -> Report:
    """Compare a revolute joint whose named quantities have combined rows."""
    rows = [MODEL.system().equations.index(f"wrist.{axis}") for axis in "xy"]
    given = {name: matrix * getattr(MODEL, name)[rows, :] for name in names}
    right = {name: getattr(MODEL, name)[rows, :] for name in changes.pop("right", ())}
    report: Report = kc.compare(MODEL, constraint="wrist", **given, **right, **changes)
    return report


@pytest.mark.parametrize("names", [("Phi_q",), QUANTITIES[1:], QUANTITIES])
def test_sum_and_difference_of_two_rows(names: tuple[str, ...]) -> None:
    report = wrist(COMBINE, *names)
    assert report.verdict == "equal up to convention"
    assert ROW_SPACES in texts(report)[0]
    assert not wrist(COMBINE, *names, strict=True).equal


def test_that_gamma_must_have_the_combinations_of_phi_q() -> None:
    report = wrist(COMBINE, "Phi_q", right=("nu", "gamma"))
    assert set(flagged(report)) == {"gamma"}
    assert ROW_SPACES in texts(report)[0]


def named(report: Report) -> set[tuple[str, str]]:
    return {(e.quantity, item.kind) for e in report.different for item in e.diagnoses}


@pytest.mark.parametrize("beside", [(), ("Phi",)])
def test_that_combinations_that_vary_are_no_derivative(beside: tuple[str, ...]) -> None:
    report = wrist(TURN, "Phi_q", "nu", "gamma", right=beside)
    assert named(report) == {("Phi_q", "row spaces agree"), ("gamma", "row spaces agree")}
    of = "your Phi" if beside else "any Phi"
    text = "only the row spaces agree: the rows are combinations of the right ones, and not the "
    assert f"{text}derivative of {of}" in report.to_text()


def test_that_combined_rows_do_not_follow_from_a_phi_that_is_not() -> None:
    report = wrist(COMBINE, "Phi_q", "nu", "gamma", right=("Phi",))
    assert named(report) == {("Phi_q", "row spaces agree"), ("gamma", "row spaces agree")}
    assert set(flagged(report)) == {"Phi_q", "gamma"}


def test_that_one_for_the_cosine_does_not_follow_from_the_sine() -> None:
    report = guide(-u, sympy.sin(psi), Phi_q=[[-1, 0, 0], [0, 0, 1]])
    assert [(e.column, e.verdict) for e in report.different] == [
        ("phi_ram", "equal on the manifold")
    ]


def driven(angle: sympy.Expr) -> kc.Mechanism:
    m = kc.Mechanism("driven")
    m.add(kc.AbsoluteAngle("motor", m.body("arm"), angle))
    return m


@pytest.mark.parametrize(
    "of", [sympy.sin, sympy.tan, lambda e: sympy.exp(e) - 1, lambda e: e**3 + e]
)
def test_a_driver_in_another_form(of: Callable[[Any], Any]) -> None:
    names = "x_arm y_arm phi_arm"
    turn = sympy.Symbol("phi_arm") - t**2 / 3
    assert kc.compare(driven(t**2 / 3), **derived([of(turn)], names)).equal
    assert not kc.compare(driven(t**2 / 3), **derived([of(turn + t / 9)], names)).equal
    assert not kc.compare(driven(t**2 / 3), Phi=[turn**2]).equal


def test_that_a_root_may_exist_near_the_motion_only() -> None:
    turn = sympy.Symbol("phi_arm") - t**2 / 3
    for equation in (sympy.asin(turn), sympy.acos(turn + sympy.Rational(1, 2)) - sympy.pi / 3):
        assert kc.compare(driven(t**2 / 3), **derived([equation], "x_arm y_arm phi_arm")).equal


@pytest.mark.slow
def test_numbers_for_parameters() -> None:
    number = {a: 200}
    Phi_q, gamma = MODEL.Phi_q.subs(number), MODEL.gamma.subs(number)
    report = kc.compare(MODEL, Phi_q=Phi_q, gamma=gamma)
    assert (report.equal, report.conventions[0].kind) == (True, "numbers for parameters")
    report = kc.compare(MODEL, Phi_q=MODEL.Phi_q.subs({a: 201}))
    assert not report.equal


@pytest.fixture(scope="module")
def four_bar(example_named: Any) -> Any:
    return example_named("four_bar")


@pytest.fixture(scope="module")
def printed(four_bar: Any) -> dict[str, Any]:
    """A state of the motion, and what a program prints there with four decimals."""
    module, solution = four_bar.module, four_bar.solution
    q, q_dot, now = solution.q[30], solution.q_dot[30], solution.t[30]
    return {
        "states": {"q": q, "q_dot": q_dot, "t": now},
        "Phi_q": np.round(module.Phi_q(q, now), 4),
        "gamma": np.round(module.gamma(q, q_dot, now), 4),
    }


def test_a_print_out_of_four_decimals(four_bar: Any, printed: dict[str, Any]) -> None:
    report = kc.compare(four_bar.model, **printed)
    assert report.equal
    assert {item.kind for item in report.conventions} == {"rounded numbers"}
    assert not kc.compare(four_bar.model, **printed, strict=True).equal
    listed = {**printed, "Phi_q": printed["Phi_q"].tolist()}
    assert kc.compare(four_bar.model, **listed).equal


def test_that_a_mistake_in_a_print_out_is_named(four_bar: Any, printed: dict[str, Any]) -> None:
    Phi_q = printed["Phi_q"].copy()
    Phi_q[1, 2] *= -1
    report = kc.compare(four_bar.model, **{**printed, "Phi_q": Phi_q})
    (entry,) = report.different
    assert (entry.row, entry.column, entry.diagnoses[0].kind) == ("A.y", "phi_crank", "sign")
    Phi_q[1, 2] = -Phi_q[1, 2] + 0.001
    assert len(kc.compare(four_bar.model, **{**printed, "Phi_q": Phi_q}).different) == 1


def test_that_a_formula_may_have_rounded_numbers() -> None:
    m = kc.Mechanism("arm")
    m.add(kc.Revolute("O", m.ground, (0, 0), m.body("arm"), (sympy.sqrt(2) / 2, 0.25)))
    for number, is_right in (("0.7071", True), ("0.7072", False), ("0.71", False)):
        text = (
            f"[[-1, 0, {number}*sin(phi_arm) + 0.25*cos(phi_arm)], [0, -1, "
            f"-{number}*cos(phi_arm) + 0.25*sin(phi_arm)]]"
        )
        assert kc.compare(m, Phi_q=text).equal == is_right


def test_functions_of_single_precision_and_differences(four_bar: Any) -> None:
    module = four_bar.module

    def gamma(q: Any, q_dot: Any, t: float, step: float = 1e-4) -> Any:
        ahead, here, behind = (module.Phi(q + h * q_dot, t + h) for h in (step, 0, -step))
        return -(ahead - 2 * here + behind) / step**2

    def Phi_q(q: Any, t: float) -> Any:
        return np.asarray(module.Phi_q(q, t), dtype=np.float32)

    report = kc.compare(four_bar.model, Phi_q=Phi_q, gamma=gamma)
    assert (report.equal, report.verdict) == (True, "equal up to convention")
    assert not kc.compare(four_bar.model, gamma=lambda q, q_dot, t: -gamma(q, q_dot, t)).equal


def test_that_functions_get_copies_of_states(four_bar: Any) -> None:
    def Phi_q(q: Any, t: float) -> Any:
        q[2] = 0.0
        return four_bar.module.Phi_q(q, t)

    wrong = kc.compare(four_bar.model, Phi_q=Phi_q)
    assert {entry.column for entry in wrong.different} == {"phi_crank"}
    assert kc.compare(four_bar.model, Phi_q=lambda q, t: Phi_q(q.copy(), t)).equal is False
    assert kc.compare(four_bar.model, Phi_q=four_bar.module.Phi_q).equal
