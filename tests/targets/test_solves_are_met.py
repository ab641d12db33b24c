"""Forces, sensitivities and accelerations beside solves with 60 digits, where plain plans fail.

Gears whose radii cancel in decimals, 0.1 - 0.3 / 3, leave elimination in a fixed order a rounding
error for a pivot; masses of very different size leave it few digits. What misses its equations by
more than `criteria.SOLVED` is solved for with pivots, or refused.
"""

import json
import random
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native

from .conftest import NODE, in_node

T = np.array([0.01, 0.05])
MINORS = [
    "3 1 0.3 0.1", "0.7 0.1 2.1 0.3", "0.1 0.2 0.3 0.6", "1.1 0.3 2.2 0.6", "0.6 0.2 0.9 0.3",
    "1.4 0.2 0.7 0.1", "3 0.7 0.9 0.21", "0.3 0.1 0.6 0.2", "0.9 0.3 3.3 1.1", "0.05 0.15 0.1 0.3",
]  # fmt: skip
"""Coefficients of two wheels in two equations whose determinant is zero."""


class Wheels:
    """Wheels pinned to the ground, coupled by equations in their angles."""

    def __init__(self, guess, parameters, build):
        self.guess, self.parameters = guess, parameters
        self.angles = sympy.symbols(f"w0:{len(guess)}")
        exact = build(self.angles, {name: sympy.Symbol(name) for name in parameters})
        start = dict(zip(self.angles, map(sympy.Rational, guess), strict=True))
        start |= {sympy.Symbol(name): sympy.Rational(x) for name, x in parameters.items()}
        sizes = [round(float(sympy.N(x.subs(kc.t, 0).subs(start))), 12) for x in exact]
        self.equations = [
            x - sympy.Rational(str(size)) for x, size in zip(exact, sizes, strict=True)
        ]

    def mechanism(self, moved=0.0):
        """Return the mechanism; defaults of parameters are moved by a part."""
        m = kc.Mechanism("wheels")
        for k, (name, value) in enumerate(self.parameters.items()):
            m.parameter(name, float(sympy.Rational(value)) * (1 + moved * (k % 3 - 1)))
        wheels = []
        for k, angle in enumerate(self.guess):
            wheels.append(
                m.body(
                    f"w{k}", (k, 0, float(sympy.Rational(angle))), mass=1, inertia=self.inertia(k)
                )
            )
            m.add(kc.Revolute(f"O{k}", m.ground, (k, 0), wheels[-1], (0, 0)))
            m.add(kc.Torque(f"T{k}", wheels[-1], 0.25 * (k + 1)))
        places = dict(zip(self.angles, (wheel.phi for wheel in wheels), strict=True))
        for k, equation in enumerate(self.equations):
            numbers = equation.atoms(sympy.Rational) - equation.atoms(sympy.Integer)
            written = equation.xreplace({x: sympy.Float(float(x), 17) for x in numbers})
            m.add(kc.Equation(f"e{k}", written.xreplace(places)))
        return m

    @staticmethod
    def inertia(k):
        return 0.5 + 0.125 * k

    def functions(self):
        """Return what gives Phi, Phi_q, nu and gamma with 60 digits."""
        q, q_dot = (sympy.Matrix(sympy.symbols(f"{x}0:{len(self.guess)}")) for x in "wv")
        Phi = sympy.Matrix(self.equations)
        Phi_q, nu = Phi.jacobian(q), -Phi.diff(kc.t)
        gamma = -(Phi_q * q_dot).jacobian(q) * q_dot - 2 * Phi_q.diff(kc.t) * q_dot
        gamma -= Phi.diff(kc.t, 2)
        names = [q.flat(), q_dot.flat(), kc.t, [sympy.Symbol(name) for name in self.parameters]]
        results = [Phi.flat(), Phi_q.tolist(), nu.flat(), gamma.flat()]
        return sympy.lambdify(names, results, "mpmath", cse=True)


