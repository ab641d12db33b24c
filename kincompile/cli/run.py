"""`kincompile run`: the motion of a model over time, summarised and written."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

import kincompile as kc
from kincompile.cli import shared
from kincompile.cli.motion import Motion, motion_options, sweep_options
from kincompile.cli.progress import progress_bar
from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.runtime.results.columns import shown_unit
from kincompile.runtime.results.write import require_known_suffix, summary, variant_named

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    import numpy as np
    from numpy.typing import NDArray

MOST_REASONS = 3
"""Variants of a sweep that are solved alone, to say why they ended."""


_PART = "the path of a point is, from one time to another."


@click.command("run")
@click.argument("model")
@motion_options
@sweep_options
@click.option("--analysis", metavar="FILE", help="Take end and points from an .acf file.")
@shared.deg_option("Show and write angles in degrees.")
@click.option("--forces", "has_forces", is_flag=True, help="Reactions and drivers' torques too.")
@click.option(
    "--straight", "lines", metavar="P[=FROM:TO]", multiple=True, help=f"How straight {_PART}"
)
@click.option(
    "--circle", "circles", metavar="P[=FROM:TO]", multiple=True, help=f"How round {_PART}"
)
@click.option(
    "--dwell",
    "dwells",
    metavar="NAME=TOL",
    multiple=True,
    help="How long a column stays within TOL of its greatest and its least value.",
)
@shared.output_option("Write the motion: .csv, .npz or .json.", required=False)
@shared.verbose_option
@click.pass_context
def command(
    context: click.Context,
    model: str,
    motion: Motion,
    sweeps: dict[str, NDArray[np.float64]],
    product: bool,
    analysis: str | None,
    angle_unit: str,
    has_forces: bool,
    output: str | None,
    lines: tuple[str, ...],
    circles: tuple[str, ...],
    dwells: tuple[str, ...],
    verbose: bool,
) -> None:
    """Solve the motion of MODEL over time and summarise it.

    Position, velocity and acceleration are solved at equally spaced times, from start to end. The
    summary goes to stdout, or to stderr where a file is written. With --sweep it has a line for
    each parameter set, and a file their values; with --forces both have forces too. Where the
    motion does not converge, what was found is written nevertheless, and the exit code is 3.
    """
    if output is not None:
        require_known_suffix(output)
        shared.require_output(output, model, "the model itself")
    mechanism = shared.read_drawn(model, [*motion.names, *sweeps])
    if analysis is not None:
        settings = kc.read_analysis(analysis)
        motion = replace(
            motion,
            end=settings.end if motion.end is None else motion.end,
            points=settings.points if motion.points is None else motion.points,
        )
    numbers = motion.numbers(mechanism)
    if twice := numbers.keys() & sweeps.keys():
        raise InputError(f"--set and --sweep both name {listed(sorted(twice))}: give one of them")
    times = motion.times(mechanism, numbers)
    module = kc.compile(mechanism)
    with progress_bar() as progress:
        options: dict[str, Any] = {"through": motion.through, "assembly": motion.assembly}
        solution = kc.solve(
            module, times, numbers | sweeps, product=product, progress=progress, **options
        )
        say = partial(shared.reasons_of, angle_unit=angle_unit, is_whole=verbose, between=" ")
        reasons = _reasons(solution, module, times, options, say) if sweeps else ""
    text = "\n\n".join(
        (summary(solution, angle_unit), *_answers(solution, angle_unit, lines, circles, dwells))
    )
    given = text, output, angle_unit, has_forces, reasons
    shared.give_motion(context, solution, *given, is_whole=verbose)


def _answers(
    solution: kc.Solution,
    angle_unit: str,
    lines: tuple[str, ...],
    circles: tuple[str, ...],
    dwells: tuple[str, ...],
) -> list[str]:
    """Return a sentence for each path and each dwell that is asked for."""
    found = []
    for kind, measure, given in (
        ("straight", solution.straightness, lines),
        ("circle", solution.roundness, circles),
    ):
        for text in given:
            point, is_part, part = text.partition("=")
            found.append(f"{measure(point, _numbers(kind, text, part, 2) if is_part else None)}")
    for text in dwells:
        name, _, part = text.partition("=")
        factor = shown_unit(solution.column(name).unit, angle_unit)[1]
        (within,) = _numbers("dwell", text, part, 1)
        found += [
            solution.dwell(name, within / factor, at).text(angle_unit) for at in ("max", "min")
        ]
    return ["\n".join(found)] if found else []


def _numbers(option: str, text: str, part: str, count: int) -> list[float]:
    """Return numbers that an option has, between colons."""
    try:
        found = [float(item) for item in part.split(":")]
    except ValueError:
        found = []
    if len(found) != count:
        form = "P=FROM:TO, as P=0.2:0.7" if count == 2 else "NAME=TOL, as ram.x=0.5"
        raise InputError(f"--{option} {text}: give it as {form}.")
    return found


def _reasons(
    solution: kc.Solution,
    module: ModuleType,
    times: NDArray[np.float64],
    options: dict[str, Any],
    say: Callable[[kc.Solution], str],
) -> str:
    """Return why variants ended: the first ones, each solved alone."""
    failed = [k for k, found in enumerate(solution.good) if not found.all()]
    lines = [f"{len(failed)} of {len(solution.q)} variants ended before the last time."]
    for number in failed[:MOST_REASONS]:
        own = {name: float(values[number]) for name, values in solution.parameters.items()}
        alone = kc.solve(module, times, own, **options)
        lines.append(f"{variant_named(solution, number)}: {say(alone)}")
    if len(failed) > MOST_REASONS:
        lines.append(f"{len(failed) - MOST_REASONS} more: solve one alone by --set to see why.")
    return "\n".join(lines)
