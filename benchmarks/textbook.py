"""The peer: the four-bar in SymPy as a textbook writes it, and what `lambdify` makes of it.

Nothing here is tuned for or against SymPy: full coordinates, revolute joints as two equations,
`Matrix.jacobian`, and `lambdify` with `cse=True`. The lists given to it are flat, because on nested
lists `cse=True` does nothing, silently.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Function = Callable[..., Any]

N = 9
t = sympy.Symbol("t")


@dataclass(frozen=True, slots=True)
class Equations:
    """Phi of a mechanism, its symbols, and what follows from it by differentiation."""

    q: list[sympy.Symbol]
    q_dot: list[sympy.Symbol]
    p: list[sympy.Symbol]
    Phi: sympy.Matrix


@dataclass(frozen=True, slots=True)
class Derived:
    """Phi_q, nu and gamma beside Phi."""

    equations: Equations
    Phi_q: sympy.Matrix
    nu: sympy.Matrix
    gamma: sympy.Matrix


def four_bar() -> Equations:
    """Return the equations of `mechanisms.four_bar`."""
    a, b, c, d, omega = p = list(sympy.symbols("a b c d omega"))
    q, q_dot = _coordinates(("crank", "coupler", "rocker"))
    crank, coupler, rocker = q[:3], q[3:6], q[6:]
    rows = [
        _point(crank, -a / 2),
        _point(crank, a / 2) - _point(coupler, -b / 2),
        _point(coupler, b / 2) - _point(rocker, -c / 2),
        _point(rocker, c / 2) - sympy.Matrix([d, 0]),
        sympy.Matrix([crank[2] - omega * t]),
    ]
    return Equations(q, q_dot, p, sympy.Matrix.vstack(*rows))


def crank_rocker() -> Equations:
    """Return the equations of `mechanisms.crank_rocker`."""
    r1, r2, r3, r4, start, rate = p = list(sympy.symbols("r1 r2 r3 r4 start rate"))
    q, q_dot = _coordinates(("arm", "bar", "swing"))
    arm, bar, swing = q[:3], q[3:6], q[6:]
    rows = [
        -_point(arm, 0),
        _point(arm, r2) - _point(bar, 0),
        _point(bar, r3) - _point(swing, r4),
        _point(swing, 0) - sympy.Matrix([r1, 0]),
        sympy.Matrix([arm[2] - start - rate * t]),
    ]
    return Equations(q, q_dot, p, sympy.Matrix.vstack(*rows))


def _coordinates(bodies: Sequence[str]) -> tuple[list[sympy.Symbol], list[sympy.Symbol]]:
    names = [f"{letter}_{body}" for body in bodies for letter in ("x", "y", "phi")]
    return [sympy.Symbol(name) for name in names], [sympy.Symbol(f"{name}_dot") for name in names]


def _point(body: Sequence[sympy.Symbol], s: Any) -> sympy.Matrix:
    """Return r + A (s, 0)."""
    x, y, phi = body
    return sympy.Matrix([x + s * sympy.cos(phi), y + s * sympy.sin(phi)])


def derive(equations: Equations) -> Derived:
    """Differentiate as the textbook does: nu = -Phi_t, gamma = -(Phi_q q_dot)_q q_dot - ..."""
    Phi, q, q_dot = equations.Phi, equations.q, sympy.Matrix(equations.q_dot)
    Phi_q = Phi.jacobian(q)
    gamma = -(Phi_q * q_dot).jacobian(q) * q_dot - 2 * Phi_q.diff(t) * q_dot - Phi.diff(t, 2)
    return Derived(equations, Phi_q, -Phi.diff(t), gamma)


def four_functions(derived: Derived) -> list[Function]:
    """Return Phi, Phi_q, nu (q, t, p) and gamma (q, q_dot, t, p), a lambdify of each matrix."""
    matrices = derived.equations.Phi, derived.Phi_q, derived.nu, derived.gamma
    return _lambdified(derived, matrices, "numpy")


def four_lists(derived: Derived) -> list[Function]:
    """Return the same as flat lists on floats; of Phi_q the entries that vary."""
    Phi, nu, gamma = (item.flat() for item in (derived.equations.Phi, derived.nu, derived.gamma))
    return _lambdified(derived, (Phi, _varying(derived), nu, gamma), "math")


def _lambdified(derived: Derived, results: Sequence[Any], modules: str) -> list[Function]:
    """Return functions (q, t, p), the last one (q, q_dot, t, p)."""
    e = derived.equations
    position, motion = [e.q, t, e.p], [e.q, e.q_dot, t, e.p]
    arguments = position, position, position, motion
    return [
        sympy.lambdify(symbols, result, modules, cse=True)
        for symbols, result in zip(arguments, results, strict=True)
    ]


def one_function(derived: Derived, modules: str) -> Function:
    """Return one function (q, q_dot, t, p) of everything that varies, as a flat list.

    The order is Phi, the entries of Phi_q that are not numbers (`varying_entries`), nu, gamma.
    """
    e = derived.equations
    flat = e.Phi.flat() + _varying(derived) + derived.nu.flat() + derived.gamma.flat()
    function: Function = sympy.lambdify([e.q, e.q_dot, t, e.p], flat, modules, cse=True)
    return function


def _varying(derived: Derived) -> list[sympy.Expr]:
    return [derived.Phi_q[row, column] for row, column in varying_entries(derived)]


def varying_entries(derived: Derived) -> list[tuple[int, int]]:
    """Return row and column of the entries of Phi_q that are not numbers."""
    return [
        (row, column)
        for row in range(N)
        for column in range(N)
        if not derived.Phi_q[row, column].is_number
    ]


class Assembly:
    """Puts the flat list into Phi, a dense Phi_q, nu and gamma, of one point or of a batch.

    The entries that are numbers are prepared once. Vectors of a batch are filled row by row and
    turned, which is faster than to fill them column by column.
    """

    def __init__(self, derived: Derived) -> None:
        self._start = np.array(
            [float(entry) if entry.is_number else 0.0 for entry in derived.Phi_q.flat()]
        ).reshape(N, N)
        self._entries = varying_entries(derived)
        self._flat = np.array([row * N + column for row, column in self._entries])

    def point(self, values: Sequence[float]) -> tuple[NDArray[np.float64], ...]:
        """Return Phi (9,), Phi_q (9, 9), nu (9,) and gamma (9,)."""
        Phi, entries, nu, gamma = self._split(values)
        return (
            np.array(Phi, float),
            self.dense(entries),
            np.array(nu, float),
            np.array(gamma, float),
        )

    def dense(self, entries: Sequence[float]) -> NDArray[np.float64]:
        """Return Phi_q (9, 9) of one point."""
        Phi_q = self._start.copy()
        Phi_q.put(self._flat, entries)
        return Phi_q

    def batch(self, values: Sequence[Any], count: int) -> tuple[NDArray[np.float64], ...]:
        """Return Phi (N, 9), Phi_q (N, 9, 9), nu (N, 9) and gamma (N, 9)."""
        Phi, entries, nu, gamma = self._split(values)
        Phi_q = np.empty((count, N, N))
        Phi_q[:] = self._start
        for (row, column), value in zip(self._entries, entries, strict=True):
            Phi_q[:, row, column] = value
        return _turned(Phi, count), Phi_q, _turned(nu, count), _turned(gamma, count)

    def _split(self, values: Sequence[Any]) -> tuple[Sequence[Any], ...]:
        stop = N + len(self._entries)
        return values[:N], values[N:stop], values[stop : stop + N], values[stop + N :]


def _turned(rows: Sequence[Any], count: int) -> NDArray[np.float64]:
    result = np.empty((N, count))
    for k, row in enumerate(rows):
        result[k] = row
    return np.ascontiguousarray(result.T)
