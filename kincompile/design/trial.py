"""One trial of a fit: the motion at some variables, its deviations, and their derivatives.

The motion goes through all times of the targets without a break, so that no branch is left between
them. From one trial to the next the branch is that of the first, by the signs of determinants;
redundant equations have none, and Newton's method starts near the position before.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.design.demands import (
    ORDERS,
    Extremes,
    compared,
    deviation,
    orders_of,
    sides,
    turning,
)
from kincompile.errors import KincompileWarning
from kincompile.runtime.follow import follow
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.results.sensitivities import sensitivities
from kincompile.runtime.solve import solution_of
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.design.columns import Column
    from kincompile.design.demands import Demands
    from kincompile.runtime.results.sensitivities import Sensitivities
    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]

EAGERNESS = 10.0
"""Factor of what limits are exceeded by, among the deviations."""

SLACK = 1e-9
"""Part of all time that counts as none."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A motion that was tried."""

    x: Array  # (nx,): the variables
    motion: Solution  # through all times that are asked for
    residuals: Array  # (R,): weighted deviations of the targets
    gaps: Array  # (G,): what is left to the limits, negative where they are exceeded

    @property
    def error(self) -> float:
        """The sum of squares of the weighted deviations."""
        return float(self.residuals @ self.residuals)

    @property
    def excess(self) -> float:
        """The most by which a limit is exceeded."""
        return float(np.max(-self.gaps, initial=0.0))


