"""The calls that are timed in this process: one point and a batch, by kincompile and by SymPy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import kincompile as kc
from benchmarks import mechanisms, textbook

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    Calls = Mapping[str, Callable[[], Sequence[Any]]]
    Vector = NDArray[np.float64]

POINTS = 1000
"""Size of the batch."""

PARAMETERS = (*mechanisms.LENGTHS.values(), mechanisms.OMEGA)


class Peers:
    """The four-bar, compiled by kincompile and by SymPy."""

    def __init__(self, module: ModuleType | None = None) -> None:
        self.module = kc.compile(mechanisms.four_bar()) if module is None else module
        derived = textbook.derive(textbook.four_bar())
        self.four = textbook.four_functions(derived)
        self.lists = textbook.four_lists(derived)
        self.math = textbook.one_function(derived, "math")
        self.numpy = textbook.one_function(derived, "numpy")
        self.assembly = textbook.Assembly(derived)

    def point_calls(self) -> Calls:
        """Return calls that give Phi, Phi_q, nu and gamma at one point."""
        m, p = self.module, PARAMETERS
        rng = np.random.default_rng(1)
        (q, q_dot), t = rng.normal(size=(2, 9)), 0.3
        q_list, q_dot_list = q.tolist(), q_dot.tolist()
        floats, kernel = m.FLOATS, m.LANES["kinematics"]
        return {
            "four functions": lambda: _four(m, q, q_dot, t),
            "kinematics": lambda: m.kinematics(q, q_dot, t),
            "code alone": lambda: kernel(floats, q_list, q_dot_list, t, p),
            "four matrices": lambda: self._four_matrices(q, q_dot, t),
            "four lists": lambda: self._four_lists(q, q_dot, t),
            "list": lambda: self.math(q_list, q_dot_list, t, p),
            "arrays": lambda: self.assembly.point(self.math(q.tolist(), q_dot.tolist(), t, p)),
        }

    def _four_matrices(self, q: Vector, q_dot: Vector, t: float) -> tuple[Vector, ...]:
        """Call four lambdified matrices as a textbook script does."""
        Phi, Phi_q, nu, gamma = self.four
        p = PARAMETERS
        return Phi(q, t, p), Phi_q(q, t, p), nu(q, t, p), gamma(q, q_dot, t, p)

    def _four_lists(self, q: Vector, q_dot: Vector, t: float) -> tuple[Vector, ...]:
        """Call four lambdified lists from arrays to arrays, each call on its own."""
        Phi, Phi_q, nu, gamma = self.lists
        p = PARAMETERS
        return (
            np.array(Phi(q.tolist(), t, p), float),
            self.assembly.dense(Phi_q(q.tolist(), t, p)),
            np.array(nu(q.tolist(), t, p), float),
            np.array(gamma(q.tolist(), q_dot.tolist(), t, p), float),
        )

    def batch_calls(self, points: int = POINTS) -> Calls:
        """Return calls that give Phi, Phi_q, nu and gamma of a batch of so many points.

        Those that end in "last" take and give arrays whose last axis is the batch.
        """
        m, p = self.module, PARAMETERS
        rng = np.random.default_rng(2)
        q, q_dot = rng.normal(size=(2, points, 9))
        t = np.linspace(0.0, 1.0, points)
        q_last, q_dot_last = np.ascontiguousarray(q.T), np.ascontiguousarray(q_dot.T)
        arrays, kernel = m.ARRAYS, m.LANES["kinematics"]
        return {
            "kinematics_batch_last": lambda: m.kinematics_batch_last(q_last, q_dot_last, t),
            "code alone, last": lambda: kernel(arrays, q_last, q_dot_last, t, p),
            "four functions": lambda: _four(m, q, q_dot, t),
            "kinematics": lambda: m.kinematics(q, q_dot, t),
            "list, last": lambda: self.numpy(q_last, q_dot_last, t, p),
            "arrays": lambda: self.assembly.batch(self.numpy(q.T, q_dot.T, t, p), points),
        }

    def batch_call_into_arrays(self, points: int) -> Callable[[], Sequence[Any]]:
        """Return the call of a compiled module that fills the results of a call before again.

        Fetching 40 MB from the system for results takes longer than to compute them.
        """
        rng = np.random.default_rng(2)
        q, q_dot = rng.normal(size=(2, 9, points))
        t = np.linspace(0.0, 1.0, points)
        function = self.module.kinematics_batch_last
        results = function(q, q_dot, t)
        return lambda: function(q, q_dot, t, out=results)

    def check(self) -> None:
        """Check that all give the same numbers, so that only equal work is compared."""
        calls = self.point_calls()
        for name in ("kinematics", "four matrices", "four lists", "arrays"):
            _require_equal(calls[name](), calls["four functions"]())
        calls = self.batch_calls()
        Phi, Phi_q, nu, gamma = wanted = calls["arrays"]()
        for name in ("four functions", "kinematics"):
            _require_equal(calls[name](), wanted)
        rows, columns = self.module.PATTERN.T
        last = Phi.T, Phi_q[:, rows, columns].T, nu.T, gamma.T
        _require_equal(calls["kinematics_batch_last"](), last)


def _four(module: ModuleType, q: Vector, q_dot: Vector, t: float | Vector) -> Sequence[Vector]:
    """Call the four public functions."""
    return module.Phi(q, t), module.Phi_q(q, t), module.nu(q, t), module.gamma(q, q_dot, t)


def _require_equal(found: Sequence[Vector], wanted: Sequence[Vector]) -> None:
    for one, other in zip(found, wanted, strict=True):
        # A lambdified column is a matrix of one column.
        np.testing.assert_allclose(np.reshape(one, other.shape), other, rtol=1e-12, atol=1e-12)
