"""`kincompile convert`: any model as a model file."""

from __future__ import annotations

import click

from kincompile.cli import shared


@click.command("convert")
@click.argument("model")
@shared.output_option("Model file to write, .toml or .json.")
def command(model: str, output: str) -> None:
    """Write MODEL, of a robot, of another program or in Python, as a model file to go on from."""
    shared.require_model_output(output, model)
    shared.write_model(output, shared.read_model(model))
