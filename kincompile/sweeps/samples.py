"""The values of a sweep's table as arrays: lists, equal steps, and samples that fill a box."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InputError
from kincompile.model.tasks import Span
from kincompile.names import listed

if TYPE_CHECKING:
    from kincompile.model.tasks import Sweep
    from kincompile.runtime.engine.code import Array


def values_of(table: Sweep) -> dict[str, Array]:
    """Return the values of each parameter of a table.

    Spans without a count are filled by the Halton sequence, whose points are the same on every
    machine, and spread evenly for every number of them.
    """
    spans = {name: item for name, item in table.parameters.items() if isinstance(item, Span)}
    filled = [name for name, item in spans.items() if item.count is None]
    if filled and table.product:
        raise InputError(
            f"sweep: {listed(filled)} would be sampled, and product = true takes every "
            "combination: give a count to each, or leave product out"
        )
    found: dict[str, Array] = {
        name: np.linspace(item.first, item.last, item.count)
        if isinstance(item, Span) and item.count is not None
        else np.array(item if not isinstance(item, Span) else (), dtype=np.float64)
        for name, item in table.parameters.items()
    }
    if filled:
        from scipy.stats import qmc  # half a second, for who needs it

        sequence = qmc.Halton(len(filled), scramble=False).fast_forward(1)  # the first is a corner
        unit = sequence.random(table.samples).T
        for name, place in zip(filled, unit, strict=True):
            found[name] = spans[name].first + place * (spans[name].last - spans[name].first)
    return found
