"""`kincompile mark`: the hand-in files of an exercise, marked."""

from __future__ import annotations

import click

import kincompile as kc
from kincompile.cli.shared import output_option, print_data
from kincompile.writing import require_writable


@click.command("mark")
@click.argument("folder")
@output_option("File to write, .csv; without it, the table goes to stdout.", required=False)
@click.option(
    "--tolerance",
    type=float,
    default=0.0,
    metavar="R",
    help="Relative error up to which a rounded number counts, at most 0.1; else 0.",
)
@click.option(
    "--digits",
    type=int,
    metavar="N",
    help="Significant digits to which a rounded number must agree, 1 to 6, to count.",
)
def command(folder: str, output: str | None, tolerance: float, digits: int | None) -> None:
    """Mark the hand-in files in FOLDER, which `kincompile exercise` wrote.

    The table has a line for each student: points, those of each blank, the reasons, and apart
    from them what cannot be read. Formulas are parsed, never run.
    """
    if output is not None:
        require_writable(output)
    marks = kc.mark(folder, tolerance=tolerance, digits=digits)
    if output is None:
        print_data(marks.to_csv())
    else:
        marks.write(output)
        click.echo(f"Wrote {output}", err=True)
