"""M and Q by hand against the derived ones: judged entry by entry, and explained load by load.

Both are sums over masses and loads. So a slip is one of what a load adds: missing, of the wrong
sign, with a factor, or as if one of the load's own numbers were zero or reversed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.agreement import ABSOLUTE, agrees, is_undecided
from kincompile.checker.comparison import ComparedEntry, Diagnosis, Verdict
from kincompile.checker.diagnosis import undecided_diagnosis
from kincompile.checker.fault import Fault, Kind, term_faults, whole_faults
from kincompile.checker.reference import OF_LOADS, positive
from kincompile.model.matrices import load_entries
from kincompile.model.resolve import title_of
from kincompile.quantities import quantity_named

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from fractions import Fraction

    from kincompile.checker.agreement import Given, Right
    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States
    from kincompile.checker.written import Written
    from kincompile.model.resolve_loads import AppliedLoad

UNEXPLAINED = "no slip with one of the loads gives these numbers."


@dataclass(frozen=True)
class LoadComparer:
    """One comparison of M and Q."""

    reference: Reference
    written: Mapping[str, Written]
    states: States
    strict: bool  # whether what is right by a convention alone is not accepted

    @property
    def wrong_count(self) -> int:
        """The number of entries that differ."""
        return sum(int((~equal).sum()) for equal in self._equal.values())

    @cached_property
    def _given(self) -> dict[str, Given]:
        """What was written, (N, rows, columns) each."""
        return {name: item.evaluate(self.states) for name, item in self.written.items()}

    @cached_property
    def _right(self) -> dict[str, Right]:
        """The derived M and Q with the scales of their entries: by row, in energies."""
        expected, arms = self.reference.values(self.states), self.reference.arms[:, None]
        M, Q = (np.abs(expected.of(name)) * arms for name in OF_LOADS)
        energy = positive(np.max(M * arms.T, axis=-1, keepdims=True))
        rate = self.reference.rate(self.states)
        scales = {"M": energy / (arms * arms.T), "Q": np.maximum(energy * rate**2, Q) / arms}
        return {
            name: self.reference.right(expected.of(name), scale, self.states)
            for name, scale in scales.items()
        }

    @cached_property
    def _equal(self) -> dict[str, Array]:
        return {
            name: np.all(agrees(given, self._right[name]), axis=0)
            for name, given in self._given.items()
        }

    def _is_undecided(self, name: str) -> Array:
        given, right = self._given[name], self._right[name]
        return np.asarray(np.all(agrees(given, right) | is_undecided(given, right), axis=0))

    def entries(self, right: Verdict = Verdict.EQUAL) -> Iterator[ComparedEntry]:
        """Yield all entries; those that agree have the verdict that is given."""
        for name, item in self.written.items():
            equal, undecided = self._equal[name], self._is_undecided(name)
            explained = {} if equal.all() else self._explained(name)
            for place in np.ndindex(*equal.shape):
                row, column = place
                given = self._given[name][:, row, column]
                values = given.values, self._right[name].values[:, row, column]
                verdict = right if equal[place] else Verdict.DIFFERENT
                if undecided[place] and not equal[place]:
                    verdict = Verdict.UNDECIDED
                    explained[place] = (undecided_diagnosis(given),)
                is_accepted = verdict is Verdict.EQUAL or (verdict.is_right and not self.strict)
                yield ComparedEntry(
                    name,
                    self.reference.coordinates[row],
                    self.reference.coordinates[column] if name == "M" else None,
                    self.reference.later(name, row, column),
                    item.texts[row][column],
                    verdict,
                    is_accepted,
                    explained.get(place, ()),
                    None if is_accepted else self.reference.difference(self.states, *values),
                )

    def _explained(self, name: str) -> dict[tuple[int, ...], tuple[Diagnosis, ...]]:
        """Return the explanations of the entries that differ: the slips that fit the best."""
        given, right = self._given[name], self._right[name]
        wrong = [tuple(place) for place in np.argwhere(~self._equal[name]).tolist()]
        found: dict[tuple[int, ...], list[tuple[int, Fault[Array]]]] = {item: [] for item in wrong}
        for fault in self._faults(name):
            agreeing = np.all(agrees(given, replace(right, values=fault.result)), axis=0)
            for place in wrong:
                if agreeing[place]:
                    found[place].append((int(agreeing.sum()), fault))
        return {place: _best(faults) for place, faults in found.items()}

    def _faults(self, name: str) -> Iterator[Fault[Array]]:
        """Yield the slips with one load, and with all of them."""
        total = self.reference.values(self.states).of(name)
        yield from whole_faults(name, name, lambda factor: float(factor) * total)
        for load in self.reference.system.loads:
            yield from self._faults_of(name, load, total)

    def _faults_of(self, name: str, load: AppliedLoad, total: Array) -> Iterator[Fault[Array]]:
        own = self._added(name, load, self.states)
        if not np.any(np.abs(own) > ABSOLUTE):
            return

        def with_factor(factor: Fraction) -> Array:
            return np.asarray(total + (float(factor) - 1) * own)

        title = title_of(load.written)
        yield from term_faults(f"what {title} adds to {name}", with_factor)
        still = replace(self.states, q_dot=0 * self.states.q_dot)
        text = f"terms with rates of {title} are missing in {name}"
        yield Fault(Kind.MISSING_RATE, text, total - own + self._added(name, load, still))
        for argument, zero, reverse in _changes(load):
            without, opposite = (self._added(name, item, self.states) for item in (zero, reverse))
            text = f"{title}: {argument} is counted as zero in {name}"
            yield Fault(Kind.WITHOUT, text, total - own + without)
            text = f"{title}: {argument} has the wrong sign in {name}"
            yield Fault(Kind.SIGN, text, total - own + opposite)

    def _added(self, name: str, load: AppliedLoad, states: States) -> Array:
        """Return what a load adds at states, (N, rows, columns)."""
        n = len(self.reference.coordinates)
        size = n if quantity_named(name).is_matrix else 1
        found = np.zeros((len(states), n, size))
        entries = list(load_entries(self.reference.system, load, name))
        values, _ = self.reference.evaluate([value for _, _, value in entries], states)
        for k, (row, column, _) in enumerate(entries):
            found[:, row, column] += values[:, k]
        return found


def _changes(load: AppliedLoad) -> Iterator[tuple[str, AppliedLoad, AppliedLoad]]:
    """Yield the arguments of a load, with the load as if they were zero, and reversed."""
    for name, item in load.written.arguments().items():
        symbol = item.symbol
        value, point = load.scalars.get(symbol, 0), load.points.get(symbol, ())
        if value != 0:
            changed = (replace(load, scalars={**load.scalars, symbol: x}) for x in (0, -value))
        elif any(x != 0 for x in point):
            points = (tuple(factor * x for x in point) for factor in (0, -1))
            changed = (replace(load, points={**load.points, symbol: x}) for x in points)
        else:
            continue
        zero, opposite = changed
        yield name, zero, opposite


def _best(faults: list[tuple[int, Fault[Array]]]) -> tuple[Diagnosis, ...]:
    """Return the slips with which the most entries agree: they are equivalent to each other."""
    if not faults:
        return (Diagnosis("not in the catalogue", UNEXPLAINED),)
    most = max(count for count, _ in faults)
    return tuple(
        dict.fromkeys(Diagnosis(f.kind, f"{f.text}.") for count, f in faults if count == most)
    )