@dataclass(slots=True, eq=False)
class Workbench:
    """Evaluates trials of one mechanism."""

    # module, demands: the mechanism, and what is asked of it
    module: ModuleType
    demands: Demands
    names: tuple[str, ...]  # the parameters that are varied
    fixed: dict[str, float]  # values of the others
    # motions, gradients: how many of each were evaluated
    motions: int = 0
    gradients: int = 0
    _found: Sensitivities | None = field(default=None, init=False)

    def solved(self, x: Array, guess: Array | None, branch: Any = None) -> Trial | None:
        """Return the trial of some variables (nx,); None where the mechanism does not get through.

        The guess (n,) is nearly its position at the first time. The determinants there must have
        the signs of the branch, if one is given.
        """
        p = self.fixed | dict(zip(self.names, x.tolist(), strict=False))
        instants = self.demands.instants(x[len(self.names) :])
        times = np.unique(np.concatenate([self.demands.grid, *instants, np.empty(0)]))
        self.motions += 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", KincompileWarning)
            inputs = read_inputs(self.module, times, p, guess, TOLERANCE, MAX_ITERATIONS)
            with np.errstate(all="ignore"):
                points, outcome = follow(inputs, explains=False)
            if outcome.status is not Status.CONVERGED:
                return None
            motion = solution_of(inputs, points, outcome)
        if branch is not None and not np.array_equal(motion.branch[0], branch):
            return None
        residuals = np.concatenate([part for part, _, _ in self._rows(motion, instants, None)])
        gaps = [part for part, _, _ in self._gap_rows(motion, instants, None)]
        trial = Trial(x, motion, residuals, np.concatenate([*gaps, np.empty(0)]))
        return trial if np.isfinite(residuals).all() and np.isfinite(trial.gaps).all() else None

    def derivatives(self, trial: Trial) -> tuple[Array, Array]:
        """Return the derivatives of residuals (R, nx) and of gaps (G, nx)."""
        self.gradients += 1
        found = sensitivities(trial.motion, self.names, self.demands.columns)
        instants = self.demands.instants(trial.x[len(self.names) :])
        parts = []
        for rows in (self._rows, self._gap_rows):
            made = [
                np.concatenate((by_p, by_t), axis=1)
                for _, by_p, by_t in rows(trial.motion, instants, found)
            ]
            parts.append(np.concatenate([*made, np.empty((0, trial.x.size))]))
        return parts[0], parts[1]

    def _rows(self, motion: Solution, instants: list[Array], found: Sensitivities | None) -> Any:
        """Yield deviations, their derivatives by parameters, and by variables that are times."""
        first = 0
        for (target, columns), at in zip(self.demands.passing, instants, strict=True):
            places = np.searchsorted(motion.t, at)
            is_free = target.times is None
            for k, column in enumerate(columns):
                weight = float(target.weights[k])
                off = deviation(target.values[:, k], column, motion[column.name][places])
                by_p = by_t = off[:, np.newaxis][:, :0]
                if found is not None:
                    by_p = weight * self._by_parameters(found, column)[0, places]
                    by_t = np.zeros((at.size, len(self.demands.time_bounds())))
                if found is not None and is_free:
                    rates = weight * orders_of(motion, column)[1, places]
                    by_t[:, first : first + at.size] = np.tril(
                        np.repeat(rates[:, None], at.size, 1)
                    )
                yield weight * off, by_p, by_t
            first += at.size if is_free else 0
        for shape, columns in self.demands.shaped:
            places = np.searchsorted(motion.t, shape.times)
            values = np.column_stack([motion[item.name][places] for item in columns])
            slopes = None
            if found is not None:
                parts = [self._by_parameters(found, item)[0, places] for item in columns]
                slopes = np.stack(parts, axis=1)
            off, by_p = compared(shape, values, slopes)
            yield off, by_p, np.zeros((off.size, len(self.demands.time_bounds())))
        for ratio, column in self.demands.ratios:
            yield self._ratio(motion, ratio, column, found)

    def _by_parameters(self, found: Sensitivities, column: Column) -> Array:
        """Return the derivatives of a column and its rates, (3 - order, N, parameters)."""
        names = [column.of + suffix for suffix in ORDERS[column.order :]]
        return np.array([[found[x, name] for name in self.names] for x in names]).swapaxes(1, 2)

    def _ratio(
        self, motion: Solution, target: Any, column: Column, found: Sensitivities | None
    ) -> tuple[Array, Array, Array]:
        """Return the deviation of a time ratio, and its derivatives."""
        grid = self.demands.grid
        on_grid = np.searchsorted(motion.t, grid)
        y, rate, second = orders_of(motion, column)[:, on_grid]
        ends = []
        for sign in (1.0, -1.0):
            zeros = turning(grid, rate, second, sign)
            if not zeros:
                nothing = np.zeros((1, len(self.names)))
                times = np.zeros((1, len(self.demands.time_bounds())))
                return np.array([np.nan]), nothing, times
            ends.append(max(zeros, key=lambda item: sign * y[item.cell]))
        top, bottom = ends
        whole = grid[-1] - grid[0]
        rise = (top.t - bottom.t) % whole
        ratio = rise / (whole - rise)
        by_p = np.zeros((1, len(self.names)))
        if found is not None:
            slopes = self._by_parameters(found, column)[1:, on_grid]
            by_rise = whole / (whole - rise) ** 2
            for item, sign in ((top, 1.0), (bottom, -1.0)):
                cell = slice(item.cell, item.cell + 2)
                values = np.concatenate((slopes[0][cell], slopes[1][cell]))
                by_p += sign * by_rise * (item.weights @ values)
        by_t = np.zeros((1, len(self.demands.time_bounds())))
        return target.weight * np.array([ratio - target.ratio]), target.weight * by_p, by_t

    def _gap_rows(
        self, motion: Solution, instants: list[Array], found: Sensitivities | None
    ) -> Any:
        """Yield what is left to limits, with derivatives as `_rows` does."""
        on_grid = np.searchsorted(motion.t, self.demands.grid)
        times = len(self.demands.time_bounds())
        for item, column, is_constant in self.demands.limits:
            places = np.zeros(1, dtype=np.intp) if is_constant else on_grid
            orders, by_p = orders_of(motion, column)[:, places], None
            if found is not None:
                by_p = self._by_parameters(found, column)[:, places]
            for side in sides(item):
                extremes = Extremes(motion.t[places], orders, side.sign)
                gap = side.left(extremes.of(orders))
                if by_p is None:
                    yield gap, np.zeros((gap.size, 0)), np.zeros((gap.size, 0))
                else:
                    yield gap, side.factor * extremes.of(by_p), np.zeros((gap.size, times))
        first = 0
        for (begin, end), (target, _) in zip(self.demands.free, self.demands.untimed, strict=True):
            count = len(target.values)
            at = next(
                at
                for (own, _), at in zip(self.demands.passing, instants, strict=True)
                if own is target
            )
            by_t = np.zeros((1, times))
            by_t[0, first : first + count] = -1 / (end - begin)
            first += count
            gap = np.array([(end - at[-1]) / (end - begin) + SLACK])
            yield gap, np.zeros((1, len(self.names))), by_t
