"""The state at which the numbers of a page are taken."""

from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.derivations.evaluation import evaluation
from kincompile.errors import InputError
from kincompile.report.document import CrossReference, Math, Table, Verbatim
from kincompile.report.formulas import Decimal


def number(run: Any) -> float:
    assert isinstance(run, Math)
    assert isinstance(run.formula, Decimal)
    return run.formula.value


def table(derivation: Any, anchor: str, sections_of: Any, k: int = 0) -> Table:
    section = next(item for item in sections_of(derivation) if item.anchor == anchor)
    found = [block for block in section.blocks if isinstance(block, Table)][k]
    assert isinstance(found, Table)
    return found


def test_that_the_default_is_an_assembled_state_where_nothing_is_special(
    example_named: Any,
) -> None:
    example = example_named("four_bar")
    chosen = evaluation(example.model.system(), None)
    t = 0.382 * example.model.end
    assert chosen.origin == f"the assembled state at t = {t:.3g}"
    solution = kc.solve(example.module, np.linspace(0, t, 50))
    np.testing.assert_allclose(chosen.q, solution.q[-1], atol=1e-9)
    np.testing.assert_allclose(chosen.q_dot, solution.q_dot[-1], atol=1e-9)
    np.testing.assert_allclose(chosen.q_ddot, solution.q_ddot[-1], atol=1e-9)
    # No angle is 0 or a right one, no entry of Phi_q that varies is zero: a wrong sign shows.
    angles = chosen.q[2::3]
    assert np.min(np.abs(np.sin(2 * angles))) > 1e-3


def test_that_time_zero_serves_where_the_motion_does_not_reach_the_generic_time() -> None:
    m = kc.Mechanism("short", end=10.0)
    arm = m.body("arm", guess=(0, 1, 1.5))
    m.add(kc.Revolute("A", m.ground, (0, 0), arm, (-1, 0)))
    m.add(kc.AbsoluteX("reach", arm, (0, 0), kc.t))  # at most 1
    assert evaluation(m.system(), None).origin == "the assembled state at t = 0"


def test_that_newton_starts_from_a_moved_position_where_the_guess_is_assembled() -> None:
    m = kc.Mechanism("pendulum")
    bob = m.body("bob", guess=(1, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), bob, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bob, kc.t / 3))
    chosen = evaluation(m.system(), 0.0)
    assert chosen.assembly is not None
    assert chosen.assembly.iterations >= 3
    assert chosen.start.startswith("From the assembled position with coordinates moved by some")
    np.testing.assert_allclose(chosen.assembly.q, (1, 0, 0), atol=1e-9)
    np.testing.assert_allclose(chosen.q, (1, 0, 0), atol=1e-9)


def test_that_another_time_may_be_chosen(example_named: Any) -> None:
    example = example_named("problem_3_5_6")
    chosen = evaluation(example.model.system(), 1.0)
    expected = [0.45625, 0.2045383521, 0.612604148]  # case R3 at t = 1
    np.testing.assert_allclose(chosen.q, expected, atol=1e-9)
    np.testing.assert_allclose(
        chosen.q_ddot, [0.0166666667, -0.0390082679, 0.0351754557], atol=1e-9
    )


def test_that_given_values_are_taken_as_they_are(example_named: Any) -> None:
    system = example_named("four_bar").model.system()
    given = {"phi_crank": 0.3, "x_crank_dot": 2.0, "a": 4.0, "t": 0.5}
    chosen = evaluation(system, given)
    assert chosen.origin == "the state that was asked for"
    assert not chosen.is_assembled
    assert {name: chosen.values[name] for name in given} == given
    assert chosen.values["x_coupler"] == 20.0  # the guess
    assert np.max(np.abs(chosen.Phi)) > 0.1


def test_that_a_parameter_alone_leaves_the_mechanism_assembled(example_named: Any) -> None:
    chosen = evaluation(example_named("four_bar").model.system(), {"omega": 3.0})
    assert chosen.is_assembled
    assert chosen.values["phi_crank_dot"] == pytest.approx(3.0)


def test_that_the_guess_serves_where_the_mechanism_does_not_assemble(
    example_named: Any, sections_of: Any
) -> None:
    derivation = kc.derivation(example_named("problem_3_5_6").model, 7.0)
    assert "the guess, because the mechanism does not assemble at t = 7" in derivation.summary
    rates = next(item for item in sections_of(derivation) if item.anchor == "rates")
    assert "Not solved" in rates.blocks[0].runs[0]


def test_that_the_six_corrections_of_problem_3_5_6_are_shown(
    example_named: Any, sections_of: Any
) -> None:
    derivation = kc.derivation(example_named("problem_3_5_6").model, 0)
    shown = table(derivation, "newton", sections_of)
    corrections = [number(row[-1][0]) for row in shown.rows[:6]]
    expected = [0.2244281, 0.2447443, 0.0427423, 2.028785e-3, 3.93443e-6, 1.511e-11]
    np.testing.assert_allclose(corrections, expected, rtol=2e-3)
    np.testing.assert_allclose(corrections[:4], expected[:4], rtol=1e-5)
    iterates = [[number(cell[0]) for cell in row[1:4]] for row in shown.rows]
    np.testing.assert_allclose(iterates[1], [0.4232233047, 0.1767766953, 0.7853981634], atol=1e-9)
    np.testing.assert_allclose(iterates[3], [0.3813100372, 0.1215644989, 1.06347535], atol=1e-8)
    assert len(shown.rows) == 7


def test_that_row_offsets_are_those_of_the_lecture(sections_of: Any) -> None:
    m = kc.Mechanism("offsets")
    one, two, three = (m.body(name, (k, 0, 0)) for k, name in enumerate(("one", "two", "three")))
    m.add(kc.Revolute("A", two, (-1, 0), one, (0, 1)))
    m.add(kc.Distance("B", one, (1, 0), m.ground, (0, 3), 2))
    m.add(kc.Translational("C", three, (0, 0), (1, 0), two, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("D", three, 0))
    derivation = kc.derivation(m)  # case R0: three equations are missing, the page says so
    rows = table(derivation, "offsets", sections_of).rows
    assert [row[4][0] for row in rows] == ["1", "3", "4", "6"]
    expected = [CrossReference(f"constraint-{name}", Verbatim(name)) for name in "ABCD"]
    assert [row[0][0] for row in rows] == expected
    mobility = next(item for item in sections_of(derivation) if item.anchor == "mobility")
    assert "3 more equations are needed" in mobility.blocks[-1].runs[0]


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ({"phi_crnak": 1.0}, "phi_crnak.*did you mean 'phi_crank'"),
        ({"phi_crank": float("nan")}, "phi_crank: nan is not a finite number"),
        ({"phi_crank": "a lot"}, "phi_crank: 'a lot' is not a finite number"),
        (float("inf"), "t: inf is not a finite number"),
        ({"phi_crank_dot": 1e200}, "no finite values"),
    ],
)
def test_that_a_wrong_state_is_refused(state: Any, message: str, example_named: Any) -> None:
    with pytest.raises(InputError, match=message):
        kc.derivation(example_named("four_bar").model, state)
