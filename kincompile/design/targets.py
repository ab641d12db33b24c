"""What a mechanism is to do: `kc.targets`, for `kc.fit`.

kc.targets.path("P", [(1, 2), (1.5, 2.2)])                     a point goes through points, in order
kc.targets.path("P", points, times=[0.1, 0.2])                 at these times
kc.targets.value("rocker.phi", angles, times)                  function generation; rates too
kc.targets.pose("rod", [(1, 2, 0.3), (1.5, 2.2, 0.5)])         a body goes through poses
kc.targets.time_ratio("ram.x", 1.4)                            forth takes 1.4 times as long as back
kc.targets.straight("P", (0.2, 0.7), within=0.1)               a path is straight between times
kc.targets.circular("P", (0.2, 0.7), within=0.1)               or a part of a circle
kc.targets.dwell("ram.x", (0.4, 0.6), within=0.5)              an output rests
kc.targets.limit("mu", 40 * kc.deg, 140 * kc.deg)           a transmission angle, over the motion
kc.targets.limit(b / a, most=4)                                of dimensions
kc.targets.grashof("crank-rocker")                             the type of a four-bar
kc.targets.moves()                                             assembled at all times: full rotation
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.errors import InputError
from kincompile.model.expressions import number_in
from kincompile.model.four_bars import four_bar_loops
from kincompile.model.tasks import PART
from kincompile.names import ROLES, TRIPLE, column_name, listed, shown, suggestion
from kincompile.runtime.results.grashof import four_bar_with, non_grashof, room
from kincompile.runtime.results.shapes import nearest_circle, nearest_level, nearest_line

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeAlias

    from numpy.typing import ArrayLike, NDArray

    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.shapes import Nearest

    Array = NDArray[np.float64]
    Target: TypeAlias = "Passing | Shaped | TimeRatio | Limit | Moves | Grashof"

MOST_POINTS = 1000
"""Points of one target."""

PLACES = 25
"""Equally spaced times at which a path or a dwell is looked at."""


POSITIVE = "give positive numbers"


@dataclass(frozen=True, slots=True, eq=False)
class Passing:
    """Columns are to have values: at times, or one after the other at times that are found.

    Attributes
    ----------
    title
        What it is called in reports.
    columns
        Names of coordinates, outputs or rates.
    values : ndarray, shape (K, columns)
        What is wanted.
    times : ndarray, shape (K,), or None
        When; None where only the order counts.
    weights : ndarray, shape (columns,)
        Factors of the deviations, whose squares are added.
    within : float
        Largest deviation, weighted, that counts as reached.
    between : tuple of float, or None
        The first and the last time that may be found; None for those of the model.
    """

    title: str
    columns: tuple[str, ...]
    values: Array
    times: Array | None
    weights: Array
    within: float
    between: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class TimeRatio:
    """The way of a column from its least to its greatest value is to take `ratio` times the rest.

    The times of the model must be one cycle.
    """

    column: str
    ratio: float
    weight: float
    within: float

    @property
    def title(self) -> str:
        """What it is called in reports."""
        return f"time ratio of {self.column}"


@dataclass(frozen=True, slots=True, eq=False)
class Shaped:
    """Columns are to keep near a line, a circle or a level that is found or given, for a while."""

    title: str
    columns: tuple[str, ...]
    nearest: Callable[[Array, Any], Nearest]
    given: Any
    times: Array  # (K,)
    weight: float
    within: float


@dataclass(frozen=True, slots=True)
class Limit:
    """A column, or an expression, is to stay between two values at all times of the model."""

    what: str | sympy.Expr
    least: float
    most: float
    title: str


@dataclass(frozen=True, slots=True)
class Grashof:
    """A four-bar is to be of a type; its links are those of the model, which makes limits of it."""

    type: str
    link: str | None
    margin: float

    def limits(self, system: ConstraintSystem) -> list[Limit]:
        """Return the limits of the lengths, whose smallest room is the margin of Grashof's rule."""
        loop = four_bar_with(four_bar_loops(system), self.link)
        title = f"{self.type} of {' '.join(loop.joints)}"
        if self.type == TRIPLE:
            return [Limit(non_grashof(loop.lengths), self.margin, math.inf, title)]
        shortest = ROLES.index(self.type)
        others = [name for k, name in enumerate(loop.links) if k != shortest]
        return [
            Limit(value, self.margin, math.inf, f"{title}, with {name} as l")
            for value, name in zip(room(loop.lengths, shortest), others, strict=True)
        ]


