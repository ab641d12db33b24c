"""What commands share: exit codes, reading a model, options, writing to stdout."""

from __future__ import annotations

import re
import shutil
import sys
import textwrap
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

import kincompile as kc
from kincompile.errors import InputError, KincompileError
from kincompile.model.declared import declared_fields
from kincompile.model.live_drawings import live_drawings
from kincompile.names import transmission_ends
from kincompile.writing import require_writable, write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.solution import Solution
    from kincompile.view.page import Page

    Ends = tuple[list[str], list[str]]
    """Names of the inputs and of the outputs of a transmission."""

    Command = Callable[..., None]

DIFFERENT, USAGE_OR_MODEL, NOT_CONVERGED, INTERRUPTED = 1, 2, 3, 130
"""Exit codes."""


def read_model(model: str) -> Mechanism | ConstraintSystem:
    """Read a model; what its file prints is a message, not data."""
    with redirect_stdout(sys.stderr):
        read: Mechanism | ConstraintSystem = kc.read_model(model)
    return read


def read_drawn(
    model: str, names: Iterable[str] = (), *, is_pulled: bool = False
) -> Mechanism | ConstraintSystem:
    """Read a model, with the coordinates of its drawn joints as parameters where they are wanted.

    They are where a name that is given is one of them, as ``B_x``, and where joints are to be
    pulled on a page and the drawing declares no length.
    """
    read = read_model(model)
    known = {item.name for item in read.parameters}
    joints = {joint for places in getattr(read, "drawn", {}).values() for joint in places}
    is_named = any(name not in known and name.rpartition("_")[0] in joints for name in names)
    has_lengths = any(item.unit == read.length_unit for item in read.parameters)
    if not joints or not (is_named or (is_pulled and not has_lengths)):
        return read
    with live_drawings():
        try:
            return read_model(model)
        except KincompileError:  # it calculates with places, as numbers
            return read


def require_output(path: str | Path, read: str, what: str) -> None:
    """Refuse an output that cannot be written, or that is a file which is read."""
    require_writable(path)
    if Path(path).exists() and Path(read).exists() and Path(path).samefile(read):
        raise InputError(f"{path} is {what}; give another name to write to")


def require_model_output(path: str, read: str) -> None:
    """Refuse a model file of another ending, or that is the model which is read."""
    if Path(path).suffix not in (".toml", ".json"):
        raise InputError(f"cannot write {path}: end its name in .toml or .json")
    require_output(path, read, "the model itself")


def write_model(path: str, model: Mechanism | ConstraintSystem) -> None:
    """Write a model file, and say so."""
    text = model.to_json() if path.endswith(".json") else model.to_toml()
    click.echo(f"Wrote {write_atomically(path, text)}", err=True)


def output_option(text: str, *, required: bool = True) -> Callable[[Command], Command]:
    """Return the option ``-o FILE``."""
    return click.option("-o", "--output", required=required, metavar="FILE", help=text)


def deg_option(text: str) -> Callable[[Command], Command]:
    """Return the option ``--deg``, which shows angles in degrees."""
    # Releases of click differ on what a default of a flag with a value means: it has no default.
    return click.option("--deg", "angle_unit", flag_value="deg", callback=_unit, help=text)


def _unit(context: click.Context, parameter: click.Parameter, value: str | None) -> str:
    del context, parameter
    return value or "rad"


def set_option(what: str) -> Callable[[Command], Command]:
    """Return the option ``--set NAME=VALUE``, which gives values by name."""
    text = f"Value of a {what}, such as a=0.25 or phi=30deg; may be given several times."
    return click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help=text)


def transmission_option(text: str) -> Callable[[Command], Command]:
    """Return the option ``--transmission INPUTS:OUTPUTS``, which gives names of both, or None."""
    return click.option(
        "--transmission",
        metavar="INPUTS:OUTPUTS",
        callback=_ends,
        help=f"{text}: names with commas, as left,right:pitch,roll.",
    )


def _ends(context: click.Context, option: click.Parameter, given: str | None) -> Ends | None:
    """Return the names of inputs and of outputs."""
    del context, option
    if given is None:
        return None
    if (ends := transmission_ends(given)) is None:
        raise InputError(
            f"--transmission {given} is not of the form INPUTS:OUTPUTS; write names with commas, "
            "as left,right:pitch,roll"
        )
    return ends


