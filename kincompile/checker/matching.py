"""How hand-written formulas are laid out against the generated ones, found by numbers.

Phi and Phi_q say how an author wrote the rows: their order, signs and scales. nu and gamma have to
follow. So a row of gamma with the opposite sign is a convention where Phi_q has that sign as well,
and a mistake where it has not.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment  # type: ignore[attr-defined]

from kincompile.checker.agreement import Multiple, agrees, finite, joined, multiple
from kincompile.checker.comparison import Convention
from kincompile.checker.conventions import OPPOSITE
from kincompile.checker.forms import Form, exchanged, jacobian_form, known_forms, own_form
from kincompile.checker.layouts import Layout, other_layouts, usual_layout
from kincompile.checker.reference import QUANTITIES
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.checker.agreement import Given, Right
    from kincompile.checker.given_forms import Subject
    from kincompile.checker.reference import ConstraintBlock, Reference
    from kincompile.checker.states import Array, States
    from kincompile.checker.written import Written

DEGREE = np.pi / 180
_ALIKE = 1e-7  # between rows of length 1, to sort the layouts that are examined
_MOST_TRIED = 24


@dataclass(frozen=True, slots=True)
class Units:
    """Whether formulas take angles in degrees, and whether their derivatives are per degree."""

    takes_degrees: bool = False
    per_degree: bool = False

    def column_factors(self, reference: Reference) -> Array:
        """Return the factors of the columns of Phi_q, shape (n,)."""
        return np.where(reference.angular & self.per_degree, DEGREE, 1.0)


@dataclass(frozen=True)
class Matching:
    """How the written formulas are laid out against the generated ones."""

    # layout, units: columns of Phi_q, and the unit of angles.
    layout: Layout
    units: Units
    rows: tuple[int, ...]  # the row of the system that each written row is
    factors: Array  # written = factor * generated, by row and state, shape (rows, N)
    # The forms of constraints that are not written as they are generated.
    forms: tuple[Form, ...] = ()
    # -1 for nu or gamma where its author states that the whole vector has the opposite sign.
    signs: Mapping[str, float] = field(default_factory=dict)

    @property
    def moved(self) -> list[int]:
        """The written rows that stand in another place than in the system."""
        usual = sorted(self.rows)
        return [k for k, row in enumerate(self.rows) if row != usual[k]]

    def form(self, row: int) -> Form | None:
        """Return the form of a row of the system, None where it is written as generated."""
        return next((form for form in self.forms if row in form.rows), None)

    def sign(self, quantity: str) -> float:
        """Return the sign of a whole quantity."""
        return self.signs.get(quantity, 1.0)

    def is_plain(self, quantity: str, row: int) -> bool:
        """Return whether no convention concerns a written row of a quantity."""
        return (
            self.units == Units()
            and not (quantity == "Phi_q" and self.layout.convention)
            and row not in self.moved
            and self.form(self.rows[row]) is None
            and self.sign(quantity) == 1
            and bool(np.all(self.factors[row] == 1))
        )


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A matching, and the written rows that it explains entirely."""

    matching: Matching
    explained: frozenset[int]

    @property
    def share(self) -> float:
        """The share of the rows that are explained."""
        return len(self.explained) / len(self.matching.rows)


