r"""Measures of a motion: extremes, dead points, time ratio and mean of every output.

Extremes lie between the points of the grid: where :math:`\dot y` changes its sign, the motion is
followed from the nearest point (`observed.py`, so that the branch is kept), and :math:`\dot y = 0`
is solved by Newton's method with :math:`\ddot y`. An integral over a step h is
that of the polynomial of fifth degree through y and its emitted rates at both ends,

.. math:: \tfrac h2 (y_0 + y_1) + \tfrac{h^2}{10} (\dot y_0 - \dot y_1)
          + \tfrac{h^3}{120} (\ddot y_0 + \ddot y_1).
"""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import ROOT_LENGTH, SAME, SOLVED, STEEP, STILL, ZERO
from kincompile.errors import InputError
from kincompile.html import Shown
from kincompile.names import column_name, listed, suggestion
from kincompile.runtime.results.columns import shown_unit
from kincompile.runtime.results.driver_range import DriverRange, driver_ranges, driver_table
from kincompile.runtime.results.grashof import FourBarType, four_bar_table, four_bar_types
from kincompile.runtime.results.observed import ObservedMotion, derivative, together
from kincompile.runtime.results.plot import runs
from kincompile.runtime.singular.curve import zero
from kincompile.tables import table

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.results.columns import MotionTable
    from kincompile.runtime.results.observed import Between

GAUSS_PLACES = 8
"""Places for the integral over a step at whose ends a rate does not exist."""


