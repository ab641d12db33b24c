"""Numba: SymPy's cse printed as Python, and the whole loop compiled, with `np.linalg.solve`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import sympy
from sympy.printing.pycode import pycode

from benchmarks.peers.common import (
    MAX_ITERATIONS,
    TOLERANCE,
    Analysis,
    Motion,
    Vector,
    derived,
    empty_motion,
    optional,
    require,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.linkages import Linkage
    from benchmarks.textbook import Derived

numba = optional("numba")


def whole_loop(linkage: Linkage) -> Analysis:
    """Return the compiled loop."""
    require(numba, "numba")
    d = derived(linkage)
    sides = {"position": d.equations.Phi, "velocity": d.nu, "acceleration": d.gamma}
    functions = [_compiled(name, side.flat(), d) for name, side in sides.items()]
    run = numba.njit(_loop)
    p, guess = linkage.values, np.array(linkage.guess)

    def analyse(times: Vector) -> Motion:
        motion = empty_motion(times.size, guess.size)
        run(*functions, times, p, guess, *motion)
        return motion

    return analyse


def _compiled(name: str, side: Sequence[sympy.Expr], d: Derived) -> Any:
    """Return a compiled function that fills a right-hand side and Phi_q."""
    e = d.equations
    shared, reduced = sympy.cse([*side, *d.Phi_q.flat()])
    n = len(e.q)
    places = [f"right_side[{k}]" for k in range(n)]
    places += [f"Phi_q[{k // n}, {k % n}]" for k in range(n * n)]
    lines = [
        f"{symbol} = {array}[{k}]"
        for array, vector in (("state", e.q), ("rates", e.q_dot), ("values", e.p))
        for k, symbol in enumerate(vector)
    ]
    lines += [f"{symbol} = {pycode(value)}" for symbol, value in shared]
    lines += [f"{place} = {pycode(x)}" for place, x in zip(places, reduced, strict=True)]
    names: dict[str, Any] = {}
    # No array is called as a symbol is: b may be a length.
    head = f"import math\ndef {name}(state, rates, t, values, right_side, Phi_q):"
    text = "\n    ".join((head, *lines))
    exec(text, names)
    return numba.njit(names[name])


def _loop(
    position: Any,
    velocity: Any,
    acceleration: Any,
    times: Vector,
    p: Vector,
    guess: Vector,
    positions: Vector,
    velocities: Vector,
    accelerations: Vector,
) -> None:
    n = guess.size
    q, b, matrix = guess.copy(), np.empty(n), np.empty((n, n))
    w: Any = guess.copy()
    for k in range(times.size):
        for _ in range(MAX_ITERATIONS):
            position(q, w, times[k], p, b, matrix)
            correction = np.linalg.solve(matrix, b)
            q -= correction
            if np.linalg.norm(correction) < TOLERANCE:
                break
        velocity(q, w, times[k], p, b, matrix)
        w = np.linalg.solve(matrix, b)
        acceleration(q, w, times[k], p, b, matrix)
        positions[k], velocities[k], accelerations[k] = q, w, np.linalg.solve(matrix, b)


CONTENDERS = {"Numba, whole loop compiled": whole_loop}
