"""`kincompile sweep`: a model at many sets of parameters, on all processors, into a folder."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from multiprocessing import get_context
from typing import Any

import click

import kincompile as kc
from kincompile.cli.motion import Motion, motion_options, sweep_options
from kincompile.cli.progress import progress_bar
from kincompile.cli.shared import (
    deg_option,
    end_unsolved,
    output_option,
    page_option,
    print_data,
    read_model,
    write_page,
)
from kincompile.errors import InputError
from kincompile.names import listed


@click.command("sweep")
@click.argument("model")
@output_option("Folder to write: .zarr or .parquet; an existing one is resumed.", required=False)
@page_option
@motion_options
@sweep_options
@click.option(
    "--column", "columns", multiple=True, metavar="NAME", help="Column over time to keep."
)
@click.option(
    "--measure",
    "measures",
    multiple=True,
    metavar="NAME",
    help="Measure to keep, such as foot.x.stroke.",
)
@click.option(
    "--processes", type=click.IntRange(min=1), default=os.cpu_count() or 1, help="How many solve."
)
@click.option(
    "--chunk", type=click.IntRange(min=1), help="Variants that are solved and written together."
)
@click.option("--target", type=click.Choice(["c", "numpy"]), default="c", help="What is run.")
@deg_option("Show angles in degrees.")
@click.pass_context
def command(
    ctx: click.Context,
    model: str,
    output: str | None,
    page: str | None,
    motion: Motion,
    sweeps: dict[str, Any],
    product: bool,
    columns: tuple[str, ...],
    measures: tuple[str, ...],
    processes: int,
    chunk: int | None,
    target: str,
    angle_unit: str,
) -> None:
    """Solve MODEL at many sets of parameters, as its table [sweep] says.

    The options --sweep, --column and --measure take the place of what the table says. What was
    found is summarised on stdout; -o writes all of it while it comes, and a run that was stopped
    goes on where it was. What cannot be solved has a status; where nothing can, the exit code is 3.
    """
    from kincompile.files.sweep_table import read_sweep_table
    from kincompile.model.tasks import Sweep
    from kincompile.sweeps.overview import overview
    from kincompile.sweeps.page import sweep_page
    from kincompile.sweeps.result import explained
    from kincompile.sweeps.samples import values_of
    from kincompile.sweeps.worker import end_with_parent

    mechanism = read_model(model)
    table = read_sweep_table(model) or Sweep({})
    swept: dict[str, Any] = sweeps or values_of(table)
    numbers = motion.numbers(mechanism)
    if twice := numbers.keys() & swept.keys():
        raise InputError(f"--set names {listed(sorted(twice))}, which is swept: give one of them")
    times = motion.times(mechanism, numbers)
    kept: dict[str, Any] = {"columns": columns or None, "measures": measures}
    if not columns and not measures:
        kept = {"columns": table.columns, "measures": table.measures}
    options: dict[str, Any] = {
        "product": product or (table.product and not sweeps),
        "assembly": motion.assembly,
    }
    options["through"] = motion.through
    # Fresh processes: a copy of this one would have its memory, and its threads as they stand.
    pool = (
        ProcessPoolExecutor(processes, get_context("spawn"), end_with_parent)
        if processes > 1
        else nullcontext()
    )
    with pool as executor, progress_bar() as progress:
        found = kc.sweep(
            mechanism, numbers | swept, times, **kept, **options,
            target=target, store=output, executor=executor, chunk=chunk, progress=progress,
        )  # fmt: skip
    print_data(f"{found}\n\n{overview(found).table(angle_unit)}\n")
    for name, what in explained(found.statuses()).items():
        click.echo(f"{name}: {what}", err=True)
    if output is not None:
        click.echo(f"Wrote {output}", err=True)
    if page is not None:
        write_page(page, sweep_page(found, angle_unit))
    if not {"CONVERGED", "CORNER"} & found.statuses().keys():
        end_unsolved(ctx, "no set of parameters was solved")