@dataclass(frozen=True, slots=True)
class OutputMeasures:
    """Extremes, mean and dwells of an output over the times that were solved.

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
        Over time. Of an output with a pole, as a mechanical advantage at a dead point, an extreme
        is infinite, and there is no mean.
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
class Measures(Shown):
    """Measures of a motion: ``measures["ram.x"]`` gives those of an output; str is a table.

    Attributes
    ----------
    name
        Of the mechanism.
    outputs : tuple of OutputMeasures
        In the order of the columns.
    drivers : tuple of DriverRange
        How far each driver can go; of a module that was loaded from a file none are known.
    four_bars : tuple of FourBarType
        The Grashof type of each four-bar, likewise.
    """

    name: str
    outputs: tuple[OutputMeasures, ...]
    drivers: tuple[DriverRange, ...]
    four_bars: tuple[FourBarType, ...] = ()

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

    def headline(self) -> str:
        """Name the mechanism and its outputs."""
        return f"{self.name}: {listed([x.name for x in self.outputs]) or 'no outputs'}"

    def to_text(self) -> str:
        """Return tables of outputs, drivers and four-bars."""
        return self.table()

    def table(self, angle_unit: str = "rad") -> str:
        """Return tables of outputs, drivers and four-bars; angles in ``"rad"`` or ``"deg"``."""
        return "\n\n".join(filter(None, self.tables(angle_unit)))

    def tables(self, angle_unit: str) -> tuple[str, str, str]:
        """Return the tables of outputs, drivers and four-bars, each "" where there are none."""
        outputs, drivers, four_bars = (
            _output_table(self.outputs, angle_unit),
            driver_table(self.drivers, angle_unit),
            four_bar_table(self.four_bars),
        )
        return "\n".join(outputs), "\n".join(drivers), "\n".join(four_bars)


def measures(solution: MotionTable, code: Compiled, p: Array) -> Measures:
    """Measure the motion of a mechanism with parameters p, as `Solution.measures` describes."""
    found = output_measures(solution, code, p)
    ranges = driver_ranges(solution, code, p)
    return Measures(solution.name, found, ranges, four_bar_types(code, p))


def output_measures(
    solution: MotionTable, code: Compiled, p: Array, names: Container[str] | None = None
) -> tuple[OutputMeasures, ...]:
    """Measure the outputs of these names, or all, over the motion of a mechanism."""
    solution.require_one_motion("measures are those of", "solve with one of the parameter sets")
    if not np.isfinite(solution.q_dot).any():
        raise InputError(f"{solution.name} has no motion to measure. {solution.message}")
    if all(name in solution.observed.without_rates for name in solution.observed.names):
        return ()
    return measures_together([solution], code, p[np.newaxis], names)[0]


def measures_together(
    solutions: Sequence[MotionTable], code: Compiled, sets: Array, names: Container[str] | None
) -> list[tuple[OutputMeasures, ...]]:
    """Measure the outputs of these names over motions with parameters (B, k), as each alone."""
    pairs = zip(solutions, sets, strict=True)
    motions = [ObservedMotion(one, code, p) for one, p in pairs]
    return together(motions, [_all_measured(motion, names) for motion in motions])


def _all_measured(
    motion: ObservedMotion, names: Container[str] | None
) -> Between[tuple[OutputMeasures, ...]]:
    """Return the measures of the outputs of these names."""
    found = []
    for k, name in enumerate(motion.names):
        if names is None or name in names:
            found.append((yield from _measured(motion, k)))
    return tuple(found)


def _measured(motion: ObservedMotion, k: int) -> Between[OutputMeasures]:
    """Return the measures of output k."""
    name = motion.names[k]
    below, above = yield from _poles(motion, k)
    if below or above:
        return _unbounded(motion, k, below, above)
    dead, kinks = yield from _dead_points(motion, k)
    least = yield from _extreme(motion, k, dead, -1)
    greatest = yield from _extreme(motion, k, dead, 1)
    period = yield from _period(motion, k, dead)
    mean, square = yield from _means(motion, k, kinks)
    return OutputMeasures(
        name, motion.units[name], least[1], least[0], greatest[1], greatest[0], tuple(dead),
        period, _time_ratio(motion, dead, period), mean, math.sqrt(max(square, 0.0)),
    )  # fmt: skip


def _poles(motion: ObservedMotion, k: int) -> Between[tuple[list[float], list[float]]]:
    """Return when an output falls below, and rises above, all bounds.

    That is where it is so on the grid, and where it changes its sign against its rate.
    """
    t, y, y_dot, is_far = motion.t, motion.y[:, k], motion.y_dot[:, k], motion.is_far[:, k]
    found: tuple[list[float], list[float]] = ([], [])
    for row in np.flatnonzero(is_far).tolist():
        for value in y[max(row - 1, 0) : row + 2].tolist():
            found[int(value > 0)].append(float(t[row]))
    against = (y[:-1] * y[1:] < 0) & (np.diff(y) * y_dot[:-1] < 0) & (np.diff(y) * y_dot[1:] < 0)
    for a in np.flatnonzero(against & ~is_far[:-1] & ~is_far[1:]).tolist():
        search = zero(float(t[a]), float(t[a + 1]), ROOT_LENGTH * motion.span)
        time, value = next(search), math.nan
        with suppress(StopIteration):
            while True:
                value, rate, _ = yield from motion.at(time, k)
                time = search.send((1 / value, -rate / value**2) if value else (math.nan, math.nan))
        if abs(value) > STEEP * max(abs(y[a]), abs(y[a + 1])):
            found[0].append(time)
            found[1].append(time)
    return found


def _unbounded(
    motion: ObservedMotion, k: int, below: list[float], above: list[float]
) -> OutputMeasures:
    """Return the measures of an output with poles: its extremes, and no mean."""
    t, y = motion.t, np.where(motion.is_far[:, k], np.nan, motion.y[:, k])
    low, high = (
        int(find(y)) if np.isfinite(y).any() else 0 for find in (np.nanargmin, np.nanargmax)
    )
    least = (min(below), -math.inf) if below else (float(t[low]), float(y[low]))
    greatest = (min(above), math.inf) if above else (float(t[high]), float(y[high]))
    return OutputMeasures(
        motion.names[k], motion.units[motion.names[k]], least[1], least[0], greatest[1],
        greatest[0], (), None, None, math.nan, math.inf,
    )  # fmt: skip


def _dead_points(motion: ObservedMotion, k: int) -> Between[tuple[list[float], list[float]]]:
    """Return the times at which an output turns back, and those of them that are corners."""
    t, y, y_dot, y_ddot = motion.t, motion.y[:, k], motion.y_dot[:, k], motion.y_ddot[:, k]
    most = float(np.max(np.abs(y_dot), initial=0.0, where=np.isfinite(y_dot)))
    if np.ptp(y) <= STILL * motion.scale(k) or not most > 0:
        return [], []
    signs = np.sign(np.where(np.abs(y_dot) > SOLVED * most, y_dot, 0.0))
    found, kinks = _rests(t, signs), []
    for a in _steps_with_zeros(t, signs, y_dot, y_ddot):
        brackets = yield from _brackets(motion, k, a, signs, y_dot, y_ddot)
        for low, high in brackets:
            time, rate = yield from _zero(motion, k, low, high)
            found.append(time)
            if (yield from motion.has_corner(time, k, rate, most)):
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


def _steps_with_zeros(t: Array, signs: Array, y_dot: Array, y_ddot: Array) -> list[int]:
    """Return the numbers of the steps in which a rate may have a zero.

    Where both of its tangents reach zero within the step, it may have two.
    """
    h, sign = np.diff(t), signs[:-1]
    same = sign * signs[1:]
    falls = sign * y_ddot[:-1] * h < -np.abs(y_dot[:-1])
    rises = sign * y_ddot[1:] * h > np.abs(y_dot[1:])
    found: list[int] = np.flatnonzero((same < 0) | ((same > 0) & falls & rises)).tolist()
    return found


def _brackets(
    motion: ObservedMotion, k: int, a: int, signs: Array, y_dot: Array, y_ddot: Array
) -> Between[list[tuple[float, float]]]:
    """Return the times between which a rate has a zero, in the step from point a to the next."""
    start, stop = float(motion.t[a]), float(motion.t[a + 1])
    if signs[a] * signs[a + 1] < 0:
        return [(start, stop)]
    middle = start + (stop - start) * float(y_ddot[a] / (y_ddot[a] - y_ddot[a + 1]))
    _, rate, _ = yield from motion.at(middle, k)
    return [(start, middle), (middle, stop)] if rate * signs[a] < 0 else []


def _zero(motion: ObservedMotion, k: int, low: float, high: float) -> Between[tuple[float, float]]:
    """Return when the rate of an output is zero between two times, and the rate there.

    At a corner there is no zero: the sign changes there.
    """
    search = zero(low, high, ROOT_LENGTH * motion.span)
    t, rate = next(search), math.nan
    with suppress(StopIteration):
        while True:
            _, rate, slope = yield from motion.at(t, k)
            t = search.send((rate, slope))
    return t, rate


def _extreme(
    motion: ObservedMotion, k: int, dead: list[float], sign: int
) -> Between[tuple[float, float]]:
    """Return the first time of the least or the greatest value, by sign, and the value."""
    y = motion.y[:, k]
    times = [float(motion.t[0]), *dead, float(motion.t[-1])]
    inner = yield from motion.values(dead, k)
    values = [float(y[0]), *inner, float(y[-1])]
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


def _period(motion: ObservedMotion, k: int, dead: list[float]) -> Between[float | None]:
    """Return the time after which an output repeats itself, if it was solved for so long."""
    if not dead:
        return None
    candidates = sorted({time - dead[0] for time in dead[1:]} | {motion.span})
    for period in candidates:
        if (yield from _repeats(motion, k, dead[0], period)):
            return period
    return None


def _repeats(motion: ObservedMotion, k: int, first: float, period: float) -> Between[bool]:
    """Say whether an output and its rate are the same one period later, at some times."""
    start, end = float(motion.t[0]), float(motion.t[-1])
    slack = ZERO * motion.span
    rates = np.abs(motion.y_dot[:, k])
    limits = np.array([np.ptp(motion.y[:, k]), rates.max(initial=0.0, where=np.isfinite(rates))])
    spread = np.linspace(start, max(start, end - period), 4).tolist()
    for time in [*spread, first]:
        if time + period > end + slack:
            continue
        later = yield from motion.at(min(time + period, end), k)
        now = yield from motion.at(time, k)
        away = np.subtract(later, now)[:2]
        if (np.abs(away) > SAME * limits).any():
            return False
    return True


def _time_ratio(motion: ObservedMotion, dead: list[float], period: float | None) -> float | None:
    """Return the longer by the shorter time between the two dead points of a period."""
    if period is None:
        return None
    own = [time for time in dead if time < dead[0] + period - ZERO * motion.span]
    if len(own) != 2:
        return None
    one = own[1] - own[0]
    return max(one, period - one) / min(one, period - one)


def _means(motion: ObservedMotion, k: int, kinks: list[float]) -> Between[tuple[float, float]]:
    """Return the means of an output and of its square over time."""
    t, y, y_dot = motion.t, motion.y[:, k], motion.y_dot[:, k]
    if t.size == 1:
        return float(y[0]), float(y[0] ** 2)
    broken = np.zeros(t.size - 1, dtype=bool)
    broken[np.clip(np.searchsorted(t, kinks) - 1, 0, t.size - 2)] = True
    y_ddot = motion.y_ddot[:, k]
    pieces = np.split(np.arange(t.size), np.flatnonzero(broken) + 1)
    if not motion.emitted[k]:
        y_dot = np.concatenate([derivative(t[piece], y[piece]) for piece in pieces])
    if not np.isfinite(y_ddot).any():
        y_ddot = np.concatenate([derivative(t[piece], y_dot[piece]) for piece in pieces])
    squares = y**2, 2 * y * y_dot, 2 * (y_dot**2 + y * y_ddot)
    total = np.array([_integrals(t, y, y_dot, y_ddot), _integrals(t, *squares)])
    for a in np.flatnonzero(broken | ~np.isfinite(total).all(axis=0)).tolist():
        edges = [float(t[a]), *(x for x in kinks if t[a] < x < t[a + 1]), float(t[a + 1])]
        total[:, a] = yield from _by_gauss(motion, k, edges)
    mean, square = (total.sum(axis=1) / motion.span).tolist()
    return mean, square


def _integrals(t: Array, f: Array, f_dot: Array, f_ddot: Array) -> Array:
    """Return the integral of a function over each step, from its rates at the ends."""
    h = np.diff(t)
    parts = h / 2 * (f[1:] + f[:-1]), h**2 / 10 * -np.diff(f_dot)
    return np.asarray(parts[0] + parts[1] + h**3 / 120 * (f_ddot[1:] + f_ddot[:-1]))


def _by_gauss(motion: ObservedMotion, k: int, edges: list[float]) -> Between[Array]:
    """Return the integrals of an output and of its square over pieces of a step."""
    total = np.zeros(2)
    places, weights = _gauss()
    for low, high in itertools.pairwise(edges):
        half = (high - low) / 2
        times = [low + half * (1 + x) for x in places.tolist()]
        y = np.array((yield from motion.values(times, k)))
        total += half * np.array([weights @ y, weights @ y**2])
    return total


@cache
def _gauss() -> tuple[Array, Array]:
    """Return places and weights in [-1, 1]; NumPy loads its polynomials for them."""
    return np.polynomial.legendre.leggauss(GAUSS_PLACES)


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
