"""Outputs over a motion, evaluated where it was found."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import probe_of
from kincompile.runtime.memory import empty
from kincompile.runtime.results.columns import Observed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled


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
