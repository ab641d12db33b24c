"""Long formulas in pieces, between which a line may be broken."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.calculus import expressions as ex
from kincompile.report import formulas as fm
from kincompile.report.notation import (
    LONGEST_NUMERATOR,
    Notation,
    is_reciprocal,
    is_slope,
    place_of,
    signed,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.report.notation import Printed

LONGEST_PIECE = 9
"""Most nodes of a factor that is kept on one line; a longer one may be broken within."""


class Breakable(Notation):
    """The textbook's notation, in which long formulas have places where a line may end."""

    def _bracket(self, text: str) -> Printed:
        """Return a bracket that does not grow with what stands beside it on one of its lines."""
        return self._operator(text)

    def pieces(self, formula: Any) -> list[Printed]:
        """Return a formula in pieces between which a line may be broken: at =, + and -.

        Long products are broken between their factors too, and long sums within their brackets.
        """
        if not isinstance(formula, fm.Equated):
            return [self._print(formula)]
        pieces: list[list[Printed]] = []
        for k, part in enumerate(formula.parts):
            if _is_sum(part):
                own = self._sum_in_pieces(part, follows=k > 0)
            elif fm.size(part, LONGEST_PIECE) > LONGEST_PIECE:
                own = self._broken(part)
            else:
                own = [[self._print(part)]]
            pieces += _led(own, self._leading("=")) if k else own
        return [self._row(piece) for piece in pieces]

    def _in_pieces(self, expr: Any) -> list[list[Printed]]:
        """Return a factor in pieces, each the parts of a row."""
        if expr in self.abbreviations or not self._is_longer(expr, LONGEST_PIECE):
            return [[self._short(expr)]]
        return self._broken(expr)

    def _broken(self, expr: Any) -> list[list[Printed]]:
        """Return a long formula, which is no sum, in pieces."""
        is_negative, magnitude = signed(expr)
        if is_negative:
            return _led(self._factor_in_pieces(magnitude), self._operator("-"))
        match expr:
            case ex.Product(factors):
                return self._product_in_pieces(factors)
            case ex.Scaled(ex.Product(factors), vector):
                return self._product_in_pieces((*factors, vector))
            case ex.Scaled(factor, vector):
                return self._product_in_pieces((factor, vector))
            case fm.Quotient(numerator, denominator) if self._is_longer(
                numerator, LONGEST_NUMERATOR
            ):
                inverse = self._fraction(self._numeral("1"), self._print(denominator))
                own = self._factor_in_pieces(numerator)
                return [[inverse], *_led(own, self._thin_space())]
            case ex.Power(base, exponent) if _is_sum(base) and exponent > 0:
                return self._bracketed(base, self._numeral(str(exponent)))
            case ex.Dot(ex.VectorSum(terms) as left, right) if (
                left not in self.abbreviations and not any(map(is_slope, terms))
            ):
                row = self._bracketed(left, self._letter("T"))
                return [*row, *self._factor_in_pieces(right)]
            case ex.Dot(left, right):
                return [[self._transposed(left)], *self._factor_in_pieces(right)]
            case fm.Call(function, arguments) if function not in ("sqrt", "pow"):
                return self._call_in_pieces(function, arguments)
        return [[self._print(expr)]]

    def _is_longer(self, expr: Any, most: int) -> bool:
        """Return whether a formula has more nodes, abbreviations being one each."""
        return fm.size(expr, most, self.abbreviations) > most

    def _factor_in_pieces(self, expr: Any) -> list[list[Printed]]:
        is_atom = expr in self.abbreviations
        if _is_sum(expr) and not is_atom and self._is_longer(expr, LONGEST_PIECE):
            return self._bracketed(expr)
        return [[self._factor(expr)]] if _is_sum(expr) else self._in_pieces(expr)

    def _product_in_pieces(self, factors: Sequence[Any]) -> list[list[Printed]]:
        below = [item.base for item in factors if is_reciprocal(item)]
        above = tuple(item for item in factors if not is_reciprocal(item))
        if below and not self._is_longer(above, LONGEST_NUMERATOR):
            return [[self._product(factors)]]
        inverse = self._fraction(self._numeral("1"), self._juxtaposed(below)) if below else None
        pieces = [] if inverse is None else [[inverse]]
        for item in sorted(above, key=place_of):
            own = self._factor_in_pieces(item)
            is_number = isinstance(item, ex.Number | fm.Decimal)
            between = self._operator("\N{DOT OPERATOR}") if is_number else self._thin_space()
            pieces += _led(own, between) if pieces else own
        return pieces

    def _call_in_pieces(self, function: str, arguments: Sequence[Any]) -> list[list[Printed]]:
        found: list[list[Printed]] = []
        for item in arguments:
            own = self._sum_in_pieces(item) if _is_sum(item) else self._in_pieces(item)
            if found:
                found[-1].append(self._operator(","))
            found += own
        found[-1].append(self._bracket(")"))
        return _led(_led(found, self._bracket("(")), self._function(function))

    def _bracketed(self, expr: Any, exponent: Printed | None = None) -> list[list[Printed]]:
        """Return a sum in brackets, in pieces."""
        found = _led(self._sum_in_pieces(expr), self._bracket("("))
        found[-1].append(self._scripts(self._bracket(")"), None, exponent))
        return found

    def _sum_in_pieces(self, expr: Any, *, follows: bool = False) -> list[list[Printed]]:
        found: list[list[Printed]] = []
        for term in expr.terms:
            is_negative, magnitude = signed(term)
            own = self._factor_in_pieces(magnitude)
            sign = "-" if is_negative else "+" if found else ""
            mark = self._leading if found or follows else self._operator
            found += _led(own, mark(sign)) if sign else own
        return found


def _is_sum(expr: Any) -> bool:
    return isinstance(expr, ex.Sum | ex.VectorSum) and bool(expr.terms)


def _led(pieces: list[list[Printed]], lead: Printed) -> list[list[Printed]]:
    """Return pieces, the first of which begins with something more."""
    return [[lead, *pieces[0]], *pieces[1:]]
