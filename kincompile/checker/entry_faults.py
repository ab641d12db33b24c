"""Faults in an entry written out in sines and cosines, as one types it.

The usual faults are made and evaluated. Any other slip is found the other way round, from the
number of the author: `slips`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.checker.agreement import is_alike, is_close
from kincompile.checker.fault import A_TERM, Fault, Kind, term_faults, whole_faults
from kincompile.checker.slips import Slips, partner
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kincompile.checker.fault import Shown
    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States

MOST_TERMS = 80
"""Longer entries are not taken apart: a single term is then no longer recognisable."""
MOST_EXPANDED = 1000
"""Terms up to which an entry is multiplied out; like ones are among them, and join."""


class TypedEntry:
    """One entry with its faults, which show there and nowhere else.

    Parameters
    ----------
    derived
        The right entry; the author's where `right` is given.
    right
        The right values of an entry by hand, whose faults are those that give these.

    Attributes
    ----------
    entry
        That formula as it is typed, a sum of products where that is not too long.
    """

    def __init__(
        self,
        reference: Reference,
        quantity: str,
        derived: sympy.Expr,
        states: States,
        right: Shown | None = None,
    ) -> None:
        self._reference, self._quantity, self._states = reference, quantity, states
        self._derived = self.entry = derived
        self._right, self._is_by_hand = right, right is not None
        if _count(self._derived) <= MOST_EXPANDED:
            self.entry = _multiplied_out(self._derived)

    @cached_property
    def _slips(self) -> Slips:
        """What may stand in the place of its products, besides the usual faults."""
        is_short = len(sympy.Add.make_args(self.entry)) <= MOST_TERMS
        forms = dict.fromkeys((self._derived, self.entry) if is_short else (self._derived,))
        return Slips(
            self._reference, list(forms), self._quantity, self._states, is_by_hand=self._is_by_hand
        )

    def one(self, given: Shown) -> Iterator[Fault[Array]]:
        """Yield the slips that give an author's numbers, or make them right, but the usual ones."""
        return self._slips.one(given if self._right is None else self._right)

    def two(self, given: Shown) -> Iterator[Fault[Array]]:
        """Yield two slips that do together."""
        return self._slips.two(given if self._right is None else self._right)

    def usual(self, given: Shown) -> Iterator[Fault[Array]]:
        """Yield the usual faults, with the entry's values; by hand those that an author made."""
        for fault, _, values in self._found:
            if self._right is None:
                yield Fault(fault.kind, fault.text, values, fault.detail)
            elif is_close(values, *self._right):
                yield Fault(fault.kind, fault.text, given[0], fault.detail)

    def formulas(self) -> Iterator[Fault[sympy.Expr]]:
        """Yield the usual faults, each with the entry as it is then typed."""
        for fault, part, _ in self._found:
            yield replace(fault, result=self.entry - part + fault.result)

    @cached_property
    def _found(self) -> list[tuple[Fault[sympy.Expr], sympy.Expr, Array]]:
        """The usual faults, the part in whose place each result stands, and the entry's values."""
        reference, entry = self._reference, self.entry
        printed = reference.printed(entry)
        angles = [sympy.Symbol(name) for name in reference.angles]
        faults: list[Fault[sympy.Expr]] = []
        if not self._is_by_hand:  # else its multiples are slips
            faults += whole_faults(self._quantity, "the entry", lambda x: x * entry, printed)
        text = "sine and cosine are swapped throughout"
        faults.append(Fault(Kind.SINE_COSINE, text, partner(entry), printed))
        terms = sympy.Add.make_args(entry)
        parts = [entry, *terms] if len(terms) <= MOST_TERMS else [entry]
        replaced = [0] * len(faults)  # number of the part in whose place the result stands
        for k, term in enumerate(parts[1:], 1):
            # One angle for another may divide by zero.
            named = [
                item
                for item in _faults_of_term(term, angles, self._is_by_hand)
                if not item.result.has(sympy.zoo, sympy.nan)
            ]
            faults += named
            replaced += [k] * len(named)
        # Sums are taken of numbers: SymPy would sort the terms of each.
        evaluated = reference.evaluate([*parts, *(fault.result for fault in faults)], self._states)
        values, sizes = (item[..., None] for item in evaluated)
        right, wrong = values[:, :1], values[:, :1] - values[:, replaced] + values[:, len(parts) :]
        sizes = sizes[:, :1] + np.abs(values[:, replaced]) + sizes[:, len(parts) :]
        equal = np.all(is_alike(wrong, right, sizes), axis=(0, 2))
        return [
            (fault, parts[replaced[k]], wrong[:, k, 0])
            for k, fault in enumerate(faults)
            if not equal[k]
        ]


