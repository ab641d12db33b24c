"""Outputs over a motion, and the outputs of other code at its points, where it was found."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import probe_of
from kincompile.runtime.engine.linear import trusted
from kincompile.runtime.memory import empty
from kincompile.runtime.results.columns import Observed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.results.columns import MotionTable

BLOCK = 500
"""Points whose matrices are taken at a time, so that they fit into memory."""


def observed(code: Compiled, motion: tuple[Array, Array, Array], t: Array, p: Any) -> Observed:
    """Evaluate the outputs of a mechanism over a motion (..., N, n) with parameters p (..., k)."""
    names = code.outputs
    units = {name: code.units[name] for name in names}
    sets = np.asarray(p, dtype=np.float64)
    if sets.ndim > 1:
        sets = sets[:, np.newaxis]
    # Where second rates were found, so were position and velocity; nearly always that is all.
    if names and math.isfinite(float(motion[2].sum())):
        y, y_dot, y_ddot = _everywhere(code, motion, t, sets)
        return Observed(names, units, y, y_dot, y_ddot)
    results = np.full((3, *motion[0].shape[:-1], len(names)), np.nan)
    if names:
        if sets.ndim > 1:
            sets = np.broadcast_to(sets, (*motion[0].shape[:-1], sets.shape[-1]))

        def observe(at: NDArray[np.bool_], q_ddot: Array) -> NDArray[Any]:
            times, own = np.broadcast_to(t, at.shape)[at], sets[at] if sets.ndim > 1 else sets
            return np.array(code.observe(motion[0][at], motion[1][at], q_ddot, times, own))

        position, complete = (
            np.isfinite(sum(part.sum(axis=-1) for part in parts)) for parts in (motion[:2], motion)
        )
        if complete.any():
            results[:, complete] = observe(complete, motion[2][complete])
        corner = position & ~complete
        if corner.any():
            # Without an acceleration an output has what no acceleration changes.
            probe = np.broadcast_to(probe_of(motion[0].shape[-1]), motion[0][corner].shape)
            some, other = observe(corner, probe), observe(corner, probe**2)
            results[:, corner] = np.where(some == other, some, np.nan)
    return Observed(names, units, *results)


def _everywhere(code: Compiled, motion: Sequence[Array], t: Array, p: Array) -> Sequence[Array]:
    """Return the outputs, their rates and second rates of a motion that was found throughout."""
    observe = code.observe_into
    if observe is None or motion[0].ndim != 2 or p.ndim != 1:
        found: Sequence[Array] = code.observe(*motion, t, p)
        return found
    seen = empty((3, len(code.outputs), t.size))
    with np.errstate(all="ignore"):
        observe([part.T for part in motion], t, p, seen)
    return [part.T for part in seen]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """L points of a motion, of all variants one after the other."""

    p: Array  # (k,), or (k, L)
    t: Array  # (L,)
    # (n, L) each
    q: Array
    q_dot: Array
    q_ddot: Array

    @classmethod
    def of(cls, solution: MotionTable) -> Points:
        """Return the points of a motion."""
        *shape, n = solution.q.shape
        p = solution.p if len(shape) == 1 else np.repeat(solution.p, shape[-1], axis=0)
        states = (part.reshape(-1, n).T for part in (solution.q, solution.q_dot, solution.q_ddot))
        return cls(p.T, np.broadcast_to(solution.t, shape).ravel(), *states)

    def at(self, some: NDArray[Any]) -> Points:
        """Return some of the points."""
        p = self.p if self.p.ndim == 1 else self.p[:, some]
        states = (state[:, some] for state in (self.q, self.q_dot, self.q_ddot))
        return Points(p, self.t[some], *states)

    def parts(self, wanted: NDArray[np.bool_]) -> Iterator[tuple[NDArray[np.intp], Points]]:
        """Yield some of the points that are wanted after the others, with their numbers."""
        numbers = np.flatnonzero(wanted)
        for start in range(0, numbers.size, BLOCK):
            own = numbers[start : start + BLOCK]
            yield own, self.at(own)

    def observe(self, code: Compiled, p: Array, orders: int = 1) -> Array:
        """Return outputs of some code and their rates below an order, (orders, r, L)."""
        found = empty((orders, len(code.outputs), self.t.size))
        assert code.observe_into is not None
        with np.errstate(all="ignore"):
            code.observe_into((self.q, self.q_dot, self.q_ddot), self.t, p, found)
        return found

    def solved(self, code: Compiled, count: int, orders: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return the last outputs of some code, and where its planned solve can be trusted.

        By what part of their terms equations are missed, and determinants, come before them.
        """
        found = self.observe(code, self.p, orders)
        first = len(code.outputs) - count
        return found[:, first:], trusted(found[0, 0], found[0, 1:first])
