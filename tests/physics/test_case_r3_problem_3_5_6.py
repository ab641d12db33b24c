"""R3: Newton's iterates, the motion, the closed form, and the lock-up at t = 4.5."""

import numpy as np
import pytest
import sympy

import kincompile as kc

START = (0.2, 0.2, np.pi / 4)


@pytest.fixture(scope="module")
def problem(example_named):
    return example_named("problem_3_5_6")


def test_the_formulas_by_hand(problem):
    t, (x2, y2, phi3), (x2_dot, y2_dot, phi3_dot) = kc.t, problem.model.q, problem.model.q_dot
    quarter = sympy.Rational(1, 4)
    sin, cos = sympy.sin(phi3), sympy.cos(phi3)
    by_hand = {
        "Phi": [
            x2 + quarter * sin - sympy.Rational(3, 5),
            y2 - quarter * cos,
            x2**2 + y2**2 - (t / 10 + sympy.Rational(2, 5)) ** 2,
        ],
        "Phi_q": [[1, 0, quarter * cos], [0, 1, quarter * sin], [2 * x2, 2 * y2, 0]],
        "nu": [0, 0, (t + 4) / 50],
        "gamma": [
            phi3_dot**2 * sin / 4,
            -(phi3_dot**2) * cos / 4,
            -2 * x2_dot**2 - 2 * y2_dot**2 + sympy.Rational(1, 50),
        ],
    }
    for name, formula in by_hand.items():
        difference = getattr(problem.model, name) - sympy.Matrix(formula)
        assert sympy.simplify(difference).is_zero_matrix, name


def test_newton_makes_the_printed_iterates(problem, printed):
    result = kc.newton(problem.module, 0.0, START)
    iterates = (
        "0.4232233047, 0.1767766953, 0.7853981634",
        "0.38125, 0.1348033906, 1.0228350305",
        "0.3813100372, 0.1215644989, 1.06347535",
        "0.3812500401, 0.1210317905, 1.065432028",
        "0.38125, 0.1210307296, 1.0654358165",
    )
    for k, text in enumerate(iterates, start=1):
        printed(text, result.iterates[k])


def test_newton_makes_the_printed_corrections_and_residuals(problem, printed):
    result = kc.newton(problem.module, 0.0, START)
    assert result.iterations == 6
    corrections = "0.2244281, 0.2447443, 0.0427423, 2.028785e-3, 3.93443e-6, 1.511e-11"
    printed(corrections, result.corrections)
    residuals = "0.2382603, 0.0503680, 7.86896e-3, 2.70813e-4, 5.58e-7, 2.1e-12"
    printed(residuals, result.residuals[:-1])


def test_newton_converges_quadratically(problem):
    corrections = kc.newton(problem.module, 0.0, START).corrections
    ratios = corrections[1:] / corrections[:-1] ** 2
    assert np.all(ratios[1:] < 2)
    order = np.diff(np.log(corrections))[1:] / np.diff(np.log(corrections))[:-1]
    np.testing.assert_allclose(order[-2:], 2, atol=0.1)


@pytest.mark.parametrize(
    ("t", "q", "q_dot", "q_ddot"),
    [
        (
            0, "0.38125, 0.1210307296, 1.0654358165",
            "0.0666666667, 0.1204928152, -0.5508242981",
            "0.0166666667, -0.1265557077, 0.4106701156",
        ),
        (
            1, "0.45625, 0.2045383521, 0.612604148",
            "0.0833333333, 0.0585668484, -0.4074215542",
            "0.0166666667, -0.0390082679, 0.0351754557",
        ),
        (
            2, "0.5479166667, 0.2445144707, 0.2098705923",
            "0.1, 0.0213007161, -0.4089737499",
            "0.0166666667, -0.0392028534, -0.0325348143",
        ),
        (
            4, "0.78125, 0.1721872164, -0.8110343943",
            "0.1333333333, -0.1403511083, -0.7743509426",
            "0.0166666667, -0.2351919356, -0.7279732044",
        ),
    ],
)  # fmt: skip
def test_the_motion(problem, printed, t, q, q_dot, q_ddot):
    solution = problem.solution
    k = np.flatnonzero(solution.t == t).item()
    printed(q, solution.q[k])
    printed(q_dot, solution.q_dot[k])
    printed(q_ddot, solution.q_ddot[k])


