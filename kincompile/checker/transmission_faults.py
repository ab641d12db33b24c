"""Faults in the maps of a transmission, by numbers: of a matrix, its rows, columns and entries.

What the right formula of a loop looks like is not known, only its numbers. So a factor is read off
them, and formulas of the author are corrected until they give them (`slips`, `entry_faults`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, islice, product
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.checker.agreement import ABSOLUTE, CLOSE, are_close
from kincompile.checker.fault import NEAR, Fault, Kind, multiple_fault, showing
from kincompile.checker.given_forms import turned_vector
from kincompile.errors import InputError
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from kincompile.checker.fault import NumericFault
    from kincompile.checker.states import Array
    from kincompile.checker.transmission_reference import PoseStates, TransmissionReference
    from kincompile.checker.written import Written

POWERS = (1.0, -1.0, 2.0, -2.0, 0.5, -0.5)
MOST_MISREAD = 14
"""Names of which each is read as each other."""
MOST_READINGS = 250
"""Ways to read names that are tried; a function is called at each state for each of them."""
MOST_PARTS = 150_000
"""Of formulas, that are evaluated for all these ways together."""
MOST_MATRICES = 4000
"""Matrices with a fault that are compared with the one by hand."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """A matrix by hand beside the right one, (N, rows, columns), with the names of both sides.

    Of efforts a column is a term of the entries, and has its effort's name.
    """

    name: str
    given: Array
    right: Array
    rows: tuple[str | None, ...]
    columns: tuple[str | None, ...]
    is_of_terms: bool = False

    @property
    def turned(self) -> Matrix:
        """The same with rows for columns."""
        given, right = (np.swapaxes(item, 1, 2) for item in (self.given, self.right))
        return Matrix(self.name, given, right, self.columns, self.rows, self.is_of_terms)

    def fault(self, kind: str, text: str, values: Array) -> Iterator[NumericFault]:
        """Yield a fault with all entries in which it shows."""
        return showing(kind, text, values, self.right)


def _back(faults: Iterable[NumericFault]) -> Iterator[NumericFault]:
    """Return faults of a turned matrix by the places of the matrix."""
    for fault in faults:
        yield replace(fault, result={(i, j): x for (j, i), x in fault.result.items()})


class MatrixFaults:
    """The faults that give all numbers of some entries, those of the most entries first."""

    def __init__(self, reference: TransmissionReference, states: PoseStates) -> None:
        self._reference, self._states = reference, states

    def of(self, matrix: Matrix) -> Iterator[NumericFault]:
        """Yield the faults of a matrix, as many as are tried."""
        yield from islice(self._all(matrix), MOST_MATRICES)

    def _all(self, matrix: Matrix) -> Iterator[NumericFault]:
        yield from self._multiples(matrix)
        yield from self._exchanged(matrix, "columns")
        yield from self._frames(matrix)
        turned = matrix.turned
        yield from _back(self._exchanged(turned, "rows"))
        yield from _back(self._frames(turned))

    def _multiples(self, matrix: Matrix) -> Iterator[NumericFault]:
        """Yield the multiples: of all, of rows and columns, and of entries."""
        count, width = matrix.right.shape[1:]
        nonzero = np.any(np.abs(matrix.right) > ABSOLUTE, axis=0)
        chosen: list[tuple[str, Array]] = [(matrix.name, nonzero)]
        for k, name in enumerate(matrix.rows if count > 1 < width else ()):
            chosen.append((f"the row of {name}", nonzero & (np.arange(count) == k)[:, None]))
        for k, name in enumerate(matrix.columns if width > 1 < count else ()):
            chosen.append((f"the column of {name}", nonzero & (np.arange(width) == k)))
        for i, j in np.argwhere(nonzero):
            one = np.zeros_like(nonzero)
            one[i, j] = True
            name = f"the term with {matrix.columns[j]}" if matrix.is_of_terms else "the entry"
            chosen.append((name, one))
        for name, own in chosen:
            if own.any():
                yield from self._multiple(matrix, name, own)

    def _multiple(self, matrix: Matrix, name: str, own: Array) -> Iterator[NumericFault]:
        given, right = matrix.given[:, own], matrix.right[:, own]
        with np.errstate(all="ignore"):
            factor = np.sum(given * right, axis=1) / np.sum(right**2, axis=1)
        if not np.isfinite(factor).all():
            return
        off = np.abs(given - factor[:, None] * right)
        if np.any(off > CLOSE * np.max(np.abs(given) + np.abs(right), axis=1)[:, None]):
            return
        result = {(int(i), int(j)): matrix.given[:, i, j] for i, j in np.argwhere(own)}
        kind_and_text: tuple[str, str] | None = None
        if not np.any(np.abs(factor) > NEAR):
            kind_and_text = Kind.LEFT_ZERO, f"{name} is left zero"
        elif np.ptp(factor) <= NEAR * np.abs(factor[0]):
            is_right = abs(factor[0] - 1) <= NEAR
            kind_and_text = None if is_right else multiple_fault(name, float(factor[0]))
        else:
            kind_and_text = self._factor(name, factor)
        if kind_and_text is not None:
            yield Fault(*kind_and_text, result)

    def _factor(self, name: str, factor: Array) -> tuple[str, str] | None:
        """Return kind and text of a factor that is a power of a word, or a quotient of two."""
        words, values = self._words
        with np.errstate(all="ignore"):
            for power in POWERS:
                for sign in (1.0, -1.0):
                    k = _first_close(sign * values**power, factor)
                    if k is not None:
                        shown = words[k] ** sympy.nsimplify(abs(power))
                        word = "too much" if power > 0 else "missing"
                        kind = Kind.EXTRA_FACTOR if power > 0 else Kind.MISSING_FACTOR
                        also = " and the sign is wrong" if sign < 0 else ""
                        return kind, f"a factor {shown} is {word} in {name}{also}"
            for b, belonging in enumerate(words):
                k = _first_close(values, factor * values[:, b])
                if k is not None:
                    text = f"{words[k]} stands where {belonging} belongs, in {name}"
                    return Kind.OTHER_VARIABLE, text
        return None

    @cached_property
    def _words(self) -> tuple[list[sympy.Expr], Array]:
        """What may be a factor: names and the sines and cosines of angles, (N, count)."""
        reference = self._reference
        words: list[sympy.Expr] = [sympy.Symbol(name) for name in reference.symbols]
        for name in reference.angles:
            words += [sympy.sin(sympy.Symbol(name)), sympy.cos(sympy.Symbol(name))]
        values = reference.evaluate(words, self._states)[0]
        usable = np.all(np.abs(values) > NEAR, axis=0)  # a coordinate may be zero throughout
        return [word for word, is_so in zip(words, usable, strict=True) if is_so], values[:, usable]

    def _exchanged(self, matrix: Matrix, what: str) -> Iterator[NumericFault]:
        """Yield two columns in each other's place, in all rows or in one."""
        kind = Kind.COLUMNS if what == "columns" else Kind.ROWS
        for a, b in combinations(range(len(matrix.columns)), 2):
            other = matrix.right.copy()
            other[:, :, [a, b]] = matrix.right[:, :, [b, a]]
            text = f"the {what} of {matrix.columns[a]} and {matrix.columns[b]} are exchanged"
            yield from matrix.fault(kind, text, other)
            for k, name in enumerate(matrix.rows if len(matrix.rows) > 1 else ()):
                where = f"in the {'row' if what == 'columns' else 'column'} of {name}"
                own = [(k, a), (k, b)]
                yield from showing(kind, f"{text} {where}", other, matrix.right, own)

    def _frames(self, matrix: Matrix) -> Iterator[NumericFault]:
        """Yield two rows turned by an angle of the mechanism, and three by a body's rotation."""
        units = [self._reference.f.units.get(name or "") for name in matrix.rows]
        for a, b in combinations(range(len(units)), 2):
            if units[a] != units[b]:
                continue
            for name, values in self._turns.items():
                c, s = np.cos(values)[:, None], np.sin(values)[:, None]
                for sign, shown in ((1, f"-{name}"), (-1, name)):
                    other = matrix.right.copy()
                    other[:, a] = c * matrix.right[:, a] + sign * s * matrix.right[:, b]
                    other[:, b] = c * matrix.right[:, b] - sign * s * matrix.right[:, a]
                    text = (
                        f"{matrix.rows[a]} and {matrix.rows[b]} are in another frame, turned by "
                        f"{shown}"
                    )
                    yield from matrix.fault(Kind.FRAME, text, other)
        for first in range(len(units) - 2):
            own = np.arange(first, first + 3)
            if len({units[k] for k in own}) == 1:
                for text, rotation in self._rotations.items():
                    other = matrix.right.copy()
                    other[:, own] = rotation @ matrix.right[:, own]
                    names = ", ".join(str(matrix.rows[k]) for k in own)
                    yield from matrix.fault(Kind.FRAME, f"{names} are in {text}", other)

    @cached_property
    def _turns(self) -> dict[str, Array]:
        inputs = self._reference.inputs(self._states)
        return {name: inputs[name] for name in self._reference.angles}

    @cached_property
    def _rotations(self) -> dict[str, Array]:
        """The rotations of bodies in space, and their transposes, (N, 3, 3)."""
        found, reference = {}, self._reference
        for body, own in zip(reference.system.bodies, reference.body_columns, strict=True):
            if len(own) == 7:
                p = tuple(self._states.q[:, own[3:]].T)
                unit = np.eye(3)[..., None] * np.ones(len(self._states))
                turned = np.array([turned_vector(p, tuple(item)) for item in unit]).transpose(
                    2, 1, 0
                )
                found[f"the frame of {body.name}"] = np.swapaxes(turned, 1, 2)
                found[f"another frame, turned with {body.name}"] = turned
        return found


