"""`kincompile schema`: the JSON Schema of model files."""

from __future__ import annotations

import json

import click

import kincompile as kc
from kincompile.cli.shared import print_data


@click.command("schema")
def command() -> None:
    """Show the JSON Schema of a model in TOML or JSON, for editors that check while one writes."""
    print_data(json.dumps(kc.model_schema(), indent=2) + "\n")
