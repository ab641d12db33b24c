"""Emitted derivatives of random mechanisms, against complex steps of SymPy's own Phi.

Phi is lambdified from `system.Phi`, and nothing else of it is used: Phi_q is its complex step by a
coordinate, nu by time, gamma minus the second derivative along a line. Off the manifold, in both
forms, of seeded mechanisms.
"""

import json
import shutil
import subprocess

import numpy as np
import pytest
import sympy
from hypothesis import HealthCheck, given, settings

import kincompile as kc
from tests.targets.test_random_mechanisms import is_usable, mechanisms

STEP, SHORT = 1e-30, 1e-4
P = np.array([0.9, 0.35])


def quantities_of(system, q, q_dot, t):
    """Return Phi, Phi_q, nu and gamma at one state, by complex steps of SymPy's Phi."""
    names = [sympy.Symbol(item.name) for item in system.parameters]
    function = sympy.lambdify([list(system.q), kc.t, names], list(system.Phi), "numpy")

    def Phi(q, t):
        return np.array([complex(value) for value in function(q, t, P)])

    def slope(s):  # along the line
        moved = Phi(q + (s + 1j * STEP) * q_dot, t + s + 1j * STEP)
        return moved.imag / STEP

    Phi_q = np.array([Phi(q + 1j * STEP * e, t).imag / STEP for e in np.eye(q.size)]).T
    nu = -Phi(q, t + 1j * STEP).imag / STEP
    near, far = (slope(h) - slope(-h) for h in (SHORT, 2 * SHORT))
    return Phi(q, t).real, Phi_q, nu, -(8 * near - far) / (12 * SHORT)


def close(found, known, digits):
    """Compare with the largest number of a quantity: what cancels leaves its rounding error."""
    size = 1 + np.max(np.abs(known), initial=0.0)
    np.testing.assert_allclose(found, known, rtol=0, atol=digits * size)


def check(model, form):
    """Compare one mechanism; return the number of entries, and a state with its quantities."""
    system, random = model.system(), np.random.default_rng(21)
    module = kc.compile(model, form=form)
    q, q_dot = random.normal(size=(2, module.N_COORDINATES))
    known = quantities_of(system, q, q_dot, 0.3)
    found = module.kinematics(q, q_dot, 0.3, P)
    for ours, theirs, digits in zip(found, known, (1e-14, 1e-13, 1e-13, 1e-9), strict=True):
        close(ours, theirs, digits)
    for name, theirs in zip(("Phi", "Phi_q", "nu"), known, strict=False):
        close(getattr(module, name)(q, 0.3, P), theirs, 1e-13)
    close(module.gamma(q, q_dot, 0.3, P), known[3], 1e-9)
    return sum(np.size(value) for value in known), (q, q_dot, known)


def compare_many(count, record):
    """Compare so many random mechanisms in both forms."""
    tried, entries = [], []

    @settings(max_examples=count, suppress_health_check=list(HealthCheck))
    @given(mechanisms())
    def one(model):
        if is_usable(model):
            for form in ("inline", "grouped"):
                entries.append(check(model, form)[0])
            tried.append(model)

    one()
    record(tried=sum(entries), wrong=0)
    assert len(tried) > 0.3 * count


def test_the_derivatives_of_a_few_mechanisms(record):
    compare_many(10, record)


@pytest.mark.slow
def test_the_derivatives_of_many_mechanisms(record):
    compare_many(120, record)


@pytest.mark.slow
def test_the_derivatives_in_javascript(tmp_path, record):
    node = shutil.which("node") or shutil.which("nodejs")
    if node is None:
        pytest.skip("node is not installed (Debian: nodejs)")
    cases, known = [], []

    @settings(max_examples=50, suppress_health_check=list(HealthCheck))
    @given(mechanisms())
    def one(model):
        if is_usable(model):
            _, (q, q_dot, values) = check(model, "inline")
            source = kc.emit(model, "javascript").source
            cases.append([source, q.tolist(), q_dot.tolist()])
            known.append(values)

    one()
    (tmp_path / "all.json").write_text(json.dumps(cases))
    script = """
    const vm = require("vm"), p = [0.9, 0.35], t = 0.3;
    const cases = JSON.parse(require("fs").readFileSync("all.json"));
    console.log(JSON.stringify(cases.map(([text, q, q_dot]) => {
        const sandbox = { module: { exports: {} } };
        vm.runInNewContext(text, sandbox);
        const m = sandbox.module.exports;
        return [m.Phi(q, t, p), m.Phi_q(q, t, p), m.nu(q, t, p), m.gamma(q, q_dot, t, p)];
    })))"""
    done = subprocess.run(
        [node, "-e", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    entries = 0
    for found, values in zip(json.loads(done.stdout), known, strict=True):
        for ours, theirs in zip(found, values, strict=True):
            close(np.array(ours), theirs, 1e-9)
            entries += theirs.size
    record(tried=entries, wrong=0)
