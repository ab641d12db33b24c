"""Mass matrix and generalised forces in every target, against Lagrange's equations by SymPy.

The oracle knows energies, forces and places alone, written out here:
M is T_q_dot_q_dot, and Q is T_q - (T_q_dot)_q q_dot - V_q and the forces times the slopes of their
places.
"""

import json
import shutil
import subprocess
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy
from sympy import cos, sin, sqrt

import kincompile as kc
from kincompile.emitters.emission import emit_program
from kincompile.ir.inline import inline
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.model.laws import TableLaw
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native

NAMES = ("M", "Q", "Q_q", "Q_q_dot")
STATES = 4
TABLE = [-2, -1, 0.5, 2], [1, 4, 2, 0.5]


def loaded():
    """Return a mechanism with loads of every type, values of every kind, and a plate."""
    m = kc.Mechanism("loaded")
    k, g = m.parameter("k", 70.0), m.parameter("g", 9.81)
    m.gravity = (0.3, -g)
    arm = m.body("arm", mass=1.3, inertia=0.02, centre=(0.3, -0.1))
    bob = m.body("bob", mass=0.7 + k / 100, inertia=0.05)
    plate = m.body(
        "plate", outline=((0, 0), (0.3, 0), (0.1, 0.2)), density=7850, thickness=0.01 * g / 9.81
    )
    m.add(kc.Revolute("A", m.ground, (0, 0), arm, (-0.5, 0)))
    m.add(kc.Revolute("B", arm, (0.5, 0), bob, (0, 0.2)))
    m.add(kc.Revolute("D", bob, (0, -0.2), plate, (0, 0)))
    tip = m.point("tip", plate, (0.3, 0.1))
    m.add(kc.Force("push", bob, (0.1, 0.2), (3 * kc.t, 2 + arm.x * tip.y)))
    m.add(kc.FollowerForce("jet", plate, (0.1, 0), (4, -2 * bob.x_dot * arm.phi)))
    m.add(kc.Torque("servo", arm, 5 * sympy.sin(kc.t) - plate.phi_dot))
    m.add(
        kc.Spring("s", arm, (0.2, 0.1), plate, (0.05, 0.07), k, 0.4, 1.5, force=tip.x_dot * bob.phi)
    )
    m.add(kc.Spring("stay", m.ground, (3, 3), arm, (0.1, 0), stiffness=12))
    m.add(kc.TorsionSpring("clock", arm, bob, 8, 0.3, 0.25, torque=2 * arm.phi_dot**2))
    m.add(kc.HingeFriction("dry", bob, plate, 1.7, 0.2))
    m.add(kc.SliderFriction("rub", arm, (0, 0), (3, 4), plate, (0.1, 0.1), 2.5, 0.3))
    cut = kc.motion.table(*TABLE)
    m.add(kc.Force("cut", arm, (0, 0), (cut.subs(kc.t, bob.x), 0)))
    return m


def place(body: Any, point: Any) -> Any:
    """Return a point of a body as a column."""
    x, y, phi = body
    turn = sympy.Matrix([[cos(phi), -sin(phi)], [sin(phi), cos(phi)]])
    return sympy.Matrix([x, y]) + turn * sympy.Matrix(point)


