r"""A coarse march: a few points of the time grid, as far apart as the prediction is good.

The same steps as `march.advance`, on plain floats and with the planned solve, so that one costs as
much as a few calls of NumPy. It takes no decision of its own: where anything is out of the ordinary
it stops, and the careful march goes on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.criteria import KINK_UNSEEN, MAX_CORRECTIONS, ROUNDING, SMOOTH_UNSEEN

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from kincompile.runtime.engine.lanes import LaneCode, Lanes

TARGET_ERROR = 0.0006
"""Error of the prediction aimed at, in radians or sizes of the mechanism. It falls with the third
power of the step, the interpolation's with the sixth: this one leaves the fine points about 1e-6
from their place."""

LARGEST_ERROR = 0.0015
"""Error of the prediction above which a coarse step is not trusted."""

SMALLEST_STEP_COUNT = 8
"""No step is longer than this part of the grid."""


@dataclass(frozen=True, slots=True)
class Node:
    """A point of the coarse march.

    Attributes
    ----------
    index
        Number of the point in the time grid.
    q, q_dot, q_ddot
        Position, velocity and acceleration, as floats.
    determinants
        Those of the blocks.
    """

    index: int
    q: Lanes
    q_dot: Lanes
    q_ddot: Lanes
    determinants: Lanes


def coarse_march(
    code: LaneCode,
    first: Node,
    times: NDArray[np.float64],
    spread: Sequence[float],
    tolerance: float,
) -> list[Node]:
    """Follow the motion over a time grid in as few steps as the prediction allows.

    Parameters
    ----------
    code
        The module on floats.
    first
        A good point of the motion.
    times
        The whole grid.
    spread
        The distance that is large for each coordinate.
    tolerance
        Bound of the last correction, in `spread`.

    Returns
    -------
    list of Node
        From `first` to the last point of the grid, or to the last one that could be trusted.
    """
    nodes, last = [first], len(times) - 1
    longest = max(1, last // SMALLEST_STEP_COUNT)
    stride = max(1, min(longest, last // 64))
    while nodes[-1].index < last:
        node = nodes[-1]
        index = min(node.index + stride, last)
        try:
            step = _step(code, node, index, times, spread, tolerance)
        except (ArithmeticError, ValueError):
            step = None
        error = LARGEST_ERROR * 8 if step is None else step[1]
        if step is not None and error <= LARGEST_ERROR:
            nodes.append(step[0])
        elif stride == 1:
            break
        ratio = (TARGET_ERROR / max(error, 1e-12)) ** (1 / 3)
        stride = max(1, min(longest, int((index - node.index) * min(2.0, max(0.25, ratio)))))
    return nodes


def _step(
    code: LaneCode,
    node: Node,
    index: int,
    times: NDArray[np.float64],
    spread: Sequence[float],
    tolerance: float,
) -> tuple[Node, float] | None:
    """Return the point at `index` and the error of its prediction; None without convergence."""
    t = float(times[index])
    h = t - float(times[node.index])
    predicted = [
        x + h * (v + 0.5 * h * a) for x, v, a in zip(node.q, node.q_dot, node.q_ddot, strict=True)
    ]
    q = predicted
    limits = [tolerance * s + ROUNDING * abs(x) for x, s in zip(q, spread, strict=True)]
    for _ in range(MAX_CORRECTIONS):
        at = code.position(q, t)
        correction = code.solve(at, at.Phi)
        q = [x - d for x, d in zip(q, correction, strict=True)]
        if all([abs(d) <= limit for d, limit in zip(correction, limits, strict=True)]):  # noqa: C419 - faster
            break
    else:
        return None
    q_dot, q_ddot = code.rates(at, q, t)
    if not math.isfinite(sum(q_ddot)):
        return None
    if any(x * y <= 0 for x, y in zip(at.determinants, node.determinants, strict=True)):
        return None
    error = max([abs(x - y) / s for x, y, s in zip(q, predicted, spread, strict=True)])
    rates = zip(q_dot, node.q_dot, node.q_ddot, spread, strict=True)
    kink = abs(h) * max([abs(w - v - h * a) / s for w, v, a, s in rates])
    if kink > KINK_UNSEEN * (error + SMOOTH_UNSEEN):
        return None
    return Node(index, q, q_dot, q_ddot, at.determinants), error
