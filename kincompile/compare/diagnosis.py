"""Explanations of entries that differ: a look-up in the catalogue of faults, by numbers.

A fault explains a set of entries if it gives the author's numbers in each of them. One fault that
explains all the entries of a constraint that differ comes first; then faults that explain some.
Explanations that give the same numbers are equivalent, and are all named.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compare.agreement import ABSOLUTE
from kincompile.compare.comparison import Diagnosis
from kincompile.compare.entry_faults import entry_faults
from kincompile.compare.fault import LEFT_ZERO
from kincompile.compare.joint_faults import Index, JointFaults, NumericFault
from kincompile.compare.vectors import with_roles_exchanged
from kincompile.model.resolve import Joint

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.compare.reference import ConstraintBlock, Reference
    from kincompile.compare.states import Array, States

CLOSE = 1e-8
"""Relative; wider than for equality, so that the fault named is not missed by rounding."""
ROUNDED = 3e-3
"""Relative difference up to which a constant was perhaps rounded to three digits."""
MOST_NAMED = 6

ROUNDED_NUMBER = "rounded number"
NOT_DEFINED = "not defined"
_NOT_DEFINED = Diagnosis(
    NOT_DEFINED,
    "it has no finite value at some states where the right one has: it divides by zero, or "
    "takes a root or logarithm of a negative number",
)


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
        self._catalogues: dict[tuple[str, str, bool], list[NumericFault]] = {}
        self._entries: dict[tuple[str, Index], list[NumericFault]] = {}
        self._generated = reference.values(states)

    def explain(
        self, block: ConstraintBlock, quantity: str, written: Mapping[Index, Array], exchanged: bool
    ) -> dict[Index, tuple[Diagnosis, ...]]:
        """Return the explanations of every entry of a constraint that differs.

        Parameters
        ----------
        block
            The constraint.
        quantity
            Phi, Phi_q, nu or gamma.
        written
            Values by row and column of the system, shape (N,), with the author's conventions taken
            out: comparable to the generated values as they are.
        exchanged
            Whether its author has the roles of bodies i and j exchanged.
        """
        left = {place: values for place, values in written.items() if np.isfinite(values).all()}
        found: dict[Index, tuple[Diagnosis, ...]] = {}
        found |= dict.fromkeys(written.keys() - left.keys(), (_NOT_DEFINED,))
        catalogue = self._catalogue(block, quantity, exchanged)
        found |= _explained(left, [fault for fault in catalogue if len(fault.result) > 1])
        # One entry alone is looked at as it is typed first, in sines and cosines.
        typed = [fault for place in left for fault in self._entry_catalogue(quantity, place)]
        catalogue = [*typed, *catalogue]
        found |= _explained(left, catalogue)
        for place, values in left.items():
            found[place] = self._one_entry(quantity, place, values, catalogue)
        return found

    def is_one_fault(
        self, block: ConstraintBlock, quantity: str, written: Mapping[Index, Array], exchanged: bool
    ) -> bool:
        """Return whether a single fault in vectors explains all the entries; see `explain`."""
        return any(
            len(fault.result) == len(written) and _fits(fault, written)
            for fault in self._catalogue(block, quantity, exchanged)
        )

    def _catalogue(
        self, block: ConstraintBlock, quantity: str, exchanged: bool
    ) -> list[NumericFault]:
        """Return the faults in vectors of a constraint, by row and column of the system."""
        joint = block.constraint if isinstance(block.constraint, Joint) else None
        if joint is not None and exchanged:
            joint = with_roles_exchanged(joint)
        if joint is None:
            return []
        key = (joint.name, quantity, exchanged)
        if key not in self._catalogues:
            numbers: dict[str | None, int] = {
                name: k for k, name in enumerate(self._reference.coordinates)
            }
            columns = [numbers.get(name) for name in joint.columns]
            self._catalogues[key] = []
            for fault in JointFaults(joint, quantity, self._reference, self._states).faults():
                result = {
                    (block.rows[row], target): values
                    for (row, column), values in fault.result.items()
                    if (target := columns[column] if quantity == "Phi_q" else 0) is not None
                }
                if result:  # a fault in the columns of the ground alone does not show
                    self._catalogues[key].append(replace(fault, result=result))
        return self._catalogues[key]

    def _entry_catalogue(self, quantity: str, place: Index) -> list[NumericFault]:
        key = (quantity, place)
        if key not in self._entries:
            row, column = place
            self._entries[key] = list(
                entry_faults(self._reference, quantity, row, column, self._states)
            )
        return self._entries[key]

    def _one_entry(
        self, quantity: str, place: Index, values: Array, catalogue: list[NumericFault]
    ) -> tuple[Diagnosis, ...]:
        """Explain an entry alone: by a fault that should show elsewhere too, or not at all."""
        partly = _named(
            fault
            for fault in catalogue
            if place in fault.result and _close(fault.result[place], values)
        )
        if partly:
            return tuple(
                replace(item, text=f"{item.text} (in this entry alone)") for item in partly
            )
        right = self._generated.of(quantity)[:, place[0], place[1]]
        size, off = np.max(np.abs(right)), np.max(np.abs(values - right))
        if size > ABSOLUTE and off <= ROUNDED * size:
            text = (
                f"it is right to {off / size:.1e} of its size: a number was rounded; write more "
                "digits, or a formula"
            )
            return (Diagnosis(ROUNDED_NUMBER, text),)
        return ()


def _explained(
    left: dict[Index, Array], catalogue: Sequence[NumericFault]
) -> dict[Index, tuple[Diagnosis, ...]]:
    """Take out the entries that faults explain, those first that explain the most."""
    found: dict[Index, tuple[Diagnosis, ...]] = {}
    while fitting := [fault for fault in catalogue if _fits(fault, left)]:
        places = max(fitting, key=lambda fault: len(fault.result)).result.keys()
        named = _named(fault for fault in fitting if fault.result.keys() == places)
        for place in places:
            del left[place]
            found[place] = named
    return found


def _fits(fault: NumericFault, left: Mapping[Index, Array]) -> bool:
    """Return whether a fault shows in entries that differ only, with the author's numbers."""
    return all(
        place in left and _close(values, left[place]) for place, values in fault.result.items()
    )


def _close(one: Array, other: Array) -> bool:
    size = np.maximum(np.max(np.abs(one)), np.max(np.abs(other)))
    return bool(np.max(np.abs(one - other)) <= CLOSE * size + ABSOLUTE)


def _named(faults: Iterable[NumericFault]) -> tuple[Diagnosis, ...]:
    """Return one diagnosis for each kind of fault, the first of its kind."""
    by_kind: dict[str, NumericFault] = {}
    for fault in faults:
        by_kind.setdefault(fault.kind, fault)
    if LEFT_ZERO in by_kind and not any(map(np.any, by_kind[LEFT_ZERO].result.values())):
        # Zero was written. That a missing term would also give zero is no further explanation.
        by_kind = {LEFT_ZERO: by_kind[LEFT_ZERO]}
    return tuple(
        Diagnosis(fault.kind, f"{fault.text}.", fault.detail)
        for fault in list(by_kind.values())[:MOST_NAMED]
    )
