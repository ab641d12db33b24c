"""Loops over time points in Python: with constraints by hand, or with lambdified matrices.

`by_hand` is what a course teaches in MATLAB: a switch over constraint types that fills Phi, Phi_q
and gamma, and a dense solve. `by_sympy` lets SymPy derive and `lambdify` the same four.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from benchmarks import textbook
from benchmarks.linkages import GROUND
from benchmarks.peers.common import (
    MAX_ITERATIONS,
    TOLERANCE,
    Analysis,
    Motion,
    Skipped,
    Vector,
    derived,
    empty_motion,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.linkages import Constraint, Linkage, Point

    Position = Callable[[Vector, float], tuple[Vector, Vector]]
    Rates = Callable[[Vector, Vector, float], tuple[Vector, Vector, Vector]]


def march(position: Position, velocity: Position, acceleration: Any, guess: Vector) -> Analysis:
    """Return Newton's method from point to point, then velocity and acceleration."""

    def analyse(times: Vector) -> Motion:
        motion = empty_motion(times.size, guess.size)
        q = guess.copy()
        for k, t in enumerate(times):
            for _ in range(MAX_ITERATIONS):
                Phi, Phi_q = position(q, t)
                correction = np.linalg.solve(Phi_q, Phi)
                q = q - correction
                if np.linalg.norm(correction) < TOLERANCE:
                    break
            else:
                raise Skipped(f"no convergence at t = {t:g}")
            Phi_q, nu = velocity(q, t)
            w = np.linalg.solve(Phi_q, nu)
            Phi_q, gamma = acceleration(q, w, t)
            for place, values in zip(motion, (q, w, np.linalg.solve(Phi_q, gamma)), strict=True):
                place[k] = values
        return motion

    return analyse


def by_sympy(linkage: Linkage, *, cse: bool) -> Analysis:
    """Return the loop over four lambdified matrices."""
    d = derived(linkage)
    e, p = d.equations, linkage.values.tolist()
    matrices = (e.Phi, d.Phi_q, d.nu, d.gamma)
    arguments = (*((e.q, textbook.t, e.p),) * 3, (e.q, e.q_dot, textbook.t, e.p))
    Phi, Phi_q, nu, gamma = (
        sympy.lambdify(symbols, matrix, "numpy", cse=cse)
        for symbols, matrix in zip(arguments, matrices, strict=True)
    )
    return march(
        lambda q, t: (Phi(q, t, p)[:, 0], Phi_q(q, t, p)),
        lambda q, t: (Phi_q(q, t, p), nu(q, t, p)[:, 0]),
        lambda q, w, t: (Phi_q(q, t, p), gamma(q, w, t, p)[:, 0]),
        np.array(linkage.guess),
    )


def by_hand(linkage: Linkage) -> Analysis:
    """Return the loop with a switch over constraint types."""
    constraints = linkage.constraints(linkage.values.tolist())
    n = len(linkage.guess)
    rates = np.zeros(n)

    def position(q: Vector, t: float) -> tuple[Vector, Vector]:
        Phi, Phi_q, _, _ = assemble(constraints, q, rates, t)
        return Phi, Phi_q

    def velocity(q: Vector, t: float) -> tuple[Vector, Vector]:
        _, Phi_q, nu, _ = assemble(constraints, q, rates, t)
        return Phi_q, nu

    def acceleration(q: Vector, w: Vector, t: float) -> tuple[Vector, Vector]:
        _, Phi_q, _, gamma = assemble(constraints, q, w, t)
        return Phi_q, gamma

    return march(position, velocity, acceleration, np.array(linkage.guess))


def assemble(
    constraints: list[Constraint], q: Vector, w: Vector, t: float
) -> tuple[Vector, Vector, Vector, Vector]:
    """Fill Phi, Phi_q, nu and gamma, constraint by constraint."""
    n, row = q.size, 0
    Phi, Phi_q, nu, gamma = np.zeros(n), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    for c in constraints:
        phi_column = 3 * c.i + 2
        if c.kind == "revolute":
            _revolute(c, row, (Phi, Phi_q, gamma), q, w)
            row += 2
        elif c.kind == "height":
            Phi[row] = q[3 * c.i + 1] - c.value
            Phi_q[row, 3 * c.i + 1] = 1.0
            row += 1
        elif c.kind == "angle":
            Phi[row] = q[phi_column] - c.value
            Phi_q[row, phi_column] = 1.0
            row += 1
        elif c.kind == "gear":
            Phi[row] = q[3 * c.j + 2] + c.value * q[phi_column]
            Phi_q[row, 3 * c.j + 2], Phi_q[row, phi_column] = 1.0, c.value
            row += 1
        elif c.kind == "drive":
            Phi[row] = q[phi_column] - c.value * t
            Phi_q[row, phi_column] = 1.0
            nu[row] = c.value
            row += 1
    return Phi, Phi_q, nu, gamma


def _revolute(
    c: Constraint, row: int, arrays: tuple[Vector, Vector, Vector], q: Vector, w: Vector
) -> None:
    """Fill the two rows of a revolute joint: r_i + A_i s_i - r_j - A_j s_j."""
    Phi, Phi_q, gamma = arrays
    for body, s, sign in ((c.i, c.s_i, 1.0), (c.j, c.s_j, -1.0)):
        if body == GROUND:
            Phi[row : row + 2] += sign * np.array(s)
            continue
        k = 3 * body
        turned, turned_90 = _turned(q[k + 2], s)
        Phi[row : row + 2] += sign * (q[k : k + 2] + turned)
        Phi_q[row, k] = Phi_q[row + 1, k + 1] = sign
        Phi_q[row : row + 2, k + 2] = sign * turned_90
        gamma[row : row + 2] += sign * turned * w[k + 2] ** 2


def _turned(phi: float, s: Point) -> tuple[Vector, Vector]:
    """Return A s and B s = dA/dphi s."""
    c, d = math.cos(phi), math.sin(phi)
    x, y = c * s[0] - d * s[1], d * s[0] + c * s[1]
    return np.array([x, y]), np.array([-y, x])
