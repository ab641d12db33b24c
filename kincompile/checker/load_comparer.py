"""M and Q by hand against the derived ones: judged entry by entry, and explained load by load.

Both are sums over masses and loads. So a slip is one of what a load adds: missing, of the wrong
sign, with a factor, or as if one of the load's own numbers were zero or reversed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.agreement import ABSOLUTE, agrees, positive
from kincompile.checker.comparison import Diagnosis
from kincompile.checker.diagnosis import defined, looked_up
from kincompile.checker.entry_faults import TypedEntry
from kincompile.checker.fault import Fault, Kind, term_faults, whole_faults
from kincompile.checker.judged import Judged, Laid
from kincompile.checker.reference import OF_LOADS
from kincompile.model.matrices import load_entries
from kincompile.model.resolve import title_of
from kincompile.quantities import quantity_named

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from fractions import Fraction

    from kincompile.checker.agreement import Right
    from kincompile.checker.comparison import Convention
    from kincompile.checker.fault import Index
    from kincompile.checker.judged import Spot
    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States
    from kincompile.checker.written import Written
    from kincompile.model.resolve_loads import AppliedLoad


class LoadComparer(Judged):
    """One comparison of M and Q."""

    def __init__(
        self,
        reference: Reference,
        written: Mapping[str, Written],
        states: States,
        strict: bool,
        convention: Convention | None = None,
    ) -> None:
        super().__init__(reference, states, strict, convention)
        names, right = reference.coordinates, self._right()
        is_plain = [convention is None] * len(names)
        self._adopt({
            name: Laid(
                item, item.evaluate(states), right[name], names,
                names if name == "M" else [None], is_plain,
            )
            for name, item in written.items()
        })  # fmt: skip

    def _right(self) -> dict[str, Right]:
        """Return the derived M and Q with the scales of their entries: by row, in energies."""
        expected, arms = self._reference.values(self._states), self._reference.arms[:, None]
        M, Q = (np.abs(expected.of(name)) * arms for name in OF_LOADS)
        energy = positive(np.max(M * arms.T, axis=-1, keepdims=True))
        rate = self._reference.rate(self._states)
        scales = {"M": energy / (arms * arms.T), "Q": np.maximum(energy * rate**2, Q) / arms}
        return {
            name: self._reference.right(expected.of(name), scale, self._states)
            for name, scale in scales.items()
        }

    def _values_at(self, states: States) -> dict[str, tuple[Array, Array]]:
        right = self._reference.values(states)
        return {
            name: (laid.written.evaluate(states).values, right.of(name))
            for name, laid in self._laid.items()
        }

    def _later(self, spot: Spot) -> Callable[[], str]:
        return self._reference.later(*spot)

    def _diagnoses(self) -> dict[Spot, tuple[Diagnosis, ...]]:
        """Return the slips with loads that fit the best, and else those of an entry as typed."""
        found: dict[Spot, tuple[Diagnosis, ...]] = {}
        for name, laid in self._laid.items():
            left, explained = defined(laid.shown(self._different(name)))
            explained |= self._explained(name, left) if left else {}
            left = {place: item for place, item in left.items() if place not in explained}

            def entry_of(place: Index, name: str = name) -> TypedEntry:
                derived = self._reference.expression(name, *place)
                return TypedEntry(self._reference, name, derived, self._states)

            explained |= looked_up(left, laid.right.values, [], [], entry_of, tuple)
            for place, items in explained.items():
                spot = (name, *place)
                found[spot] = items or (self._unexplained(spot),)
        return found

    def _explained(self, name: str, left: Iterable[Index]) -> dict[Index, tuple[Diagnosis, ...]]:
        """Return the slips with loads, those with which the most entries of the quantity agree."""
        laid, most = self._laid[name], dict.fromkeys(left, 0)
        found: dict[Index, dict[Diagnosis, None]] = {}
        for fault in self._faults(name):
            agreeing = np.all(agrees(laid.given, replace(laid.right, values=fault.result)), axis=0)
            count = int(agreeing.sum())
            for place in [place for place in most if agreeing[place] and count >= most[place]]:
                if count > most[place]:
                    most[place], found[place] = count, {}
                found[place][Diagnosis(fault.kind, f"{fault.text}.")] = None
        return {place: tuple(items) for place, items in found.items()}

    def _faults(self, name: str) -> Iterator[Fault[Array]]:
        """Yield the slips with one load, and with all of them."""
        total = self._reference.values(self._states).of(name)
        yield from whole_faults(name, name, lambda factor: float(factor) * total)
        for load in self._reference.system.loads:
            yield from self._faults_of(name, load, total)

    def _faults_of(self, name: str, load: AppliedLoad, total: Array) -> Iterator[Fault[Array]]:
        own = self._added(name, load, self._states)
        if not np.any(np.abs(own) > ABSOLUTE):
            return

        def with_factor(factor: Fraction) -> Array:
            return np.asarray(total + (float(factor) - 1) * own)

        title = title_of(load.written)
        yield from term_faults(f"what {title} adds to {name}", with_factor)
        still = replace(self._states, q_dot=0 * self._states.q_dot)
        text = f"terms with rates of {title} are missing in {name}"
        yield Fault(Kind.MISSING_RATE, text, total - own + self._added(name, load, still))
        for argument, zero, reverse in _changes(load):
            without, opposite = (self._added(name, item, self._states) for item in (zero, reverse))
            text = f"{title}: {argument} is counted as zero in {name}"
            yield Fault(Kind.WITHOUT, text, total - own + without)
            text = f"{title}: {argument} has the wrong sign in {name}"
            yield Fault(Kind.SIGN, text, total - own + opposite)

    def _added(self, name: str, load: AppliedLoad, states: States) -> Array:
        """Return what a load adds at states, (N, rows, columns)."""
        n = len(self._reference.coordinates)
        size = n if quantity_named(name).is_matrix else 1
        found = np.zeros((len(states), n, size))
        entries = list(load_entries(self._reference.system, load, name))
        values, _ = self._reference.evaluate([value for _, _, value in entries], states)
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
