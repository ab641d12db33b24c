"""The symbols that a formula depends on, found by changing one symbol at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.agreement import finite
from kincompile.checker.reference import MOVING
from kincompile.checker.states import Array, States
from kincompile.names import listed, rate

if TYPE_CHECKING:
    from kincompile.checker.reference import Reference

Evaluate = Callable[[States], Mapping[str, tuple[Array, Array]]]
"""Gives the written and the right values by quantity, (N, rows, columns) each."""

CHANGE = 1.17  # any factor will do that is no symmetry of a formula
SAME = 1e-9
_ORDERS = {2.0: "linear", 4.0: "quadratic"}


class Dependence:
    """The symbols that written and right formulas, and their differences, depend on."""

    def __init__(self, reference: Reference, states: States, evaluate: Evaluate) -> None:
        self._evaluate = evaluate
        base = self._with_difference(states)
        self._changed: dict[str, list[dict[str, Array]]] = {}
        for name, changed in _changes(reference, states):
            now = self._with_difference(changed)
            self._changed[name] = [
                {quantity: _differs(one[quantity], other[quantity]) for quantity in one}
                for one, other in zip(base, now, strict=True)
            ]
        faster = self._with_difference(replace(states, q_dot=2 * states.q_dot))[2]
        self._growth = {name: _ratio(faster[name], base[2][name]) for name in faster}

    def _with_difference(self, states: States) -> list[Mapping[str, Array]]:
        pairs = self._evaluate(states)
        written, right = ({name: item[k] for name, item in pairs.items()} for k in range(2))
        return [written, right, {name: written[name] - right[name] for name in written}]

    def explanation(self, quantity: str, row: int, column: int) -> str:
        """Return which symbols are missing or extra in an entry, and how the difference varies."""
        written, right, difference = (
            {name for name, found in self._changed.items() if found[k][quantity][row, column]}
            for k in range(3)
        )
        parts = ["no fault of the catalogue fits"]
        if right - written:
            parts.append(f"missing: {listed(sorted(right - written))}")
        if written - right:
            parts.append(f"extra: {listed(sorted(written - right))}")
        depends = f"depends on {listed(sorted(difference))}"
        parts.append(f"the difference {depends if difference else 'is a constant number'}")
        order = _ORDERS.get(round(float(self._growth[quantity][row, column]), 6))
        if quantity in MOVING and order:
            parts.append(f"it is {order} in the velocities")
        return f"{'; '.join(parts)}."


def _changes(reference: Reference, states: States) -> list[tuple[str, States]]:
    found = [("t", replace(states, t=CHANGE * states.t))]
    for k, name in enumerate(reference.base.coordinates):
        found.append((name, replace(states, q=_scaled(states.q, k))))
        found.append((rate(name), replace(states, q_dot=_scaled(states.q_dot, k))))
    for k, item in enumerate(reference.system.parameters):
        found.append((item.name, replace(states, p=_scaled(states.p, k))))
    return found


def _scaled(array: Array, column: int) -> Array:
    changed = np.array(array)
    changed[:, column] *= CHANGE
    return changed


def _differs(one: Array, other: Array) -> Array:
    """Return for every entry whether two evaluations differ, shape (rows, columns)."""
    one, other = finite(one), finite(other)
    size = np.max(np.abs(one) + np.abs(other), axis=0)
    return np.asarray(np.max(np.abs(one - other), axis=0) > SAME * size)


def _ratio(faster: Array, base: Array) -> Array:
    """Return the growth of a difference at twice the velocities; NaN if it varies by state."""
    with np.errstate(all="ignore"):
        ratios = faster / base
    same = np.ptp(ratios, axis=0) <= 1e-6
    return np.asarray(np.where(same, ratios[0], np.nan))