def exact_motion(functions, q, t, p):
    """Return q, q_dot, q_ddot and Phi_q near a position."""
    q, still = [mpmath.mpf(x) for x in q], [mpmath.mpf(0)] * len(q)
    for _ in range(12):
        Phi, Phi_q, _, _ = functions(q, still, t, p)
        change = mpmath.lu_solve(mpmath.matrix(Phi_q), -mpmath.matrix(Phi))
        q = [x + step for x, step in zip(q, change, strict=True)]
        if mpmath.norm(change) < mpmath.mpf(10) ** -50:
            break
    _, Phi_q, nu, _ = functions(q, still, t, p)
    matrix = mpmath.matrix(Phi_q)
    q_dot = list(mpmath.lu_solve(matrix, mpmath.matrix(nu)))
    gamma = functions(q, q_dot, t, p)[3]
    return [q, q_dot, list(mpmath.lu_solve(matrix, mpmath.matrix(gamma)))], matrix


def planetary():
    """Return a planetary gear whose radii cancel beside entries that vary."""

    def build(w, p):
        sun, ring, carrier, planet = w
        return [
            p["three"] * sun + p["one"] * ring - kc.t,
            p["r_3"] * sun + p["r_1"] * ring + p["k"] * sympy.sin(carrier) - kc.t / 2,
            p["k"] * ring + carrier**3 + p["k"] * sympy.sin(planet) + 3 * kc.t / 10,
            p["k"] * planet + sympy.cos(ring) / 2 + p["k"] * carrier - kc.t / 5,
        ]

    radii = {"r_1": "0.1", "k": "0.7", "r_3": "0.3", "one": "1", "three": "3"}
    return Wheels(["0.4", "0.5", "0.3", "0.6"], radii, build)


def random_wheels(seed):
    """Return wheels two of whose coefficients cancel, as numbers or as parameters."""
    rng = random.Random(seed)
    n = rng.choice([4, 4, 5, 6, 7])
    parameters: dict[str, str] = {}
    kind = rng.choice(["parameters", "parameters", "numbers", "mixed"])

    def coefficient(value):
        if kind == "numbers" or (kind == "mixed" and rng.random() < 0.5):
            return sympy.Rational(value)
        parameters[f"p{len(parameters)}"] = str(value)
        return sympy.Symbol(f"p{len(parameters) - 1}")

    def term(angle):
        shift = sympy.Rational(rng.randint(-5, 5), 10)
        terms = (sympy.sin(angle + shift), angle**3 + angle / 2, sympy.cos(3 * angle / 10 + 1))
        return coefficient(sympy.Rational(rng.randint(3, 20), 10)) * rng.choice(terms)

    angles, order = sympy.symbols(f"w0:{n}"), rng.sample(range(n), n)
    (first, second), (k, j) = rng.sample(range(n), 2), rng.sample(range(n), 2)
    a, b, c, d = map(coefficient, rng.choice(MINORS).split())
    rows = []
    for i in range(n):
        others = [order[i], order[(i + 1) % n]]
        others += [rng.randrange(n)] if rng.random() < 0.4 else []
        if i == second:
            others = [x for x in (*others, *range(n)) if x not in (k, j)][:1]
        row = sum((term(angles[x]) for x in others if i != first), sympy.Integer(0))
        row += {first: a * angles[k] + b * angles[j], second: c * angles[k] + d * angles[j]}.get(
            i, 0
        )
        rows.append(row - sympy.Rational(rng.choice([-9, -6, -4, 3, 5, 8]), 10) * kc.t)
    guess = [str(sympy.Rational(rng.randint(-90, 90), 100)) for _ in range(n)]
    return Wheels(guess, parameters, lambda *_: rows)


def is_good(wheels, functions):
    """Say whether the mechanism has a motion from its guess, far from singular positions."""
    p = [mpmath.mpf(x.p) / x.q for x in map(sympy.Rational, wheels.parameters.values())]
    guess = [float(sympy.Rational(x)) for x in wheels.guess]
    try:
        found = [exact_motion(functions, guess, mpmath.mpf(t), p) for t in (0, 0.05)]
    except (ZeroDivisionError, TypeError):  # what mpmath says of a singular matrix
        return False
    matrices = [np.array(matrix.tolist(), dtype=float) for _, matrix in found]
    conditions = [np.linalg.cond(x / np.abs(x).max(axis=1, keepdims=True)) for x in matrices]
    moved = max(abs(float(x) - y) for x, y in zip(found[1][0][0], guess, strict=True))
    return max(conditions) < 200 and moved < 0.3


def missed(found, known):
    """Return the error of numbers relative to the largest of them; infinity for NaN."""
    found, known = (np.asarray(x, dtype=float) for x in (found, known))
    if not np.isfinite(found).all():
        return np.inf
    return float(np.abs(found - known).max() / (np.abs(known).max() + 1e-4))


