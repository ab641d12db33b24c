"""What commands share: exit codes, reading a model, options, writing to stdout."""

from __future__ import annotations

import re
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

import click
import sympy

import kincompile as kc
from kincompile.errors import InputError
from kincompile.files.safe_expressions import ExpressionError, parse_expression
from kincompile.model.expressions import (
    NotAnExpressionError,
    as_expression,
    degrees_problem,
    number_in,
)
from kincompile.writing import require_writable

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from kincompile.model.expressions import Scalar
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

    Command = Callable[..., None]

DIFFERENT, USAGE_OR_MODEL, NOT_CONVERGED, INTERRUPTED = 1, 2, 3, 130
"""Exit codes."""


def read_model(model: str) -> Mechanism | ConstraintSystem:
    """Read a model; what its file prints is a message, not data."""
    with redirect_stdout(sys.stderr):
        read: Mechanism | ConstraintSystem = kc.read_model(model)
    return read


def require_output(path: str | Path, read: str, what: str) -> None:
    """Refuse an output that cannot be written, or that is a file which is read."""
    require_writable(path)
    if Path(path).exists() and Path(read).exists() and Path(path).samefile(read):
        raise InputError(f"{path} is {what}; give another name to write to")


def output_option(text: str, *, required: bool = True) -> Callable[[Command], Command]:
    """Return the option ``-o FILE``."""
    return click.option("-o", "--output", required=required, metavar="FILE", help=text)


def set_option(what: str) -> Callable[[Command], Command]:
    """Return the option ``--set NAME=VALUE``, which gives values by name."""
    text = f"Value of a {what}, such as a=0.25 or phi=30deg; may be given several times."
    return click.option(
        "--set", "values", multiple=True, metavar="NAME=VALUE", help=text, callback=_values
    )


def _values(
    context: click.Context, option: click.Parameter, given: tuple[str, ...]
) -> dict[str, str]:
    """Return what is set, as text; the last one counts where one is set twice."""
    del context, option
    pairs = [assignment.partition("=") for assignment in given]
    wrong = [f"--set {name}{sign}{text}" for name, sign, text in pairs if not text.strip()]
    if wrong:
        raise InputError(
            f"{item}: give NAME=VALUE with a number, such as a=0.25 or phi=30deg" for item in wrong
        )
    return {name.strip(): text for name, _, text in pairs}


def set_values(model: Mechanism | ConstraintSystem, given: Mapping[str, str]) -> dict[str, float]:
    """Return the numbers that are set, angles in radians.

    Raises
    ------
    InputError
        With every value that is no number, or in degrees where it is no angle.
    """
    units: dict[str, str] = {item.name: str(item.unit) for item in model.parameters}
    if any("deg" in text for name, text in given.items() if name not in units):
        units |= {item.name: item.unit for item in model.system().coordinates}
    values: dict[str, float] = {}
    problems: list[str] = []
    for name, text in given.items():
        try:
            values[name] = number(text, f"--set {name}={text}", {}, units.get(name, ""))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return values


def number(text: str, what: str, names: Mapping[str, float], unit: str = "") -> float:
    """Return the number that a text is: plain, in degrees, or a formula of names.

    Parameters
    ----------
    text
        For instance ``0.25``, ``30deg``, ``pi/6`` or ``60/n``.
    what
        The option, for messages.
    names
        The numbers of names that may occur.
    unit
        The unit of the number; degrees become radians, and what is in degrees stays.

    Raises
    ------
    InputError
        If it is no finite number, or in degrees where it is no angle.
    """
    written = re.sub(r"(?<=[0-9.])\s*deg\b", "*deg", text)
    try:
        value = _value(written, names)
    except NotAnExpressionError as error:
        why = error.problem if isinstance(error, ExpressionError) else str(error)
        raise InputError(f"{what}: give a number, such as 0.25 or 30deg: {why}") from None
    problem = degrees_problem(value, unit)
    found = number_in(value, unit, dict(names))
    if problem is None and found is not None:
        return found
    raise InputError(f"{what}: {problem or 'it is not a finite number'}")


def _value(text: str, names: Mapping[str, float]) -> Scalar:
    """Return a plain number, or a formula."""
    try:
        return as_expression(float(text))
    except NotAnExpressionError:
        raise
    except ValueError:
        return parse_expression(text, {name: sympy.Symbol(name) for name in names})


def print_data(text: str) -> None:
    """Write data to stdout; an error of the system becomes an `InputError`."""
    try:
        click.echo(text, nl=False)
    except OSError as error:
        raise InputError(f"cannot write to stdout: {error.strerror}") from error
