"""One fresh process: `python -m benchmarks.scale_process CONTENDER gears|chain N`.

Prints a list: model and compilation [s], peak memory after it [bytes], one evaluation of Phi,
Phi_q, nu and gamma [s], one full time step [s]. Imports are not counted in the times, but nothing
has been compiled before; memory is that of the whole process.
"""

from __future__ import annotations

import itertools
import json
import resource
import sys
from functools import partial
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

import kincompile as kc
from benchmarks.loops import Loops
from benchmarks.peers import casadi_peer, hand_loop
from benchmarks.peers.common import MAX_ITERATIONS, TOLERANCE
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from benchmarks.linkages import Linkage

    Vector = NDArray[np.float64]

STEP = 0.01
STEPS = 10
ROUNDS = 5
ACCURACY = 1e-8


class Contender:
    """What a contender does after it is built."""

    def all_four(self) -> object:
        """Evaluate Phi, Phi_q, nu and gamma once."""
        raise NotImplementedError

    def march(self, steps: int) -> Vector:
        """Assemble at t = 0 and go so many steps; return the last position."""
        raise NotImplementedError


class Kincompile(Contender):
    """The NumPy module."""

    def __init__(self, loops: Loops) -> None:
        self.module = kc.compile(loops.mechanism(), form="grouped")
        self._q = np.array(self.module.GUESS)
        # Another position each time: a module keeps the cosines and sines of the last one.
        self._positions = itertools.cycle((self._q, self._q + 0.01))

    def all_four(self) -> object:
        """Evaluate sparse Phi_q: the dense one would have gigabytes."""
        m, q = self.module, next(self._positions)
        return m.evaluate(q, 0.1), m.nu(q, 0.1), m.gamma(q, q, 0.1)

    def march(self, steps: int) -> Vector:
        """Go by `kc.solve`."""
        solution = kc.solve(self.module, STEP * np.arange(steps + 1), throw=True)
        q: Vector = solution.q[-1]
        return q


class SuperLU(Kincompile):
    """The NumPy module's values and SciPy's sparse LU, as its documentation has it."""

    def march(self, steps: int) -> Vector:
        """Go by Newton's method, from a prediction."""
        q, q_dot, q_ddot = self._q, 0.0 * self._q, 0.0 * self._q
        for k in range(steps + 1):
            h = STEP if k else 0.0
            q, q_dot, q_ddot = self._solve(q + h * (q_dot + h / 2 * q_ddot), STEP * k)
        return q

    def _solve(self, q: Vector, t: float) -> tuple[Vector, Vector, Vector]:
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        m, (rows, columns) = self.module, self.module.PATTERN.T
        for _ in range(MAX_ITERATIONS):
            Phi, nonzeros = m.evaluate(q, t)
            factors = splu(csc_matrix((nonzeros, (rows, columns)), (q.size, q.size)))
            correction = factors.solve(Phi)
            q = q - correction
            if np.linalg.norm(correction) < TOLERANCE:
                break
        q_dot = factors.solve(m.nu(q, t))
        return q, q_dot, factors.solve(m.gamma(q, q_dot, t))


class Casadi(Contender):
    """CasADi's virtual machine, `fast_newton` and its sparse QR."""

    def __init__(self, loops: Loops, *, is_rolling: bool = False) -> None:
        import casadi

        linkage = loops.table(is_rolling=is_rolling)
        self._guess = np.array(linkage.guess)
        q, t = casadi.SX.sym("q", self._guess.size), casadi.SX.sym("t")
        rows = linkage.residual(casadi, casadi.vertsplit(q), t, [])
        p, Phi = casadi.SX.sym("p", 0), casadi.vertcat(*rows)
        self._four = casadi_peer.all_four(Phi, q, t, p)
        self._step = casadi_peer.step_function(Phi, q, t, p)

    def all_four(self) -> object:
        """Call the function."""
        return self._four(self._guess, self._guess, 0.1, [])

    def march(self, steps: int) -> Vector:
        """Go by the rootfinder, from a prediction."""
        q: Any = self._guess
        q_dot: Any = 0.0
        q_ddot: Any = 0.0
        for k in range(steps + 1):
            h = STEP if k else 0.0
            q, q_dot, q_ddot = self._step(q + h * (q_dot + h / 2 * q_ddot), STEP * k, [])
        last: Vector = q.full()[:, 0]
        return last


class HandLoop(Contender):
    """The MATLAB-style loop with dense matrices."""

    def __init__(self, loops: Loops) -> None:
        self._table: Linkage = loops.table()
        self._guess = np.array(self._table.guess)
        self._analyse = hand_loop.by_hand(self._table)

    def all_four(self) -> object:
        """Assemble."""
        return hand_loop.assemble(self._table.constraints([]), self._guess, self._guess, 0.1)

    def march(self, steps: int) -> Vector:
        """Go by Newton's method."""
        q: Vector = self._analyse(STEP * np.arange(steps + 1, dtype=np.float64))[0][-1]
        return q


CONTENDERS: dict[str, Callable[[Loops], Contender]] = {
    "kincompile": Kincompile,
    "casadi": Casadi,
    "casadi-rolling": partial(Casadi, is_rolling=True),
    "superlu": SuperLU,
    "hand": HandLoop,
}


def main(name: str, kind: str, count: int) -> None:
    """Measure one contender at one size and print."""
    loops = Loops.of(count, is_chain=kind == "chain")
    kc.compile  # noqa: B018 - loads the compiler
    start = process_time()
    contender = CONTENDERS[name](loops)
    build = process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    _check(contender.march(STEPS), loops.position(STEP * STEPS))
    four = in_turn({"": contender.all_four}, calls=3, rounds=ROUNDS)[""].median
    times = in_turn(
        {"all": lambda: contender.march(STEPS), "first": lambda: contender.march(0)},
        calls=1,
        rounds=ROUNDS,
    )
    step = (times["all"].median - times["first"].median) / STEPS
    print(json.dumps([build, peak, four, step]))


def _check(q: Vector, wanted: Vector) -> None:
    np.testing.assert_allclose(q, wanted, rtol=0, atol=ACCURACY)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
