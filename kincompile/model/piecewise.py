"""Gaps between the pieces of a Piecewise.

They can be seen where its conditions compare one symbol with plain numbers, as `t < 1` does.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, cast

import sympy
from sympy.core.relational import Relational

from kincompile.model.laws import MotionLaw

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sympy.functions.elementary.piecewise import ExprCondPair

TOLERANCE = 1e-9
"""A gap relative to the values on both sides: breakpoints are often given as decimal numbers."""

_REMEDY = "let the pieces meet with equal value and slope"
_ALLOW = "corners=True"


def gap_problem(value: sympy.Expr, *, corners: bool = False) -> str | None:
    """Return a message about a jump or a corner between pieces, or None.

    Velocities and accelerations need the first derivative to be continuous. A breakpoint or a
    difference that is not a plain number, since it depends on parameters, is not looked at. With
    `corners` the slope may jump.

    Returns
    -------
    str or None
        The breakpoint and the numbers on both sides, or None where no gap is seen.
    """
    problem = _law_problem(value, corners=corners)
    if problem:
        return problem
    for symbol, place, reach in _breakpoints(value):
        before, after = (_at(value, symbol, place + side * reach) for side in (-1, 1))
        jump = _numbers_that_differ(before, after, symbol, place)
        if jump:
            return (
                f"the pieces do not meet at {symbol} = {number_text(place)}: {jump[0]:g} before, "
                f"{jump[1]:g} after; {_REMEDY}"
            )
        if corners:
            continue
        corner = _numbers_that_differ(before.diff(symbol), after.diff(symbol), symbol, place)
        if corner:
            return (
                f"the pieces meet in a corner at {symbol} = {number_text(place)}: the slope is "
                f"{corner[0]:g} before, {corner[1]:g} after; {_REMEDY}, or keep it: {_ALLOW}"
            )
    return None


def _law_problem(value: sympy.Expr, *, corners: bool) -> str | None:
    """Return a message about a motion law that jumps or has corners, or None."""
    laws = sorted(value.atoms(MotionLaw), key=str)
    for smooth, what in ((-1, "jump"), (0, "corner")):
        rough = [law for law in laws if min(law.continuity - law.order, 1) == smooth]
        if rough and not (corners and smooth == 0):
            ends = sorted({end for law in rough for end in _ends(law)}, key=sympy.default_sort_key)
            places = ", ".join(map(number_text, ends))
            names = ", ".join(dict.fromkeys(law.func.__name__ for law in rough))
            remedy = f", or keep them: {_ALLOW}" if smooth == 0 else ""
            return f"the law {names} has {what}s at t = {places}; take a smoother one{remedy}"
    return None


def _ends(law: MotionLaw) -> Iterator[sympy.Expr]:
    """Yield the times at which a law begins and ends, where its argument is linear in time."""
    argument, time = cast("sympy.Expr", law.args[0]), sympy.Symbol("t")
    slope, start = argument.diff(time), argument.subs(time, 0)
    if slope and not slope.has(time):
        yield from (sympy.simplify((place - start) / slope) for place in (0, 1))


def number_text(place: sympy.Expr) -> str:
    """Return a place as a message shows it: a decimal number short, anything else as it is."""
    return f"{float(place):g}" if isinstance(place, sympy.Float) else str(place)


def _breakpoints(value: sympy.Expr) -> Iterator[tuple[sympy.Symbol, sympy.Expr, sympy.Expr]]:
    """Yield each symbol with its breakpoints, and how far around one there is no other."""
    found: dict[sympy.Symbol, set[sympy.Expr]] = {}
    for relation in value.atoms(Relational):
        symbols = relation.free_symbols
        if len(symbols) == 1:
            symbol = cast("sympy.Symbol", next(iter(symbols)))
            found.setdefault(symbol, set()).update(_zeros(relation.lhs - relation.rhs, symbol))
    for symbol in sorted(found, key=str):
        places = sorted(found[symbol], key=float)
        reach = min((after - before for before, after in pairwise(places)), default=sympy.S.One)
        for place in places:
            yield symbol, place, reach / 4


def _zeros(difference: sympy.Expr, symbol: sympy.Symbol) -> list[sympy.Expr]:
    """Return the real zero of a linear difference; other differences are not looked at."""
    slope = difference.diff(symbol)
    if not slope.is_number or not slope.is_real or slope.is_zero:
        return []
    zero = -difference.subs(symbol, 0) / slope
    return [zero] if zero.is_real else []


def _at(value: sympy.Expr, symbol: sympy.Symbol, place: sympy.Expr) -> sympy.Expr:
    """Return the expression that holds around a place: of each Piecewise the piece taken there."""

    def piece(node: sympy.Expr) -> sympy.Expr:
        for pair in cast("tuple[ExprCondPair, ...]", node.args):
            holds = pair.cond.subs(symbol, place)
            if holds == sympy.true:
                return cast("sympy.Expr", pair.expr)
            if holds != sympy.false:
                break
        return node

    taken = value.replace(lambda node: isinstance(node, sympy.Piecewise), piece)
    return cast("sympy.Expr", taken)


def _numbers_that_differ(
    before: sympy.Expr, after: sympy.Expr, symbol: sympy.Symbol, place: sympy.Expr
) -> tuple[float, float] | None:
    """Return the values of two expressions at a place where both are numbers and not equal."""
    numbers = [side.subs(symbol, place).evalf() for side in (before, after)]
    if not all(number.is_Number and number.is_finite for number in numbers):
        return None
    left, right = float(numbers[0]), float(numbers[1])
    return (left, right) if abs(left - right) > TOLERANCE * (1 + abs(left) + abs(right)) else None
