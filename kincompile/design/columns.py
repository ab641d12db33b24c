"""Columns by name: which coordinate or output a name means, and which of its rates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import probe_of
from kincompile.errors import InputError
from kincompile.names import rate, rate_unit
from kincompile.runtime.engine.code import column_meant
from kincompile.runtime.inputs import names_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.runtime.engine.code import Compiled

ANGLES = {"deg": "rad"}
"""Units in which angles may be asked for, and those of the columns."""


@dataclass(frozen=True, slots=True)
class Column:
    """A coordinate or an output, or one of its rates: its name, unit, what it is a rate of."""

    name: str
    unit: str
    of: str
    order: int


def column_of(code: Compiled, name: str) -> Column:
    """Return the column that a name means; refuse one that would need a third derivative of q."""
    of, order = column_meant(code.name, name, code.coordinates, code.outputs)
    _require_rate(code, of, order)
    return Column(rate(of, order), rate_unit(code.units.get(of, ""), order), of, order)


def _require_rate(code: Compiled, of: str, order: int) -> None:
    """Check that an output has a rate of this order; those of third derivatives are NaN."""
    if of not in code.outputs or order == 0:
        return
    probe = probe_of(code.guess.size)
    with np.errstate(all="ignore"):
        seen = np.array(code.observe(code.guess, probe, probe**2, 0.0, code.defaults))
    y = seen[:, code.outputs.index(of)]
    if np.isfinite(y[0]) and np.isnan(y[order]):
        which = ("rate", "second rate")[order - 1]
        raise InputError(
            f"{code.name}: the output {of!r} has no {which}, since it has rates or accelerations "
            "in it: that would take third derivatives of the coordinates, and they are not solved "
            "for."
        )


def columns_of(code: Compiled, names: Iterable[str] | str | None) -> list[Column]:
    """Return the columns that are named; without names the outputs, or else the coordinates."""
    if names is None:
        names = code.outputs or code.coordinates
    found: list[Column] = []
    problems: list[str] = []
    for name in names_of(names, "of"):
        try:
            found.append(column_of(code, name))
        except InputError as error:
            problems += error.problems
    if problems or not found:
        raise InputError(problems or f"no column of {code.name} is asked for: name one.")
    return list(dict.fromkeys(found))
