"""`kincompile view`: a page that shows a model in motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import kincompile as kc
from kincompile.cli.motion import Motion, motion_options
from kincompile.cli.shared import (
    NOT_CONVERGED,
    deg_option,
    on_screen,
    output_option,
    read_drawn,
    reasons_of,
    tabled_ends,
    transmission_option,
    verbose_option,
    warn_of_branch,
)
from kincompile.cli.watch import follow
from kincompile.errors import InputError
from kincompile.writing import require_writable

if TYPE_CHECKING:
    from kincompile.cli.shared import Ends


@click.command("view")
@click.argument("models", nargs=-1, required=True, metavar="MODEL...")
@output_option(
    "Page to write, .html; a folder gets a page of each model, and index.html.", required=False
)
@click.option(
    "--watch", is_flag=True, help="Serve the page and reload it whenever the model is saved."
)
@motion_options
@transmission_option("A panel of the mechanism as a function, also by a table [transmission]")
@deg_option("Show angles in degrees at first; the page can change it.")
@verbose_option
@click.pass_context
def command(
    context: click.Context,
    models: tuple[str, ...],
    output: str | None,
    watch: bool,
    motion: Motion,
    transmission: Ends | None,
    angle_unit: str,
    verbose: bool,
) -> None:
    """Write a page that shows MODEL in motion, with plots and numbers.

    The page is one file that needs no network: open it in a browser. Of several models, each gets
    a page in a folder, whose index.html links them. Where the motion does not converge, the page
    shows what was found, or the start guess, and the exit code is 3. With a transmission the page
    has a panel with sliders of the inputs, and needs no motion.

    With --watch the page of one model is shown on this machine alone, at the address that is said,
    until Ctrl-C. It is made anew, by this command, when a file is saved that the model reads; an
    error is shown on it.
    """
    if watch:
        _watch(context, models, output)
        return
    if not output:
        raise click.MissingParameter(ctx=context, param=_parameter(context, "output"))
    is_page = Path(output).suffix in (".html", ".htm")
    if is_page:
        require_writable(output)
    elif Path(output).suffix and not Path(output).is_dir():
        raise InputError(f"{output} is not the name of a page: end it in .html, or name a folder")
    if is_page and len(models) > 1:
        raise InputError(f"{output}: {len(models)} pages do not go into one file; name a folder")
    read = [read_drawn(model, motion.names, is_pulled=True) for model in models]
    options: dict[str, Any] = {
        "through": motion.through, "assembly": motion.assembly, "angle_unit": angle_unit,
    }  # fmt: skip
    pages = []
    for path, model in zip(models, read, strict=True):
        numbers = motion.numbers(model)
        options["transmission"] = transmission or tabled_ends(path)
        pages.append(kc.page(model, t=motion.times(model, numbers), p=numbers, **options))
    written = [pages[0].write(output)] if is_page else kc.gallery(pages).write(output)
    for path in written:
        click.echo(f"Wrote {path}", err=True)
    failed = [item for item in pages if not item.success]
    for item in pages:
        warn_of_branch(item.doubt, angle_unit)
    for item in failed:
        said = reasons_of(item, angle_unit, is_whole=verbose)
        click.echo(on_screen(f"Error: {said}"), err=True)
    if failed:
        context.exit(NOT_CONVERGED)


def _watch(context: click.Context, models: tuple[str, ...], output: str | None) -> None:
    """Show the page of one model while it is written, with the options of this call."""
    if len(models) > 1 or output is not None:
        raise InputError("--watch shows one model and writes no page: give one MODEL, and no -o")
    options = []
    for item in context.command.params:
        given = context.params[item.name or ""]
        if item.param_type_name == "option" and item.name not in ("output", "watch"):
            if item.name == "transmission":
                given = given and ":".join(",".join(names) for names in given)
            every = given if isinstance(given, tuple) else (given,)
            if isinstance(item, click.Option) and item.is_flag:
                options += [item.opts[-1]] if given == item.flag_value else []
            else:
                options += [f"{item.opts[-1]}={value}" for value in every if value is not None]
    follow(models[0], options)


def _parameter(context: click.Context, name: str) -> click.Parameter:
    return next(item for item in context.command.params if item.name == name)
