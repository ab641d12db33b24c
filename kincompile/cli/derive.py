"""`kincompile derive`: the derivation of a model, step by step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

import kincompile as kc
from kincompile.cli.motion import set_values
from kincompile.cli.shared import (
    output_option,
    read_model,
    set_option,
    transmission_option,
)
from kincompile.errors import InputError
from kincompile.writing import require_writable

if TYPE_CHECKING:
    from kincompile.cli.shared import Ends

DERIVATIONS = (".slides.html", ".html", ".tex", ".md", ".ipynb")
"""Endings of the files that `derive` writes."""

LEVELS = ("vector", "expanded", "numeric")
"""The levels of a derivation."""

FORMS = ("r-p", "r-omega")
"""The forms of a derivation in space."""


@click.command("derive")
@click.argument("model")
@output_option("File to write: .html, .slides.html, .tex, .md or .ipynb.")
@click.option("--time", "at", type=float, metavar="T", help="Time of the numbers.")
@set_option("parameter, coordinate or rate")
@click.option("--constraint", metavar="NAME", help="Show this constraint alone.")
@click.option(
    "--levels", default=",".join(LEVELS), metavar="LEVEL,...", help="Levels that are shown."
)
@click.option("--form", default=FORMS[0], metavar="FORM", help="In space: r-p, or r-omega (Haug).")
@transmission_option("The Jacobian of the mechanism as a function")
def command(
    model: str,
    output: str,
    at: float | None,
    values: tuple[str, ...],
    constraint: str | None,
    levels: str,
    form: str,
    transmission: Ends | None,
) -> None:
    """Show how Phi_q, nu and gamma of MODEL follow from Phi, step by step.

    A page for each constraint in nine steps (in vectors, in sines and cosines, in numbers) and for
    the assembled system. The numbers are taken where the mechanism is assembled at the time, by
    default one at which nothing is special, or at the coordinates that are set. With --transmission
    the page shows how the Jacobian of outputs by inputs follows from Phi_q: the elimination, the
    chain rule, efforts and singular positions, with the numbers at the inputs that are set.
    """
    if not output.endswith(DERIVATIONS):
        raise InputError(f"{output}: a derivation is written as {', '.join(DERIVATIONS)}")
    require_writable(output)
    read = read_model(model)
    numbers = set_values(read, values)
    state = numbers if at is None else {"t": at, **numbers}
    found = kc.derivation(
        read,
        state or None,
        constraint=constraint,
        levels=[level.strip() for level in levels.split(",") if level.strip()],
        form=form,
        transmission=transmission,
    )
    found.write(output)
    click.echo(f"Wrote {output}", err=True)
