"""What solves with a module's equations: one protocol, whatever the mechanism and its form.

| engine | linear systems | for |
| --- | --- | --- |
| `planned.Planned` | the elimination planned at compile time | batches of points or variants |
| `problem.Dense` | LAPACK with pivoting; least squares for redundant equations | single points |
| `staged.Staged` | block after block of a large sparse matrix | mechanisms in the grouped form |

A compiled module needs none of its own: its functions take the place of the NumPy ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import AGREEMENT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.runtime.engine.code import Code

Array = NDArray[np.float64]


@dataclass(slots=True, eq=False)
class Point:
    """A position, or a batch of N, at which the equations were evaluated. The batch is last."""

    q: Array  # (n,) or (n, N): the position
    t: Any  # float or (N,): the time
    # (m,) or (m, N): the constraint vector, of a batch also as a row each; m > n where redundant
    # equations agree
    Phi: Any
    # The Jacobian, as its engine has it: a matrix (m, n), the entries of its pattern, or those of
    # them that vary.
    Phi_q: Any
    factors: Any = None  # what the engine keeps of Phi_q once it was factored


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Velocity and acceleration at a position."""

    # q_dot, q_ddot, in the shape of q: the rates; not finite where they cannot be had
    q_dot: Array
    q_ddot: Array
    movement: Array  # in the shape of q: the solution for the right side that was asked for besides
    agree: Any = True  # whether redundant equations are all met by the rates, shape (N,) or one


class Engine(Protocol):
    """The equations of a module with parameters set, and the linear systems of their Phi_q.

    No method raises on numbers: what cannot be had is not finite.
    """

    code: Code

    def __init__(self, code: Code, p: Array) -> None:
        """Set the parameters of a module."""

    def evaluate(self, q: Array, t: Any) -> Point:
        """Evaluate Phi and Phi_q at positions (n,) or (n, N) and times () or (N,)."""

    def factor(self, point: Point) -> None:
        """Factor Phi_q of a point, once."""

    def solve(self, point: Point, b: Array) -> Any:
        """Return x of Phi_q x = b, b of shape (m,) or (m, N); of a batch also as a row each."""

    def solve_transposed(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q^T x = b, b of shape (n,) or (n, N)."""

    def rates(self, point: Point, besides: Array | None) -> Rates:
        """Return the rates at a point, and x of Phi_q x = besides if that is asked for."""

    def determinants(self, point: Point, before: Point) -> Array:
        """Return the determinants of the blocks of Phi_q, shape (blocks,) or (blocks, N).

        Where there are no blocks it is one number, relative to that of a point before.
        """

    def signs(self, point: Point) -> tuple[float, ...]:
        """Return their signs at one point; none where redundant equations forbid a determinant."""


def agree(matrix: Array, rates: Array, sides: Array) -> Any:
    """Say whether redundant equations are all met by the rates: at a point (n,), or at each (N, n).

    `matrix` and `sides` have one axis more and as many.
    """
    if matrix.shape[-2] == matrix.shape[-1]:
        return True
    rates = rates[..., np.newaxis]
    terms = (np.abs(matrix) @ np.abs(rates))[..., 0] + np.abs(sides)
    missing = np.abs((matrix @ rates)[..., 0] - sides)
    return np.max(missing, axis=-1) <= AGREEMENT * np.max(terms, axis=-1)


def rates_agree(code: Code, t: Any, p: Any, states: Sequence[Array]) -> Any:
    """Say at which points redundant equations are all met by rates that solve the others.

    `states` are position, velocity and acceleration, shape (n, N) each; `p` is (k,) or (k, N).
    """
    finite = np.isfinite(sum(states)).all(axis=0)
    q, q_dot, q_ddot = (np.where(finite, state, 0.0).T for state in states)
    t, p = np.broadcast_to(t, len(q)), np.asarray(p).T
    Phi_q, nu, gamma = code.Phi_q(q, t, p), code.nu(q, t, p), code.gamma(q, q_dot, t, p)
    return finite & agree(Phi_q, q_dot, nu) & agree(Phi_q, q_ddot, gamma)
