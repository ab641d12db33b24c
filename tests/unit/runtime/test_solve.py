import itertools
import math
import warnings

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.errors import AssemblyWarning, SolveError
from kincompile.runtime.engine.code import Kind, code_of
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.solve import solve
from kincompile.runtime.status import Status
from tests.trust.test_passages import FLAT, row_of_parallelograms

DIGITS = 5.1e-11  # ten decimals printed


def close(actual, printed):
    np.testing.assert_allclose(actual, printed, rtol=0, atol=DIGITS)


# Reference cases


def test_r1_simple_pendulum(pendulum):
    solution = solve(pendulum, [0, 0.37])
    close(solution.q[0], (1, 0, math.pi / 2))
    close(solution.q[1], (1.7289686274, 1.6845471059, 3.8955748905))
    np.testing.assert_allclose(solution.q_dot[0], (6.283185307, 0, 6.283185307), atol=1e-9)
    close(solution.q_dot[1], (-4.301136318, 4.5802449692, 6.2831853072))
    close(solution.q_ddot[0], (0, 39.4784176044, 0))
    close(solution.q_ddot[1], (-28.7785278938, -27.0248365177, 0))


def test_r3_problem_3_5_6(problem_3_5_6):
    solution = solve(problem_3_5_6, [0, 1, 2, 4, 4.49])
    close(solution.q[0], (0.38125, 0.1210307296, 1.0654358165))
    close(solution.q[1], (0.45625, 0.2045383521, 0.612604148))
    close(solution.q[2], (0.5479166667, 0.2445144707, 0.2098705923))
    close(solution.q[3], (0.78125, 0.1721872164, -0.8110343943))
    close(solution.q_dot[0], (0.0666666667, 0.1204928152, -0.5508242981))
    close(solution.q_dot[1], (0.0833333333, 0.0585668484, -0.4074215542))
    close(solution.q_dot[2], (0.1, 0.0213007161, -0.4089737499))
    close(solution.q_dot[3], (0.1333333333, -0.1403511083, -0.7743509426))
    close(solution.q_ddot[0], (0.0166666667, -0.1265557077, 0.4106701156))
    close(solution.q_ddot[1], (0.0166666667, -0.0390082679, 0.0351754557))
    close(solution.q_ddot[2], (0.0166666667, -0.0392028534, -0.0325348143))
    close(solution.q_ddot[3], (0.0166666667, -0.2351919356, -0.7279732044))
    close(solution["phi3_dot"][4], -5.3257543665)
    assert solution["phi3_ddot"][4] == pytest.approx(-266.0025, abs=5e-5)


def test_r3_on_the_other_branch(problem_3_5_6):
    first = solve(problem_3_5_6, 0)
    other = solve(problem_3_5_6, 0, guess={"y2": -0.2, "phi3": 2.0})
    close(other.q[0], (0.38125, -0.1210307296, 2.0761568371))
    np.testing.assert_allclose(other.q_dot[0], first.q_dot[0] * (1, -1, -1), atol=1e-12)
    np.testing.assert_allclose(other.q_ddot[0], first.q_ddot[0] * (1, -1, -1), atol=1e-12)


def test_r3_follows_the_closed_form(problem_3_5_6):
    t = np.linspace(0, 4.49, 30)
    phi = np.arcsin((0.4225 - (t / 10 + 0.4) ** 2) / 0.3)
    np.testing.assert_allclose(solve(problem_3_5_6, t)["phi3"], phi, atol=1e-10)


def test_r4_example_3_7_5(example_3_7_5):
    solution = solve(example_3_7_5, [2, 4, 6])
    close(solution.q[0], (2.2802389662, 0.5235987756, 1.2309594173))
    close(solution.q[1], (1.7247448714, 1.0471975512, 0.9553166181))
    close(solution.q[2], (1.1180339887, math.pi / 2, 0.8410686706))
    close(solution.q_dot[0], (-0.2110590583, 0.2617993878, -0.1603187288))
    close(solution.q_dot[1], (-0.3192849817, 0.2617993878, -0.1068791525))
    close(solution.q_dot[2], (-0.2617993878, 0.2617993878, 0))
    close(solution.q_ddot[0], (-0.0881321441, 0, 0.0151451046))
    close(solution.q_ddot[1], (-0.0132837872, 0, 0.0403869456))
    close(solution.q_ddot[2], (0.0613030732, 0, 0.0613030732))


