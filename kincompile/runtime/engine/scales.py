"""By what a position is judged: the scales of its coordinates and equations, and what they say.

Nothing here compares a length with an angle, or a residual with a fixed number: a coordinate is
compared with its own scale (the size of the mechanism, or a radian), an equation with the sum of
what its terms contribute at those scales. So a mechanism in millimetres and the same one in metres
get the same verdicts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    FAR,
    NEAR_ANGLE,
    NEAR_PART,
    RESIDUAL_FACTOR,
    ROUNDING,
    SAME_POSITION,
    WILD,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.runtime.engine.code import Array, Compiled


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


@dataclass(slots=True, eq=False, kw_only=True)
class Scales:
    """The criteria in use for a mechanism with n coordinates and m equations."""

    code: Compiled
    angular: np.ndarray[tuple[int], np.dtype[np.bool_]]  # (n,), bool: which coordinates are angles
    size: float  # the size of the mechanism
    # (n,): scale of each coordinate: 1 rad for angles, the size of the mechanism for the others
    reference: Array
    # (n,): how far from zero each coordinate is at a guess, or in the assembled mechanism
    place: Array
    # Correction, in scales, below which there are only rounding errors of so far a place.
    floor: float
    probe: Array  # (m,): numbers of size 1/2 to 1 and either sign without a pattern
    magnitude: Array  # (m,): what the terms of each equation contribute at a generic position
    # (m,): what rounding errors of so large coordinates leave of each equation
    noise: Array
    limit: Array | float = np.inf  # (m,): what they contribute at most, wherever they are
    _weights: Array | None = field(default=None, init=False)

    def scale(self, q: Array) -> Array:
        """Give how large each coordinate is at a position, as far as it is not gone wild."""
        return np.minimum(np.maximum(np.abs(q), self.reference), WILD * self.reference + self.place)

    def is_small(self, correction: Array, q: Array, tolerance: float) -> bool:
        """Say whether a correction that led to q is small, or all that floating point can give."""
        allowed = max(tolerance, self.floor) * self.reference + ROUNDING * np.abs(q)
        return bool((np.abs(correction) <= allowed).all())

    @property
    def near(self) -> Array:
        """How far each coordinate of a guess may be from an assembly that it is near."""
        return self.reference * np.where(self.angular, NEAR_ANGLE, NEAR_PART)

    def apart(self, q: Array, guess: Array) -> Array:
        """Give the way from a guess to a position, or to each of a batch, as a mechanism shows it.

        Whole turns of an angle are no way, and Euler parameters p and -p are one orientation.
        """
        way = q - guess
        turns = np.round(way[self.angular] / math.tau)
        if turns.any():
            way[self.angular] -= math.tau * turns
        covers = self.code.covers
        if covers.size:
            p, shown = q[covers], guess[covers]
            is_turned = (p * shown).sum(axis=1, keepdims=True) < 0
            way[covers] = np.where(is_turned, p + shown, p - shown)
        return way

    def is_turned(self, q: Array, guess: Array) -> Any:
        """Say whether whole turns, or the sign of Euler parameters, may lie between positions."""
        turned = (np.abs(q - guess)[self.angular | self.code.may_turn] > math.pi).any(axis=0)
        covers = self.code.covers
        along = (q[covers] * guess[covers]).sum(axis=1)
        return turned | (along <= SAME_POSITION).any(axis=0)

    def turned_back(self, q: Array, guess: Array) -> Array:
        """Turn angles of a batch of positions by whole turns towards a guess."""
        turning, found = self.angular | self.code.may_turn, q.copy()
        found[turning] -= math.tau * np.round((q - guess)[turning] / math.tau)
        return found

    def away(self, q: Array, guess: Array) -> Any:
        """Give how far a position, or each of a batch, is from a guess; up to 1.0 it is near."""
        return (np.abs(self.apart(q, guess)) / column(self.near, q)).max(axis=0)

    def is_far(self, q: Array, guess: Array) -> Any:
        """Say whether an angle of a position, or of each of a batch, is far from a guess's."""
        return (np.abs(self.apart(q, guess))[self.code.may_turn] > FAR).any(axis=0)

    def has_converged(
        self, before: Point, point: Point, tolerance: float, corrections: list[float]
    ) -> bool:
        """Say whether Newton's method is at its end: the last correction small, and Phi zero.

        Near a singular configuration rounding alone keeps the corrections above any tolerance: they
        crawl.
        """
        # Its length alone nearly always says whether a correction is small.
        length, bound = corrections[-1], max(tolerance, self.floor)
        most = bound * max(1.0, self.size) * math.sqrt(point.q.size) + ROUNDING * norm(point.q)
        small = length <= bound * min(1.0, self.size) or (
            length <= 2 * most and self.is_small(point.q - before.q, point.q, tolerance)
        )
        if small and self.holds(point, RESIDUAL_FACTOR * tolerance):
            return True
        return (small or converges_linearly(corrections)) and bool(self.holds_to_rounding(point))

    def weights(self) -> Array:
        """Give by what equations of different units are multiplied to count alike."""
        if self._weights is None:
            self._weights = weights_of(self.magnitude)
        return self._weights

    def terms(self, point: Point, scale: Array) -> Array:
        """Give what the terms of each equation contribute at the scales of the coordinates.

        At a dead point a whole row of Phi_q may vanish. What it contributes elsewhere keeps the
        equation from being measured by nothing. For a batch that has to do.
        """
        if point.q.ndim > 1:
            return self.magnitude[:, np.newaxis]
        sizes = np.abs(point.Phi_q)
        if sizes.ndim > 1:
            terms = sizes @ scale
        else:
            rows, columns = self.code.pattern.T
            terms = np.bincount(rows, sizes * scale[columns], self.magnitude.size)
        return np.asarray(np.maximum(self.magnitude, np.minimum(terms, self.limit)))

    def holds(self, point: Point, tolerance: float) -> Any:
        """Say where every equation holds, relative to what its terms contribute.

        The reference is the scale here: a wild iterate must not become a solution because its own
        coordinates are huge.
        """
        if point.q.ndim == 1 and within(point.Phi, tolerance * self.magnitude):
            return True  # nearly always; the terms are never less, and cost a pass over Phi_q
        noise = column(self.noise, point.q)
        return within(point.Phi, tolerance * self.terms(point, self.reference) + noise)

    def holds_to_rounding(self, point: Point) -> Any:
        """Say where every equation holds as well as floating point permits."""
        terms = self.terms(point, self.scale(point.q))
        return within(point.Phi, ROUNDING * terms)

    def extent(self, rows: Array) -> Any:
        """Return the largest of some coordinates, or of each of a batch of them, in scales."""
        return (np.abs(rows).T / self.reference).max(axis=-1)

    def distance(self, q: Array, other: Array) -> float:
        """Return how far two positions are apart, whatever whole turns lie between."""
        return float(self.extent(self.apart(q, other)))

    def missed(self, Phi: Array) -> float:
        """Return by how much all equations are missed, relative to their terms."""
        return norm(Phi * self.weights())

    def scaled(self, Phi_q: Array) -> Array:
        """Return a matrix Phi_q (m, n) in scales of the equations and the coordinates."""
        return np.asarray(self.weights()[:, np.newaxis] * Phi_q * self.reference)