def errors(wheels, module, names, *, second=False):
    """Return the errors of forces and sensitivities along a motion."""
    mpmath.mp.dps = 60
    functions, n = wheels.functions(), len(wheels.guess)
    p = [mpmath.mpf(x.p) / x.q for x in map(sympy.Rational, wheels.parameters.values())]
    given = {name: float(value) for name, value in zip(wheels.parameters, p, strict=True)}
    solution = kc.solve(module, T, given or None)
    assert solution.success
    own = [module.COORDINATES.index(f"phi_w{k}") for k in range(n)]
    rows = [module.EQUATIONS.index(f"e{k}") for k in range(n)]
    multipliers = kc.forces(solution).multipliers[:, rows]
    slopes: Any = kc.sensitivities(solution, names, second=second) if names else None
    found = {"forces": 0.0, "sensitivities": 0.0, "second": 0.0}
    step = mpmath.mpf(10) ** -20
    for k, t in enumerate(T.tolist()):
        motion, Phi_q = exact_motion(functions, solution.q[k, own], t, p)
        sides = [0.25 * (i + 1) - wheels.inertia(i) * motion[2][i] for i in range(n)]
        factors = mpmath.lu_solve(Phi_q.T, mpmath.matrix(sides))
        found["forces"] = max(found["forces"], missed(multipliers[k], list(factors)))
        for j, name in enumerate(names):
            place = list(wheels.parameters).index(name)
            near = []
            for sign in (1, -1):
                moved = [x + sign * step * (i == place) for i, x in enumerate(p)]
                near.append(exact_motion(functions, motion[0], t, moved)[0])
            for order, known in enumerate((slopes.q_p, slopes.q_dot_p, slopes.q_ddot_p)):
                after, before = near[0][order], near[1][order]
                exact = [(x - y) / (2 * step) for x, y in zip(after, before, strict=True)]
                error = missed(known[k, own, j], exact)
                found["sensitivities"] = max(found["sensitivities"], error)
                if second:
                    parts = zip(after, motion[order], before, strict=True)
                    exact = [(x - 2 * y + z) / step**2 for x, y, z in parts]
                    error = missed(slopes.second[order, k, own, j, j], exact)
                    found["second"] = max(found["second"], error)
    return found


COMPILED = pytest.param("c", marks=pytest.mark.slow)


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("target", ["numpy", COMPILED])
def test_that_forces_and_sensitivities_of_decimal_radii_are_exact(target):
    wheels = planetary()
    found = errors(wheels, kc.compile(wheels.mechanism(), target), ["k"], second=True)
    assert max(found.values()) < 1e-12


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("target", ["numpy", COMPILED])
def test_that_radii_may_cancel_where_the_defaults_do_not(target):
    wheels = planetary()
    module = kc.compile(wheels.mechanism(moved=0.01), target)
    found = errors(wheels, module, ["k"])
    assert max(found.values()) < 1e-12
    solution = kc.solve(module, T, {k: float(x) for k, x in wheels.parameters.items()})
    assert np.isnan(kc.sensitivities(solution, ["k"], second=True).second).all()  # refused


HEAVY = [(1e6, 1.0), (1.0, 1e6), (1e-9, 1e-9)]
"""Masses and inertias of a four-bar that leave its planned accelerations no right digit."""


def chain(masses, *, closed=True):
    """Return a chain of bodies under gravity, its last one on the ground too."""
    m = kc.Mechanism("chain")
    m.gravity = (0, -9.81)
    bodies = [m.ground]
    for k, (mass, inertia) in enumerate(masses):
        given = {"mass": mass, "inertia": inertia, "centre": (0.1, 0)}
        bodies.append(m.body(f"b{k}", (k + 0.5, 0, 0.3 * k), **given))
        place = (0.5, 0) if k else (0, 0)
        m.add(kc.Revolute(f"R{k}", bodies[-2], place, bodies[-1], (-0.5, 0)))
    if closed:
        m.add(kc.Revolute("end", m.ground, (2, 0), bodies[-1], (0.5, 0)))
    return m


