"""What has converged meets Phi_q q_dot = nu and Phi_q q_ddot = gamma, however it was solved for.

0.1 - 0.3 / 3 is not zero in floating point. An elimination that takes it for a pivot loses all
digits; so it is taken for zero, and where a plan is bad all the same, its results are refused.
"""

import json

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.criteria import AGREEMENT
from kincompile.ir import elimination
from kincompile.ir.elimination import plan_solve
from kincompile.ir.inline import inline
from kincompile.ir.lower import lower

from .conftest import NODE, in_node

T = np.linspace(0, 0.3, 61)
FACTORS = np.linspace(0.2, 0.4, 9)


def system(b=0.1, a=0.3, repeated=False):
    """Return three equations of which plain numbers leave b - a / 3 beside entries that vary."""
    x, y, u, k = sympy.symbols("x y u k")
    equations = [
        3 * x + y - kc.t - 5,
        a * x + b * y + sympy.sin(u) - kc.t / 2 - 0.8,
        y + u**3 - k * kc.t - 1.1,
    ]
    if repeated:
        equations.append(2 * equations[0])
    names = {"parameters": {"k": 0.3}, "guess": {"x": 1.2, "y": 1.0, "u": 0.3}}
    return kc.ConstraintSystem("residue", [x, y, u], equations, **names)


def expected(q, k, b=0.1, a=0.3):
    """Return velocity and acceleration at positions (..., 3), solved for with pivots."""
    u, none, one = q[..., 2], 0 * q[..., 2], 1 + 0 * q[..., 2]
    rows = [[3 * one, one, none], [a * one, b * one, np.cos(u)], [none, one, 3 * u**2]]
    matrix = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    nu = np.stack(np.broadcast_arrays(one, one / 2, k), axis=-1)
    q_dot = np.linalg.solve(matrix, nu[..., np.newaxis])[..., 0]
    squared = q_dot[..., 2] ** 2
    gamma = np.stack((none, np.sin(u) * squared, -6 * u * squared), axis=-1)
    return q_dot, np.linalg.solve(matrix, gamma[..., np.newaxis])[..., 0]


def require_rates(q, q_dot, q_ddot, k, tolerance, **numbers):
    for found, known in zip((q_dot, q_ddot), expected(q, k, **numbers), strict=True):
        np.testing.assert_allclose(found, known, rtol=0, atol=tolerance)


@pytest.fixture(params=["mended", "bad"])
def plan(request, monkeypatch):
    """Let elimination be as it is, or take any plain number for a pivot, rounding errors too."""
    if request.param == "bad":
        monkeypatch.setattr(elimination, "SAFE_PIVOT", 0.0)
        monkeypatch.setattr(elimination, "NOISE", -1.0)
    return request.param


@pytest.mark.usefixtures("quick_compiler")
def test_that_velocities_are_looked_at_and_accelerations_too(monkeypatch):
    """A bad plan gives wrong velocities, accelerations, or both with opposite signs."""
    monkeypatch.setattr(elimination, "SAFE_PIVOT", 0.0)
    monkeypatch.setattr(elimination, "NOISE", -1.0)
    x, y, u, k, a, b, c = sympy.symbols("x y u k a b c")
    driver = a * kc.t + b * kc.t**2 + c * sympy.exp(-kc.t)
    equations = [3 * x + y - driver, 0.3 * x + 0.1 * y + k * u - driver / 2, y + k * u]
    parameters = {"k": 0.7, "a": 0.0, "b": 0.0, "c": 0.0}
    linear = kc.ConstraintSystem("linear", [x, y, u], equations, parameters=parameters)
    module = kc.compile(linear, "c")
    matrix = np.array([[3, 1, 0], [0.3, 0.1, 0.7], [0, 1, 0.7]])
    share = np.linalg.solve(matrix, np.array([1, 0.5, 0]))
    for name, size, times in (("a", 1.0, T), ("b", 1.0, T[:1]), ("c", 1e-12, T)):
        solution = kc.solve(module, times, {name: size})
        assert solution.success
        assert "compiled" not in solution.statistics
        moving = driver.subs({**parameters, name: size})
        for order, found in enumerate((solution.q_dot, solution.q_ddot), 1):
            rate = sympy.lambdify(kc.t, sympy.diff(moving, kc.t, order))
            known = np.outer(np.broadcast_to(rate(times), times.shape), share)
            np.testing.assert_allclose(found, known, rtol=0, atol=1e-12 * np.abs(known).max())


