"""R4: one model, three cases: regular, lock-up, bifurcation."""

import numpy as np
import pytest
import sympy

import kincompile as kc


@pytest.fixture(scope="module")
def slider_crank(example_named):
    return example_named("example_3_7_5")


@pytest.fixture(scope="module")
def at_time(slider_crank):
    """Return the function that follows the motion of a rod length to one time."""

    def motion(rod, t):
        times = np.append(np.arange(0, t - 0.05, 0.1), t)
        solution = kc.solve(slider_crank.module, times, p={"l": rod}, throw=True)
        Phi_q = slider_crank.module.Phi_q(solution.q[-1], t, np.array([rod]))
        return solution.q[-1], solution.q_dot[-1], solution.q_ddot[-1], np.linalg.det(Phi_q)

    return motion


def test_the_formulas_by_hand(slider_crank):
    t, (x2, phi1, phi2) = kc.t, slider_crank.model.q
    phi1_dot, phi2_dot = slider_crank.model.q_dot[1:]
    rod = sympy.Symbol("l")
    sin_1, cos_1, sin_2, cos_2 = (f(phi) for phi in (phi1, phi2) for f in (sympy.sin, sympy.cos))
    by_hand = {
        "Phi": [-x2 + cos_1 + rod * sin_2, sin_1 - rod * cos_2, phi1 - sympy.pi * t / 12],
        "Phi_q": [[-1, -sin_1, rod * cos_2], [0, cos_1, rod * sin_2], [0, 1, 0]],
        "nu": [0, 0, sympy.pi / 12],
        "gamma": [
            phi1_dot**2 * cos_1 + rod * phi2_dot**2 * sin_2,
            phi1_dot**2 * sin_1 - rod * phi2_dot**2 * cos_2,
            0,
        ],
    }
    for name, formula in by_hand.items():
        difference = getattr(slider_crank.model, name) - sympy.Matrix(formula)
        assert sympy.simplify(difference).is_zero_matrix, name


@pytest.mark.parametrize(
    ("t", "q", "q_dot", "q_ddot"),
    [
        (
            2, "2.2802389662, 0.5235987756, 1.2309594173",
            "-0.2110590583, 0.2617993878, -0.1603187288",
            "-0.0881321441, 0, 0.0151451046",
        ),
        (
            4, "1.7247448714, 1.0471975512, 0.9553166181",
            "-0.3192849817, 0.2617993878, -0.1068791525",
            "-0.0132837872, 0, 0.0403869456",
        ),
        (
            6, "1.1180339887, 1.5707963268, 0.8410686706",
            "-0.2617993878, 0.2617993878, 0",
            "0.0613030732, 0, 0.0613030732",
        ),
    ],
)  # fmt: skip
def test_the_regular_motion(slider_crank, printed, t, q, q_dot, q_ddot):
    solution = slider_crank.solution
    k = np.flatnonzero(solution.t == t).item()
    assert solution.parameters == {"l": 1.5}
    printed(q, solution.q[k])
    printed(q_dot, solution.q_dot[k])
    printed(q_ddot, solution.q_ddot[k])


def test_the_determinant_of_the_regular_motion(at_time, printed):
    printed("1.4142135624", at_time(1.5, 2.0)[3])


def test_towards_the_lock_up(at_time, printed):
    printed("1.3937256649, 0.2617993878, 1.0267082201", at_time(0.5, 1.0)[0])
    printed("0.1493971804", at_time(0.5, 1.9)[3])
    _, q_dot, q_ddot, det = at_time(0.5, 1.99)
    printed("-2.5056592734, ., -4.7723637897", q_dot)
    printed("-119.3730283571, 0, -237.5378012678", q_ddot)
    printed("0.0475795324", det)
    _, q_dot, _, det = at_time(0.5, 1.999)
    printed("-15.0608015873", q_dot[2])
    printed("0.0150562492", det)


@pytest.mark.parametrize("rod", [0.5, 0.35, 0.8])
def test_that_a_short_rod_locks_up(slider_crank, rod):
    lock_up = 12 / np.pi * np.arcsin(rod)
    t = np.linspace(0, 6, 65)  # does not hit the lock-up
    solution = kc.solve(slider_crank.module, t, p={"l": rod})
    assert not solution.success
    np.testing.assert_array_equal(solution.status == kc.Status.CONVERGED, t < lock_up)
    assert solution.status[np.argmax(t > lock_up)] == kc.Status.LOCK_UP


def test_that_the_lock_up_itself_is_singular(slider_crank):
    solution = kc.solve(slider_crank.module, np.linspace(0, 3, 31), p={"l": 0.5})
    assert solution.t[20] == 2.0
    assert np.all(solution.status[:20] == kc.Status.CONVERGED)
    assert solution.status[20] == kc.Status.SINGULAR
    assert np.all(solution.status[21:] == kc.Status.NOT_REACHED)


def test_towards_the_bifurcation(at_time, printed):
    _, q_dot, _, det = at_time(1.0, 5.9)
    printed("0.0261769483", det)
    printed("-0.5234193514, ., -0.2617993878", q_dot)


def test_that_velocities_stay_finite_at_the_bifurcation_and_not_at_the_lock_up(at_time):
    bifurcation = [np.abs(at_time(1.0, 6 - gap)[1]).max() for gap in (1e-1, 1e-2, 1e-3)]
    lock_up = [np.abs(at_time(0.5, 2 - gap)[1]).max() for gap in (1e-1, 1e-2, 1e-3)]
    np.testing.assert_allclose(bifurcation, np.pi / 6, rtol=1e-3)
    # Near a lock-up the velocity grows as the inverse square root of the time that is left.
    np.testing.assert_allclose(np.divide(lock_up[1:], lock_up[:-1]), np.sqrt(10), rtol=0.05)


def test_that_the_bifurcation_itself_is_singular(slider_crank):
    solution = kc.solve(slider_crank.module, np.linspace(0, 7, 71), p={"l": 1.0})
    assert solution.t[60] == 6.0
    assert np.all(solution.status[:60] == kc.Status.CONVERGED)
    assert solution.status[60] == kc.Status.SINGULAR
    np.testing.assert_allclose(solution.q[60], [0, np.pi / 2, 0], atol=1e-6)
