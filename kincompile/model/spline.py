"""A table of values as a quintic spline.

It has four continuous derivatives, one more than a pair of cams needs. Its slopes and curvatures at
the points are those of the least integral of the third derivative squared. They are found by an
elimination in plain floats: the coefficients stand in emitted text, and a library's elimination
rounds as the processor at hand does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import sympy

if TYPE_CHECKING:
    from collections.abc import Sequence

STIFFNESS = ((192, 36, 168, -24), (36, 9, 24, -3), (168, 24, 192, -36), (-24, -3, -36, 9))
"""Of a piece of length 1: what slope and curvature at its two ends add to the jumps there."""

RISE = (360, 60, 360, -60)
"""And the same of its mean slope, on the right side."""


@dataclass(frozen=True, slots=True)
class SplineTable:
    """Piecewise polynomials of one period, 2 pi.

    Attributes
    ----------
    breaks
        Increasing angles, shape (M + 1,), in rad; the last is the first plus 2 pi.
    coefficients
        Shape (M, 6), highest power first, in powers of the angle from the left break.
    """

    breaks: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def __call__(self, angle: float, order: int = 0) -> float:
        """Return the spline, or its derivative of the given order, at one angle."""
        first, last = self.breaks[0], self.breaks[-1]
        angle = first + (angle - first) % (last - first)
        k = min(
            int(np.searchsorted(self.breaks, angle, side="right")) - 1, len(self.coefficients) - 1
        )
        return float(np.polyval(np.polyder(self.coefficients[k], order), angle - self.breaks[k]))


class PeriodicSpline(sympy.Function):
    """A spline as a SymPy function of one angle.

    Each table and order of derivative has a subclass of its own.
    """

    nargs = 1
    table: ClassVar[SplineTable]
    table_name: ClassVar[str]
    order: ClassVar[int]

    @classmethod
    @lru_cache(maxsize=256)
    def of(cls, table_name: str, table: SplineTable, order: int = 0) -> type[PeriodicSpline]:
        """Return the SymPy function of a table, or of one of its derivatives.

        The same one for the same table, since SymPy takes functions of two classes for different.
        """
        contents = {"table": table, "table_name": table_name, "order": order}
        function: type[PeriodicSpline] = type(table_name + "'" * order, (cls,), contents)
        return function

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Return the derivative: the same table, one order higher."""
        del argindex
        slope = PeriodicSpline.of(self.table_name, self.table, self.order + 1)
        value: sympy.Expr = slope(self.args[0])
        return value

    def _eval_evalf(self, prec: int) -> sympy.Float | None:
        angle = self.args[0]
        if not isinstance(angle, sympy.Expr) or not angle.is_number:
            return None
        return sympy.Float(self.table(float(angle), self.order), precision=prec)


def fit(angles: Any, radii: Any) -> SplineTable:
    """Interpolate radii over one revolution by a periodic quintic spline.

    Parameters
    ----------
    angles
        Strictly increasing polar angles within one revolution, shape (M,), in rad, M at least 6.
        The first angle plus 2 pi may be repeated as the last, with the same radius.
    radii
        Radii at these angles, shape (M,).

    Raises
    ------
    ValueError
        If the table is not of this form; the message says which point is wrong.
    """
    x, y = _numbers(angles), _numbers(radii)
    problem = _table_problem(x, y)
    if problem:
        raise ValueError(problem)
    if x[-1] - x[0] < 2 * np.pi - 1e-9:
        x, y = np.append(x, x[0] + 2 * np.pi), np.append(y, y[0])
    y[-1] = y[0]
    return _spline(x.tolist(), y.tolist(), None)


def fit_between(times: Any, values: Any, velocities: Any) -> SplineTable:
    """Interpolate values over time by a quintic spline without acceleration at its ends.

    Parameters
    ----------
    times, values
        Rising times and the value at each, shape (M,), M at least 2.
    velocities
        At the first time and at the last.
    """
    return _spline(list(map(float, times)), list(map(float, values)), velocities)


