"""The safeguarded attempts to assemble many parameter sets, together: which are in vain.

One set that cannot be assembled takes a hundred steps of `newton.safeguarded_step`. Here all sets
take them side by side; one that comes anywhere near to holding its equations is left to
`newton.assemble`, which alone decides what is found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import BEND, LARGEST_ANGLE, RESTARTS, SHORTEST_STEP, SUFFICIENT
from kincompile.runtime.newton import begins
from kincompile.runtime.problem import weights_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.problem import Problem

    Mask = NDArray[np.bool_]

NEAR_MISS = 1e-3
"""What equations are missed by, relative to their terms, where they may hold after all."""


def in_vain(
    problems: Sequence[Problem], t: float, guesses: Sequence[Array], max_iterations: int
) -> Mask:
    """Say of which of N problems no safeguarded attempt from its guess comes near a position."""
    found = np.ones(len(problems), dtype=bool)
    block = max(1, MOST_NUMBERS // max(item.place.size**2 for item in problems)) if problems else 1
    for first in range(0, len(problems), block):
        for number in range(RESTARTS + 1):
            left = first + np.flatnonzero(found[first : first + block])
            if left.size:
                some = [problems[k] for k in left.tolist()]
                q = np.array([begins(problems[k], guesses[k])[number] for k in left.tolist()])
                found[left] = _Attempts(some, t).miss(q, max_iterations)
    return found


WILD = 1e100
"""Entry of Phi_q with whose square nothing can be solved."""

MOST_NUMBERS = 1_000_000
"""Numbers of the matrices that are taken at a time."""


class _Attempts:
    """What `newton.safeguarded_step` reads, of N problems: arrays (N, n) and (N, m)."""

    def __init__(self, problems: Sequence[Problem], t: float) -> None:
        self._code, self._t = problems[0].code, t
        self._p = np.array([item.p for item in problems])
        self._reference = np.array([item.reference for item in problems])
        self._magnitude = np.array([item.magnitude for item in problems])
        shape = self._magnitude.shape
        self._limit = np.array([np.broadcast_to(item.limit, shape[1]) for item in problems])
        self._most = self._reference * np.where(self._code.angular, LARGEST_ANGLE, 1.0)

    def miss(self, q: Array, max_iterations: int) -> Mask:
        """Say which attempts from positions (N, n) stay far from holding the equations."""
        far = np.ones(len(q), dtype=bool)
        moving = np.arange(len(q))
        for _ in range(max_iterations):
            if not moving.size:
                break
            Phi, Phi_q = self._code.written(q[moving], self._t, self._p[moving])
            reference = self._reference[moving]
            terms = (np.abs(Phi_q) @ reference[..., np.newaxis])[..., 0]
            terms = np.maximum(self._magnitude[moving], np.minimum(terms, self._limit[moving]))
            weights = weights_of(terms)
            before = _norms(weights * Phi)
            known = (before > NEAR_MISS) & (np.abs(Phi_q) < WILD).all(axis=(1, 2))
            far[moving[~known]] = False
            moving, weights, before = moving[known], weights[known], before[known]
            matrix = weights[..., np.newaxis] * Phi_q[known] * reference[known][:, np.newaxis]
            correction = reference[known] * _directions(matrix, weights * Phi[known], before)
            sane = np.isfinite(correction).all(axis=1)
            far[moving[~sane]] = False
            moving, correction = moving[sane], correction[sane]
            moved = self._shortened(q, moving, correction, weights[sane], before[sane])
            moving = moving[moved]
        return far

    def _shortened(
        self, q: Array, moving: NDArray[np.intp], correction: Array, weights: Array, before: Array
    ) -> Mask:
        """Apply as much of each correction as lowers the residual; say where any does."""
        part = 1 / np.maximum((np.abs(correction) / self._most[moving]).max(axis=1), 1.0)
        moved = np.zeros(moving.size, dtype=bool)
        left = np.arange(moving.size)
        while left.size:
            trial = q[moving[left]] + part[left, np.newaxis] * correction[left]
            Phi, _ = self._code.written(trial, self._t, self._p[moving[left]])
            after = _norms(weights[left] * Phi)
            lower = after <= (1 - SUFFICIENT * part[left]) * before[left]
            q[moving[left[lower]]], moved[left[lower]] = trial[lower], True
            part[left] /= 2
            left = left[~lower & (part[left] >= SHORTEST_STEP)]
        return moved


def _directions(matrix: Array, residual: Array, size: Array) -> Any:
    """Return Levenberg's and Marquardt's directions, of residuals that are far from zero."""
    turned = matrix.swapaxes(1, 2)
    bend = BEND * np.minimum(1.0, size)
    normal = turned @ matrix + bend[:, np.newaxis, np.newaxis] * np.eye(matrix.shape[2])
    found: Any = -np.linalg.solve(normal, turned @ residual[..., np.newaxis])[..., 0]
    return found


def _norms(rows: Array) -> Any:
    return np.sqrt((rows * rows).sum(axis=1))
