"""`kc.jax`: numbers of the runtime, exact derivatives, and what JAX does with it."""

import os
import sys

import numpy as np
import pytest

import kincompile as kc
from tests import transmission_models

# Fusion takes two thirds of the time in which JAX compiles scalar code; the numbers are the same.
os.environ.setdefault("XLA_FLAGS", "--xla_disable_hlo_passes=fusion")
jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'kincompile[jax]'")
jax.config.update("jax_enable_x64", True)
pytestmark = pytest.mark.slow

TIMES = np.linspace(0.0, 4.0, 41)
MECHANISMS = ("four_bar", "cam_by_table", "rssr")


@pytest.fixture(scope="module", params=MECHANISMS)
def compared(request, example_named):
    """Return a module, its solution by the runtime, and the function of JAX."""
    model = example_named(request.param).model
    module = kc.compile(model)
    return module, kc.solve(module, TIMES), kc.jax(module)


def test_that_motions_are_those_of_the_runtime(compared):
    _, solution, f = compared
    found = jax.jit(jax.vmap(f))(TIMES)
    for mine, own in zip(found, (solution.q, solution.q_dot, solution.q_ddot), strict=True):
        np.testing.assert_allclose(mine, own, rtol=1e-11, atol=1e-11 * np.abs(own).max())


def test_that_derivatives_are_the_exact_sensitivities(compared):
    module, solution, f = compared
    names = list(module.PARAMETERS)
    own = kc.sensitivities(solution, names)
    found = jax.jit(jax.vmap(jax.jacfwd(f, argnums=1), (0, None)))(TIMES, module.DEFAULTS)
    for mine, exact in zip(found, (own.q_p, own.q_dot_p, own.q_ddot_p), strict=True):
        np.testing.assert_allclose(mine, exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())


@pytest.fixture(scope="module")
def four_bar(example_named):
    """Return the module of the four-bar and its function."""
    module = kc.compile(example_named("four_bar").model)
    return module, kc.jax(module)


