"""`kincompile derive`: the derivation of a model, step by step."""

from __future__ import annotations

from pathlib import Path

import click

import kincompile as kc
from kincompile.cli.motion import set_values
from kincompile.cli.shared import output_option, read_model, set_option
from kincompile.errors import InputError
from kincompile.writing import require_writable

DERIVATIONS = (".html", ".tex", ".md", ".ipynb")
"""Endings of the files that `derive` writes."""


@click.command("derive")
@click.argument("model")
@output_option("File to write: .html, .tex, .md or .ipynb.")
@click.option("--time", "at", type=float, default=0.0, metavar="T", help="Time of the numbers.")
@set_option("parameter, coordinate or rate")
def command(model: str, output: str, at: float, values: tuple[str, ...]) -> None:
    """Show how Phi_q, nu and gamma of MODEL follow from Phi, step by step.

    A page for each constraint in nine steps (in vectors, in sines and cosines, in numbers) and for
    the assembled system. The numbers are taken where the mechanism is assembled at the time, or at
    the coordinates that are set.
    """
    if Path(output).suffix not in DERIVATIONS:
        raise InputError(f"{output}: a derivation is written as {', '.join(DERIVATIONS)}")
    require_writable(output)
    read = read_model(model)
    kc.derivation(read, {"t": at, **set_values(read, values)}).write(output)
    click.echo(f"Wrote {output}", err=True)
