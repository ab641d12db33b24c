"""Formulas by hand beside what is right at some states: judged entry by entry, and reported.

Equations, loads and the maps of a transmission differ in how they are laid out, and in their
faults. When a number counts as right and what an entry is reported with are the same for all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from kincompile.checker.agreement import Given, Right, agrees, is_undecided, tolerance
from kincompile.checker.comparison import ComparedEntry, Convention, Diagnosis, Verdict
from kincompile.checker.dependence import Dependence
from kincompile.checker.diagnosis import undecided_diagnosis
from kincompile.checker.report import Report

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from kincompile.checker.fault import Index, Shown
    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States
    from kincompile.checker.written import Written

AnyJudged = TypeVar("AnyJudged", bound="Judged")

UNEXPLAINED = "not in the catalogue"

NUMBERS = Convention(
    "numbers for parameters",
    "numbers stand for parameters: everything is compared at the parameters' default values.",
)

Spot = tuple[str, int, int]
"""A quantity, and row and column of one of its entries as written."""


@dataclass(frozen=True, eq=False)
class Laid:
    """A quantity by hand as it is laid out, beside the right values in that order.

    Attributes
    ----------
    given, right
        The values, (N, rows, columns); a right column that is NaN is the ground's, not compared.
    rows, columns
        Names of the equations or outputs, and of the coordinates or inputs, None of a vector.
    is_plain
        By row, whether no convention concerns it.
    """

    written: Written
    given: Given
    right: Right
    rows: Sequence[str]
    columns: Sequence[str | None]
    is_plain: Sequence[bool]

    @cached_property
    def equal(self) -> Array:
        """Which entries are right at all states, (rows, columns)."""
        return np.asarray(np.all(agrees(self.given, self.right), axis=0))

    @property
    def wrong_count(self) -> int:
        """The number of entries that differ."""
        return int((~self.equal).sum())

    @property
    def verdicts(self) -> Iterator[tuple[Index, Verdict]]:
        """The verdict on each entry that is compared."""
        exact = np.asarray(np.all(agrees(self.given.exact, self.right), axis=0))
        is_open = agrees(self.given, self.right) | is_undecided(self.given, self.right)
        undecided = np.asarray(np.all(is_open, axis=0))
        compared = np.asarray(~np.isnan(self.right.values).all(axis=0))
        for place in np.ndindex(*self.equal.shape):
            row, column = place
            if self.equal[place]:
                is_plain = exact[place] and self.is_plain[row]
                yield (row, column), Verdict.EQUAL if is_plain else Verdict.CONVENTION
            elif compared[place]:
                yield (row, column), Verdict.UNDECIDED if undecided[place] else Verdict.DIFFERENT

    def shown(self, places: Iterable[Index]) -> dict[Index, Shown]:
        """Return the author's values of entries, and what rounding may have taken from them."""
        lost = tolerance(self.given, self.right)
        return {(i, j): (self.given.values[:, i, j], lost[:, i, j]) for i, j in places}


class Judged:
    """Formulas by hand at some states, from the layout to the report."""

    _constraint: str | None = None
    """Name of the one constraint that is checked."""

    def __init__(
        self,
        reference: Reference,
        states: States,
        strict: bool,
        convention: Convention | None = None,
    ) -> None:
        self._reference, self._states = reference, states
        self._strict, self._convention = strict, convention

    def _adopt(self, laid: dict[str, Laid]) -> None:
        self._laid = laid
        self._verdicts: dict[Spot, Verdict] = {
            (name, *place): verdict
            for name, item in laid.items()
            for place, verdict in item.verdicts
        }

    @property
    def wrong_count(self) -> int:
        """The number of entries that are not accepted."""
        return sum(not self._is_accepted(spot) for spot in self._verdicts)

    def _is_accepted(self, spot: Spot) -> bool:
        verdict = self._verdicts[spot]
        if self._strict:
            return verdict is Verdict.EQUAL
        return verdict.is_right or (verdict is Verdict.MANIFOLD and spot[0] in ("nu", "gamma"))

    def other_states(self) -> Iterator[tuple[States, Convention | None]]:
        """Yield states at which the author may be right, each with the convention that it is."""
        reference, states = self._reference, self._states
        is_free = states is reference.random and states is not reference.fixed
        if self.wrong_count and is_free and reference.own:
            yield reference.fixed, NUMBERS

    def report(self) -> Report:
        """Return the outcome."""
        diagnoses = self._undecided() | self._diagnoses()
        return Report(
            self._reference.name,
            self._constraint,
            tuple(self._entry(spot, diagnoses.get(spot, ())) for spot in self._verdicts),
            tuple(self._all_conventions()),
        )

    def _all_conventions(self) -> Iterator[Convention]:
        yield from [self._convention] if self._convention else []
        yield from self._conventions()
        for name, laid in self._laid.items():
            rounded = {
                laid.rows[spot[1]]
                for spot, verdict in self._verdicts.items()
                if spot[0] == name and verdict is Verdict.CONVENTION and laid.is_plain[spot[1]]
            }
            if rounded:
                text = f"{name}: {laid.written.rounding}."
                yield Convention("rounded numbers", text, tuple(sorted(rounded)))

    def _conventions(self) -> Iterator[Convention]:
        """Yield what is another way of writing."""
        yield from ()

    def _undecided(self) -> dict[Spot, tuple[Diagnosis, ...]]:
        return {
            (name, row, column): (undecided_diagnosis(self._laid[name].given[:, row, column]),)
            for (name, row, column), verdict in self._verdicts.items()
            if verdict is Verdict.UNDECIDED
        }

    def _different(self, name: str) -> list[Index]:
        """Return the places of a quantity that are to be explained."""
        return [
            (row, column)
            for (quantity, row, column), verdict in self._verdicts.items()
            if quantity == name and verdict is Verdict.DIFFERENT
        ]

    def _unexplained(self, spot: Spot) -> Diagnosis:
        """Return what is said of an entry outside the catalogue."""
        if self._laid[spot[0]].written.takes_states:
            return Diagnosis(UNEXPLAINED, self._dependence.explanation(*spot))
        return Diagnosis(UNEXPLAINED, "no fault of the catalogue fits.")

    @cached_property
    def _dependence(self) -> Dependence:
        return Dependence(self._reference, self._states, self._values_at)

    def _values_at(self, states: States) -> dict[str, tuple[Array, Array]]:
        """Return the values by hand and the right ones at other states, by quantity."""
        raise NotImplementedError

    def _diagnoses(self) -> dict[Spot, tuple[Diagnosis, ...]]:
        """Return the explanations of entries that differ."""
        raise NotImplementedError

    def _later(self, spot: Spot) -> Callable[[], str]:
        """Return what gives the right formula of an entry."""
        raise NotImplementedError

    def _entry(self, spot: Spot, diagnoses: tuple[Diagnosis, ...]) -> ComparedEntry:
        name, row, column = spot
        laid, is_accepted = self._laid[name], self._is_accepted(spot)
        values = (item.values[:, row, column] for item in (laid.given, laid.right))
        return ComparedEntry(
            name,
            laid.rows[row],
            laid.columns[column],
            self._later(spot),
            laid.written.texts[row][column],
            self._verdicts[spot],
            is_accepted,
            diagnoses,
            None if is_accepted else self._reference.difference(self._states, *values),
        )


def retried(make: Callable[[States, Convention | None], AnyJudged], states: States) -> AnyJudged:
    """Compare at states, and where something differs at others that may explain it."""
    best = make(states, None)
    for others, convention in best.other_states():
        other = make(others, convention)
        if other.wrong_count < best.wrong_count:
            best = other
    return best
