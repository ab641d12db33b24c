"""The textbook's notation, independent of the language it is printed in.

`Notation` is mixed into a printer of SymPy, which dispatches on the class of what it prints; the
methods below add the classes of the vector calculus and of `formulas`. A language gives the
primitives: a row, an index, a fraction, a matrix.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from kincompile.calculus import expressions as ex
from kincompile.calculus.space import EulerRotation
from kincompile.derive.collected import is_rate
from kincompile.report import formulas as fm

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from fractions import Fraction

Printed = Any
"""A printed formula: text, or an element of a document."""

GREEK = frozenset(
    (
        *("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa"),
        *("lambda", "mu", "nu", "xi", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi"),
        *("omega", "vartheta", "Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma"),
        *("Upsilon", "Phi", "Psi", "Omega"),
    )
)
_NAME = re.compile(r"([A-Za-z]+?)(\d*)(?:_(\w+))?")
_RATE = re.compile(r"(\w+?)_(d+)ot")
CONNECTIVES = {"&": "\N{LOGICAL AND}", "|": "\N{LOGICAL OR}"}
LONGEST_NUMERATOR = 24
"""Most nodes above a fraction bar, since no line can be broken within a fraction."""

BODY_FIXED, OF_BODIES = ("s", "v", "omega", "pi"), ("a", "f", "g", "h")
"""Letters of vectors given in the frame of a body, the last with the index of a body."""


def has_prime(letter: str, index: str) -> bool:
    """Return whether a vector is given in the frame of a body."""
    return letter in BODY_FIXED or (letter in OF_BODIES and bool(index))


def split_name(name: str) -> tuple[str, str, int]:
    """Return letter, index and number of dots of a name, for instance of `phi_crank_dot`.

    A name whose stem is neither a letter nor Greek is a word of its own, without an index.
    """
    match = _RATE.fullmatch(name)
    stem, dots = (match[1], len(match[2])) if match else (name, 0)
    parts = _NAME.fullmatch(stem)
    if parts is None or not (len(parts[1]) == 1 or parts[1] in GREEK):
        return stem, "", dots
    return parts[1], ",".join(part for part in parts.groups()[1:] if part), dots


class Notation:
    """Printing methods for the vector calculus, for formulas and for the expanded code.

    A medium gives the first methods: things side by side, letters by their names, the text of an
    index, operators and brackets, one at the beginning of a continued line (`_leading`), numerals,
    dots or a tilde over something, an index or an exponent or both, and so on.

    Attributes
    ----------
    abbreviations
        Vectors and angles that are printed as one symbol, such as d.
    """

    abbreviations: Mapping[Any, fm.Glyph]

    def _row(self, parts: Sequence[Printed]) -> Printed: ...
    def _letter(self, name: str, *, bold: bool = False) -> Printed: ...
    def _index_text(self, index: str) -> Printed: ...
    def _operator(self, text: str) -> Printed: ...
    def _leading(self, text: str) -> Printed: ...
    def _numeral(self, text: str) -> Printed: ...
    def _dotted(self, base: Printed, dots: int) -> Printed: ...
    def _tilded(self, base: Printed) -> Printed: ...
    def _scripts(
        self, base: Printed, index: Printed | None, exponent: Printed | None
    ) -> Printed: ...
    def _fraction(self, numerator: Printed, denominator: Printed) -> Printed: ...
    def _function(self, name: str) -> Printed: ...
    def _root(self, value: Printed) -> Printed: ...
    def _fenced_with(self, value: Printed, exponent: Printed) -> Printed:
        """Return something in brackets with an exponent."""
        return self._scripts(self._fenced(value), None, exponent)

    def _thin_space(self) -> Printed: ...
    def _array(self, rows: Sequence[Sequence[Printed]]) -> Printed: ...

    if TYPE_CHECKING:

        def _print(self, expr: Any, **kwargs: Any) -> Printed:
            """Print anything; the printer of SymPy has it."""

    def _named(self, name: str, *, is_vector: bool, is_skew: bool = False) -> Printed:
        letter, index, dots = split_name(name)
        prime = self._operator("\N{PRIME}") if is_vector and has_prime(letter, index) else None
        base = self._letter(letter, bold=is_vector)
        base = self._dotted(base, dots) if dots else base
        base = self._tilded(base) if is_skew else base
        return self._scripts(base, self._index_text(index) if index else None, prime)

    def _fenced(self, value: Printed) -> Printed:
        return self._row([self._operator("("), value, self._operator(")")])

    def _print_Symbol(self, expr: Any, style: str = "plain") -> Printed:
        del style
        return self._named(expr.name, is_vector=False)

    def _print_VectorSymbol(self, expr: ex.VectorSymbol) -> Printed:
        return self._named(expr.name, is_vector=True)

    def _print_TimeFunction(self, expr: ex.TimeFunction) -> Printed:
        base = self._letter(expr.name)
        return self._dotted(base, expr.order) if expr.order else base

    def _print_ProfileFunction(self, expr: ex.ProfileFunction) -> Printed:
        letter, index, _ = split_name(expr.name)
        return self._primed(self._letter(letter), self._index_text(index), expr.order)

    def _print_Pi(self, expr: Any) -> Printed:
        del expr
        return self._letter("pi")

    def _print_Basis(self, expr: ex.Basis) -> Printed:
        return self._unit("xyz"[expr.axis] if expr.size < 4 else str(expr.axis))

    def _print_Circular(self, expr: ex.Circular) -> Printed:
        return self._row([self._function(expr.name), self._fenced(self._short(expr.argument))])

    def _print_Angle(self, expr: ex.Angle) -> Printed:
        parts = [self._short(expr.sine), self._operator(","), self._short(expr.cosine)]
        return self._row([self._function("atan2"), self._fenced(self._row(parts))])

    def _unit(self, axis: str) -> Printed:
        return self._scripts(self._letter("e", bold=True), self._index_text(axis), None)

    def _print_Perpendicular(self, expr: ex.Perpendicular) -> Printed:
        if isinstance(expr.vector, ex.Basis):
            return self._unit("y")
        turn = self._letter("R", bold=True)
        return self._row([turn, self._factor(expr.vector)])

    def _print_RotationSlope(self, expr: ex.RotationSlope) -> Printed:
        (p,) = expr.rotation.coordinates
        if expr.is_small and isinstance(p, ex.VectorSymbol):
            return self._row([self._matrix("A", p.name), self._skew(expr.vector)])
        return self._slope(p, expr.vector)

    def _matrix(self, letter: str, name: str) -> Printed:
        """Return a matrix of a body with the index of something else of it."""
        index = split_name(name)[1]
        base = self._letter(letter, bold=True)
        return self._scripts(base, self._index_text(index) if index else None, None)

    def _skew(self, vector: Any) -> Printed:
        """Return v~."""
        if isinstance(vector, ex.VectorSymbol):
            return self._named(vector.name, is_vector=True, is_skew=True)
        return self._tilded(self._factor(vector))

    def _print_Cross(self, expr: ex.Cross) -> Printed:
        return self._row([self._skew(expr.left), self._factor(expr.right)])

    def _print_TimesG(self, expr: ex.TimesG) -> Printed:
        name = expr.p.name if isinstance(expr.p, ex.VectorSymbol) else ""
        matrix = self._matrix("G", name)
        if expr.is_transposed:
            index = self._index_text(split_name(name)[1])
            matrix = self._scripts(self._letter("G", bold=True), index, self._letter("T"))
        return self._row([matrix, self._factor(expr.vector)])

    def _print_RowOfSlope(self, expr: ex.RowOfSlope) -> Printed:
        return self._row([self._transposed(expr.left), self._short(expr.slope)])

    def _slope(self, p: Any, vector: Any) -> Printed:
        """Return B(p, v), linear in both."""
        arguments = [self._short(p), self._operator(","), self._short(vector)]
        return self._row([self._letter("B", bold=True), self._fenced(self._row(arguments))])

    def _print_Rotated(self, expr: ex.Rotated) -> Printed:
        (angle,) = expr.rotation.coordinates
        if isinstance(expr.rotation, EulerRotation) and expr.along:
            first, *others = (angle, *expr.along)[-2:]
            return self._row([self._slope(first, expr.vector), self._factor(others[0])])
        if isinstance(expr.vector, ex.Basis):
            unit = self._row([self._letter("u", bold=True), self._fenced(self._short(angle))])
            turn = [self._letter("R", bold=True)] if expr.along else []
            return self._row([*turn, unit])
        index = split_name(angle.name)[1] if isinstance(angle, ex.Symbol | ex.VectorSymbol) else ""
        base = self._letter(expr.rotation.letters[expr.order], bold=True)
        matrix = self._scripts(base, self._index_text(index), None)
        return self._row([matrix, self._factor(expr.vector)])

    def _print_Norm(self, expr: ex.Norm) -> Printed:
        return self._row([self._operator("|"), self._short(expr.vector), self._operator("|")])

    def _print_Root(self, expr: ex.Root) -> Printed:
        return self._root(self._print(expr.square))

    def _print_Dot(self, expr: ex.Dot) -> Printed:
        return self._row([self._transposed(expr.left), self._factor(expr.right)])

    def _print_Transposed(self, expr: fm.Transposed) -> Printed:
        if isinstance(expr.vector, ex.VectorSum) and any(map(is_slope, expr.vector.terms)):
            return self._row_of(expr.vector.terms)
        if is_slope(expr.vector):
            return self._print(expr.vector)
        is_negative, magnitude = signed(expr.vector)
        minus = [self._operator("-")] if is_negative else []
        return self._row([*minus, self._transposed(magnitude)])

    def _row_of(self, terms: Sequence[Any]) -> Printed:
        """Return a sum of rows: vectors transposed, and rows of slopes."""
        parts: list[Printed] = []
        for term in terms:
            is_negative, magnitude = signed(term)
            if is_negative or parts:
                parts.append(self._operator("-" if is_negative else "+"))
            parts.append(self._print(fm.Transposed(magnitude)))
        return self._row(parts)

    def _transposed(self, vector: Any) -> Printed:
        if isinstance(vector, ex.RowOfSlope):
            return self._short(vector)
        return self._raised(vector, self._letter("T"))

    def _raised(self, base: Any, exponent: Printed) -> Printed:
        """Return something with an exponent, in brackets where it needs them."""
        if self._is_atom(base):
            return self._scripts(self._short(base), None, exponent)
        return self._fenced_with(self._short(base), exponent)

    def _is_atom(self, expr: Any) -> bool:
        """Return whether something needs no brackets under an exponent."""
        is_unit = isinstance(expr, ex.Perpendicular) and isinstance(expr.vector, ex.Basis)
        atoms = (
            ex.Symbol | ex.VectorSymbol | ex.TimeFunction | ex.Basis | fm.Call | ex.ProfileFunction
        )
        return is_unit or isinstance(expr, atoms) or expr in self.abbreviations

    def _short(self, expr: Any) -> Printed:
        """Return a formula, or its abbreviation."""
        found = self.abbreviations.get(expr)
        return self._print(expr if found is None else found)

    def _factor(self, expr: Any) -> Printed:
        """Return a formula as a factor of a product."""
        is_sum = isinstance(expr, ex.Sum | ex.VectorSum) and expr not in self.abbreviations
        printed = self._short(expr)
        return self._fenced(printed) if is_sum else printed

    def _print_Number(self, expr: Any) -> Printed:
        value = expr.value
        minus = [self._operator("-")] if value < 0 else []
        return self._row([*minus, self._magnitude(abs(value))])

    def _magnitude(self, value: Fraction) -> Printed:
        top, bottom = self._numeral(str(value.numerator)), self._numeral(str(value.denominator))
        return top if value.denominator == 1 else self._fraction(top, bottom)

    def _print_Decimal(self, expr: fm.Decimal) -> Printed:
        text = f"{expr.value + 0.0:.{expr.digits}g}"
        mantissa, _, exponent = text.lstrip("-").partition("e")
        parts = [self._operator("-")] if text.startswith("-") else []
        parts.append(self._numeral(mantissa))
        if exponent:
            power = self._numeral(str(int(exponent)).replace("-", "\N{MINUS SIGN}"))
            parts += [self._operator("\N{MULTIPLICATION SIGN}")]
            parts += [self._scripts(self._numeral("10"), None, power)]
        return self._row(parts)

    def _print_Sum(self, expr: Any) -> Printed:
        return self._sum(expr.terms)

    _print_VectorSum = _print_Sum

    def _sum(self, terms: Sequence[Any]) -> Printed:
        if not terms:
            return self._numeral("0")
        parts: list[Printed] = []
        for k, term in enumerate(terms):
            is_negative, magnitude = signed(term)
            if is_negative or k:
                parts.append(self._operator("-" if is_negative else "+"))
            # A sum inside a sum comes from the code, where the order of addition matters.
            parts.append(self._factor(magnitude))
        return self._row(parts)

    def _print_Product(self, expr: Any) -> Printed:
        is_negative, magnitude = signed(expr)
        if is_negative:
            return self._row([self._operator("-"), self._factor(magnitude)])
        return self._product(expr.factors)

    def _print_Scaled(self, expr: ex.Scaled) -> Printed:
        is_negative, magnitude = signed(expr)
        if is_negative:
            return self._row([self._operator("-"), self._factor(magnitude)])
        factors = expr.factor.factors if isinstance(expr.factor, ex.Product) else (expr.factor,)
        return self._product((*factors, expr.vector))

    def _product(self, factors: Sequence[Any]) -> Printed:
        """Return a product: numbers first, rates last, reciprocals below the fraction bar."""
        below = [item.base for item in factors if is_reciprocal(item)]
        above = [item for item in factors if not is_reciprocal(item)]
        above.sort(key=place_of)
        if not below:
            return self._juxtaposed(above)
        divisor = self._juxtaposed(below)
        if fm.size(tuple(above), LONGEST_NUMERATOR) <= LONGEST_NUMERATOR:
            return self._fraction(self._juxtaposed(above), divisor)
        inverse = self._fraction(self._numeral("1"), divisor)
        return self._row([inverse, self._thin_space(), *(self._factor(item) for item in above)])

    def _juxtaposed(self, factors: Sequence[Any]) -> Printed:
        if not factors:
            return self._numeral("1")
        if len(factors) == 1:
            return self._short(factors[0])
        parts: list[Printed] = []
        for k, item in enumerate(factors):
            if k and isinstance(item, ex.Number | fm.Decimal):
                parts.append(self._operator("\N{DOT OPERATOR}"))
            elif k:
                parts.append(self._thin_space())
            parts.append(self._factor(item))
        return self._row(parts)

    def _print_Power(self, expr: Any) -> Printed:
        base, exponent = expr.base, str(expr.exponent).replace("-", "\N{MINUS SIGN}")
        if isinstance(base, fm.Call) and base.function != "sqrt":
            head = self._scripts(self._function(base.function), None, self._numeral(exponent))
            return self._row([head, self._arguments(base)])
        return self._raised(base, self._numeral(exponent))

    def _print_Quotient(self, expr: fm.Quotient) -> Printed:
        return self._fraction(self._print(expr.numerator), self._print(expr.denominator))

    def _print_Call(self, expr: fm.Call) -> Printed:
        if expr.function == "sqrt":
            return self._root(self._print(expr.arguments[0]))
        if expr.function == "pow":
            base, exponent = expr.arguments
            return self._scripts(self._fenced(self._print(base)), None, self._print(exponent))
        return self._row([self._function(expr.function), self._arguments(expr)])

    def _arguments(self, expr: fm.Call) -> Printed:
        simple = len(expr.arguments) == 1 and isinstance(expr.arguments[0], ex.Symbol)
        if simple and expr.function in ("sin", "cos", "tan"):
            return self._print(expr.arguments[0])
        return self._listed(expr.arguments)

    def _listed(self, items: Sequence[Any]) -> Printed:
        """Return things in brackets, with commas between them."""
        return self._fenced(self._joined(",", items))

    def _joined(self, operator: str, items: Sequence[Any]) -> Printed:
        """Return things side by side, with an operator between them."""
        parts = [part for item in items for part in (self._operator(operator), self._print(item))]
        return self._row(parts[1:])

    def _print_PeriodicSpline(self, expr: Any) -> Printed:
        name = self._letter(expr.table_name)
        return self._row([self._primed(name, None, expr.order), self._listed(expr.args[:1])])

    def _primed(self, base: Printed, index: Printed | None, order: int) -> Printed:
        """Return something with as many primes as it is differentiated."""
        return self._scripts(base, index, self._operator("\N{PRIME}" * order) if order else None)

    def _print_Choice(self, expr: fm.Choice) -> Printed:
        rows = [
            [self._print(expr.first), self._print(expr.condition)],
            [self._print(expr.second), self._function("otherwise")],
        ]
        return self._array(rows)

    def _print_Relation(self, expr: fm.Relation) -> Printed:
        relation = self._operator(CONNECTIVES.get(expr.relation, expr.relation))
        return self._row([self._print(expr.left), relation, self._print(expr.right)])

    def _print_Glyph(self, expr: fm.Glyph) -> Printed:
        base = self._letter(expr.letter, bold=expr.bold)
        base = self._dotted(base, expr.dots) if expr.dots else base
        index = self._index_text(expr.index) if expr.index else None
        exponent = self._index_text(expr.exponent) if expr.exponent else None
        return self._scripts(base, index, exponent)

    def _print_Joined(self, expr: fm.Joined) -> Printed:
        return self._row([self._part(part) for part in expr.parts])

    def _part(self, part: Any) -> Printed:
        if not isinstance(part, str):
            return self._print(part)
        if part.isdigit():
            return self._numeral(part)
        return self._function(part) if part.isalpha() else self._operator(part)

    def _print_Sub(self, expr: fm.Sub) -> Printed:
        index = self._print(expr.index)
        if isinstance(expr.base, fm.Glyph) and expr.base.exponent and not expr.base.index:
            bare = self._print(replace(expr.base, exponent=""))
            return self._scripts(bare, index, self._index_text(expr.base.exponent))
        return self._scripts(self._print(expr.base), index, None)

    def _print_DerivativeSymbol(self, expr: fm.DerivativeSymbol) -> Printed:
        top = self._row([self._sign(expr.sign), self._print(expr.numerator)])
        return self._fraction(
            top, self._row([self._sign(expr.sign), self._print(expr.denominator)])
        )

    def _sign(self, sign: str) -> Printed:
        return self._letter("d") if sign == "d" else self._operator(sign)

    def _print_Differential(self, expr: fm.Differential) -> Printed:
        return self._row([self._letter("d"), self._print(expr.variable)])

    def _print_Equated(self, expr: fm.Equated) -> Printed:
        return self._joined("=", expr.parts)

    def _print_Matrix(self, expr: fm.Matrix) -> Printed:
        return self._array([[self._short(cell) for cell in row] for row in expr.rows])


def is_slope(term: Any) -> bool:
    """Return whether a term of a row is a slope, with or without a factor."""
    return isinstance(term.vector if isinstance(term, ex.Scaled) else term, ex.RowOfSlope)


def signed(term: Any) -> tuple[bool, Any]:
    """Return whether a term has a minus in front, and the term without it."""
    match term:
        case ex.Number(value) if value < 0:
            return True, ex.Number(-value)
        case fm.Decimal(value, digits) if value < 0:
            return True, fm.Decimal(-value, digits)
        case ex.Product((ex.Number(value), *rest)) if value < 0:
            factors = rest if value == -1 else [ex.Number(-value), *rest]
            return True, factors[0] if len(factors) == 1 else ex.Product(tuple(factors))
        case ex.Scaled(factor, vector):
            is_negative, magnitude = signed(factor)
            return is_negative, vector if magnitude == ex.ONE else ex.Scaled(magnitude, vector)
    return False, term


def is_reciprocal(factor: Any) -> bool:
    """Return whether a factor stands below a fraction bar."""
    return isinstance(factor, ex.Power) and factor.exponent == -1


def place_of(factor: Any) -> int:
    """Return where a factor stands: numbers first, rates and differentials last."""
    if isinstance(factor, ex.Number | fm.Decimal):
        return 0
    return 2 if isinstance(factor, fm.Differential) or is_rate(factor) else 1
