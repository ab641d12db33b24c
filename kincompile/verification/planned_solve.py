"""The planned solve of a module, multiplied back: Phi_q x = b for random b, whatever gave x.

The determinants of its blocks are judged too, since their signs tell one branch from another: their
product is det Phi_q up to a factor, the same one at all states.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import SINGULAR_SENSITIVITY
from kincompile.runtime.engine.blocks import BlockSolver
from kincompile.runtime.engine.linear import Planned, stacked
from kincompile.verification.samples import dense

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.verification.samples import Samples

Array = NDArray[Any]

LIMIT = 1e-8
"""Allowed error, in terms of an equation; of determinants, the part of them that they may change.
A plan does not pivot: Phi_q of a sensitivity of 1e7 may cost half of the digits of b. Those of x
are lost to every method."""

OF_LARGEST = 1e-4
"""Part of the largest equation's terms that counts for all: rounding errors go from large equations
to small ones."""

ASIDE = 0.03
"""Imaginary part of complex coordinates, of themselves: nearly as regular as the real ones."""

SEED = 1990


class PlannedSolve:
    """The solves of a module with a planned solve, at its states where Phi_q is regular."""

    def __init__(self, samples: Samples) -> None:
        self._at = samples.only(_regular(samples))
        self._code = samples.code
        self._nonzeros = self._code.nonzeros(self._at.q, self._at.t, self._at.p)
        self._Phi_q = dense(self._code, self._nonzeros)
        random, shape = np.random.default_rng(SEED), (2, *self._at.q.shape)
        self._b, self._other = random.uniform(-1, 1, shape)

    @property
    def states(self) -> int:
        """The number of states."""
        return len(self._b)

    def errors(self) -> Array:
        """Return by how much the worst solution misses each equation, in its terms, (m,)."""
        found = [_missing(self._Phi_q, x, self._b) for x in self._solutions()]
        if self._code.lanes is not None:
            found.append(_missing(*self._of_complex_numbers()))
        return np.asarray(np.max(found, axis=0))

    def _solutions(self) -> Iterator[Array]:
        """Yield x (S, n) of each function that solves, of single states and of batches."""
        code, systems = self._code, list(zip(self._nonzeros, self._b, strict=True))
        solve = code.functions["solve"]
        yield np.array([solve(*system) for system in systems])
        yield solve(self._nonzeros, self._b)
        if code.lanes is not None:
            yield np.array(
                [self._by_floats(*state) for state in zip(self._at.each(), self._b, strict=True)]
            )
        if code.blocks:  # unchecked: what the blocks miss is otherwise mended by SuperLU
            solver = BlockSolver(code)
            yield np.array([solver.solve(solver.factor(J), b) for J, b in systems])

    def _by_floats(self, state: tuple[Array, Array, float, Array], b: Array) -> Any:
        """Return x (n,) by the lanes of one state; NaN where floats refuse a division by zero."""
        (q, _, t, p), lanes = state, self._code.lanes
        assert lanes is not None
        engine = Planned(self._code, p.tolist(), lanes.floats)
        try:
            return engine.solve(engine.evaluate(q.tolist(), t), b.tolist())
        except ArithmeticError:
            return np.full(q.size, np.nan)

    def _of_complex_numbers(self) -> tuple[Array, Array, Array]:
        """Return Phi_q, x and b of complex numbers: of complex coordinates, in a batch.

        Where a function takes real ones only, Phi_q is between that of each state and of another.
        """
        engine = Planned(self._code, self._at.p.T)
        try:
            q = self._at.q * (1 + ASIDE * 1j * self._other)
            nonzeros = self._code.nonzeros(q, self._at.t, self._at.p)
            point = engine.evaluate(q.T, self._at.t)
        except TypeError:
            nonzeros = _between(self._nonzeros)
            point = engine.evaluate(self._at.q.T, self._at.t)
            point.Phi_q = _between(stacked(point.Phi_q, self.states).T).T
        b = self._b + 1j * self._other
        x = engine.solve(point, b.T)
        return dense(self._code, nonzeros), np.array(np.broadcast_arrays(*x)).T, b

    @property
    def has_blocks(self) -> bool:
        """Whether the determinants of blocks are known."""
        return self._code.lanes is not None or bool(self._code.blocks)

    def error_of_determinants(self) -> float:
        """Return by what part the product of the determinants changes relative to det Phi_q."""
        signs, sizes = np.linalg.slogdet(self._Phi_q)
        if self._code.lanes is not None:
            engine = Planned(self._code, self._at.p.T)
            found = engine.determinants(engine.evaluate(self._at.q.T, self._at.t)).T
        else:
            solver = BlockSolver(self._code)
            found = np.array([solver.determinants(solver.factor(J)) for J in self._nonzeros])
        signs = signs * np.prod(np.sign(found), axis=1)
        sizes = np.sum(np.log(np.abs(found)), axis=1) - sizes
        change = signs * signs[0] * np.exp(sizes - sizes[0]) - 1
        return float(np.nan_to_num(np.max(np.abs(change)), nan=np.inf))


def _regular(samples: Samples) -> NDArray[np.bool_]:
    """Return at which states Phi_q, in sizes of its rows and columns, can be inverted."""
    given = zip(samples.each(), samples.terms, strict=True)
    return np.array(
        [
            _sensitivity(samples.code.Phi_q(q, t, p) * samples.reference / terms[:, np.newaxis])
            < SINGULAR_SENSITIVITY
            for (q, _, t, p), terms in given
        ]
    )


def _sensitivity(matrix: Array) -> float:
    try:
        return float(np.linalg.norm(np.linalg.inv(matrix), 1))
    except np.linalg.LinAlgError:
        return np.inf


def _between(values: Array) -> Array:
    """Return complex numbers between those of each state (S, ...) and of the state before."""
    return np.asarray(values + 1j * (np.roll(values, 1, axis=0) - values))


def _missing(Phi_q: Array, x: Array, b: Array) -> Array:
    """Return the largest error of each equation over states; infinite where x is not finite."""
    terms = np.einsum("sij,sj->si", np.abs(Phi_q), np.abs(x)) + np.abs(b)
    size = terms + OF_LARGEST * np.max(terms, axis=1, keepdims=True)
    error = np.abs(np.einsum("sij,sj->si", Phi_q, x) - b) / size
    return np.asarray(np.max(np.nan_to_num(error, nan=np.inf), axis=0))
