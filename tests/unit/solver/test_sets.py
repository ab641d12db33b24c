"""The text of many parameter sets, on NumPy and in C, beside what the runtime does on arrays."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import kincompile as kc
from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.runtime.along import lead_together
from kincompile.runtime.attempts import attempted, other_sides, safeguarded
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.problem import problem
from kincompile.runtime.status import Status
from kincompile.solver.words import on_numpy

from .conftest import mechanism_of

COUNT = 40


def sets_of(module, count=COUNT):
    """Return parameters (B, k) around those of a module, of which some cannot be assembled."""
    p = np.repeat(module.DEFAULTS[np.newaxis], count, axis=0)
    p[:, :2] *= np.exp(np.random.default_rng(3).normal(0, 0.5, (count, 2)))
    return p


def known_of(module):
    """Return the inputs of a module at t = 0, its assembled position and the equations there."""
    inputs = read_inputs(module, np.zeros(1), None, None, TOLERANCE, MAX_ITERATIONS)
    q = kc.solve(module, [0.0]).q[0]
    return inputs, q, problem(code_of(module), inputs.p, q, 0.0)


def on_text(module, lanes, name, p, guesses, *given):
    """Run a function of the text over sets; return what it writes: q (n, B) and statuses (B,)."""
    text, (n, count) = on_numpy(mechanism_of(module, lanes)), guesses.shape
    written = {x: np.full((n, 1, count), np.nan) for x in ("q", "q_dot", "q_ddot")}
    said = {x: np.zeros(count, int) for x in ("status", "iterations")}
    m = text.Variants(
        count=1, variants=count, t=np.zeros(1), p=p.T, guess=guesses, size=known_of(module)[2].size,
        tolerance=TOLERANCE, max_iterations=MAX_ITERATIONS, residual=np.zeros(count),
        **written, **said,
    )  # fmt: skip
    with np.errstate(all="ignore"):
        vars(text)[name](m, *given)
    return written["q"][:, 0], said["status"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "rssr"])
def test_that_attempts_come_near_where_those_on_arrays_do(example_named, name, quick_compiler):
    example = example_named(name)
    p, (_, q, equations) = sets_of(example.module), known_of(example.module)
    away = 0.3 * equations.reference * np.random.default_rng(5).uniform(-1, 1, (COUNT, q.size))
    expected, found = ((q + away).T.copy() for _ in range(2))
    given = p, np.zeros(COUNT)
    with np.errstate(all="ignore"):
        is_near = attempted(equations, *given, expected, MAX_ITERATIONS)
    assert 5 < is_near.sum() < COUNT - 5
    own = replace(equations, code=code_of(example.native))
    np.testing.assert_array_equal(attempted(own, *given, found, MAX_ITERATIONS), is_near)
    text, status = on_text(example.module, 7, "attempt_variants", p, (q + away).T.copy())
    np.testing.assert_array_equal(status == Status.CONVERGED, is_near)
    for reached in (found, text):
        np.testing.assert_allclose(reached[:, is_near], expected[:, is_near], rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["four_bar", "rssr"])
def test_that_lines_of_parameters_lead_where_steps_on_arrays_do(
    example_named, name, quick_compiler
):
    example = example_named(name)
    module, p, (inputs, q, equations) = (
        example.module,
        sets_of(example.module),
        known_of(example.module),
    )
    with np.errstate(all="ignore"):
        expected, reached, crosses = lead_together(inputs, equations, q, p)
    assert not crosses.any()
    assert 5 < reached.sum() < COUNT - 5
    given = inputs.p, 0.0, q, p, equations.size, TOLERANCE, MAX_ITERATIONS
    begins = np.repeat(inputs.p[np.newaxis], COUNT, axis=0)
    guesses = np.repeat(q[:, np.newaxis], COUNT, axis=1)
    lead = code_of(example.native).lead
    assert lead is not None
    ways = (
        partial(lead, *given),
        partial(on_text, module, 7, "lead_variants", begins, guesses, p.T),
    )
    for way in ways:
        found, status = way()
        np.testing.assert_array_equal(status == Status.CONVERGED, reached)
        assert (status[~reached] == Status.LOCK_UP).all()
        np.testing.assert_allclose(found[:, reached], expected[:, reached], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["four_bar", "rssr"])
def test_that_the_other_side_is_that_of_the_smallest_singular_value(
    example_named, name, quick_compiler
):
    example, size = example_named(name), 0.1
    p, (_, q, equations) = sets_of(example.module), known_of(example.module)
    rng = np.random.default_rng(4)
    places = q[:, np.newaxis] + size * equations.reference[:, np.newaxis] * rng.uniform(
        -1, 1, (q.size, COUNT)
    )
    expected = other_sides(equations, p, 0.0, places)
    own = replace(equations, code=code_of(example.native))
    text, _ = on_text(example.module, 7, "mirror_variants", p, places.copy(), equations.magnitude)
    way = np.abs(expected - places).max(axis=0)
    for found in (other_sides(own, p, 0.0, places), text):
        assert (np.abs(found - expected).max(axis=0) < 1e-3 * way).mean() > 0.9
        np.testing.assert_allclose(found[:, :10], expected[:, :10], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("target", ["module", "native"])
def test_that_attempts_decide_at_the_very_edge_of_the_reach(example_named, target, quick_compiler):
    """Coupler and rocker reach the crank's end where it is at most b + c away."""
    module = getattr(example_named("four_bar"), target)
    beyond = np.array([s * 10.0**-k for k in range(1, 10) for s in (-1, 1)])
    place, (a, b, c, *_) = module.PARAMETERS.index("d"), module.DEFAULTS
    p = np.repeat(module.DEFAULTS[np.newaxis], beyond.size, axis=0)
    p[:, place] = a + (b + c) * (1 + beyond)  # the crank lies along the ground at t = 0
    _, q, equations = known_of(module)
    near = safeguarded(equations, p, 0.0, np.repeat(q[np.newaxis], beyond.size, axis=0), 100)
    is_near = np.isfinite(near[0])
    assert is_near[beyond < 0].all()
    assert not is_near[beyond > 1e-5].any()
