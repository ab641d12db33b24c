"""Columns by name: which coordinate or output a name means, and which of its rates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import probe_of
from kincompile.errors import InputError
from kincompile.names import column_name, listed, rate_of, suggestion
from kincompile.runtime.inputs import names_of
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
    """Return the column that a name means; refuse one that would need a third derivative of q."""
    known = (*module.COORDINATES, *getattr(module, "OUTPUTS", ()))
    wanted = column_name(str(name))
    if found := rate_of(wanted, known):
        _require_rate(module, *found)
        return Column(wanted, rate_unit(module.UNITS.get(found[0], ""), found[1]), *found)
    near = suggestion(wanted, known) or "."
    raise InputError(
        f"{module.NAME} has no coordinate, point or output {name!r}{near} There are "
        f"{listed(known)}; add _dot or _ddot for the rates."
    )


def _require_rate(module: ModuleType, of: str, order: int) -> None:
    """Check that an output has a rate of this order; those of third derivatives are NaN."""
    outputs = getattr(module, "OUTPUTS", ())
    if of not in outputs or order == 0:
        return
    probe = probe_of(len(module.GUESS))
    with np.errstate(all="ignore"):
        seen = np.array(module.observe(module.GUESS, probe, probe**2, 0.0, module.DEFAULTS))
    y = seen[:, outputs.index(of)]
    if np.isfinite(y[0]) and np.isnan(y[order]):
        which = ("rate", "second rate")[order - 1]
        raise InputError(
            f"{module.NAME}: the output {of!r} has no {which}, since it has rates or accelerations "
            "in it: that would take third derivatives of the coordinates, and they are not solved "
            "for."
        )


def columns_of(module: ModuleType, names: Iterable[str] | str | None) -> list[Column]:
    """Return the columns that are named; without names the outputs, or else the coordinates."""
    if names is None:
        names = getattr(module, "OUTPUTS", ()) or module.COORDINATES
    found: list[Column] = []
    problems: list[str] = []
    for name in names_of(names, "of"):
        try:
            found.append(column_of(module, name))
        except InputError as error:
            problems += error.problems
    if problems or not found:
        raise InputError(problems or f"no column of {module.NAME} is asked for: name one.")
    return list(dict.fromkeys(found))
