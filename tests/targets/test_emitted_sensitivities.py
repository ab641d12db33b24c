"""A mechanism emitted with its sensitivities, run in every language beside `kc.sensitivities`."""

import json
import runpy

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native

from .conftest import NODE, in_node

NAMES = ("b", "omega")
TIMES = np.linspace(0, 2, 9)


@pytest.fixture
def four_bar(example_named):
    """Return a four-bar of its own, with an output."""
    mechanism = runpy.run_path(str(example_named("four_bar").path))["mechanism"]
    coupler = mechanism.bodies[1]
    mechanism.output("lift", coupler.y * coupler.x, "m^2")
    return mechanism


def expected(model):
    """Return the motion with its sensitivities, and the outputs with theirs, for each order."""
    solution = kc.solve(kc.compile(model), TIMES)
    found = kc.sensitivities(solution, NAMES)
    seen = solution.observed
    pairs = {
        "q": (solution.q, found.q_p),
        "q_dot": (solution.q_dot, found.q_dot_p),
        "q_ddot": (solution.q_ddot, found.q_ddot_p),
        "y": (seen.y, found.y_p),
        "y_dot": (seen.y_dot, found.y_dot_p),
        "y_ddot": (seen.y_ddot, found.y_ddot_p),
    }
    return {
        name: np.concatenate((own, *np.moveaxis(parts, -1, 0)), axis=-1)
        for name, (own, parts) in pairs.items()
    }


def assert_same(found, known):
    for name, values in known.items():
        mine = np.array(found[name], dtype=float).reshape(values.shape)
        np.testing.assert_allclose(mine, values, rtol=1e-9, atol=1e-9 * np.abs(values).max())


def in_numpy(model):
    return from_source(kc.emit(model, sensitivities=NAMES).source, "four_bar")


def assert_motion(module, model):
    solution = kc.solve(module, TIMES)
    assert solution.success, solution.message
    seen = solution.observed
    motion = (solution.q, solution.q_dot, solution.q_ddot, seen.y, seen.y_dot, seen.y_ddot)
    known = expected(model)
    assert_same(dict(zip(known, motion, strict=True)), known)


def test_that_numpy_solves_for_them(four_bar):
    assert_motion(in_numpy(four_bar), four_bar)


def test_that_c_solves_for_them(four_bar, quick_compiler):
    files = kc.emit(four_bar, "c", sensitivities=NAMES).files
    assert_motion(make_native(in_numpy(four_bar), files), four_bar)


@pytest.mark.skipif(NODE is None, reason="node is not installed")
def test_that_javascript_solves_for_them(four_bar, tmp_path):
    source = kc.emit(four_bar, "javascript", sensitivities=NAMES).source
    (tmp_path / "model.js").write_text(source, encoding="utf-8")
    module = in_numpy(four_bar)
    given = ", ".join(json.dumps(x.tolist()) for x in (TIMES, module.DEFAULTS, module.GUESS))
    text = f"""(() => {{
      const motion = four_bar.solver.solve(four_bar, {given});
      const names = ["q", "q_dot", "q_ddot", "y", "y_dot", "y_ddot"];
      return JSON.stringify(Object.fromEntries(names.map(x => [x, Array.from(motion[x])])));
    }})()"""
    assert_same(json.loads(in_node(tmp_path, {"model": "four_bar"}, text)), expected(four_bar))


def test_that_octave_evaluates_them(four_bar, octave, tmp_path):
    kc.emit(four_bar, "octave", sensitivities=NAMES).write(tmp_path)
    module = in_numpy(four_bar)
    solution = kc.solve(module, TIMES[:2])
    q, q_dot = (json.dumps(x[1].tolist()) for x in (solution.q, solution.q_dot))
    t = float(TIMES[1])
    found = octave(
        [
            f"show('gamma', four_bar_gamma({q}, {q_dot}, {t!r}));",
            f"show('Phi_q', four_bar_Phi_q({q}, {t!r}));",
        ]
    )
    gamma = module.gamma(solution.q[1], solution.q_dot[1], t)
    np.testing.assert_allclose(np.ravel(found["gamma"]), gamma, rtol=1e-11, atol=1e-11)
    known = module.Phi_q(solution.q[1], t)
    # Octave shows a matrix column by column.
    np.testing.assert_allclose(np.reshape(found["Phi_q"], known.shape).T, known, atol=1e-12)
