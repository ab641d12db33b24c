"""Comparison of hand-derived formulas with the generated ones.

reference   what the compiler derives, evaluated at random states        reference.py, states.py
hand        what the author derives: formulas, arrays, functions         hand.py, hand_file.py
match       rows, columns, signs, scales that conventions leave open     conventions.py, layouts.py
agree       entry by entry: equal, equal on the manifold, different      agreement.py
diagnose    what fault of the catalogue gives the numbers that differ    faults.py, diagnosis.py
report      entries with verdicts, for people and for machines           report.py, pages.py

Equality is decided by numbers at a dozen random states, never by simplification.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from kincompile.compare.agreement import agrees
from kincompile.compare.conventions import Matcher, Matching, Scope, conventions_found
from kincompile.compare.dependence import Dependence
from kincompile.compare.diagnosis import Diagnostician, Differing
from kincompile.compare.entries import Diagnosis, Difference, Entry, Verdict
from kincompile.compare.hand import Hand, read_hand, vocabulary
from kincompile.compare.hand_file import HandFile, read_hand_file
from kincompile.compare.layouts import expected_widths, usual_layout
from kincompile.compare.reference import QUANTITIES, Reference
from kincompile.compare.report import Report
from kincompile.compare.states import States, given_states
from kincompile.errors import InputError
from kincompile.names import listed

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from kincompile.compare.faults import Place
    from kincompile.compare.reference import Block
    from kincompile.compare.states import Array
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

UNEXPLAINED = "not in the catalogue"

ON_MANIFOLD = 1e-8
"""Relative; the states on the manifold are themselves accurate to 1e-12 only."""


def compare(
    model: Mechanism | ConstraintSystem | Reference,
    Phi: Any = None,
    Phi_q: Any = None,
    nu: Any = None,
    gamma: Any = None,
    *,
    constraint: str | None = None,
    aliases: Mapping[str, Any] | None = None,
    states: Mapping[str, Any] | None = None,
) -> Report:
    r"""Compare hand-derived Phi, Phi_q, nu and gamma with the generated ones.

    :math:`\Phi_q \dot q = \nu = -\Phi_t` and :math:`\Phi_q \ddot q = \gamma = -(\Phi_q \dot q)_q
    \dot q - 2 \Phi_{qt} \dot q - \Phi_{tt}` (Haug, section 3.1).

    Parameters
    ----------
    model
        The mechanism or system; a `Reference` made of it, where many are compared with one model.
    Phi, Phi_q, nu, gamma
        What was derived by hand: text such as ``[[1, 0, 0.25*cos(phi3)], ...]``, nested lists of
        numbers, texts and SymPy expressions, a SymPy matrix, an array, or a function ``f(q, t)``
        (of gamma ``f(q, q_dot, t)``), which may take the parameters p as a last argument. Parts
        that were not derived are left out.
    constraint
        Name of the one constraint that is checked alone. Phi_q then has the columns of the whole
        system, or of the constraint's bodies, i before j.
    aliases
        Names of the author's own, each with its expression, for instance ``{"w": "phi3_dot"}``.
    states
        States at which the values of arrays belong: ``q`` (N, n), and where they matter ``q_dot``
        (N, n), ``t`` (N,), ``p`` (N, k). Random states where None.

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
    return _compared(reference, given, constraint, aliases or {}, states)