def test_r4_with_a_short_rod(example_3_7_5):
    solution = solve(example_3_7_5, [1, 1.9, 1.99, 1.999], {"l": 0.5})
    close(solution.q[0], (1.3937256649, 0.2617993878, 1.0267082201))
    close(solution.q_dot[2, [0, 2]], (-2.5056592734, -4.7723637897))
    np.testing.assert_allclose(solution.q_ddot[2], (-119.3730283571, 0, -237.5378012678), atol=1e-8)
    assert solution["phi2_dot"][3] == pytest.approx(-15.0608015873, abs=1e-8)


def test_r4_just_before_its_bifurcation(example_3_7_5):
    solution = solve(example_3_7_5, np.linspace(0, 5.9, 60), {"l": 1})
    assert solution.success
    close(solution.q_dot[-1, [0, 2]], (-0.5234193514, -0.2617993878))


def test_r11_four_bar(four_bar):
    solution = solve(four_bar, np.linspace(0, 10, 1001))
    t0 = (5, 0, 0, 21.3, 6.4272855857, 0.5171520074, 26.3, 6.4272855857, 3.9369914838)
    close(solution.q[0], t0)
    close(solution.q_dot[0], (0, 7.5, 1.5, 9.6409283785, -1.95, -1.5, 9.6409283785, -9.45, -1.5))
    q_ddot = (-11.25, 0, 0, -76.275, 35.3815770232, 4.4108822647)
    close(solution.q_ddot[0], (*q_ddot, -65.025, 35.3815770232, 7.9115824748))
    close(solution["phi_coupler"][[100, 500, 1000]], (0.2762500015, 0.2485432987, 0.4383041956))
    close(solution["phi_rocker"][[500, 1000]], (4.2099970133, 4.9395937155))
    close(solution["phi_coupler_dot"][100], 0.1747221947)
    close(solution["phi_rocker_dot"][[100, 1000]], (0.9493170669, 0.7766003938))
    close(solution["phi_coupler_ddot"][100], 0.2801072825)
    close(solution["phi_rocker_ddot"][[100, 1000]], (-0.0477375696, -0.4745376691))


# Velocity and acceleration are derivatives of the motion


def difference_errors(module, t, h=1e-4):
    """Errors of q_dot and q_ddot against central differences of q and q_dot."""
    before, at, after = (solve(module, time) for time in (t - h, t, t + h))
    return (
        np.max(np.abs((after.q - before.q) / (2 * h) - at.q_dot)),
        np.max(np.abs((after.q_dot - before.q_dot) / (2 * h) - at.q_ddot)),
    )


@pytest.mark.parametrize("name", ["problem_3_5_6", "example_3_7_5", "four_bar"])
def test_velocity_and_acceleration_are_derivatives(name, request):
    errors = difference_errors(request.getfixturevalue(name), 0.7)
    assert max(errors) < 1e-5


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("(t + 4) / 50)", "-(t + 4) / 50)"),
        ("phi3_dot**2 * np.sin(phi3) / 4,", "-(phi3_dot**2) * np.sin(phi3) / 4,"),
        ("-(phi3_dot**2) * np.cos", "phi3_dot**2 * np.cos"),
        (" + 1 / 50", ""),
        ("-2 * x2_dot**2", "2 * x2_dot**2"),
    ],
)
def test_a_wrong_nu_or_gamma_is_noticed(edited, old, new):
    assert max(difference_errors(edited("problem_3_5_6", (old, new)), 0.7)) > 1e-3


# The way through the grid


