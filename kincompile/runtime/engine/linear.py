"""What solves with a module's equations: one base class, whatever the mechanism and its form.

| class | linear systems | for |
| --- | --- | --- |
| `planned.Planned` | the elimination planned at compile time | batches of points or variants |
| `dense.Dense` | LAPACK with pivoting; least squares for redundant equations | single points |
| `sparse.Sparse` | equal blocks of a large sparse matrix side by side | the grouped form |

A compiled module needs none of its own: its functions take the place of the NumPy ones. A solve for
rates knows what it misses of them; a correction of Newton's method is judged by the next one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import AGREEMENT, SOLVED, TINY

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Compiled
    from kincompile.runtime.engine.scales import Point, Scales

Array = NDArray[np.float64]


@dataclass(slots=True, eq=False)
class Rates:
    """Velocity and acceleration at a position."""

    # q_dot, q_ddot, in the shape of q: the rates; not finite where they cannot be had
    q_dot: Array
    q_ddot: Array
    movement: Array  # in the shape of q: the solution for the extra right side
    # nu, gamma: the right sides, (m,), or of a batch a row each
    nu: Any
    gamma: Any
    are_met: Any = False  # bool or (N,), bool: where both equations are known to hold


class Linear(ABC):
    """The equations of a module with parameters set, and the linear systems of their Phi_q.

    No method raises on numbers: what cannot be had is not finite.
    """

    code: Compiled

    @abstractmethod
    def evaluate(self, q: Array, t: Any) -> Point:
        """Evaluate Phi and Phi_q at positions (n,) or (n, N) and times () or (N,)."""

    @abstractmethod
    def solve(self, point: Point, b: Array) -> Any:
        """Return x of Phi_q x = b, b of shape (m,) or (m, N); of a batch also as a row each."""

    @abstractmethod
    def missing(self, point: Point, x: Array, b: Any) -> Any:
        """Return Phi_q x - b, of a batch a row each."""

    @abstractmethod
    def rates(self, point: Point, extra_rhs: Array | None) -> Rates:
        """Return the rates at a point; with `extra_rhs` also x of Phi_q x = extra_rhs."""

    @abstractmethod
    def determinants(self, point: Point, before: Point) -> Array:
        """Return the determinants of the blocks of Phi_q, shape (blocks,) or (blocks, N).

        Where there are no blocks it is one number, relative to that of a point before.
        """

    @abstractmethod
    def signs(self, point: Point) -> tuple[float, ...]:
        """Return their signs at one point; none where redundant equations forbid a determinant."""

    def solved(self, scales: Scales, point: Point, extra_rhs: Array | None = None) -> Rates:
        """Return the rates at a point as `rates` does, with where they meet their equations."""
        rates = self.rates(point, extra_rhs)
        rates.are_met = self.meet(scales, point, rates)
        return rates

    def meet(self, scales: Scales, point: Point, rates: Rates) -> Any:
        """Say where Phi_q q_dot = nu and Phi_q q_ddot = gamma hold for rates that were solved for.

        Each equation is measured by its own coefficients and the largest rate, in scales.
        """
        parts = self.parts(scales, point)
        speed, growth = sizes_of(scales, rates)
        good: Any = np.isfinite(speed + growth)
        for x, b, size in ((rates.q_dot, rates.nu, speed), (rates.q_ddot, rates.gamma, growth)):
            missing = self.missing(point, x, b)
            if point.q.ndim == 1:
                good = good and bool((np.abs(missing) <= parts * size).all())
                continue
            for row, part in zip(missing, parts.tolist(), strict=True):
                good = good & (np.abs(row) <= part * size)
        return good

    def parts(self, scales: Scales, point: Point) -> Array:
        """Return what each equation may be missed by at rates of one scale, shape (m,)."""
        # By least squares all miss a little.
        part = AGREEMENT if scales.code.redundant else SOLVED
        return np.asarray(part * scales.terms(point, scales.reference).ravel())


def sizes_of(scales: Scales, rates: Rates) -> tuple[Any, Any]:
    """Return how large velocities and accelerations are, in scales.

    The size of accelerations is also the square of the velocities, which gamma is made of.
    """
    speed = scales.extent(rates.q_dot) + TINY
    return speed, scales.extent(rates.q_ddot) + speed * speed
