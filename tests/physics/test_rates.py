"""Velocity and acceleration against differences of the motion: signs and factors of every example.

An acceleration checked against differences of velocities alone would miss a wrong global sign of
the velocity, so both start from q(t).
"""

import numpy as np
import pytest

import kincompile as kc

# Central differences of fourth order: at -2, -1, 0, 1, 2 steps.
FIRST = np.array([1, -8, 0, 8, -1]) / 12
SECOND = np.array([-1, 16, -30, 16, -1]) / 12


@pytest.fixture(scope="module")
def sample(example):
    """Four generic times of an example, with its motion up to two steps to either side."""
    end = example.model.end
    centres = np.sort(np.random.default_rng(4242).uniform(0.05, 0.95, 4)) * end
    step = 1e-3 * min(end, 1.0)
    around = (centres[:, np.newaxis] + step * np.arange(-2, 3)).ravel()
    way = np.linspace(0, around[0], 20, endpoint=False)
    solution = kc.solve(example.module, np.append(way, around), throw=True)
    quantities = (solution.q, solution.q_dot, solution.q_ddot)
    return step, [values[len(way) :].reshape(4, 5, -1) for values in quantities]


def scale(values):
    """Return the size of each coordinate's numbers, at least 1."""
    return np.maximum(1, np.abs(values).max(axis=(0, 1)))


def test_that_q_dot_is_the_rate_of_q(sample):
    step, (q, q_dot, _) = sample
    difference = np.einsum("k,ckn->cn", FIRST, q) / step
    error = np.abs(difference - q_dot[:, 2]) / scale(q_dot)
    assert error.max() < 1e-6


def test_that_q_ddot_is_the_second_rate_of_q(sample):
    step, (q, _, q_ddot) = sample
    difference = np.einsum("k,ckn->cn", SECOND, q) / step**2
    error = np.abs(difference - q_ddot[:, 2]) / scale(q_ddot)
    assert error.max() < 1e-5


def test_that_q_ddot_is_the_rate_of_q_dot(sample):
    step, (_, q_dot, q_ddot) = sample
    difference = np.einsum("k,ckn->cn", FIRST, q_dot) / step
    error = np.abs(difference - q_ddot[:, 2]) / scale(q_ddot)
    assert error.max() < 1e-6


def test_that_position_velocity_and_acceleration_equations_hold(example):
    module, solution = example.module, example.solution
    assert solution.success, solution.message
    q, q_dot, q_ddot, t = solution.q, solution.q_dot, solution.q_ddot, solution.t
    Phi, Phi_q, nu, gamma = module.kinematics(q, q_dot, t)
    np.testing.assert_allclose(Phi, 0, atol=1e-12)
    for rates, right in ((q_dot, nu), (q_ddot, gamma)):
        left = np.einsum("...mn,...n->...m", Phi_q, rates)
        size = np.einsum("...mn,...n->...m", np.abs(Phi_q), np.abs(rates)) + 1
        assert np.max(np.abs(left - right) / size) < 1e-13