class Matcher:
    """Finds the matching that explains the most, the plain one first."""

    def __init__(
        self, subject: Subject, written: Mapping[str, Written], signs: Mapping[str, float]
    ) -> None:
        self._subject = subject
        self._quantities = written
        self._signs = signs
        self._reference = subject.reference

    def match(self) -> Matching:
        """Return how the written formulas are laid out."""
        usual = self._usual_layout()
        plain = best = self._rows_matched(usual, Units())
        if self._reference.angular.any():
            for units in (Units(True, False), Units(True, True), Units(False, True)):
                best = self._better(best, usual, units)
        if "Phi_q" in self._quantities and best.share < 1:
            for layout in self._promising(usual):
                other = self._better(best, layout, Units())
                best = other if self._is_whole(other, plain) else best
        return self._with_forms(best.matching)

    def expected(self, matching: Matching, states: States) -> dict[str, Right]:
        """Return the right values by the author's conventions, (N, rows, columns) each.

        Columns of the ground hold NaN.
        """
        generated = self._generated(matching, states)
        rights = self._reference.scaled(generated, states)
        for form in matching.forms:
            for name, sizes in (form.sizes(states) if form.sizes else {}).items():
                rights[name] = rights[name].rounded(list(form.rows), sizes)
        by_group = dict(zip(self._subject.states.group.tolist(), matching.factors.T, strict=True))
        factors = np.stack([by_group[k] for k in states.group.tolist()])
        result = {}
        for name in self._quantities:
            right = rights[name][:, list(matching.rows)]
            if name == "Phi_q":
                right = right.times(matching.units.column_factors(self._reference))
                right = right.each(matching.layout.arranged)
            result[name] = right.times((factors * matching.sign(name))[:, :, None])
        return result

    def written(self, matching: Matching, states: States) -> dict[str, Given]:
        """Return the values of the written formulas, (N, rows, columns) each."""
        if matching.units.takes_degrees:
            states = self._subject.in_degrees(states)
        found = {name: item.evaluate(states) for name, item in self._quantities.items()}
        by_row = np.zeros((len(matching.rows), 1))
        for k, row in enumerate(matching.rows):
            form = matching.form(row)
            by_row[k] = form.accuracy if form is not None else 0.0
        return {name: replace(x, relative=x.relative + by_row) for name, x in found.items()}

    def _generated(self, matching: Matching, states: States) -> dict[str, Array]:
        found = self._reference.values(states)
        values = {name: found.of(name) for name in QUANTITIES}
        for form in matching.forms:
            own = form.evaluate(states)
            for name in values:
                values[name] = values[name].copy()
                values[name][:, list(form.rows)] = own[name]
        return values

    def _usual_layout(self) -> Layout:
        if "Phi_q" not in self._quantities:
            return Layout(tuple(range(len(self._reference.coordinates))))
        width = self._quantities["Phi_q"].shape[1]
        layout = usual_layout(self._reference, self._subject.block, width)
        assert layout is not None, "shapes are checked before"
        return layout

    def _promising(self, usual: Layout) -> list[Layout]:
        """Return the other layouts that are worth a closer look, the best first.

        The look at all of them is quick: rows in the usual order, each divided by its length.
        Where rows and columns both have another order, it sees nothing; then a few are tried. An
        order that explains no more rows than the usual one does not count: a sign is wrong.
        """
        layouts = [usual, *other_layouts(self._reference, usual)]
        values = self._quantities["Phi_q"].evaluate(self._subject.states).values
        written = _directions(finite(values))
        Phi_q = self._reference.values(self._subject.states)["Phi_q"][:, list(self._subject.rows)]
        scores = []
        for layout in layouts:
            generated = layout.arranged(Phi_q)
            known = ~np.isnan(generated[0, 0])
            right = _directions(generated[..., known])
            # The columns of the ground count in the length of a row by hand, and only there.
            w = _directions(written[..., known])
            off = np.minimum(np.abs(w - right).max((0, 2)), np.abs(w + right).max((0, 2)))
            scores.append(int(np.sum(off <= _ALIKE)))
        if max(scores) == 0:
            return layouts[1 : _MOST_TRIED + 1]
        better = [k for k, score in enumerate(scores) if score > scores[0]]
        order = sorted(better, key=lambda k: -scores[k])
        return [layouts[k] for k in order[:_MOST_TRIED]]

    def _better(self, best: _Candidate, layout: Layout, units: Units) -> _Candidate:
        """Return the candidate that explains the most rows; another one only if it is most rows."""
        if best.share == 1.0:
            return best
        other = self._rows_matched(layout, units)
        return other if other.share > best.share and other.share >= 0.5 else best

    def _is_whole(self, other: _Candidate, plain: _Candidate) -> bool:
        """Return whether an order of columns is that of all rows, and more than one slip."""
        gained = [other.matching.rows[k] for k in other.explained - plain.explained]
        is_shown = other.matching.layout.is_shown(gained, self._subject.blocks)
        return is_shown and plain.explained <= other.explained

    def _rows_matched(self, layout: Layout, units: Units) -> _Candidate:
        states, rows = self._subject.states, self._subject.rows
        plain = Matching(layout, units, rows, np.ones((len(rows), len(states))), signs=self._signs)
        written, expected = self.written(plain, states), self.expected(plain, states)
        defining: list[str] = [name for name in ("Phi_q", "Phi") if name in written]
        names = defining or list(written)
        order, found = match_rows(
            [written[name] for name in names],
            [expected[name] for name in names],
            states.group,
            may_scale=bool(defining),
        )
        factors = np.stack([item.factor for item in found])
        matching = replace(plain, rows=tuple(rows[k] for k in order), factors=factors)
        return _Candidate(matching, frozenset(k for k, x in enumerate(found) if x.share == 1.0))

    def _with_forms(self, matching: Matching) -> Matching:
        """Take the other forms in which constraints are written.

        Phi shows them, or Phi_q where there is no Phi; nu and gamma have to follow. Where these are
        all there is, they have to be right.
        """
        if matching.units != Units():
            return matching
        written = self.written(matching, self._subject.states)
        defining = [name for name in ("Phi", "Phi_q") if name in written][:1]
        shown = {name: written[name] for name in defining or written}
        right = self._right_rows(matching, shown)
        for block in self._subject.blocks:
            own = [k for k, row in enumerate(matching.rows) if row in block.rows]
            if all(right[own]):
                continue
            for form in self._forms(block, own, matching):
                trial = self.with_form(matching, form)
                if form.defines or all(self._right_rows(trial, shown)[own]):
                    matching = trial
                    break
        return matching

    def _forms(self, block: ConstraintBlock, own: list[int], matching: Matching) -> Iterator[Form]:
        """Yield the forms that a constraint may have, those first that need no definition."""
        subject, rows = self._subject, [matching.rows[k] for k in own]
        if {"Phi", "Phi_q"}.intersection(self._quantities) and (form := exchanged(block, subject)):
            yield form
        if "Phi" in self._quantities:
            if form := own_form(subject, rows, self._quantities["Phi"], own):
                yield form
            return
        yield from known_forms(block, subject)
        if "Phi_q" in self._quantities:

            def Phi_q(states: States) -> Array:
                values = self._quantities["Phi_q"].evaluate(states).values[:, own]
                return matching.layout.by_column(values, len(self._reference.coordinates))

            if form := jacobian_form(subject, rows, Phi_q):
                yield form

    def with_form(self, matching: Matching, form: Form) -> Matching:
        """Return a matching with a constraint in another form."""
        written = self.written(matching, self._subject.states)
        own = [k for k, row in enumerate(matching.rows) if row in form.rows]
        factors = matching.factors.copy()
        factors[own] = 1.0
        trial = replace(matching, forms=(*matching.forms, form), factors=factors)
        if form.defines:
            return trial
        expected = self.expected(trial, self._subject.states)
        for name in [name for name in ("Phi_q", "Phi") if name in written][:1]:
            for k in own:
                right = expected[name][:, k]
                factors[k] = multiple(written[name][:, k], right, self._subject.states.group).factor
        return trial

    def _right_rows(self, matching: Matching, written: Mapping[str, Given]) -> Array:
        expected = self.expected(matching, self._subject.states)
        right = np.ones(len(matching.rows), dtype=bool)
        for name, given in written.items():
            equal = agrees(given, expected[name]) | np.isnan(expected[name].values)
            right &= equal.all(axis=(0, 2))
        return right