def weights_of(terms: Array) -> Array:
    """Return by what equations are multiplied whose terms contribute so much, to count alike."""
    return np.asarray(1 / np.where(terms > 0, terms, 1.0))


def within(values: Array | Iterable[Array], limits: Array) -> Any:
    """Say where no value, of a row of a batch, is beyond the limit of its row."""
    if isinstance(values, np.ndarray) and values.ndim == 1:
        return (np.abs(values) <= limits).all()
    good: Any = np.True_
    for row, limit in zip(values, limits.ravel().tolist(), strict=True):
        if not np.dot(row, row) <= limit * limit:
            good = good & (np.abs(row) <= limit)
    return good


def column(values: Array, q: Array) -> Array:
    """Return a number for each coordinate or equation in the shape that fits positions."""
    return values if q.ndim == 1 else values[:, np.newaxis]


def norm(vector: Array) -> float:
    """Return the Euclidean norm; three times as fast as `numpy.linalg.norm`."""
    length = math.sqrt(vector @ vector)
    return length if length < math.inf else math.hypot(*vector)  # where the squares overflow


def converges_linearly(corrections: Sequence[float]) -> bool:
    """Say whether corrections shrink no faster than towards a double root, by halves."""
    return len(corrections) > 1 and corrections[-1] > corrections[-2] / 4
