"""`kincompile editor`: a page in which a mechanism is drawn, solved and saved."""

from __future__ import annotations

from pathlib import Path

import click

from kincompile.cli.shared import output_option, read_model, require_output
from kincompile.errors import InputError
from kincompile.view.editor import editor_page
from kincompile.writing import write_atomically


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
    if Path(output).suffix not in (".html", ".htm"):
        raise InputError(f"cannot write {output}: end its name in .html")
    page = editor_page("" if model is None else _text_of(model))
    click.echo(f"Wrote {write_atomically(output, page)}", err=True)


def _text_of(model: str) -> str:
    """Return a model as the text of a file: as it is written, where it is one."""
    mechanism = read_model(model)
    path = Path(model)
    return path.read_text("utf-8") if path.suffix in (".toml", ".json") else mechanism.to_toml()
