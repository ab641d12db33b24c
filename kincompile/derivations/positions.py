"""Where the numbers of a derivation are taken, and from where Newton's method is shown."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import probe_of
from kincompile.errors import KincompileError
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.newton import NewtonResult, newton
from kincompile.runtime.problem import problem
from kincompile.runtime.solve import solve
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

GENERIC_PART = 0.382
"""Part of a model's time at which nothing is special, so that a wrong sign shows in the numbers."""

STEPS = 20
"""Steps in which the motion is followed to that time."""

FEWEST = 3
"""Corrections that a table of Newton's method must have to show anything."""

DISTURBANCES = (0.15, 0.08, 0.04, 0.02)
"""How far a position is moved for such a table, in radians and sizes of the mechanism."""

SAME = 1e-8
"""Difference, relative to the scales, up to which two positions are one."""


def generic_time(end: float) -> float:
    """Return a time between 0 and the end of a model's motion, in three digits."""
    return float(f"{GENERIC_PART * end:.3g}")


def followed(module: ModuleType, t: float, p: Array) -> Array | None:
    """Return the position at a time as the motion from the time 0 reaches it; None if it fails."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            solution = solve(module, np.linspace(0.0, t, STEPS + 1), p)
        except KincompileError:
            return None
    return solution.q[-1] if solution.success else None


def newton_table(
    module: ModuleType, t: float, guess: Array, q: Array, p: Array
) -> tuple[NewtonResult, str]:
    """Return the iterates to a position that is known, and in words from where they come.

    The guess of the model is the start, unless it leads elsewhere or is so near that there is
    nothing to see: then the position, moved.
    """
    scales = _scales(module, q, t)
    result = newton(module, t, guess, p)
    if _leads(result, q, scales) and result.iterations >= FEWEST:
        return result, "From the guess"
    for part in DISTURBANCES:
        disturbed = newton(module, t, q + part * scales * probe_of(q.size), p)
        if _leads(disturbed, q, scales):
            words = f"From the assembled position with coordinates moved by some {part:g} of their"
            return disturbed, f"{words} scale (1 rad, or the size of the mechanism)"
    return result, "From the guess"


def _leads(result: NewtonResult, q: Array, scales: Array) -> bool:
    near = np.abs(result.q - q) <= SAME * scales
    return result.status is Status.CONVERGED and bool(near.all())


def _scales(module: ModuleType, q: Array, t: float) -> Array:
    with np.errstate(all="ignore"):
        return problem(code_of(module), module.DEFAULTS, q, t).reference
