"""How straight or round a path is, and how long a column rests.

Between the times that were solved a column is the polynomial of fifth degree through its values and
rates at both ends of a step. `nearest_line`, `nearest_circle` and `nearest_level` are the one
definition of a deviation, for results and for the targets of `kc.fit`.
"""

from __future__ import annotations

import math
import numbers
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import ROOT_LENGTH, SAME, STILL
from kincompile.errors import InputError
from kincompile.names import column_name, shown
from kincompile.runtime.engine.code import DRIVERS
from kincompile.runtime.results.columns import shown_unit
from kincompile.runtime.singular.curve import zero

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.results.columns import MotionTable

PARTS = 8
"""Parts of a step at which a path is looked at; its farthest places are found between them."""

ROUNDS = 50
"""Steps of Gauss and Newton towards the nearest circle."""


@dataclass(frozen=True, slots=True)
class PathDeviation:
    """How far a path is from a straight line or a circle, over a part of a motion.

    Attributes
    ----------
    point, unit
        Name of the point, and its unit of length.
    shape
        ``"line"`` or ``"circle"``.
    deviation : float
        The largest distance from the line or circle, to either side.
    t : float
        When it is.
    rms : float
        Root mean square of the distances, over time.
    place : tuple of float
        A point on the line, the middle of the path; the centre of the circle.
    direction : tuple of float, or None
        Of the line, a unit vector.
    radius : float or None
        Of the circle.
    start, stop : float
        The first and the last time of the part.
    """

    point: str
    unit: str
    shape: str
    deviation: float
    t: float
    rms: float
    place: tuple[float, float]
    direction: tuple[float, float] | None
    radius: float | None
    start: float
    stop: float

    def __str__(self) -> str:
        """Return one sentence."""
        where = "({:.6g}, {:.6g})".format(*self.place)
        if self.direction is None:
            shape = f"the circle of radius {self.radius:.6g} {self.unit} about {where}"
        else:
            shape = "the line through {} along ({:.6g}, {:.6g})".format(where, *self.direction)
        return (
            f"{self.point} keeps within {self.deviation:.6g} {self.unit} of {shape} from "
            f"t = {self.start:.6g} to {self.stop:.6g}; rms {self.rms:.6g}, farthest at "
            f"t = {self.t:.6g}"
        )


@dataclass(frozen=True, slots=True)
class Dwell:
    """How long a column stays near a value.

    Attributes
    ----------
    name, unit
        Of the column.
    at, within : float
        The value, and how far from it the column may be.
    start, stop : float
        Of the longest such time. Of a column that repeats itself after the times that were solved
        it may go on behind their end. NaN where there is none.
    travel : dict
        By how much each driver moves meanwhile.
    units : dict
        Of the drivers.
    """

    name: str
    unit: str
    at: float
    within: float
    start: float
    stop: float
    travel: Mapping[str, float]
    units: Mapping[str, str]

    @property
    def time(self) -> float:
        """How long it is [s]; zero where there is none."""
        return self.stop - self.start if math.isfinite(self.start) else 0.0

    def text(self, angle_unit: str = "rad") -> str:
        """Return one sentence, with angles in ``"rad"`` or ``"deg"``."""
        unit, factor = shown_unit(self.unit, angle_unit)
        near = f"within {factor * self.within:.6g} of {factor * self.at:.6g} {unit}".rstrip()
        if not math.isfinite(self.start):
            return f"{self.name} is never {near}"
        moved = []
        for name, value in self.travel.items():
            own, by = shown_unit(self.units[name], angle_unit)
            moved.append(f", while {name} moves by {by * value:.6g} {own}".rstrip())
        return (
            f"{self.name} is {near} for {self.time:.6g} s, from t = {self.start:.6g} to "
            f"{self.stop:.6g}{''.join(moved)}"
        )

    def __str__(self) -> str:
        """Return one sentence."""
        return self.text()


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """What is nearest to values (N, c): a line or a circle in the plane, or a level."""

    offsets: Array  # (N,): how far each value is from it, with a sign
    slopes: Array  # (N, c): derivatives of each offset by its own value
    free: Array  # (N, a): derivatives by what of it was chosen
    place: Array
    direction: Array | None = None
    radius: float | None = None


