"""Every constraint type against its Phi by hand, in every variant, on the manifold and off it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.model.catalogue import CONSTRAINTS

T0 = 0.4
TOLERANCE = 1e-12  # both sides are exact to rounding
STEP = 1e-30  # of the complex step: no subtraction, so no cancellation


@pytest.mark.every(5)
def test_that_the_emitted_module_agrees_at_single_points(case: Any) -> None:
    assert case.deviation(case.module.kinematics) < TOLERANCE


def test_that_the_emitted_module_agrees_on_a_batch(case: Any) -> None:
    q, q_dot = (np.array(states) for states in zip(*case.states, strict=True))
    batch = case.module.kinematics(q, q_dot, T0, case.p)
    points = {tuple(point): k for k, point in enumerate(q.tolist())}

    def taken(at: Any, *_: Any) -> Any:
        return tuple(quantity[points[tuple(at.tolist())]] for quantity in batch)

    assert case.deviation(taken) < TOLERANCE


def test_that_the_single_functions_agree(generic_case: Any) -> None:
    module = generic_case.module

    def singly(q: Any, q_dot: Any, t: float, p: Any) -> Any:
        return (
            module.Phi(q, t, p),
            module.Phi_q(q, t, p),
            module.nu(q, t, p),
            module.gamma(q, q_dot, t, p),
        )

    assert generic_case.deviation(singly) < TOLERANCE


def test_that_the_interpreter_agrees(case: Any) -> None:
    program = lower(case.mechanism.system())
    assert case.deviation(lambda *at: interpret(program, *at)) < TOLERANCE


def test_that_the_matrices_agree(grounded_case: Any) -> None:
    system = grounded_case.mechanism.system()
    matrices = [item.tolist() for item in (system.Phi, system.Phi_q, system.nu, system.gamma)]
    evaluate = sympy.lambdify(
        (list(system.q), list(system.q_dot), kc.t), matrices, "math", cse=True
    )

    def assembled(q: Any, q_dot: Any, t: float, _: Any) -> Any:
        Phi, Phi_q, nu, gamma = (np.array(rows) for rows in evaluate(q, q_dot, t))
        return Phi[:, 0], Phi_q, nu[:, 0], gamma[:, 0]

    assert grounded_case.deviation(assembled) < TOLERANCE


def test_that_the_jacobian_is_the_complex_step_of_the_constraints(case: Any) -> None:
    for q, _ in case.states:
        directions = STEP * np.eye(len(q))
        columns = case.module.Phi(q + 1j * directions, T0, case.p).imag / STEP
        np.testing.assert_allclose(
            case.module.Phi_q(q, T0, case.p), columns.T, rtol=1e-13, atol=1e-13
        )


def test_that_nu_is_the_complex_step_of_the_constraints_in_time(case: Any) -> None:
    for q, _ in case.states:
        rise = case.module.Phi(q, T0 + 1j * STEP, case.p).imag / STEP
        np.testing.assert_allclose(case.module.nu(q, T0, case.p), -rise, rtol=1e-13, atol=1e-13)


def test_that_gamma_is_the_complex_step_of_the_velocity_equation(case: Any) -> None:
    """With q_ddot = 0, gamma = -d/ds (Phi_q q_dot - nu) along the line q + s q_dot, t + s."""
    for q, q_dot in case.states:
        Phi_q, nu = case.module.velocity(q + 1j * STEP * q_dot, T0 + 1j * STEP, case.p)
        bend = (Phi_q @ q_dot - nu).imag / STEP
        gamma = case.module.gamma(q, q_dot, T0, case.p)
        np.testing.assert_allclose(gamma, -bend, rtol=1e-12, atol=1e-12)


def test_that_the_consistent_states_are_consistent(generic_case: Any) -> None:
    """Else the comparison on the manifold would be one off it."""
    (q, q_dot), rows = generic_case.states[-1], slice(0, generic_case.rows)
    Phi, Phi_q, nu, _ = generic_case.module.kinematics(q, q_dot, T0, generic_case.p)
    assert np.abs(Phi[rows]).max() < 1e-12
    np.testing.assert_allclose((Phi_q @ q_dot)[rows], nu[rows], atol=1e-12)
    assert np.abs(generic_case.module.Phi(generic_case.states[0][0], T0)[rows]).max() > 1e-2


def test_that_a_driver_at_rest_still_accelerates(case_of: Callable[..., Any], flat: Any) -> None:
    case = case_of("AbsoluteAngle", driver=flat)
    (q, q_dot), *_ = case.states
    assert case.module.nu(q, T0)[0] == pytest.approx(0, abs=1e-15)
    # gamma = C'' = 2 c1, where the driver is c0 + c1 (t - T0)^2 + ...
    assert case.module.gamma(q, q_dot, T0)[0] == pytest.approx(2 * case.values["driver"][1])


def test_that_the_printed_gamma_of_a_translational_joint_holds_on_the_manifold_only(
    case_of: Callable[..., Any],
) -> None:
    case = case_of("Translational")
    parallel = [case.module.gamma(q, q_dot, T0)[1] for q, q_dot in case.states]
    assert parallel[-1] == pytest.approx(0, abs=1e-12)
    assert abs(parallel[0]) > 0.1


def test_that_every_constraint_type_has_an_oracle(kinds: tuple[str, ...]) -> None:
    assert set(kinds) == {*CONSTRAINTS, "Equation"}
