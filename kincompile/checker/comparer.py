"""One comparison: formulas matched, judged entry by entry, and what differs explained."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.agreement import (
    ABSOLUTE,
    OF_ROW,
    ON_MANIFOLD,
    Given,
    Right,
    agrees,
    is_undecided,
    tolerance,
)
from kincompile.checker.comparison import (
    ComparedEntry,
    Convention,
    Diagnosis,
    Verdict,
)
from kincompile.checker.conventions import OPPOSITE, conventions_found
from kincompile.checker.dependence import Dependence
from kincompile.checker.diagnosis import Diagnostician, undecided_diagnosis
from kincompile.checker.fault import Kind
from kincompile.checker.forms import OTHER, is_same_space, known_forms
from kincompile.checker.matching import Matcher, Matching, Units
from kincompile.checker.report import Report
from kincompile.model.expressions import symbol_names

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.checker.joint_faults import Index
    from kincompile.checker.reference import ConstraintBlock, Subject
    from kincompile.checker.slips import Shown
    from kincompile.checker.states import Array, States
    from kincompile.checker.written import Written

UNEXPLAINED = "not in the catalogue"

NUMBERS = Convention(
    "numbers for parameters",
    "numbers stand for parameters: everything is compared at the parameters' default values.",
)

Spot = tuple[str, int, int]
"""A quantity, and row and column of one of its entries as written."""


class Comparer:
    """One comparison, from the matching to the report."""

    def __init__(
        self,
        subject: Subject,
        written: Mapping[str, Written],
        signs: Mapping[str, float],
        strict: bool,
        convention: Convention | None = None,
    ) -> None:
        self._subject = subject
        self._quantities = written
        self._strict = strict
        self._convention = convention
        self._reference = subject.reference
        self._matcher = Matcher(subject, written, signs)
        self._adopt(self._matcher.match())
        for block in subject.blocks:
            self._prefer_one_fault(block)
            self._prefer_known_form(block)
        self._find_equal_on_manifold()

    @property
    def wrong_count(self) -> int:
        """The number of entries that are not accepted."""
        return sum(not self._is_accepted(spot) for spot in self._verdicts)

    def other_states(self) -> Iterator[tuple[States, Convention | None]]:
        """Yield states at which the author may be right, each with the convention that it is."""
        reference, states = self._reference, self._subject.states
        if states is not reference.random or not self.wrong_count:
            return
        if not all(np.isfinite(given.values).all() for given in self._written.values()):
            yield reference.about_guess(states), None
        if any(map(self._lacks_a_parameter, self._wrong())):
            yield states.with_default_parameters(reference.defaults), NUMBERS

    def _lacks_a_parameter(self, spot: Spot) -> bool:
        """Return whether parameters are missing in an entry, perhaps as numbers stand for them."""
        name, row, column = spot
        written = self._quantities[name].formula(row, column)
        right = symbol_names(self._reference.expression(name, *self._index(spot)))
        missing = right - (symbol_names(written) if written is not None else set())
        return any(item.name in missing for item in self._reference.system.parameters)

    def _adopt(self, matching: Matching) -> None:
        self._matching = matching
        self._written = self._matcher.written(matching, self._subject.states)
        self._expected = self._matcher.expected(matching, self._subject.states)
        self._verdicts = {
            spot: verdict for name in self._quantities for spot, verdict in self._judged(name)
        }

    def _judged(self, name: str) -> Iterator[tuple[Spot, Verdict]]:
        given, right = self._written[name], self._expected[name]
        equal = agrees(given, right)
        exact = np.all(agrees(given.exact, right), axis=0)
        undecided = np.all(equal | is_undecided(given, right), axis=0)
        equal = np.all(equal, axis=0)
        for row, columns in enumerate(equal):
            is_plain = self._matching.is_plain(name, row) and self._convention is None
            is_plain &= not self._reference.is_global or name != "Phi_q"
            for column, is_equal in enumerate(columns):
                if not np.isnan(right.values[:, row, column]).all():  # a column of the ground
                    is_exact = is_plain and exact[row, column]
                    verdict = Verdict.EQUAL if is_exact else Verdict.CONVENTION
                    if not is_equal:
                        is_open = undecided[row, column]
                        verdict = Verdict.UNDECIDED if is_open else Verdict.DIFFERENT
                    yield (name, row, column), verdict

    def _conventions(self) -> Iterator[Convention]:
        yield from [self._convention] if self._convention else []
        yield from conventions_found(self._matching, self._reference)
        for name, item in self._quantities.items():
            rounded = {
                self._reference.equations[self._index(spot)[0]]
                for spot, verdict in self._verdicts.items()
                if spot[0] == name and verdict is Verdict.CONVENTION
                if self._matching.is_plain(name, spot[1]) and self._convention is None
            }
            if rounded:
                yield Convention(
                    "rounded numbers", f"{name}: {item.rounding}.", tuple(sorted(rounded))
                )

    def _wrong(self, block: ConstraintBlock | None = None) -> list[Spot]:
        wrong = [spot for spot, verdict in self._verdicts.items() if not verdict.is_right]
        return [spot for spot in wrong if block is None or self._index(spot)[0] in block.rows]

    def _index(self, spot: Spot) -> Index:
        """Return row and column in the system of an entry as written."""
        name, row, column = spot
        if name != "Phi_q":
            return self._matching.rows[row], 0
        system_column = self._matching.layout.columns[column]
        assert system_column is not None
        return self._matching.rows[row], system_column

    def _prefer_one_fault(self, block: ConstraintBlock) -> None:
        """Prefer one fault in a constraint to what only looks like a way of writing it.

        That is a factor that explains its rows in part only: blocks of two bodies that are swapped
        have most entries right but for the sign. It is also another equation that Phi_q alone
        shows, unless its form is known, as an angle for its sine, and forgiven.
        """
        before, form = self._matching, self._matching.form(block.rows[0])
        is_guess = form is not None and form.defines and "Phi" not in self._quantities
        is_guess &= self._strict or (form is not None and form.text == OTHER)
        wrong = {row for _, row, _ in self._wrong(block)}
        own = {k for k, row in enumerate(before.rows) if row in block.rows and wrong}
        forms = tuple(item for item in before.forms if item is not form or not is_guess)
        for rows in (own, wrong):
            factors = before.factors.copy()
            factors[list(rows)] = 1.0
            if is_guess or np.any(factors != before.factors):
                self._adopt(replace(before, factors=factors, forms=forms))
                if self._is_one_fault(block):
                    return
                self._adopt(before)

    def _prefer_known_form(self, block: ConstraintBlock) -> None:
        """Take a known form in which a constraint has fewer slips, if it has not one as it is."""
        before, fewest = self._matching, len(self._wrong(block))
        is_plain = before.form(block.rows[0]) is None and before.units == Units()
        if not fewest or not is_plain or self._is_one_fault(block):
            return
        best = before
        for form in known_forms(block, self._subject):
            self._adopt(self._matcher.with_form(before, form))
            if (count := len(self._wrong(block))) < fewest:
                best, fewest = self._matching, count
        self._adopt(best)

    def _is_one_fault(self, block: ConstraintBlock) -> bool:
        spots = [spot for spot in self._wrong(block) if spot[0] == "Phi_q"]
        return bool(spots) and self._diagnostician.is_one_fault(
            block, self._in_system_terms(spots), self._matching.form(block.rows[0])
        )

    def _in_system_terms(self, spots: Sequence[Spot]) -> dict[Index, Shown]:
        """Return written entries of a quantity by place, with the conventions taken out."""
        units = self._matching.units.column_factors(self._reference)
        values = {}
        for spot in spots:
            name, row, column = spot
            place = self._index(spot)
            scale = self._matching.factors[row] * self._matching.sign(name)
            if name == "Phi_q":
                scale = scale * units[place[1]]
            given = self._written[name][:, row, column]
            right = self._expected[name][:, row, column]
            values[place] = given.values / scale, tolerance(given, right) / np.abs(scale)
        return values

    def report(self) -> Report:
        """Return the outcome."""
        diagnoses = self._diagnoses()
        block = self._subject.block
        return Report(
            self._reference.system.name,
            None if block is None else block.constraint.name,
            tuple(self._entry(spot, diagnoses.get(spot, ())) for spot in self._verdicts),
            tuple(self._conventions()),
        )

    def _find_equal_on_manifold(self) -> None:
        """Compare the entries that differ once more, at states at which the constraint holds.

        The constraint alone comes first; an entry may also need the other constraints to hold.
        Phi itself is zero there, right or wrong.
        """
        if not all(item.takes_states for item in self._quantities.values()):
            return
        for block in self._subject.blocks:
            spots = [spot for spot in self._wrong(block) if not self._is_mistake(spot)]
            for rows in (block.rows, range(len(self._reference.equations))) if spots else ():
                states = self._subject.near(rows)
                if states is not None:
                    self._compare_on_manifold(states, spots)

    def _compare_on_manifold(self, states: States, spots: Sequence[Spot]) -> None:
        written = self._matcher.written(self._matching, states)
        expected = self._matcher.expected(self._matching, states)
        for name, row, column in spots:
            given, right = written[name][:, row, column], expected[name][:, row, column]
            # A value that vanishes on the manifold is measured by its size elsewhere.
            size = np.max(np.abs(self._expected[name].values[:, row, column]))
            size += np.max(right.scale)
            allowed = ON_MANIFOLD * size + np.max(tolerance(given, right))
            if np.isfinite(allowed) and np.all(np.abs(given.values - right.values) <= allowed):
                self._verdicts[name, row, column] = Verdict.MANIFOLD

    def _is_mistake(self, spot: Spot) -> bool:
        """Return whether an entry is wrong wherever it may have the right value.

        Phi is zero on the manifold, right or wrong; a sign is wrong where it makes no difference.
        """
        name, row, column = spot
        place = np.s_[:, row : row + 1, column : column + 1]
        opposite = self._expected[name][place].times(-1.0)
        is_opposite = agrees(self._written[name][place], opposite).all()
        return name == "Phi" or bool(is_opposite) or self._has_rates(spot)

    def _has_rates(self, spot: Spot) -> bool:
        name, row, column = spot
        expression = self._quantities[name].formula(row, column)
        names = symbol_names(expression) if expression is not None else set()
        return name != "gamma" and not names.isdisjoint(self._reference.rates)

    def _is_accepted(self, spot: Spot) -> bool:
        verdict = self._verdicts[spot]
        if self._strict:
            return verdict is Verdict.EQUAL
        return verdict.is_right or (verdict is Verdict.MANIFOLD and spot[0] in ("nu", "gamma"))

    def _diagnoses(self) -> dict[Spot, tuple[Diagnosis, ...]]:
        found: dict[Spot, tuple[Diagnosis, ...]] = {}
        for block in self._subject.blocks:
            wrong = [spot for spot in self._wrong(block) if not self._is_accepted(spot)]
            for name in dict.fromkeys(name for name, _, _ in wrong):
                spots = [spot for spot in wrong if spot[0] == name]
                whole = self._of_whole.get(name) or self._combined(block, name)
                if whole is not None:
                    found |= dict.fromkeys(spots, (whole,))
                    continue
                is_open = [self._verdicts[spot] is Verdict.UNDECIDED for spot in spots]
                undecided = [spot for spot, is_so in zip(spots, is_open, strict=True) if is_so]
                spots = [spot for spot, is_so in zip(spots, is_open, strict=True) if not is_so]
                for spot in undecided:
                    _, row, column = spot
                    found[spot] = (undecided_diagnosis(self._written[name][:, row, column]),)
                explained = self._diagnostician.explain(
                    block, name, self._in_system_terms(spots), self._matching.form(block.rows[0])
                )
                for spot in spots:
                    found[spot] = explained[self._index(spot)] or (self._unexplained(spot),)
        return found

    @cached_property
    def _of_whole(self) -> dict[str, Diagnosis]:
        """The diagnoses of quantities that are wrong as a whole: sign, place of the rows."""
        return {
            name: found
            for name, written in self._written.items()
            if (found := self._whole_fault(name, written, self._expected[name]))
        }

    def _whole_fault(self, name: str, written: Given, expected: Right) -> Diagnosis | None:
        """Return the one fault that explains a quantity of all constraints."""
        right = expected.values
        if name == "Phi_q":
            plain = self._reference.values(self._subject.states)[name]
            turned = np.swapaxes(plain, -1, -2)
            is_square = written.values.shape == turned.shape
            if is_square and agrees(written, replace(expected, values=turned)).all():
                return Diagnosis(
                    Kind.WHOLE_TRANSPOSED, "rows and columns of the matrix are exchanged."
                )
            return None
        kind = {"nu": Kind.REVERSED, "gamma": Kind.WHOLE_SIGN}.get(name)
        is_opposite = kind and agrees(written, expected.times(-1.0)).all()
        if kind and is_opposite and np.any(np.abs(right) > ABSOLUTE):
            text = (
                f"{name} has the opposite sign throughout; if that is how you define it, state "
                f'{name} = "{OPPOSITE[name]}" in [conventions].'
            )
            return Diagnosis(kind, text)
        if right.shape[1] > 2:
            for here, there in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[:, :-1], np.s_[:, 1:])):
                shows = np.any(np.abs(right[there]) > ABSOLUTE)
                if shows and agrees(written[here], expected[there]).all():
                    return Diagnosis(Kind.OFFSET, "each row stands one place from its own.")
        return None

    def _combined(self, block: ConstraintBlock, name: str) -> Diagnosis | None:
        """Return the diagnosis of rows that are combinations of the right ones.

        With the same combinations of nu and gamma they give the right rates. But they are not the
        derivative of the author's Phi, nor of any where the combination varies with the position.
        """
        wrong = [spot for spot in self._wrong(block) if spot[0] == "Phi_q"]
        is_wrong = any(self._verdicts[spot] is Verdict.DIFFERENT for spot in wrong)
        if name == "Phi" or not is_wrong or self._is_one_fault(block):
            return None
        states = self._subject.states
        if (combination := self._combination(block, states)) is not None:
            if name == "Phi_q":
                return _same_space("", "your Phi" if "Phi" in self._quantities else "any Phi")
            rows = [k for k, row in enumerate(self._matching.rows) if row in block.rows]
            generated = self._reference.values(states).of(name)
            given = self._written[name][:, rows]
            right = generated[:, [self._matching.rows[k] for k in rows]]
            sizes = np.abs(combination) @ np.abs(right)
            scale = np.maximum(self._expected[name].scale[:, rows], sizes)
            if agrees(given, Right(combination @ right, scale, OF_ROW * scale)).all():
                text = "it belongs to the rows of your Phi_q, combinations of the right ones."
                return Diagnosis(Kind.SAME_SPACE, text)
        elif name == "Phi_q" and self._quantities[name].takes_states:
            near = self._subject.near(block.rows)
            if near is not None and self._combination(block, near) is not None:
                return _same_space(" where the constraint holds", "any Phi")
        return None

    def _combination(self, block: ConstraintBlock, states: States) -> Array | None:
        """Return the combination of right rows that the rows of Phi_q are, shape (N, m, m).

        None too where each is a constant multiple of its own: that is a factor, which has a name.
        """
        rows = [k for k, row in enumerate(self._matching.rows) if row in block.rows]
        values = self._matcher.written(self._matching, states)["Phi_q"].values
        own = self._matching.layout.by_column(values[:, rows], len(self._reference.coordinates))
        generated = self._reference.values(states)["Phi_q"]
        generated = generated[:, [self._matching.rows[k] for k in rows]]
        if not is_same_space(own, generated):
            return None
        factor = np.asarray(own @ np.linalg.pinv(generated, rcond=1e-10))
        multiple = factor[states.group == states.group[0]] * np.eye(len(rows))
        is_multiple = np.allclose(multiple, multiple[0]) and np.allclose(
            factor, factor * np.eye(len(rows))
        )
        return None if is_multiple else factor

    def _unexplained(self, spot: Spot) -> Diagnosis:
        if self._has_rates(spot):
            text = f"rates stand in it; {spot[0]} depends on positions and time alone."
            return Diagnosis(Kind.WITH_RATES, text)
        if self._verdicts[spot] is Verdict.MANIFOLD:
            text = "right only where the constraints hold; Newton's method needs it elsewhere too."
            return Diagnosis(UNEXPLAINED, text)
        if self._quantities[spot[0]].takes_states:
            return Diagnosis(UNEXPLAINED, self._dependence.explanation(*spot))
        return Diagnosis(UNEXPLAINED, "no fault of the catalogue fits.")

    @cached_property
    def _dependence(self) -> Dependence:
        def evaluate(states: States) -> tuple[dict[str, Array], dict[str, Array]]:
            written = self._matcher.written(self._matching, states)
            expected = self._matcher.expected(self._matching, states)
            hand, right = (
                {name: item.values for name, item in found.items()} for found in (written, expected)
            )
            return hand, right

        return Dependence(self._reference, self._subject.states, evaluate)

    @cached_property
    def _diagnostician(self) -> Diagnostician:
        """The catalogue of faults, kept where many are compared with one model."""
        subject = self._subject
        return subject.kept("faults", lambda: Diagnostician(subject.reference, subject.states))

    def _entry(self, spot: Spot, diagnoses: tuple[Diagnosis, ...]) -> ComparedEntry:
        name, row, column = spot
        system_row, system_column = self._index(spot)
        values = (item[name].values[:, row, column] for item in (self._written, self._expected))
        is_accepted = self._is_accepted(spot)
        reference, form_row = self._reference, system_row
        form = self._matching.form(system_row)
        if form is not None and form.formulas is not None and not is_accepted:
            reference, form_row = form.formulas, form.rows.index(system_row)
        return ComparedEntry(
            name,
            self._reference.equations[system_row],
            self._reference.coordinates[system_column] if name == "Phi_q" else None,
            reference.later(name, form_row, system_column),
            self._quantities[name].texts[row][column],
            self._verdicts[spot],
            is_accepted,
            diagnoses,
            None if is_accepted else self._reference.difference(self._subject.states, *values),
        )


def _same_space(where: str, Phi: str) -> Diagnosis:
    text = (
        f"only the row spaces agree{where}: the rows are combinations of the right ones, and not "
        f"the derivative of {Phi}, which Newton's method needs."
    )
    return Diagnosis(Kind.SAME_SPACE, text)
