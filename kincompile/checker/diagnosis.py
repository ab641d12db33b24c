"""Explanations of entries that differ: a look-up in the catalogue of faults, by numbers.

A fault explains a set of entries if it gives the author's numbers in each of them. One fault that
explains all the entries of a constraint that differ comes first; then faults that explain some.
Explanations that give the same numbers are equivalent, and are all named.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.checker.agreement import ABSOLUTE, ROUNDING, Given, finite, is_close
from kincompile.checker.comparison import Diagnosis
from kincompile.checker.entry_faults import TypedEntry
from kincompile.checker.fault import OMISSIONS, TERM_SIGN, Fault, Kind, showing
from kincompile.checker.forms import known_forms
from kincompile.checker.gamma_faults import PARTS_OF_GAMMA
from kincompile.checker.given_forms import Subject
from kincompile.checker.joint_faults import JointFaults
from kincompile.checker.misread import Misread
from kincompile.derive.equations import derive_equation
from kincompile.model.resolve import FreeEquation, Joint

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from kincompile.checker.fault import Index, NumericFault, Shown
    from kincompile.checker.forms import Form
    from kincompile.checker.reference import ConstraintBlock, Reference
    from kincompile.checker.states import Array, States

ROUNDED = 3e-3
"""Relative difference up to which a constant was perhaps rounded to three digits."""
MOST_NAMED = 6

_Key = tuple[tuple[int, ...], str, "Form | None"]
"""The rows of a constraint, a quantity and the form it is in."""

ROUNDED_NUMBER = "rounded number"
NOT_DEFINED = "not defined"
FEW_DIGITS, CANCEL = "too few digits", "terms that cancel"
_NOT_DEFINED = Diagnosis(
    NOT_DEFINED,
    "it has no finite value at some states where the right one has: it divides by zero, or "
    "takes a root or logarithm of a negative number",
)


def undecided_diagnosis(given: Given) -> Diagnosis:
    """Return why it cannot be decided whether an entry, (N,), is right, and what to do."""
    if np.max(finite(given.typed + given.printed)) > np.max(ROUNDING * finite(given.sizes)):
        text = (
            "it cannot be decided: half of the last digit of its numbers is too much beside the "
            "entry. Write more digits, or a formula."
        )
        return Diagnosis(FEW_DIGITS, text)
    text = (
        "it cannot be decided: terms that cancel are so large that their rounding hides the rest. "
        "Write the entry without them."
    )
    return Diagnosis(CANCEL, text)


class Diagnostician:
    """Explains differences in the formulas of one system; keeps the catalogues that it has made."""

    def __init__(self, reference: Reference, states: States) -> None:
        self._reference = reference
        self._states = states
        self._catalogues: dict[_Key, list[NumericFault]] = {}
        self._misread: dict[_Key, tuple[Misread, list[NumericFault]]] = {}
        self._entries: dict[tuple[str, Index, Form | None], TypedEntry] = {}

    def explain(
        self,
        block: ConstraintBlock,
        quantity: str,
        written: Mapping[Index, Shown],
        form: Form | None,
    ) -> dict[Index, tuple[Diagnosis, ...]]:
        """Return the explanations of every entry of a constraint that differs.

        Parameters
        ----------
        written
            By row and column of the system, with the author's conventions taken out: comparable to
            the generated values as they are.
        form
            The form in which its author has it, None where it is written as generated.
        """
        left, found = defined(written)
        joint = block.constraint if form is None else form.joint

        def vectors() -> Iterable[NumericFault]:
            if isinstance(joint, Joint):
                yield from self._faults_of(joint, block, quantity, left)

        return found | looked_up(
            left,
            self._right(quantity, form),
            self._catalogue(block, quantity, form),
            [*self._of_several(block, quantity, form, left)],
            lambda place: self._typed(quantity, place, form),
            vectors,
        )

    def is_one_fault(
        self, block: ConstraintBlock, written: Mapping[Index, Shown], form: Form | None
    ) -> bool:
        """Return whether a single fault in vectors explains entries of Phi_q; see `explain`.

        The sign of a whole row is not a fault: it is a way to write the row.
        """
        return any(
            fault.kind != Kind.SIGN and len(fault.result) == len(written) and _fits(fault, written)
            for fault in self._catalogue(block, "Phi_q", form)
        )

    def _catalogue(
        self, block: ConstraintBlock, quantity: str, form: Form | None
    ) -> list[NumericFault]:
        """Return the faults in vectors of a constraint, by row and column of the system."""
        joint = block.constraint if form is None else form.joint
        key = (block.rows, quantity, form)
        if key not in self._catalogues:
            faults: Iterable[NumericFault] = ()
            if isinstance(joint, Joint):
                faults = self._faults_of(joint, block, quantity)
            elif isinstance(joint, FreeEquation) and quantity == "gamma":
                # Its three parts are by the coordinates.
                is_by_q = self._reference.base is self._reference
                faults = self._missing_in_equations(joint, block) if is_by_q else ()
            self._catalogues[key] = [*faults, *self._other_forms(block, quantity, form)]
        return self._catalogues[key]

    def _faults_of(
        self,
        joint: Joint,
        block: ConstraintBlock,
        quantity: str,
        given: Mapping[Index, Shown] | None = None,
    ) -> Iterator[NumericFault]:
        """Yield the faults of a joint's vectors, or the vectors that fit the entries given."""
        columns = [self._reference.columns.get(name or "") for name in joint.columns]
        columns = columns if quantity == "Phi_q" else [0]
        # The columns of the ground have no place in the system.
        system = {
            (row, column): (block.rows[row], target)
            for row in range(len(block.rows))
            for column, target in enumerate(columns)
            if target is not None
        }
        own = JointFaults(joint, quantity, self._reference, self._states)
        faults = own.faults()
        if given is not None:
            faults = own.other_vectors(
                {place: given[item][0] for place, item in system.items() if item in given}
            )
        for fault in faults:
            result = {
                system[place]: values for place, values in fault.result.items() if place in system
            }
            if result:  # a fault in the columns of the ground alone does not show
                yield replace(fault, result=result)

    def _missing_in_equations(
        self, equation: FreeEquation, block: ConstraintBlock
    ) -> Iterator[NumericFault]:
        for row, Phi in zip(block.rows, equation.expressions, strict=True):
            terms = derive_equation(Phi, equation.columns).gamma_terms
            values, _ = self._reference.evaluate(terms, self._states)
            for k, (kind, text) in enumerate(PARTS_OF_GAMMA):
                rest = np.delete(values, k, axis=1).sum(axis=1)
                if np.any(values[:, k]) and np.any(rest):
                    yield Fault(kind, text, {(row, 0): rest})

    def _other_forms(
        self, block: ConstraintBlock, quantity: str, form: Form | None
    ) -> Iterator[NumericFault]:
        """Yield the formulas that are right for another Phi than the author's."""
        if quantity == "Phi":
            return
        right, others = self._right(quantity, form), []
        if form is not None and form.defines:
            others.append(("another form of the equation", self._right(quantity, None)))
        if form is None:
            subject = Subject(self._reference, block, self._states)
            others += [(x.text, self._right(quantity, x)) for x in known_forms(block, subject)]
        places = [(row, column) for row in block.rows for column in range(right.shape[-1])]
        for text, values in others:
            text = f"it belongs to {text}, and not to your Phi"
            yield from showing(Kind.OTHER_FORM, text, values, right, places)

    def _right(self, quantity: str, form: Form | None, states: States | None = None) -> Array:
        """Return the right formulas; at other states than those of the comparison if given."""
        states = self._states if states is None else states
        right = self._reference.values(states).of(quantity)
        if form is not None:
            right = right.copy()
            right[:, list(form.rows)] = form.evaluate(states)[quantity]
        return right

    def _typed(self, quantity: str, place: Index, form: Form | None) -> TypedEntry:
        key = (quantity, place, form)
        if key not in self._entries:
            reference, row = self._reference, place[0]
            if form is not None and form.formulas is not None:
                reference, row = form.formulas, form.rows.index(place[0])
            derived = reference.expression(quantity, row, place[1])
            self._entries[key] = TypedEntry(reference, quantity, derived, self._states)
        return self._entries[key]

    def _of_several(
        self,
        block: ConstraintBlock,
        quantity: str,
        form: Form | None,
        left: Mapping[Index, Shown],
    ) -> Iterator[NumericFault]:
        """Yield faults that show in several entries, of any formulas: joints or free equations."""
        if not left:
            return
        key = (block.rows, quantity, form)
        right_at = partial(self._right, quantity, form)
        if key not in self._misread:
            own = Misread(self._reference, block, quantity, self._states, right_at)
            self._misread[key] = own, [*own.faults()]
        own, faults = self._misread[key]
        columns = {column for _, column in left} if quantity == "Phi_q" else ()
        yield from own.exchanged_columns(columns)
        yield from faults