@dataclass(frozen=True, slots=True)
class Moves:
    """The mechanism is to move through all times of the model."""

    title: str = "moves"


def path(
    point: str,
    points: ArrayLike,
    times: ArrayLike | None = None,
    *,
    weight: float = 1.0,
    within: float | None = None,
    between: tuple[float, float] | None = None,
) -> Passing:
    """Return the demand that a point goes through points, in their order.

    Parameters
    ----------
    point
        Name of a point, ``"P"``, or of a body, whose origin is meant.
    points : array_like, shape (K, 2), in space (K, 3)
        Where it is to be [length].
    times : array_like, shape (K,), optional
        When; without, the times are found as well.
    weight
        Factor of its deviations, among other targets.
    within
        Distance along an axis up to which a point counts as reached; without, a thousandth of
        how far the points are apart.
    between
        The first and the last time that may be found; without, those of the model.

    Raises
    ------
    InputError
        If numbers are missing, not finite, or times do not rise.
    """
    wanted = _numbers(points, f"the points of {point!r}", 2)
    letters = "xyz"[: wanted.shape[1]]
    names = tuple(f"{letter}_{point}" for letter in letters)
    weights = np.full(len(names), weight)
    return _passing(f"path of {point}", names, wanted, times, weights, within, between)


def value(
    column: str,
    values: ArrayLike,
    times: ArrayLike | None = None,
    *,
    weight: float = 1.0,
    within: float | None = None,
    between: tuple[float, float] | None = None,
) -> Passing:
    """Return the demand that a column has values: function generation, velocities.

    Parameters
    ----------
    column
        A coordinate, an output, or a rate: ``"rocker.phi"``, ``"ram.x_dot"``. Angles count modulo
        whole turns.
    values : array_like, shape (K,)
        What is wanted, in the unit of the column.
    times, weight, within, between
        As for `path`, which also says what is refused.
    """
    wanted = _numbers(values, f"the values of {column!r}", 1)[:, np.newaxis]
    name = column_name(column)
    return _passing(name, (name,), wanted, times, np.array([weight]), within, between)


def pose(
    body: str,
    poses: ArrayLike,
    times: ArrayLike | None = None,
    *,
    weight: float = 1.0,
    angle_weight: float = 1.0,
    within: float | None = None,
    between: tuple[float, float] | None = None,
) -> Passing:
    """Return the demand that a body of the plane goes through poses, in their order.

    Parameters
    ----------
    body
        Its name.
    poses : array_like, shape (K, 3)
        x, y [length] and phi [rad].
    angle_weight
        Factor of deviations of the angle beside those of lengths [length/rad].
    times, weight, within, between
        As for `path`, which also says what is refused.
    """
    wanted = _numbers(poses, f"the poses of {body!r}", 2)
    if wanted.shape[1] != 3:
        raise InputError(f"the poses of {body!r} have {wanted.shape[1]} numbers: give x, y, phi")
    names = tuple(f"{letter}_{body}" for letter in ("x", "y", "phi"))
    weights = weight * np.array([1.0, 1.0, angle_weight])
    return _passing(f"poses of {body}", names, wanted, times, weights, within, between)


def time_ratio(
    column: str, ratio: float, *, weight: float = 1.0, within: float = PART
) -> TimeRatio:
    """Return the demand that a column rises for `ratio` times the time in which it falls.

    The times of the model must be one cycle.

    Raises
    ------
    InputError
        If the ratio is no positive number.
    """
    found = _number(ratio, f"the time ratio of {column!r}")
    if not found > 0:
        raise InputError(f"the time ratio of {column!r} is {found:g}: give a positive number")
    if not (weight > 0 and within > 0):
        raise InputError(f"the time ratio of {column!r} has weight and within: {POSITIVE}")
    return TimeRatio(column_name(column), found, float(weight), float(within))