def exact_accelerations(module, q, q_dot):
    """Return accelerations and multipliers by a solve with 60 digits."""
    mpmath.mp.dps = 60
    Phi_q = module.Phi_q(q, 0.0)
    zeros = np.zeros((len(Phi_q), len(Phi_q)))
    matrix = np.block([[module.M(q, 0.0), Phi_q.T], [Phi_q, zeros]])
    sides = np.concatenate((module.Q(q, q_dot, 0.0), module.gamma(q, q_dot, 0.0)))
    found = mpmath.lu_solve(mpmath.matrix(matrix.tolist()), mpmath.matrix(sides.tolist()))
    return np.split(np.array([float(x) for x in found]), [q.size])


def state(module):
    return module.GUESS, np.linspace(-1, 1, module.GUESS.size)


def test_that_accelerations_that_miss_their_equations_are_refused():
    module = from_source(kc.emit(chain(HEAVY), dynamics=True).source, "chain")
    q, q_dot = state(module)
    for found in module.forward_dynamics(q, q_dot, 0.0):
        assert np.isnan(found).all()
    module = from_source(kc.emit(chain([(1, 0.1)] * 3), dynamics=True).source, "chain")
    known = exact_accelerations(module, q, q_dot)
    for found, exact in zip(module.forward_dynamics(q, q_dot, 0.0), known, strict=True):
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12 * np.abs(exact).max())


@pytest.mark.slow
@pytest.mark.skipif(NODE is None, reason="node is not installed")
def test_that_they_are_refused_in_every_target(tmp_path, quick_compiler):
    emitted = {name: kc.emit(chain(HEAVY), name, dynamics=True) for name in ("numpy", "c")}
    module = from_source(emitted["numpy"].source, "chain")
    q, q_dot = state(module)
    native = make_native(module, emitted["c"].files)
    assert np.isnan(np.concatenate(native.forward_dynamics(q, q_dot, 0.0))).all()
    source = kc.emit(chain(HEAVY), "javascript", dynamics=True).source
    (tmp_path / "chain.js").write_text(source, encoding="utf-8")
    call = f"chain.accelerations({q.tolist()}, {q_dot.tolist()}, 0)"
    assert set(json.loads(in_node(tmp_path, {"chain": "chain"}, f"JSON.stringify({call})"))) == {
        None
    }


def test_that_a_simulation_goes_on_with_pivots_there():
    module = kc.compile(chain(HEAVY))
    solution = kc.simulate(module, np.linspace(0, 0.02, 3))
    assert solution.success
    for q, q_dot, q_ddot in zip(solution.q, solution.q_dot, solution.q_ddot, strict=True):
        known = exact_accelerations(module, q, q_dot)[0]
        np.testing.assert_allclose(q_ddot, known, rtol=0, atol=1e-12 * np.abs(known).max())
    assert np.abs(solution["energy_drift"]).max() < 1e-9 * solution["kinetic_energy"].max()


@pytest.mark.slow
@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("moved", [0.0, 0.01])
@pytest.mark.parametrize("first", range(0, 60, 10))
def test_that_random_wheels_are_exact(first, moved):
    count = 0
    for seed in range(first, first + 10):
        wheels = random_wheels(seed)
        mpmath.mp.dps = 60
        if not is_good(wheels, wheels.functions()):
            continue
        target = "c" if seed % 10 == 0 else "numpy"
        module = kc.compile(wheels.mechanism(moved), target)
        names = list(wheels.parameters)[:2]
        given = {name: float(sympy.Rational(x)) for name, x in wheels.parameters.items()}
        if not kc.solve(module, T, given or None).success:  # a lock-up on the way
            continue
        count += 1
        found = errors(wheels, module, names, second=not moved)
        assert max(found.values()) < 1e-8, (seed, found)
    assert count


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 200, 25))
def test_that_accelerations_of_any_masses_are_right_or_refused(first):
    for seed in range(first, first + 25):
        rng = random.Random(seed)
        sizes = [10.0 ** rng.choice([-6, -3, 0, 3]) for _ in range(8)]
        count = rng.choice([2, 3, 4])
        masses = list(zip(sizes[:count], sizes[4:][:count], strict=True))
        model = chain(masses, closed=count == 3)
        module = from_source(kc.emit(model, dynamics=True).source, "chain")
        q, q_dot = state(module)
        found = module.accelerations(q, q_dot, 0.0)
        known = exact_accelerations(module, q, q_dot)[0]
        assert np.isnan(found).all() or missed(found, known) < 1e-6, (seed, masses)
