"""Find the mistake: Jacobians of constraints with one slip each, from the checker's catalogue."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import cycle, islice, zip_longest
from random import Random
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.checker.compare import compare
from kincompile.checker.entry_faults import TypedEntry
from kincompile.checker.reference import Reference
from kincompile.errors import InputError
from kincompile.exercises.blanks import PLACE, Blank, is_fair
from kincompile.model.resolve import Joint

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from kincompile.checker.fault import Fault
    from kincompile.model.system import ConstraintSystem

TASKS = 3
"""Jacobians of an exercise, of the constraints in turn."""

VISIBLE = 1e-2
"""Part of an entry by which a slip changes it at half of the states at least."""


@dataclass(frozen=True, slots=True)
class Mistake:
    """A Jacobian with a slip in one entry.

    Attributes
    ----------
    place, entry
        The two blanks of it: where the slip is, and what belongs there.
    rows
        The entries as they are shown, by row and column of the system; those left out are zero.
    kind, text
        What the slip is, as the checker's catalogue has it.
    """

    place: Blank
    entry: Blank
    rows: Mapping[tuple[int, int], sympy.Expr]
    kind: str
    text: str


def choose_mistakes(system: ConstraintSystem, seed: str) -> tuple[Mistake, ...]:
    """Choose slips for a student: each changes one entry of Phi_q, and the checker names it.

    The seed is that of the student.

    Raises
    ------
    InputError
        If no entry of the model varies.
    """
    drawing = _Drawing(system, Random(f"mistakes-{seed}"))
    names = [
        item.name
        for item in system.constraints
        if not (isinstance(item, Joint) and item.written.is_own)
    ]
    drawing.random.shuffle(names)
    drawn = {name: drawing.mistakes(name) for name in names}
    found: list[Mistake] = []
    for name in islice(cycle(names), TASKS * len(names)):
        if len(found) < TASKS and (made := next(drawn[name], None)) is not None:
            found.append(made)
    if len(found) < TASKS:
        raise InputError(
            f"{system.name} has too few entries of Phi_q that vary, so that there is no slip to "
            "find; give a mechanism with joints, or free equations"
        )
    found.sort(key=lambda item: item.place.row)
    return tuple(_numbered(item, k) for k, item in enumerate(found, 1))


class _Drawing:
    """Draws slips in the Jacobians of a system."""

    def __init__(self, system: ConstraintSystem, random: Random) -> None:
        self._system, self.random, self._reference = system, random, Reference(system)
        self._Phi, self._Phi_q = system.Phi, system.Phi_q  # made anew each time they are asked for

    def mistakes(self, name: str) -> Iterator[Mistake]:
        """Yield Jacobians of a constraint with one slip, entries and kinds of slips in turn."""
        reference, columns = self._reference, range(len(self._system.coordinates))
        places = [(row, k) for row in reference.block(name).rows for k in columns]
        places = [x for x in places if self._Phi_q[x] != 0]
        typed = {
            x: TypedEntry(reference, "Phi_q", reference.expression("Phi_q", *x), reference.random)
            for x in places
        }
        fair = [x for x in places if is_fair(self._Phi_q[x])]
        own = {x for row in reference.block(name).rows for x in self._Phi[row].free_symbols}
        self.random.shuffle(fair)
        waiting = [(x, _in_turn(typed[x].formulas(), self.random)) for x in fair]
        while waiting:
            place, faults = waiting.pop(0)
            if (fault := next(faults, None)) is None:
                continue
            waiting.append((place, faults))
            shown = {x: _plain(item.entry) for x, item in typed.items()}
            shown[place] = _plain(fault.result)
            # A number where something varies, or another joint's angle, would be seen at once.
            is_hidden = is_fair(fault.result) and fault.result.free_symbols <= own
            if is_hidden and self._is_one_slip(name, place, shown, fault.kind):
                asked, entry = (Blank("", name, quantity, *place) for quantity in (PLACE, "Phi_q"))
                yield Mistake(asked, entry, shown, fault.kind, fault.text)

    def _is_one_slip(
        self, name: str, place: tuple[int, int], shown: Mapping[tuple[int, int], Any], kind: str
    ) -> bool:
        """Return whether the checker finds this slip, in this entry alone, and calls it so.

        Its numbers must show it too: rounded formulas by hand are no slips.
        """
        system, reference = self._system, self._reference
        rows = reference.block(name).rows
        Phi_q = [[shown.get((row, k), 0) for k in range(len(system.coordinates))] for row in rows]
        Phi = [self._Phi[row] for row in rows]
        report = compare(reference, Phi=Phi, Phi_q=Phi_q, constraint=name)
        wrong = [entry for entry in report.entries if not entry.accepted]
        label = Blank("", name, "Phi_q", *place).label(system)
        if [entry.label for entry in wrong] != [label] or report.conventions:
            return False
        if kind not in [item.kind for item in wrong[0].diagnoses]:
            return False
        formulas = shown[place], self._Phi_q[place]
        values, _ = reference.evaluate(formulas, reference.random)
        off = np.abs(values[:, 0] - values[:, 1]) / np.max(np.abs(values[:, 1]))
        return bool(np.median(off) > VISIBLE)


def _in_turn(faults: Iterable[Fault[sympy.Expr]], random: Random) -> Iterator[Fault[sympy.Expr]]:
    """Yield faults in random order, one of each kind before the second of any."""
    kinds: dict[str, list[Fault[sympy.Expr]]] = {}
    for fault in faults:
        kinds.setdefault(fault.kind, []).append(fault)
    groups = list(kinds.values())
    random.shuffle(groups)
    for group in groups:
        random.shuffle(group)
    for own in zip_longest(*groups):
        yield from (fault for fault in own if fault is not None)


def _plain(entry: sympy.Expr) -> sympy.Expr:
    """Return an entry with whole numbers as one writes them, 2 for 2.0."""
    whole = {x: sympy.Integer(int(x)) for x in entry.atoms(sympy.Float) if float(x).is_integer()}
    plain: sympy.Expr = entry.xreplace(whole)
    return plain


def _numbered(mistake: Mistake, k: int) -> Mistake:
    place, entry = replace(mistake.place, name=f"P{k}"), replace(mistake.entry, name=f"B{k}")
    return replace(mistake, place=place, entry=entry)