def test_that_the_rate_of_a_position_is_the_velocity(four_bar):
    _, f = four_bar
    rate = jax.jacfwd(lambda t: f(t)[0])
    _, q_dot, q_ddot = f(0.7)
    np.testing.assert_allclose(rate(0.7), q_dot, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(jax.jacfwd(rate)(0.7), q_ddot, rtol=1e-10, atol=1e-10)


def test_that_gradients_backwards_are_those_forwards(four_bar):
    module, f = four_bar
    forward, backward = (
        jac(lambda p: jax.numpy.concatenate(f(1.3, p)))(module.DEFAULTS)
        for jac in (jax.jacfwd, jax.jacrev)
    )
    np.testing.assert_allclose(backward, forward, rtol=1e-12, atol=1e-12)


def test_that_it_can_be_exported(four_bar):
    _, f = four_bar
    text = jax.export.export(jax.jit(f))(jax.ShapeDtypeStruct((), float)).mlir_module()
    assert "stablehlo.while" in text


def test_that_there_is_nothing_beyond_a_lock_up():
    m = kc.Mechanism("rocker")  # of a non-Grashof four-bar: the crank stops at 131 degrees
    crank, coupler, rocker = (
        m.body("crank", (1.5, 0, 0)),
        m.body("coupler", (3, 1, 2)),
        m.body("rocker", (2, 1, 1.6)),
    )
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-1.5, 0)))
    m.add(kc.Revolute("B", crank, (1.5, 0), coupler, (-1, 0)))
    m.add(kc.Revolute("C", coupler, (1, 0), rocker, (1, 0)))
    m.add(kc.Revolute("D", rocker, (-1, 0), m.ground, (2, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    module = kc.compile(m)
    f, end = jax.jit(kc.jax(module)), np.arccos((3**2 + 2**2 - 4**2) / (2 * 3 * 2))
    solution = kc.solve(module, [0.0, 0.9 * end])
    np.testing.assert_allclose(f(0.9 * end)[0], solution.q[1], rtol=1e-10)
    for t in (1.01 * end, 2 * np.pi, 2 * np.pi + 0.3):  # a full turn later it could be assembled
        assert np.isnan(f(t)).all(), t  # a driven rate too


def test_that_a_time_that_is_no_number_has_no_position(example_named):
    """Also where a law by pieces is constant, and would not notice."""
    f = kc.jax(kc.compile(example_named("swing_and_dwell").model))
    assert np.isfinite(f(1.0)).all()
    assert np.isnan(f(np.nan)).all()


def test_that_far_parameters_are_followed_on_the_branch(four_bar):
    module, f = four_bar
    p = np.array(module.DEFAULTS) * [1.2, 0.9, 1.1, 1.0, 1.0]
    own = kc.solve(module, [0.0, 2.0], p=dict(zip(module.PARAMETERS, p, strict=True)))
    np.testing.assert_allclose(f(2.0, p)[0], own.q[1], rtol=1e-10)


def test_that_many_turns_begin_at_the_nearest_time(four_bar):
    module, _ = four_bar
    t, turn = np.linspace(-1.0, 101.0, 60), 2 * np.pi / 1.5
    f = jax.jit(jax.vmap(kc.jax(module, np.linspace(0.0, 24 * turn, 200))))
    found = f(t)[0]
    at = [kc.solve(module, np.linspace(0.0, x, 1 + 20 * int(1 + abs(x)))).q[-1] for x in t]
    np.testing.assert_allclose(found, at, rtol=1e-11, atol=1e-10)


def test_that_a_transmission_is_a_function_too():
    f = kc.transmission(transmission_models.five_bar(), ["motor_1", "motor_2"], ["end"])
    g = kc.jax(f)
    u = f.home.u + 0.05 * np.random.default_rng(0).uniform(-1, 1, (50, 2))
    np.testing.assert_allclose(jax.vmap(g)(u), f(u), rtol=1e-12, atol=1e-12)
    found = jax.vmap(jax.jacrev(g))(u)
    np.testing.assert_allclose(found, f.J(u), rtol=1e-11, atol=1e-12)
    second = jax.vmap(jax.jacfwd(jax.jacfwd(g)))(u)
    np.testing.assert_allclose(second, f.second(u), rtol=1e-9, atol=1e-10)


def test_that_the_extra_is_named_where_jax_is_missing(four_bar, monkeypatch):
    module, _ = four_bar
    monkeypatch.setitem(sys.modules, "jax.numpy", None)
    with pytest.raises(kc.UnsupportedError, match=r"jax is not installed; pip install .*\[jax\]"):
        kc.jax(module)


def test_that_single_precision_is_refused(four_bar):
    module, _ = four_bar
    with jax.enable_x64(False), pytest.raises(kc.InputError, match="jax_enable_x64"):
        kc.jax(module)


def test_that_wrong_arguments_are_named(four_bar):
    _, f = four_bar
    with pytest.raises(kc.InputError, match=r"t has the shape \(2,\): give one time. For a batch"):
        f(np.zeros(2))
    with pytest.raises(kc.InputError, match=r"t is complex: give one time, as an array of real"):
        f(0.1 + 1j)
    with pytest.raises(kc.InputError, match=r"p is a mapping: give 5 numbers, a, b, c"):
        f(0.1, {"a": 8.0})
    with pytest.raises(kc.InputError, match=r"p has the shape \(3,\): give 5 numbers, a, b, c"):
        f(0.0, np.ones(3))


def test_that_a_module_in_grouped_form_is_refused(example_named):
    module = kc.compile(example_named("four_bar").model, form="grouped")
    with pytest.raises(kc.UnsupportedError, match="grouped form"):
        kc.jax(module)


def test_that_what_cannot_be_assembled_says_so():
    m = kc.Mechanism("torn")
    m.add(kc.Revolute("A", m.ground, (0, 0), m.body("rod", (1, 0, 0)), (-1, 0)))
    m.add(kc.AbsoluteX("x", "rod", (0, 0), 1.5 + kc.t))
    with pytest.raises(kc.SolveError, match="positions at `times`"):
        kc.jax(kc.compile(m))
