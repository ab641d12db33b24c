"""Outputs over a motion, evaluated where it was found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.runtime.results.columns import Observed

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def observed(module: ModuleType, motion: tuple[Array, Array, Array], t: Array, p: Any) -> Observed:
    """Evaluate the outputs of a module over a motion (..., N, n) with parameters p (..., k)."""
    names = getattr(module, "OUTPUTS", ())
    shape = (*motion[0].shape[:-1], len(names))
    results = np.full((3, *shape), np.nan)
    if names:
        found = np.isfinite(sum(part.sum(axis=-1) for part in motion))
        times = np.broadcast_to(t, found.shape)[found]
        sets = np.asarray(p, dtype=np.float64)
        if sets.ndim > 1:
            sets = np.broadcast_to(sets[:, np.newaxis], (*found.shape, sets.shape[-1]))[found]
        if times.size:
            results[:, found] = module.observe(*(part[found] for part in motion), times, sets)
    return Observed(names, {name: module.UNITS[name] for name in names}, *results)
