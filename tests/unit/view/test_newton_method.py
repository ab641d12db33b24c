"""Newton's method of the page, in node: LU against NumPy, iterates against the runtime's."""

import json

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import iterate, problem
from kincompile.view.page_scripts import MOST_COORDINATES, solver_script
from tests.page_modules import in_node

STATUSES = {
    "CONVERGED": "converged", "SINGULAR": "singular", "NOT_FINITE": "not finite",
    "NOT_CONVERGED": "not converged",
}  # fmt: skip


def run(script, expression):
    """Return what an expression of `newton` and of a script's declarations gives."""
    return in_node(f"{script}\nimport {{ newton }} from './newton.js';\ntell({expression});")


def guesses(module):
    """Return the model's guess and others around it, nearby and far away."""
    rng = np.random.default_rng(3)
    angular = np.array([module.UNITS[name] == "rad" for name in module.COORDINATES])
    size = np.max(np.abs(np.where(angular, 0, module.GUESS)), initial=0) or 1.0
    scale = np.where(angular, 1.0, size)
    spreads = (0.0, 0.03, 0.1, 0.1, 0.3, 0.3)
    return [module.GUESS + scale * rng.normal(0, spread, scale.size) for spread in spreads]


LINEAR = "emitted.solver.linear"


def test_that_factors_solve_and_give_the_determinant():
    rng = np.random.default_rng(5)
    for n in (1, 2, 5, 15):
        matrix, b = rng.normal(size=(n, n)), rng.normal(size=n)
        matrix[0, 0] = 0 if n > 1 else matrix[0, 0]
        text = f"(() => {{ const f = {LINEAR}.factor({json.dumps(matrix.tolist())});"
        text += f"return [{LINEAR}.solve(f, {json.dumps(b.tolist())}), f.determinant]; }})()"
        x, determinant = run(solver_script(folded()), text)
        np.testing.assert_allclose(x, np.linalg.solve(matrix, b), rtol=1e-11)
        np.testing.assert_allclose(determinant, np.linalg.det(matrix), rtol=1e-12)


def test_that_columns_that_depend_on_each_other_are_found():
    matrix = np.random.default_rng(6).normal(size=(5, 5))
    matrix[:, 3] = 2 * matrix[:, 0] - matrix[:, 2]
    text = f"{LINEAR}.factor({json.dumps(matrix.tolist())})"
    factors = run(solver_script(folded()), text)
    assert factors["determinant"] == 0
    assert factors["dependent"] == [0, 2, 3]


@pytest.mark.parametrize("shape", [(1, 1), (4, 4), (6, 4), (4, 5)])
def test_that_singular_values_are_numpys(shape):
    matrix = np.random.default_rng(7).normal(size=shape)
    matrix[:, 0] = matrix[:, -1]
    text = f"{LINEAR}.singularValues({json.dumps(matrix.tolist())})"
    found = run(solver_script(folded()), text)[::-1]
    sizes = np.zeros(shape[1])
    sizes[: min(shape)] = np.linalg.svd(matrix, compute_uv=False)
    np.testing.assert_allclose([item["size"] for item in found], sizes, atol=1e-14)
    directions = np.array([item["direction"] for item in found])
    np.testing.assert_allclose(directions @ directions.T, np.eye(shape[1]), atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(matrix @ directions.T, axis=0), sizes, atol=1e-14)


@pytest.mark.every(5)
def test_that_iterates_are_those_of_the_runtime(example):
    module, t = example.module, 0.3
    starts = [guess.tolist() for guess in guesses(module)]
    text = f"{json.dumps(starts)}.map(guess => newton.iterate(emitted, guess, {t}))"
    found = run(solver_script(example.model), text)
    for guess, attempt in zip(starts, found, strict=True):
        q = np.array(guess)
        # The page has the size of the mechanism from the model's guess.
        equations = problem(code_of(module), module.DEFAULTS, module.GUESS, 0.0)
        expected = iterate(equations, t, q, 1e-10, 25)
        assert attempt["status"] == STATUSES[expected.status.name]
        assert len(attempt["iterates"]) == len(expected.points)
        assert [item["correction"] for item in attempt["iterates"]][1:] == pytest.approx(
            expected.corrections, rel=1e-6, abs=1e-12
        )
        for here, there in zip(attempt["iterates"], expected.points, strict=True):
            np.testing.assert_allclose(here["q"], there.q, rtol=1e-9, atol=1e-9)


def test_that_iterates_are_those_of_the_lecture(example_named):
    """Reference case R3, to the digits printed there."""
    example = example_named("problem_3_5_6")
    text = "newton.iterate(emitted, [0.2, 0.2, Math.PI / 4], 0).iterates"
    found = run(solver_script(example.model), text)
    expected = [
        (0.4232233047, 0.1767766953, 0.7853981634), (0.38125, 0.1348033906, 1.0228350305),
        (0.3813100372, 0.1215644989, 1.06347535), (0.3812500401, 0.1210317905, 1.065432028),
        (0.38125, 0.1210307296, 1.0654358165),
    ]  # fmt: skip
    np.testing.assert_allclose([item["q"] for item in found[1:6]], expected, atol=6e-11)
    corrections = (0.2244281, 0.2447443, 0.0427423, 2.028785e-3, 3.93443e-6, 1.511e-11)
    assert [item["correction"] for item in found[1:]] == pytest.approx(corrections, rel=1e-3)
    residuals = (0.2382603, 0.0503680, 7.86896e-3, 2.70813e-4, 5.58e-7, 2.1e-12)
    norms = [np.linalg.norm(item["Phi"]) for item in found[:6]]
    assert norms == pytest.approx(residuals, rel=0.02)


