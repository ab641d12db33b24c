r"""Measures of a motion: extremes, dead points, time ratio and mean of every output.

Extremes lie between the points of the grid: where :math:`\dot y` changes its sign, the motion is
followed from the point before it (`March.advance`, so that the branch is kept), and
:math:`\dot y = 0` is solved by Newton's method with :math:`\ddot y`. An integral over a step h is
that of the polynomial of fifth degree through y and its emitted rates at both ends,

.. math:: \tfrac h2 (y_0 + y_1) + \tfrac{h^2}{10} (\dot y_0 - \dot y_1)
          + \tfrac{h^3}{120} (\ddot y_0 + \ddot y_1).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import MAX_CORRECTIONS, TOLERANCE
from kincompile.errors import InputError
from kincompile.names import column_name, listed, suggestion
from kincompile.runtime.march import March, State
from kincompile.runtime.problem import problem
from kincompile.runtime.results.columns import shown_unit
from kincompile.runtime.results.driver_range import DriverRange, driver_ranges, driver_table
from kincompile.runtime.results.plot import runs
from kincompile.runtime.singular.events import quintic
from kincompile.tables import table

if TYPE_CHECKING:
    from collections.abc import Container
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.results.columns import MotionTable

STILL = 1e-11
"""Movement, relative to the largest number of the same unit, that is a rounding error."""

AT_REST = 1e-10
"""Rate, relative to an output's largest, that is zero."""

KINK = 1e-6
"""Rate, relative to an output's largest, with which it changes its sign at a corner."""

SHARP = 1e-2
"""The same, where the rate is a difference: its jump over twice the distance `APART`."""

SAME = 1e-7
"""Difference, relative to its stroke, up to which an output repeats itself."""

LOCATED = 1e-13
"""Part of the span of times to which a zero is located."""

ROOT_STEPS = 60
"""Steps of the search for a zero: as many halvings as there are bits."""

APART = 1e-5
"""Distance of the times that give a rate where none is emitted, as a part of the span."""

GAUSS_PLACES = 8
"""Places for the integral over a step at whose ends a rate does not exist."""


@dataclass(frozen=True, slots=True)
class OutputMeasures:
    """What an output does in the time that was solved.

    Attributes
    ----------
    name, unit
        As in the columns of the solution.
    least, t_least, greatest, t_greatest : float
        The extremes, and the first time of each.
    dead_points : tuple of float
        Times at which it is at rest and turns back, and ends of the time at which it is at rest; a
        dwell counts once, where it begins.
    period : float or None
        After what time it repeats itself; None if it is not cyclic, or not solved for so long.
    time_ratio : float or None
        Of a cyclic output with two dead points in a period, the longer by the shorter of the two
        times between them.
    mean, rms : float
        Over time.
    """

    name: str
    unit: str
    least: float
    t_least: float
    greatest: float
    t_greatest: float
    dead_points: tuple[float, ...]
    period: float | None
    time_ratio: float | None
    mean: float
    rms: float

    @property
    def stroke(self) -> float:
        """The difference of the extremes."""
        return self.greatest - self.least


@dataclass(frozen=True, slots=True, repr=False)
class Measures:
    """Measures of a motion: ``measures["ram.x"]`` gives those of an output; str is a table.

    Attributes
    ----------
    name
        Of the mechanism.
    outputs : tuple of OutputMeasures
        In the order of the columns.
    drivers : tuple of DriverRange
        How far each driver can go; of a module that was loaded from a file none are known.
    """

    name: str
    outputs: tuple[OutputMeasures, ...]
    drivers: tuple[DriverRange, ...]

    def __getitem__(self, name: str) -> OutputMeasures | DriverRange:
        """Return the measures of an output, or the range of a driver, by name."""
        known: dict[str, OutputMeasures | DriverRange] = {x.name: x for x in self.drivers}
        known |= {item.name: item for item in self.outputs}
        found = known.get(name) or known.get(column_name(name))
        if found is None:
            raise InputError(
                f"{self.name} has no output or driver {name!r}{suggestion(name, known) or '.'} "
                f"There are {listed(known) or 'none: name a point or an output in the model'}."
            )
        return found

    def __repr__(self) -> str:
        """Name the outputs and drivers."""
        return (
            f"<Measures of {self.name}: {listed([x.name for x in self.outputs]) or 'no outputs'}>"
        )

    def __str__(self) -> str:
        """Return tables of outputs and drivers."""
        return self.table()

    def table(self, angle_unit: str = "rad") -> str:
        """Return tables of outputs and drivers; angles in ``"rad"`` or ``"deg"``."""
        parts = (_output_table(self.outputs, angle_unit), driver_table(self.drivers, angle_unit))
        return "\n\n".join("\n".join(part) for part in parts if part)


