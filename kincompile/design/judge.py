"""What the ends of a search are worth: those whose motions are whole, and why others are not.

The points of an end were found one by one. A design has a defect of order where its points do not
come within one cycle, of circuit where the motion stops between two of them, and of branch where it
arrives at another position than the one that was found (Mallik, Ghosh, Dittrich 1994).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import TINY
from kincompile.design.trial import EXCESS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.design.explore import Explored
    from kincompile.design.trial import Trial, Workbench

    Array = NDArray[np.float64]

DESIGNS = 8
"""Designs that are judged, each unlike the others."""

MOST_TRIED = 100
"""Ends that are looked at for them."""

APART = 0.01
"""Part of the bounds within which two designs are one."""

AWAY = 1e-3
"""Part of the size of a coordinate by which a motion may differ from what was found."""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Motions of designs, the best first, and how many were dropped for which defect."""

    ends: list[Trial]
    dropped: dict[str, int]


def judge(bench: Workbench, explored: Explored, bounds: Array) -> Judged:
    """Return the best ends, or else the best starts, whose motions are whole."""
    found: list[Trial] = []
    count = len(bench.names)
    dropped = dict.fromkeys(("order", "circuit", "branch"), 0)
    for number, own in enumerate((explored.ends, explored.starts)):
        tried: list[Array] = []
        for x, q in zip(own.x, own.q, strict=True):
            if len(found) == DESIGNS or len(tried) == MOST_TRIED or (number and found):
                break
            x = np.clip(x, *bounds.T)
            x[count:] = bench.demands.within(x[count:])
            if any(_is_one(x, other, bounds) for other in tried):
                continue
            tried.append(x)
            t = np.concatenate([bench.demands.grid, *bench.demands.instants(x[count:])])
            trial = bench.solved(x, q[t.argmin()])
            if defect := _defect(bench, trial, t, q, is_start=number == 1):
                dropped[defect] += 1
            elif trial is not None:
                found.append(trial)
    return Judged(sorted(found, key=lambda trial: trial.cost), dropped)


def _defect(bench: Workbench, trial: Trial | None, t: Array, q: Array, *, is_start: bool) -> str:
    """Return why a design is dropped; "" where it is not."""
    if trial is None:
        return "circuit"
    count = len(bench.demands.free)
    if count and (trial.gaps[-count:] < -EXCESS).any():
        return "order"
    got = trial.motion.q[np.searchsorted(trial.motion.t, t)]
    off = np.abs(got - q).max(axis=0) / (np.abs(q).max(axis=0) + np.ptp(q, axis=0).max() + TINY)
    return "branch" if not is_start and off.max() > AWAY else ""


def _is_one(x: Array, other: Array, bounds: Array) -> bool:
    return bool(np.max(np.abs(x - other) / np.ptp(bounds, axis=1)) < APART)


def distinct(trials: Sequence[Trial], bounds: Array, count: int) -> list[Trial]:
    """Return trials without those that differ from a better one in their times alone."""
    found: list[Trial] = []
    for trial in trials:
        if not any(_is_one(trial.x[:count], x.x[:count], bounds[:count]) for x in found):
            found.append(trial)
    return found
