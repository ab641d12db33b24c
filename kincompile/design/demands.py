"""The targets of a fit for one mechanism: which columns at which times, and their deviations.

The variables are the parameters, then for each passing without times its first time and the steps
to the next ones, so that their order is kept by bounds. What is asked of the motion as a whole is
asked at the times of a grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy
from scipy.interpolate import BPoly
from scipy.optimize import brentq

from kincompile.design.columns import Column, column_of
from kincompile.design.targets import Limit, Moves, Passing, Shaped, TimeRatio
from kincompile.errors import InputError
from kincompile.names import rate
from kincompile.runtime.engine.code import code_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.design.targets import Target
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]
    Places = NDArray[np.intp]
    Values = Callable[[Column], Array]

ORDERS = ("", "_dot", "_ddot")
"""Endings of the names of a column's rates."""

SMALLEST_STEP = 1e-6
"""Time between two points whose times are found, as a part of all time."""

LATE = 1e-3
"""Part of all time by which the last of these points may be late, and the steps be shortened."""

GRID = 73
"""Times at which the motion as a whole is looked at, and between which extremes are found."""


@dataclass(frozen=True, slots=True, eq=False)
class Demands:
    """Targets with their columns, for a module."""

    passing: tuple[tuple[Passing, tuple[Column, ...]], ...]  # each target with its columns
    shaped: tuple[tuple[Shaped, tuple[Column, ...]], ...]  # each with its columns, at grid times
    # The passing targets whose times are found, each with the first and last time allowed.
    free: tuple[tuple[float, float], ...]
    # Each limit with its column, and whether it depends on parameters alone.
    limits: tuple[tuple[Limit, Column, bool], ...]
    ratios: tuple[tuple[TimeRatio, Column], ...]  # each time ratio with its column
    grid: Array  # times for what concerns the whole motion; empty where nothing does

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the coordinates and outputs whose derivatives are needed."""
        of = [column.of for _, columns in (*self.passing, *self.shaped) for column in columns]
        of += [column.of for _, column, _ in self.limits]
        of += [column.of for _, column in self.ratios]
        return tuple(dict.fromkeys(of))

    def time_bounds(self) -> list[tuple[float, float]]:
        """Return the bounds of the variables that are times."""
        found = []
        for (first, last), (target, _) in zip(self.free, self.untimed, strict=True):
            span = last - first
            found += [(first, last), *[(SMALLEST_STEP * span, span)] * (len(target.values) - 1)]
        return found

    @property
    def first_time(self) -> float:
        """The first time at which anything is asked for."""
        given = [float(item.times[0]) for item, _ in self.passing if item.times is not None]
        begins = [first for first, _ in self.free]
        return min(*given, *begins, *map(float, self.grid[:1]), math.inf)

    @property
    def untimed(self) -> list[tuple[Passing, tuple[Column, ...]]]:
        """The passing targets whose times are found."""
        return [item for item in self.passing if item[0].times is None]

    def instants(self, variables: Array) -> list[Array]:
        """Return the times of each passing target, given the variables that are times."""
        found, first = [], 0
        for target, _ in self.passing:
            if target.times is not None:
                found.append(target.times)
                continue
            count = len(target.values)
            found.append(np.cumsum(variables[first : first + count]))
            first += count
        return found

    def within(self, variables: Array) -> Array:
        """Return variables that are times, with steps shortened where the last time is late."""
        found, first = variables.copy(), 0
        for (begin, end), (target, _) in zip(self.free, self.untimed, strict=True):
            own = slice(first, first + len(target.values))
            first = own.stop
            late = float(found[own].sum()) - end
            if 0 < late <= LATE * (end - begin):
                found[own] *= (end - begin) / (end - begin + late)
                found[own.start] += begin * late / (end - begin + late)
        return found


def read_demands(
    module: ModuleType, system: ConstraintSystem, targets: Sequence[Target]
) -> Demands:
    """Return the targets with their columns; refuse what cannot be asked for, all at once."""
    problems: list[str] = []
    code = code_of(module)

    def column(name: str, title: str = "", further: int = 0) -> Column:
        """Return a column, of which rates of some further order are needed too."""
        try:
            found = column_of(code, name)
            column_of(code, rate(found.of, min(found.order + further, 2)))
        except InputError as error:
            problems.extend(f"{title}: {item}" if title else item for item in error.problems)
            return Column(name, "", name, 0)
        return found

    passing = tuple(
        (
            target,
            tuple(column(name, target.title, target.times is None) for name in target.columns),
        )
        for target in targets
        if isinstance(target, Passing)
    )
    shaped = tuple(
        (item, tuple(column(name, item.title) for name in item.columns))
        for item in targets
        if isinstance(item, Shaped)
    )
    ratios = tuple(
        (item, column(item.column, item.title, 2))
        for item in targets
        if isinstance(item, TimeRatio)
    )
    limits = []
    for number, item in enumerate(item for item in targets if isinstance(item, Limit)):
        is_expression = isinstance(item.what, sympy.Expr)
        found = column(limit_name(number) if is_expression else str(item.what))
        limits.append((item, found, is_expression and _is_constant(item.what, system)))
    problems += [
        f"{target.title}: times of second rates cannot be found; give times"
        for target, columns in passing
        if target.times is None and any(item.order == 2 for item in columns)
    ]
    problems += [
        f"{item.title}: it is a time ratio of {found.of}; name the coordinate or output itself"
        for item, found in ratios
        if found.order
    ]
    if problems:
        raise InputError(problems)
    whole = any(isinstance(item, Moves | TimeRatio) for item in targets)
    whole = whole or any(not is_constant for _, _, is_constant in limits)
    end = float(system.end)
    free = tuple(
        (0.0, end) if target.between is None else target.between
        for target, _ in passing
        if target.times is None
    )
    grid = np.linspace(0.0, end, GRID) if whole else np.empty(0)
    grid = np.unique(np.concatenate([grid, *(item.times for item, _ in shaped)]))
    return Demands(passing, shaped, free, tuple(limits), ratios, grid)


def limit_name(number: int) -> str:
    """Return the name of the output that a limit of an expression becomes."""
    return f"limit_{number + 1}"


def _is_constant(expression: Any, system: ConstraintSystem) -> bool:
    """Say whether an expression depends on parameters alone."""
    known = {item.name for item in system.parameters}
    return {str(item) for item in expression.free_symbols} <= {*known, "deg"}


def deviation(wanted: Array, column: Column, got: Array) -> Array:
    """Return how far values are from what is wanted; angles modulo whole turns."""
    off: Array = got - wanted
    if column.unit == "rad" and column.order == 0:
        off = (off + math.pi) % (2 * math.pi) - math.pi
    return off


def compared(target: Shaped, values: Array, slopes: Array | None = None) -> tuple[Array, Array]:
    """Return weighted deviations from a shape, and their derivatives by k parameters.

    Of values (K, c) at its times, and of their derivatives (K, c, k). The shape moves with the
    values: what it may take away is left out, so that the gradient of the sum of squares is exact
    (Kaufman 1975).
    """
    found = target.nearest(values, target.given)
    if slopes is None:
        return target.weight * found.offsets, np.zeros((len(values), 0))
    by_p = np.einsum("kc,kcp->kp", found.slopes, slopes)
    if found.free.size:
        by_p -= found.free @ np.linalg.lstsq(found.free, by_p, rcond=None)[0]
    return target.weight * found.offsets, target.weight * by_p


@dataclass(frozen=True, slots=True)
class Side:
    """One end of a limit."""

    sign: float  # 1 of the least value that is allowed, -1 of the greatest
    bound: float
    factor: float  # of the derivative of what is left

    def left(self, got: Array) -> Array:
        """Return what is left to it as a part of the limit's size, negative beyond it."""
        return self.factor * (got - self.bound)


