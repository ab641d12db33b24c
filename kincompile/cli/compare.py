"""`kincompile compare`: formulas derived by hand, checked."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import kincompile as kc
from kincompile.cli.shared import (
    DIFFERENT,
    output_option,
    print_data,
    read_model,
    require_output,
    tabled_ends,
    transmission_option,
)
from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    from kincompile.checker.hand_file import HandFile
    from kincompile.cli.shared import Ends


@click.command("compare")
@click.argument("model")
@click.argument("hand")
@click.option("--constraint", metavar="NAME", help="Check this constraint alone.")
@transmission_option("HAND has J and efforts of this function")
@click.option("--reveal", is_flag=True, help="Show the right formulas.")
@click.option("--strict", is_flag=True, help="Accept no convention: equal everywhere, or wrong.")
@output_option("Write the report: .html, .json or .txt.", required=False)
@click.option("--gradescope", metavar="FILE", help="Write a results.json for Gradescope.")
@click.pass_context
def command(
    context: click.Context,
    model: str,
    hand: str,
    constraint: str | None,
    transmission: Ends | None,
    reveal: bool,
    strict: bool,
    output: str | None,
    gradescope: str | None,
) -> None:
    """Compare the formulas in HAND with those derived from MODEL.

    HAND is a TOML or JSON file, or lines such as "Phi_q = [[1, 0, cos(phi)], ...]", with any of
    Phi, Phi_q, nu, gamma, M and Q; or with J, J_dot, effort and x of a transmission, whose inputs
    and outputs are those of the option, of HAND, or of the table [transmission] of MODEL. Its
    formulas are parsed, never run. The exit code is 0 where all
    entries are accepted: equal, equal up to a convention that is named, or, in nu and gamma, equal
    on the constraint manifold; 1 where one is not.
    """
    writers = {".html": "to_html", ".json": "to_json", ".txt": "to_text"}
    if output is not None and Path(output).suffix not in writers:
        raise InputError(f"{output}: a report is written as .html, .json or .txt")
    for path in filter(None, (output, gradescope)):
        require_output(path, model, "the model itself")
        require_output(path, hand, "the file to compare")
    from kincompile.checker.hand_file import read_hand_file

    read: Any = read_model(model)
    file = read_hand_file(hand)
    if ends := transmission or _ends(model, hand, file):
        read = kc.transmission(read, *ends)
    report = kc.compare_file(read, file, constraint=constraint, strict=strict)
    if output is not None:
        write_atomically(output, getattr(report, writers[Path(output).suffix])(reveal))
    if gradescope is not None:
        write_atomically(gradescope, report.to_gradescope(reveal))
    if output is None and sys.stdout.isatty():
        _print_coloured(report.to_rich(reveal))
    elif output is None:
        print_data(report.to_text(reveal))
    else:
        click.echo(f"{report.summary}\nWrote {output}", err=True)
    if not report.equal:
        context.exit(DIFFERENT)


def _ends(model: str, hand: str, file: HandFile) -> Ends | None:
    """Return inputs and outputs, from HAND or else MODEL, where HAND is of a transmission."""
    from kincompile.checker.reference import OF_TRANSMISSIONS

    own = [name for name in file.quantities if name in OF_TRANSMISSIONS]
    if file.transmission is not None or not own:
        return file.transmission
    if (ends := tabled_ends(model)) is not None:
        return ends
    raise InputError(
        f"{listed(own)}: say of which function, with --transmission INPUTS:OUTPUTS, a line "
        f"transmission = INPUTS:OUTPUTS in {hand}, or a table [transmission] in {model}"
    )


def _print_coloured(table: Any) -> None:
    """Print a table to the terminal."""
    from rich.console import Console

    Console().print(table)
