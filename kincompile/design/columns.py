"""Columns by name: which coordinate or output a name means, and which of its rates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.errors import InputError
from kincompile.names import column_name, listed, rate, suggestion
from kincompile.runtime.results.columns import rate_unit

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import ModuleType

ANGLES = {"deg": "rad"}
"""Units in which angles may be asked for, and those of the columns."""


@dataclass(frozen=True, slots=True)
class Column:
    """A coordinate or an output, or one of its rates: its name, unit, what it is a rate of."""

    name: str
    unit: str
    of: str
    order: int


def column_of(module: ModuleType, name: str) -> Column:
    """Return the column that a name means; refuse another name."""
    known = (*module.COORDINATES, *getattr(module, "OUTPUTS", ()))
    wanted = column_name(str(name))
    for of in known:
        for order in range(3):
            if rate(of, order) == wanted:
                return Column(wanted, rate_unit(module.UNITS.get(of, ""), order), of, order)
    near = suggestion(wanted, known) or "."
    raise InputError(
        f"{module.NAME} has no coordinate, point or output {name!r}{near} There are "
        f"{listed(known)}; add _dot or _ddot for the rates."
    )


def columns_of(module: ModuleType, names: Iterable[str] | str | None) -> list[Column]:
    """Return the columns that are named; without names the outputs, or else the coordinates."""
    if names is None:
        names = getattr(module, "OUTPUTS", ()) or module.COORDINATES
    found: list[Column] = []
    problems: list[str] = []
    for name in (names,) if isinstance(names, str) else names:
        try:
            found.append(column_of(module, name))
        except InputError as error:
            problems += error.problems
    if problems or not found:
        raise InputError(problems or f"no column of {module.NAME} is asked for: name one.")
    return list(dict.fromkeys(found))
