"""`kincompile inspect`: what a model is made of."""

from __future__ import annotations

import click

import kincompile as kc
from kincompile.cli.shared import DIFFERENT, print_data, read_model


@click.command("inspect")
@click.argument("model")
@click.option("--verify", is_flag=True, help="Check Phi_q, nu and gamma against Phi alone.")
@click.pass_context
def command(context: click.Context, model: str, verify: bool) -> None:
    """Show what MODEL is made of, and whether it can be compiled.

    Bodies, parameters, constraints, rows and columns of Phi_q, mobility, rank, the order of
    solution and the pattern of Phi_q; and what to do about missing drivers, about redundant and
    conflicting equations, and where it cannot be assembled. Rows and columns count from 0. With
    --verify, Phi_q, nu and gamma of the emitted module are compared with complex steps of its Phi
    and the second derivative of Phi along a line, at seeded states; the exit code is 1 where one
    differs.
    """
    read = read_model(model)
    print_data(f"{kc.inspect(read)}\n")
    if verify:
        found = kc.verify(read)
        print_data(f"\n{found}\n")
        if not found.passed:
            context.exit(DIFFERENT)
