"""The options of a motion: its times, and the values of parameters."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING

import click
import numpy as np

from kincompile.cli.shared import set_option
from kincompile.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


def motion_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a motion: its times, and the values of parameters."""
    options = (
        click.option("--end", type=float, help="Last time.  [default: the model's own]"),
        click.option(
            "--points",
            type=click.IntRange(min=1),
            help="Number of equally spaced times from 0 to the end.  [default: the model's own]",
        ),
        set_option("parameter"),
        click.option(
            "--through",
            type=click.Choice(["smooth"]),
            help="Go on past a bifurcation, along the smooth branch.",
        ),
        click.option(
            "--assembly",
            type=int,
            metavar="N",
            help="Start in the N-th of the ways that `kincompile assemblies` lists.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


def time_grid(
    model: Mechanism | ConstraintSystem, end: float | None, points: int | None
) -> NDArray[np.float64]:
    """Return the time grid: the options before the model's own."""
    try:
        last = float(model.end if end is None else end)
        count = operator.index(model.points if points is None else points)
    except (TypeError, ValueError):
        last, count = math.nan, 0
    if not math.isfinite(last) or count < 1:
        given = f"end = {model.end!r}, points = {model.points!r}" if end is None else f"--end {end}"
        raise InputError(f"{given}: give a finite time, and at least one point")
    if count == 1 and end:
        raise InputError("one point is the time 0 alone: give --points 2 or more to reach the end")
    return np.linspace(0.0, last, count)
