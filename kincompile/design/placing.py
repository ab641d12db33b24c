r"""A mechanism moved, turned and scaled as a whole: the place that serves its targets best.

Of points :math:`z` of the plane and parameters :math:`l` on which they depend linearly this is

.. math:: \min_{z_0, c, l} \sum_i w_i^2\,|z_0 + c\,(z_i + l \cdot b_i) - w_i|^2

with complex :math:`z_0` and c. Whether parameters can do so is seen from exact derivatives: a
displacement of all points is one of the parameters where it equals J dp along whole motions. One
that is affine in the parameters has a flow, a matrix exponential.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

SAME = 1e-6
"""Part of a displacement within which derivatives agree with it."""

STEPS = 8
"""Of Gauss and Newton, which turns and scales."""


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """How k parameters move, turn and scale a mechanism: affine fields, (4, k + 1, k + 1)."""

    fields: Array

    @classmethod
    def of(cls, z: Complex, slopes: Complex, p: Array) -> Placing | None:
        """Find them from points of S motions (S, N) with slopes (S, N, k) at parameters (S, k).

        None where the parameters cannot do so.
        """
        good = np.isfinite(slopes).all(axis=(1, 2))
        z, slopes, p = z[good], slopes[good], p[good]
        count, k = p.shape
        if count < k + 2:
            return None
        by_p = np.concatenate((slopes.real, slopes.imag), axis=1)
        inverse = np.linalg.pinv(by_p, rcond=1e-11)
        known, fields = np.concatenate((p, np.ones((count, 1))), axis=1), []
        for way in (np.ones_like(z), 1j * np.ones_like(z), 1j * z, z):
            wanted = np.concatenate((way.real, way.imag), axis=1)
            found = np.einsum("ski,si->sk", inverse, wanted)
            off = np.abs(np.einsum("sik,sk->si", by_p, found) - wanted).max(axis=1)
            off = off / np.abs(wanted).max(axis=1)
            exact = off <= max(SAME, float(np.median(off)))  # others are nearly singular
            if not np.median(off) <= SAME or exact.sum() < k + 2:
                return None
            field = np.linalg.lstsq(known[exact], found[exact], rcond=None)[0]
            missed = np.abs(known[exact] @ field - found[exact])
            if not np.median(missed.max(axis=1)) <= SAME * max(1.0, float(np.abs(found).max())):
                return None
            field[np.abs(field) < SAME] = 0.0
            fields.append(np.concatenate((field.T, np.zeros((1, k + 1)))))
        return cls(np.array(fields))

    def moved(self, p: Array, place: Complex, turn: Complex) -> Array:
        """Return parameters (B, k) of mechanisms turned and scaled by c (B,), then moved."""
        ways = np.array((np.angle(turn), np.log(np.abs(turn)), place.real, place.imag))
        state = np.concatenate((p, np.ones((len(p), 1))), axis=1)[..., np.newaxis]
        with np.errstate(all="ignore"):
            for amount, field in zip(ways, self.fields[[2, 3, 0, 1]], strict=True):
                state = expm(amount[:, np.newaxis, np.newaxis] * field) @ state
        return np.asarray(state[:, :-1, 0])


def best_places(
    z: Complex, slopes: Complex, wanted: Complex, weights: Array
) -> tuple[Complex, Complex, Array]:
    """Return z0 (B,), c (B,) and l (B, k) that bring points (B, K) nearest to those wanted (K,)."""
    count, k = len(z), slopes.shape[-1]
    w = weights[:, np.newaxis]
    plain = np.stack((np.ones_like(z), z), axis=-1) * w
    start = np.linalg.pinv(plain) @ (weights * wanted)[:, np.newaxis]
    place, turn, along = start[:, 0, 0], start[:, 1, 0], np.zeros((count, k))
    best, error = (place, turn, along), np.full(count, np.inf)
    for _ in range(STEPS):
        base = z + np.einsum("bik,bk->bi", slopes, along)
        off = weights * (place[:, np.newaxis] + turn[:, np.newaxis] * base - wanted)
        now = (np.abs(off) ** 2).sum(axis=1)
        is_better = now < error
        error = np.where(is_better, now, error)
        best = (
            np.where(is_better, place, best[0]), np.where(is_better, turn, best[1]),
            np.where(is_better[:, np.newaxis], along, best[2]),
        )  # fmt: skip
        ones = np.ones_like(z)
        columns = [ones, 1j * ones, base, 1j * base]
        by = np.concatenate(
            (np.stack(columns, axis=-1), turn[:, np.newaxis, np.newaxis] * slopes), axis=-1
        )
        real = np.concatenate((by.real, by.imag), axis=1) * np.tile(w, (2, 1))
        right = np.concatenate((off.real, off.imag), axis=1)[..., np.newaxis]
        if not np.isfinite(real).all():
            break
        step = -(np.linalg.pinv(real, rcond=1e-11) @ right)[..., 0]
        place, turn = place + step[:, 0] + 1j * step[:, 1], turn + step[:, 2] + 1j * step[:, 3]
        along = along + step[:, 4:]
    return best
