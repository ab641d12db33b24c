"""Which symbols a formula depends on, found by changing one symbol at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compare.states import Array, States
from kincompile.names import listed, rate

if TYPE_CHECKING:
    from kincompile.compare.reference import Reference

Evaluate = Callable[[States], Mapping[str, Array]]
"""Gives quantities by name, (N, rows, columns) each."""

CHANGE = 1.17  # any factor will do that is no symmetry of a formula
SAME = 1e-9


class Dependence:
    """What two sets of formulas, and their difference, depend on.

    Parameters
    ----------
    reference
        The system whose coordinates, rates and parameters are changed.
    states
        Where to evaluate.
    written, expected
        The formulas as written and as they should be.
    """

    def __init__(
        self, reference: Reference, states: States, written: Evaluate, expected: Evaluate
    ) -> None:
        self._evaluate = (written, expected)
        self._states = states
        self._base = self._all(states)
        self._changed: dict[str, list[Mapping[str, Array]]] = {}
        for name, changed in _changes(reference, states):
            now = self._all(changed)
            self._changed[name] = [
                {quantity: _differs(one[quantity], other[quantity]) for quantity in one}
                for one, other in zip(self._base, now, strict=True)
            ]
        faster = self._all(replace(states, q_dot=2 * states.q_dot))[2]
        self._ratio = {name: _ratio(faster[name], self._base[2][name]) for name in faster}

    def _all(self, states: States) -> list[Mapping[str, Array]]:
        """Evaluate what is written, what should be, and the difference."""
        written, expected = (evaluate(states) for evaluate in self._evaluate)
        difference = {name: written[name] - expected[name] for name in written}
        return [written, expected, difference]

    def text(self, quantity: str, row: int, column: int) -> str:
        """Say which symbols are missing or extra in an entry, and what the difference is like."""
        hand, generated, difference = (
            {name for name, found in self._changed.items() if found[k][quantity][row, column]}
            for k in range(3)
        )
        parts = []
        if generated - hand:
            parts.append(f"missing: {listed(sorted(generated - hand))}")
        if hand - generated:
            parts.append(f"extra: {listed(sorted(hand - generated))}")
        parts.append(
            f"the difference depends on {listed(sorted(difference))}"
            if difference
            else "the difference is a constant number"
        )
        order = _ORDERS.get(round(float(self._ratio[quantity][row, column]), 6))
        if quantity == "gamma" and order:
            parts.append(f"it is {order} in the velocities")
        return f"no fault of the catalogue fits; {'; '.join(parts)}."


_ORDERS = {2.0: "linear", 4.0: "quadratic"}


def _changes(reference: Reference, states: States) -> list[tuple[str, States]]:
    """Return the states with one symbol changed, by its name."""
    found = []
    for k, name in enumerate(reference.coordinates):
        found.append((name, replace(states, q=_scaled(states.q, k))))
        found.append((rate(name), replace(states, q_dot=_scaled(states.q_dot, k))))
    for k, item in enumerate(reference.system.parameters):
        found.append((item.name, replace(states, p=_scaled(states.p, k))))
    found.append(("t", replace(states, t=CHANGE * states.t)))
    return found


def _scaled(array: Array, column: int) -> Array:
    changed = np.array(array)
    changed[:, column] *= CHANGE
    return changed


def _differs(one: Array, other: Array) -> Array:
    """Return for every entry whether two evaluations differ, shape (rows, columns)."""
    one, other = np.nan_to_num(one), np.nan_to_num(other)
    size = np.max(np.abs(one) + np.abs(other), axis=0)
    return np.asarray(np.max(np.abs(one - other), axis=0) > SAME * size)


def _ratio(faster: Array, base: Array) -> Array:
    """Return by what a difference grows at twice the velocities; NaN where it is not one number."""
    with np.errstate(all="ignore"):
        ratios = faster / base
    same = np.ptp(ratios, axis=0) <= 1e-6
    return np.asarray(np.where(same, ratios[0], np.nan))