def measures(solution: MotionTable, module: ModuleType, p: Array) -> Measures:
    """Measure the motion of a module with parameters p, as `Solution.measures` describes."""
    found = output_measures(solution, module, p)
    return Measures(solution.name, found, driver_ranges(solution, module, p))


def output_measures(
    solution: MotionTable, module: ModuleType, p: Array, names: Container[str] | None = None
) -> tuple[OutputMeasures, ...]:
    """Measure the outputs of these names, or all, over the motion of a module."""
    solution.require_one_motion("measures are those of", "solve with one of the parameter sets")
    if not np.isfinite(solution.q_dot).any():
        raise InputError(f"{solution.name} has no motion to measure. {solution.message}")
    if all(name in solution.observed.without_rates for name in solution.observed.names):
        return ()
    motion = _ObservedMotion(solution, module, p)
    return tuple(
        _measured(motion, k)
        for k, name in enumerate(motion.names)
        if names is None or name in names
    )


class _ObservedMotion:
    """Outputs over rising times (N,), and between them."""

    def __init__(self, solution: MotionTable, module: ModuleType, p: Array) -> None:
        own = solution.observed
        good = np.flatnonzero(np.isfinite(solution.q_dot).all(axis=1))
        self.t, order = np.unique(solution.t[good], return_index=True)
        self.rows = good[order]
        # Forces are not followed between the times; they come after all that is.
        self.names = tuple(name for name in own.names if name not in own.without_rates)
        self.units, count = own.units, len(self.names)
        y, y_dot, y_ddot = (part[self.rows, :count] for part in (own.y, own.y_dot, own.y_ddot))
        self.emitted: NDArray[np.bool_] = np.any(np.isfinite(y_dot), axis=0)
        self.y, self.y_dot, self.y_ddot = y, y_dot, y_ddot
        for k in np.flatnonzero(~self.emitted).tolist():
            y_dot[:, k] = _derivative(self.t, y[:, k])
        self.span = float(self.t[-1] - self.t[0])
        self._solution, self._module, self._p = solution, module, p
        on_grid = np.array((self.y, self.y_dot, self.y_ddot)).transpose(1, 0, 2)
        self._known: dict[float, Array] = dict(zip(self.t.tolist(), on_grid, strict=True))
        self._states: dict[int, State | None] = {}
        self._is_free = len(module.EQUATIONS) < len(solution.coordinates)
        start = self._position(0)
        equations = problem(self._module, self._p, start, self.t[0], staged=True)
        self._march = March(equations, equations.engine, TOLERANCE)
        self._scales = self._largest()

    def scale(self, k: int) -> float:
        """Return the largest number of the unit of an output."""
        return self._scales[self.units[self.names[k]]]

    def at(self, t: float, k: int) -> tuple[float, float, float]:
        """Return an output and its rates at any time in the span; NaN where it cannot be followed.

        A rate that is not emitted is that of the polynomial of fourth degree around it.
        """
        y, y_dot, y_ddot = self._observed(t)[:, k]
        if not self.emitted[k]:
            h = APART * self.span
            at = [float(self._observed(t + part * h)[0, k]) for part in (-2, -1, 1, 2)]
            y_dot = (8 * (at[2] - at[1]) - (at[3] - at[0])) / (12 * h)
        return float(y), float(y_dot), float(y_ddot)

    def value(self, t: float, k: int) -> float:
        """Return an output at any time in the span."""
        return float(self._observed(t)[0, k])

    def has_corner(self, t: float, k: int, rate: float, most: float) -> bool:
        """Say whether an output turns back in a corner, where its rate jumps, at most by `most`."""
        if self.emitted[k]:
            return not abs(rate) <= KINK * most
        h = APART * self.span
        bend = self.value(t - h, k) - 2 * self.value(t, k) + self.value(t + h, k)
        return not abs(bend) <= SHARP * h * most

    def _observed(self, t: float) -> Array:
        """Return all outputs and their rates at a time, shape (3, k)."""
        if t not in self._known:
            motion = self._interpolated(t) if self._is_free else self._followed(t)
            found = np.full((3, len(self.names)), np.nan)
            if motion is not None:
                with np.errstate(all="ignore"):
                    found = np.array(self._module.observe(*motion, t, self._p))
            self._known[t] = found
        return self._known[t]

    def _followed(self, t: float) -> tuple[Array, Array, Array] | None:
        """Follow the motion from a neighbour on the grid, the nearer one first."""
        near = sorted(self._neighbours(t), key=lambda k: abs(float(self.t[k]) - t))
        for state in filter(None, map(self._on_grid, near)):
            with np.errstate(all="ignore"):
                outcome = self._march.advance(state, t, MAX_CORRECTIONS)
            if outcome.position is not None:
                found = outcome.state
                return None if found is None else (found.point.q, found.q_dot, found.q_ddot)
        return None

    def _interpolated(self, t: float) -> tuple[Array, Array, Array]:
        """Return a motion that follows from forces, between its points."""
        own, rows = self._solution, self.rows[self._neighbours(t)]
        ends = [(own.q[row], own.q_dot[row], own.q_ddot[row]) for row in rows.tolist()]
        times = own.t[rows].tolist()
        return ends[0] if len(ends) == 1 else quintic(times[0], ends[0], times[1], ends[1], t)

    def _neighbours(self, t: float) -> list[int]:
        """Return the numbers of the points before and after a time."""
        after = min(int(np.searchsorted(self.t, t)), self.t.size - 1)
        return sorted({max(after - 1, 0), after})

    def _on_grid(self, k: int) -> State | None:
        """Return a point of the grid as a state from which the motion is followed."""
        if k not in self._states:
            point = self._march.equations.at(self._position(k), float(self.t[k]))
            state = None if point is None else self._march.state(point)
            self._states[k] = state if isinstance(state, State) else None
        return self._states[k]

    def _position(self, k: int) -> Array:
        return np.ascontiguousarray(self._solution.q[self.rows[k]])

    def _largest(self) -> dict[str, float]:
        """Return the largest number of each unit."""
        names = (*self._solution.coordinates, *self.names)
        values = np.abs(np.column_stack((self._solution.q[self.rows], self.y))).max(axis=0)
        units = self._solution.units
        found: dict[str, float] = {"rad": 1.0}
        for name, value in zip(names, values.tolist(), strict=True):
            unit = units.get(name, "")
            found[unit] = max(found.get(unit, 0.0), value)
        return found