@cache
def oracle():
    """Return M and Q as functions of q, q_dot, t, k, g and the cutting force."""
    names = [f"{letter}_{body}" for body in ("arm", "bob", "plate") for letter in ("x", "y", "phi")]
    q: Any = sympy.Matrix(sympy.symbols(names))
    q_dot: Any = sympy.Matrix(sympy.symbols([f"{name}_dot" for name in names]))
    t, k, g = sympy.symbols("t k g")
    arm, bob, plate = tuple(q[:3]), tuple(q[3:6]), tuple(q[6:])

    def rate(expression):
        return (sympy.Matrix([expression]).jacobian(q) * q_dot)[0]

    def speed(point):
        return point.jacobian(q) * q_dot

    area, x, y = 0.03, 0.4 / 3, 0.2 / 3
    # Of a triangle: area/36 (sum of squared sides), about its centroid.
    polar = area / 36 * (0.3**2 + (0.2**2 + 0.2**2) + (0.1**2 + 0.2**2))
    sheet = 7850 * 0.01 * g / 9.81
    masses = (
        (arm, 1.3, 0.02, (0.3, -0.1)),
        (bob, 0.7 + k / 100, 0.05, (0, 0)),
        (plate, sheet * area, sheet * polar, (x, y)),
    )
    kinetic, potential = sympy.S.Zero, sympy.S.Zero
    for number, (body, mass, inertia, centre) in enumerate(masses):
        at = place(body, centre)
        v = speed(at)
        kinetic += mass * v.dot(v) / 2 + inertia * q_dot[3 * number + 2] ** 2 / 2
        potential -= mass * (0.3 * at[0] - g * at[1])
    tip = place(plate, (0.3, 0.1))
    cut = sympy.Function("cut")(bob[0])
    jet = place((0, 0, plate[2]), (4, -2 * q_dot[3] * arm[2]))

    def work(force, displacement):
        return [force * displacement.diff(item) for item in q]

    d = place(plate, (0.05, 0.07)) - place(arm, (0.2, 0.1))
    length = sqrt(d.dot(d))
    pull = k * (length - 0.4) + 1.5 * rate(length) + speed(tip)[0] * bob[2]
    stay = place(arm, (0.1, 0)) - sympy.Matrix([3, 3])
    potential += 6 * stay.dot(stay)
    potential += 4 * (bob[2] - arm[2] - 0.3) ** 2
    damped = 0.25 * (q_dot[5] - q_dot[2]) + 2 * q_dot[2] ** 2
    slip = q_dot[8] - q_dot[5]
    axis = place((0, 0, arm[2]), (0.6, 0.8))
    way = axis.dot(place(plate, (0.1, 0.1)) - place(arm, (0, 0)))
    glide = rate(way)
    terms = [
        work(-pull, length),
        work(-damped, bob[2] - arm[2]),
        work(-1.7 * slip / sqrt(slip**2 + 0.04), plate[2] - bob[2]),
        work(-2.5 * glide / sqrt(glide**2 + 0.09), way),
    ]
    applied = generalised(
        [
            (sympy.Matrix([3 * t, 2 + arm[0] * tip[1]]), place(bob, (0.1, 0.2))),
            (jet, place(plate, (0.1, 0))),
            (sympy.Matrix([cut, 0]), place(arm, (0, 0))),
            (sympy.Matrix([5 * sin(t) - q_dot[8]]), sympy.Matrix([arm[2]])),
        ],
        q,
    )
    momentum = sympy.Matrix([kinetic.diff(item) for item in q_dot])
    Q = [
        (kinetic - potential).diff(q[n])
        - (momentum[n : n + 1, :].jacobian(q) * q_dot)[0]
        + sum(term[n] for term in (*terms, applied))
        for n in range(9)
    ]
    matrices = {"M": momentum.jacobian(q_dot), "Q": sympy.Matrix(Q)}
    symbols = [*q, *q_dot, t, k, g, sympy.Symbol("force")]
    return {
        name: sympy.lambdify(symbols, matrix.xreplace({cut: symbols[-1]}).tolist(), cse=True)
        for name, matrix in matrices.items()
    }


def generalised(pairs: Any, q: Any) -> Any:
    """Return generalised forces of pairs of a force and the point that it acts on."""
    return [sum(force.dot(point.diff(item)) for force, point in pairs) for item in q]


def states():
    rng = np.random.default_rng(8)
    shape = (STATES, 9)
    p = np.array([70.0, 9.81]) * rng.uniform(0.7, 1.4, (STATES, 2))
    return rng.uniform(-1, 1, shape), rng.uniform(-2, 2, shape), rng.uniform(0, 1, STATES), p


@cache
def expected():
    """Return the quantities at all states, from the oracle; Jacobians of Q by complex steps."""
    (law,) = kc.motion.table(*TABLE).atoms(TableLaw)

    def at(name, state):
        q_4 = state[3]
        force = law.table(q_4.real, 0) + 1j * q_4.imag * law.table(q_4.real, 1)
        return np.array(oracle()[name](*state, force), dtype=complex).squeeze()

    found: dict[str, list[Any]] = {name: [] for name in NAMES}
    for rows in zip(*states(), strict=True):
        state = np.hstack(rows).astype(complex)
        steps = [state + 1e-30j * (np.arange(state.size) == k) for k in range(18)]
        slopes = np.array([at("Q", step).imag / 1e-30 for step in steps]).T
        found["M"].append(at("M", state).real)
        found["Q"].append(at("Q", state).real)
        found["Q_q"].append(slopes[:, :9])
        found["Q_q_dot"].append(slopes[:, 9:])
    return {name: np.array(rows) for name, rows in found.items()}


