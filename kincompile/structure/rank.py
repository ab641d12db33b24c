r"""The rank of Phi_q at generic assembled states, and what it says of joints and drivers.

Counting looks at no length. A parallelogram with a third parallel bar counts as a structure and
moves: on the manifold :math:`\Phi = 0` some rows of Phi_q depend on the others, at every position,
while at positions that are not assembled they do not. So the rank is taken where it matters: at
seeded random states that are assembled first, joints alone, so that the drivers choose nothing.

A row may also depend on the others at every state that was found, and yet repeat none: rhombi in a
chain have components of their manifold on which a loop lies flat, and Phi_q is singular throughout.
So the mechanism is moved with the independent joints alone. A row that repeats them depends on
them there as well; one that does not is independent of them, and the states were singular.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import (
    ALLOWED_PART,
    ASSEMBLED,
    DAMPING,
    HALF,
    LESS_DAMPING,
    MORE_DAMPING,
    NEAR_MISS,
    RESIDUAL_FACTOR,
    SLIGHT,
    STALLED,
    size_of,
)
from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.structure.blocks import SMALL

Array: TypeAlias = NDArray[np.float64]
Evaluate: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]
"""Gives Phi (S, m) and Phi_q (S, m, n) at states q (S, n), t (S,)."""
State: TypeAlias = tuple[Array, Array]
"""Coordinates q (1, n) and time t (1,)."""

STATES, SEED = 5, 1989
"""States at which the rank is taken; the largest counts, since any of them may be singular."""

NEAR = 0.15
"""How far from the guess a state is sought, in radians and sizes of the mechanism: near enough to
be the same way of assembling it."""

ITERATIONS, PATIENCE = 60, 8
"""Steps of Levenberg and Marquardt towards an assembled state, and how many good ones may go by
that shorten the residual by less than a hundredth."""

DEPENDENT = SLIGHT
"""Part of a row that is left when the rows before are taken out of it, below which it depends."""

ASIDE = (0.1, 0.03, 0.01, 1e-3, 1e-4)
"""How far a state is moved along the tangents of the independent joints, in scales."""

UNSURE = math.sqrt(DEPENDENT)
"""What stands for `DEPENDENT` where no position is settled: each is wrong by the root of that."""

ANGLES_FIRST = 10.0
"""How much rather a driver is an angle than a length: motors turn."""


@dataclass(frozen=True, slots=True, eq=False)
class RankReport:
    """The generic rank of a system, and the rows and columns that make it smaller."""

    # Rank of Phi_q at generic states at which the joints are assembled; where all that were found
    # are singular, at states beside them that the independent joints allow.
    rank: int
    redundant: tuple[int, ...]  # rows that depend on rows before them and hold whenever those do
    # Rows that depend on rows before them and cannot hold together with them.
    conflicting: tuple[int, ...]
    # For each redundant and conflicting row, the rows that it depends on.
    partners: dict[int, tuple[int, ...]]
    free: tuple[int, ...]  # columns that no equation determines
    # As many of them as there are degrees of freedom: with these driven, nothing is free.
    drive: tuple[int, ...]
    # (dof, n): orthonormal directions, in scales, in which it may move at the generic state.
    motions: Array
    state: State  # the generic one
    # Whether joints and drivers, as far as they are independent, could be assembled at the start.
    assembled: bool
    # Rank at the start; where it is less than `rank` and the system is assembled, that position is
    # singular.
    rank_at_start: int
    nearest: Array  # (n,): the position at the start, or the nearest to one
    residuals: Array  # (m,): Phi there
    scale: Array  # (n,): the size of the mechanism, 1 for angles


def generic_rank(
    evaluate: Evaluate,
    guess: Array,
    angular: NDArray[np.bool_],
    drivers: Sequence[int],
    own: Sequence[int],
    end: float,
    names: Sequence[str],
) -> RankReport:
    """Find the rank of Phi_q at generic assembled states, and the rows that depend on others.

    The mechanism is meant to be assembled at the guess (n,), and moves from t = 0 to the end.
    `angular` (n,) says which coordinates are angles, `drivers` are the rows that are functions of
    time, `own` those of bodies themselves: these come first, so that no joint makes them redundant.
    An equation that has no finite value, or derivative, anywhere near the guess is refused by its
    name.
    """
    with np.errstate(all="ignore"):
        analysis = _Analysis(evaluate, guess, angular, drivers, own, end)
        undefined = [names[row] for row in analysis.undefined()]
        if undefined:
            raise InputError(
                f"these equations have no finite value near the guess: {listed(undefined)}. Look "
                "for a division by zero, or a square root or logarithm of a negative number; or "
                "give a guess where they have one"
            )
        return analysis.report()


class _Analysis:
    """A system with its scales and the states from which it is assembled."""

    def __init__(
        self,
        evaluate: Evaluate,
        guess: Array,
        angular: NDArray[np.bool_],
        drivers: Sequence[int],
        own: Sequence[int],
        end: float,
    ) -> None:
        random = np.random.default_rng(SEED)

        def entries(q: Array) -> tuple[Array, Array]:
            Phi, Phi_q = evaluate(q[np.newaxis], np.zeros(1))
            return Phi[0], Phi_q[0].reshape(-1)

        size = size_of(entries, None, angular, guess) or 1.0
        self._evaluate = evaluate
        self._angular = angular
        self._scale = np.where(angular, 1.0, size)
        offsets = random.uniform(-NEAR, NEAR, (STATES, guess.size))
        offsets[0] *= 1e-3
        self._q = guess + offsets * self._scale
        self._t = np.append(0.0, random.uniform(0, end, STATES - 1))
        _, Phi_q = evaluate(self._q, self._t)
        sizes = np.abs(Phi_q) @ self._scale
        terms = np.max(np.where(np.isfinite(sizes), sizes, 0.0), axis=0)
        self._terms = np.where(terms > 0, terms, 1.0)
        self._drivers = list(drivers)
        others = {*drivers, *own}
        self._joints = [*own, *(row for row in range(terms.size) if row not in others)]

    def undefined(self) -> list[int]:
        """Return the rows that are most seldom finite, where no state has all of them finite."""
        Phi, Phi_q = self._evaluate(self._q, self._t)
        finite = np.isfinite(Phi) & np.isfinite(Phi_q).all(axis=2)
        if finite.all(axis=1).any():
            return []
        often = np.sum(finite, axis=0)
        return [int(row) for row in np.flatnonzero(often == often.min())]

    def report(self) -> RankReport:
        """Analyse the joints, then the drivers, then whether all can hold together."""
        q, held, settled = self._assemble(self._joints, self._q, self._t)
        chosen = held & settled if (held & settled).any() else held
        order, limit = [*self._joints, *self._drivers], DEPENDENT
        if chosen.any():
            sure = DEPENDENT if settled[chosen].all() else UNSURE
            state = self._beside(q[chosen], self._t[chosen], sure)
        elif nearly := self._nearly_assembled(q):
            q, state, limit = nearly
        else:  # which joints are too many, if any, shows elsewhere too
            q, ranks = self._q, [_rank(x) for x in self._scaled(self._q[1:], self._t[1:])]
            state = self._state(q, self._t, 1 + int(np.argmax(ranks)))
        matrix = self._scaled(*state)[0]
        kept, dependent = _split(matrix, order, limit)
        # A joint that holds at an assembled state, and depends on others beside it, repeats them.
        repeating = [row for row in dependent if row not in self._drivers and chosen.any()]
        doubtful = [row for row in dependent if row not in repeating]
        wrong = self._contradictions(q, kept, doubtful, repeating) if doubtful else set()
        if not chosen.any() and not wrong:
            wrong = set(dependent)
        nearest, together, _ = self._assemble(kept, q[:1], self._t[:1])
        motions = np.linalg.svd(matrix[kept])[2][len(kept) :]
        weights = np.where(self._angular, ANGLES_FIRST, 1.0)
        drive, _ = drivers_of(motions, np.eye(motions.shape[1]), weights)
        return RankReport(
            rank=len(kept),
            redundant=tuple(sorted(set(dependent) - wrong)),
            conflicting=tuple(sorted(wrong)),
            partners=_partners(matrix, kept, dependent),
            free=tuple(np.flatnonzero(np.max(np.abs(motions), 0, initial=0) > DEPENDENT).tolist()),
            drive=tuple(sorted(drive)),
            motions=motions,
            state=state,
            assembled=bool(together[0]),
            rank_at_start=_rank(self._scaled(nearest, self._t[:1])[0]),
            nearest=nearest[0],
            residuals=self._evaluate(nearest, self._t[:1])[0][0],
            scale=self._scale,
        )

    @staticmethod
    def _state(q: Array, t: Array, index: int) -> State:
        """Return one of some states."""
        return q[index : index + 1], t[index : index + 1]

    def _nearly_assembled(self, q: Array) -> tuple[Array, State, float] | None:
        """Return where joints almost hold that cannot hold exactly, and what depends on others.

        There a row that would repeat others, were the lengths right, differs from them by about as
        much as the equations are missed, or up to ten times that. The others can be assembled.
        Returns states, the best of them and the limit for what depends; None where that is not the
        case.
        """
        missed = np.max(np.abs(self._weighted(q, self._t, self._joints)[0]), axis=1)
        best = int(np.argmin(missed))
        if len(self._terms) <= q.shape[1] or not missed[best] <= NEAR_MISS:
            return None
        state, limit = self._state(q, self._t, best), max(DEPENDENT, RESIDUAL_FACTOR * missed[best])
        kept, dependent = _split(self._scaled(*state)[0], self._joints, limit)
        _, held, _ = self._assemble(kept, q, self._t)
        return (q, state, limit) if dependent and held.any() else None

    def _beside(self, q: Array, t: Array, limit: float) -> State:
        """Return the best of some assembled states, or where Phi_q has a larger rank beside it.

        There the independent joints hold, and a row that repeats them depends on them, too.
        """
        matrices = self._scaled(q, t)
        ranks = [_rank_and_gap(matrix, limit) for matrix in matrices]
        if self._drivers and max(ranks)[0] < min(matrices.shape[1:]):
            # The joints may hold on a branch on which the drivers cannot move them.
            led, held, settled = self._assemble([*self._joints, *self._drivers], q, t)
            q, t = np.vstack([q, led[held & settled]]), np.append(t, t[held & settled])
            matrices = self._scaled(q, t)
            ranks += [_rank_and_gap(matrix, limit) for matrix in matrices[len(ranks) :]]
        best = ranks.index(max(ranks))
        kept, dependent = _split(matrices[best], self._joints, limit)
        if not dependent or len(kept) == matrices.shape[2]:
            return self._state(q, t, best)
        tangents = np.linalg.svd(matrices[best][kept])[2][len(kept) :]
        random, lengths = np.random.default_rng(SEED), np.array(ASIDE)[:, np.newaxis]
        steps = random.uniform(-1, 1, (len(ASIDE), len(tangents))) @ tangents
        steps *= lengths / np.max(np.abs(steps), axis=1, keepdims=True)
        times, start = np.full(len(ASIDE), t[best]), q[best] + steps * self._scale
        moved, held, settled = self._assemble(kept, start, times)
        near = (np.abs(moved - start) <= ALLOWED_PART * lengths * self._scale).all(axis=1)
        usable = held & settled & near
        states = np.vstack([q[best], moved[usable]]), np.append(t[best], times[usable])
        return self._state(*states, int(np.argmax([_rank(x) for x in self._scaled(*states)])))

    def _contradictions(
        self, q: Array, kept: list[int], dependent: list[int], repeating: list[int]
    ) -> set[int]:
        """Return which dependent rows fail where the independent ones and those repeating hold."""
        found, held, _ = self._assemble(kept, q, self._t)
        if not held.any():  # the drivers lead where the joints cannot follow
            return set(dependent) & set(self._drivers)
        missed = np.abs(self._evaluate(found[held], self._t[held])[0]) / self._terms
        on_branch = (missed[:, repeating] <= ASSEMBLED * RESIDUAL_FACTOR).all(axis=1)
        # The median, for drivers may agree at one time; and a state may be on another branch.
        missed = np.median(missed[on_branch] if on_branch.any() else missed, axis=0)
        return {row for row in dependent if not missed[row] <= ASSEMBLED * 10}

    def _scaled(self, q: Array, t: Array) -> Array:
        """Return Phi_q at states with each row of length one and columns in scales.

        A row that is not finite is set to zero: it has no meaning there.
        """
        matrices = self._evaluate(q, t)[1] * self._scale
        matrices[~np.isfinite(matrices).all(axis=2)] = 0.0
        lengths = np.linalg.norm(matrices, axis=2, keepdims=True)
        return np.asarray(matrices / np.where(lengths > 0, lengths, 1.0))

    def _assemble(
        self, rows: list[int], start: Array, t: Array
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Find states at which some rows hold; return them, which do so, and which are settled."""
        (least, first, most), q, step = DAMPING, start.copy(), np.full(len(start), np.inf)
        damping, idle = np.full(len(q), first), np.zeros(len(q), dtype=int)
        Phi, matrices = self._weighted(q, t, rows)
        size = np.sum(Phi * Phi, axis=1)
        for _ in range(ITERATIONS):
            held = np.max(np.abs(Phi), axis=1, initial=0.0) <= ASSEMBLED / 100
            # At a singular position equations hold to 1e-12 while q is still wrong by 1e-6.
            settled, stuck = held & (step <= HALF), (idle >= PATIENCE) | (damping >= most)
            if (held | stuck).all() and (settled.any() or not held.any()):
                break
            active = np.flatnonzero(~settled & ~stuck)
            try:
                steps = np.array([damped(matrices[k], Phi[k], damping[k]) for k in active])
            except (np.linalg.LinAlgError, RuntimeError):  # not finite
                break
            moved = q[active] - self._scale * steps
            tried, jacobians = self._weighted(moved, t[active], rows)
            reached = np.sum(tried * tried, axis=1)
            better = reached < size[active]
            fell = reached < STALLED * size[active]
            idle[active] = np.where(fell, 0, idle[active] + better)
            taken = active[better]
            q[taken], Phi[taken], matrices[taken] = moved[better], tried[better], jacobians[better]
            size[taken] = reached[better]
            step[active] = np.max(np.abs(steps), axis=1)
            factors = np.where(better, LESS_DAMPING, MORE_DAMPING)
            damping[active] = np.clip(damping[active] * factors, least, most)
        return q, np.max(np.abs(Phi), axis=1, initial=0.0) <= ASSEMBLED, step <= HALF

    def _weighted(self, q: Array, t: Array, rows: list[int]) -> tuple[Array, Array]:
        """Return some rows of Phi and Phi_q, in scales of equations and coordinates."""
        Phi, Phi_q = self._evaluate(q, t)
        terms = self._terms[rows]
        return Phi[:, rows] / terms, Phi_q[:, rows] * (self._scale / terms[:, None])