def _measured(motion: _ObservedMotion, k: int) -> OutputMeasures:
    """Return the measures of output k."""
    name = motion.names[k]
    dead, kinks = _dead_points(motion, k)
    least, greatest = (_extreme(motion, k, dead, sign) for sign in (-1, 1))
    period = _period(motion, k, dead)
    mean, square = _means(motion, k, kinks)
    return OutputMeasures(
        name, motion.units[name], least[1], least[0], greatest[1], greatest[0], tuple(dead),
        period, _time_ratio(motion, dead, period), mean, math.sqrt(max(square, 0.0)),
    )  # fmt: skip


def _dead_points(motion: _ObservedMotion, k: int) -> tuple[list[float], list[float]]:
    """Return the times at which an output turns back, and those of them that are corners."""
    t, y, y_dot, y_ddot = motion.t, motion.y[:, k], motion.y_dot[:, k], motion.y_ddot[:, k]
    most = float(np.max(np.abs(y_dot), initial=0.0, where=np.isfinite(y_dot)))
    if np.ptp(y) <= STILL * motion.scale(k) or not most > 0:
        return [], []
    signs = np.sign(np.where(np.abs(y_dot) > AT_REST * most, y_dot, 0.0))
    found, kinks = _rests(t, signs), []
    for a in range(t.size - 1):
        for low, high in _brackets(motion, k, a, signs, y_dot, y_ddot):
            time, rate = _zero(motion, k, low, high)
            found.append(time)
            if motion.has_corner(time, k, rate, most):
                kinks.append(time)
    return sorted(found), kinks


def _rests(t: Array, signs: Array) -> list[float]:
    """Return the points of the grid at which an output is at rest; of several in a row the first.

    Where it goes on as it came it has no dead point, unless it dwells there.
    """
    found = []
    for first, last in runs(signs == 0):
        before, after = signs[max(first - 1, 0)], signs[min(last + 1, t.size - 1)]
        if last > first or before * after <= 0:
            found.append(float(t[first]))
    return found


