"""Corners of drivers: times at which a velocity jumps, so that there is no acceleration.

A module whose model allows them says so (`CORNERS`). A corner is where nu jumps from one side of a
time to the other; so it is found whatever parameters it depends on.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import CORNER, SAME_TIME
from kincompile.errors import CornerWarning
from kincompile.names import listed
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.results.solution import Solution

    Mask = NDArray[np.bool_]

NAMED_TIMES = 6
"""How many corners a message names."""

ENTRIES = 1_000_000
"""Entries of nu that are evaluated at a time."""


def corners_of(inputs: Inputs) -> Mask | None:
    """Return at which times a driver has a corner, shape (N,), of B variants (B, N).

    None if no time has one, or the model allows no corners.
    """
    if not inputs.code.corners:
        return None
    if inputs.sets is None:
        found = _corners(inputs, inputs.p)
    else:
        found = np.array([_corners(inputs, p) for p in inputs.sets])
    return found if found.any() else None


def after_corners(inputs: Inputs, corners: Mask | None) -> Inputs:
    """Return the inputs with times just after the corners: there the velocity has one value."""
    if corners is None:
        return inputs
    everywhere = corners.reshape(-1, inputs.t.size).all(axis=0)
    return replace(inputs, t=np.where(everywhere, inputs.t + _reach(inputs.t), inputs.t))


def with_corners(solution: Solution, t: Array, corners: Mask) -> Solution:
    """Return a solution without acceleration at its corners, at the times that were asked for."""
    marked = corners & (solution.status == Status.CONVERGED)
    status, q_ddot = solution.status.copy(), solution.q_ddot.copy()
    status[marked], q_ddot[marked] = Status.CORNER, np.nan
    times = listed(
        (f"{time:.10g}" for time in t[marked.reshape(-1, t.size).any(axis=0)]), NAMED_TIMES
    )
    text = f"{solution.name}: a driver has a corner at t = {times}"
    warnings.warn(f"{text}: the velocity jumps, and there is no acceleration.", CornerWarning, 4)
    note = f" At t = {times} a driver has a corner, and there is no acceleration."
    return replace(solution, t=t, status=status, q_ddot=q_ddot, message=solution.message + note)


def _corners(inputs: Inputs, p: Array) -> Mask:
    """Return where nu jumps, with one parameter set."""
    code, t, q = inputs.code, inputs.t, inputs.guess
    largest = np.zeros(len(code.equations))
    jumps, reach = [], _reach(t)
    size = max(1, ENTRIES // largest.size)
    with np.errstate(all="ignore"):  # the guess may lie where an equation has no value
        for first in range(0, t.size, size):
            times = t[first : first + size]
            before, after = (code.nu(q, times + side * reach, p) for side in (-1, 1))
            largest = np.fmax(largest, np.fmax.reduce(np.fmax(np.abs(before), np.abs(after))))
            jumps.append(np.abs(after - before))
    return np.asarray((np.concatenate(jumps) > CORNER * largest).any(axis=1))


def _reach(t: Array) -> float:
    """Return how far two times may be apart that differ by rounding alone."""
    return SAME_TIME * float(np.abs(t).max())
