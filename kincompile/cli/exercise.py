"""`kincompile exercise`: a variant of a model for each student, with entries to derive by hand."""

from __future__ import annotations

from pathlib import Path

import click

import kincompile as kc
from kincompile.cli.shared import output_option, read_model


@click.command("exercise")
@click.argument("model")
@output_option("Folder to write, a new one.")
@click.option("--students", type=int, default=1, metavar="N", help="Number of variants.")
@click.option("--seed", type=int, default=0, metavar="S", help="The same seed, the same files.")
@click.option("--signs", is_flag=True, help="Turn frames of bodies, so that signs differ too.")
@click.option("--lengths", is_flag=True, help="Change points and distances given as numbers too.")
@click.option("--mistakes", is_flag=True, help="Find the mistake: Jacobians with one slip each.")
@click.option("--exam", is_flag=True, help="Numbered sheets to fill on paper, with numbers.")
@click.option(
    "--for",
    "system",
    metavar="SYSTEM",
    help="What the course is taught with: gradescope, moodle, nbgrader, otter or prairielearn.",
)
def command(
    model: str,
    output: str,
    students: int,
    seed: int,
    signs: bool,
    lengths: bool,
    mistakes: bool,
    exam: bool,
    system: str | None,
) -> None:
    """Write an exercise on MODEL: a page and a hand-in file for each student.

    Each student has a variant of the mechanism that assembles and moves, drawn on a page, and the
    same entries of Phi_q and gamma to derive; with --mistakes three Jacobians in each of which an
    entry is wrong, other ones for each student; with --exam sheets with boxes for formulas and
    numbers, all of them to print in students/sheets.html, and a table answers.csv. The folder
    instructor has the solutions; `kincompile mark` checks what is handed in. With --for a course's
    own system marks: a notebook for otter or nbgrader, a question for PrairieLearn, questions for
    Moodle (STACK, and with --exam numbers), an autograder for Gradescope.
    """
    made = kc.exercise(
        read_model(model),
        students,
        seed,
        signs=signs,
        lengths=lengths,
        mistakes=mistakes,
        exam=exam,
    )
    written = made.write(Path(output), system)
    click.echo(f"Wrote {written}: {made.sizes}", err=True)
