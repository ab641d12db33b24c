"""`kincompile mark`: the hand-in files of an exercise, marked."""

from __future__ import annotations

from pathlib import Path

import click

import kincompile as kc
from kincompile.cli.shared import output_option, print_data
from kincompile.errors import InputError
from kincompile.writing import require_new_folder, require_writable


@click.command("mark")
@click.argument("folder")
@output_option(
    "Table to write, .csv, or a new folder: points, feedback, statistics, gradebooks. Without it, "
    "the table goes to stdout.",
    required=False,
)
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
@click.option(
    "--roster",
    metavar="FILE",
    help="Table of the class, .csv, with a column sheet and those that a gradebook exports.",
)
@click.option("--title", metavar="TEXT", help="Title of the column in gradebooks.")
def command(
    folder: str,
    output: str | None,
    tolerance: float,
    digits: int | None,
    roster: str | None,
    title: str | None,
) -> None:
    """Mark the hand-in files in FOLDER, which `kincompile exercise` wrote.

    The table has a line for each student: points, those of each blank, the reasons, and apart
    from them what cannot be read. A folder has that, a page of feedback for each student,
    statistics of the class, and tables that Moodle and Canvas import. Formulas are parsed, never
    run.
    """
    is_folder = output is not None and not Path(output).suffix
    if not is_folder and (roster or title):
        raise InputError("--roster and --title are for a folder: write one, as -o marks")
    if is_folder:
        require_new_folder(Path(str(output)))
    elif output is not None:
        require_writable(output)
    marks = kc.mark(folder, tolerance=tolerance, digits=digits)
    if output is None:
        print_data(marks.to_csv())
        return
    written = marks.write(output, roster, title)
    if is_folder:
        print_data(marks.statistics().to_text())
    click.echo(f"Wrote {written}", err=True)
