"""`kincompile editor`: a page in which a mechanism is drawn, solved and saved."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout

import click

import kincompile as kc
from kincompile.cli.shared import output_option, require_output


@click.command("editor")
@click.argument("model", required=False)
@output_option("File to write, which ends in .html.")
def command(model: str | None, output: str) -> None:
    """Write a page in which a mechanism in the plane is drawn by hand and moves at once.

    With MODEL it is open there. The page is one file, needs no network, and saves what is drawn as
    TOML and as Python.
    """
    if model is not None:
        require_output(output, model, "the model itself")
    with redirect_stdout(sys.stderr):
        made = kc.editor(model)
    click.echo(f"Wrote {made.write(output)}", err=True)
