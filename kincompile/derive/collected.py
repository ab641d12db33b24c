"""Gamma as the book prints it: products multiplied out, like terms joined, rates factored.

What is derived is right, but in the order in which the rules fired. Here it is multiplied out to
terms `number * scalars * rates * vector`, in which no vector and no side of a scalar product is a
sum; turned vectors have one form (R A = B, R B = -A, u^T R v = -(R u)^T v); and the rates that
stand with the same scalars and vector are put together, as a square where they are one.
Abbreviations such as d stay whole.
"""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction
from functools import reduce
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias
from zlib import crc32

from kincompile.calculus import expressions as ex
from kincompile.calculus.expand import Expansion
from kincompile.calculus.rotations import PlaneRotation
from kincompile.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


RATES = ("_dot", "_ddot")
"""Ends of the names of rates."""

Monomial: TypeAlias = tuple[tuple[ex.Scalar, int], ...]
"""Scalars with their exponents."""

Core: TypeAlias = ex.Vector | None
"""A vector that cannot be multiplied out; None in a scalar term."""

Term: TypeAlias = tuple[Fraction, Monomial, Core]

Polynomial: TypeAlias = dict[Monomial, Fraction]
"""A sum of products of rates."""

AGREEMENT = 1e-9
"""Difference, relative to the terms, up to which two forms are equal at random numbers."""


def collected(expression: ex.Expression, names: Mapping[ex.Expression, object]) -> ex.Expression:
    """Return gamma with like terms joined, equal to it at random numbers.

    Parameters
    ----------
    names
        What is printed as one symbol, and so not multiplied out.

    Raises
    ------
    InternalError
        If the two differ in numbers: the line is never printed.
    """
    parts = like_terms(expression, names)
    result: ex.Expression
    if isinstance(expression, ex.Vector):
        result = ex.vector_sum(tuple(_vector(_part(*part)) for part in parts))
    else:
        result = _over_divisors(parts)
    _require_equal(expression, result)
    return result


def like_terms(
    expression: ex.Expression, names: Mapping[ex.Expression, object]
) -> list[tuple[Monomial, Core, Polynomial]]:
    """Return an expression multiplied out: scalars, vector, and the rates that stand with them."""
    found: dict[tuple[Monomial, Core], Polynomial] = {}
    for number, monomial, core in _terms(expression, _Atoms(names)):
        rates = tuple(item for item in monomial if is_rate(item[0]))
        others = tuple(item for item in monomial if not is_rate(item[0]))
        polynomial = found.setdefault((others, core), {})
        polynomial[rates] = polynomial.get(rates, Fraction(0)) + number
    kept = [(key, {k: v for k, v in item.items() if v}) for key, item in found.items()]
    return [(others, core, item) for (others, core), item in kept if item]


def _over_divisors(parts: list[tuple[Monomial, Core, Polynomial]]) -> ex.Scalar:
    found: dict[Monomial, list[ex.Scalar]] = {}
    for others, core, rates in parts:
        below = tuple(factor for factor in others if factor[1] < 0)
        above = tuple(factor for factor in others if factor[1] > 0)
        found.setdefault(below, []).append(_scalar(_part(above, core, rates)))
    terms: list[ex.Scalar] = []
    for below, items in found.items():
        divisors = tuple(ex.Power(base, exponent) for base, exponent in below)
        terms += [ex.product_of((*divisors, _sum(items)))] if below else items
    return _sum(terms)


class _Atoms:
    """What is not multiplied out: the abbreviations, and products of scalars that are one."""

    def __init__(self, names: Mapping[ex.Expression, object]) -> None:
        self.whole = frozenset(names)
        self.products = [item for item in names if isinstance(item, ex.Product)]

    def folded(self, factors: tuple[ex.Scalar, ...]) -> list[ex.Scalar]:
        """Return factors with those that make an abbreviation as that abbreviation."""
        rest = Counter(dict(self._powers(factors)))
        found: list[ex.Scalar] = []
        for item in self.products:
            wanted = Counter(dict(self._powers(item.factors)))
            while all(
                abs(rest[base]) >= abs(n) and rest[base] * n > 0 for base, n in wanted.items()
            ):
                rest.subtract(wanted)
                found.append(item)
        return [*found, *(power(base, n) for base, n in rest.items() if n)]

    @staticmethod
    def _powers(factors: Iterable[ex.Scalar]) -> Iterable[tuple[ex.Scalar, int]]:
        for item in factors:
            yield (item.base, item.exponent) if isinstance(item, ex.Power) else (item, 1)


