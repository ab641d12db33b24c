"""Implicit methods: the derivatives of the accelerations, and what they spare."""

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp  # type: ignore[attr-defined]  # a star there

import kincompile as kc
from kincompile.runtime.dynamics.equations import dynamics_of
from kincompile.runtime.engine.code import code_of
from tests.targets.test_forward_dynamics import mixed, repeated, rolling
from tests.unit.dynamics.test_forward import equations_of

STIFF, DAMPER = 1e8, 1e4


def sprung():
    """Return a bar that a stiff spring with a damper holds in the slot of a pendulum."""
    m = kc.Mechanism("sprung")
    m.gravity = (0, -9.81)
    first = m.body("first", (0.5, 0, 0), mass=1, inertia=1 / 12)
    second = m.body("second", (1.5, 0, 0), mass=1, inertia=1 / 12)
    m.add(kc.Revolute("O", m.ground, (0, 0), first, (-0.5, 0)))
    m.add(kc.Translational("slot", first, (0, 0), (1, 0), second, (0, 0), (1, 0)))
    m.add(kc.Spring("s", first, (0.5, 0), second, (-0.4, 0), STIFF, 0.1, DAMPER))
    return m


def driven_twice():
    """Return a crank that is driven at its pin too: that equation is left out."""
    m = mixed()
    m.name = "driven_twice"
    m.add(kc.AbsoluteX("again", m.bodies[0], (0.5, 0), sympy.cos(0.3 * kc.t + 2 * kc.t**2) / 2))
    return m


@pytest.mark.parametrize(
    "model", [mixed(), repeated(), driven_twice(), rolling(), sprung()], ids=lambda m: m.name
)
def test_that_the_jacobian_is_that_of_complex_steps(model):
    equations, module = equations_of(model)
    n, rng = module.N_COORDINATES, np.random.default_rng(1)
    y = np.concatenate((module.GUESS, np.zeros(n + 1)))
    y[:-1] += rng.uniform(-0.3, 0.3, 2 * n)
    accelerations = dynamics_of(code_of(kc.compile(model))).accelerations
    steps = y[:-1] + 1e-30j * np.eye(2 * n)
    q, q_dot, t = steps[:, :n], steps[:, n:], np.full(2 * n, 0.4)
    found = accelerations.observe(q, q_dot, 0 * q, t)[0].imag / 1e-30
    expected = np.zeros((2 * n + 1, 2 * n + 1))
    expected[:n, n:-1], expected[n:, :-1] = np.eye(n), found.T
    jacobian = equations.jacobian(0.4, y)
    np.testing.assert_allclose(jacobian, expected, rtol=1e-9, atol=1e-11 * np.abs(found).max())


@pytest.mark.slow
def test_that_a_stiff_spring_takes_few_evaluations():
    """Beside SciPy's own differences, on the same equations; all find the pendulum of two rods."""
    equations, module = equations_of(sprung())
    for method in ("Radau", "BDF", "CVODE"):
        found = kc.simulate(module, [0, 0.5], method=method, rtol=1e-7)
        assert found.success
        # The spring hardly gives: both bars swing as one, of length 2.
        assert found["second.phi"][-1] == pytest.approx(rod_of_two(0.5), abs=1e-5)
        assert 0 < found.statistics["jacobians"] < found.statistics["evaluations"]
    start = np.concatenate((found.q[0], found.q_dot[0], [0.0]))
    counts = []
    for jacobian in (None, equations.jacobian):
        before = equations.evaluations
        options = {"method": "Radau", "rtol": 1e-6, "atol": 1e-6, "jac": jacobian}
        assert solve_ivp(equations.rate, (0, 0.5), start, **options).success
        counts.append(equations.evaluations - before)
    assert counts[1] < 0.7 * counts[0]


def rod_of_two(t):
    """Return the angle of both bars together, stiff: 2 kg, centre at 1 m, falling from level."""
    inertia = 2 / 12 + 0.5**2 + 1.5**2

    def rate(_, y):
        return y[1], -2 * 9.81 * np.cos(y[0]) / inertia

    return solve_ivp(rate, (0, t), (0, 0), "DOP853", rtol=1e-10, atol=1e-12).y[0, -1]
