"""What explains entries that differ: a look-up in the catalogue of faults, by numbers.

A fault explains a set of entries where it gives the author's numbers in each of them. One fault
that explains all the entries of a constraint that differ comes first; then faults that explain
some. Explanations that give the same numbers cannot be told apart, and are all named.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compare.agreement import ABSOLUTE
from kincompile.compare.elementary import entry_faults
from kincompile.compare.entries import Diagnosis
from kincompile.compare.faults import LEFT_ZERO, Fault, Place, VectorFaults
from kincompile.compare.vectors import with_roles_exchanged
from kincompile.model.resolve import Joint

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.compare.reference import Block, Reference
    from kincompile.compare.states import Array, States

CLOSE = 1e-8
"""Relative; wider than for equality, so that the fault named is not missed by rounding."""
ROUNDED = 3e-3
"""Relative difference up to which a constant was perhaps rounded to three digits."""
MOST_NAMED = 6

ROUNDED_NUMBER = "rounded number"
NOT_DEFINED = "not defined"


@dataclass(frozen=True, slots=True)
class Differing:
    """Entries of one quantity of one constraint that differ.

    Attributes
    ----------
    quantity
        Phi, Phi_q, nu or gamma.
    values
        By row and column of the system, what the author has there, with the conventions taken
        out: comparable to the generated values as they are, shape (N,).
    """

    quantity: str
    values: Mapping[Place, Array]


class Diagnostician:
    """Explains differences in the formulas of one system; keeps the catalogues that it has made.

    Parameters
    ----------
    reference
        The system.
    states
        Where formulas are compared.
    """

    def __init__(self, reference: Reference, states: States) -> None:
        self._reference = reference
        self._states = states
        self._catalogues: dict[tuple[str, str, bool], list[Fault]] = {}
        self._entries: dict[tuple[str, Place], list[Fault]] = {}
        self._generated = reference.values(states)

    def explain(
        self, block: Block, differing: Differing, exchanged: bool = False
    ) -> dict[Place, tuple[Diagnosis, ...]]:
        """Return the explanations of every entry.

        Parameters
        ----------
        block
            The constraint.
        differing
            What differs in it.
        exchanged
            Whether its author has the roles of bodies i and j exchanged.
        """
        left = dict(differing.values)
        found: dict[Place, tuple[Diagnosis, ...]] = {}
        catalogue = self._catalogue(block, differing.quantity, exchanged)
        for place in left:
            if not np.isfinite(left[place]).all():
                found[place] = (_not_defined(),)
        left = {place: values for place, values in left.items() if place not in found}
        for place in left:
            catalogue = [*catalogue, *self._entry_catalogue(differing.quantity, place)]
        while left:
            fitting = [fault for fault in catalogue if _fits(fault, left)]
            if not fitting:
                break
            most = max(len(fault.values) for fault in fitting)
            best = [fault for fault in fitting if len(fault.values) == most]
            places = set(best[0].values)
            same = [fault for fault in best if set(fault.values) == places]
            named = _named(same)
            found.update(dict.fromkeys(places, named))
            left = {place: values for place, values in left.items() if place not in places}
        for place, values in left.items():
            found[place] = self._one_entry(differing.quantity, place, values, catalogue)
        return found

    def is_one_fault(self, block: Block, differing: Differing, exchanged: bool) -> bool:
        """Return whether a single fault in vectors explains all the entries."""
        catalogue = self._catalogue(block, differing.quantity, exchanged)
        return any(
            len(fault.values) == len(differing.values) and _fits(fault, differing.values)
            for fault in catalogue
        )

    def _catalogue(self, block: Block, quantity: str, exchanged: bool) -> list[Fault]:
        """Return the faults in vectors of a constraint, by row and column of the system."""
        joint = block.constraint
        if not isinstance(joint, Joint):
            return []
        key = (joint.name, quantity, exchanged)
        if key not in self._catalogues:
            other = with_roles_exchanged(joint) if exchanged else joint
            assert other is not None
            faults = VectorFaults(other, quantity, self._reference, self._states).faults()
            placed = (self._placed(fault, other, block, quantity) for fault in faults)
            self._catalogues[key] = [fault for fault in placed if fault.values]
        return self._catalogues[key]

    def _placed(self, fault: Fault, joint: Joint, block: Block, quantity: str) -> Fault:
        """Return a fault by row and column of the system, without the columns of the ground."""
        if quantity != "Phi_q":
            values = {(block.rows[row], 0): item for (row, _), item in fault.values.items()}
        else:
            number = {name: k for k, name in enumerate(self._reference.coordinates)}
            values = {
                (block.rows[row], number[name]): item
                for (row, column), item in fault.values.items()
                if (name := joint.columns[column]) is not None
            }
        return Fault(fault.kind, fault.text, values, fault.detail)

    def _entry_catalogue(self, quantity: str, place: Place) -> list[Fault]:
        key = (quantity, place)
        if key not in self._entries:
            row, column = place
            self._entries[key] = list(
                entry_faults(self._reference, quantity, row, column, self._states)
            )
        return self._entries[key]

    def _one_entry(
        self, quantity: str, place: Place, values: Array, catalogue: list[Fault]
    ) -> tuple[Diagnosis, ...]:
        """Explain an entry alone: by a fault that should show elsewhere too, or not at all."""
        partly = [
            fault
            for fault in catalogue
            if place in fault.values and _close(fault.values[place], values)
        ]
        if partly:
            return tuple(
                Diagnosis(item.kind, f"{item.text} (in this entry alone)", item.detail)
                for item in _named(partly)
            )
        right = self._generated.of(quantity)[:, place[0], place[1]]
        size = np.max(np.abs(right))
        if size > ABSOLUTE and np.max(np.abs(values - right)) <= ROUNDED * size:
            return (
                Diagnosis(
                    ROUNDED_NUMBER,
                    f"it is right to {np.max(np.abs(values - right)) / size:.1e} of its size: a "
                    "number was rounded; write more digits, or a formula",
                ),
            )
        return ()


def _not_defined() -> Diagnosis:
    text = (
        "it has no finite value at some states where the right one has: it divides by zero, or "
        "takes a root or logarithm of a negative number"
    )
    return Diagnosis(NOT_DEFINED, text)


def _fits(fault: Fault, left: Mapping[Place, Array]) -> bool:
    """Return whether a fault shows in entries that differ only, with the author's numbers."""
    return all(
        place in left and _close(values, left[place]) for place, values in fault.values.items()
    )


def _close(one: Array, other: Array) -> bool:
    size = np.maximum(np.max(np.abs(one)), np.max(np.abs(other)))
    return bool(np.max(np.abs(one - other)) <= CLOSE * size + ABSOLUTE)


def _named(faults: list[Fault]) -> tuple[Diagnosis, ...]:
    """Return one diagnosis for each kind of fault, the first of its kind."""
    by_kind: dict[str, Fault] = {}
    for fault in faults:
        by_kind.setdefault(fault.kind, fault)
    if LEFT_ZERO in by_kind and all(np.all(v == 0) for v in by_kind[LEFT_ZERO].values.values()):
        # Zero is what was written; that it would also follow from a term missing says no more.
        by_kind = {LEFT_ZERO: by_kind[LEFT_ZERO]}
    return tuple(
        Diagnosis(fault.kind, _sentence(fault.text), fault.detail)
        for fault in list(by_kind.values())[:MOST_NAMED]
    )


def _sentence(text: str) -> str:
    return f"{text}."