def _first_close(values: Array, wanted: Array) -> int | None:
    """Return the first column (N, count) that has the values wanted, (N,)."""
    with np.errstate(invalid="ignore"):
        close = np.abs(values - wanted[:, None]) <= CLOSE * np.abs(wanted)[:, None]
    found = np.flatnonzero(close.all(axis=0))
    return int(found[0]) if found.size else None


def misread(
    reference: TransmissionReference, states: PoseStates, written: Written, right: Array
) -> Iterator[NumericFault]:
    """Yield the faults of formulas that are right where one name is read as another.

    Parameters
    ----------
    right
        The right values as they are laid out in what is written, (N, rows, columns).
    """
    given, inputs = written.evaluate(states).values, reference.inputs(states)
    most = min(MOST_READINGS, MOST_PARTS // (1 + written.size))
    for kind, text, changes in islice(_readings(reference, written, inputs), most):
        try:
            read = written.evaluate(reference.read_as(states, changes)).values
        except InputError:  # a function may not be defined there
            continue
        changed, fits = ~are_close(read, given), are_close(read, right)
        every = range(given.shape[1])
        for rows in (every, *([i] for i in every if len(every) > 1)):
            own = [(i, j) for i, j in np.argwhere(changed).tolist() if i in rows]
            if own and all(fits[place] for place in own):
                yield Fault(kind, text, {(i, j): given[:, i, j] for i, j in own})


def _readings(
    reference: TransmissionReference, written: Written, inputs: Mapping[str, Array]
) -> Iterator[tuple[str, str, dict[str, Array]]]:
    """Yield the ways to misread names: kind, text, and the values that they have then."""
    read_by = {"u": reference.f.inputs, "x": reference.f.outputs}
    names = [
        name
        for name in reference.symbols
        if written.uses(name)
        and (not written.arguments or any(name in read_by.get(x, ()) for x in written.arguments))
    ][:MOST_MISREAD]
    for name in names:
        yield Kind.SIGN, f"the sign of {name} is wrong throughout", {name: -inputs[name]}
    angles = [name for name in names if name in reference.angles]
    if angles:
        values = {name: np.degrees(inputs[name]) for name in angles}
        yield Kind.DEGREES, f"{listed(angles)}: degrees are taken for radians", values
    for a, b in combinations(names, 2):
        values = {a: inputs[b], b: inputs[a]}
        yield Kind.OTHER_VARIABLE, f"{a} and {b} stand in each other's place", values
    ends = (*reference.f.inputs, *reference.f.outputs)
    for a, b in product(names, dict.fromkeys((*ends, *names))):
        if a != b:
            text = f"{a} stands where {b} belongs, throughout"
            yield Kind.OTHER_VARIABLE, text, {a: inputs[b]}


def missing_terms(terms: Mapping[str, Array], matrix: Matrix) -> Iterator[NumericFault]:
    """Yield J_dot without one of the terms of the chain rule, or with its sign turned."""
    for name, term in terms.items():
        for kind, word, factor in (
            (Kind.CHAIN_RULE, "is missing", 1),
            (Kind.SIGN, "has the wrong sign", 2),
        ):
            text = f"the term of the chain rule with {name} {word}"
            yield from matrix.fault(kind, text, matrix.right - factor * term)
