"""R1 and R10: one body, with figures that are also published or follow in closed form."""

import numpy as np
import pytest
import sympy

import kincompile as kc


@pytest.fixture(scope="module")
def pendulum(example_named):
    return example_named("simple_pendulum")


def test_r1_at_the_start(pendulum, printed):
    solution, module = pendulum.solution, pendulum.module
    printed("1, 0, 1.570796", solution.q[0])
    printed("6.283185307, 0, 6.283185307", solution.q_dot[0])
    printed("0, 39.4784176044, 0", solution.q_ddot[0])
    printed("0, 39.4784176, 0", module.gamma(solution.q[0], solution.q_dot[0], 0.0))
    np.testing.assert_array_equal(module.nu(solution.q[0], 0.0), [0, 0, 2 * np.pi])


def test_r1_later(pendulum, printed):
    solution = pendulum.solution
    k = np.flatnonzero(np.isclose(solution.t, 0.37)).item()
    printed("1.7289686274, 1.6845471059, 3.8955748905", solution.q[k])
    printed("-4.301136318, 4.5802449692, 6.2831853072", solution.q_dot[k])
    printed("-28.7785278938, -27.0248365177, 0", solution.q_ddot[k])
    printed(
        "1, 0, 0.6845471059, 0, 1, -0.7289686274, 0, 0, 1",
        pendulum.module.Phi_q(solution.q[k], solution.t[k]),
    )


def test_r1_the_published_residue_of_gamma_is_rounding(pendulum):
    q, q_dot = np.array([1.0, 0.0, np.pi / 2]), np.array([2 * np.pi, 0.0, 2 * np.pi])
    published = (2.4e-15, 39.4784, 0.0)
    np.testing.assert_allclose(pendulum.module.gamma(q, q_dot, 0.0), published, atol=5e-5)


def ladder() -> kc.Mechanism:
    """Return rodDYN.adm of R10: a rod of length 4 between wall and floor."""
    m = kc.Mechanism("ladder")
    rod = m.body("rod", guess=(1, 1.7, 0.5))
    m.add(kc.AbsoluteX("wall", rod, (0, 2), 0))
    m.add(kc.AbsoluteY("floor", rod, (0, -2), 0))
    m.add(kc.AbsoluteAngle("tilt", rod, kc.t + kc.pi / 6))
    return m


def test_r10_ladder(printed):
    solution = kc.solve(kc.compile(ladder()), np.linspace(0, 1, 11), throw=True)
    # The published figures are cut off, not rounded: a unit of the last digit, not half of it.
    np.testing.assert_allclose(solution.q[0, :2], [1, 1.7320508075], rtol=0, atol=1e-10)
    printed("0.523598775598", solution.q[0, 2])
    np.testing.assert_allclose(solution.q_dot[0], [1.7320508075, -1, 1], rtol=0, atol=1e-10)
    printed("-1, -1.7320508, 0", solution.q_ddot[0])
    printed("1.9977728, 0.09436006, 1.52359878", solution.q[-1])
    printed("-1.9977728, -0.09436006, 0", solution.q_ddot[-1])


def test_r10_ladder_in_closed_form():
    t = np.linspace(0, 1, 11)
    solution = kc.solve(kc.compile(ladder()), t, throw=True)
    angle = t + np.pi / 6
    x, y = 2 * np.sin(angle), 2 * np.cos(angle)
    zero, one = np.zeros_like(t), np.ones_like(t)
    np.testing.assert_allclose(solution.q, np.stack([x, y, angle], axis=-1), atol=1e-14)
    np.testing.assert_allclose(solution.q_dot, np.stack([y, -x, one], axis=-1), atol=1e-14)
    np.testing.assert_allclose(solution.q_ddot, np.stack([-x, -y, zero], axis=-1), atol=1e-14)


def test_r10_swinging_pendulum(printed):
    m = kc.Mechanism("swinging_pendulum")
    arm = m.body("arm", guess=(2, 0, 0))
    m.add(kc.Revolute("pin", arm, (-2, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("swing", arm, sympy.sin(kc.t)))
    solution = kc.solve(kc.compile(m), np.linspace(0, 1, 11), throw=True)
    printed("1.33273349, 1.49124828, 0.84147098", solution.q[-1])
    printed("-0.80572489, 0.72007898, 0.54030231", solution.q_dot[-1])
    printed("0.86578183, -1.55679158, -0.84147098", solution.q_ddot[-1])