def damped(matrix: Array, Phi: Array, damping: float) -> Array:
    """Return the correction of Levenberg and Marquardt."""
    n = matrix.shape[1]
    if n <= SMALL:
        normal = matrix.T @ matrix + damping * np.eye(n)
        return np.asarray(np.linalg.solve(normal, matrix.T @ Phi), dtype=np.float64)
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import splu

    sparse = csc_array(matrix)
    factors = splu(csc_array(sparse.T @ sparse + damping * eye_array(n)))
    return np.asarray(factors.solve(matrix.T @ Phi), dtype=np.float64)


def _rank(matrix: Array) -> int:
    """Return the rank of a matrix with rows of length one."""
    return int(np.linalg.matrix_rank(matrix, tol=DEPENDENT))


def _rank_and_gap(matrix: Array, limit: float) -> tuple[int, float]:
    """Return the rank of a matrix with rows of length one, and its smallest singular value."""
    values = np.linalg.svd(matrix, compute_uv=False)
    rank = int(np.sum(values > limit))
    return rank, float(values[rank - 1]) if rank else 0.0


def _split(
    matrix: Array, order: Sequence[int], limit: float = DEPENDENT
) -> tuple[list[int], list[int]]:
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
        if length > limit and len(kept) < len(basis):
            basis[len(kept)] = rest / length
            kept.append(row)
        else:
            dependent.append(row)
    return kept, dependent