def test_one_time_gives_one_row(pendulum):
    for t in (0, 0.0, np.float32(0), [0], np.array(0)):
        solution = solve(pendulum, t)
        assert solution.q.shape == solution.q_dot.shape == solution.q_ddot.shape == (1, 3)
        assert solution.t.shape == solution.status.shape == solution.residual.shape == (1,)


def test_a_falling_grid_gives_the_same_motion(four_bar):
    t = np.linspace(0, 4, 41)
    rising = solve(four_bar, t)
    falling = solve(four_bar, t[::-1], guess=rising.q[-1])
    np.testing.assert_allclose(falling.q[::-1], rising.q, atol=1e-10)
    np.testing.assert_allclose(falling.q_ddot[::-1], rising.q_ddot, atol=1e-9)


def test_a_time_may_repeat(four_bar):
    solution = solve(four_bar, [0, 1, 1, 2])
    assert solution.success
    np.testing.assert_allclose(solution.q[1], solution.q[2], atol=1e-12)


def test_the_predictor_saves_iterations(four_bar):
    solution = solve(four_bar, np.linspace(0, 1, 1001))
    assert solution.iterations[1:].max() <= 2


def test_the_predictor_is_exact_for_a_quadratic_motion(edited):
    module = edited(
        "pendulum",
        (
            "x + math.cos(phi) - 1, y + math.sin(phi) - 1, phi - phi_0 - omega * t",
            "x, y, phi - t*t",
        ),
        ("[1.0, 0.0, -math.sin(phi)], [0.0, 1.0, math.cos(phi)]", "[1.0, 0, 0], [0, 1.0, 0]"),
        ("np.array([0.0, 0.0, p[0]])", "np.array([0.0, 0.0, 2 * t])"),
        ("[square * math.cos(q[2]), square * math.sin(q[2]), 0.0]", "[0.0, 0.0, 2.0]"),
    )
    loose = solve(module, [0, 0.3, 0.6], tolerance=1e-3)
    np.testing.assert_allclose(loose["phi_rod"], (0, 0.09, 0.36), atol=1e-15)
    assert loose.iterations[1:].tolist() == [1, 1]