def _terms(expression: ex.Expression, atoms: _Atoms) -> list[Term]:
    if expression in atoms.whole:
        return [_atom(expression)]
    match expression:
        case ex.Number(value):
            return [(value, (), None)]
        case ex.VectorSum(items) if (term := _difference(items)) is not None:
            return [term]
        case ex.Sum(items) | ex.VectorSum(items):
            return [term for item in items for term in _terms(item, atoms)]
        case ex.Product():
            number, rest = ex.split_coefficient(expression)
            parts = [_terms(item, atoms) for item in atoms.folded(rest)]
            return _multiplied([[(number, (), None)], *parts])
        case ex.Power(base, exponent) if exponent > 1 and isinstance(base, ex.Sum):
            return _multiplied([_terms(base, atoms)] * exponent)
        case ex.Scaled(factor, vector):
            return _multiplied([_terms(factor, atoms), _terms(vector, atoms)])
        case ex.Dot(left, right):
            return [_dotted(a, b) for a, b in product(_terms(left, atoms), _terms(right, atoms))]
        case ex.Rotated() | ex.Perpendicular():
            return [_turned(expression)]
    return [_atom(expression)]


def _difference(items: tuple[ex.Vector, ...]) -> Term | None:
    """Return the difference of two points of a body as one turned vector: A (s_Q - s_P)."""
    if len(items) != 2:
        return None
    (factor, first), (other, second) = map(ex.split_factor, items)
    if not (isinstance(first, ex.Rotated) and isinstance(second, ex.Rotated) and factor == -other):
        return None
    if (first.rotation, first.along) != (second.rotation, second.along):
        return None
    number, factors = ex.split_coefficient(factor)
    if repr(first.vector) < repr(second.vector):  # s_Q - s_P wherever it stands
        number, first, second = -number, second, first
    (sign, _, core) = _turned(ex.Rotated(first.rotation, first.vector - second.vector, first.along))
    monomial: Monomial = ()
    for item in factors:
        monomial = _joined(monomial, _atom(item)[1])
    return sign * number, monomial, core


def _atom(expression: ex.Expression) -> Term:
    if isinstance(expression, ex.Vector):
        return Fraction(1), (), expression
    base, exponent = (
        (expression.base, expression.exponent)
        if isinstance(expression, ex.Power)
        else (expression, 1)
    )
    return Fraction(1), ((base, exponent),), None


def _multiplied(parts: list[list[Term]]) -> list[Term]:
    return [reduce(_times, choice) for choice in product(*parts)]


def _times(first: Term, second: Term) -> Term:
    core = first[2] if second[2] is None else second[2]
    return first[0] * second[0], _joined(first[1], second[1]), core


def _scalar(item: ex.Expression) -> ex.Scalar:
    assert isinstance(item, ex.Scalar)
    return item


def _joined(first: Monomial, second: Monomial) -> Monomial:
    """Return the product of two monomials, in an order that does not depend on theirs."""
    exponents: dict[ex.Scalar, int] = {}
    for base, exponent in (*first, *second):
        exponents[base] = exponents.get(base, 0) + exponent
    kept = ((base, exponent) for base, exponent in exponents.items() if exponent)
    return tuple(sorted(kept, key=lambda item: repr(item[0])))


def _quarter_turns(vector: ex.Vector) -> tuple[ex.Vector, int]:
    """Return a turned vector without its quarter turns, and how many there were.

    In the plane all turns commute: R A = A R = B.
    """
    match vector:
        case ex.Rotated(PlaneRotation() as rotation, inner, along) if all(
            x == ex.ONE for x in along
        ):
            core, turns = _quarter_turns(inner)
            return ex.Rotated(rotation, core), turns + len(along)
        case ex.Perpendicular(inner) if not isinstance(inner, ex.Basis):
            core, turns = _quarter_turns(inner)
            return core, turns + 1
    return vector, 0


def _with_turns(vector: ex.Vector, turns: int) -> tuple[int, ex.Vector]:
    """Return a sign and a vector with at most one quarter turn, which its outer rotation has."""
    sign = -1 if turns % 4 > 1 else 1
    if turns % 2 == 0:
        return sign, vector
    if isinstance(vector, ex.Rotated):
        return sign, ex.Rotated(vector.rotation, vector.vector, (ex.ONE,))
    return sign, ex.Perpendicular(vector)


def _turned(vector: ex.Vector) -> Term:
    sign, core = _with_turns(*_quarter_turns(vector))
    return Fraction(sign), (), core


def _dotted(first: Term, second: Term) -> Term:
    """Return the scalar product of two terms; of two turned vectors the left has the turn."""
    (left, turns), (right, more) = (_quarter_turns(_vector(term[2])) for term in (first, second))
    if isinstance(left, ex.Rotated) and isinstance(right, ex.Rotated):
        turns, more = (turns - more) % 4, 0
    (sign, left), (other, right) = _with_turns(left, turns), _with_turns(right, more)
    monomial = _joined(_joined(first[1], second[1]), ((ex.Dot(left, right), 1),))
    return sign * other * first[0] * second[0], monomial, None


def _vector(item: ex.Expression | None) -> ex.Vector:
    assert isinstance(item, ex.Vector)
    return item


def power(base: ex.Scalar, exponent: int) -> ex.Scalar:
    """Return a power as it is written."""
    return base if exponent == 1 else ex.Power(base, exponent)


def _part(others: Monomial, core: Core, rates: Polynomial) -> ex.Expression:
    """Return number, scalars, scalar products, vector, with the polynomial in the rates."""
    number, factors = factored(rates)
    scalars = [power(*item) for item in sorted(others, key=lambda x: isinstance(x[0], ex.Dot))]
    scalar = _product(number, (*scalars, *factors))
    return scalar if core is None else ex.scaled(scalar, core)