def _multiplied_out(expression: sympy.Expr) -> sympy.Expr:
    """Return a sum of products; roots and quotients of sums stay as they are."""
    kept = {
        item: sympy.Dummy()
        for item in expression.atoms(sympy.Pow)
        if item.base.is_Add and not (item.exp.is_Integer and item.exp > 0)
    }
    back = {symbol: item for item, symbol in kept.items()}
    expanded: sympy.Expr = sympy.expand(expression.xreplace(kept)).xreplace(back)
    return expanded


def _count(expression: Any) -> int:
    """Return of how many terms an expression is when its products are multiplied out, at most."""
    if expression.is_Add:
        return sum(map(_count, expression.args))
    if expression.is_Mul:
        return prod(map(_count, expression.args))
    base, exponent = expression.as_base_exp()
    return _count(base) ** int(exponent) if exponent.is_Integer and exponent > 1 else 1


def _faults_of_term(
    term: sympy.Expr, angles: Sequence[sympy.Symbol], is_by_hand: bool
) -> Iterator[Fault[sympy.Expr]]:
    """Yield the faults of a term; the result stands in its place."""
    full = str(term)
    if not is_by_hand:
        yield from term_faults(A_TERM, lambda factor: factor * term, full)
    functions = sorted(term.atoms(sympy.sin, sympy.cos), key=str)
    yield Fault(Kind.SINE_COSINE, "sine and cosine are swapped in a term", partner(term), full)
    for function in functions if len(functions) > 1 else ():
        text = f"sine and cosine of {function.args[0]} are swapped in a term"
        swapped = term.xreplace({function: partner(function)})
        yield Fault(Kind.SINE_COSINE, text, swapped, full)
        if function.func == sympy.cos and function.args[0].is_Add:
            # cos(a - b) is also cos(b - a), whose sine is the other one.
            yield Fault(Kind.SINE_COSINE, text, -swapped, full)
    for angle in angles:
        for other in angles if term.has(angle) else ():
            if other != angle:
                one, belonging = (angle, other) if is_by_hand else (other, angle)
                text = f"{one} stands where {belonging} belongs, in a term"
                mixed = {item: item.xreplace({angle: other}) for item in functions}
                yield Fault(Kind.MIXED_ANGLES, text, term.xreplace(mixed), full)
    if not is_by_hand:
        yield from _missing_factors(term, full)


def _missing_factors(term: sympy.Expr, full: str) -> Iterator[Fault[sympy.Expr]]:
    number, _ = term.as_coeff_Mul()
    if abs(number) not in (0, 1, 2):
        text = "a constant factor of a term is missing"
        yield Fault(Kind.MISSING_FACTOR, text, term / abs(number), full)
    for factor in sympy.Mul.make_args(term):
        base, exponent = factor.as_base_exp()
        if isinstance(base, sympy.Symbol) and base.name.endswith(rate("")):
            kind, text = Kind.MISSING_RATE, f"a factor {base} is missing in a term"
            if exponent == 2:
                kind, text = Kind.MISSING_SQUARE, f"{base} stands where {base}^2 belongs, in a term"
            yield Fault(kind, text, term / base, full)
