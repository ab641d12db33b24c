"""`kincompile tolerance`: what the tolerances of a model's file do to its motion."""

from __future__ import annotations

from functools import partial

import click

import kincompile as kc
from kincompile.cli.motion import Motion, motion_options
from kincompile.cli.shared import page_option, print_data, read_model, table_options, write_page
from kincompile.model.tasks import Tolerance


@click.command("tolerance")
@click.argument("model")
@page_option
@partial(motion_options, has_through=False)
@table_options(Tolerance)
def command(
    model: str,
    page: str | None,
    motion: Motion,
    **options: int | None,
) -> None:
    """Say how far the motion of MODEL deviates, as its table [tolerance] says.

    Worst case, root sum of squares and, with samples, Monte Carlo go to stdout: of each column at
    the time at which it deviates most, with what each dimension contributes. --page writes the
    bands over time too.
    """
    from kincompile.design.page import tolerance_page
    from kincompile.design.task_tables import read_tolerance

    mechanism = read_model(model)
    given = read_tolerance(model)
    given |= {name: x for name, x in options.items() if x is not None}
    numbers = motion.numbers(mechanism)
    times = motion.times(mechanism, numbers)
    found = kc.tolerance(mechanism, t=times, p=numbers, assembly=motion.assembly, **given)
    print_data(f"{found}\n")
    if page is not None:
        write_page(page, tolerance_page(found))