def _product(number: Fraction, factors: tuple[ex.Scalar, ...]) -> ex.Scalar:
    if not factors:
        return ex.Number(number)
    if number == 1:
        return factors[0] if len(factors) == 1 else ex.Product(factors)
    return ex.Product((ex.Number(number), *factors))


def factored(polynomial: Polynomial) -> tuple[Fraction, tuple[ex.Scalar, ...]]:
    """Return a polynomial in the rates as a number and factors: what all terms share, the rest."""
    first = next(iter(polynomial))
    common = tuple(
        (base, least)
        for base, _ in first
        if (least := min(dict(monomial).get(base, 0) for monomial in polynomial)) > 0
    )
    divisor = tuple((base, -exponent) for base, exponent in common)
    rest = {_joined(monomial, divisor): number for monomial, number in polynomial.items()}
    number = _content(list(rest.values()))
    rest = {monomial: value / number for monomial, value in rest.items()}
    shared = tuple(power(base, exponent) for base, exponent in common)
    if len(rest) == 1:
        return number, shared
    square = _square(rest)
    if square is not None:
        return number, (*shared, square)
    return number, (*shared, ex.Sum(tuple(rates_term(item, value) for item, value in rest.items())))


def _content(numbers: list[Fraction]) -> Fraction:
    """Return the largest number that leaves integers, with the sign of the first."""
    below = math.lcm(*(item.denominator for item in numbers))
    above = math.gcd(*(int(item * below) for item in numbers))
    return Fraction(above if numbers[0] > 0 else -above, below)


def rates_term(monomial: Monomial, number: Fraction) -> ex.Scalar:
    """Return a number times rates."""
    return _product(number, tuple(power(base, exponent) for base, exponent in monomial))


def _square(polynomial: Polynomial) -> ex.Scalar | None:
    """Return (a + b - c)^2 where a polynomial is the square of such a sum."""
    bases = list(dict.fromkeys(base for monomial in polynomial for base, _ in monomial))
    first = bases[0]
    signs = {first: Fraction(1)} | {
        base: polynomial.get(_joined(((first, 1),), ((base, 1),)), Fraction(0)) / 2
        for base in bases[1:]
    }
    square: dict[Monomial, Fraction] = {}
    for a, b in product(bases, bases):
        monomial = _joined(((a, 1),), ((b, 1),))
        square[monomial] = square.get(monomial, Fraction(0)) + signs[a] * signs[b]
    if square != polynomial:
        return None
    if signs[bases[-1]] < 0:  # phi_j - phi_i, as in the book
        signs = {base: -signs[base] for base in reversed(bases)}
    return ex.Power(ex.Sum(tuple(_product(sign, (base,)) for base, sign in signs.items())), 2)


def _sum(terms: list[ex.Scalar]) -> ex.Scalar:
    """Return a sum, flat; unlike `sum_of` it leaves numbers before brackets."""
    flat = tuple(part for item in terms for part in getattr(item, "terms", (item,)))
    return ex.Sum(flat) if len(flat) != 1 else flat[0]


def is_rate(factor: Any) -> bool:
    """Return whether a factor is the rate of a scalar, a power or a sum of such."""
    match factor:
        case ex.Symbol(name):
            return name.endswith(RATES)
        case ex.Power(base, _):
            return is_rate(base)
        case ex.Sum(terms):
            parts = map(ex.split_coefficient, terms)
            return all(
                abs(number) == 1 and list(map(is_rate, rest)) == [True] for number, rest in parts
            )
    return False


class _AtRandom:
    """Every leaf of an expression as a number that follows from its name."""

    def number(self, value: Fraction) -> Any:
        return float(value)

    def pi(self) -> Any:
        return math.pi

    def symbol(self, symbol: ex.Symbol) -> Any:
        return 0.5 + crc32(symbol.name.encode()) / 2**32

    def vector(self, symbol: ex.VectorSymbol) -> Any:
        return tuple(self.symbol(ex.Symbol(f"{symbol.name} {k}")) for k in range(symbol.size))

    def time_function(self, function: ex.TimeFunction) -> Any:
        return self.symbol(ex.Symbol(f"{function.name} {function.order}"))

    def profile(self, profile: ex.ProfileFunction) -> Any:
        return self.symbol(ex.Symbol(f"{profile.name} {profile.order}"))

    def entries(self, rotation: ex.Rotation, expand: Expansion) -> Any:
        return expand.entries(rotation)

    def call(self, function: str, *values: Any) -> Any:
        return getattr(math, function)(*values)


def _require_equal(first: ex.Expression, second: ex.Expression) -> None:
    values = [Expansion(_AtRandom()).components(item) for item in (first, second)]
    for a, b in zip(*values, strict=True):
        if not math.isclose(a, b, rel_tol=AGREEMENT, abs_tol=AGREEMENT):
            raise InternalError(f"gamma collected is not gamma: {b} is not {a}.")