@pytest.mark.parametrize("points", [2, 4, 9])
def test_sub_steps_keep_a_coarse_grid_on_its_branch(four_bar, points):
    fine = solve(four_bar, np.linspace(0, 12, 1201))
    coarse = solve(four_bar, np.linspace(0, 12, points))  # up to 2.9 revolutions in a step
    assert coarse.success
    np.testing.assert_allclose(coarse.q, fine.q[:: 1200 // (points - 1)], atol=1e-9)


def test_sub_steps_turn_the_corner_near_a_bifurcation(example_3_7_5):
    # For l slightly above 1 the rod comes within 0.03 rad of the other branch and turns back.
    rod, t = 1.0005, np.linspace(0, 24, 13)
    solution = solve(example_3_7_5, t, {"l": rod})
    assert solution.success
    phi2 = np.arccos(np.sin(math.pi * t / 12) / rod)
    np.testing.assert_allclose(solution["phi2"], phi2, atol=1e-9)


def test_millimetres_give_the_same_motion_as_metres(four_bar):
    t, lengths = np.linspace(0, 4, 21), np.arange(9) % 3 < 2
    metres = solve(four_bar, t)
    scale = np.where(lengths, 1000, 1)
    p = four_bar.DEFAULTS * (1000, 1000, 1000, 1000, 1)
    millimetres = solve(four_bar, t, p, four_bar.GUESS * scale)
    assert millimetres.success
    np.testing.assert_allclose(millimetres.q / scale, metres.q, atol=1e-9)
    np.testing.assert_allclose(millimetres.q_ddot / scale, metres.q_ddot, atol=1e-8)


@pytest.mark.parametrize("size", [1e-5, 1, 1e5])
def test_a_guess_of_zeros_is_assembled(edited, size):
    guess = "GUESS = np.array([5, 0, 0, 20, 10, math.pi / 4, 20, 9, 1.5 * math.pi])"
    module = edited("four_bar", (guess, "GUESS = np.zeros(9)"))
    p = module.DEFAULTS * (size, size, size, size, 1)
    with pytest.warns(AssemblyWarning, match="there is no guess of coupler, rocker"):
        solution = solve(module, np.linspace(0, 1, 5), p)
    assert solution.success
    for t, q in zip(solution.t, solution.q, strict=True):
        np.testing.assert_allclose(module.Phi(q, t, p), 0, atol=1e-10 * size)


def test_parameters_and_guesses_come_as_vectors_or_by_name(pendulum):
    by_name = solve(pendulum, 0.5, {"omega": 3.0}, {"x_rod": 1.1})
    vector = solve(pendulum, 0.5, [3.0, math.pi / 2], (1.1, 0, math.pi / 2))
    np.testing.assert_array_equal(by_name.q, vector.q)
    assert by_name["phi_rod"][0] == pytest.approx(math.pi / 2 + 1.5)
    assert by_name.parameters == {"omega": 3.0, "phi_0": math.pi / 2}


def test_the_start_that_a_module_keeps_is_of_what_it_depends_on(four_bar):
    far = kc.newton(four_bar, 0.7, None).q + 0.5
    given = [{}, {"p": {"a": 9.0}}, {"guess": far}, {"max_iterations": 9}, {"tolerance": 0.1}]
    times = (0.0, 0.7, np.linspace(0.7, 1, 3), 0.7)
    for t, own in itertools.product(times, (*given, *given[::-1])):
        kept = [solve(four_bar, t, **own) for _ in range(2)]
        code_of(four_bar).made.clear()
        fresh = solve(four_bar, t, **own)
        for found in kept:
            assert found.message == fresh.message
            for name in ("q", "q_dot", "q_ddot", "status", "residual", "iterations"):
                np.testing.assert_array_equal(getattr(found, name), getattr(fresh, name))
            found.q[:] = 7.0  # it is the caller's


def test_the_event_of_a_singular_start_is_the_callers():
    x = sympy.Symbol("x")
    module = kc.compile(kc.ConstraintSystem("meet", ["x"], [x**2 - kc.t**2], guess={"x": 0}))
    for _ in range(2):
        found = solve(module, [0.0, 0.1])
        assert (found.status[0], found.q[0, 0], found.events[0].q[0]) == (Status.SINGULAR, 0, 0)
        found.events[0].q[:] = 7.0


def test_another_thread_may_keep_a_start_while_a_module_is_asked_what_it_has(four_bar):
    code = code_of(four_bar)

    class Asked(Kind[object]):
        __hash__ = object.__hash__

        def __eq__(self, other: object) -> bool:
            code.made[Kind("late"), None] = None
            return False

    code.made[Kind("early"), None] = None
    assert not code.has(Asked("asked"))
    code.made.clear()


@pytest.mark.parametrize("angle", [0.0, 0.5, math.pi / 2, 2.0, math.pi, 5.0])
def test_a_start_on_floats_is_that_of_matrices(four_bar, angle, monkeypatch):
    t = angle / four_bar.DEFAULTS[-1]
    near = kc.newton(four_bar, t, None).q + 0.01
    found = solve(four_bar, t, guess=near)
    monkeypatch.setattr("kincompile.runtime.start.is_settled", lambda *_: False)
    code_of(four_bar).made.clear()
    with_care = solve(four_bar, t, guess=near)
    assert found.success
    for name in ("q", "q_dot", "q_ddot"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(with_care, name), rtol=1e-12, atol=1e-11
        )


def test_progress_counts_the_points(pendulum):
    calls = []
    solve(pendulum, np.linspace(0, 1, 4), progress=lambda done, total: calls.append((done, total)))
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]


# Failure


def check_failure(solution: Solution, index: int, status: Status) -> None:
    """The points before are good, this one failed, the others were not tried."""
    assert not solution.success
    assert solution.status[:index].tolist() == [Status.CONVERGED] * index
    assert solution.status[index] == status
    assert (solution.status[index + 1 :] == Status.NOT_REACHED).all()
    for values in (solution.q, solution.q_dot, solution.q_ddot):
        assert np.isfinite(values[:index]).all()
        assert np.isnan(values[index + 1 :]).all()
    assert np.isnan(solution.q_dot[index:]).all()
    assert f"failed at t = {solution.t[index]:.10g}, point {index + 1} of" in solution.message
    # An event that ended the motion is the reason; else the status says what may be.
    sentences = [event.message for event in solution.events] or [status.sentence]
    if status is Status.NOT_ASSEMBLED:
        sentences = ["the mechanism cannot be assembled at this time"]
    assert sentences[-1] in solution.message


@pytest.mark.parametrize("points", [10, 38, 102])
def test_r3_fails_at_the_first_time_after_its_lock_up(problem_3_5_6, points):
    t = np.linspace(0, 5, points)
    solution = solve(problem_3_5_6, t)
    check_failure(solution, int(np.argmax(t > 4.5)), Status.LOCK_UP)
    assert np.isnan(solution.q[t > 4.5]).all()
    assert "the motion was followed to t = 4.49999" in solution.message
    reason, residuals = "Lock-up at t = 4.5", "largest residuals at the nearest position: "
    assert Status.LOCK_UP.sentence not in solution.message
    assert -1 < solution.message.index(reason) < solution.message.index(residuals)
    assert "length is " in solution.message
    assert "0.85 m at most (found by moving the other joints)" in solution.message


def test_r3_locks_up_backwards_too(problem_3_5_6):
    solution = solve(problem_3_5_6, -np.linspace(0, 1, 8))
    check_failure(solution, 4, Status.LOCK_UP)
    assert "the motion was followed to t = -0.4999" in solution.message


@pytest.mark.parametrize("t", [[0, 4.5], np.linspace(0, 5, 51), np.linspace(0, 5, 11)])
def test_at_the_lock_up_itself_the_position_exists_and_the_velocity_does_not(problem_3_5_6, t):
    solution = solve(problem_3_5_6, t)
    index = int(np.argmin(np.abs(solution.t - 4.5)))
    check_failure(solution, index, Status.SINGULAR)
    np.testing.assert_allclose(solution.q[index], (0.85, 0, -math.pi / 2), atol=1e-6)
    assert "The position there was found." in solution.message


@pytest.mark.parametrize("points", [8, 71, 70])
def test_r4_stops_at_its_bifurcation(example_3_7_5, points):
    t = np.linspace(0, 7, points)
    solution = solve(example_3_7_5, t, {"l": 1})
    check_failure(solution, int(np.argmax(t > 6 - 1e-9)), Status.SINGULAR)


def test_a_gap_without_solutions_is_not_jumped(example_3_7_5):
    # With l = 0.5 there is no position for t in (2, 10), but there is one at t = 12.
    solution = solve(example_3_7_5, [0, 1, 12, 13], {"l": 0.5})
    check_failure(solution, 2, Status.LOCK_UP)
    assert "A position exists at that time, but the motion does not lead there" in solution.message
    assert "the motion was followed to t = 1.99999" in solution.message


def test_a_driver_that_jumps_is_not_followed(edited):
    module = edited("pendulum", ("phi - phi_0 - omega * t", "phi - phi_0 - (1.0 if t > 1 else 0)"))
    solution = solve(module, [0, 0.5, 1.5])
    check_failure(solution, 2, Status.NOT_CONVERGED)


def test_a_mechanism_that_does_not_assemble_fails_at_once(problem_3_5_6):
    solution = solve(problem_3_5_6, [4.7, 4.8, 4.9])
    check_failure(solution, 0, Status.NOT_ASSEMBLED)
    assert solution.residual[0] > 1e-3
    assert np.isnan(solution.residual[1:]).all()


def test_the_cap_on_iterations_is_obeyed(problem_3_5_6):
    solution = solve(problem_3_5_6, 0, max_iterations=2)
    check_failure(solution, 0, Status.NOT_ASSEMBLED)
    assert solve(problem_3_5_6, 0, max_iterations=6).success


@pytest.mark.parametrize("driver", ["math.sqrt(1 - t)", "np.sqrt(1 - t)", "1 / (t < 1)"])
def test_a_driver_that_ends_is_not_finite(edited, driver):
    module = edited("pendulum", ("phi - phi_0 - omega * t", f"phi - phi_0 - {driver}"))
    solution = solve(module, [0, 0.5, 1.5, 2])
    check_failure(solution, 2, Status.NOT_FINITE)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("np.array([0.0, 0.0, p[0]])", "np.array([0.0, math.nan, p[0]])"),
        ("np.array([0.0, 0.0, p[0]])", "np.array([0.0, math.log(-1), p[0]])"),
        ("square = q_dot[2] ** 2", "square = math.inf"),
        ("square = q_dot[2] ** 2", "square = 1 / 0"),
    ],
)
def test_a_derivative_that_is_not_finite_is_reported(edited, old, new):
    solution = solve(edited("pendulum", (old, new)), [0, 1])
    check_failure(solution, 0, Status.NOT_FINITE)
    close(solution.q[0], (1, 0, math.pi / 2))


