"""Deviations of targets and what is left to limits, of many motions side by side, with derivatives.

A motion has N times of its own. Places say which of them a target asks for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.design.demands import Extremes, compared, deviation, sides, turning
from kincompile.runtime.results.observed import observed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from kincompile.design.columns import Column
    from kincompile.design.demands import Demands, Side
    from kincompile.runtime.engine.code import Compiled

    Array = NDArray[np.float64]
    Places = NDArray[np.intp]
    Row = tuple[Array, Array | None, Array | None]

SLACK = 1e-9
"""Part of all time that counts as none."""

EAGERNESS = 10.0
"""Factor of what limits are exceeded by, among the deviations."""


class Columns:
    """The columns of motions, (B, N), by name and order, evaluated once."""

    def __init__(self, code: Compiled, motion: tuple[Array, ...], t: Array, sets: Array) -> None:
        self._coordinates = code.coordinates
        self._motion = motion
        q, q_dot, q_ddot = motion
        self._outputs = observed(code, (q, q_dot, q_ddot), t, sets)

    @property
    def count(self) -> int:
        """The number of motions."""
        return len(self._motion[0])

    def column(self, name: str, order: int) -> Array:
        """Return a coordinate or an output, or a rate of it."""
        if name in self._coordinates:
            return self._motion[order][..., self._coordinates.index(name)]
        return self._outputs.column(name, order).values


@dataclass(slots=True, eq=False)
class Motions:
    """Columns of B motions at N times each, as the targets of a fit ask for them."""

    demands: Demands
    t: Array  # (B, N)
    grid: Places  # (G,): which times are those of the grid
    instants: list[Places]  # of each passing target (B, K)
    # A column, or a rate of it, by name and order, (B, N).
    column: Callable[[str, int], Array]
    # Its derivatives by k parameters, (B, N, k), where they are asked for.
    slope: Callable[[str, int], Array] | None = None
    is_fine: bool = True  # whether extremes are found between the times of the grid

    def rows(self) -> tuple[Array, Array | None]:
        """Return weighted deviations (B, R), and derivatives (B, R, nx)."""
        return self._joined(self._deviations())

    def gaps(self) -> tuple[Array, Array | None]:
        """Return what is left to limits, (B, G), negative beyond them, and derivatives."""
        return self._joined(self._left())

    def combined(self) -> tuple[Array, Array | None]:
        """Return deviations, then what limits are exceeded by, (B, R + G), and derivatives."""
        (rows, by), (gaps, gaps_by) = self.rows(), self.gaps()
        off = np.concatenate((rows, EAGERNESS * np.minimum(gaps, 0.0)), axis=1)
        if by is None or gaps_by is None:
            return off, None
        beyond = EAGERNESS * gaps_by * (gaps < 0)[..., np.newaxis]
        return off, np.concatenate((by, beyond), axis=1)

    def costs(self) -> Array:
        """Return the sum of squares of that, infinite where it is no number."""
        cost = (self.combined()[0] ** 2).sum(axis=1)
        return np.where(np.isfinite(cost), cost, np.inf)

    def _joined(self, parts: Iterator[Row]) -> tuple[Array, Array | None]:
        """Return parts side by side, by parameters and by variables that are times."""
        made, count = list(parts), len(self.demands.time_bounds())
        values = np.concatenate([*(part for part, _, _ in made), np.empty((len(self.t), 0))], 1)
        if self.slope is None:
            return values, None
        slopes = [np.empty((len(self.t), 0, self._width + count))]
        for value, by_p, by_t in made:
            shape = (*value.shape, count)
            own = np.zeros((*value.shape, self._width)) if by_p is None else by_p
            slopes.append(np.concatenate((own, np.zeros(shape) if by_t is None else by_t), axis=2))
        return values, np.concatenate(slopes, axis=1)

    @property
    def _width(self) -> int:
        assert self.slope is not None
        return int(self.slope(self.demands.columns[0], 0).shape[-1])

    def _at(self, column: Column, places: Places, more: int = 0) -> Array:
        """Return a column, or a further rate of it, at places."""
        return np.take_along_axis(self.column(column.of, column.order + more), places, axis=1)

    def _slope_at(self, column: Column, places: Places) -> Array | None:
        if self.slope is None:
            return None
        found = self.slope(column.of, column.order)
        return np.take_along_axis(found, places[..., np.newaxis], axis=1)

    def _deviations(self) -> Iterator[Row]:
        first, times = 0, len(self.demands.time_bounds())
        for (target, columns), places in zip(self.demands.passing, self.instants, strict=True):
            count, is_free = len(target.values), target.times is None
            for k, column in enumerate(columns):
                weight = float(target.weights[k])
                off = weight * deviation(target.values[:, k], column, self._at(column, places))
                by_p, by_t = self._slope_at(column, places), None
                if by_p is not None and is_free:
                    by_t = np.zeros((*off.shape, times))
                    rates = weight * self._at(column, places, 1)
                    by_t[..., first : first + count] = np.tril(
                        rates[..., np.newaxis].repeat(count, 2)
                    )
                yield off, None if by_p is None else weight * by_p, by_t
            first += count if is_free else 0
        for shape, columns in self.demands.shaped:
            places = np.searchsorted(self.demands.grid, shape.times)
            places = np.broadcast_to(self.grid[places], (len(self.t), places.size))
            values = np.stack([self._at(item, places) for item in columns], axis=2)
            slopes: list[Any] = [self._slope_at(item, places) for item in columns]
            every = None if self.slope is None else np.stack(slopes, axis=2)
            found = [
                compared(shape, own, None if every is None else every[b])
                for b, own in enumerate(values)
            ]
            offs, by_ps = (np.array(part) for part in zip(*found, strict=True))
            yield offs, None if self.slope is None else by_ps, None
        for ratio, column in self.demands.ratios:
            made = [self._ratio(b, ratio, column) for b in range(len(self.t))]
            off, by = (np.array(part) for part in zip(*made, strict=True))
            yield off, None if self.slope is None else by, None

    def _ratio(self, b: int, target: Any, column: Column) -> tuple[Array, Array]:
        """Return the deviation of a time ratio, (1,), and its derivatives."""
        grid = self.demands.grid
        y, rate, second = (self.column(column.of, order)[b, self.grid] for order in range(3))
        nothing = np.zeros((1, 0 if self.slope is None else self._width))
        ends = []
        for sign in (1.0, -1.0):
            zeros = turning(grid, rate, second, sign)
            if not zeros:
                return np.array([np.nan]), nothing
            ends.append(max(zeros, key=lambda item: sign * y[item.cell]))
        top, bottom = ends
        whole = grid[-1] - grid[0]
        rise = (top.t - bottom.t) % whole
        by_p = nothing
        if self.slope is not None:
            slopes = [self.slope(column.of, order)[b, self.grid] for order in (1, 2)]
            by_rise = whole / (whole - rise) ** 2
            for item, sign in ((top, 1.0), (bottom, -1.0)):
                cell = slice(item.cell, item.cell + 2)
                values = np.concatenate((slopes[0][cell], slopes[1][cell]))
                by_p = by_p + sign * by_rise * (item.weights @ values)
        off = rise / (whole - rise) - target.ratio
        return target.weight * np.array([off]), target.weight * by_p

    def _left(self) -> Iterator[Row]:
        times = len(self.demands.time_bounds())
        for item, column, is_constant in self.demands.limits:
            at = self.grid[:0] if is_constant else self.grid
            places = np.broadcast_to(at if at.size else 0, (len(self.t), max(at.size, 1)))
            for side in sides(item):
                yield (
                    *(self._finely if self.is_fine else self._coarsely)(side, column, places),
                    None,
                )
        first = 0
        for (begin, end), (target, _) in zip(self.demands.free, self.demands.untimed, strict=True):
            count = len(target.values)
            number = next(k for k, (own, _) in enumerate(self.demands.passing) if own is target)
            last = np.take_along_axis(self.t, self.instants[number][:, -1:], axis=1)
            by_t = np.zeros((len(self.t), 1, times))
            by_t[..., first : first + count] = -1 / (end - begin)
            first += count
            yield (end - last) / (end - begin) + SLACK, None, by_t

    def _coarsely(self, side: Side, column: Column, places: Places) -> tuple[Array, Array | None]:
        by_p = self._slope_at(column, places)
        return side.left(self._at(column, places)), None if by_p is None else side.factor * by_p

    def _finely(self, side: Side, column: Column, places: Places) -> tuple[Array, Array | None]:
        """Return what is left between the times too, of each motion."""
        gaps, by_ps, orders = [], [], range(column.order, 3)
        for b, at in enumerate(places):
            values = np.array([self.column(column.of, order)[b, at] for order in orders])
            extremes = Extremes(self.t[b, at], values, side.sign)
            gaps.append(side.left(extremes.of(values)))
            if self.slope is not None:
                slopes = np.array([self.slope(column.of, order)[b, at] for order in orders])
                by_ps.append(side.factor * extremes.of(slopes))
        return np.array(gaps), np.array(by_ps) if self.slope is not None else None
