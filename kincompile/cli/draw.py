"""`kincompile draw`: a model at a time, or its motion, as a picture or for CAD."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import kincompile as kc
from kincompile.cli.motion import Motion, motion_options
from kincompile.cli.shared import (
    end_unsolved,
    output_option,
    read_model,
    reasons_of,
    require_output,
    verbose_option,
    warn_of_branch,
)
from kincompile.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

STILL, MOVING = (".svg", ".dxf"), (".svg", ".gif", ".mp4", ".glb")
"""Endings of files that show one time, and of those that show the motion."""


@click.command("draw")
@click.argument("model")
@output_option("File to write: .svg or .dxf; .gif, .mp4 and .glb of a motion.")
@click.option("--time", "at", type=float, metavar="T", help="Draw this time of the motion alone.")
@click.option(
    "--trace",
    multiple=True,
    metavar="NAME",
    help="Draw the path of a point, body or joint.  [default: the model's points]",
)
@click.option("--true-size", is_flag=True, help="Give an .svg of one time the mechanism's size.")
@click.option(
    "--view",
    metavar="NAME",
    help="Show a mechanism in space as an .svg from the front, side or top.  [default: isometric]",
)
@motion_options
@verbose_option
@click.pass_context
def command(
    context: click.Context,
    model: str,
    output: str,
    at: float | None,
    trace: tuple[str, ...],
    true_size: bool,
    view: str | None,
    motion: Motion,
    verbose: bool,
) -> None:
    """Draw MODEL in motion, or at one time, for slides and for CAD.

    An .svg moves, without a script, or with --time stands still. A .dxf has one position, the first
    without --time, in the model's unit, with a layer for each body, the ground, the joints and the
    paths. A .glb (glTF) is a motion in space for programs that show 3-D. Where the motion does not
    converge, what was found is drawn, and the exit code is 3.
    """
    is_still = _is_still(output, at, true_size)
    if view and not (is_still and output.lower().endswith(".svg")):
        raise InputError("--view is for an .svg of one time: give --time T, too")
    require_output(output, model, "the model itself")
    mechanism = read_model(model)
    numbers = motion.numbers(mechanism)
    times = motion.times(mechanism, numbers)
    if at is not None:
        times = _with_time(times, at)
    module = kc.compile(mechanism)
    options: Any = {"through": motion.through, "assembly": motion.assembly}
    solution = kc.solve(module, times, numbers, **options)
    shown = solution.good if at is None else solution.good[times == at]
    if shown.any():
        named = trace or None
        if is_still:
            kc.draw(solution, output, at, trace=named, true_size=true_size, view=view)
        else:
            kc.animate(solution, output, trace=named)
        click.echo(f"Wrote {output}", err=True)
    warn_of_branch(solution.doubt)
    if not solution.success:
        end_unsolved(context, reasons_of(solution, is_whole=verbose))


def _is_still(output: str, at: float | None, true_size: bool) -> bool:
    """Return whether a file shows one time, after checking that it can."""
    ending = Path(output).suffix.lower()
    known = sorted({*STILL, *MOVING}) if at is None else STILL
    if ending not in known:
        when = "" if at is None else " of one time"
        endings = f"{', '.join(known[:-1])} or {known[-1]}"
        raise InputError(f"cannot write {output}{when}: end its name in {endings}")
    is_still = at is not None or ending not in MOVING
    if true_size and not (is_still and ending == ".svg"):
        raise InputError("--true-size is for an .svg of one time: give --time T, too")
    return is_still


def _with_time(times: NDArray[np.float64], at: float) -> NDArray[np.float64]:
    """Return the times of a motion with one among them."""
    first, last = float(times[0]), float(times[-1])
    if not min(first, last) <= at <= max(first, last):
        raise InputError(
            f"--time {at:g}: the motion goes from t = {first:g} to {last:g}; give a time in it, or "
            "another --end"
        )
    every = np.union1d(times, at)
    return every if first <= last else every[::-1]
