"""`kincompile transmission`: a model as a function of its inputs, over a grid."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import kincompile as kc
from kincompile.cli.motion import set_values
from kincompile.cli.shared import deg_option, end_unsolved, print_data, read_model, set_option
from kincompile.errors import InputError
from kincompile.names import column_name, unknown
from kincompile.runtime.results.columns import shown_unit
from kincompile.runtime.results.driver_range import driver_table
from kincompile.tables import table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

MOST_POSES = 100_000
"""Poses of a grid at most."""


@click.command("transmission")
@click.argument("model")
@click.option("--inputs", metavar="NAMES", help="Drivers and coordinates, separated by commas.")
@click.option("--outputs", metavar="NAMES", help="Coordinates, outputs and points, likewise.")
@click.option(
    "--grid", "grid", multiple=True, metavar="NAME=FIRST:LAST:COUNT",
    help="Values of an input, such as crank=0:90deg:10, or one, crank=30deg; several times.",
)  # fmt: skip
@click.option(
    "--effort", "efforts", multiple=True, metavar="NAME=VALUE",
    help="What an output delivers, such as pitch=35; may be given several times.",
)  # fmt: skip
@set_option("parameter")
@deg_option("Show angles in degrees; J and efforts stay in radians.")
@click.pass_context
def command(
    context: click.Context,
    model: str,
    inputs: str | None,
    outputs: str | None,
    grid: tuple[str, ...],
    efforts: tuple[str, ...],
    values: tuple[str, ...],
    angle_unit: str,
) -> None:
    """Tabulate MODEL as a function of inputs: outputs, J, efforts and singularities.

    Inputs and outputs, and with them a grid and efforts, are those of the table [transmission] of
    MODEL where options do not give them. Without a grid it is the first pose; an input without
    values is held at its first one. The limits of the inputs, each with the others held, come
    after it. The exit code is 3 where a pose of the grid was not reached.
    """
    read = read_model(model)
    given: dict[str, Any] = {"grid": {}, "efforts": {}}
    if inputs is None or outputs is None:
        from kincompile.design.task_tables import read_transmission

        given = read_transmission(model)
    names = given.get("inputs", ()) if inputs is None else inputs.split(",")
    f = kc.transmission(read, names, given["outputs"] if outputs is None else outputs.split(","))
    numbers = set_values(read, values)
    axes = {**_named(given["grid"], f.inputs), **_grid(grid, f)}
    loads = {**given["efforts"], **_efforts(efforts, f)}
    sizes = [axes.get(name, [float(x)]) for name, x in zip(f.inputs, f.home.u, strict=True)]
    if (count := int(np.prod([len(item) for item in sizes]))) > MOST_POSES:
        raise InputError(f"the grid has {count:,} poses; give {MOST_POSES:,} at most")
    poses = f.at(np.array(list(product(*sizes))), p=numbers)
    print_data("\n".join(_lines(f, poses, _named(loads, f.outputs), angle_unit)) + "\n")
    if not poses.success:
        end_unsolved(context, poses.message)


def _named(given: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Return values by the names of inputs or outputs, checked."""
    found = {name if name in names else column_name(name): x for name, x in given.items()}
    for name in found:
        if name not in names:
            text = f"the transmission has no input or output {name!r} here"
            raise InputError(unknown(text, name, names))
    return found


def _grid(given: Sequence[str], f: kc.Transmission) -> dict[str, list[float]]:
    """Return the values of inputs from options."""
    from kincompile.cli.values import number

    found = {}
    for item in given:
        name, _, text = item.partition("=")
        parts, what = text.split(":"), f"--grid {item}: write NAME=FIRST:LAST:COUNT or NAME=VALUE"
        (name,) = _named({name.strip(): 0}, f.inputs)
        parts = [*parts, *parts, "1"] if len(parts) == 1 else parts
        count = parts[2] if len(parts) == 3 else ""
        if not count.isdecimal() or not 0 < int(count) <= MOST_POSES:
            raise InputError(f"{what}, with a count of 1 to {MOST_POSES:,}")
        first, last = (number(part, what, {}, f.units[name]) for part in parts[:2])
        found[name] = np.linspace(first, last, int(count)).tolist()
    return found


def _efforts(given: Sequence[str], f: kc.Transmission) -> dict[str, float]:
    """Return the efforts of outputs from options."""
    from kincompile.cli.values import number

    found = {}
    for item in given:
        name, _, text = item.partition("=")
        (name,) = _named({name.strip(): 0}, f.outputs)
        found[name] = number(text, f"--effort {item}: give NAME=VALUE with a number", {})
    return found


def _lines(
    f: kc.Transmission, poses: kc.Poses, loads: Mapping[str, float], angle_unit: str
) -> list[str]:
    """Return the table of poses, and that of the limits of the inputs."""
    from kincompile.functions.limits import limits

    count = len(poses.u)
    columns: list[tuple[str, Any]] = []
    for names, found in ((f.inputs, poses.u), (f.outputs, poses.x)):
        for name, column in zip(names, found.T, strict=True):
            unit, factor = shown_unit(f.units[name], angle_unit)
            columns.append((f"{name} [{unit or 1}]", factor * column))
    for row, output in enumerate(f.outputs):
        columns += [(f"d {output}/d {x}", poses.J[:, row, k]) for k, x in enumerate(f.inputs)]
    if loads:
        tau = np.einsum("kij,i->kj", poses.J, [loads.get(name, 0.0) for name in f.outputs])
        columns += [(f"effort of {name}", tau[:, k]) for k, name in enumerate(f.inputs)]
    if len(f.inputs) == len(f.outputs):
        columns.append(("det J", poses.determinant))
    shown = [[f"{x + 0.0:.6g}" for x in column] for _, column in columns]
    shown.append(poses.singularity.tolist())
    titles = [title for title, _ in columns]
    lines = [f.to_text(), f"{count} pose{'s' * (count > 1)}", ""]
    lines += table((*titles, "singularity"), list(zip(*shown, strict=True)), right=titles)
    ranges = driver_table(limits(f, f.home), angle_unit)
    return [*lines, "", *(line.replace("driver", "input ", 1) for line in ranges)]