def _directions(values: Array) -> Array:
    """Return rows of length 1; their signs stay."""
    length = np.sqrt(np.sum(values**2, axis=-1, keepdims=True))
    return np.asarray(values / np.where(length == 0, 1.0, length))


def match_rows(
    written: Sequence[Given],
    expected: Sequence[Right],
    group: Array,
    may_scale: bool,
) -> tuple[list[int], list[Multiple]]:
    """Return the generated row of each row, and the factor between them.

    Parameters
    ----------
    written
        The quantities that distinguish the rows, (N, rows, columns) each.
    expected
        The generated ones; Phi last.
    group
        The set of parameters of each state, shape (N,).
    """

    def pair(row: int, target: int) -> Multiple:
        """Return the factor between two rows."""
        given = [item[:, row] for item in written]
        right = [item[:, target] for item in expected]
        whole = multiple(joined(given), joined(right), group, may_scale)
        if whole.share == 1.0 or len(given) == 1:
            return whole
        # Phi defines the constraint: the factor of a right Phi is the one Phi_q must have.
        of_phi = multiple(given[-1], right[-1], group, may_scale)
        return Multiple(of_phi.factor, whole.share) if of_phi.share == 1.0 else whole

    rows = list(range(expected[0].values.shape[1]))
    found = {(k, k): pair(k, k) for k in rows}
    unmatched = [k for k in rows if found[k, k].share < 1.0]
    cost = np.full((len(unmatched), len(unmatched)), 2.0)
    for a, row in enumerate(unmatched):
        for b, target in enumerate(unmatched):
            share = found.setdefault((row, target), pair(row, target)).share
            # A row that is only nearly another one stays in its place.
            cost[a, b] = (0.0 if share == 1.0 else 1.0 - 0.1 * share) + 0.2 * (row != target)
    for a, b in zip(*linear_sum_assignment(cost), strict=True):
        rows[unmatched[a]] = unmatched[b]
    return rows, [found[k, target] for k, target in enumerate(rows)]