def _brackets(
    motion: _ObservedMotion, k: int, a: int, signs: Array, y_dot: Array, y_ddot: Array
) -> list[tuple[float, float]]:
    """Return the times between which a rate has a zero, in the step from point a to the next.

    Where both tangents of the rate reach zero within the step, it may have two.
    """
    start, stop = float(motion.t[a]), float(motion.t[a + 1])
    if signs[a] * signs[a + 1] < 0:
        return [(start, stop)]
    slopes, sign = y_ddot[a : a + 2] * (stop - start), signs[a]
    reaches = sign * slopes[0] < -abs(y_dot[a]) and sign * slopes[1] > abs(y_dot[a + 1])
    if not (signs[a] * signs[a + 1] > 0 and reaches):
        return []
    middle = start + (stop - start) * float(slopes[0] / (slopes[0] - slopes[1]))
    crosses = motion.at(middle, k)[1] * sign < 0
    return [(start, middle), (middle, stop)] if crosses else []


def _zero(motion: _ObservedMotion, k: int, low: float, high: float) -> tuple[float, float]:
    """Return when the rate of an output is zero between two times, and the rate there.

    Newton's method, or secants where no second rate is emitted, with a bisection where either
    leaves the bracket. At a corner there is no zero: the sign changes there.
    """
    smallest = LOCATED * motion.span
    before, at_low = low, motion.at(low, k)[1]
    rate_before, t = at_low, (low + high) / 2
    for _ in range(ROOT_STEPS):
        _, rate, slope = motion.at(t, k)
        if not math.isfinite(rate) or rate == 0:
            break
        if not math.isfinite(slope):
            slope = (rate - rate_before) / (t - before)
        low, high = (t, high) if rate * at_low > 0 else (low, t)
        before, rate_before = t, rate
        following = t - rate / slope if slope else low
        if abs(following - t) <= smallest or high - low <= smallest:
            break
        t = following if low < following < high else (low + high) / 2
    return t, rate


def _extreme(motion: _ObservedMotion, k: int, dead: list[float], sign: int) -> tuple[float, float]:
    """Return the first time of the least or the greatest value, by sign, and the value."""
    y = motion.y[:, k]
    times = [float(motion.t[0]), *dead, float(motion.t[-1])]
    values = [float(y[0]), *(motion.value(time, k) for time in dead), float(y[-1])]
    on_grid = int(np.nanargmax(sign * y)) if np.isfinite(y).any() else 0
    noise = STILL * motion.scale(k)
    best = int(np.nanargmax(sign * np.array(values))) if np.isfinite(values).any() else 0
    if sign * (y[on_grid] - values[best]) > noise:
        return float(motion.t[on_grid]), float(y[on_grid])
    apart = 1e-3 * motion.span
    for time, value in zip(times, values, strict=True):
        if abs(value - values[best]) <= noise and times[best] - time > apart:
            return time, value
    return times[best], values[best]


def _period(motion: _ObservedMotion, k: int, dead: list[float]) -> float | None:
    """Return the time after which an output repeats itself, if it was solved for so long."""
    if not dead:
        return None
    candidates = sorted({time - dead[0] for time in dead[1:]} | {motion.span})
    return next((period for period in candidates if _repeats(motion, k, dead[0], period)), None)


def _repeats(motion: _ObservedMotion, k: int, first: float, period: float) -> bool:
    """Say whether an output and its rate are the same one period later, at some times."""
    start, end = float(motion.t[0]), float(motion.t[-1])
    slack = 1e-9 * motion.span
    rates = np.abs(motion.y_dot[:, k])
    limits = np.array([np.ptp(motion.y[:, k]), rates.max(initial=0.0, where=np.isfinite(rates))])
    spread = np.linspace(start, max(start, end - period), 4).tolist()
    for time in [*spread, first]:
        if time + period > end + slack:
            continue
        away = np.subtract(motion.at(min(time + period, end), k), motion.at(time, k))[:2]
        if (np.abs(away) > SAME * limits).any():
            return False
    return True


def _time_ratio(motion: _ObservedMotion, dead: list[float], period: float | None) -> float | None:
    """Return the longer by the shorter time between the two dead points of a period."""
    if period is None:
        return None
    own = [time for time in dead if time < dead[0] + period - 1e-9 * motion.span]
    if len(own) != 2:
        return None
    one = own[1] - own[0]
    return max(one, period - one) / min(one, period - one)


