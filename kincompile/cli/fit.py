"""`kincompile fit`: dimensions with which a model reaches the targets of its file."""

from __future__ import annotations

import click

import kincompile as kc
from kincompile.cli import shared
from kincompile.cli.motion import set_values
from kincompile.model.tasks import Fit


@click.command("fit")
@click.argument("model")
@shared.output_option("Model to write with the dimensions found: .toml or .json.", required=False)
@shared.page_option
@shared.set_option("parameter")
@shared.table_options(Fit)
@click.pass_context
def command(
    context: click.Context,
    /,
    model: str,
    output: str | None,
    page: str | None,
    values: tuple[str, ...],
    **options: int | None,
) -> None:
    """Find dimensions with which MODEL reaches the targets of its table [fit].

    What was found goes to stdout; -o writes the model with these dimensions, --page a page that
    shows it move. Where a target is not reached, or a limit is not kept, what comes nearest is
    written nevertheless, and the exit code is 3.
    """
    from kincompile.design.page import fit_page
    from kincompile.design.task_tables import read_fit
    from kincompile.design.variation import require_mechanism

    if output is not None:
        shared.require_model_output(output, model)
    mechanism = require_mechanism(shared.read_model(model), "kincompile fit")
    given = read_fit(model, mechanism)
    given |= {name: x for name, x in options.items() if x is not None}
    found = kc.fit(mechanism, p=set_values(mechanism, values), **given)
    shared.print_data(f"{found}\n")
    if output is not None:
        shared.write_model(output, found.model)
    if page is not None:
        shared.write_page(page, fit_page(found))
    if not found.success:
        shared.end_unsolved(context, found.message)