def module_of(target, **arguments):
    if target == "grouped":
        return kc.compile(system(**arguments), form="grouped")
    return kc.compile(system(**arguments), target)


COMPILED = pytest.param("c", marks=pytest.mark.slow)
TARGETS = ["numpy", COMPILED, "grouped"]


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("target", TARGETS)
def test_that_rates_of_a_motion_are_those_of_a_solve_with_pivots(target, plan):
    module = module_of(target)
    solution = kc.solve(module, T)
    assert solution.success
    require_rates(solution.q, solution.q_dot, solution.q_ddot, 0.3, 1e-12)
    if plan == "mended" and target == "numpy":
        assert solution.statistics["marched"] == 0
    if plan == "bad" and target == "c":
        assert "compiled" not in solution.statistics


@pytest.mark.usefixtures("plan", "quick_compiler")
@pytest.mark.parametrize("target", ["numpy", "c", "grouped"])
def test_that_rates_of_parameter_sets_are_those_of_a_solve_with_pivots(target):
    solution = kc.solve(module_of(target), T[::10], {"k": FACTORS})
    assert solution.success
    require_rates(solution.q, solution.q_dot, solution.q_ddot, FACTORS[:, np.newaxis], 1e-12)


@pytest.mark.usefixtures("plan", "quick_compiler")
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize("target", ["numpy", COMPILED])
@pytest.mark.parametrize("k", [0.3, FACTORS])
def test_that_redundant_equations_change_nothing(target, k):
    solution = kc.solve(module_of(target, repeated=True), T[::10], {"k": k})
    assert solution.success
    require_rates(solution.q, solution.q_dot, solution.q_ddot, np.expand_dims(k, -1), 1e-12)


