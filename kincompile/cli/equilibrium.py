"""`kincompile equilibrium`: where loads let a model rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
import numpy as np

import kincompile as kc
from kincompile.cli import shared
from kincompile.cli.motion import set_values
from kincompile.errors import InputError
from kincompile.runtime.results.columns import largest
from kincompile.tables import table, without_noise

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType


@click.command("equilibrium")
@click.argument("model")
@click.option("--time", "at", type=float, default=0.0, metavar="T", help="Time of the loads.")
@click.option("--all", "is_all", is_flag=True, help="All equilibria, unstable ones too.")
@shared.set_option("parameter")
@shared.output_option(
    "File to write, .csv, .npz or .json: position, outputs, reactions.", required=False
)
@click.pass_context
def command(
    context: click.Context,
    model: str,
    at: float,
    is_all: bool,
    values: tuple[str, ...],
    output: str | None,
) -> None:
    """Find where the loads of MODEL let it rest, with its drivers held at a time.

    From the guess it goes along its forces to a stable equilibrium. The exit code is 3 where there
    is none.
    """
    if output is not None:
        shared.require_output(output, model, "the model")
        if is_all:
            raise InputError("--all lists equilibria; -o writes one: leave one of them out")
    read = shared.read_model(model)
    numbers, module = set_values(read, values), kc.compile(read)
    if is_all:
        found = kc.equilibria(module, at, numbers)
        message = f"{module.NAME} has no equilibrium at t = {at:g} that was found"
    else:
        one = kc.equilibrium(module, at, numbers)
        found, message = [one] if one.success else [], one.message
    if not found:
        shared.end_unsolved(context, message)
    shared.print_data("\n".join(_listed(module, found, at)) + "\n")
    if output is not None:
        click.echo(f"Wrote {kc.write(found[0].forces.motion, output)}", err=True)


def _listed(module: ModuleType, found: Sequence[kc.Equilibrium], t: float) -> list[str]:
    """Return a table: a row a coordinate, a column an equilibrium."""
    many = "1 equilibrium" if len(found) == 1 else f"{len(found)} equilibria"
    numbers = [str(k) for k in range(1, len(found) + 1)]
    rows = [["", "", *(item.stability[0] for item in found)]]
    values = np.stack([item.q[0] for item in found])
    values = without_noise(values, largest(values))
    for name, shown in zip(module.COORDINATES, values.T, strict=True):
        rows.append([name, module.UNITS[name], *(f"{value + 0.0:.6g}" for value in shown)])
    heading = f"{module.NAME}: {many} at t = {t:g}"
    return [heading, "", *table(("coordinate", "unit", *numbers), rows, right=numbers)]