def _means(motion: _ObservedMotion, k: int, kinks: list[float]) -> tuple[float, float]:
    """Return the means of an output and of its square over time."""
    t, y, y_dot = motion.t, motion.y[:, k], motion.y_dot[:, k]
    if t.size == 1:
        return float(y[0]), float(y[0] ** 2)
    broken = np.zeros(t.size - 1, dtype=bool)
    broken[np.clip(np.searchsorted(t, kinks) - 1, 0, t.size - 2)] = True
    y_ddot = motion.y_ddot[:, k]
    pieces = np.split(np.arange(t.size), np.flatnonzero(broken) + 1)
    if not motion.emitted[k]:
        y_dot = np.concatenate([_derivative(t[piece], y[piece]) for piece in pieces])
    if not np.isfinite(y_ddot).any():
        y_ddot = np.concatenate([_derivative(t[piece], y_dot[piece]) for piece in pieces])
    squares = y**2, 2 * y * y_dot, 2 * (y_dot**2 + y * y_ddot)
    total = np.array([_integrals(t, y, y_dot, y_ddot), _integrals(t, *squares)])
    for a in np.flatnonzero(broken | ~np.isfinite(total).all(axis=0)).tolist():
        edges = [float(t[a]), *(x for x in kinks if t[a] < x < t[a + 1]), float(t[a + 1])]
        total[:, a] = _by_gauss(motion, k, edges)
    mean, square = (total.sum(axis=1) / motion.span).tolist()
    return mean, square


def _integrals(t: Array, f: Array, f_dot: Array, f_ddot: Array) -> Array:
    """Return the integral of a function over each step, from its rates at the ends."""
    h = np.diff(t)
    parts = h / 2 * (f[1:] + f[:-1]), h**2 / 10 * -np.diff(f_dot)
    return np.asarray(parts[0] + parts[1] + h**3 / 120 * (f_ddot[1:] + f_ddot[:-1]))


def _by_gauss(motion: _ObservedMotion, k: int, edges: list[float]) -> Array:
    """Return the integrals of an output and of its square over pieces of a step."""
    total = np.zeros(2)
    places, weights = _gauss()
    for low, high in itertools.pairwise(edges):
        half = (high - low) / 2
        y = np.array([motion.value(low + half * (1 + x), k) for x in places.tolist()])
        total += half * np.array([weights @ y, weights @ y**2])
    return total


@cache
def _gauss() -> tuple[Array, Array]:
    """Return places and weights in [-1, 1]; NumPy loads its polynomials for them."""
    return np.polynomial.legendre.leggauss(GAUSS_PLACES)


def _derivative(t: Array, values: Array) -> Array:
    """Return the derivative of a spline of fifth degree, where no rate is emitted."""
    degree = 5 if t.size > 5 else 3 if t.size > 3 else 1
    if t.size < 2 or not np.isfinite(values).all():
        return np.full(t.size, np.nan)
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(t, values, degree).derivative()(t), dtype=np.float64)


def _output_table(outputs: tuple[OutputMeasures, ...], angle_unit: str) -> list[str]:
    """Return the lines of the table of outputs."""
    right = ("min", "at t", "max", "stroke", "dead points at", "time ratio", "mean", "rms")
    header = ("output", "unit", "min", "at t", "max", "at t", *right[3:])
    return (
        table(header, [_output_row(item, angle_unit) for item in outputs], right=right)
        if outputs
        else []
    )


def _output_row(item: OutputMeasures, angle_unit: str) -> list[str]:
    """Return the cells of an output, with zero for rounding errors."""
    noise = STILL * max(abs(item.least), abs(item.greatest))
    unit, factor = shown_unit(item.unit, angle_unit)

    def text(number: float) -> str:
        return _text(0.0 if abs(number) < noise else factor * number)

    extremes = (text(item.least), _text(item.t_least), text(item.greatest), _text(item.t_greatest))
    ratio = "not cyclic"
    if item.period is not None:
        ratio = "-" if item.time_ratio is None else _text(item.time_ratio)
    means = text(item.mean), text(item.rms)
    return [item.name, unit, *extremes, text(item.stroke), _times(item.dead_points), ratio, *means]


def _times(times: tuple[float, ...]) -> str:
    """Return times as text; of more than four the first, and how many."""
    shown = ", ".join(_text(time) for time in times[:4])
    return f"{shown}, ... ({len(times)})" if len(times) > 4 else shown or "-"


def _text(number: float) -> str:
    return f"{number:.6g}"
