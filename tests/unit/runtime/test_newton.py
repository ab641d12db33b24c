import math

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.errors import InputError
from kincompile.runtime.newton import newton
from kincompile.runtime.status import Status

START = (0.2, 0.2, math.pi / 4)  # of case R3


def orders(corrections):
    """Order of convergence seen in each three successive corrections."""
    logs = np.log(corrections)
    return np.diff(logs)[1:] / np.diff(logs)[:-1]


def test_r3_has_the_printed_iterates(problem_3_5_6):
    result = newton(problem_3_5_6, 0, START)
    printed = [
        (0.2, 0.2, math.pi / 4),
        (0.4232233047, 0.1767766953, 0.7853981634),
        (0.38125, 0.1348033906, 1.0228350305),
        (0.3813100372, 0.1215644989, 1.06347535),
        (0.3812500401, 0.1210317905, 1.065432028),
        (0.38125, 0.1210307296, 1.0654358165),
        (0.38125, 0.1210307296, 1.0654358165),
    ]
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(result.iterates, printed, rtol=0, atol=5.1e-11)
    np.testing.assert_array_equal(result.q, result.iterates[-1])


def test_r3_has_the_printed_corrections_and_residuals(problem_3_5_6):
    result = newton(problem_3_5_6, 0, START)
    corrections = [f"{norm:.7g}" for norm in result.corrections[:4]]
    assert corrections == ["0.2244281", "0.2447443", "0.04274234", "0.002028785"]
    assert [f"{norm:.4g}" for norm in result.corrections[4:]] == ["3.934e-06", "1.511e-11"]
    printed = [0.2382603, 0.0503680, 7.86896e-3, 2.70813e-4, 5.58e-7, 2.1e-12]
    np.testing.assert_allclose(result.residuals[:6], printed, rtol=1e-2)
    np.testing.assert_allclose(result.residuals[:4], printed[:4], rtol=2e-6)
    assert result.residuals[6] < 1e-15
    assert result.residual < 1e-15
    assert result.iterations == 6


def test_newton_converges_with_order_two(problem_3_5_6):
    corrections = newton(problem_3_5_6, 0, START).corrections
    np.testing.assert_allclose(orders(corrections)[-2:], 2, atol=0.1)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("= 0.25 * np.sin(phi3)\n", "= -0.25 * np.sin(phi3)\n"),
        ("2] = 0.25 * np.cos(phi3)", "2] = 0.26 * np.cos(phi3)"),
        ("= 2 * x2\n", "= 2.02 * x2\n"),
        ("= 2 * y2\n", "= -2 * y2\n"),
    ],
)
def test_a_wrong_jacobian_does_not_converge_with_order_two(edited, old, new):
    result = newton(edited("problem_3_5_6", (old, new)), 0, START)
    seen = orders(result.corrections)[-2:]
    assert result.status is not Status.CONVERGED or np.max(np.abs(seen - 2)) > 0.5


def test_the_last_correction_is_applied(problem_3_5_6):
    result = newton(problem_3_5_6, 0, START, tolerance=1e-2)
    assert result.iterations == 4
    assert result.corrections[-1] == pytest.approx(2.028785e-3, rel=1e-6)
    np.testing.assert_allclose(result.q, (0.3812500401, 0.1210317905, 1.065432028), atol=1e-10)


def test_the_correction_is_measured_against_the_position(four_bar):
    p = four_bar.DEFAULTS * (1e6, 1e6, 1e6, 1e6, 1)
    result = newton(four_bar, 1.0, four_bar.GUESS * np.where(np.arange(9) % 3 < 2, 1e6, 1), p)
    bound = 1e-10 * (1 + np.linalg.norm(result.q))
    assert 1e-10 < result.corrections[-1] <= bound < result.corrections[-2]


def test_the_other_branch_is_found_from_a_guess_near_it(problem_3_5_6):
    result = newton(problem_3_5_6, 0, {"y2": -0.2, "phi3": 2.0})
    np.testing.assert_allclose(result.q, (0.38125, -0.1210307296, 2.0761568371), atol=1e-10)


def test_no_iteration_is_wasted_on_an_exact_guess(pendulum):
    result = newton(pendulum, 0, None)
    assert result.status is Status.CONVERGED
    assert result.iterations == 1


# Starts of the four-bar from which the plain iteration never ends.
BAD_GUESSES = [
    {"phi_coupler": 3.4, "phi_rocker": 5.5},
    {"phi_coupler": -2.7, "phi_rocker": -1.6},
]


@pytest.mark.parametrize("guess", BAD_GUESSES)
def test_safeguards_rescue_a_bad_guess(four_bar, guess, monkeypatch):
    result = newton(four_bar, 0, guess)
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(four_bar.Phi(result.q, 0), 0, atol=1e-12)
    steps = np.abs(np.diff(result.iterates, axis=0))[:, 2::3]
    assert steps.max() <= 0.5 + 1e-12
    assert result.iterates[0, [5, 8]].tolist() == list(guess.values())
    monkeypatch.setattr("kincompile.runtime.start.safeguarded_step", lambda *_: Status.SINGULAR)
    assert newton(four_bar, 0, guess).status is not Status.CONVERGED


