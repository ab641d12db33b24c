"""`kincompile view`: a page that shows a model in motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import kincompile as kc
from kincompile.cli.motion import motion_options, motion_times, set_values
from kincompile.cli.shared import NOT_CONVERGED, output_option, read_model
from kincompile.errors import InputError
from kincompile.writing import require_writable


@click.command("view")
@click.argument("models", nargs=-1, required=True, metavar="MODEL...")
@output_option("Page to write, .html; a folder gets a page of each model, and index.html.")
@motion_options
@click.pass_context
def command(
    context: click.Context,
    models: tuple[str, ...],
    output: str,
    start: str,
    end: str | None,
    points: int | None,
    grid: str | None,
    values: tuple[str, ...],
    through: str | None,
    assembly: int | None,
) -> None:
    """Write a page that shows MODEL in motion, with plots and numbers.

    The page is one file that needs no network: open it in a browser. Of several models, each gets
    a page in a folder, whose index.html links them. Where the motion does not converge, the page
    shows what was found, or the start guess, and the exit code is 3.
    """
    is_page = Path(output).suffix in (".html", ".htm")
    if is_page:
        require_writable(output)
    if is_page and len(models) > 1:
        raise InputError(f"{output}: {len(models)} pages do not go into one file; name a folder")
    read = [read_model(model) for model in models]
    options: dict[str, Any] = {"through": through, "assembly": assembly}
    pages = []
    for model in read:
        numbers = set_values(model, values)
        times = motion_times(model, start, end, points, grid, numbers)
        pages.append(kc.page(model, t=times, p=numbers, **options))
    written = [pages[0].write(output)] if is_page else kc.gallery(pages).write(output)
    for path in written:
        click.echo(f"Wrote {path}", err=True)
    failed = [item for item in pages if not item.success]
    for item in failed:
        click.echo(f"Error: {item.message}", err=True)
    if failed:
        context.exit(NOT_CONVERGED)
