r"""The rank of Phi_q at generic assembled states, and what it says of joints and drivers.

Counting looks at no length. A parallelogram with a third parallel bar counts as a structure and
moves: on the manifold :math:`\Phi = 0` some rows of Phi_q depend on the others, at every position,
while at positions that are not assembled they do not. So the rank is taken where it matters: at
seeded random states that are assembled first, joints alone, so that the drivers choose nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

Array: TypeAlias = NDArray[np.float64]
Evaluate: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]
"""Gives Phi (S, m) and Phi_q (S, m, n) at states q (S, n), t (S,)."""

STATES, SEED = 5, 1989
"""States at which the rank is taken; the largest counts, since any of them may be singular."""

NEAR = 0.15
"""How far from the guess a state is sought, in radians and sizes of the mechanism: near enough to
be the same way of assembling it."""

ITERATIONS = 60
"""Steps of Levenberg and Marquardt towards an assembled state."""

ASSEMBLED = 1e-9
"""Residual, relative to what the terms of an equation contribute, of an assembled state."""

DEPENDENT = 1e-6
"""Part of a row that is left when the rows before are taken out of it, below which it depends."""


@dataclass(frozen=True, slots=True)
class RankReport:
    """The generic rank of a system, and the rows and columns that make it smaller than it might be.

    Attributes
    ----------
    rank
        Rank of Phi_q at generic states at which the joints are assembled.
    redundant
        Rows that depend on rows before them and hold whenever those do.
    conflicting
        Rows that depend on rows before them and cannot hold together with them.
    partners
        For each redundant and conflicting row, the rows that it depends on.
    free
        Columns that no equation determines.
    assembled
        Whether the joints could be assembled; where rows depend on others, with the drivers.
    """

    rank: int
    redundant: tuple[int, ...]
    conflicting: tuple[int, ...]
    partners: dict[int, tuple[int, ...]]
    free: tuple[int, ...]
    assembled: bool


def generic_rank(
    evaluate: Evaluate,
    guess: Array,
    angular: NDArray[np.bool_],
    drivers: Sequence[int],
    end: float,
) -> RankReport:
    """Find the rank of Phi_q at generic assembled states, and the rows that depend on others.

    Parameters
    ----------
    evaluate
        The equations.
    guess : ndarray, shape (n,)
        Where the mechanism is meant to be assembled.
    angular : ndarray of bool, shape (n,)
        Which coordinates are angles.
    drivers
        Rows that are functions of time.
    end
        The motion lasts from 0 to this time.
    """
    with np.errstate(all="ignore"):
        return _Analysis(evaluate, guess, angular, drivers, end).report()


class _Analysis:
    """A system with its scales and the states from which it is assembled."""

    def __init__(
        self,
        evaluate: Evaluate,
        guess: Array,
        angular: NDArray[np.bool_],
        drivers: Sequence[int],
        end: float,
    ) -> None:
        random = np.random.default_rng(SEED)
        size = np.max(np.abs(guess[~angular]), initial=0.0) or 1.0
        self._evaluate = evaluate
        self._scale = np.where(angular, 1.0, size)
        offsets = random.uniform(-NEAR, NEAR, (STATES, guess.size))
        offsets[0] *= 1e-3
        self._q = guess + offsets * self._scale
        self._t = np.append(0.0, random.uniform(0, end, STATES - 1))
        _, Phi_q = evaluate(self._q, self._t)
        terms = np.nanmax(np.abs(Phi_q) @ self._scale, axis=0)
        self._terms = np.where(terms > 0, terms, 1.0)
        m = terms.size
        self._drivers = list(drivers)
        self._joints = [row for row in range(m) if row not in set(drivers)]

    def report(self) -> RankReport:
        """Analyse the joints, then the drivers, then whether all can hold together."""
        q, held = self._assemble(self._joints)
        if not held.any():
            return self._unassembled()
        scaled = self._scaled(q[held], self._t[held])
        order = [*self._joints, *self._drivers]
        kept, dependent, matrix = _best(scaled, order)
        partners = {row: _partners(matrix, row, kept, order) for row in dependent}
        wrong, together = self._contradictions(q, kept, dependent) if dependent else (set(), True)
        return RankReport(
            rank=len(kept),
            redundant=tuple(sorted(set(dependent) - wrong)),
            conflicting=tuple(sorted(wrong)),
            partners=partners,
            free=_free(matrix[kept]),
            assembled=together,
        )

    def _contradictions(
        self, q: Array, kept: list[int], dependent: list[int]
    ) -> tuple[set[int], bool]:
        """Return which dependent rows fail where the independent ones hold; and whether they do."""
        found, held = self._assemble(kept, q)
        if not held.any():
            return set(), False
        Phi, _ = self._evaluate(found[held], self._t[held])
        moving = self._t[held] > 0  # at the start drivers may agree that do not agree later
        sizes = np.abs(Phi[moving] if moving.any() else Phi) / self._terms
        missed = np.median(sizes, axis=0)
        return {row for row in dependent if not missed[row] <= ASSEMBLED * 10}, True

    def _unassembled(self) -> RankReport:
        """Report of joints that cannot be assembled: which of them are too many, if any."""
        scaled = self._scaled(self._q[1:], self._t[1:])
        order = [*self._joints, *self._drivers]
        kept, dependent, matrix = _best(scaled, order)
        partners = {row: _partners(matrix, row, kept, order) for row in dependent}
        return RankReport(
            len(kept), (), tuple(sorted(dependent)), partners, _free(matrix[kept]), assembled=False
        )

    def _scaled(self, q: Array, t: Array) -> Array:
        """Return Phi_q at states with each row of length one and columns in scales."""
        matrices = self._evaluate(q, t)[1] * self._scale
        lengths = np.linalg.norm(matrices, axis=2, keepdims=True)
        return np.asarray(matrices / np.where(lengths > 0, lengths, 1.0))

    def _assemble(
        self, rows: list[int], start: Array | None = None
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Find states at which some rows hold; return them, and which of them are assembled."""
        q = (self._q if start is None else start).copy()
        damping = np.full(len(q), 1e-3)
        Phi, matrices = self._weighted(q, rows)
        size = np.sum(Phi * Phi, axis=1)
        for _ in range(ITERATIONS):
            try:
                steps = [_damped(*parts) for parts in zip(matrices, Phi, damping, strict=True)]
            except (np.linalg.LinAlgError, RuntimeError):  # not finite
                break
            moved = q - self._scale * np.array(steps)
            tried, jacobians = self._weighted(moved, rows)
            reached = np.sum(tried * tried, axis=1)
            better = reached < size
            q = np.where(better[:, None], moved, q)
            Phi = np.where(better[:, None], tried, Phi)
            matrices = np.where(better[:, None, None], jacobians, matrices)
            size = np.where(better, reached, size)
            damping = np.clip(np.where(better, damping / 10, damping * 8), 1e-13, 1e3)
            held = np.max(np.abs(Phi), axis=1, initial=0.0) <= ASSEMBLED / 100
            if (held | (damping >= 1e3)).all():
                break
        return q, np.max(np.abs(Phi), axis=1, initial=0.0) <= ASSEMBLED

    def _weighted(self, q: Array, rows: list[int]) -> tuple[Array, Array]:
        """Return some rows of Phi and Phi_q, in scales of equations and coordinates."""
        Phi, Phi_q = self._evaluate(q, self._t)
        terms = self._terms[rows]
        return Phi[:, rows] / terms, Phi_q[:, rows] * (self._scale / terms[:, None])


