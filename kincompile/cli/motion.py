"""The options of a motion: its times, and the values of parameters.

What they say is read by `values`, which needs SymPy: it is loaded when a command is called, and not
for ``--help``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from kincompile.cli.shared import set_option

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


def motion_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a motion: its times, and the values of parameters."""
    options = (
        click.option("--start", default="0", metavar="T", help="First time."),
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


def set_values(model: Mechanism | ConstraintSystem, given: Sequence[str]) -> dict[str, float]:
    """Return the numbers of the options ``--set``, by name."""
    from kincompile.cli import values

    return values.set_values(model, given)


def motion_times(
    model: Mechanism | ConstraintSystem,
    start: str,
    end: str | float | None,
    points: int | None,
    grid: str | None,
    numbers: dict[str, float],
) -> NDArray[np.float64]:
    """Return the times of a motion, shape (N,): equally spaced, or where a coordinate is."""
    from kincompile.cli import values

    times = values.time_grid(model, start, end, points, numbers)
    return times if grid is None else values.times_on_grid(model, grid, times, numbers)