def tabled_ends(model: str) -> Ends | None:
    """Return inputs and outputs of the table [transmission] of a model, None without it."""
    # SymPy, which the help of a command does not need.
    from kincompile.files.sweep_table import task_reader

    if task_reader(model, "transmission") is None:
        return None
    from kincompile.design.task_tables import read_transmission  # SciPy

    given = read_transmission(model)
    return given["inputs"], given["outputs"]


def table_options(table: type) -> Callable[[Command], Command]:
    """Add an option for each whole number of a declared table, None where it is not given."""

    def added(command: Command) -> Command:
        for name, item in reversed(declared_fields(table).items()):
            if item.schema.get("type") == "integer":
                limits = click.IntRange(item.schema["minimum"], item.schema["maximum"])
                command = click.option(f"--{name}", type=limits, help=item.words)(command)
        return command

    return added


def page_option(command: Command) -> Command:
    """Add the option ``--page FILE``."""
    option = click.option(
        "--page", metavar="FILE", callback=_page, help="Page of the results to write, .html."
    )
    return option(command)


def _page(context: click.Context, option: click.Parameter, given: str | None) -> str | None:
    """Return the name of a page, which can be written."""
    del context, option
    if given is not None:
        require_page(given)
    return given


def require_page(path: str) -> None:
    """Refuse a page that has another ending, or cannot be written."""
    if Path(path).suffix not in (".html", ".htm"):
        raise InputError(f"cannot write {path}: end its name in .html")
    require_writable(path)


def write_page(path: str, html: str) -> None:
    """Write a page of results, and say so."""
    click.echo(f"Wrote {write_atomically(path, html)}", err=True)


def print_data(text: str) -> None:
    """Write data to stdout; an error of the system becomes an `InputError`."""
    try:
        click.echo(text, nl=False)
    except OSError as error:
        raise InputError(f"cannot write to stdout: {error.strerror}") from error


_ANGLE = re.compile(r"(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?) rad\b(?!/)")


def end_unsolved(context: click.Context, message: str) -> NoReturn:
    """Say what was not solved, and end the command with the exit code of that."""
    click.echo(on_screen(f"Error: {message}"), err=True)
    context.exit(NOT_CONVERGED)


def on_screen(text: str) -> str:
    """Return a message as it is shown: wrapped between words on a terminal, else as it is."""
    if not sys.stderr.isatty():
        return text
    width = shutil.get_terminal_size().columns
    lines = (textwrap.fill(line, width, subsequent_indent="  ") for line in text.splitlines())
    return "\n".join(lines)


def warn_of_branch(doubt: str, angle_unit: str = "rad") -> None:
    """Say that a motion does not begin where its model is drawn, if so."""
    if doubt:
        click.echo(on_screen(f"Warning: {shown_angles(doubt, angle_unit)}"), err=True)


def reasons_of(
    solution: Solution | Page,
    angle_unit: str = "rad",
    *,
    is_whole: bool = False,
    between: str = "\n  ",
) -> str:
    """Return why a motion failed: what, its limit and what to do, a line each.

    `is_whole` adds the residuals. Where reasons are not known it is the message.
    """
    given = solution.reasons if is_whole else solution.reasons[:-1]
    return shown_angles(between.join(filter(None, given)) or solution.message, angle_unit)


verbose_option = click.option(
    "-v", "--verbose", is_flag=True, help="Say of a failure which equations are missed too."
)


def give_motion(
    context: click.Context,
    solution: Solution,
    text: str,
    output: str | None,
    angle_unit: str,
    has_forces: bool,
    reasons: str = "",
    *,
    is_whole: bool = False,
) -> None:
    """Print the summary of a motion, write it where a file is asked for, and exit by its success.

    With `has_forces` both have the forces along it. `reasons` say why not all of it was found; the
    message of the solution does where none are given, `is_whole` with the residuals.
    """
    written = solution
    if has_forces:
        found = kc.forces(solution)
        text, written = f"{text}\n\n{found.summary()}", found.motion
    if output is None:
        print_data(text + "\n")
    else:
        kc.write(written, output, angle_unit=angle_unit)
        click.echo(f"{text}\nWrote {output}", err=True)
    warn_of_branch(solution.doubt, angle_unit)
    if not solution.success:
        end_unsolved(context, reasons or reasons_of(solution, angle_unit, is_whole=is_whole))


def shown_angles(message: str, angle_unit: str) -> str:
    """Return a message with its angles in the unit in which angles are shown."""
    from kincompile.runtime.results.columns import shown_unit  # NumPy

    unit, factor = shown_unit("rad", angle_unit)
    return _ANGLE.sub(lambda found: f"{factor * float(found[1]):.4g} {unit}", message)
