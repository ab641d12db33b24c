"""The variables of a fit, parameters and then times, as numbers of the unit interval."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

WIDE = 10.0
"""Greatest over least value of a bound above which a variable goes by its logarithm."""


class Variables:
    """Bounds (nx, 2) of variables. What spans one whole turn goes around."""

    def __init__(self, bounds: Array) -> None:
        self.low, self.high = bounds.T
        self._is_wide = (self.low > 0) & (self.high > WIDE * self.low)
        self._base = np.where(self._is_wide, self.low, 1.0)
        self._log = np.log(np.where(self._is_wide, self.high, math.e) / self._base)
        self.is_turn = np.abs(self.high - self.low - 2 * math.pi) < 1e-9

    def to_x(self, u: Array) -> Array:
        """Return variables (..., nx) from numbers of the unit interval."""
        with np.errstate(over="ignore"):
            x = np.where(
                self._is_wide, self._base * np.exp(self._log * u), self.low + self._span * u
            )
        return np.asarray(np.clip(x, self.low, self.high))

    def to_u(self, x: Array) -> Array:
        """Return numbers of the unit interval from variables."""
        inside = np.where(self._is_wide, x, 1.0) / self._base
        return np.asarray(
            np.where(self._is_wide, np.log(inside) / self._log, (x - self.low) / self._span)
        )

    def slopes(self, x: Array) -> Array:
        """Return the derivatives of variables by numbers of the unit interval."""
        return np.asarray(np.where(self._is_wide, x * self._log, self._span))

    def within(self, u: Array) -> Array:
        """Return numbers of the unit interval: whole turns are left out, others end at its ends."""
        return np.where(self.is_turn, u % 1.0, np.clip(u, 0.0, 1.0))

    def step(self, u: Array, matrix: Array, slope: Array) -> Array:
        """Return Newton's steps (B, nx); what is at an end of its bounds does not leave them."""
        held = ((u <= 0) & (slope > 0)) | ((u >= 1) & (slope < 0))
        held &= ~self.is_turn
        is_out = held[:, :, np.newaxis] | held[:, np.newaxis, :]
        one = np.eye(u.shape[1])
        matrix = np.where(is_out, held[..., np.newaxis] * one, matrix)
        right = np.where(held, 0.0, -slope)[..., np.newaxis]
        return np.asarray(np.linalg.solve(matrix, right)[..., 0])

    def around(self, x: Array) -> Array:
        """Return variables without whole turns."""
        return np.where(self.is_turn, self.low + (x - self.low) % (2 * math.pi), x)

    def hold(self, x: Array) -> NDArray[np.bool_]:
        """Say which sets of variables (B, nx) lie within the bounds."""
        return np.asarray(((x >= self.low) & (x <= self.high)).all(axis=-1))

    @property
    def _span(self) -> Array:
        return np.asarray(self.high - self.low)