def conventions_found(matching: Matching, reference: Reference) -> Iterator[Convention]:
    """Yield the conventions of a matching."""
    yield from [reference.convention] if reference.convention else []
    equations = reference.equations
    if text := matching.layout.convention:
        kind = "ground columns" if "ground" in text else "order of columns"
        order = ["(ground)" if k is None else reference.coordinates[k]
                 for k in matching.layout.columns]  # fmt: skip
        yield Convention(kind, f"Phi_q: {text}, the same in all rows: {listed(order, 30)}.")
    parts = ["angles are taken in degrees"] if matching.units.takes_degrees else []
    parts += ["derivatives are per degree"] if matching.units.per_degree else []
    if parts:
        yield Convention("degrees", f"{'; '.join(parts)}.")
    names = [equations[row] for row in matching.rows]
    if moved := matching.moved:
        pairs = listed([f"row {k + 1} is {names[k]}" for k in moved], 30)
        rows = tuple(names[k] for k in moved)
        yield Convention("order of rows", f"the rows have another order: {pairs}.", rows)
    for form in matching.forms:
        own = tuple(equations[row] for row in form.rows)
        yield Convention(form.kind, f"{listed(own)}: {form.text}.", own)
    yield from _row_factors(matching, names)
    for name, sign in matching.signs.items():
        if sign < 0:
            text = f"{name} is the {OPPOSITE[name]}, as stated: it has the opposite sign."
            yield Convention(f"sign of {name}", text)


def _row_factors(matching: Matching, names: Sequence[str]) -> Iterator[Convention]:
    """Yield the signs and scales of rows."""
    factors = list(zip(names, matching.factors, strict=True))
    opposite = tuple(name for name, factor in factors if np.all(factor == -1))
    if opposite:
        text = f"{listed(opposite)}: written with the opposite sign."
        yield Convention("row sign", text, opposite)
    for name, factor in factors:
        if name not in opposite and np.any(factor != 1):
            is_number = np.ptp(factor) <= 1e-9 * abs(factor[0])
            size = f"{factor[0]:.6g}" if is_number else "a factor that depends on parameters"
            text = f"{name}: written as {size} times the generated equation."
            yield Convention("row scale", text, (name,))
