"""One comparison of equations: matched, judged entry by entry, and explained."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.agreement import ABSOLUTE, OF_ROW, ON_MANIFOLD, Right, agrees, tolerance
from kincompile.checker.comparison import Diagnosis, Verdict
from kincompile.checker.conventions import OPPOSITE
from kincompile.checker.diagnosis import Diagnostician
from kincompile.checker.fault import Kind
from kincompile.checker.forms import OTHER, is_same_space, known_forms
from kincompile.checker.judged import UNEXPLAINED, Judged, Laid
from kincompile.checker.matching import Matcher, Matching, Units, conventions_found
from kincompile.model.expressions import symbol_names

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from kincompile.checker.agreement import Given
    from kincompile.checker.comparison import Convention
    from kincompile.checker.fault import Index, Shown
    from kincompile.checker.given_forms import Subject
    from kincompile.checker.judged import Spot
    from kincompile.checker.reference import ConstraintBlock
    from kincompile.checker.states import Array, States
    from kincompile.checker.written import Written


class Comparer(Judged):
    """One comparison of equations, from the matching to the report."""

    def __init__(
        self,
        subject: Subject,
        written: Mapping[str, Written],
        signs: Mapping[str, float],
        strict: bool,
        convention: Convention | None = None,
    ) -> None:
        super().__init__(subject.reference, subject.states, strict, convention)
        self._subject = subject
        self._quantities = written
        self._constraint = None if subject.block is None else subject.block.constraint.name
        self._matcher = Matcher(subject, written, signs)
        self._take(self._matcher.match())
        for block in subject.blocks:
            self._prefer_one_fault(block)
            self._prefer_known_form(block)
        self._find_equal_on_manifold()

    def other_states(self) -> Iterator[tuple[States, Convention | None]]:
        """Yield states at which the author may be right, each with the convention that it is."""
        if self._states is not self._reference.random or not self.wrong_count:
            return
        if not all(np.isfinite(laid.given.values).all() for laid in self._laid.values()):
            yield self._reference.about_guess(self._states), None
        if any(map(self._lacks_a_parameter, self._wrong())):
            yield from super().other_states()

    def _lacks_a_parameter(self, spot: Spot) -> bool:
        """Return whether parameters are missing in an entry, perhaps as numbers stand for them."""
        name, row, column = spot
        written = self._quantities[name].formula(row, column)
        right = symbol_names(self._reference.expression(name, *self._index(spot)))
        missing = right - (symbol_names(written) if written is not None else set())
        return not missing.isdisjoint(self._reference.own)

    def _take(self, matching: Matching) -> None:
        """Lay the formulas out as a matching has them, and judge them anew."""
        self._matching = matching
        written = self._matcher.written(matching, self._states)
        expected = self._matcher.expected(matching, self._states)
        reference, columns = self._reference, matching.layout.columns
        rows = [reference.equations[row] for row in matching.rows]
        coordinates = [None if k is None else reference.coordinates[k] for k in columns]
        laid = {}
        for name, item in self._quantities.items():
            is_usual = self._convention is None
            is_usual &= not reference.is_global or name != "Phi_q"
            is_plain = [is_usual and matching.is_plain(name, k) for k in range(len(rows))]
            names = coordinates if name == "Phi_q" else [None]
            laid[name] = Laid(item, written[name], expected[name], rows, names, is_plain)
        self._adopt(laid)

    def _conventions(self) -> Iterator[Convention]:
        return conventions_found(self._matching, self._reference)

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
                self._take(replace(before, factors=factors, forms=forms))
                if self._is_one_fault(block):
                    return
                self._take(before)

    def _prefer_known_form(self, block: ConstraintBlock) -> None:
        """Take a known form in which a constraint has fewer slips, if it has not one as it is."""
        before, fewest = self._matching, len(self._wrong(block))
        is_plain = before.form(block.rows[0]) is None and before.units == Units()
        if not fewest or not is_plain or self._is_one_fault(block):
            return
        best = before
        for form in known_forms(block, self._subject):
            self._take(self._matcher.with_form(before, form))
            if (count := len(self._wrong(block))) < fewest:
                best, fewest = self._matching, count
        self._take(best)

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
            given, lost = self._laid[name].shown([(row, column)])[row, column]
            values[place] = given / scale, lost / np.abs(scale)
        return values

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
            size = np.max(np.abs(self._laid[name].right.values[:, row, column]))
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
        opposite = self._laid[name].right[place].times(-1.0)
        is_opposite = agrees(self._laid[name].given[place], opposite).all()
        return name == "Phi" or bool(is_opposite) or self._has_rates(spot)

    def _has_rates(self, spot: Spot) -> bool:
        name, row, column = spot
        expression = self._quantities[name].formula(row, column)
        names = symbol_names(expression) if expression is not None else set()
        return name != "gamma" and not names.isdisjoint(self._reference.rates)

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
                spots = [x for x in spots if self._verdicts[x] is not Verdict.UNDECIDED]
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
            for name, laid in self._laid.items()
            if (found := self._whole_fault(name, laid.given, laid.right))
        }

    def _whole_fault(self, name: str, written: Given, expected: Right) -> Diagnosis | None:
        """Return the one fault that explains a quantity of all constraints."""
        right = expected.values
        if name == "Phi_q":
            plain = self._reference.values(self._states)[name]
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
        states = self._states
        if (combination := self._combination(block, states)) is not None:
            if name == "Phi_q":
                return _same_space("", "your Phi" if "Phi" in self._quantities else "any Phi")
            rows = [k for k, row in enumerate(self._matching.rows) if row in block.rows]
            generated = self._reference.values(states).of(name)
            given = self._laid[name].given[:, rows]
            right = generated[:, [self._matching.rows[k] for k in rows]]
            sizes = np.abs(combination) @ np.abs(right)
            scale = np.maximum(self._laid[name].right.scale[:, rows], sizes)
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
        return super()._unexplained(spot)

    def _values_at(self, states: States) -> dict[str, tuple[Array, Array]]:
        written = self._matcher.written(self._matching, states)
        expected = self._matcher.expected(self._matching, states)
        return {name: (item.values, expected[name].values) for name, item in written.items()}

    @cached_property
    def _diagnostician(self) -> Diagnostician:
        """The catalogue of faults, kept where many are compared with one model."""
        subject = self._subject
        return subject.kept("faults", lambda: Diagnostician(subject.reference, subject.states))

    def _later(self, spot: Spot) -> Callable[[], str]:
        row, column = self._index(spot)
        form = self._matching.form(row)
        if form is None or form.formulas is None or self._is_accepted(spot):
            return self._reference.later(spot[0], row, column)
        return form.formulas.later(spot[0], form.rows.index(row), column)


def _same_space(where: str, Phi: str) -> Diagnosis:
    text = (
        f"only the row spaces agree{where}: the rows are combinations of the right ones, and not "
        f"the derivative of {Phi}, which Newton's method needs."
    )
    return Diagnosis(Kind.SAME_SPACE, text)