def test_a_constraint_that_repeats_another_is_singular(edited):
    module = edited(
        "pendulum",
        ("phi - phi_0 - omega * t])", "2 * (y + math.sin(phi) - 1)])"),
        ("[0.0, 0.0, 1.0]]", "[0.0, 2.0, 2 * math.cos(phi)]]"),
    )
    solution = solve(module, [0, 1], guess=(0.8, 0.3, 1.2))
    check_failure(solution, 0, Status.SINGULAR)


def test_throw_raises_with_the_partial_solution(problem_3_5_6):
    with pytest.raises(SolveError, match=r"problem_3_5_6 failed at t = 5, point 4 of 4") as caught:
        solve(problem_3_5_6, [0, 2, 4, 5], throw=True)
    assert caught.value.solution.status.tolist() == [0, 0, 0, Status.LOCK_UP]
    assert solve(problem_3_5_6, [0, 2, 4], throw=True).success


def test_every_status_has_a_sentence_with_a_remedy():
    for status in Status:
        assert status.sentence.endswith(".")
        assert len(status.sentence) > 40
    assert int(Status.CONVERGED) == 0


# Solution


def test_a_solution_describes_itself(pendulum):
    solution = solve(pendulum, np.linspace(0, 1, 5))
    assert repr(solution).startswith("<Solution of pendulum: 5 points, t = 0 to 1; converged, ")
    assert repr(solve(pendulum, 2)).startswith("<Solution of pendulum: 1 point, t = 2; converged")
    assert solution.message.startswith("pendulum: all 5 points converged; the largest residual")
    assert solution.coordinates == pendulum.COORDINATES
    assert solution.equations == pendulum.EQUATIONS
    assert solution.units == pendulum.UNITS


def test_a_failed_solution_says_so(problem_3_5_6):
    solution = solve(problem_3_5_6, [0, 5])
    assert repr(solution).endswith("t = 0 to 5; failed, 1 of 2 points converged; see .message>")


def test_columns_by_name(pendulum):
    solution = solve(pendulum, [0, 0.1])
    np.testing.assert_array_equal(solution["phi_rod"], solution.q[:, 2])
    np.testing.assert_array_equal(solution["x_rod_dot"], solution.q_dot[:, 0])
    np.testing.assert_array_equal(solution["y_rod_ddot"], solution.q_ddot[:, 1])


def test_that_more_than_a_thousand_coordinates_are_warned_about_too():
    module = kc.compile(row_of_parallelograms(112, 0.0))
    assert module.N_COORDINATES > 1000
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert kc.solve(module, [0.0, 1.0, FLAT - 0.1]).success
    said = r"row is nearly singular at t = 2\.14159165"
    with pytest.warns(kc.SingularConfigurationWarning, match=said):
        assert kc.solve(module, [0.0, 1.0, FLAT - 1e-6]).success