def _damped(matrix: Array, Phi: Array, damping: float) -> Array:
    """Return the correction of Levenberg and Marquardt."""
    sparse = csc_array(matrix)
    normal = sparse.T @ sparse + damping * eye_array(matrix.shape[1])
    return np.asarray(splu(csc_array(normal)).solve(matrix.T @ Phi), dtype=np.float64)


def _best(matrices: Array, order: Sequence[int]) -> tuple[list[int], list[int], Array]:
    """Return independent and dependent rows at the state of largest rank, and Phi_q there."""
    finite = [matrix for matrix in matrices if np.isfinite(matrix).all()]
    best = max(finite, key=lambda matrix: int(np.linalg.matrix_rank(matrix, tol=DEPENDENT)))
    return (*_split(best, order), best)


def _split(matrix: Array, order: Sequence[int]) -> tuple[list[int], list[int]]:
    """Take rows in an order; return those independent of the ones before, and the others."""
    basis = np.empty((min(matrix.shape), matrix.shape[1]))
    kept: list[int] = []
    dependent: list[int] = []
    for row in order:
        rest = matrix[row]
        known = basis[: len(kept)]
        for _ in range(2):  # once more, for the rounding errors of the first time
            rest = rest - known.T @ (known @ rest)
        length = np.linalg.norm(rest)
        if length > DEPENDENT and len(kept) < len(basis):
            basis[len(kept)] = rest / length
            kept.append(row)
        else:
            dependent.append(row)
    return kept, dependent


def _partners(matrix: Array, row: int, kept: list[int], order: list[int]) -> tuple[int, ...]:
    """Return the rows that a dependent row is a combination of."""
    before = set(order[: order.index(row)])
    rows = [item for item in kept if item in before]
    shares = np.linalg.lstsq(matrix[rows].T, matrix[row], rcond=None)[0]
    return tuple(item for item, share in zip(rows, shares, strict=True) if abs(share) > DEPENDENT)


def _free(matrix: Array) -> tuple[int, ...]:
    """Return the columns in which some null vector of independent rows is not zero."""
    rank, n = matrix.shape
    if rank == n:
        return ()
    null = np.linalg.svd(matrix)[2][rank:]
    return tuple(np.flatnonzero(np.max(np.abs(null), axis=0) > DEPENDENT).tolist())