@pytest.mark.usefixtures("plan")
@pytest.mark.skipif(NODE is None, reason="node is not installed")
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize("repeated", [False, True])
def test_that_rates_in_javascript_are_those_of_a_solve_with_pivots(tmp_path, repeated):
    source = kc.emit(system(repeated=repeated), "javascript").source
    (tmp_path / "residue.js").write_text(source, encoding="utf-8")
    text = f"""(() => {{
        const found = residue.solver.solve(residue, {T.tolist()});
        const parts = [found.status, found.q, found.q_dot, found.q_ddot];
        return JSON.stringify(parts.map(x => Array.from(x)));
    }})()"""
    status, *motion = json.loads(in_node(tmp_path, {"residue": "residue"}, text))
    assert set(status) == {0}
    q, q_dot, q_ddot = np.array(motion).reshape(3, -1, 3)
    require_rates(q, q_dot, q_ddot, 0.3, 1e-12)


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("target", TARGETS)
def test_that_a_planned_solve_of_decimal_numbers_has_all_digits(target):
    module, rng = module_of(target), np.random.default_rng(4)
    q, b = rng.uniform(0.5, 1.5, (20, 3)), rng.normal(size=(20, 3))
    found = module.solve(module.Phi_q_nonzeros(q, 0.1), b)
    known = np.linalg.solve(module.Phi_q(q, 0.1), b[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-12)


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("target", ["numpy", COMPILED])
@pytest.mark.parametrize("small", [1e-3, 1e-6, 1e-9, 1e-12])
def test_that_a_small_coefficient_costs_no_digits(target, small):
    solution = kc.solve(module_of(target, a=0.0, b=small), T)
    assert solution.success
    assert solution.statistics["marched"] == 0
    require_rates(solution.q, solution.q_dot, solution.q_ddot, 0.3, 1e-12, a=0.0, b=small)


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_that_pivots_are_the_same_in_every_unit_of_length(factor):
    m = kc.Mechanism("lever")
    wheel, lever = m.body("wheel"), m.body("lever", guess=(factor, 0, 0.3))
    m.add(kc.Revolute("O", m.ground, (0, 0), wheel, (0, 0)))
    m.add(kc.Revolute("P", m.ground, (factor, 0), lever, (0, 0)))
    m.add(kc.Distance("link", wheel, (0, factor / 2), lever, (0, factor / 2), factor))
    m.add(kc.AbsoluteAngle("motor", wheel, kc.t))
    plan = plan_solve(inline(lower(m.system())))
    assert plan is not None
    assert [len(block.rows) for block in plan.blocks] == [1]


def geared(radii):
    """Return a planetary gear by the equation of Willis, with a clutch and a lever."""
    m = kc.Mechanism("phaser")
    names = ("sun", "ring", "carrier", "lever")
    bodies = [m.body(n, guess=(k, 0, 0.3 * (k == 3))) for k, n in enumerate(names)]
    for k, body in enumerate(bodies):
        m.add(kc.Revolute(f"O_{k}", m.ground, (k, 0), body, (0, 0)))
    sun, ring, carrier, lever = bodies
    willis = radii[0] * sun.phi + radii[1] * ring.phi - radii[2] * carrier.phi
    phase = 0.1 * sympy.sin(lever.phi) - 0.05 * (1 + sympy.sin(2 * kc.t)) / 2
    m.add(kc.Equation("willis", willis))
    m.add(kc.Equation("phase", carrier.phi - ring.phi - phase))
    m.add(kc.RelativeAngle("clutch", sun, ring, 0))
    m.add(kc.Distance("link", sun, (0, 0.5), lever, (0, 0.8), 3.0))
    return m


@pytest.mark.usefixtures("plan", "quick_compiler")
@pytest.mark.filterwarnings("ignore::kincompile.errors.AssemblyWarning")
@pytest.mark.parametrize("target", ["numpy", COMPILED])
def test_that_a_gear_with_decimal_radii_moves_as_one_with_whole_ones(target):
    decimal, whole = (
        kc.solve(kc.compile(geared(radii), target), np.linspace(0, 2, 41))
        for radii in ((0.1, 0.2, 0.3), (1, 2, 3))
    )
    assert decimal.success
    assert whole.success
    for name in ("q", "q_dot", "q_ddot"):
        np.testing.assert_allclose(getattr(decimal, name), getattr(whole, name), atol=1e-11)


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_the_parts_that_may_be_missed_are_those_of_the_criteria():
    source = kc.emit(system(repeated=True), "c").source
    assert f"AGREEMENT = {AGREEMENT!r};" in source
    assert "IS_REDUNDANT[] = {\n    0, 0, 0, 1,\n}" in source


@pytest.mark.parametrize(("target", "method"), [("numpy", "march"), ("numpy", "grid"), ("c", None)])
def test_that_equations_of_all_sizes_are_not_called_singular(target, method, quick_compiler):
    """Beside rows of 1e6 those of 1e-10 lose their digits, though nothing is near singular."""
    a, b, c, d, e, f, g = sympy.symbols("a b c d e f g")
    drive = sympy.sin(kc.t)
    equations = [
        -1.62 * b * c - 0.11 * d + 0.478814,
        -1.48 * a + 0.5 * b + 3e-7 * c + 4 * d / 9 + 0.412289005888889,
        -0.74 * a + 0.25 * b + 1.5e-7 * c + 2 * d / 9 + 7 * g / 9 - 0.35 * drive / 3
        + 0.626144502944444,
        -1e6 * b * f - 3e-7 * e - 219000 * drive + 511000.000000174,
        -4e-10 * d * g + 9e-10 * e - 1.35e-10 * drive - 5.5656e-10,
        -0.1 * a + 7e5 * e - 105000 * drive - 405999.992,
        4 * b / 7 + 0.5 * c * g - 1.2 * drive / 7 + 2.1829 / 7,
    ]  # fmt: skip
    guess = [0.08, -0.73, -0.39, 0.16, 0.58, -0.7, -0.54]
    system = kc.ConstraintSystem("rows", [*"abcdefg"], equations, guess=guess)
    t = np.linspace(0, 1, 6)
    module = kc.compile(system, target)
    solution = kc.solve(module, t, method=method)
    assert solution.success, solution.message
    for q, q_dot, time in zip(solution.q, solution.q_dot, t, strict=True):
        Phi_q, nu = module.velocity(q, time)
        weights = 1 / np.abs(Phi_q).max(axis=1)
        known = np.linalg.solve(weights[:, np.newaxis] * Phi_q, weights * nu)
        np.testing.assert_allclose(q_dot, known, rtol=0, atol=1e-9)
