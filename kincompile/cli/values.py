"""Numbers and times as people type them behind an option: plain, in degrees, or as a formula.

Commands load this module when they are called: it needs SymPy, and ``--help`` does not.
"""

from __future__ import annotations

import math
import operator
import re
from typing import TYPE_CHECKING

import numpy as np
import sympy

import kincompile as kc
from kincompile.errors import InputError
from kincompile.files.formula_text import ExpressionError
from kincompile.files.safe_expressions import parse_expression
from kincompile.model.bodies import default_values
from kincompile.model.expressions import (
    degrees_problem,
    evaluate,
    number_in,
)
from kincompile.model.sections import MOST_POINTS
from kincompile.names import column_name, rate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


def set_values(
    model: Mechanism | ConstraintSystem, given: Sequence[str], option: str = "--set"
) -> dict[str, float]:
    """Return the numbers that are set, angles in radians; the last counts of a name set twice.

    Names are those of parameters or of columns, ``crank.phi`` or ``crank.phi_dot``. One message
    lists every value that is not a number.
    """
    units: dict[str, str] = {item.name: str(item.unit) for item in model.parameters}
    pairs = [item.partition("=")[::2] for item in given]
    assignments = [(name.strip(), text) for name, text in pairs]
    if any("deg" in text for name, text in assignments if name not in units):
        units |= {item.name: item.unit for item in model.system().coordinates}
    values: dict[str, float] = {}
    problems: list[str] = []
    for item, (name, text) in zip(given, assignments, strict=True):
        what = f"{option} {item}: give NAME=VALUE with a number"
        try:
            column = column_name(name).removesuffix(rate(""))
            values[name] = number(text, what, {}, units.get(name, units.get(column, "")))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return values


def number(text: str, what: str, names: Mapping[str, float], unit: str = "") -> float:
    """Return the number that a text is: plain, in degrees, or a formula of names.

    As ``0.25``, ``30deg``, ``pi/6`` or ``60/n``; `what` says for messages which option it is, and
    what is expected. Degrees become radians where `unit` is not that of degrees itself.
    """
    try:
        return float(text)
    except ValueError:
        pass
    written = re.sub(r"(?<=[0-9.])\s*deg\b", "*deg", text)
    try:
        value = parse_expression(written, {name: sympy.Symbol(name) for name in names})
    except ExpressionError as error:
        raise InputError(f"{what}, such as 0.25 or 30deg: {error.problem}") from None
    problem = degrees_problem(value, unit)
    found = number_in(value, unit, dict(names))
    if problem is None and found is not None:
        return found
    raise InputError(f"{what}; {problem or 'this is not a finite number'}")


def time_grid(
    model: Mechanism | ConstraintSystem,
    start: str,
    end: str | float | None,
    points: int | None,
    values: dict[str, float],
) -> NDArray[np.float64]:
    """Return equally spaced times: the options before the model's own."""
    names = default_values(model.parameters) | values
    first, last = number(start, f"--start {start}: give a time", names), _last(model, end, names)
    try:
        count = operator.index(model.points if points is None else points)
    except TypeError:
        count = 0
    if not (math.isfinite(first) and math.isfinite(last)) or count < 1:
        own = f"end = {model.end_given!r}, points = {model.points!r}"
        given = own if end is None else f"--end {end}"
        given = given if math.isfinite(first) else f"--start {start}"
        raise InputError(f"{given}: give a finite time, and at least one point")
    if count == 1 and end:
        alone = f"one point is the time {first:g} alone"
        raise InputError(f"{alone}: give --points 2 or more to reach the end")
    return np.linspace(first, last, count)


def _last(
    model: Mechanism | ConstraintSystem, end: str | float | None, names: dict[str, float]
) -> float:
    """Return the last time, NaN if it is not a number."""
    if isinstance(end, str):
        return number(end, f"--end {end}: give a time", names)
    given = model.end_given if end is None else end
    try:
        found = evaluate(given, names) if isinstance(given, sympy.Expr) else float(given)
    except (TypeError, ValueError):
        return math.nan
    return math.nan if found is None else found


def times_on_grid(
    model: Mechanism | ConstraintSystem,
    grid: str,
    times: NDArray[np.float64],
    values: dict[str, float],
) -> NDArray[np.float64]:
    """Return the times at which a coordinate has equally spaced values, NAME=FIRST:LAST:STEP."""
    module = kc.compile(model)
    name, _, text = grid.partition("=")
    parts = text.split(":")
    if len(parts) != 3:
        raise InputError(f"--grid {grid}: write NAME=FIRST:LAST:STEP, as crank.phi=0:360deg:1deg")
    unit = module.UNITS.get(column_name(name), "")
    names = default_values(model.parameters) | values
    what = f"--grid {grid}: give numbers"
    first, last, step = (number(part, what, names, unit) for part in parts)
    count = (last - first) / step if step else -1.0
    if not 0 <= count < MOST_POINTS:
        raise InputError(f"--grid {grid}: give a step that leads from the first value to the last")
    # The last value counts where the steps lead to it but for rounding.
    steps = np.arange(math.floor(count * (1 + 1e-12) + 1e-9) + 1)
    found: NDArray[np.float64] = kc.times_at(module, name, first + step * steps, times, values)
    return found
