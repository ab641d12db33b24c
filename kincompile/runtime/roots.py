"""A zero of a function of one number, between two places at which its signs differ.

Newton's method where slopes are known, secants where they are not. A step that leaves the bracket,
or is not half as long as the one before the last, is a bisection instead.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

from kincompile.criteria import ROOT_STEPS

if TYPE_CHECKING:
    from collections.abc import Callable, Generator


def zero(low: float, high: float, width: float) -> Generator[float, tuple[float, float], None]:
    """Yield places, the last of them a zero to a width, or one where rounding errors hide it.

    The value of the function there is sent, NaN if there is none, and its slope, NaN if not known.
    """
    at_low, _ = yield low
    if at_low == 0 or not math.isfinite(at_low):
        return
    (before, value_before), (earlier, last) = (low, at_low), (math.inf, math.inf)
    t = (low + high) / 2
    for _ in range(ROOT_STEPS):
        value, slope = yield t
        if value == 0 or not math.isfinite(value):
            return
        is_known = math.isfinite(slope)
        if not is_known:
            slope = (value - value_before) / (t - before)
        low, high = (t, high) if (value > 0) == (at_low > 0) else (low, t)
        step = -value / slope if slope else math.inf
        if abs(step) <= width:
            if is_known:
                return
            step = math.copysign(width / 2, step)  # just beyond the zero, if the secant is right
        elif 2 * abs(step) > earlier:
            step = math.inf
        following = t + step
        if (following - low) * (following - high) > 0:
            following = (low + high) / 2
        if following == t or abs(high - low) <= width:
            return
        (before, value_before), (earlier, last) = (t, value), (last, abs(following - t))
        t = following


def root(function: Callable[[float], float], low: float, high: float, width: float) -> float:
    """Return a zero of a function whose slope is not known."""
    search = zero(low, high, width)
    t = next(search)
    with suppress(StopIteration):
        while True:
            t = search.send((function(t), math.nan))
    return t