def compare_file(
    model: Mechanism | ConstraintSystem | Reference,
    path: str | os.PathLike[str],
    *,
    constraint: str | None = None,
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

    Returns
    -------
    Report
        As `compare` gives it.

    Raises
    ------
    ModelError, InputError
        As `compare` does; a message begins with the file and the line.
    """
    file: HandFile = read_hand_file(Path(path))
    reference = model if isinstance(model, Reference) else Reference(model)
    chosen = file.constraint if constraint is None else constraint
    where = f"{file.name}, "
    return _compared(reference, file.quantities, chosen, file.aliases, None, where)


def _compared(
    reference: Reference,
    given: Mapping[str, Any],
    constraint: str | None,
    aliases: Mapping[str, Any],
    states: Mapping[str, Any] | None,
    where: str = "",
) -> Report:
    block = None if constraint is None else reference.block(constraint)
    words = vocabulary(reference, aliases, where)
    hands: dict[str, Hand] = {}
    problems: list[str] = []
    for name in QUANTITIES:
        if name in given:
            try:
                hands[name] = read_hand(
                    name, given[name], words, reference, at_states=states is not None, where=where
                )
                problems += _shape_problems(name, hands[name], reference, block, where)
            except InputError as error:
                problems += error.problems
    if problems:
        raise InputError(problems)
    scope = Scope(reference, block, _chosen_states(reference, hands, states))
    return _Comparison(scope, hands).report()


def _shape_problems(
    name: str, hand: Hand, reference: Reference, block: Block | None, where: str
) -> list[str]:
    rows, columns = hand.shape
    names = reference.equations
    if block is not None:
        names = block.constraint.equation_names
    found = []
    if rows != len(names):
        found.append(
            f"{where}{name} has {rows} rows; expected {len(names)}, one for each of: "
            f"{listed(names, 60)}"
        )
    if name == "Phi_q" and usual_layout(reference, block, columns) is None:
        widths = expected_widths(reference, block)
        found.append(f"{where}Phi_q has {columns} columns; expected {widths}")
    if name != "Phi_q" and columns != 1:
        found.append(f"{where}{name} has {columns} columns; it is a vector: expected one")
    return found


def _chosen_states(
    reference: Reference, hands: Mapping[str, Hand], states: Mapping[str, Any] | None
) -> States:
    if states is not None:
        return given_states(states, reference.system)
    if all(hand.takes_parameters for hand in hands.values()):
        return reference.random
    return reference.random.with_default_parameters(reference.defaults)


class _Comparison:
    """One comparison under way."""

    def __init__(self, scope: Scope, hands: Mapping[str, Hand]) -> None:
        self._scope = scope
        self._hands = hands
        self._reference = scope.reference
        self._matcher = Matcher(scope, hands)
        self._take(self._matcher.match())
        self._drop_doubtful_factors()

    def _take(self, matching: Matching) -> None:
        """Compare under a matching."""
        states = self._scope.states
        self._matching = matching
        self._written = self._matcher.written(matching, states)
        self._expected = self._matcher.expected(matching, states)
        self._verdicts = {name: self._verdicts_of(name) for name in self._hands}

    def _drop_doubtful_factors(self) -> None:
        """Prefer one fault in a constraint to a factor that explains its rows in part only.

        Blocks of two bodies that are swapped, for instance, have most entries right but for the
        sign: that is no row sign.
        """
        usual = self._matching
        for block in self._scope.blocks:
            rows = [
                row
                for row, target in enumerate(usual.rows)
                if self._scope.rows[target] in block.rows
                and np.any(usual.factors[row] != 1)
                and any(place[0] == row for name in self._hands for place in self._unequal(name))
            ]
            if not rows:
                continue
            before = self._matching
            factors = before.factors.copy()
            factors[rows] = 1.0
            self._take(replace(before, factors=factors))
            if not self._is_one_fault(block):
                self._take(before)

    def _is_one_fault(self, block: Block) -> bool:
        """Return whether one fault explains all that differs in the Jacobian of a constraint."""
        own = {
            self._target("Phi_q", *place): self._plain("Phi_q", *place)
            for place in (self._unequal("Phi_q") if "Phi_q" in self._hands else [])
            if self._target("Phi_q", *place)[0] in block.rows
        }
        diagnostician = _diagnostician(self._reference, self._scope.states)
        differing = Differing("Phi_q", own)
        return bool(own) and diagnostician.is_one_fault(block, differing, self._exchanged(block))

    def _exchanged(self, block: Block) -> bool:
        first = self._scope.rows[0]
        return self._matching.exchanged.issuperset(row - first for row in block.rows)

    def report(self) -> Report:
        """Return the outcome."""
        self._find_equal_on_manifold()
        diagnoses = self._diagnoses()
        block = self._scope.block
        names = [self._reference.equations[row] for row in self._scope.rows]
        entries = [
            self._entry(name, row, column, verdict, diagnoses.get((name, row, column), ()))
            for name, verdicts in self._verdicts.items()
            for (row, column), verdict in verdicts.items()
        ]
        return Report(
            self._reference.system.name,
            None if block is None else block.constraint.name,
            tuple(entries),
            conventions_found(self._matching, names),
        )

    def _verdicts_of(self, name: str) -> dict[tuple[int, int], Verdict]:
        """Return the verdict of every entry that is compared, row by row."""
        values, sizes = self._written[name]
        expected = self._expected[name]
        equal = np.asarray(agrees(values, sizes, expected).all(axis=0))
        verdicts = {}
        for row, column in np.ndindex(equal.shape):
            if np.isnan(expected[:, row, column]).all():
                continue  # a column of the ground
            verdict = Verdict.DIFFERENT
            if equal[row, column]:
                plain = self._matching.is_plain(name, row)
                verdict = Verdict.EQUAL if plain else Verdict.CONVENTION
            verdicts[row, column] = verdict
        return verdicts

    def _unequal(self, name: str) -> list[tuple[int, int]]:
        right = (Verdict.EQUAL, Verdict.CONVENTION)
        return [place for place, verdict in self._verdicts[name].items() if verdict not in right]

    def _target(self, name: str, row: int, column: int) -> Place:
        """Return row and column in the system of an entry as written."""
        system_row = self._scope.rows[self._matching.rows[row]]
        if name != "Phi_q":
            return system_row, 0
        system_column = self._matching.layout.columns[column]
        assert system_column is not None
        return system_row, system_column

    def _find_equal_on_manifold(self) -> None:
        """Look again at what differs, at states at which the constraint holds.

        The constraint alone comes first; an entry may also need the other constraints to hold.
        Phi itself is zero there, whatever it is.
        """
        open_entries = {name: self._unequal(name) for name in self._hands if name != "Phi"}
        if not any(open_entries.values()) or not all(
            hand.takes_states for hand in self._hands.values()
        ):
            return
        for block in self._blocks_of(open_entries):
            for rows in (block.rows, range(len(self._reference.equations))):
                states = self._reference.consistent(self._scope.states, list(rows))
                if states is not None:
                    self._compare_on_manifold(states, block, open_entries)

    def _blocks_of(self, entries: Mapping[str, list[tuple[int, int]]]) -> list[Block]:
        rows = {
            self._target(name, *place)[0] for name, places in entries.items() for place in places
        }
        return [block for block in self._scope.blocks if rows.intersection(block.rows)]

    def _compare_on_manifold(
        self, states: States, block: Block, entries: Mapping[str, list[tuple[int, int]]]
    ) -> None:
        written = self._matcher.written(self._matching, states)
        expected = self._matcher.expected(self._matching, states)
        for name, places in entries.items():
            for row, column in places:
                if self._target(name, row, column)[0] not in block.rows:
                    continue
                # What vanishes on the manifold is measured by its size elsewhere.
                size = np.max(np.abs(self._expected[name][:, row, column]))
                values, sizes = (item[:, row, column] for item in written[name])
                off = np.abs(values - expected[name][:, row, column])
                if np.all(off <= ON_MANIFOLD * (size + np.max(sizes))):
                    self._verdicts[name][row, column] = Verdict.MANIFOLD

    def _diagnoses(self) -> dict[tuple[str, int, int], tuple[Diagnosis, ...]]:
        """Return what explains every entry that is not equal."""
        diagnostician = _diagnostician(self._reference, self._scope.states)
        found: dict[tuple[str, int, int], tuple[Diagnosis, ...]] = {}
        for name in self._hands:
            places = {self._target(name, *place): place for place in self._unequal(name)}
            for block in self._scope.blocks:
                own = {target: place for target, place in places.items() if target[0] in block.rows}
                if not own:
                    continue
                values = {target: self._plain(name, *place) for target, place in own.items()}
                differing = Differing(name, values)
                explained = diagnostician.explain(block, differing, self._exchanged(block))
                for target, diagnoses in explained.items():
                    found[name, *own[target]] = diagnoses or self._unexplained(name, *own[target])
        return found

    def _plain(self, name: str, row: int, column: int) -> Array:
        """Return what is written in an entry with the conventions taken out."""
        values = self._written[name][0][:, row, column]
        scale = self._matching.factors[row] * self._matching.sign(name)
        if name == "Phi_q":
            target = self._target(name, row, column)[1]
            scale = scale * self._matching.units.column_factors(self._reference)[target]
        return np.asarray(values / scale)

    def _unexplained(self, name: str, row: int, column: int) -> tuple[Diagnosis, ...]:
        if not self._hands[name].takes_states:
            return (Diagnosis(UNEXPLAINED, "no fault of the catalogue fits."),)
        return (Diagnosis(UNEXPLAINED, self._dependence.text(name, row, column)),)

    @cached_property
    def _dependence(self) -> Dependence:
        return Dependence(
            self._reference,
            self._scope.states,
            lambda states: {
                name: values
                for name, (values, _) in self._matcher.written(self._matching, states).items()
            },
            lambda states: self._matcher.expected(self._matching, states),
        )

    def _entry(
        self,
        name: str,
        row: int,
        column: int,
        verdict: Verdict,
        diagnoses: tuple[Diagnosis, ...],
    ) -> Entry:
        system_row, system_column = self._target(name, row, column)
        right = verdict in (Verdict.EQUAL, Verdict.CONVENTION)
        return Entry(
            name,
            self._reference.equations[system_row],
            self._reference.coordinates[system_column] if name == "Phi_q" else None,
            self._reference.text(name, system_row, system_column),
            self._hands[name].texts[row][column],
            verdict,
            diagnoses,
            None if right else self._difference(name, row, column),
        )

    def _difference(self, name: str, row: int, column: int) -> Difference:
        """Return the state at which an entry differs the most."""
        written = self._written[name][0][:, row, column]
        expected = self._expected[name][:, row, column]
        off = np.nan_to_num(np.abs(written - expected), nan=np.inf, posinf=np.inf)
        k = int(np.argmax(off))
        named = self._reference.named(self._scope.states, k)
        return Difference(named, float(expected[k]), float(written[k]))


_DIAGNOSTICIANS: WeakKeyDictionary[Reference, Diagnostician] = WeakKeyDictionary()


def _diagnostician(reference: Reference, states: States) -> Diagnostician:
    """Return the catalogue of a reference, kept where many are compared with one model."""
    if states is not reference.random:
        return Diagnostician(reference, states)
    if reference not in _DIAGNOSTICIANS:
        _DIAGNOSTICIANS[reference] = Diagnostician(reference, states)
    return _DIAGNOSTICIANS[reference]