def straight(
    point: str,
    between: tuple[float, float],
    *,
    line: ArrayLike | None = None,
    weight: float = 1.0,
    within: float,
) -> Shaped:
    """Return the demand that the path of a point in the plane is straight, as `sol.straightness`.

    Parameters
    ----------
    point
        Name of a point, ``"P"``, or of a body, whose origin is meant.
    between
        The first and the last time; 25 equally spaced times are looked at.
    line : array_like, shape (2, 2), optional
        Two places on the line [length]; without, it may lie anywhere.
    weight
        Factor of its deviations, among other targets.
    within
        Distance from the line that counts as reached [length].

    Raises
    ------
    InputError
        If numbers are missing or not finite, or the times are in the wrong order.
    """
    ends = None if line is None else _numbers(line, f"the line of {point!r}", 2)
    if ends is not None and (ends.shape != (2, 2) or (ends[0] == ends[1]).all()):
        raise InputError(f"the line of {point!r} has no direction: give two places (x, y) on it")
    names = (f"x_{point}", f"y_{point}")
    title = f"straightness of {point}"
    return _shaped(title, names, nearest_line, ends, between, weight, within)


def circular(
    point: str,
    between: tuple[float, float],
    *,
    circle: ArrayLike | None = None,
    weight: float = 1.0,
    within: float,
) -> Shaped:
    """Return the demand that the path of a point in the plane is a part of a circle.

    Parameters
    ----------
    circle : array_like, shape (3,), optional
        x and y of its centre and its radius [length]; without, it may be any.
    point, between, weight, within
        As for `straight`, which also says what is refused.
    """
    given = None if circle is None else _numbers(circle, f"the circle of {point!r}", 1)
    if given is not None and (given.size != 3 or not given[2] > 0):
        raise InputError(f"the circle of {point!r} needs x, y of its centre and a positive radius")
    names = (f"x_{point}", f"y_{point}")
    title = f"roundness of {point}"
    return _shaped(title, names, nearest_circle, given, between, weight, within)


def dwell(
    column: str,
    between: tuple[float, float],
    *,
    at: float | None = None,
    weight: float = 1.0,
    within: float,
) -> Shaped:
    """Return the demand that a column rests from one time to another.

    Parameters
    ----------
    column
        A coordinate, an output, or a rate.
    at
        Where, in its unit; without, anywhere.
    between, weight, within
        As for `straight`, which also says what is refused.
    """
    level = None if at is None else _number(at, f"the dwell of {column!r}")
    title, names = f"dwell of {column}", (column_name(column),)
    return _shaped(title, names, nearest_level, level, between, weight, within)


def limit(what: Any, least: Any = -math.inf, most: Any = math.inf, *, title: str = "") -> Limit:
    """Return the demand that something stays between two values at all times of the model.

    Parameters
    ----------
    what
        A column, or an expression of parameters, coordinates and points: ``kc.outputs`` has the
        transmission angle, ``b / a`` is a ratio of lengths.
    least, most
        Limits, in its unit; one of them may be left out.
    title
        What it is called in reports.

    Raises
    ------
    InputError
        If there is no limit, or they are in the wrong order.
    """
    about = title or str(what)
    low, high = (
        item if isinstance(item, float) and math.isinf(item) else _number(item, f"limit of {about}")
        for item in (least, most)
    )
    if not low < high or low == math.inf or high == -math.inf:
        raise InputError(
            f"{about} is to stay between {low:g} and {high:g}: give the least value first"
        )
    if math.isinf(low) and math.isinf(high):
        raise InputError(f"{about} has no limit: give least, most or both")
    if not isinstance(what, sympy.Expr):
        what = column_name(str(what))
    return Limit(what, low, high, about)


