"""Comparison of hand-derived formulas with the generated ones.

generated   the formulas the compiler derives, evaluated at random states   reference.py, states.py
written     the formulas of the author: texts, arrays, functions            written.py, hand_file.py
match       rows, columns, signs, scales that conventions leave open        matching.py, layouts.py
agree       entry by entry: equal, equal on the manifold, different         agreement.py
diagnose    the fault of the catalogue that gives the numbers that differ   diagnosis.py, *fault*.py
report      entries with verdicts, for people and for machines              report.py

Equality is decided by numbers at a dozen random states, never by simplification.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compare.agreement import ABSOLUTE, OF_TERMS, ON_MANIFOLD, agrees
from kincompile.compare.comparison import (
    ComparedEntry,
    Convention,
    Diagnosis,
    Difference,
    Verdict,
)
from kincompile.compare.conventions import OPPOSITE, conventions_found, stated_signs
from kincompile.compare.dependence import Dependence
from kincompile.compare.diagnosis import Diagnostician
from kincompile.compare.fault import REVERSED, WHOLE_SIGN, WITH_RATES
from kincompile.compare.hand_file import read_hand_file
from kincompile.compare.layouts import expected_widths, usual_layout
from kincompile.compare.matching import Matcher, Matching
from kincompile.compare.reference import QUANTITIES, Reference, Subject
from kincompile.compare.report import Report
from kincompile.compare.states import given_states
from kincompile.compare.written import TOLD, read_written, vocabulary
from kincompile.errors import InputError
from kincompile.model.expressions import symbol_names
from kincompile.names import listed

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike

    from kincompile.compare.diagnosis import Given
    from kincompile.compare.joint_faults import Index
    from kincompile.compare.reference import ConstraintBlock
    from kincompile.compare.states import Array, States
    from kincompile.compare.written import Written
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

UNEXPLAINED = "not in the catalogue"

NUMBERS = Convention(
    "numbers for parameters",
    "numbers stand for parameters: everything is compared at the parameters' default values.",
)

Spot = tuple[str, int, int]
"""A quantity, and row and column of one of its entries as written."""


def compare(
    model: Mechanism | ConstraintSystem | Reference,
    Phi: object = None,
    Phi_q: object = None,
    nu: object = None,
    gamma: object = None,
    *,
    constraint: str | None = None,
    aliases: Mapping[str, object] | None = None,
    conventions: Mapping[str, str] | None = None,
    states: Mapping[str, ArrayLike] | None = None,
    strict: bool = False,
) -> Report:
    r"""Compare hand-derived Phi, Phi_q, nu and gamma with the generated ones.

    :math:`\Phi_q \dot q = \nu = -\Phi_t` and :math:`\Phi_q \ddot q = \gamma = -(\Phi_q \dot q)_q
    \dot q - 2 \Phi_{qt} \dot q - \Phi_{tt}` (Haug, section 3.1).

    Parameters
    ----------
    model
        The mechanism or system; a `Reference` made of it, where many are compared with one model.
    Phi, Phi_q, nu, gamma
        Formulas derived by hand: text such as ``[[1, 0, 0.25*cos(phi3)], ...]``, nested lists of
        numbers, texts and SymPy expressions, a SymPy matrix, an array, or a function ``f(q, t)``
        (of gamma ``f(q, q_dot, t)``), which may take the parameters p as a last argument. At
        least one.
    constraint
        Name of the one constraint that is checked alone. Phi_q then has the columns of the whole
        system, or of the constraint's bodies, i before j.
    aliases
        Names of the author's own, each with its expression, for instance ``{"w": "phi3_dot"}``.
    conventions
        What the author says that nu and gamma are: ``{"nu": "Phi_t"}`` and ``{"gamma": "left
        side"}`` have the opposite sign, which is a mistake where it is not stated.
    states
        States at which the values of arrays belong: ``q`` (N, n), and where they matter ``q_dot``
        (N, n), ``t`` (N,), ``p`` (N, k). Random states where None.
    strict
        Whether an entry must be equal to the generated one to be accepted, without a convention
        and at states off the constraint manifold too.

    Returns
    -------
    Report
        Verdict and diagnosis of every entry, and the conventions in which the two differ.

    Raises
    ------
    ModelError
        If the model cannot be used as written.
    InputError
        If a formula cannot be read, holds an unknown name, or has the wrong shape.
    """
    reference = model if isinstance(model, Reference) else Reference(model)
    given = {"Phi": Phi, "Phi_q": Phi_q, "nu": nu, "gamma": gamma}
    given = {name: value for name, value in given.items() if value is not None}
    if not given:
        raise InputError(f"there is nothing to compare: give at least one of {listed(QUANTITIES)}.")
    block = None if constraint is None else reference.block(constraint)
    written = _read(reference, block, given, aliases or {}, at_states=states is not None)
    if states is not None:
        at = given_states(states, reference.system)
    elif all(item.takes_parameters for item in written.values()):
        at = reference.random
    else:
        at = reference.random.with_default_parameters(reference.defaults)
    signs = stated_signs(conventions or {})
    return _compared(Subject(reference, block, at), written, signs, strict)


def compare_file(
    model: Mechanism | ConstraintSystem | Reference,
    path: str | os.PathLike[str],
    *,
    constraint: str | None = None,
    strict: bool = False,
) -> Report:
    """Compare a hand file with the generated formulas.

    Parameters
    ----------
    model
        As for `compare`.
    path
        The hand file: TOML, JSON or lines ``Name = [[...]]``; see `read_hand_file`.
    constraint
        Name of the one constraint that is checked alone; the file's own where None.
    strict
        As for `compare`.

    Returns
    -------
    Report
        As `compare` gives it.

    Raises
    ------
    ModelError, InputError
        As `compare` does; a message begins with the file and the line.
    """
    file = read_hand_file(Path(path))
    reference = model if isinstance(model, Reference) else Reference(model)
    constraint = file.constraint if constraint is None else constraint
    block = None if constraint is None else reference.block(constraint)
    try:
        written = _read(reference, block, file.quantities, file.aliases)
        signs = stated_signs(file.conventions)
    except InputError as error:
        raise InputError([f"{file.name}, {problem}" for problem in error.problems]) from error
    return _compared(Subject(reference, block, reference.random), written, signs, strict)


def _compared(
    subject: Subject, written: Mapping[str, Written], signs: Mapping[str, float], strict: bool
) -> Report:
    """Compare at the given states, and where something differs at others that may explain it."""
    best = _Comparer(subject, written, signs, strict)
    for states, convention in best.other_states():
        other = _Comparer(replace(subject, states=states), written, signs, strict, convention)
        if other.wrong_count < best.wrong_count:
            best = other
    return best.report()


def _read(
    reference: Reference,
    block: ConstraintBlock | None,
    given: Mapping[str, object],
    aliases: Mapping[str, object],
    at_states: bool = False,
) -> dict[str, Written]:
    """Read all quantities, or raise all problems at once."""
    words = vocabulary(reference, aliases)
    written: dict[str, Written] = {}
    problems: list[str] = []
    for name in QUANTITIES:
        if name in given:
            try:

                def check(rows: int, columns: int, name: str = name) -> list[str]:
                    return _shape_problems(name, rows, columns, reference, block)

                written[name] = read_written(name, given[name], words, reference, at_states, check)
                problems += check(*written[name].shape)
            except InputError as error:
                problems += [item for item in error.problems if item != TOLD]
    if problems:
        raise InputError(problems)
    return written


def _shape_problems(
    name: str, rows: int, columns: int, reference: Reference, block: ConstraintBlock | None
) -> list[str]:
    names = reference.equations if block is None else block.constraint.equation_names
    found = []
    if rows != len(names):
        found.append(
            f"{name} has {rows} rows; expected {len(names)}, one for each of: {listed(names, 60)}"
        )
    if name == "Phi_q" and usual_layout(reference, block, columns) is None:
        widths = expected_widths(reference, block)
        found.append(f"Phi_q has {columns} columns; expected {widths}")
    if name != "Phi_q" and columns != 1:
        found.append(f"{name} has {columns} columns; it is a vector: expected one")
    return found


class _Comparer:
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
        self._drop_doubtful_factors()
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
        if not all(np.isfinite(values).all() for values, _ in self._written.values()):
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
        """Compare under a matching."""
        self._matching = matching
        self._written = self._matcher.written(matching, self._subject.states)
        self._exact = self._matcher.written(matching, self._subject.states, exact=True)
        self._expected = self._matcher.expected(matching, self._subject.states)
        self._verdicts = {
            spot: verdict for name in self._quantities for spot, verdict in self._judged(name)
        }

    def _judged(self, name: str) -> Iterator[tuple[Spot, Verdict]]:
        """Yield the verdict of every entry that is compared, row by row."""
        expected = self._expected[name]
        equal = np.all(agrees(*self._written[name], expected), axis=0)
        exact = np.all(agrees(*self._exact[name], expected), axis=0)
        for row, columns in enumerate(equal):
            is_plain = self._matching.is_plain(name, row) and self._convention is None
            for column, is_equal in enumerate(columns):
                if not np.isnan(expected[:, row, column]).all():  # a column of the ground
                    is_exact = is_plain and exact[row, column]
                    right = Verdict.EQUAL if is_exact else Verdict.CONVENTION
                    yield (name, row, column), right if is_equal else Verdict.DIFFERENT

    def _conventions(self) -> Iterator[Convention]:
        """Yield the conventions in which the two differ."""
        yield from [self._convention] if self._convention else []
        yield from conventions_found(self._matching, self._reference.equations)
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
        """Return the entries that are not right, of all constraints or of one."""
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

    def _drop_doubtful_factors(self) -> None:
        """Prefer one fault in a constraint to a factor that explains its rows in part only.

        Blocks of two bodies that are swapped, for instance, have most entries right but for the
        sign: that is no row sign.
        """
        for block in self._subject.blocks:
            before = self._matching
            rows = [row for row in {row for _, row, _ in self._wrong(block)}
                    if np.any(before.factors[row] != 1)]  # fmt: skip
            if rows:
                factors = before.factors.copy()
                factors[rows] = 1.0
                self._adopt(replace(before, factors=factors))
                if not self._is_one_fault(block):
                    self._adopt(before)

    def _is_one_fault(self, block: ConstraintBlock) -> bool:
        """Return whether one fault explains all that differs in the Jacobian of a constraint."""
        spots = [spot for spot in self._wrong(block) if spot[0] == "Phi_q"]
        return bool(spots) and self._diagnostician.is_one_fault(
            block, self._in_system_terms(spots), self._matching.form(block.rows[0])
        )

    def _in_system_terms(self, spots: Sequence[Spot]) -> dict[Index, Given]:
        """Return written entries of a quantity by place, with the conventions taken out."""
        units = self._matching.units.column_factors(self._reference)
        values = {}
        for spot in spots:
            name, row, column = spot
            place = self._index(spot)
            scale = self._matching.factors[row] * self._matching.sign(name)
            if name == "Phi_q":
                scale = scale * units[place[1]]
            written, sizes = (item[:, row, column] / scale for item in self._written[name])
            values[place] = written, OF_TERMS * np.abs(sizes)
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
        exact = self._matcher.written(self._matching, states, exact=True)
        expected = self._matcher.expected(self._matching, states)
        for name, row, column in spots:
            values, sizes = (item[:, row, column] for item in written[name])
            # A value that vanishes on the manifold is measured by its size elsewhere.
            size = np.max(np.abs(self._expected[name][:, row, column]))
            size += np.max(exact[name][1][:, row, column])
            off = np.abs(values - expected[name][:, row, column])
            allowed = ON_MANIFOLD * size + OF_TERMS * np.max(sizes)
            if np.isfinite(allowed) and np.all(off <= allowed):
                self._verdicts[name, row, column] = Verdict.MANIFOLD

    def _is_mistake(self, spot: Spot) -> bool:
        """Return whether an entry is wrong wherever it may have the right value.

        Phi is zero on the manifold, right or wrong; a sign is wrong where it makes no difference.
        """
        name, row, column = spot
        place = np.s_[:, row : row + 1, column : column + 1]
        values, sizes = (item[place] for item in self._written[name])
        is_opposite = agrees(values, sizes, -self._expected[name][place]).all()
        return name == "Phi" or bool(is_opposite) or self._has_rates(spot)

    def _has_rates(self, spot: Spot) -> bool:
        """Return whether rates stand in an entry of Phi, Phi_q or nu."""
        name, row, column = spot
        expression = self._quantities[name].formula(row, column)
        names = symbol_names(expression) if expression is not None else set()
        return name != "gamma" and not names.isdisjoint(self._reference.rates)

    def _is_accepted(self, spot: Spot) -> bool:
        """Return whether an entry counts as right."""
        verdict = self._verdicts[spot]
        if self._strict:
            return verdict is Verdict.EQUAL
        return verdict.is_right or (verdict is Verdict.MANIFOLD and spot[0] in ("nu", "gamma"))

    def _diagnoses(self) -> dict[Spot, tuple[Diagnosis, ...]]:
        """Return the explanations of every entry that is not right."""
        found: dict[Spot, tuple[Diagnosis, ...]] = {}
        for block in self._subject.blocks:
            wrong = [spot for spot in self._wrong(block) if not self._is_accepted(spot)]
            for name in dict.fromkeys(name for name, _, _ in wrong):
                spots = [spot for spot in wrong if spot[0] == name]
                if name in self._opposite:
                    found |= dict.fromkeys(spots, (self._opposite[name],))
                    continue
                explained = self._diagnostician.explain(
                    block, name, self._in_system_terms(spots), self._matching.form(block.rows[0])
                )
                for spot in spots:
                    found[spot] = explained[self._index(spot)] or (self._unexplained(spot),)
        return found

    @cached_property
    def _opposite(self) -> dict[str, Diagnosis]:
        """The diagnosis of nu or gamma where the whole vector has the opposite sign."""
        found = {}
        for name, kind in (("nu", REVERSED), ("gamma", WHOLE_SIGN)):
            expected = self._expected.get(name, np.zeros(1))
            is_opposite = name in self._written and agrees(*self._written[name], -expected).all()
            if is_opposite and np.any(np.abs(expected) > ABSOLUTE):
                text = (
                    f"{name} has the opposite sign throughout; if that is how you define it, state "
                    f'{name} = "{OPPOSITE[name]}" in [conventions].'
                )
                found[name] = Diagnosis(kind, text)
        return found

    def _unexplained(self, spot: Spot) -> Diagnosis:
        if self._has_rates(spot):
            text = f"rates stand in it; {spot[0]} depends on positions and time alone."
            return Diagnosis(WITH_RATES, text)
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
            values = {name: item for name, (item, _) in written.items()}
            return values, self._matcher.expected(self._matching, states)

        return Dependence(self._reference, self._subject.states, evaluate)

    @cached_property
    def _diagnostician(self) -> Diagnostician:
        """The catalogue of faults, kept where many are compared with one model."""
        subject = self._subject
        return subject.kept("faults", lambda: Diagnostician(subject.reference, subject.states))

    def _entry(self, spot: Spot, diagnoses: tuple[Diagnosis, ...]) -> ComparedEntry:
        name, row, column = spot
        system_row, system_column = self._index(spot)
        is_accepted = self._is_accepted(spot)
        reference, form_row = self._reference, system_row
        form = self._matching.form(system_row)
        if form is not None and form.formulas is not None and not is_accepted:
            reference, form_row = form.formulas, form.rows.index(system_row)
        return ComparedEntry(
            name,
            self._reference.equations[system_row],
            self._reference.coordinates[system_column] if name == "Phi_q" else None,
            reference.text(name, form_row, system_column),
            self._quantities[name].texts[row][column],
            self._verdicts[spot],
            is_accepted,
            diagnoses,
            None if is_accepted else self._difference(spot),
        )

    def _difference(self, spot: Spot) -> Difference:
        """Return the state at which an entry differs the most."""
        name, row, column = spot
        written = self._written[name][0][:, row, column]
        expected = self._expected[name][:, row, column]
        k = int(np.argmax(np.nan_to_num(np.abs(written - expected), nan=np.inf, posinf=np.inf)))
        state = self._reference.named(self._subject.states, k)
        return Difference(state, float(expected[k]), float(written[k]))