def folded():
    """Return a four-bar whose guess of zeros is singular."""
    m = kc.Mechanism("folded")
    crank, coupler, rocker = (m.body(name) for name in ("crank", "coupler", "rocker"))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-1, 0)))
    m.add(kc.Revolute("B", crank, (1, 0), coupler, (-2, 0)))
    m.add(kc.Revolute("C", coupler, (2, 0), rocker, (-1.5, 0)))
    m.add(kc.Revolute("D", rocker, (1.5, 0), m.ground, (3, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 1 + kc.t))
    return m


def stated(m, guess, motion, t=0.0):
    """Return what the panel says of a run."""
    guess, motion = (json.dumps(None if q is None else list(q)) for q in (guess, motion))
    text = f"newton.statement(emitted, newton.iterate(emitted, {guess}, {t}), {t}, "
    return run(solver_script(m), f"{text}emitted.DEFAULTS, {motion})")


def test_that_the_statement_names_the_branch():
    m = folded()
    first, second = kc.assemblies(kc.compile(m))[:2]
    near = first + 0.01
    assert stated(m, near, first).endswith("iterations to the position of the motion.")
    text = stated(m, near, second)
    assert "to the other branch: det \u03a6_q is " in text
    assert text.endswith(
        "Other than in the motion: x_coupler, y_coupler, phi_coupler, x_rocker, y_rocker, "
        "phi_rocker."
    )
    signs = np.sign(np.linalg.det(kc.compile(m).Phi_q(np.array([first, second]), 0.0)))
    words = {1.0: "positive", -1.0: "negative"}
    assert f"is {words[signs[0]]} there and {words[signs[1]]} in the motion" in text
    assert "the motion has none at this time" in stated(m, near, None)


def test_that_the_statement_counts_whole_turns():
    m = folded()
    first = kc.assemblies(kc.compile(m))[0]
    turned = first + np.eye(9)[8] * 4 * np.pi + 1e-3
    text = stated(m, turned, first)
    assert text.endswith(
        "to the position of the motion, turned further: phi_rocker by 2 \u00d7 2\u03c0."
    )


def test_that_the_statement_names_dependent_columns():
    m = folded()
    text = stated(m, [0.0] * 9, None)
    # On a line only the two lengths along y are determined twice; phi_crank has its driver.
    assert text.startswith("Stopped after 0 iterations: \u03a6_q is singular there, its columns ")
    assert set(text.split("columns ")[1].removesuffix(" depend on each other.").split(", ")) == {
        "y_coupler", "phi_coupler", "y_rocker", "phi_rocker",
    }  # fmt: skip


def test_that_the_statement_says_where_there_is_no_convergence():
    x = sympy.Symbol("x")
    m = kc.ConstraintSystem("none", "x", [x**2 + 1])
    assert stated(m, [0.3], None).startswith("No convergence in 25 iterations: ")
    m = kc.ConstraintSystem("double", "x", [(x - 1) ** 2])
    for far in (0.3, 30.0):
        text = stated(m, [far], None)
        assert "iterations the corrections still only halve: \u03a6_q is singular" in text
        assert text.endswith("its column x vanishes.")
    m = kc.ConstraintSystem("root", "x", [sympy.sqrt(x) + 1])
    text = stated(m, [0.3], None)
    assert text == "Stopped after 0 iterations: the equations have no finite value at the next one."


def test_that_a_lock_up_is_named(example_named):
    m = example_named("problem_3_5_6").model
    # At t = 4.5 sin(phi3) = -1: the last position, and Phi_q is singular there.
    text = stated(m, [0.85, 0.0, -1.4], None, 4.5)
    assert "the corrections still only halve: \u03a6_q is singular" in text
    assert "phi3" in text
    assert stated(m, [0.85, 0.0, -1.4], None, 4.6).startswith("No convergence in 25 ")


def test_that_the_script_has_no_name_of_the_mechanism_outside():
    m = folded()
    assert solver_script(m).startswith("const emitted = (() => {\n")
    assert "</" not in solver_script(m)


def test_that_the_script_says_why_there_are_no_functions():
    m = kc.Mechanism("many")
    for k in range(MOST_COORDINATES // 3 + 1):
        m.body(f"b{k}")
    m.add(kc.AbsoluteAngle("motor", "b0", kc.t))
    assert solver_script(m) == (
        'const emitted = {"reason": "153 coordinates are too many for a page."};\n'
    )
    m = kc.Mechanism("few")
    m.add(kc.AbsoluteAngle("motor", m.body("b"), kc.t))
    assert solver_script(m).startswith('const emitted = {"reason": "')
    assert "equations for 3 coordinates" in solver_script(m)
