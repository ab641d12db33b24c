"""What a sweep found, in one pass over its chunks: extremes, means, bands over time, samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kincompile.runtime.results.columns import shown_unit
from kincompile.sweeps.layout import STATUS
from kincompile.tables import table, without_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.sweeps.layout import Kept
    from kincompile.sweeps.result import Sweep

MOST_SHOWN = 2000
"""Approximate number of dots; larger sweeps are subsampled."""

HEADER = ("kept", "unit", "least", "at", "greatest", "where", "mean")


class End(NamedTuple):
    """An extreme: its value, and the swept parameters and the time at which it was found."""

    value: float
    place: tuple[float, ...]


class Found:
    """What is known of a column or a measure after some chunks."""

    def __init__(self, kept: Kept, times: int) -> None:
        self.kept = kept
        # The extremes at each time, and those of all; of a measure there is one time.
        self.low, self.high = np.full(times, np.inf), np.full(times, -np.inf)
        self.least, self.greatest = End(math.inf, ()), End(-math.inf, ())
        self._sum, self._count = np.zeros(times), np.zeros(times, dtype=np.int64)

    def add(self, values: Array, swept: Array, t: Array) -> None:
        """Add the values of a chunk, shape (B, N), whose swept parameters are (B, k)."""
        is_there = np.isfinite(values)
        self._count += is_there.sum(axis=0)
        self._sum += values.sum(axis=0, where=is_there)
        low, high = np.where(is_there, values, np.inf), np.where(is_there, values, -np.inf)
        self.low = np.minimum(self.low, low.min(axis=0))
        self.high = np.maximum(self.high, high.max(axis=0))

        def end(of: Array, flat: np.intp) -> End:
            variant, time = np.unravel_index(flat, of.shape)
            times = () if self.kept.measure else (float(t[time]),)
            return End(float(of[variant, time]), (*swept[variant].tolist(), *times))

        self.least = min(self.least, end(low, low.argmin()), key=lambda x: x.value)
        self.greatest = max(self.greatest, end(high, high.argmax()), key=lambda x: x.value)

    @property
    def means(self) -> Array:
        """The mean at each time; NaN where nothing was found."""
        return np.where(self._count > 0, self._sum, np.nan) / np.maximum(self._count, 1)

    @property
    def mean(self) -> float:
        """The mean of all; NaN where nothing was found."""
        count = int(self._count.sum())
        return float(self._sum.sum()) / count if count else math.nan


@dataclass(frozen=True, slots=True, eq=False)
class Overview:
    """What a sweep found."""

    sweep: Sweep
    found: tuple[Found, ...]  # of each column and measure extremes, mean and band
    samples: Array  # (S, k): the swept parameters of some variants
    measured: dict[str, Array]  # of those, the measures by name, shape (S,)
    is_good: NDArray[np.bool_]  # (S,), bool: which of them were found throughout

    def rows(self, angle_unit: str = "rad") -> list[list[str]]:
        """Return a row of text for each column and measure, as `HEADER` says."""
        return [self._row(item, angle_unit) for item in self.found]

    def table(self, angle_unit: str = "rad") -> str:
        """Return what was found as a table; angles in ``"rad"`` or ``"deg"``."""
        right = ("least", "greatest", "mean")
        return "\n".join(table(HEADER, self.rows(angle_unit), right=right))

    def _row(self, item: Found, angle_unit: str) -> list[str]:
        unit, factor = shown_unit(item.kept.unit, angle_unit)
        numbers = (item.least.value, item.greatest.value, item.mean)
        shown = factor * without_noise(numbers, max(map(abs, numbers[:2])))
        least, greatest, mean = (f"{x:.6g}" if math.isfinite(x) else "-" for x in shown)
        at, where = self._place(item.least, angle_unit), self._place(item.greatest, angle_unit)
        return [item.kept.name, unit, least, at, greatest, where, mean]

    def _place(self, end: End, angle_unit: str) -> str:
        """Return the parameters at which an extreme was found, and the time, as text."""
        contents = self.sweep.contents
        units = [contents.units[name] for name in contents.plan.sweep]
        factors = [shown_unit(unit, angle_unit)[1] for unit in units] + [1.0]
        named = zip([*contents.plan.sweep, "t"], factors, end.place, strict=False)
        words = [f"{name} = {factor * value:.4g}" for name, factor, value in named]
        return ", ".join(words) if math.isfinite(end.value) else "-"


def overview(sweep: Sweep) -> Overview:
    """Go once through the chunks of a sweep that are done."""
    contents, plan = sweep.contents, sweep.contents.plan
    found = [Found(x, 1 if x.measure else contents.t.size) for x in contents.layout.kept]
    samples, is_good = [np.empty((0, len(plan.sweep)))], [np.empty(0, dtype=bool)]
    measured = {x.name: [np.empty(0)] for x in contents.layout.kept if x.measure}
    for number in np.flatnonzero(sweep.store.done()).tolist():
        swept = np.column_stack(plan.swept(number))
        some = _scattered(plan.grid.first(number), len(swept), MOST_SHOWN / plan.grid.variants)
        samples.append(swept[some])
        status = sweep.store.read(number, STATUS).reshape(len(swept), -1)
        is_good.append((status[some] == 0).all(axis=1))
        for item in found:
            values = sweep.store.read(number, item.kept.name).reshape(len(swept), -1)
            item.add(values, swept, contents.t)
            if item.kept.measure:
                measured[item.kept.name].append(values[some, 0])
    return Overview(
        sweep,
        tuple(found),
        np.concatenate(samples),
        {name: np.concatenate(parts) for name, parts in measured.items()},
        np.concatenate(is_good),
    )


def _scattered(first: int, count: int, part: float) -> NDArray[np.bool_]:
    """Say which of `count` variants in a row are shown, about a part of all.

    A regular choice would alias with a grid, and with the sequence of samples.
    """
    numbers = np.arange(first, first + count, dtype=np.uint64)
    mixed = (numbers * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)
    return np.asarray(mixed <= min(part, 1.0) * 2.0**32)
