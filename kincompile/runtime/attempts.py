"""The safeguarded attempts to assemble many parameter sets, together: which are in vain.

One set that cannot be assembled takes a hundred of `problem.safeguarded_step`. Here all sets take
them side by side; one that comes anywhere near to holding its equations is left to
`start.assemble`. Where the attempt from its guess leads shows on which branch that would end.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import criteria
from kincompile.runtime.engine.linear import Planned, stacked
from kincompile.runtime.engine.scales import weights_of
from kincompile.runtime.start import mirrored, restart_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.problem import Problem

    Mask = NDArray[np.bool_]
    Places = NDArray[np.intp]
    Entries = tuple[tuple[int, int, float | None], ...]


def safeguarded(
    equations: Problem, sets: Array, t: float | Array, guesses: Array, max_iterations: int
) -> Array:
    """Return where safeguarded attempts from N guesses (N, n), with parameters (N, k), come near.

    That is (n, N), of each the first attempt that does, and NaN where none does: Newton's own steps
    lead from there to the position, or nowhere. The scales of all are those of one set. The module
    has a planned solve.
    """
    times = np.broadcast_to(t, len(sets))
    found, (first, *others) = np.full_like(guesses.T, np.nan), restart_points(equations, guesses)
    most = max(1, MOST_NUMBERS // equations.place.size**2)
    for some in ([first], others):
        left = np.flatnonzero(np.isnan(found[0]))
        own = np.tile(left, len(some))
        q = np.concatenate([begin[left] for begin in some]).T
        for part in [slice(k, k + most) for k in range(0, own.size, most)]:
            here, which = q[:, part].copy(), own[part]
            is_near = attempted(equations, sets[which], times[which], here, max_iterations)
            q[:, part] = np.where(is_near, here, np.nan)
        for reached in reversed(np.split(q, len(some), axis=1)):  # the first one counts
            near = np.isfinite(reached[0])
            found[:, left[near]] = reached[:, near]
    return found


def attempted(equations: Problem, sets: Array, t: Array, q: Array, max_iterations: int) -> Mask:
    """Make attempts from positions (n, N), and say which come near; these become where they end."""
    run = equations.code.attempts
    if run is None or len(q) > LARGEST_DENSE:
        return ~_Attempts(equations, sets.T.copy(), t, q).miss(q, max_iterations)
    is_near = np.zeros(len(t), dtype=bool)
    for time in np.unique(t):
        which = np.flatnonzero(t == time)
        own = q[:, which]
        is_near[which] = run(sets[which], float(time), own, equations.size, max_iterations)
        q[:, which] = own
    return is_near


def other_sides(equations: Problem, sets: Array, t: float, q: Array) -> Array:
    """Return `start.other_side` of N positions (n, N), with parameters (N, k)."""
    n, found, run = len(q), np.full_like(q, np.nan), equations.code.mirror
    some, most = np.flatnonzero(np.isfinite(q).all(axis=0)), max(1, MOST_NUMBERS // n**2)
    for first in range(0, some.size if n <= criteria.MOST_MIRRORED else 0, most):
        own = some[first : first + most]
        here, p = q[:, own], sets[own]
        if run is not None and n <= LARGEST_DENSE:
            found[:, own] = run(p, t, here, equations.size, equations.magnitude)
            continue
        attempts = _Attempts(equations, p.T.copy(), np.full(len(p), t), here)
        found[:, own] = mirrored(equations, here.T, attempts.matrices(here.T), attempts.matrices).T
    return found


PATIENT = 3
"""Steps over which a residual must fall."""

LARGEST_DENSE = 60
"""Coordinates up to which compiled attempts are made, whose normal equations are dense."""

MOST_NUMBERS = 250_000
"""Numbers of the matrices that are taken at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class _Pattern:
    """Where the entries of Phi_q are, and in which order its normal equations are eliminated."""

    rows: Places  # (nnz,)
    columns: Places
    numbers: Array  # (nnz,): what never changes; NaN where it varies
    rows_of: list[Places]  # of each row its entries
    # The normal equations: entries of the lower triangle that are not zero, each a number. What is
    # added to it: two entries of Phi_q.
    products: list[tuple[int, int, int]]
    # Each pivot, its number, the columns that it is coupled with then, with the numbers of these
    # entries; and what loses a product of two of them: its number, and theirs.
    order: list[tuple[int, int, list[tuple[int, int]], list[tuple[int, int, int]]]]
    diagonal: Places  # numbers of the diagonal's entries
    count: int  # of all entries