def defined(
    written: Mapping[Index, Shown],
) -> tuple[dict[Index, Shown], dict[Index, tuple[Diagnosis, ...]]]:
    """Return the entries that have finite values, and what is said of the others."""
    left = {place: item for place, item in written.items() if np.isfinite(item[0]).all()}
    return left, dict.fromkeys(written.keys() - left.keys(), (_NOT_DEFINED,))


def looked_up(
    left: dict[Index, Shown],
    right: Array,
    catalogue: Sequence[NumericFault],
    several: Sequence[NumericFault],
    entry_of: Callable[[Index], TypedEntry | None],
    vectors: Callable[[], Iterable[NumericFault]],
) -> dict[Index, tuple[Diagnosis, ...]]:
    """Return the explanations of entries that differ, none where the catalogue has none.

    Parameters
    ----------
    left
        The author's values of these entries.
    right
        The right values of all, (N, rows, columns).
    catalogue, several
        Faults of a whole formula, and those that show in several entries.
    entry_of
        Gives an entry as it is typed, None where only its numbers are known.
    vectors
        Gives the vectors that fit entries which nothing else explains.
    """
    found: dict[Index, tuple[Diagnosis, ...]] = {}
    for faults in (catalogue, several):
        found |= _explained(left, [fault for fault in faults if len(fault.result) > 1])
    # One entry alone is looked at as it is typed first, in sines and cosines.
    made = {place: entry_of(place) for place in left}
    entries = {place: entry for place, entry in made.items() if entry is not None}
    typed: list[NumericFault] = [
        Fault(fault.kind, fault.text, {place: fault.result}, fault.detail)
        for place, entry in entries.items()
        for fault in entry.usual(left[place])
    ]
    catalogue = [*typed, *catalogue]
    found |= _explained(left, catalogue)
    for place, given in left.items():
        found[place] = (
            _one_entry(place, given, right[:, place[0], place[1]], catalogue)
            or _named(entries[place].one(given) if place in entries else ())
            or _named(_at(place, given, several))
        )
    # What is left is no slip of one entry: another vector, or two slips at once.
    if not all(found.values()):
        others = [*vectors()]
        found |= {
            place: found[place] or _named(fault for fault in others if place in fault.result)
            for place in left
        }
    for place in left.keys() & entries.keys():
        found[place] = found[place] or _named(entries[place].two(left[place]))
    return found


