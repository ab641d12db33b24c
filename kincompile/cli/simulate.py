"""`kincompile simulate`: the motion of a model that follows from its masses and forces."""

from __future__ import annotations

import click

import kincompile as kc
from kincompile.cli import shared
from kincompile.cli.motion import Motion, set_values, time_options
from kincompile.cli.progress import progress_bar
from kincompile.criteria import STEP_TOLERANCE
from kincompile.errors import InputError
from kincompile.runtime.dynamics.integrate import METHODS
from kincompile.runtime.results.write import require_known_suffix, summary


@click.command("simulate")
@click.argument("model")
@time_options
@click.option(
    "--position",
    "positions",
    multiple=True,
    metavar="NAME=VALUE",
    help="A coordinate at the start, held exactly, such as crank.phi=30deg.",
)
@click.option(
    "--velocity",
    "velocities",
    multiple=True,
    metavar="NAME=VALUE",
    help="A velocity at the start, such as crank.phi_dot=2.",
)
@click.option(
    "--stop",
    "stops",
    multiple=True,
    metavar="NAME=VALUE",
    help="End where a coordinate or output has this value; a name may have several.",
)
@click.option("--method", type=click.Choice(METHODS), default="DOP853", help="The integrator.")
@click.option("--rtol", type=float, default=STEP_TOLERANCE, help="Relative tolerance of a step.")
@click.option("--through", type=click.Choice(["smooth"]), help="Go on past singular positions.")
@shared.deg_option("Show and write angles in degrees.")
@click.option("--forces", "has_forces", is_flag=True, help="Reactions and drivers' torques too.")
@shared.output_option("Write the motion: .csv, .npz or .json.", required=False)
@click.pass_context
def command(
    context: click.Context,
    model: str,
    motion: Motion,
    positions: tuple[str, ...],
    velocities: tuple[str, ...],
    stops: tuple[str, ...],
    method: str,
    rtol: float,
    angle_unit: str,
    has_forces: bool,
    output: str | None,
) -> None:
    """Simulate MODEL: the motion that follows from its masses and forces.

    Without --position and --velocity it begins at the guess, at rest. The summary goes to stdout,
    or to stderr where a file is written. Where the motion cannot go on, what was found is written
    nevertheless, and the exit code is 3.
    """  # fmt: skip
    if output is not None:
        require_known_suffix(output)
        shared.require_output(output, model, "the model itself")
    mechanism = shared.read_model(model)
    numbers = motion.numbers(mechanism)
    times = motion.times(mechanism, numbers)
    if times.size < 2:
        raise InputError("a simulation takes time: give --end and --points of at least 2.")
    limits: dict[str, list[float]] = {}
    for text in stops:
        for name, value in set_values(mechanism, [text], "--stop").items():
            limits.setdefault(name, []).append(value)
    module = kc.compile(mechanism)
    with progress_bar() as progress:
        solution = kc.simulate(
            module,
            times,
            numbers,
            position=set_values(mechanism, positions, "--position"),
            velocity=set_values(mechanism, velocities, "--velocity"),
            stops=limits,
            method=method,
            rtol=rtol,
            through=motion.through,
            progress=progress,
        )
    said = shared.shown_angles(solution.message, angle_unit)
    text = f"{summary(solution, angle_unit)}\n{said}"
    shared.give_motion(context, solution, text, output, angle_unit, has_forces)