@pytest.fixture(scope="module")
def program():
    return lower(loaded().system())


def assert_equal(found, name):
    scale = np.abs(expected()[name]).max()
    np.testing.assert_allclose(found, expected()[name], rtol=1e-11, atol=1e-12 * scale)


def arguments(name):
    q, q_dot, t, p = states()
    return (q, t, p) if name == "M" else (q, q_dot, t, p)


def test_that_the_interpreter_has_them(program):
    q, q_dot, t, p = states()
    found = interpret(program, q, q_dot, t, p.T)
    names = [item.name for item in program.quantities]
    assert names[-4:] == list(NAMES)
    for name in NAMES:
        assert_equal(found[names.index(name)], name)


@pytest.mark.parametrize("form", ["inline", "grouped"])
def test_that_a_numpy_module_has_them(form):
    module = kc.compile(loaded(), form=form)
    assert module.LOADS[:4] == ("arm", "bob", "plate", "push")
    for name in NAMES:
        function, given = getattr(module, name), arguments(name)
        assert_equal(function(*given), name)
        one = [function(*(part[k] for part in given)) for k in range(STATES)]
        assert_equal(np.array(one), name)
        if name != "Q":
            pattern = getattr(module, f"PATTERN_{name}")
            nonzeros = getattr(module, f"{name}_nonzeros")(*given)
            np.testing.assert_array_equal(nonzeros, function(*given)[(..., *pattern.T)])


def test_that_compiled_c_has_them(program, quick_compiler):
    code = inline(program)
    module = from_source(emit_program("numpy", code).source, program.name)
    native = make_native(module, emit_program("c", code).files)
    for name in NAMES:
        assert_equal(getattr(native, name)(*arguments(name)), name)


@pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")
def test_that_javascript_has_them(program, tmp_path):
    (tmp_path / "module.js").write_text(emit_program("javascript", inline(program)).source)
    given = {name: [[row.tolist() for row in part] for part in arguments(name)] for name in NAMES}
    script = f"""
    const m = require("./module.js"), given = {json.dumps(given)}, found = {{}};
    for (const name of Object.keys(given)) {{
        const parts = given[name];
        found[name] = parts[0].map((_, k) => m[name](...parts.map((part) => part[k])));
    }}
    console.log(JSON.stringify(found));
    """
    done = subprocess.run(
        ["node", "-e", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    for name, found in json.loads(done.stdout).items():
        assert_equal(np.array(found), name)


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="octave-cli is not installed")
def test_that_octave_has_them(program, octave, tmp_path):
    emit_program("octave", inline(program)).write(tmp_path)
    lines = []
    for name in NAMES:
        for rows in zip(*arguments(name), strict=True):
            texts = (f"{json.dumps(row.tolist())}'" for row in rows)
            lines.append(f"show('{name}', {program.name}_{name}({', '.join(texts)})');")
    found = octave(lines)
    for name in NAMES:
        assert_equal(np.array(found[name]).reshape(expected()[name].shape), name)


@pytest.mark.slow
def test_that_sympy_shows_them():
    m = loaded()
    symbols = [*m.q, *m.q_dot, kc.t, *sympy.symbols("k g")]
    for name, matrix in (("M", m.M), ("Q", m.Q)):
        plain = matrix.replace(lambda e: isinstance(e, TableLaw), lambda e: e.in_pieces())
        for k, state in enumerate(zip(*states(), strict=True)):
            numbers = dict(zip(symbols, np.hstack(state).tolist(), strict=True))
            found = np.array(plain.subs(numbers).evalf().tolist(), dtype=float)
            reference = expected()[name][k].reshape(found.shape)
            np.testing.assert_allclose(found, reference, rtol=1e-9, atol=1e-10)


def test_that_a_model_without_loads_has_none_of_it(example_named):
    module = example_named("four_bar").module
    assert not hasattr(module, "LOADS")
    assert not hasattr(module, "M")
    assert "M" not in [item.name for item in lower(kc.Mechanism.system(free())).quantities]


def free():
    m = kc.Mechanism("free")
    arm = m.body("arm")
    m.add(kc.Revolute("A", m.ground, (0, 0), arm, (-0.5, 0)))
    return m
