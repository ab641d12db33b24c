"""The times at which a motion has given values: a grid in crank angle instead of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import ROOT_LENGTH
from kincompile.errors import InputError
from kincompile.names import rate
from kincompile.runtime.inputs import real_numbers
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import ArrayLike, NDArray

    from kincompile.runtime.inputs import Values
    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]

ITERATIONS = 60
"""After which halving alone has found a time to its last digit."""


def times_at(
    module: ModuleType,
    name: str,
    values: ArrayLike,
    t: ArrayLike,
    p: Values = None,
    guess: Values = None,
) -> Array:
    """Return the times at which a coordinate, or an output, has given values.

    Parameters
    ----------
    module
        An emitted module.
    name
        The column, such as ``"crank.phi"``.
    values : array_like, shape (N,)
        What it is to be, rising or falling; angles in radians.
    t : array_like, shape (M,)
        Times between which to look, two at least. The column rises there all the way, or falls.
    p, guess
        As for `solve`.

    Returns
    -------
    ndarray, shape (N,)
        A time for each value, found by Newton's method within brackets.

    Raises
    ------
    InputError
        When there is no such column, it is not monotonic, or does not reach a value.
    """
    problems: list[str] = []
    given = real_numbers("the list of values", values, problems)
    if given is None or given.ndim > 1 or not given.size:
        shape = f"the values are {values!r}: give one, or a list of them."
        raise InputError(problems or shape)
    wanted = np.atleast_1d(given)
    known = solve(module, t, p, guess)
    times, column = _one_way(known, name, wanted)
    forward = np.sign(column[-1] - column[0])
    place = np.clip(np.searchsorted(forward * column, forward * wanted), 1, column.size - 1)
    low, high = times[place - 1], times[place]
    found = np.interp(forward * wanted, forward * column, times)
    q = known.q[known.good][place - 1]
    for _ in range(ITERATIONS):  # as `curve.zero`, in arrays: there may be thousands of values
        order = np.argsort(found, kind="stable")
        motion = solve(module, found[order], p, q[order[0]], throw=True)
        error, slope = np.empty((2, wanted.size))
        error[order] = motion[name] - wanted[order]
        slope[order] = motion[rate(motion.column(name).name)]
        done = np.abs(error) <= ROOT_LENGTH * np.abs(column).max()
        if done.all():
            break
        is_late = forward * error > 0
        low, high = np.where(is_late, low, found), np.where(is_late, found, high)
        with np.errstate(all="ignore"):  # the column may be at rest at its ends
            step = found - error / slope
        inside = (step - low) * (step - high) < 0
        found = np.where(done, found, np.where(inside, step, (low + high) / 2))
    return np.asarray(found)


def _one_way(known: Solution, name: str, wanted: Array) -> tuple[Array, Array]:
    """Return the times and values of a column that rises, or falls, over all of them."""
    good = known.good
    times, column = known.t[good], known[name][good]
    steps = np.diff(column)
    if not (steps.size and ((steps > 0).all() or (steps < 0).all())):
        turn = times[:-1][np.sign(steps) != np.sign(steps[:1])]
        where = f"at about t = {turn[0]:.6g}" if turn.size else "at any time"
        raise InputError(
            f"{known.name}: {name} is not monotonic {where}, so it cannot be inverted for "
            "time. Look between two times where it goes one way."
        )
    low, high = sorted((column[0], column[-1]))
    rounding = ROOT_LENGTH * max(abs(low), abs(high))
    missed = wanted[(wanted < low - rounding) | (wanted > high + rounding)]
    if missed.size:
        why = "" if known.success else f" {known.message}"
        raise InputError(
            f"{known.name}: {name} goes from {column[0]:.6g} to {column[-1]:.6g} between t = "
            f"{times[0]:.6g} and {times[-1]:.6g}, and never is {missed[0]:.6g}.{why}"
        )
    return times, column