def _at(place: Index, given: Shown, catalogue: Iterable[NumericFault]) -> Iterator[Fault[Array]]:
    """Yield the faults that show in one entry alone, and explain it."""
    for fault in catalogue:
        if fault.result.keys() == {place} and is_close(fault.result[place], *given):
            yield Fault(fault.kind, fault.text, fault.result[place], fault.detail)


def _one_entry(
    place: Index, given: Shown, right: Array, catalogue: Sequence[NumericFault]
) -> tuple[Diagnosis, ...]:
    """Explain an entry alone: by a fault that should show elsewhere too, or not at all."""
    partly = _named(
        fault
        for fault in catalogue
        if place in fault.result and is_close(fault.result[place], *given)
    )
    if partly:
        return tuple(replace(item, text=f"{item.text} (in this entry alone)") for item in partly)
    size, off = np.max(np.abs(right)), np.max(np.abs(given[0] - right))
    if size > ABSOLUTE and off <= ROUNDED * size:
        text = (
            f"it is right to {off / size:.1e} of its size: a number was rounded; write more "
            "digits, or a formula"
        )
        return (Diagnosis(ROUNDED_NUMBER, text),)
    return ()


def _explained(
    left: dict[Index, Shown], catalogue: Sequence[NumericFault]
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


def _fits(fault: NumericFault, left: Mapping[Index, Shown]) -> bool:
    """Return whether a fault shows in entries that differ only, with the author's numbers."""
    return all(
        place in left and is_close(values, *left[place]) for place, values in fault.result.items()
    )


def _named(faults: Iterable[Fault[Any]]) -> tuple[Diagnosis, ...]:
    """Return one diagnosis for each kind of fault, the first of its kind."""
    faults = list(faults)
    by_kind: dict[str, Fault[Any]] = {}
    for fault in faults:
        by_kind.setdefault(fault.kind, fault)
    zero = by_kind.get(Kind.LEFT_ZERO)
    if zero is not None and not any(map(np.any, zero.result.values())):
        # Zero was written. That a missing term would also give zero is no further explanation.
        by_kind = {Kind.LEFT_ZERO: zero}
    if Kind.MISSING_TERM in by_kind and OMISSIONS.intersection(by_kind):
        # Last: it says less of the same.
        by_kind[Kind.MISSING_TERM] = by_kind.pop(Kind.MISSING_TERM)
    signs = [fault for fault in faults if fault.kind == Kind.SIGN]
    if Kind.TRANSPOSED in by_kind and [fault.text for fault in signs] == [TERM_SIGN]:
        # The sign is the effect of a transposed rotation on one entry: one sentence says both.
        cause, shown = by_kind[Kind.TRANSPOSED], by_kind.pop(Kind.SIGN)
        text = f"{shown.text}, as where {cause.text}"
        by_kind[Kind.TRANSPOSED] = replace(cause, text=text, detail=shown.detail)
    return tuple(
        Diagnosis(fault.kind, f"{fault.text}.", fault.detail)
        for fault in list(by_kind.values())[:MOST_NAMED]
    )
