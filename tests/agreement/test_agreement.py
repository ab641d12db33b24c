"""SymPy's matrices, the interpreter of the IR and the emitted module give the same numbers.

The three ways meet only at their ends. SymPy: `system.Phi` and the others, evaluated by mpmath with
40 digits, and a Jacobian, nu and gamma that SymPy derives itself from `system.Phi`. The
interpreter: kernels x instances, without elimination of equal values and without a printer. The
emitted module: a point, a batch, and a batch whose axis is the last.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower

STATES = 4
QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")
TOLERANCE = 1e-13


@dataclass(frozen=True)
class States:
    """Seeded random states of an example, off the manifold, with parameters beside the defaults."""

    model: Any
    q: Any
    q_dot: Any
    t: Any
    p: Any

    @classmethod
    def of(cls, example) -> "States":
        """Return four states near the motion of an example: lengths of its own size."""
        rng = np.random.default_rng(20240717)
        n, points = example.module.N_COORDINATES, example.solution.t.size
        rows = rng.integers(points, size=STATES)
        size = 1 + np.abs(example.solution.q).max(axis=0)
        q = example.solution.q[rows] + 0.3 * size * rng.uniform(-1, 1, (STATES, n))
        q_dot = rng.uniform(-2, 2, (STATES, n))
        p = example.module.DEFAULTS * rng.uniform(0.8, 1.25, example.module.DEFAULTS.shape)
        return cls(example.model, q, q_dot, example.solution.t[rows], p)

    def symbols(self, k: int) -> dict[Any, Any]:
        """Return the values of all symbols in a state, exactly."""
        names = [item.name for item in self.model.system().parameters]
        pairs = [
            *zip(self.model.q, self.q[k], strict=True),
            *zip(self.model.q_dot, self.q_dot[k], strict=True),
            *((sympy.Symbol(name), value) for name, value in zip(names, self.p, strict=True)),
            (kc.t, self.t[k]),
        ]
        return {symbol: mpmath.mpf(float(value)) for symbol, value in pairs}

    @cached_property
    def by_sympy(self) -> dict[str, Any]:
        """Phi, Phi_q, nu and gamma of all states by mpmath, (STATES, m) and (STATES, m, n)."""
        return {name: self.evaluate(getattr(self.model, name)) for name in QUANTITIES}

    def evaluate(self, matrix: Any) -> Any:
        """Evaluate a SymPy matrix in every state; a single column loses its last axis."""
        symbols = sorted(self.symbols(0), key=str)
        function = sympy.lambdify(symbols, matrix.tolist(), modules="mpmath")
        with mpmath.workdps(40):
            values = []
            for k in range(STATES):
                state = self.symbols(k)
                rows = function(*(state[symbol] for symbol in symbols))
                values.append([[float(entry) for entry in row] for row in rows])
        array = np.array(values)
        return array[..., 0] if matrix.shape[1] == 1 else array


@pytest.fixture(scope="module")
def states(example):
    return States.of(example)


def assert_same(actual, expected):
    """Compare each vector relative to its largest number, Phi_q row by row."""
    for name in QUANTITIES:
        here, there = actual[name], expected[name]
        assert here.shape == there.shape, name
        size = np.abs(there).max(axis=-1, keepdims=True)
        assert np.all(np.abs(here - there) <= TOLERANCE * size), name


def named(values):
    """Return the four quantities by name."""
    return dict(zip(QUANTITIES, values, strict=True))


def test_that_the_interpreter_agrees_with_sympy(example, states):
    program = lower(example.model.system())
    rows = [
        interpret(program, states.q[k], states.q_dot[k], states.t[k], states.p)
        for k in range(STATES)
    ]
    stacked = [np.array(values) for values in zip(*rows, strict=True)]
    assert_same(named(stacked), states.by_sympy)


def test_that_the_interpreter_takes_a_batch_at_one_time(example, states):
    program = lower(example.model.system())
    batch = interpret(program, states.q, states.q_dot, 0.3, states.p)
    for k in range(STATES):
        alone = interpret(program, states.q[k], states.q_dot[k], 0.3, states.p)
        for one, many in zip(alone, batch, strict=True):
            np.testing.assert_allclose(many[k], one, rtol=1e-14, atol=1e-14)


def test_that_the_module_agrees_at_a_point(example, states):
    module, rows = example.module, []
    for k in range(STATES):
        q, q_dot, t, p = states.q[k], states.q_dot[k], float(states.t[k]), states.p
        single = module.Phi(q, t, p), module.Phi_q(q, t, p), module.nu(q, t, p)
        rows.append((*single, module.gamma(q, q_dot, t, p)))
    stacked = [np.array(values) for values in zip(*rows, strict=True)]
    assert_same(named(stacked), states.by_sympy)


def test_that_the_module_agrees_on_a_batch(example, states):
    module, (q, q_dot, t, p) = example.module, (states.q, states.q_dot, states.t, states.p)
    single = module.Phi(q, t, p), module.Phi_q(q, t, p), module.nu(q, t, p)
    assert_same(named((*single, module.gamma(q, q_dot, t, p))), states.by_sympy)


def test_that_the_fused_functions_agree(example, states):
    module, (q, q_dot, t, p) = example.module, (states.q, states.q_dot, states.t, states.p)
    expected = states.by_sympy
    assert_same(named(module.kinematics(q, q_dot, t, p)), expected)
    for function, arguments, names in [
        (module.position, (q, t, p), ("Phi", "Phi_q")),
        (module.velocity, (q, t, p), ("Phi_q", "nu")),
        (module.acceleration, (q, q_dot, t, p), ("Phi_q", "gamma")),
    ]:
        found = dict(zip(names, function(*arguments), strict=True))
        assert_same({**expected, **found}, expected)


def test_that_the_module_agrees_with_the_batch_last(example, states):
    module, expected = example.module, states.by_sympy
    values = named(
        module.kinematics_batch_last(
            states.q.T.copy(), states.q_dot.T.copy(), states.t, np.tile(states.p, (STATES, 1)).T
        )
    )
    rows, columns = module.PATTERN.T
    dense = np.zeros((STATES, module.N_EQUATIONS, module.N_COORDINATES))
    dense[:, rows, columns] = values.pop("Phi_q").T
    found = {name: array.T for name, array in values.items()}
    assert_same({**found, "Phi_q": dense}, expected)


def test_that_the_nonzeros_are_those_of_the_jacobian(example, states):
    module, expected = example.module, states.by_sympy["Phi_q"]
    rows, columns = module.PATTERN.T
    nonzeros = module.Phi_q_nonzeros(states.q, states.t, states.p)
    size = np.abs(expected).max(axis=-1)[:, rows]
    assert np.all(np.abs(nonzeros - expected[:, rows, columns]) <= TOLERANCE * size)
    outside = np.ones(expected.shape[1:], dtype=bool)
    outside[rows, columns] = False
    assert not expected[:, outside].any()


def test_that_sympy_derives_the_same_from_phi(example, states):
    # gamma = -(Phi_q q_dot)_q q_dot - 2 Phi_qt q_dot - Phi_tt, by SymPy's own jacobian and diff.
    Phi, q, q_dot = example.model.Phi, example.model.q, example.model.q_dot
    Phi_q, Phi_t = Phi.jacobian(q), Phi.diff(kc.t)
    gamma = -(Phi_q * q_dot).jacobian(q) * q_dot
    gamma -= 2 * Phi_q.diff(kc.t) * q_dot + Phi_t.diff(kc.t)
    derived = {"Phi": Phi, "Phi_q": Phi_q, "nu": -Phi_t, "gamma": gamma}
    assert_same(
        {name: states.evaluate(matrix) for name, matrix in derived.items()}, states.by_sympy
    )