def _spline(x: list[float], y: list[float], velocities: Sequence[float] | None) -> SplineTable:
    """Return the quintic spline through points; without velocities at its ends it is periodic.

    Slope and curvature at point k are unknowns 2 k and 2 k + 1. The jumps of the third and fourth
    derivatives there, which are zero, have a matrix that is symmetric and positive definite, so
    that it is eliminated without a choice of pivots.
    """
    last = len(x) - 1
    points = [*range(last), 0 if velocities is None else last]
    rows: list[dict[int, float]] = [{} for _ in range(2 * len(set(points)))]
    right = [0.0] * len(rows)
    for k, (i, j) in enumerate(pairwise(points)):
        h = x[k + 1] - x[k]
        slope, unknowns = (y[k + 1] - y[k]) / h, (2 * i, 2 * i + 1, 2 * j, 2 * j + 1)
        for row, size, rise, numbers in zip(
            unknowns, (h * h * h, h * h) * 2, RISE, STIFFNESS, strict=True
        ):
            right[row] += rise * slope / size
            for column, number, power in zip(unknowns, numbers, (1.0, h, 1.0, h), strict=True):
                rows[row][column] = rows[row].get(column, 0.0) + number * power / size
    if velocities is not None:
        for row, value in zip((0, 1, -2, -1), (velocities[0], 0, velocities[1], 0), strict=True):
            rows[row], right[row] = {row % len(rows): 1.0}, float(value)
    found = _solved(rows, right)
    pieces = []
    for k, (i, j) in enumerate(pairwise(points)):
        h = x[k + 1] - x[k]
        m, c = found[2 * i : 2 * i + 2]
        value = (y[k + 1] - y[k]) / h - m - c * h / 2
        slope, bend = found[2 * j] - m - c * h, (found[2 * j + 1] - c) * h
        pieces.append((
            (6 * value - 3 * slope + bend / 2) / (h * h * h * h),
            (7 * slope - 15 * value - bend) / (h * h * h),
            (10 * value - 4 * slope + bend / 2) / (h * h),
            c / 2, m, y[k],
        ))  # fmt: skip
    return SplineTable(tuple(x), tuple(pieces))


def _solved(rows: list[dict[int, float]], right: list[float]) -> list[float]:
    """Solve equations, given by column, in which no pivot need be chosen."""
    below: list[set[int]] = [set() for _ in rows]
    for k, row in enumerate(rows):
        for column in row:
            below[column].add(k)
    for k, pivot in enumerate(rows):
        for j in sorted(item for item in below[k] if item > k):
            factor = rows[j].pop(k) / pivot[k]
            right[j] -= factor * right[k]
            for column, number in pivot.items():
                if column > k:
                    rows[j][column] = rows[j].get(column, 0.0) - factor * number
                    below[column].add(j)
    for k in reversed(range(len(rows))):
        for column, number in rows[k].items():
            if column > k:
                right[k] -= number * right[column]
        right[k] /= rows[k][k]
    return right


def _numbers(values: Any) -> np.ndarray:
    array = np.asarray(values)
    if array.dtype.kind == "c":
        raise ValueError("the table contains complex numbers")
    return array.astype(float)


def _table_problem(x: np.ndarray, y: np.ndarray) -> str | None:
    if x.ndim != 1 or x.shape != y.shape:
        return (
            f"angles and radii must be two lists of equal length, not of shapes {x.shape} "
            f"and {y.shape}"
        )
    if len(x) < 6:
        return f"a table needs at least 6 points, not {len(x)}"
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return "the table contains values that are not finite"
    if (np.diff(x) <= 0).any():
        k = int(np.argmax(np.diff(x) <= 0))
        return f"angles must increase, but {x[k + 1]:g} follows {x[k]:g}"
    turn = x[-1] - x[0]
    if turn > 2 * np.pi + 1e-9:
        return f"the angles span {turn:g} rad, more than one revolution (are they in degrees?)"
    if turn > 2 * np.pi - 1e-9 and not np.isclose(y[0], y[-1], rtol=1e-12, atol=0):
        return (
            f"the table closes after one revolution, but its radius there is {y[-1]:g}, "
            f"not {y[0]:g}"
        )
    return None
