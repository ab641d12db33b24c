"""`kincompile assemblies`: all ways to assemble a model, listed and drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
import numpy as np

import kincompile as kc
from kincompile.cli import shared
from kincompile.cli.motion import set_values
from kincompile.runtime.results.columns import shown_unit
from kincompile.tables import table

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Differences, beside the largest number, that are those of rounding."""


@click.command("assemblies")
@click.argument("model")
@click.option("--time", "at", type=float, default=0.0, metavar="T", help="Time of the assemblies.")
@shared.set_option("parameter")
@shared.deg_option("List angles in degrees.")
@shared.output_option("Page to write, .html: each assembly and the motion from it.", required=False)
@click.pass_context
def command(
    context: click.Context,
    model: str,
    at: float,
    values: tuple[str, ...],
    angle_unit: str,
    output: str | None,
) -> None:
    """List the ways to assemble MODEL at a time, and draw them.

    They count from 1, the nearest to the model's guess first: `run --assembly N` takes one. With -o
    a page shows each in motion, as far as it goes, from that time on. The exit code is 3 where
    there is none.
    """
    if output is not None:
        shared.require_page(output)
    read = shared.read_model(model)
    numbers = set_values(read, values)
    if output is None:
        module = kc.compile(read)
        found = kc.assemblies(module, at, numbers)
    else:
        drawn = kc.assembly_gallery(read, at, numbers)
        module, found = drawn.module, drawn.positions
    if not len(found):
        shared.end_unsolved(context, f"{module.NAME} cannot be assembled at t = {at:g}")
    shared.print_data("\n".join(_listed(module, found, at, angle_unit)) + "\n")
    if output is not None:
        click.echo(f"Wrote {drawn.write(output)}", err=True)


def _listed(module: ModuleType, found: Array, t: float, angle_unit: str) -> list[str]:
    """Return a table: a row a coordinate that differs, a column an assembly."""
    least = ROUNDING * float(np.max(np.abs(found), initial=1.0))
    apart = np.ptp(found, axis=0) if len(found) > 1 else np.full(found.shape[1], np.inf)
    names = [module.COORDINATES[k] for k in np.flatnonzero(apart > least)]
    rows = []
    for name in names:
        values = found[:, module.COORDINATES.index(name)]
        unit, factor = shown_unit(module.UNITS[name], angle_unit)
        shown = np.where(np.abs(values) > least, values * factor, 0.0)
        rows.append([name, unit, *(f"{value:.6g}" for value in shown)])
    numbers = [str(k) for k in range(1, len(found) + 1)]
    only = f"{module.NAME}: 1 assembly at t = {t:g}"
    several = f"{module.NAME}: {len(found)} assemblies at t = {t:g}; the coordinates that differ"
    heading = several if len(found) > 1 else only
    return [heading, "", *table(("coordinate", "unit", *numbers), rows, right=numbers)]
