"""Slips in an entry written out in sines and cosines, as one types it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

from kincompile.compare import mutations
from kincompile.compare.agreement import agrees
from kincompile.compare.faults import LEFT_ZERO, REVERSED, WHOLE_SIGN, Fault
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.compare.reference import Reference
    from kincompile.compare.states import Array, States

MOST_TERMS = 80
"""Longer entries are not taken apart: one term in so many is no longer recognisable."""

Slip = tuple[str, str, sympy.Expr, str]
"""Kind, text, what stands in the place of the term or entry, and the right formula of it."""


def entry_faults(
    reference: Reference, quantity: str, row: int, column: int, states: States
) -> Iterator[Fault]:
    """Yield the faults of one entry; they show there and nowhere else.

    Parameters
    ----------
    reference
        The system.
    quantity, row, column
        The entry, by its place in the system; the column of a vector is 0.
    states
        Where to evaluate.
    """
    entry = sympy.expand(reference.expression(quantity, row, column))
    terms = sympy.Add.make_args(entry)
    angles = _angles(reference)
    slips = list(_whole(entry, quantity))
    rest: list[sympy.Expr] = [sympy.Integer(0)] * len(slips)
    if len(terms) <= MOST_TERMS:
        for term in terms:
            for slip in _term(term, angles):
                slips.append(slip)
                rest.append(entry - term)
    wrong = [other + slip[2] for other, slip in zip(rest, slips, strict=True)]
    values, sizes = reference.evaluate([entry, *wrong], states)
    for k, (kind, text, _, detail) in enumerate(slips, 1):
        if not _same(values[:, k], sizes[:, k], values[:, 0]):
            yield Fault(kind, text, {(row, column): values[:, k]}, detail)


def _same(values: Array, sizes: Array, right: Array) -> bool:
    shape = (-1, 1, 1)
    return bool(agrees(values.reshape(shape), sizes.reshape(shape), right.reshape(shape)).all())


def _angles(reference: Reference) -> dict[sympy.Symbol, list[sympy.Symbol]]:
    """Return for every angle the others that it may be mixed up with."""
    symbols = [
        sympy.Symbol(name)
        for name, angular in zip(reference.coordinates, reference.angular, strict=True)
        if angular
    ]
    return {symbol: [other for other in symbols if other != symbol] for symbol in symbols}


def _whole(entry: sympy.Expr, quantity: str) -> Iterator[Slip]:
    signs = {"nu": REVERSED, "gamma": WHOLE_SIGN}
    full = str(entry)
    yield signs.get(quantity, mutations.SIGN), "the entry has the wrong sign", -entry, full
    yield LEFT_ZERO, "the entry is left zero", sympy.Integer(0), full
    yield mutations.FACTOR, "the entry is twice what it should be", 2 * entry, full
    yield mutations.FACTOR, "the entry is half of what it should be", entry / 2, full
    exchanged = _sine_cosine(entry)
    yield mutations.SINE_COSINE, "sine and cosine are swapped throughout", exchanged, full


def _term(term: sympy.Expr, angles: dict[sympy.Symbol, list[sympy.Symbol]]) -> Iterator[Slip]:
    """Yield what may stand in the place of a term."""
    full = str(term)
    yield mutations.MISSING_TERM, "a term is missing", sympy.Integer(0), full
    yield mutations.SIGN, "a term has the wrong sign", -term, full
    yield mutations.FACTOR, "a term is counted twice", 2 * term, full
    yield mutations.FACTOR, "a term is counted half", term / 2, full
    yield mutations.SINE_COSINE, "sine and cosine are swapped in a term", _sine_cosine(term), full
    yield from _functions_of(term, full)
    for angle, others in angles.items():
        for other in others if term.has(angle) else ():
            text = f"{other} stands where {angle} belongs, in a term"
            yield mutations.MIXED_ANGLES, text, _in_functions(term, angle, other), full
    yield from _factors(term, full)


def _functions_of(term: sympy.Expr, full: str) -> Iterator[Slip]:
    """Yield the term with one of its sines or cosines replaced."""
    found = sorted(term.atoms(sympy.sin, sympy.cos), key=str)
    if len(found) > 1:
        for function in found:
            swapped = term.xreplace({function: _sine_cosine(function)})
            text = f"sine and cosine of {function.args[0]} are swapped in a term"
            yield mutations.SINE_COSINE, text, swapped, full


def _sine_cosine(expression: sympy.Expr) -> sympy.Expr:
    """Swap sine and cosine, all at once."""
    found = expression.atoms(sympy.sin, sympy.cos)
    other = {sympy.sin: sympy.cos, sympy.cos: sympy.sin}
    swapped: sympy.Expr = expression.xreplace({f: other[f.func](*f.args) for f in found})
    return swapped


def _in_functions(term: sympy.Expr, angle: sympy.Symbol, other: sympy.Symbol) -> sympy.Expr:
    """Replace an angle where it stands in a sine or cosine."""
    found = {f: f.xreplace({angle: other}) for f in term.atoms(sympy.sin, sympy.cos)}
    replaced: sympy.Expr = term.xreplace(found)
    return replaced


def _factors(term: sympy.Expr, full: str) -> Iterator[Slip]:
    """Yield the term without a factor, or without a square."""
    number, _ = term.as_coeff_Mul()
    if abs(number) not in (0, 1, 2):
        sign = 1 if number > 0 else -1
        text = "a constant factor of a term is missing"
        yield mutations.MISSING_FACTOR, text, sign * term / number, full
    for factor in sympy.Mul.make_args(term):
        base, exponent = factor.as_base_exp()
        is_rate = isinstance(base, sympy.Symbol) and base.name.endswith(rate(""))
        if is_rate and exponent == 2:
            text = f"{base} stands where {base}^2 belongs, in a term"
            yield mutations.MISSING_SQUARE, text, term / base, full
        elif is_rate:
            yield mutations.MISSING_RATE, f"a factor {base} is missing in a term", term / base, full
