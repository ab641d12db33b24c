"""Which coordinate or output the name of a column means, and which of its rates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.errors import InputError
from kincompile.names import column_name, listed, rate, rate_of, suggestion

if TYPE_CHECKING:
    from collections.abc import Sequence

RATES = range(3)
"""Orders of columns: values, rates and second rates."""

VALUES = range(1)
"""Orders of columns of which no rate is asked for."""

ADVICE = "add _dot or _ddot for the rates"


def column_meant(
    owner: str,
    given: object,
    coordinates: Sequence[str],
    outputs: Sequence[str] = (),
    *,
    orders: Sequence[int] = RATES,
    advice: str = ADVICE,
) -> tuple[str, int]:
    """Return the coordinate or output of which a column is the rate, and the order of the rate.

    Parameters
    ----------
    owner
        Who has the columns, for the message.
    given
        The name of the column, as ``"phi_rod_dot"`` or ``"rod.phi_dot"``.
    coordinates, outputs
        Names of those that have columns.
    orders
        Orders of rates that may be asked for.
    advice
        How further columns are had, for the message.

    Raises
    ------
    InputError
        When no column has this name; the message lists those that exist.
    """
    names = (*coordinates, *outputs)
    if found := rate_of(str(given), names, orders):
        return found
    every = (rate(name, order) for order in orders for name in names)
    near = suggestion(column_name(str(given)), every) or "."
    others = f", the outputs {listed(outputs)}" if outputs else ""
    raise InputError(
        f"{owner} has no column {given!r}{near} The coordinates are {listed(coordinates)}{others}; "
        f"{advice}."
    )
