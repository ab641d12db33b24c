"""The textbook's notation, independent of the language it is printed in.

`Notation` is mixed into a printer of SymPy, which dispatches on the class of what it prints; the
methods below add the classes of the vector calculus and of `formulas`. A language gives the
primitives: a row, an index, a fraction, a matrix.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from kincompile.calculus.expressions import (
    ONE,
    Basis,
    Dot,
    Norm,
    Number,
    Perpendicular,
    Power,
    Product,
    Profile,
    Rotated,
    Scaled,
    Sum,
    Symbol,
    TimeFunction,
    VectorSum,
    VectorSymbol,
)
from kincompile.derivation.formulas import (
    Call,
    Choice,
    Decimal,
    Equated,
    Glyph,
    Matrix,
    Partial,
    Quotient,
    Relation,
    Row,
    Sub,
    Transposed,
    size,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from fractions import Fraction

Printed = Any
"""What a language makes of a formula: text, or an element of a document."""

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
"""Nodes above a fraction bar: within a fraction no line can be broken."""

_BODY_FIXED = ("s", "v")


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

    Attributes
    ----------
    abbreviations
        Vectors and angles that are printed as one symbol, such as d.
    """

    abbreviations: Mapping[Any, Glyph]

    @abstractmethod
    def row(self, parts: Sequence[Printed]) -> Printed:
        """Return things side by side."""

    @abstractmethod
    def letter(self, name: str, *, bold: bool = False) -> Printed:
        """Return a letter, a Greek letter by its name, or a word."""

    @abstractmethod
    def index_text(self, index: str) -> Printed:
        """Return the text of an index."""

    @abstractmethod
    def operator(self, text: str) -> Printed:
        """Return an operator or a bracket."""

    @abstractmethod
    def leading(self, text: str) -> Printed:
        """Return an operator at the beginning of a continued line."""

    @abstractmethod
    def numeral(self, text: str) -> Printed:
        """Return a number."""

    @abstractmethod
    def dotted(self, base: Printed, dots: int) -> Printed:
        """Return something with dots over it."""

    @abstractmethod
    def scripts(self, base: Printed, index: Printed | None, exponent: Printed | None) -> Printed:
        """Return something with an index, an exponent, or both."""

    @abstractmethod
    def fraction(self, numerator: Printed, denominator: Printed) -> Printed:
        """Return a fraction."""

    @abstractmethod
    def function(self, name: str) -> Printed:
        """Return the name of a function."""

    @abstractmethod
    def root(self, value: Printed) -> Printed:
        """Return a square root."""

    def fenced_with(self, value: Printed, exponent: Printed) -> Printed:
        """Return something in brackets with an exponent."""
        return self.scripts(self._fenced(value), None, exponent)

    @abstractmethod
    def thin_space(self) -> Printed:
        """Return what stands between factors."""

    @abstractmethod
    def array(self, rows: Sequence[Sequence[Printed]]) -> Printed:
        """Return a matrix in brackets."""

    if TYPE_CHECKING:

        def _print(self, expr: Any, **kwargs: Any) -> Printed:
            """Print anything; the printer of SymPy has it."""

    def _named(self, name: str, *, is_vector: bool) -> Printed:
        letter, index, dots = split_name(name)
        prime = self.operator("\N{PRIME}") if is_vector and letter in _BODY_FIXED else None
        base = self.letter(letter, bold=is_vector)
        base = self.dotted(base, dots) if dots else base
        return self.scripts(base, self.index_text(index) if index else None, prime)

    def _fenced(self, value: Printed) -> Printed:
        return self.row([self.operator("("), value, self.operator(")")])

    def _print_Symbol(self, expr: Any, style: str = "plain") -> Printed:
        del style
        return self._named(expr.name, is_vector=False)

    def _print_VectorSymbol(self, expr: VectorSymbol) -> Printed:
        return self._named(expr.name, is_vector=True)

    def _print_TimeFunction(self, expr: TimeFunction) -> Printed:
        base = self.letter(expr.name)
        return self.dotted(base, expr.order) if expr.order else base

    def _print_Profile(self, expr: Profile) -> Printed:
        letter, index, _ = split_name(expr.name)
        primes = self.operator("\N{PRIME}" * expr.order) if expr.order else None
        base = self.letter(letter)
        return self.scripts(base, self.index_text(index), primes)

    def _print_Pi(self, expr: Any) -> Printed:
        del expr
        return self.letter("pi")

    def _print_Basis(self, expr: Basis) -> Printed:
        del expr
        return self._unit("x")

    def _unit(self, axis: str) -> Printed:
        return self.scripts(self.letter("e", bold=True), self.index_text(axis), None)

    def _print_Perpendicular(self, expr: Perpendicular) -> Printed:
        if isinstance(expr.vector, Basis):
            return self._unit("y")
        turn = self.letter("R", bold=True)
        return self.row([turn, self._factor(expr.vector)])

    def _print_Rotated(self, expr: Rotated) -> Printed:
        (angle,) = expr.rotation.coordinates
        if isinstance(expr.vector, Basis):
            unit = self.row([self.letter("u", bold=True), self._fenced(self._short(angle))])
            turn = [self.letter("R", bold=True)] if expr.along else []
            return self.row([*turn, unit])
        index = split_name(angle.name)[1] if isinstance(angle, Symbol) else ""
        base = self.letter(expr.rotation.letters[expr.order], bold=True)
        matrix = self.scripts(base, self.index_text(index), None)
        return self.row([matrix, self._factor(expr.vector)])

    def _print_Norm(self, expr: Norm) -> Printed:
        return self.row([self.operator("|"), self._short(expr.vector), self.operator("|")])

    def _print_Dot(self, expr: Dot) -> Printed:
        return self.row([self._transposed(expr.left), self._factor(expr.right)])

    def _print_Transposed(self, expr: Transposed) -> Printed:
        is_negative, magnitude = _signed(expr.vector)
        minus = [self.operator("-")] if is_negative else []
        return self.row([*minus, self._transposed(magnitude)])

    def _transposed(self, vector: Any) -> Printed:
        return self._raised(vector, self.letter("T"))

    def _raised(self, base: Any, exponent: Printed) -> Printed:
        """Return something with an exponent, in brackets where it needs them."""
        if self._is_atom(base):
            return self.scripts(self._short(base), None, exponent)
        return self.fenced_with(self._short(base), exponent)

    def _is_atom(self, expr: Any) -> bool:
        """Return whether something needs no brackets under an exponent."""
        is_unit = isinstance(expr, Perpendicular) and isinstance(expr.vector, Basis)
        atoms = Symbol | VectorSymbol | TimeFunction | Basis | Call | Profile
        return is_unit or isinstance(expr, atoms) or expr in self.abbreviations

    def _short(self, expr: Any) -> Printed:
        """Return a formula, or its abbreviation."""
        found = self.abbreviations.get(expr)
        return self._print(expr if found is None else found)

    def _factor(self, expr: Any) -> Printed:
        """Return a formula as a factor of a product."""
        is_sum = isinstance(expr, Sum | VectorSum) and expr not in self.abbreviations
        printed = self._short(expr)
        return self._fenced(printed) if is_sum else printed

    def _print_Number(self, expr: Any) -> Printed:
        value = expr.value
        minus = [self.operator("-")] if value < 0 else []
        return self.row([*minus, self._magnitude(abs(value))])

    def _magnitude(self, value: Fraction) -> Printed:
        top, bottom = self.numeral(str(value.numerator)), self.numeral(str(value.denominator))
        return top if value.denominator == 1 else self.fraction(top, bottom)

    def _print_Decimal(self, expr: Decimal) -> Printed:
        text = f"{expr.value + 0.0:.{expr.digits}g}"
        mantissa, _, exponent = text.lstrip("-").partition("e")
        parts = [self.operator("-")] if text.startswith("-") else []
        parts.append(self.numeral(mantissa))
        if exponent:
            power = self.numeral(str(int(exponent)).replace("-", "\N{MINUS SIGN}"))
            parts += [self.operator("\N{MULTIPLICATION SIGN}")]
            parts += [self.scripts(self.numeral("10"), None, power)]
        return self.row(parts)

    def _print_Sum(self, expr: Any) -> Printed:
        return self._sum(expr.terms)

    def _print_VectorSum(self, expr: VectorSum) -> Printed:
        return self._sum(expr.terms)

    def _sum(self, terms: Sequence[Any]) -> Printed:
        if not terms:
            return self.numeral("0")
        parts: list[Printed] = []
        for k, term in enumerate(terms):
            is_negative, magnitude = _signed(term)
            if is_negative or k:
                parts.append(self.operator("-" if is_negative else "+"))
            # A sum inside a sum comes from the code, where the order of addition matters.
            parts.append(self._factor(magnitude))
        return self.row(parts)

    def _print_Product(self, expr: Any) -> Printed:
        is_negative, magnitude = _signed(expr)
        if is_negative:
            return self.row([self.operator("-"), self._factor(magnitude)])
        return self._product(expr.factors)

    def _print_Scaled(self, expr: Scaled) -> Printed:
        is_negative, magnitude = _signed(expr)
        if is_negative:
            return self.row([self.operator("-"), self._factor(magnitude)])
        factors = expr.factor.factors if isinstance(expr.factor, Product) else (expr.factor,)
        return self._product((*factors, expr.vector))

    def _product(self, factors: Sequence[Any]) -> Printed:
        """Return a product: numbers in front, rates behind, reciprocals below the line."""
        below = [item.base for item in factors if _is_reciprocal(item)]
        above = [item for item in factors if not _is_reciprocal(item)]
        above.sort(key=_place)
        if not below:
            return self._juxtaposed(above)
        divisor = self._juxtaposed(below)
        if size(tuple(above)) <= LONGEST_NUMERATOR:
            return self.fraction(self._juxtaposed(above), divisor)
        inverse = self.fraction(self.numeral("1"), divisor)
        return self.row([inverse, self.thin_space(), *(self._factor(item) for item in above)])

    def _juxtaposed(self, factors: Sequence[Any]) -> Printed:
        if not factors:
            return self.numeral("1")
        if len(factors) == 1:
            return self._short(factors[0])
        parts: list[Printed] = []
        for k, item in enumerate(factors):
            if k and isinstance(item, Number | Decimal):
                parts.append(self.operator("\N{DOT OPERATOR}"))
            elif k:
                parts.append(self.thin_space())
            parts.append(self._factor(item))
        return self.row(parts)

    def _print_Power(self, expr: Any) -> Printed:
        base, exponent = expr.base, str(expr.exponent).replace("-", "\N{MINUS SIGN}")
        if isinstance(base, Call) and base.function != "sqrt":
            head = self.scripts(self.function(base.function), None, self.numeral(exponent))
            return self.row([head, self._arguments(base)])
        return self._raised(base, self.numeral(exponent))

    def _print_Quotient(self, expr: Quotient) -> Printed:
        return self.fraction(self._print(expr.numerator), self._print(expr.denominator))

    def _print_Call(self, expr: Call) -> Printed:
        if expr.function == "sqrt":
            return self.root(self._print(expr.arguments[0]))
        if expr.function == "pow":
            base, exponent = expr.arguments
            return self.scripts(self._fenced(self._print(base)), None, self._print(exponent))
        return self.row([self.function(expr.function), self._arguments(expr)])

    def _arguments(self, expr: Call) -> Printed:
        simple = len(expr.arguments) == 1 and isinstance(expr.arguments[0], Symbol)
        if simple and expr.function in ("sin", "cos", "tan"):
            return self._print(expr.arguments[0])
        parts: list[Printed] = []
        for k, item in enumerate(expr.arguments):
            parts += [self.operator(",")] if k else []
            parts.append(self._print(item))
        return self._fenced(self.row(parts))

    def _print_Choice(self, expr: Choice) -> Printed:
        rows = [
            [self._print(expr.first), self._print(expr.condition)],
            [self._print(expr.second), self.function("otherwise")],
        ]
        return self.array(rows)

    def _print_Relation(self, expr: Relation) -> Printed:
        relation = self.operator(CONNECTIVES.get(expr.relation, expr.relation))
        return self.row([self._print(expr.left), relation, self._print(expr.right)])

    def _print_Glyph(self, expr: Glyph) -> Printed:
        base = self.letter(expr.letter, bold=expr.bold)
        base = self.dotted(base, expr.dots) if expr.dots else base
        index = self.index_text(expr.index) if expr.index else None
        exponent = self.index_text(expr.exponent) if expr.exponent else None
        return self.scripts(base, index, exponent)

    def _print_Row(self, expr: Row) -> Printed:
        return self.row([self._part(part) for part in expr.parts])

    def _part(self, part: Any) -> Printed:
        if not isinstance(part, str):
            return self._print(part)
        if part.isdigit():
            return self.numeral(part)
        return self.function(part) if part.isalpha() else self.operator(part)

    def _print_Sub(self, expr: Sub) -> Printed:
        index = self._print(expr.index)
        if isinstance(expr.base, Glyph) and expr.base.exponent and not expr.base.index:
            bare = self._print(replace(expr.base, exponent=""))
            return self.scripts(bare, index, self.index_text(expr.base.exponent))
        return self.scripts(self._print(expr.base), index, None)

    def _print_Partial(self, expr: Partial) -> Printed:
        parts = (
            [self._sign(expr.sign), self._print(item)]
            for item in (expr.numerator, expr.denominator)
        )
        top, bottom = (self.row(part) for part in parts)
        return self.fraction(top, bottom)

    def _sign(self, sign: str) -> Printed:
        return self.letter("d") if sign == "d" else self.operator(sign)

    def _print_Equated(self, expr: Equated) -> Printed:
        parts: list[Printed] = []
        for k, part in enumerate(expr.parts):
            parts += [self.operator("=")] if k else []
            parts.append(self._print(part))
        return self.row(parts)

    def pieces(self, formula: Any) -> list[Printed]:
        """Return a formula in pieces between which a line may be broken: at = and at + and -."""
        if not isinstance(formula, Equated):
            return [self._print(formula)]
        pieces: list[Printed] = []
        for k, part in enumerate(formula.parts):
            lead = [self.leading("=")] if k else []
            for sign, magnitude in self._terms(part):
                signs = [self.leading(sign) if pieces else self.operator(sign)] if sign else []
                pieces.append(self.row([*lead, *signs, magnitude]))
                lead = []
        return pieces

    def _terms(self, part: Any) -> list[tuple[str, Printed]]:
        """Return sign and magnitude of the terms of a sum; anything else is one term."""
        if isinstance(part, Sum | VectorSum) and part.terms:
            terms: Sequence[Any] = part.terms
        else:
            return [("", self._print(part))]
        found = []
        for k, term in enumerate(terms):
            is_negative, magnitude = _signed(term)
            sign = "-" if is_negative else "+" if k else ""
            found.append((sign, self._factor(magnitude)))
        return found

    def _print_Matrix(self, expr: Matrix) -> Printed:
        return self.array([[self._short(cell) for cell in row] for row in expr.rows])


def _signed(term: Any) -> tuple[bool, Any]:
    """Return whether a term has a minus in front, and the term without it."""
    match term:
        case Number(value) if value < 0:
            return True, Number(-value)
        case Decimal(value, digits) if value < 0:
            return True, Decimal(-value, digits)
        case Product((Number(value), *rest)) if value < 0:
            factors = rest if value == -1 else [Number(-value), *rest]
            return True, factors[0] if len(factors) == 1 else Product(tuple(factors))
        case Scaled(factor, vector):
            is_negative, magnitude = _signed(factor)
            return is_negative, vector if magnitude == ONE else Scaled(magnitude, vector)
    return False, term


def _is_reciprocal(factor: Any) -> bool:
    return isinstance(factor, Power) and factor.exponent == -1


def _place(factor: Any) -> int:
    """Return where a factor stands: numbers first, rates last."""
    if isinstance(factor, Number | Decimal):
        return 0
    base = factor.base if isinstance(factor, Power) else factor
    is_rate = isinstance(base, Symbol) and split_name(base.name)[2] > 0
    return 2 if is_rate else 1
