"""The engines: each solves the systems that NumPy solves, and says no less."""

from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.engine.code import POINTS, SENSITIVE, code_of
from kincompile.runtime.engine.linear import Dense, Floats, Linear, Planned
from kincompile.runtime.engine.scales import Point
from kincompile.runtime.engine.sparse import Sparse
from kincompile.runtime.load import from_source
from kincompile.runtime.problem import problem

ENGINES: dict[str, Any] = {
    "dense": Dense,
    "floats": Floats,
    "planned": Planned,
    "sparse": Sparse,
}
KINDS = tuple(ENGINES)
TIME = 0.3


@pytest.fixture(scope="module")
def modules(example_named):
    model = example_named("four_bar").model
    inline = example_named("four_bar").module
    return {
        "dense": inline,
        "floats": inline,
        "planned": inline,
        "sparse": kc.compile(model, form="grouped"),
    }


def evaluated(module: Any, kind: str) -> tuple[Linear, Point, np.ndarray]:
    """Return an engine, a generic point of it, and the matrix Phi_q there."""
    code, p = code_of(module), module.DEFAULTS
    q = module.GUESS + np.random.default_rng(5).uniform(0.1, 0.5, module.GUESS.size)
    engine: Linear = ENGINES[kind](code, p)
    batch = np.add.outer(q, [0.0, 0.1, 0.2]) if kind == "planned" else q
    return engine, engine.evaluate(batch, TIME), module.Phi_q(batch.T, TIME)


def right_side(point: Point, seed: int = 6) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=point.q.shape)


def expected(matrix: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.solve(matrix, b.T[..., np.newaxis])[..., 0].T


@pytest.mark.parametrize("kind", KINDS)
def test_that_systems_are_solved_as_numpy_solves_them(modules, kind):
    engine, point, matrix = evaluated(modules[kind], kind)
    b = right_side(point)
    np.testing.assert_allclose(engine.solve(point, b), expected(matrix, b), rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_that_rates_solve_the_equations_of_velocity_and_acceleration(modules, kind):
    module = modules[kind]
    engine, point, matrix = evaluated(module, kind)
    b = right_side(point)
    p = module.DEFAULTS
    equations = problem(code_of(module), p, module.GUESS, TIME)
    rates = engine.solved(equations, point, b)
    assert np.all(rates.are_met)
    q = point.q.T
    q_dot = expected(matrix, np.asarray(module.nu(q, TIME, p)).T)
    q_ddot = expected(matrix, np.asarray(module.gamma(q, q_dot.T, TIME, p)).T)
    for found, wanted in ((rates.q_dot, q_dot), (rates.q_ddot, q_ddot)):
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(rates.movement, expected(matrix, b), rtol=1e-9, atol=1e-11)
    for wrong in (replace(rates, q_dot=1.001 * q_dot), replace(rates, q_ddot=1.001 * q_ddot)):
        assert not np.any(engine.meet(equations, point, wrong))


@pytest.mark.parametrize("kind", KINDS)
def test_that_the_determinants_of_blocks_tell_the_branch(modules, kind):
    module = modules[kind]
    signs = []
    for sign in (1, -1):
        q = kc.newton(module, 0, {"phi_rocker": 4.7 if sign > 0 else 1.5}).q
        engine, _, _ = evaluated(module, kind)
        point = engine.evaluate(q[:, np.newaxis] if kind == "planned" else q, 0.0)
        signs.append(engine.signs(point))
        assert np.sign(engine.determinants(point, point)).ravel().tolist() == list(signs[-1])
    first = kc.newton(module, 0, {"phi_rocker": 4.7}).q
    second = kc.newton(module, 0, {"phi_rocker": 1.5}).q
    determinants = [np.linalg.det(module.Phi_q(q, 0.0)) for q in (first, second)]
    assert (signs[0] == signs[1]) == (determinants[0] * determinants[1] > 0)


@pytest.mark.parametrize("kind", KINDS)
def test_that_a_singular_matrix_gives_numbers_that_are_not_finite(kind):
    u, v = sympy.symbols("u v")
    equations = [u**2 + v**2 - 1, u - v**2 - 1]
    system = kc.ConstraintSystem("fold", "u v", equations, guess=[1.0, 0.0])
    module = kc.compile(system, form="grouped" if kind == "sparse" else "inline")
    if kind == "sparse" and not code_of(module).blocks:
        pytest.skip("solved whole")
    engine: Linear = ENGINES[kind](code_of(module), module.DEFAULTS)
    q = np.array([1.0, 0.0])
    point = engine.evaluate(q[:, np.newaxis] if kind == "planned" else q, 0.0)
    with np.errstate(all="ignore"):
        found = engine.solve(point, np.ones_like(point.q))
    assert not np.isfinite(found).all()


def test_that_redundant_equations_are_solved_in_the_least_squares_sense():
    m = kc.Mechanism("slab")
    slab = m.body("slab", guess=(1, 0, 0))
    for name in ("A", "B"):
        m.add(kc.Translational(name, m.ground, (0, 0), (1, 0), slab, (0, 0), (1, 0)))
    m.add(kc.AbsoluteX("motor", slab, (0, 0), 1 + kc.t))
    with pytest.warns(kc.RedundantConstraintWarning):
        module = kc.compile(m)
    engine = Dense(code_of(module), module.DEFAULTS)
    point = engine.evaluate(np.array([1.0, 0.0, 0.0]), 0.0)
    equations = problem(code_of(module), module.DEFAULTS, point.q, 0.0)
    rates = engine.solved(equations, point, np.zeros(5))
    np.testing.assert_allclose(rates.q_dot, (1, 0, 0), atol=1e-12)
    assert rates.are_met
    assert engine.signs(point) == ()


def test_that_a_module_is_read_once_and_again_when_it_is_compiled(example_named, quick_compiler):
    module = example_named("four_bar").module
    assert code_of(module) is code_of(module)
    native = code_of(example_named("four_bar").native)
    assert native.march is not None
    assert code_of(module).march is None
    assert native.lanes is not None


def test_that_what_is_asked_for_again_is_not_compiled_again(example_named):
    example = example_named("four_bar")
    code = code_of(example.module)
    assert code.points() is code.request(POINTS) is code.points()
    assert code.request(SENSITIVE, ("a",)) is code.request(SENSITIVE, ("a",))
    of_file = code_of(from_source(kc.emit(example.model).source, "four_bar"))
    assert of_file.points() is of_file
    with pytest.raises(kc.InputError, match=r"loaded from a file.*Compile the model, solve with"):
        of_file.request(SENSITIVE, ("a",))


def test_that_a_copy_of_a_module_is_read_for_itself(example_named):
    module = example_named("four_bar").module
    copy = ModuleType("copy")
    vars(copy).update(vars(module), nu=lambda q, t, p: np.zeros_like(q))
    assert code_of(copy).nu is copy.nu
    assert code_of(module).nu is module.nu