def _partners(matrix: Array, kept: list[int], dependent: list[int]) -> dict[int, tuple[int, ...]]:
    """Return the independent rows that each dependent row is a combination of."""
    if not dependent:
        return {}
    shares = np.linalg.lstsq(matrix[kept].T, matrix[dependent].T, rcond=None)[0]
    return {
        row: tuple(kept[k] for k in np.flatnonzero(np.abs(share) > DEPENDENT).tolist())
        for row, share in zip(dependent, shares.T, strict=True)
    }


def drivers_of(motions: Array, rows: Array, weights: Array) -> tuple[list[int], Array]:
    """Return rows to drive one after the other, each where it moves most; and the motions left.

    `motions` (dof, n) are directions in which a mechanism may move, `rows` (k, n) the rates that
    drivers may give, `weights` (k,) how much rather one is taken. Of equals it is the first.
    """
    weights = weights * (1 - DEPENDENT * np.arange(len(rows)))
    taken: list[int] = []
    rates = rows @ motions.T
    while rates.size:
        lengths = np.linalg.norm(rates, axis=1)
        row = int(np.argmax(lengths * weights))
        if not lengths[row] > DEPENDENT:
            break
        taken.append(row)
        # Householder: the first of the reflected directions is that of this row.
        normal = rates[row].copy()
        normal[0] += math.copysign(lengths[row], normal[0])
        normal *= math.sqrt(2) / np.linalg.norm(normal)
        motions = (motions - np.outer(normal, normal @ motions))[1:]
        rates = (rates - np.outer(rates @ normal, normal))[:, 1:]
    return taken, motions