@pytest.mark.every(4)
@pytest.mark.parametrize("turns", [-2, -1, 1, 3])
@pytest.mark.parametrize("longer", [0.99, 1.0, 1.01])
def test_that_a_driven_angle_may_be_guessed_whole_turns_away(four_bar, turns, longer):
    time = math.radians(-2) / 1.5  # the driver says -2 degrees: the guess is 358, 718, ... off
    p = four_bar.DEFAULTS * [1, longer, 1, 1, 1]
    for assembly in kc.assemblies(four_bar, time, p):
        guess = assembly + [0.3, -0.3, 0.1] * 3
        guess[2] += 2 * math.pi * turns
        found = newton(four_bar, time, guess, p)
        assert found.status is Status.CONVERGED
        np.testing.assert_allclose(found.q, assembly, atol=1e-9)


def test_safeguards_leave_a_singular_guess(four_bar):
    stretched = {"phi_coupler": 0.0, "phi_rocker": math.pi, "x_rocker": 11, "y_rocker": 0}
    q = newton(four_bar, 0, stretched | {"x_coupler": 23, "y_coupler": 0}).q
    np.testing.assert_allclose(four_bar.Phi(q, 0), 0, atol=1e-12)


def test_a_mechanism_that_cannot_be_assembled_is_not_converged(problem_3_5_6):
    result = newton(problem_3_5_6, 4.7, START)  # beyond the lock-up at 4.5
    assert result.status is Status.NOT_CONVERGED
    assert result.residual > 1e-3


def test_the_cap_is_reported(problem_3_5_6):
    result = newton(problem_3_5_6, 0, START, max_iterations=4)
    assert result.status is Status.NOT_CONVERGED
    assert result.iterations <= 4
    assert len(result.iterates) == len(result.residuals) == result.iterations + 1


def test_a_double_root_is_singular(problem_3_5_6):
    result = newton(problem_3_5_6, 4.5, START)
    assert result.status is Status.SINGULAR


@pytest.mark.parametrize("method", ["march", "grid"])
def test_a_pole_is_no_root(method):
    # There a residual of 1.6e16 is small beside the slope of 2.7e32.
    x = sympy.Symbol("x")
    tangent = kc.ConstraintSystem("tangent", "x", [sympy.tan(x) - kc.t], guess=[math.pi / 2])
    solution = kc.solve(kc.compile(tangent), [0.5, 1.0], method=method)
    np.testing.assert_allclose(np.tan(solution.q[:, 0]), [0.5, 1.0], rtol=1e-12)


@pytest.mark.parametrize("equation", ["math.sqrt(t - 1)", "math.nan * t", "1 / (t - t)"])
def test_an_equation_that_is_not_finite_is_reported(edited, equation):
    module = edited("pendulum", ("phi - phi_0 - omega * t", f"phi - {equation}"))
    result = newton(module, 0, None)
    assert result.status is Status.NOT_FINITE
    assert math.isnan(result.residual)
    np.testing.assert_array_equal(result.iterates, [module.GUESS])


def test_a_tiny_mechanism_is_not_done_before_it_starts(edited):
    # Lengths below the tolerance: every correction is small, and the point is still wrong.
    module = edited(
        "problem_3_5_6",
        ("(t / 10 + 0.4) ** 2", "(1e-10 * (t / 10 + 0.4)) ** 2"),
        ("0.6", "0.6e-10"),
        ("0.25", "0.25e-10"),
        ("[0.2, 0.2, ", "[0.2e-10, 0.2e-10, "),
    )
    result = newton(module, 0, None)
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(result.q[:2], (0.38125e-10, 0.1210307296e-10), rtol=1e-8)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-13, 1e-15, 1e-17])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_a_well_converged_point_is_never_rejected(four_bar, size, tolerance):
    p = four_bar.DEFAULTS * (size, size, size, size, 1)
    guess = four_bar.GUESS * np.where(np.arange(9) % 3 < 2, size, 1)
    result = newton(four_bar, 1.0, guess, p, tolerance=tolerance)
    assert result.status is Status.CONVERGED
    assert result.residual < 1e-5 * math.sqrt(tolerance) * size + 1e-14 * size


def test_an_ill_conditioned_point_in_millimetres_is_accepted(four_bar):
    p = four_bar.DEFAULTS * (1000, 1000, 1000, 1000, 1)
    guess = four_bar.GUESS * np.where(np.arange(9) % 3 < 2, 1000, 1)
    result = newton(four_bar, 1.0, guess, p)
    assert np.linalg.cond(four_bar.Phi_q(result.q, 1.0, p)) > 4e5
    assert result.status is Status.CONVERGED


def test_newton_works_at_one_time(problem_3_5_6):
    with pytest.raises(InputError, match="newton works at one time, got 2: use solve for a grid"):
        newton(problem_3_5_6, [0, 1], START)  # type: ignore[arg-type]  # what is refused


def test_that_equations_need_no_value_on_the_other_side():
    x = sympy.Symbol("x")
    module = kc.compile(kc.ConstraintSystem("log", ["x"], [x * sympy.log(x) + 0.3]))
    found = kc.newton(module, 0.0, [0.3717418546365915])
    assert found.status is kc.Status.CONVERGED
    assert found.q * np.log(found.q) == pytest.approx(-0.3)