def grashof(type: str, link: str | None = None, *, margin: float = 0.0) -> Grashof:  # noqa: A002
    """Return the demand that a four-bar of the model is of a type, by Grashof's rule.

    Parameters
    ----------
    type
        ``"crank-rocker"``, ``"rocker-crank"``, ``"double-crank"``, ``"double-rocker"`` or
        ``"triple-rocker"``. The link on the ground that is driven is the crank.
    link
        A link that it has; a model with one four-bar needs none.
    margin
        By how much p + q is to be above s + l at least [length]; of a triple-rocker, how large at
        least the product of the three differences of pairs, by the square of all lengths.

    Raises
    ------
    InputError
        If there is no such type, or the margin is negative.
    """
    if type not in (*ROLES, TRIPLE):
        near = suggestion(type, (*ROLES, TRIPLE)) or "."
        raise InputError(
            f"there is no type {shown(type)} of a four-bar{near} There are "
            f"{listed((*ROLES, TRIPLE))}."
        )
    least = _number(margin, "the margin of Grashof's rule")
    if least < 0:
        raise InputError(f"the margin of Grashof's rule is {least:g}: give zero or more")
    return Grashof(type, link, least)


def moves() -> Moves:
    """Return the demand that the mechanism moves through all times of the model: a full turn."""
    return Moves()


def _shaped(
    title: str,
    columns: tuple[str, ...],
    nearest: Callable[[Array, Any], Nearest],
    given: Any,
    between: tuple[float, float],
    weight: float,
    within: float,
) -> Shaped:
    """Return a demand over a part of the motion, checked."""
    ends = _numbers(between, f"the times of {title}", 1)
    if ends.size != 2 or not ends[0] < ends[1]:
        raise InputError(
            f"{title} is asked for between {shown(between)}: give the first time first"
        )
    if not (weight > 0 and within > 0):
        raise InputError(f"{title} has weight and within: {POSITIVE}")
    times = np.linspace(ends[0], ends[1], PLACES)
    return Shaped(title, columns, nearest, given, times, float(weight), float(within))


def _passing(
    title: str,
    columns: tuple[str, ...],
    values: Array,
    times: ArrayLike | None,
    weights: Array,
    within: float | None,
    between: tuple[float, float] | None,
) -> Passing:
    """Return a demand, checked."""
    problems = []
    at = None if times is None else _numbers(times, f"the times of {title}", 1)
    if at is not None and len(at) != len(values):
        problems.append(f"{title} has {len(values)} values and {len(at)} times: give one for each")
    elif at is not None and not (np.diff(at) > 0).all():
        problems.append(f"the times of {title} do not rise: give them in their order, each once")
    if not (np.isfinite(weights).all() and (weights > 0).all()):
        problems.append(f"{title} has the weight {weights.min():g}: give a positive number")
    if within is not None and not within > 0:
        problems.append(f"{title} is to be within {within:g}: give a positive number")
    if between is not None and not between[0] < between[1]:
        problems.append(
            f"{title} is to happen between {between[0]:g} and {between[1]:g}: give the first time "
            "first"
        )
    if problems:
        raise InputError(problems)
    if within is None:
        sizes = np.ptp(values, axis=0)
        sizes = np.where(sizes > 0, sizes, sizes.max() or np.abs(values).max() or 1.0)
        within = PART * float((weights * sizes).max())
    return Passing(title, columns, values, at, weights, float(within), between)


def _numbers(given: ArrayLike, what: str, dimensions: int) -> Array:
    """Return finite numbers, of one or two dimensions."""
    try:
        rows: Any = given
        if dimensions == 1:
            found = np.array([_number(item, what) for item in rows])
        else:
            found = np.array([[_number(item, what) for item in row] for row in rows])
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{what} are {shown(given)}: give a list of numbers for each") from None
    if found.ndim != dimensions or not 0 < len(found) <= MOST_POINTS:
        raise InputError(f"{what} are {len(found)}: give 1 to {MOST_POINTS}, all of one length")
    if dimensions == 2 and found.shape[1] not in (2, 3):
        raise InputError(f"{what} have {found.shape[1]} coordinates: give 2, in space 3")
    return found


def _number(given: Any, what: str) -> float:
    """Return a finite number; an expression such as 30*kc.deg is one."""
    if isinstance(given, sympy.Expr):
        given = number_in(given, "rad", {})
    try:
        found = float(given)
    except (TypeError, ValueError):
        found = math.nan
    if not math.isfinite(found):
        raise InputError(f"{what}: {shown(given)} is not a finite number")
    return found