@lru_cache(maxsize=16)
def _pattern_of(entries: Entries, m: int, n: int) -> _Pattern:
    """Return the pattern of Phi_q: eliminated first is what is coupled with fewest others."""
    rows, columns, numbers = (np.array(x) for x in zip(*entries, strict=True))
    places: dict[tuple[int, int], int] = {}

    def number_of(i: int, j: int) -> int:
        return places.setdefault((max(i, j), min(i, j)), len(places))

    coupled: dict[int, set[int]] = {column: set() for column in range(n)}
    diagonal = np.array([number_of(column, column) for column in range(n)])
    rows_of = [np.flatnonzero(rows == row) for row in range(m)]
    products, order = [], []
    for own in rows_of:
        among = list(zip(own.tolist(), columns[own].tolist(), strict=True))
        for k, (first, i) in enumerate(among):
            coupled[i].update(j for _, j in among)
            products += [(number_of(i, j), first, second) for second, j in among[k:]]
    while coupled:
        pivot = min(coupled, key=lambda column: len(coupled[column]))
        others = sorted(coupled.pop(pivot) - {pivot})
        for column in others:
            coupled[column] = coupled[column].union(others) - {pivot}
        below = [(i, number_of(i, pivot)) for i in others]
        updates = [
            (number_of(i, j), first, second)
            for k, (i, first) in enumerate(below)
            for j, second in below[k:]
        ]
        order.append((pivot, int(diagonal[pivot]), below, updates))
    return _Pattern(
        rows, columns, numbers.astype(np.float64), rows_of, products, order, diagonal, len(places)
    )