def sides(item: Limit) -> list[Side]:
    """Return the ends that a limit has."""
    ends = [
        (sign, end) for sign, end in ((1.0, item.least), (-1.0, item.most)) if math.isfinite(end)
    ]
    size = max(abs(end) for _, end in ends) or 1.0
    return [Side(sign, end, sign / size) for sign, end in ends]


class Extremes:
    """The least (sign 1) or greatest (sign -1) values between neighbouring times of a grid.

    Of a column and as many of its rates as are known, shape (orders, N), these are at one of both
    times, or where the first rate changes sign between them.
    """

    def __init__(self, t: Array, orders: Array, sign: float) -> None:
        value = sign * orders[0]
        lower = np.arange(t.size - 1) + (value[1:] < value[:-1])
        self._t, self._ends = t, lower if t.size > 1 else np.zeros(1, dtype=np.intp)
        self._inner: dict[int, float] = {}
        if len(orders) > 1:
            slope = sign * orders[1]
            for cell in np.flatnonzero((slope[:-1] < 0) & (slope[1:] > 0)).tolist():
                rate = self._between(orders, cell).derivative()
                self._inner[cell] = brentq(rate, t[cell], t[cell + 1], xtol=1e-16)

    def of(self, orders: Array) -> Array:
        """Return a column there, or derivatives of it (orders, N, k) by parameters, (N - 1, ...).

        The time of an extreme changes with the parameters, but to first order not the value.
        """
        found: Array = orders[0][self._ends]
        for cell, t in self._inner.items():
            found[cell] = self._between(orders, cell)(t)
        return found

    def _between(self, orders: Array, cell: int) -> Any:
        """Return the polynomial through values and rates at both ends of a cell."""
        ends = orders[:, cell : cell + 2].swapaxes(0, 1)
        return BPoly.from_derivatives(self._t[cell : cell + 2], ends)


def orders_of(motion: Solution, column: Column) -> Array:
    """Return a column and its rates over time, (3 - order, N)."""
    return np.array([motion[column.of + suffix] for suffix in ORDERS[column.order :]])


@dataclass(frozen=True, slots=True)
class Turning:
    """A zero of a rate between two points of a grid, and how it depends on the values there."""

    t: float
    weights: Array  # derivatives of it by the rate at both points, and by the second rate at both
    cell: int  # the number of the point before it


def turning(t: Array, rate: Array, second: Array, sign: float) -> list[Turning]:
    """Return where a rate passes through zero downwards (sign 1), or upwards (sign -1).

    Between two points it is the polynomial of third degree through both and its derivatives.
    """
    signed = sign * rate
    found = []
    for cell in np.flatnonzero((signed[:-1] > 0) & (signed[1:] <= 0)).tolist():
        h = t[cell + 1] - t[cell]
        data = np.array([rate[cell], rate[cell + 1], h * second[cell], h * second[cell + 1]])
        s = brentq(lambda s, data: float(_basis(s) @ data), 0.0, 1.0, (data,), xtol=1e-16)
        slope = float(_basis_slopes(s) @ data) / h
        weights = -_basis(s) / slope
        weights[2:] *= h
        found.append(Turning(float(t[cell] + s * h), weights, cell))
    return found


def _basis(s: float) -> Array:
    """Return Hermite's polynomials of third degree: of both values, of both derivatives."""
    return np.array(
        [(1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s), s * (1 - s) ** 2, s * s * (s - 1)]
    )


def _basis_slopes(s: float) -> Array:
    return np.array(
        [6 * s * s - 6 * s, 6 * s - 6 * s * s, 3 * s * s - 4 * s + 1, 3 * s * s - 2 * s]
    )
