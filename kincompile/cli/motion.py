"""The options of a motion: its times, and the values of parameters.

What they say is read by `values`, which needs SymPy: it is loaded when a command is called, and not
for ``--help``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import wraps
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from kincompile.cli.shared import set_option
from kincompile.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kincompile.cli.shared import Command
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


@dataclass(frozen=True, slots=True)
class Motion:
    """What the options of a motion say; those that a command has not are left out."""

    start: str
    end: str | float | None
    points: int | None
    values: tuple[str, ...]
    grid: str | None = None
    through: str | None = None
    assembly: int | None = None

    @property
    def names(self) -> list[str]:
        """The names of what is set."""
        return [item.partition("=")[0].strip() for item in self.values]

    def numbers(self, model: Mechanism | ConstraintSystem) -> dict[str, float]:
        """Return the values of parameters that are set."""
        return set_values(model, self.values)

    def times(
        self, model: Mechanism | ConstraintSystem, numbers: dict[str, float]
    ) -> NDArray[np.float64]:
        """Return the times, shape (N,): equally spaced, or where a coordinate is."""
        from kincompile.cli import values

        times = values.time_grid(model, self.start, self.end, self.points, numbers)
        return (
            times if self.grid is None else values.times_on_grid(model, self.grid, times, numbers)
        )


def _together(command: Command) -> Command:
    """Hand the options of a motion to a command as one, `motion`."""

    @wraps(command)
    def called(*args: Any, **given: Any) -> None:
        own = {item.name: given.pop(item.name) for item in fields(Motion) if item.name in given}
        command(*args, motion=Motion(**own), **given)

    return called


def time_options(command: Command) -> Command:
    """Add the options of times, and of values of parameters."""
    return _with(
        _together(command),
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
        set_option("parameter"),
    )


def motion_options(command: Command, *, has_through: bool = True) -> Command:
    """Add the options of a motion: its times, and the values of parameters."""
    grid = click.option(
        "--grid",
        metavar="NAME=FIRST:LAST:STEP",
        help="Times at which a coordinate has these values, such as crank.phi=0:360deg:1deg.",
    )
    through = click.option(
        "--through",
        type=click.Choice(["smooth"]),
        help="Go on past a bifurcation, along the smooth branch.",
    )
    assembly = click.option(
        "--assembly",
        type=int,
        metavar="N",
        help="Start in the N-th of the ways that `kincompile assemblies` lists.",
    )
    return time_options(_with(command, grid, *((through,) if has_through else ()), assembly))


def _with(command: Command, *options: Callable[[Command], Command]) -> Command:
    """Add options in order."""
    for option in reversed(options):
        command = option(command)
    return command


def sweep_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of parameters that are swept."""
    product = click.option("--product", is_flag=True, help="Solve every combination of the sweeps.")
    sweep = click.option(
        "--sweep",
        "sweeps",
        multiple=True,
        metavar="NAME=FIRST:LAST:COUNT",
        callback=_sweeps,
        help="Solve for COUNT values of a parameter; several sweeps go in pairs.",
    )
    return sweep(product(command))


def _sweeps(
    context: click.Context, option: click.Parameter, given: tuple[str, ...]
) -> dict[str, NDArray[np.float64]]:
    """Return the values of parameters that are swept."""
    del context, option
    values, problems = {}, []
    for sweep in given:
        name, _, span = sweep.partition("=")
        try:
            first, last, count = span.split(":")
            ends, size = (float(first), float(last)), int(count)
        except ValueError:
            ends, size = (math.nan, math.nan), 0
        if size < 1 or not all(map(math.isfinite, ends)):
            problems.append(
                f"--sweep {sweep}: give NAME=FIRST:LAST:COUNT with numbers, such as a=0.2:0.6:5"
            )
        values[name.strip()] = np.linspace(*ends, max(size, 1))
    if problems:
        raise InputError(problems)
    return values


def set_values(
    model: Mechanism | ConstraintSystem, given: Sequence[str], option: str = "--set"
) -> dict[str, float]:
    """Return the numbers of options such as ``--set``, by name."""
    from kincompile.cli import values

    return values.set_values(model, given, option)