def determinant(module, solution, k):
    return np.linalg.det(module.Phi_q(solution.q[k], solution.t[k]))


def test_the_determinant_at_the_start(problem, printed):
    printed("-0.1452368755", determinant(problem.module, problem.solution, 0))


def test_the_closed_form(problem):
    t, (x2, y2, phi3) = problem.solution.t, problem.solution.q.T
    sin = (0.4225 - (t / 10 + 0.4) ** 2) / 0.3
    np.testing.assert_allclose(np.sin(phi3), sin, atol=1e-14)
    np.testing.assert_allclose(x2, 0.6 - sin / 4, atol=1e-14)
    np.testing.assert_allclose(y2, np.sqrt(1 - sin**2) / 4, atol=1e-14)


def test_the_other_branch(problem, printed):
    first = kc.solve(problem.module, 0.0)
    second = kc.solve(problem.module, 0.0, guess=(0.38, -0.12, 2.1), throw=True)
    printed("0.38125, -0.1210307296, 2.0761568371", second.q[0])
    mirror = [1, -1, -1]
    np.testing.assert_allclose(second.q_dot, first.q_dot * mirror, atol=1e-14)
    np.testing.assert_allclose(second.q_ddot, first.q_ddot * mirror, atol=1e-13)


def test_near_the_lock_up(problem, printed):
    solution = kc.solve(problem.module, np.append(np.arange(0, 4.45, 0.1), 4.49), throw=True)
    printed("-5.3257543665", solution["phi3_dot"][-1])
    printed("-266.0025", solution["phi3_ddot"][-1])
    # The reference case prints -0.0318829; det = -0.3 cos(phi3) by hand decides the last digit.
    sin = (0.4225 - 0.849**2) / 0.3
    det = determinant(problem.module, solution, -1)
    np.testing.assert_allclose(det, -0.3 * np.sqrt(1 - sin**2), rtol=1e-10)
    printed("-0.0318828", det)


def test_that_the_lock_up_itself_is_singular(problem):
    solution = kc.solve(problem.module, np.linspace(0, 5, 51))
    assert not solution.success
    before, at, after = np.split(solution.status, [45, 46])
    assert solution.t[45] == 4.5
    assert np.all(before == kc.Status.CONVERGED)
    assert at == kc.Status.SINGULAR
    assert np.all(after == kc.Status.NOT_REACHED)
    assert np.isnan(solution.q[46:]).all()
    assert "t = 4.5" in solution.message
    # sin(phi3) = -1 is a double root: the position is known to half the digits only.
    np.testing.assert_allclose(solution.q[45], [0.85, 0, -np.pi / 2], atol=1e-6)


@pytest.mark.parametrize("step", [0.04, 0.11, 0.35, 0.7])
def test_that_the_lecture_s_end_time_fails_at_the_first_point_past_the_lock_up(problem, step):
    t = np.arange(0, 5.001, step)
    solution = kc.solve(problem.module, t)
    assert not solution.success
    np.testing.assert_array_equal(solution.status == kc.Status.CONVERGED, t < 4.5)
    first = np.argmax(t > 4.5)
    assert solution.status[first] == kc.Status.LOCK_UP
    assert f"t = {t[first]:.10g}" in solution.message


def test_the_lock_up_backwards(problem):
    t = np.arange(0, -1, -0.07)
    solution = kc.solve(problem.module, t)
    assert not solution.success
    np.testing.assert_array_equal(solution.status == kc.Status.CONVERGED, t > -0.5)
