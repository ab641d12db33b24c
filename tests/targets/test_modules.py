"""Modules that Python calls: points and batches, functions of one and of several quantities.

And the interpreter, which takes batches too.
"""

import numpy as np
import pytest

import kincompile as kc
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower

TOLERANCE = 1e-13
UNSOLVABLE = ("undriven", "driven_twice")


def assert_close(found, expected):
    """Compare vectors, or rows of a matrix, relative to their largest number."""
    assert found.shape == expected.shape
    size = np.abs(expected).max(axis=-1, keepdims=True)
    assert np.all(np.abs(found - expected) <= TOLERANCE * size)


def test_that_a_module_agrees_at_a_point(module_of, name, case_named):
    case, module = case_named(name), module_of(name)
    for k, (q, q_dot, t, p) in enumerate(zip(case.q, case.q_dot, case.t, case.p, strict=True)):
        for quantity, expected in case.expected.items():
            rates = (q_dot,) if quantity == "gamma" else ()
            assert_close(getattr(module, quantity)(q, *rates, float(t), p), expected[k])


def test_that_functions_of_several_quantities_agree(module_of, name, case_named):
    case, module = case_named(name), module_of(name)
    q, q_dot, t, p = case.q, case.q_dot, case.t, case.p
    for function, arguments, quantities in [
        (module.position, (q, t, p), ("Phi", "Phi_q")),
        (module.velocity, (q, t, p), ("Phi_q", "nu")),
        (module.acceleration, (q, q_dot, t, p), ("Phi_q", "gamma")),
        (module.gamma, (q, q_dot, t, p), ("gamma",)),
    ]:
        found = function(*arguments)
        for item, quantity in zip(
            found if isinstance(found, tuple) else (found,), quantities, strict=True
        ):
            assert_close(item, case.expected[quantity])


def test_that_the_batch_may_be_the_last_axis(module_of, name, case_named):
    case, module = case_named(name), module_of(name)
    given = [np.ascontiguousarray(value.T) for value in (case.q, case.q_dot, case.t, case.p)]
    Phi, nonzeros, nu, gamma = module.kinematics_batch_last(*given)
    rows, columns = module.PATTERN.T
    Phi_q = np.zeros_like(case.expected["Phi_q"])
    Phi_q[:, rows, columns] = nonzeros.T
    for found, expected in zip((Phi.T, Phi_q, nu.T, gamma.T), case.expected.values(), strict=True):
        assert_close(found, expected)


def test_that_the_nonzeros_are_those_of_the_jacobian(module_of, name, case_named):
    case, module = case_named(name), module_of(name)
    expected = case.expected["Phi_q"]
    rows, columns = module.PATTERN.T
    nonzeros = module.Phi_q_nonzeros(case.q, case.t, case.p)
    size = np.abs(expected).max(axis=-1)[:, rows]
    assert np.all(np.abs(nonzeros - expected[:, rows, columns]) <= TOLERANCE * size)
    outside = np.ones(expected.shape[1:], dtype=bool)
    outside[rows, columns] = False
    assert not expected[:, outside].any()


def test_that_a_complex_step_gives_the_jacobian(module_of, case_named):
    case, module = case_named("functions"), module_of("functions")
    beside = [k for k, (x, y, *_) in enumerate(case.q) if x != y]  # where no condition changes
    for q, t, expected in zip(
        case.q[beside], case.t[beside], case.expected["Phi_q"][beside], strict=True
    ):
        columns = module.Phi(q + 1e-30j * np.eye(q.size), t).imag / 1e-30
        np.testing.assert_allclose(columns.T, expected, rtol=1e-12, atol=1e-13)


def test_that_the_planned_solve_solves(module_of, case_named):
    case, module = case_named("struct"), module_of("struct")
    q, t, p = case.q[0], case.t[0], case.p[0]
    x = module.solve(module.Phi_q_nonzeros(q, t, p), np.ones(q.size))
    np.testing.assert_allclose(module.Phi_q(q, t, p) @ x, 1, rtol=1e-9)


@pytest.mark.parametrize("name", UNSOLVABLE)
def test_that_a_module_that_is_not_square_has_no_solve_and_says_why(module_of, name):
    module = module_of(name)
    assert module.N_EQUATIONS != module.N_COORDINATES
    assert not {"solve", "factor", "compiled_march"} & vars(module).keys()
    assert not {"solve", "factor"} & getattr(module, "LANES", {}).keys()
    with pytest.raises(kc.StructuralError, match=f"'{name}' has . equations for 6 coord") as caught:
        kc.solve(module, [0.0, 1.0])
    assert str(caught.value) == module.UNSOLVABLE


def test_that_the_interpreter_takes_a_batch_at_one_time(name, case_named):
    case = case_named(name)
    program, p = lower(case.model.system()), case.p[-1]
    batch = interpret(program, case.q, case.q_dot, 0.3, p)
    for k in range(len(case.q)):
        alone = interpret(program, case.q[k], case.q_dot[k], 0.3, p)
        for one, many in zip(alone, batch, strict=True):
            np.testing.assert_allclose(many[k], one, rtol=1e-14, atol=1e-14)
