r"""The branch of a motion: the signs of the determinants of the structural blocks of Phi_q.

Two assembled positions of a mechanism that differ in a sign cannot be reached from each other
without passing a singular configuration. The planned solve of a module, in one piece or in blocks,
has the determinants at hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.runtime.engine.dense import Dense
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.engine.sparse import Sparse

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled

    Signs = NDArray[np.int8]

BLOCK = 2048
"""Points at a time, so that intermediate arrays stay in the cache."""


def signatures(code: Compiled, q: Array, t: Array, p: Sequence[float]) -> Signs:
    """Return the signature of each point of a motion, shape (N, blocks), for q (N, n) at t (N,).

    It is 0 where q is NaN.
    """
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    with np.errstate(all="ignore"):
        parts = list(_signs(code, q[known], t[known], np.asarray(p, dtype=np.float64)))
    found = np.nan_to_num(np.concatenate(parts)) if parts else np.zeros((0, 1))
    result = np.zeros((t.size, found.shape[1]), dtype=np.int8)
    result[known] = found
    return result


def _signs(code: Compiled, q: Array, t: Array, p: Array) -> Iterator[Array]:
    """Yield the signs of known positions, some at a time."""
    if code.lanes is None:
        engine = Sparse(code, p) if code.blocks else Dense(code, p)
        for position, time in zip(q, t.tolist(), strict=True):
            yield np.array([engine.signs(engine.evaluate(np.ascontiguousarray(position), time))])
        return
    planned = Planned(code, p)
    for start in range(0, t.size, BLOCK):
        lanes = np.ascontiguousarray(q[start : start + BLOCK].T)
        point = planned.evaluate(lanes, t[start : start + BLOCK])
        yield np.sign(planned.determinants(point, point)).T


def counted_signatures(q: Array, t: Array, passed: Sequence[float]) -> Signs:
    """Return the signature of a motion with redundant equations, shape (N, 1); 0 where q is NaN.

    They have no determinant; the sign is that of the start, and changes with every bifurcation that
    was passed, at these times.
    """
    way = np.abs(t - t[0])
    count = sum(((way > abs(time - t[0])).astype(int) for time in passed), np.zeros(t.size, int))
    signs = np.where(np.isfinite(q).all(axis=1), 1 - 2 * (count % 2), 0)
    return signs.astype(np.int8)[:, np.newaxis]
