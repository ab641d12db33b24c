"""What people write a motion with: `kc.motion.sequence`, `.table`, `.law`; and cams for it.

A motion is a SymPy expression, for the value of a driver, an equation or the law of a cam.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.errors import ModelError
from kincompile.model.cam_profile import flat_cam, oscillating_cam, roller_cam
from kincompile.model.expressions import (
    NotAnExpressionError,
    as_expression,
    as_sympy,
    in_radians,
    t,
)
from kincompile.model.laws import RISES, Rise, TableLaw, constant_velocity
from kincompile.model.piecewise import number_text
from kincompile.model.spline import fit_between
from kincompile.names import listed, suggestion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.expressions import Scalar

__all__ = ["flat_cam", "law", "oscillating_cam", "roller_cam", "sequence", "table"]

MOST_STEPS = 500
"""Points of a sequence, each a part of the formula that is differentiated."""

SHORTEST = 1e-12
"""Part of all times up to which one is as good as that before it."""

RAMP = sympy.Rational(1, 4)
"""Default share of a rise that each ramp of the law "constant velocity" takes."""


def law(title: str) -> type[Rise]:
    """Return a normalised law s(u), a SymPy function that rises from 0 to 1 while u does.

    Parameters
    ----------
    title
        ``"polynomial 3-4-5"``, ``"polynomial 4-5-6-7"``, ``"cycloidal"``, ``"simple harmonic"``,
        ``"modified sine"``, ``"modified trapezoid"``, ``"constant velocity"``, a function of u and
        of the share of its ramps, or ``"linear"``, which has corners.

    Raises
    ------
    ModelError
        If there is no such law.
    """
    problem = _law_problem(title)
    if problem:
        raise ModelError(problem)
    return RISES[title]


def sequence(
    points: Sequence[tuple[Scalar, Scalar]],
    law: str | Sequence[str] = "modified sine",
    *,
    ramp: Scalar = RAMP,
) -> sympy.Expr:
    """Return a motion that rests at given values and goes from one to the next by a law.

    Parameters
    ----------
    points
        Pairs (time, value), in order of rising time: numbers, or expressions of parameters. Two
        equal values in turn are a dwell. Before the first and after the last the value is held.
    law
        The law of all motions, or a list with one for each step from point to point.
    ramp
        Of the law "constant velocity": the share of a step that is spent accelerating, and again
        decelerating, up to 1/2.

    Returns
    -------
    sympy.Expr
        An expression of `t`; ``.subs(kc.t, ...)`` makes it one of an angle.

    Raises
    ------
    ModelError
        With everything that is wrong with the points and the laws.
    """
    problems: list[str] = []
    rows = _rows(points, problems)
    laws = _laws(law, len(rows) - 1, problems)
    share = _number(ramp, "ramp", problems)
    if share.is_number and not 0 < share <= sympy.S.Half:
        problems.append(f"ramp is {share}: each of the two ramps takes more than 0, up to 1/2")
    _check_times([time for time, _ in rows], problems)
    if len(rows) > MOST_STEPS:
        problems.append(f"{len(rows)} points are more than {MOST_STEPS}: a table goes through them")
    if len(rows) < 2 and not problems:
        problems.append(f"a sequence needs two points (time, value) or more, not {len(rows)}")
    if problems:
        raise ModelError([f"motion sequence: {problem}" for problem in problems])
    moves = []
    for (begin, start), (end, stop), rise in zip(rows, rows[1:], laws, strict=False):
        shape = (share,) if rise is constant_velocity else ()
        if in_radians(stop - start) != 0:
            moves.append((stop - start) * rise((t - begin) / (end - begin), *shape))
    return sympy.Add(rows[0][1], *moves)


def table(
    times: Sequence[float], values: Sequence[float], *, velocities: Sequence[float] = (0, 0)
) -> sympy.Expr:
    """Return a motion through a table of values: a quintic spline, with four smooth derivatives.

    Parameters
    ----------
    times, values
        Rising times and the value at each, three rows or more, numbers.
    velocities
        At the first time and at the last; before and after these the motion keeps them, without
        acceleration. By default it begins and ends at rest.

    Raises
    ------
    ModelError
        With everything that is wrong with the table.
    """
    problems: list[str] = []
    columns = [
        tuple(
            float(_constant(item, f"{name}, entry {k}", problems))
            for k, item in enumerate(_items(given, name, problems), 1)
        )
        for name, given in (("times", times), ("values", values), ("velocities", velocities))
    ]
    rows, ends = columns[0], columns[2]
    if len(rows) != len(columns[1]):
        problems.append(f"there are {len(rows)} times and {len(columns[1])} values")
    if len(rows) < 3:
        problems.append(
            f"a table of {len(rows)} rows is no curve; give three rows or more, or take a "
            "sequence with a law"
        )
    if len(ends) != 2:
        problems.append(f"velocities are two, at the first time and at the last, not {len(ends)}")
    _check_times([sympy.Float(time) for time in rows], problems)
    if problems:
        raise ModelError([f"motion table: {problem}" for problem in problems])
    spline = fit_between(*columns)
    motion: sympy.Expr = TableLaw.of(tuple(columns), spline, "motion_table")(t)
    return motion


def _items(given: Any, what: str, problems: list[str]) -> list[Any]:
    if isinstance(given, list | tuple | np.ndarray):
        return list(given)
    problems.append(f"{what}: {given!r} is not a list")
    return []


def _rows(points: Any, problems: list[str]) -> list[tuple[sympy.Expr, sympy.Expr]]:
    rows = []
    for k, point in enumerate(_items(points, "points", problems), 1):
        if not isinstance(point, list | tuple | np.ndarray) or len(point) != 2:
            problems.append(f"point {k}, {point!r}, is not a pair (time, value)")
            continue
        time, value = (_number(item, f"point {k}", problems) for item in point)
        rows.append((time, value))
    return rows


def _number(given: Any, where: str, problems: list[str]) -> sympy.Expr:
    try:
        return as_sympy(as_expression(given))
    except NotAnExpressionError as error:
        problems.append(f"{where}: {error}; give a number or an expression of parameters")
        return sympy.S.Zero


def _constant(given: Any, where: str, problems: list[str]) -> sympy.Expr:
    value = _number(given, where, problems).evalf()
    if value.is_Number:
        return value
    problems.append(f"{where}: {given} is not a number, and a table holds numbers")
    return sympy.S.Zero


def _laws(given: Any, steps: int, problems: list[str]) -> list[type[Rise]]:
    if isinstance(given, str):
        titles = [given] * max(steps, 1)
    else:
        before = len(problems)
        titles = _items(given, "law", problems)
        if len(titles) != steps and len(problems) == before:
            problems.append(f"there are {len(titles)} laws for {steps} steps from point to point")
    wrong = list(dict.fromkeys(filter(None, map(_law_problem, titles))))
    problems += wrong
    return [] if wrong else [RISES[title] for title in titles]


def _law_problem(title: Any) -> str | None:
    if isinstance(title, str) and title in RISES:
        return None
    near = suggestion(title, RISES) if isinstance(title, str) else ""
    return f"there is no law {title!r}{near}; laws are: {listed(RISES)}"


def _check_times(times: Sequence[sympy.Expr], problems: list[str]) -> None:
    span = times[-1] - times[0] if times else sympy.S.Zero
    least = SHORTEST * span if span.is_number and span > 0 else 0
    for before, after in pairwise(times):
        step = after - before
        if step.is_number and not step > least:
            late, early = number_text(after), number_text(before)
            problems.append(f"times must rise, but {late} follows {early}")


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """Say how a law of motion is called; they are texts, in files too."""
    hint = f": write kc.motion.law({name!r})" if name in RISES else suggestion(name, __all__)
    raise AttributeError(f"kc.motion has no {name!r}{hint}")