class _Attempts:
    """What `problem.safeguarded_step` reads, of N problems: arrays (n, N) and (m, N)."""

    def __init__(self, equations: Problem, sets: Array, t: Array, q: Array) -> None:
        code = equations.code
        pattern = _pattern_of(code.entries, len(code.equations), len(code.coordinates))
        self._code, self._pattern, self._t, self._p = code, pattern, t, sets
        self._reference = equations.reference[:, np.newaxis]
        self._limit = np.broadcast_to(equations.limit, len(pattern.rows_of))[:, np.newaxis]
        self._most = (
            self._reference * np.where(self._code.angular, criteria.LARGEST_ANGLE, 1.0)[:, None]
        )
        self._scales = self._reference[pattern.columns]
        # (m, nnz): adds up what the entries of each row contribute.
        self._add = (np.arange(self._limit.size)[:, None] == pattern.rows) * self._scales.T
        generic = q + self._reference * criteria.probe_of(len(q))[:, np.newaxis]
        terms = self._add @ np.abs(self._evaluate(generic, np.arange(t.size))[1])
        self._magnitude = np.where(np.isfinite(terms), terms, equations.magnitude[:, np.newaxis])

    def _evaluate(self, q: Array, which: Places) -> tuple[Array, Array]:
        """Return Phi (m, N) and the entries of Phi_q (nnz, N) of some problems."""
        varies = np.isnan(self._pattern.numbers)
        point = Planned(self._code, self._p[:, which]).evaluate(q, self._t[which])
        entries = np.repeat(self._pattern.numbers[:, np.newaxis], which.size, axis=1)
        entries[varies] = stacked(point.Phi_q, which.size)
        return stacked(point.Phi, which.size), entries

    def matrices(self, q: Array) -> Array:
        """Return Phi_q, (N, m, n), of all problems at positions (N, n)."""
        found = np.zeros((len(q), len(self._pattern.rows_of), q.shape[1]))
        entries = self._evaluate(q.T, np.arange(len(q)))[1]
        found[:, self._pattern.rows, self._pattern.columns] = entries.T
        return found

    def miss(self, q: Array, max_iterations: int) -> Mask:
        """Say which sets the attempts from positions (n, N) bring nowhere near to being assembled.

        The positions become those that were reached.
        """
        far, moving = np.ones(q.shape[1], dtype=bool), np.arange(q.shape[1])
        earlier = np.full((PATIENT, moving.size), np.inf)  # the last residuals of each
        Phi, Phi_q = self._evaluate(q, moving)
        for _ in range(max_iterations):
            sizes = np.abs(Phi_q)
            terms = np.minimum(self._add @ sizes, self._limit)
            weights = weights_of(np.maximum(self._magnitude[:, moving], terms))
            residual = weights * Phi
            before = _norms(residual)
            known = (before > criteria.ASSEMBLES) & (sizes.max(axis=0) < criteria.TOO_STEEP)
            far[moving[~known]] = False
            known &= before < criteria.FALLING * earlier[0, moving]
            earlier[:, moving] = np.vstack((earlier[1:, moving], before))
            entries = weights[self._pattern.rows] * Phi_q * self._scales
            moving, weights, residual, before, entries = _some(
                known, moving, weights, residual, before, entries
            )
            direction, falls = _directions(self._pattern, entries, residual, before)
            sane = np.isfinite(falls)
            far[moving[~sane]] = False
            sane &= falls > criteria.STATIONARY
            moving, direction, weights, before = _some(sane, moving, direction, weights, before)
            if not moving.size:
                break
            correction = self._reference * direction
            moved, Phi, Phi_q = self._shortened(q, moving, correction, weights, before)
            moving, Phi, Phi_q = _some(moved, moving, Phi, Phi_q)
        return far

    def _shortened(
        self, q: Array, moving: Places, correction: Array, weights: Array, before: Array
    ) -> tuple[Mask, Array, Array]:
        """Apply as much of each correction as lowers the residual.

        Returns where any does, and Phi and the entries of Phi_q there.
        """
        part = 1 / np.maximum((np.abs(correction) / self._most).max(axis=0), 1.0)
        moved, left = np.zeros(moving.size, dtype=bool), np.arange(moving.size)
        Phi, Phi_q = np.zeros((len(weights), left.size)), np.zeros((len(self._scales), left.size))
        while left.size:
            trial = q[:, moving[left]] + part[left] * correction[:, left]
            here = self._evaluate(trial, moving[left])
            after = _norms(weights[:, left] * here[0])
            lower = after <= (1 - criteria.SUFFICIENT * part[left]) * before[left]
            done = left[lower]
            q[:, moving[done]], moved[done] = trial[:, lower], True
            Phi[:, done], Phi_q[:, done] = here[0][:, lower], here[1][:, lower]
            part[left] /= 2
            left = left[~lower & (part[left] >= criteria.SHORTEST_STEP)]
        return moved, Phi, Phi_q


def _directions(
    pattern: _Pattern, entries: Array, residual: Array, size: Array
) -> tuple[Array, Array]:
    """Return Levenberg's and Marquardt's directions, of residuals that are far from zero.

    And by which part of itself the square of each residual would fall, if equations were linear.
    """
    normal, sides = np.zeros((pattern.count, size.size)), np.zeros((len(pattern.order), size.size))
    part = np.empty(size.size)
    for place, first, second in pattern.products:
        np.multiply(entries[first], entries[second], out=part)
        normal[place] += part
    for right, among in zip(residual, pattern.rows_of, strict=True):
        for k in among:
            np.multiply(entries[k], right, out=part)
            sides[pattern.columns[k]] -= part
    normal[pattern.diagonal] += criteria.BEND * np.minimum(1.0, size)
    found, factors = sides.copy(), normal.copy()
    for pivot, own, below, updates in pattern.order:
        for i, place in below:
            factors[place] = normal[place] / normal[own]
            np.multiply(factors[place], found[pivot], out=part)
            found[i] -= part
        for place, first, second in updates:
            np.multiply(factors[first], normal[second], out=part)
            normal[place] -= part
    for pivot, own, below, _ in reversed(pattern.order):
        found[pivot] /= normal[own]
        for i, place in below:
            np.multiply(factors[place], found[i], out=part)
            found[pivot] -= part
    return found, (found * sides).sum(axis=0) / size**2


def _some(which: Mask, *arrays: Any) -> Any:
    """Return some columns of arrays; no copies of all of them."""
    return arrays if which.all() else tuple(values[..., which] for values in arrays)


def _norms(columns: Array) -> Any:
    return np.sqrt((columns * columns).sum(axis=0))
