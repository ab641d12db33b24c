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

    from kincompile.cli.shared import Command
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


def time_options(command: Command) -> Command:
    """Add the options of times, and of values of parameters."""
    return _with(
        command,
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
        set_option("parameter"),
    )


def motion_options(command: Command) -> Command:
    """Add the options of a motion: its times, and the values of parameters."""
    return time_options(
        _with(
            command,
            click.option(
                "--grid",
                metavar="NAME=FIRST:LAST:STEP",
                help="Times at which a coordinate has these values, as crank.phi=0:360deg:1deg.",
            ),
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
    )


def _with(command: Command, *options: Callable[[Command], Command]) -> Command:
    """Add options in order."""
    for option in reversed(options):
        command = option(command)
    return command


def set_values(
    model: Mechanism | ConstraintSystem, given: Sequence[str], option: str = "--set"
) -> dict[str, float]:
    """Return the numbers of options such as ``--set``, by name."""
    from kincompile.cli import values

    return values.set_values(model, given, option)


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
