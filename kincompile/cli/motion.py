"""The options of a motion: its times, and the values of parameters."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING

import click
import numpy as np
import sympy

import kincompile as kc
from kincompile.cli.shared import number, set_option
from kincompile.errors import InputError
from kincompile.files.file_format import MOST_POINTS
from kincompile.model.expressions import as_expression, evaluate, number_in
from kincompile.names import column_name

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


def motion_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a motion: its times, and the values of parameters."""
    options = (
        click.option("--start", default="0", metavar="T", help="First time.  [default: 0]"),
        click.option(
            "--end",
            metavar="T",
            help="Last time, such as 2 or 60/n with a parameter n.  [default: the model's own]",
        ),
        click.option(
            "--points",
            type=click.IntRange(min=1),
            help="Number of equally spaced times from start to end.  [default: the model's own]",
        ),
        click.option(
            "--grid",
            metavar="NAME=FIRST:LAST:STEP",
            help="Times at which a coordinate has these values, such as crank.phi=0:360deg:1deg.",
        ),
        set_option("parameter"),
        click.option(
            "--through",
            type=click.Choice(["smooth"]),
            help="Go on past a bifurcation, along the smooth branch.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


def time_grid(
    model: Mechanism | ConstraintSystem,
    start: str,
    end: str | float | None,
    points: int | None,
    values: dict[str, float],
) -> NDArray[np.float64]:
    """Return equally spaced times: the options before the model's own.

    Raises
    ------
    InputError
        If a time is no finite number at the values of the parameters, or there is no point.
    """
    names = _numbers_of(model) | values
    first, last = number(start, f"--start {start}", names), _last(model, end, names)
    try:
        count = operator.index(model.points if points is None else points)
    except TypeError:
        count = 0
    if not math.isfinite(last) or count < 1:
        given = f"end = {model.end!r}, points = {model.points!r}" if end is None else f"--end {end}"
        raise InputError(f"{given}: give a finite time, and at least one point")
    if count == 1 and end:
        raise InputError("one point is the start alone: give --points 2 or more to reach the end")
    return np.linspace(first, last, count)


def _numbers_of(model: Mechanism | ConstraintSystem) -> dict[str, float]:
    """Return the default parameters of a model, which need not have been checked."""
    found = {
        item.name: number_in(as_expression(item.default), str(item.unit), {})
        for item in model.parameters
        if isinstance(item.default, float | int | sympy.Expr)
    }
    return {name: value for name, value in found.items() if value is not None}


def _last(
    model: Mechanism | ConstraintSystem, end: str | float | None, names: dict[str, float]
) -> float:
    """Return the last time, NaN where it is none."""
    if isinstance(end, str):
        return number(end, f"--end {end}", names)
    given = getattr(model, "end_given", model.end) if end is None else end
    try:
        found = evaluate(given, names) if isinstance(given, sympy.Expr) else float(given)
    except (TypeError, ValueError):
        return math.nan
    return math.nan if found is None else found


def times_on_grid(
    model: Mechanism | ConstraintSystem,
    module: ModuleType,
    grid: str,
    times: NDArray[np.float64],
    values: dict[str, float],
) -> NDArray[np.float64]:
    """Return the times at which a coordinate has equally spaced values.

    Raises
    ------
    InputError
        If the grid is not written as NAME=FIRST:LAST:STEP, or the motion does not reach it.
    """
    name, _, text = grid.partition("=")
    parts = text.split(":")
    if len(parts) != 3:
        raise InputError(f"--grid {grid}: write NAME=FIRST:LAST:STEP, as crank.phi=0:360deg:1deg")
    unit = module.UNITS.get(column_name(name), "")
    names = _numbers_of(model) | values
    first, last, step = (number(part, f"--grid {grid}", names, unit) for part in parts)
    count = (last - first) / step if step else -1.0
    if not 0 <= count < MOST_POINTS:
        raise InputError(f"--grid {grid}: give a step that leads from the first value to the last")
    # The last value counts where the steps lead to it but for rounding.
    steps = np.arange(math.floor(count * (1 + 1e-12) + 1e-9) + 1)
    found: NDArray[np.float64] = kc.times_at(module, name, first + step * steps, times, values)
    return found
