"""A table of radii as a periodic quintic spline.

It has four continuous derivatives, one more than a pair of cams needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import sympy

DEGREE = 5


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
    # SciPy's interpolation takes a quarter of a second to import, and only tables need it.
    from scipy.interpolate import PPoly, make_interp_spline

    x, y = _numbers(angles), _numbers(radii)
    problem = _table_problem(x, y)
    if problem:
        raise ValueError(problem)
    if x[-1] - x[0] < 2 * np.pi - 1e-9:
        x, y = np.append(x, x[0] + 2 * np.pi), np.append(y, y[0])
    pieces = PPoly.from_spline(make_interp_spline(x, y, k=DEGREE, bc_type="periodic"))
    wide = np.diff(pieces.x) > 0
    keep = wide & (pieces.x[:-1] >= x[0] - 1e-12) & (pieces.x[:-1] < x[-1] - 1e-12)
    breaks = (*pieces.x[:-1][keep].tolist(), float(x[-1]))
    return SplineTable(breaks, tuple(tuple(row) for row in pieces.c.T[keep].tolist()))


def fit_between(times: Any, values: Any, velocities: Any) -> SplineTable:
    """Interpolate values over time by a quintic spline without acceleration at its ends.

    Parameters
    ----------
    times, values
        Rising times and the value at each, shape (M,), M at least 2.
    velocities
        At the first time and at the last.
    """
    from scipy.interpolate import PPoly, make_interp_spline

    ends = tuple([(1, velocity), (2, 0.0)] for velocity in velocities)
    pieces = PPoly.from_spline(make_interp_spline(times, values, k=DEGREE, bc_type=ends))
    keep = np.diff(pieces.x) > 0
    breaks = (*pieces.x[:-1][keep].tolist(), times[-1])
    return SplineTable(breaks, tuple(map(tuple, pieces.c.T[keep].tolist())))


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
