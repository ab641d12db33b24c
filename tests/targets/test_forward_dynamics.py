"""Accelerations and multipliers in every target, against dense solves and kc.simulate.

The oracle is the solve of [M Phi_q^T; Phi_q 0] by LAPACK, of the rows that repeat no other.
"""

import json
import shutil
import subprocess
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp  # type: ignore[attr-defined]  # a star there

import kincompile as kc
from kincompile import spatial
from kincompile.ir.interpret import interpret
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native

STATES = 3


def mixed():
    """A crank with a motor that carries a pendulum, whose length is a parameter."""
    m = kc.Mechanism("mixed", end=1.5, points=4)
    m.gravity = (0, -9.81)
    length = m.parameter("L", 0.4, unit="m")
    crank = m.body("crank", mass=2, inertia=0.1)
    bob = m.body("bob", (0.5, -0.4, -np.pi / 2), mass=0.7, inertia=0.02, centre=(0.05, 0.02))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 0.3 * kc.t + 2 * kc.t**2))
    m.add(kc.Revolute("A", crank, (0.5, 0), bob, (-length, 0)))
    m.add(kc.TorsionSpring("damper", crank, bob, 0.2, 0.0, 0.05))
    return m


def repeated():
    """A parallelogram with a third crank, which repeats what two cranks say."""
    m = kc.Mechanism("repeated", end=1)
    m.gravity = (0, -9.81)
    rod = m.body("rod", (1, 1, 0), mass=3, inertia=0.5)
    for k in range(3):
        crank = m.body(f"crank_{k}", (k, 0.5, np.pi / 2), mass=1, inertia=0.1)
        m.add(kc.Revolute(f"O_{k}", m.ground, (k, 0), crank, (-0.5, 0)))
        m.add(kc.Revolute(f"A_{k}", crank, (0.5, 0), rod, (k - 1, 0)))
    return m


def rolling():
    """Two bodies in space: a hinge that is not along an axis, and a ball joint."""
    m = spatial.Mechanism("rolling")
    m.gravity = (0, 0, -9.81)
    arm = m.body("arm", mass=1.5, inertia=(0.1, 0.2, 0.15), centre=(0.3, 0.1, 0))
    bob = m.body("bob", mass=0.5, inertia=(0.02, 0.03, 0.04))
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), (0, 1, 2), arm, (0, 0, 0), (0, 1, 2)))
    m.add(spatial.Spherical("A", arm, (1, 0, 0), bob, (0, 0, 0.3)))
    return m


MODELS = {"mixed": mixed, "repeated": repeated, "rolling": rolling}


@cache
def emitted(name, target="numpy"):
    return kc.emit(MODELS[name](), target, dynamics=True)


@cache
def module_of(name):
    return from_source(emitted(name).source, name)


@cache
def states(name):
    """Random states off the manifold, near the guess, and sets of parameters."""
    module, rng = module_of(name), np.random.default_rng(5)
    q = module.GUESS + rng.uniform(-0.4, 0.4, (STATES, module.N_COORDINATES))
    p = module.DEFAULTS * rng.uniform(0.8, 1.2, (STATES, module.DEFAULTS.size))
    return q, rng.uniform(-2, 2, q.shape), rng.uniform(0, 1, STATES), p


@cache
def expected(name):
    """Accelerations and multipliers, by dense solves of the equations that repeat no other."""
    module, found = module_of(name), []
    left_out = {"repeated": 1}.get(name, 0)
    n, m = module.N_COORDINATES, module.N_EQUATIONS
    zeros = module.multipliers(*states(name)) == 0
    kept = np.flatnonzero(~zeros.all(axis=0))
    assert m - kept.size == left_out
    for q, q_dot, t, p in zip(*states(name), strict=True):
        Phi_q = module.Phi_q(q, t, p)[kept]
        matrix = np.block([[module.M(q, t, p), Phi_q.T], [Phi_q, np.zeros((kept.size, kept.size))]])
        sides = np.concatenate((module.Q(q, q_dot, t, p), module.gamma(q, q_dot, t, p)[kept]))
        solution, row = np.linalg.solve(matrix, sides), np.zeros(n + m)
        row[np.concatenate((np.arange(n), n + kept))] = solution
        found.append(row)
    both = np.array(found)
    return {"accelerations": both[:, :n], "multipliers": both[:, n:]}


def assert_equal(name, quantity, found):
    known = expected(name)[quantity]
    np.testing.assert_allclose(found, known, rtol=1e-9, atol=1e-11 * np.abs(known).max())


@pytest.mark.parametrize("name", MODELS)
def test_that_a_numpy_module_has_them(name):
    module, given = module_of(name), states(name)
    both = dict(zip(("accelerations", "multipliers"), module.forward_dynamics(*given), strict=True))
    for quantity, together in both.items():
        function = getattr(module, quantity)
        assert_equal(name, quantity, together)
        np.testing.assert_array_equal(function(*given), together)
        for k, row in enumerate(together):
            one = function(*(part[k] for part in given))
            np.testing.assert_allclose(one, row, rtol=1e-12, atol=1e-12 * np.abs(row).max())


def test_that_compiled_c_has_them(quick_compiler):
    name = "mixed"
    module = from_source(emitted(name).source, name)
    native = make_native(module, emitted(name, "c").files)
    for quantity, found in zip(
        ("accelerations", "multipliers"), native.forward_dynamics(*states(name)), strict=True
    ):
        assert_equal(name, quantity, found)


@pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")
def test_that_javascript_has_them(tmp_path):
    given = {}
    for name in MODELS:
        (tmp_path / f"{name}.js").write_text(emitted(name, "javascript").source)
        given[name] = [[part[k].tolist() for part in states(name)] for k in range(STATES)]
    script = f"""
    const found = {{}};
    for (const [name, states] of Object.entries({json.dumps(given)})) {{
        const m = require(`./${{name}}.js`);
        found[name] = states.map((state) => [m.accelerations(...state), m.multipliers(...state)]);
    }}
    console.log(JSON.stringify(found));
    """
    done = subprocess.run(
        ["node", "-e", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    for name, rows in json.loads(done.stdout).items():
        for quantity, found in zip(
            ("accelerations", "multipliers"), zip(*rows, strict=True), strict=True
        ):
            assert_equal(name, quantity, np.array(found))


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="octave-cli is not installed")
def test_that_octave_has_them_and_integrates(octave, tmp_path):
    """The function of `mixed` runs ode45; SciPy's integrator and kc.simulate find the same."""
    lines = []
    for name in MODELS:
        emitted(name, "octave").write(tmp_path)
        for k in range(STATES):
            texts = ", ".join(f"{json.dumps(part[k].tolist())}'" for part in states(name))
            for quantity in ("accelerations", "multipliers"):
                lines.append(f"show('{name}.{quantity}', {name}_{quantity}({texts}));")
    found = octave(
        [*lines, "[~, Q, ~, ~, ~, LAMBDA] = mixed();", "show('Q', Q);", "show('LAMBDA', LAMBDA);"]
    )
    for name in MODELS:
        for quantity, known in expected(name).items():
            assert_equal(name, quantity, np.reshape(found[f"{name}.{quantity}"], known.shape))
    motion = kc.simulate(kc.compile(mixed()), np.linspace(0, 1.5, 4), rtol=1e-11)
    n, module = motion.q.shape[1], module_of("mixed")
    np.testing.assert_allclose(np.reshape(found["Q"], (4, n)), motion.q, atol=2e-7)
    known = module.multipliers(motion.q, motion.q_dot, motion.t)
    np.testing.assert_allclose(np.reshape(found["LAMBDA"], known.shape), known, atol=1e-5)

    def rate(t, y):
        return np.concatenate((y[n:], module.accelerations(y[:n], y[n:], t)))

    start = np.concatenate((motion.q[0], motion.q_dot[0]))
    own = solve_ivp(rate, (0, 1.5), start, "DOP853", rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(own.y[:n, -1], motion.q[-1], atol=1e-8)


@pytest.mark.slow
def test_that_octave_starts_and_moves_alike_in_every_unit_of_length(octave, tmp_path):
    """From a guess that is not assembled; kc.simulate is the oracle."""
    units, lines = (1e-6, 1.0, 1e6), []
    for k, unit in enumerate(units):
        m = kc.Mechanism(f"pendulum_{k}", end=2.0, points=5)
        m.gravity = (0, -9.81 * unit)
        a = m.body("a", guess=(0, -unit, 0), mass=1.0, inertia=0.1 * unit**2)
        b = m.body("b", (unit / 2, -2 * unit, 0.2), mass=1.0, inertia=0.1 * unit**2)
        m.add(kc.Revolute("O", m.ground, (0, 0), a, (0, unit)))
        m.add(kc.Revolute("A", a, (0, -unit), b, (-unit / 2, 0)))
        kc.emit(m, "octave", dynamics=True).write(tmp_path)
        lines += [f"[~, Q] = {m.name}();", f"show('{k}', Q([3, 6], :));"]
    found = octave(lines)
    known = kc.simulate(kc.compile(m), np.linspace(0, 2, 5), rtol=1e-11)
    angles = np.column_stack((known["phi_a"], known["phi_b"]))
    for k in range(len(units)):
        np.testing.assert_allclose(np.reshape(found[str(k)], (5, 2)), angles, atol=2e-6)


def test_that_the_interpreter_has_them():
    from kincompile.ir.accelerations import with_motion
    from kincompile.ir.inline import inline
    from kincompile.ir.lower import lower

    program = with_motion(inline(lower(mixed().system())))
    q, q_dot, t, p = states("mixed")
    found = interpret(program, q, q_dot, t, p.T)
    for quantity, values in zip(("accelerations", "multipliers"), found[-2:], strict=True):
        assert_equal("mixed", quantity, values)


def test_what_has_no_equations_of_motion():
    bare = kc.Mechanism("bare")
    arm = bare.body("arm")
    bare.add(kc.Revolute("A", bare.ground, (0, 0), arm, (0.5, 0)))
    with pytest.raises(kc.InputError, match="bare has no masses and no forces"):
        kc.emit(bare, dynamics=True)
    light = mixed()
    light.add(kc.Revolute("B", light.body("tail"), (0, 0), light.bodies[1], (0, 0)))
    with pytest.raises(kc.StructuralError, match="tail has no mass"):
        kc.emit(light, dynamics=True)
    with pytest.raises(kc.UnsupportedError, match="no equations of motion"):
        kc.emit(mixed(), form="grouped", dynamics=True)
