"""`kincompile compile`: a model as source files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import kincompile as kc
from kincompile.cli.shared import (
    output_option,
    print_data,
    read_model,
    require_output,
    transmission_option,
)
from kincompile.emitters.registry import PACKAGES, TARGETS
from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.writing import require_writable

if TYPE_CHECKING:
    from kincompile.cli.shared import Ends
    from kincompile.emitters.target import Emitted

ENDINGS = {ending: name for name, item in TARGETS.items() for ending in item.endings}
ENDINGS |= {item.ending: name for name, item in PACKAGES.items()}
"""The target whose files have an ending."""


@click.command("compile")
@click.argument("model")
@output_option("File to write, or a folder, or - for stdout.")
@click.option(
    "--target",
    default="numpy",
    metavar="NAME",
    help=f"What to emit: {listed([*TARGETS, *PACKAGES])}.",
)
@click.option("--dynamics", is_flag=True, help="The accelerations that follow from forces too.")
@transmission_option("The mechanism as a function")
@click.option(
    "--real", default="float64", metavar="NAME", help="Numbers: float64, or float32 with one point."
)
@click.option(
    "--points", default="many", metavar="HOW", help="many, or one at a time for a controller, in C."
)
def command(
    model: str,
    output: str,
    target: str,
    dynamics: bool,
    transmission: Ends | None,
    real: str,
    points: str,
) -> None:
    """Write Phi, Phi_q, nu and gamma of MODEL as a module.

    The module imports NumPy and nothing else: it runs where kincompile is not installed. Where a
    target has several files, the others are written beside the one named. A model whose motion
    cannot be solved, because a driver is missing, has a module too, and a warning; with --dynamics
    it has the right side for an integrator, accelerations(q, q_dot, t, p). With --transmission the
    file is a function from inputs, drivers or coordinates, to outputs, with its Jacobian. The
    target fmi is a unit for co-simulation, FMI 3.0: an archive of C files and a library of them.
    For a controller --target c --points one goes from one time to the next, from a state that the
    caller keeps; how large that is is printed.
    """
    emitted = kc.emit(
        read_model(model),
        target,
        dynamics=dynamics,
        transmission=transmission,
        real=real,
        points=points,
    )
    if emitted.unsolvable and not dynamics:
        click.echo(f"Warning: {emitted.unsolvable}", err=True)
    if output == "-" and target in PACKAGES:
        raise InputError(f"{emitted.main} is an archive, which is not text: give -o a file")
    if output == "-":
        print_data("\n".join(emitted.files.values()))
        return
    folder, main = _destination(output, emitted, target)
    for path in (folder / name for name in (main, *emitted.companions)):
        if path.parent.exists():
            require_output(path, model, "the model itself")
    for path in emitted.write(folder, main):
        click.echo(f"Wrote {path}", err=True)
    if emitted.needs:
        click.echo(emitted.needs, err=True)


def _destination(output: str, emitted: Emitted, target: str) -> tuple[Path, str]:
    """Return the folder to write to, and the name there of the main file."""
    path = Path(output)
    usual = emitted.main
    is_device = path.exists() and not path.is_file()
    if path.is_dir() or not (path.suffix or is_device):
        return path, usual
    other = ENDINGS.get(path.suffix, target)
    if other != target:
        raise InputError(
            f"{path} is the name of a file for {other}, and the target is {target}; "
            f"give --target {other}, or end the name as {usual}"
        )
    beside = {Path(name).suffix for name in emitted.companions} - {Path(usual).suffix}
    if path.name in emitted.companions or path.suffix in beside:
        raise InputError(f"{path} is the name of another file that is written; end it as {usual}")
    require_writable(path)
    return path.parent, path.name