def nearest_line(values: Array, given: Any = None) -> Nearest:
    """Return the line with the least sum of squared distances, or a given one, by two places."""
    if given is None:
        place = values.mean(axis=0)
        _, _, axes = np.linalg.svd(values - place, full_matrices=False)
        u = axes[0] * (1.0 if axes[0] @ (values[-1] - values[0]) >= 0 else -1.0)
    else:
        ends = np.array(given, dtype=np.float64)
        place, u = ends[0], (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    normal, away = np.array([-u[1], u[0]]), values - place
    free = np.column_stack((away @ u, np.ones(len(values))))
    slopes = np.tile(normal, (len(values), 1))
    return Nearest(away @ normal, slopes, free[:, : 0 if given is not None else 2], place, u)


def nearest_circle(values: Array, given: Any = None) -> Nearest:
    """Return the circle with the least sum of squared distances, or a given one, (x, y, radius).

    It starts from that whose equation, linear in the centre, is met best (Kasa 1976).
    """
    middle = values.mean(axis=0)
    size = float(np.abs(values - middle).max()) or 1.0
    scaled = (values - middle) / size
    if given is None:
        rows = np.column_stack((2 * scaled, np.ones(len(scaled))))
        x, y, c = np.linalg.lstsq(rows, (scaled**2).sum(axis=1), rcond=None)[0]
        found = np.array([x, y, math.sqrt(max(c + x * x + y * y, 0.0))])
        for _ in range(ROUNDS):
            offsets, away = _from_circle(scaled, found)
            step = np.linalg.lstsq(np.column_stack((away, np.ones(len(away)))), offsets, rcond=None)
            found = found + step[0]
            if np.abs(step[0]).max() <= 1e-15 * np.abs(found).max():
                break
        place, radius = middle + size * found[:2], size * float(found[2])
    else:
        place, radius = np.array(given[:2], dtype=np.float64), float(given[2])
    offsets, away = _from_circle(values, np.array([*place, radius]))
    free = -np.column_stack((away, np.ones(len(away))))
    return Nearest(
        offsets, away, free[:, : 0 if given is not None else 3], place, radius=abs(radius)
    )


def _from_circle(values: Array, circle: Array) -> tuple[Array, Array]:
    """Return distances from a circle (x, y, radius), and the directions away from its centre."""
    away = values - circle[:2]
    sizes = np.linalg.norm(away, axis=1)
    return sizes - circle[2], away / np.where(sizes > 0, sizes, 1.0)[:, np.newaxis]


def nearest_level(values: Array, given: Any = None) -> Nearest:
    """Return the mean of a column (N, 1), or a given level."""
    place = values.mean(axis=0) if given is None else np.array([float(given)])
    ones = np.ones_like(values)
    free = -ones[:, : 0 if given is not None else 1]
    return Nearest((values - place)[:, 0], ones, free, place)


def path_deviation(
    solution: MotionTable, point: str, between: Any, shape: str, given: Any
) -> PathDeviation:
    """Compare the path of a point with a line or a circle, as `Solution.straightness` describes."""
    solution.require_one_motion("a path is that of", "take a variant: .variant(0)")
    if any(name.startswith("e0_") for name in solution.coordinates):
        raise InputError(f"{solution.name} moves in space: paths are compared in the plane only.")
    times, inside = _part(solution, between)
    names, given = path_columns(solution, point), _read_shape(shape, given)
    curves = [_curve(solution, name) for name in names]
    values = np.column_stack([curve(times) for curve in curves])[inside]
    times = times[inside]
    found = (nearest_line if shape == "line" else nearest_circle)(values, given)
    t, farthest = _farthest(curves, times, found)
    direction = None if found.direction is None else (*found.direction.tolist(),)
    return PathDeviation(
        point, solution.column(names[0]).unit, shape, farthest, t,
        float(np.sqrt(np.mean(found.offsets**2))), (*found.place.tolist(),), direction,
        found.radius, float(times[0]), float(times[-1]),
    )  # fmt: skip


SHAPES = {
    "line": ((2, 2), "a line is two places apart, such as ((0, 1), (2, 1))"),
    "circle": ((3,), "a circle is x, y and a positive radius, such as (0, 0, 1)"),
}
"""The numbers of a line and of a circle, and how they are given."""


def _read_shape(shape: str, given: Any) -> Any:
    """Return a line or a circle as numbers, or None where it is to be found."""
    if given is None:
        return None
    form, how = SHAPES[shape]
    try:
        found = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.array(np.nan)
    fits = found.shape == form and bool(np.isfinite(found).all())
    if not (fits and (found[-1] > 0 if shape == "circle" else (found[0] != found[1]).any())):
        raise InputError(f"the {shape} is {shown(given)}: {how}")
    return found


def path_columns(solution: MotionTable, point: str) -> tuple[str, str]:
    """Return the names of both coordinates of a point; of a column say which point it is of."""
    names = f"{point}.x", f"{point}.y"
    try:
        solution.column(names[0])
    except InputError:
        quantity, _, owner = column_name(point).partition("_")
        if quantity not in ("x", "y") or not owner:
            raise
        solution.column(f"{owner}.x")
        raise InputError(
            f"{point!r} is a column, and a path is that of a point. Name the point: {owner!r}."
        ) from None
    return names


def _farthest(curves: Sequence[Any], times: Array, found: Nearest) -> tuple[float, float]:
    """Return when a path is farthest from a line or circle, and how far, between times too."""
    rates, seconds = ([curve.derivative(k) for curve in curves] for k in (1, 2))

    def at(t: Any) -> Array:
        """Return distances from the shape, their rates and second rates, (3, N)."""
        place, rate, second = (
            np.array([curve(np.atleast_1d(t)) for curve in of]).T for of in (curves, rates, seconds)
        )
        if found.radius is None:
            offsets, away, bend = (place - found.place) @ found.slopes[0], found.slopes[:1], 0.0
        else:
            offsets, away = _from_circle(place, np.array([*found.place, found.radius]))
            across = (rate**2).sum(axis=1) - (away * rate).sum(axis=1) ** 2
            bend = across / np.maximum(offsets + found.radius, STILL * found.radius)
        return np.array((offsets, (away * rate).sum(axis=1), (away * second).sum(axis=1) + bend))

    offsets, slopes, _ = at(times)
    where, span = [times[np.argmax(np.abs(offsets))]], times[-1] - times[0]
    for k in np.flatnonzero(slopes[:-1] * slopes[1:] < 0).tolist():
        search = zero(float(times[k]), float(times[k + 1]), ROOT_LENGTH * span)
        t = next(search)
        with suppress(StopIteration):
            while True:
                _, rate, slope = at(t)[:, 0].tolist()
                t = search.send((rate, slope))
        where.append(t)
    sizes = np.abs(at(np.array(where))[0])
    worst = int(np.argmax(sizes))
    return float(where[worst]), float(sizes[worst])


def dwell(
    solution: MotionTable, code: Compiled, p: Array, name: str, within: float, at: Any
) -> Dwell:
    """Find the longest dwell of a column, as `Solution.dwell` describes."""
    solution.require_one_motion("a dwell is that of", "take a variant: .variant(0)")
    if not (isinstance(within, numbers.Real) and within > 0):
        raise InputError(f"the dwell of {name} within {shown(within)}: give a positive tolerance")
    column, curve = solution.column(name), _curve(solution, name)
    first, last = float(curve.x[0]), float(curve.x[-1])
    turning = curve.derivative().roots(extrapolate=False)
    y = curve(np.concatenate((curve.x, turning[np.isfinite(turning)])))
    level = {"max": float(y.max()), "min": float(y.min())}.get(at) if isinstance(at, str) else at
    if not (isinstance(level, numbers.Real) and not math.isnan(level)):
        raise InputError(f"a dwell at {at!r}: give 'max', 'min' or a value")
    edge = within + STILL * float(np.abs(y).max())
    cuts = np.concatenate([curve.solve(level + side, extrapolate=False) for side in (-edge, edge)])
    ends = np.unique([first, *cuts[np.isfinite(cuts)], last])
    near = np.abs(curve((ends[1:] + ends[:-1]) / 2) - level) <= edge
    starts = ends[:-1][near & ~np.append(False, near[:-1])]
    stops = ends[1:][near & ~np.append(near[1:], False)]
    if len(starts) > 1 and near[0] and near[-1] and _is_cyclic(curve):
        starts, stops = starts[1:], np.append(stops[1:-1], last + stops[0] - first)
    longest = int(np.argmax(stops - starts)) if len(starts) else None
    start, stop = (
        (math.nan,) * 2 if longest is None else map(float, (starts[longest], stops[longest]))
    )
    travel, units = {}, {}
    if longest is not None and DRIVERS in code.makers:
        over = max(stop - last, 0.0)
        here, there, begin, further = (
            code.request(DRIVERS)(t, p) for t in (start, min(stop, last), first, first + over)
        )
        for k, (driver, unit, *_) in enumerate(here):
            moved = [float(rows[k][3]) for rows in (there, here, further, begin)]
            travel[driver], units[driver] = moved[0] - moved[1] + moved[2] - moved[3], unit
    return Dwell(column.name, column.unit, float(level), float(within), start, stop, travel, units)


def _is_cyclic(curve: Any) -> bool:
    """Say whether a column ends as it began."""
    rate = curve.derivative()
    limits = (np.ptp(curve(curve.x)), np.abs(rate(curve.x)).max())
    pairs = zip((curve, rate), limits, strict=True)
    return all(abs(f(curve.x[-1]) - f(curve.x[0])) <= SAME * limit for f, limit in pairs)


def _part(solution: MotionTable, between: Any) -> tuple[Array, Any]:
    """Return times, and which of them belong to a part of the motion."""
    good = np.unique(solution.t[_found(solution)])
    low, high, column = float(good[0]), float(good[-1]), ""
    if isinstance(between, dict) and len(between) == 1:
        column, (least, most) = next((name, _two(ends)) for name, ends in between.items())
    elif between is not None:
        least, most = _two(between)
        low, high = max(low, least), min(high, most)
    count = PARTS * max(int(((good > low) & (good < high)).sum()) + 1, 4) + 1
    times = np.linspace(low, high, count) if low < high else np.empty(0)
    inside = np.ones(times.size, dtype=bool)
    if column:
        y = _curve(solution, column)(times)
        slack = STILL * float(np.abs(y).max())
        inside = (y >= least - slack) & (y <= most + slack)
    if inside.sum() < 4:
        raise InputError(
            f"{solution.name} moves from t = {good[0]:g} to {good[-1]:g}, and there is no part of "
            f"it between {shown(between)}. Give two times in their order, or a range of a column "
            "that it passes, as {'crank.phi': (1, 2)}."
        )
    return times, inside


def _two(given: Any) -> tuple[float, float]:
    """Return two numbers, the ends of a part."""
    try:
        low, high = (float(item) for item in given)
        is_known = not (math.isnan(low) or math.isnan(high))
    except (TypeError, ValueError):
        is_known = False
    if not is_known:
        raise InputError(
            f"a part of the motion is {shown(given)}: give two times, or {{'crank.phi': (1, 2)}}"
        )
    return low, high


def _found(solution: MotionTable) -> Any:
    """Return the numbers of the points that were found."""
    good = np.flatnonzero(np.isfinite(solution.q_dot).all(axis=1))
    if good.size < 2:
        raise InputError(f"{solution.name} has no motion to measure. {solution.message}")
    return good


def _curve(solution: MotionTable, name: str) -> Any:
    """Return a column as a function of time, pieces of polynomials of fifth degree."""
    from scipy.interpolate import BPoly, PPoly

    good = _found(solution)
    t, order = np.unique(solution.t[good], return_index=True)
    orders = [solution.column(name + rate).values[good[order]] for rate in ("", "_dot", "_ddot")]
    for k in (1, 2):  # rates that are not emitted, or do not exist in a corner
        missing = ~np.isfinite(orders[k])
        if missing.any():
            orders[k] = np.where(missing, np.gradient(orders[k - 1], t), orders[k])
    rows = np.stack(orders, axis=1)
    return PPoly.from_bernstein_basis(BPoly.from_derivatives(t, rows))
