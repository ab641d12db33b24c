"""Faults in gamma, and a formula multiplied out and collected by u^T A_ij v, as textbooks print it.

The derivation keeps d = r_j + A_j s_j - r_i - A_i s_i together; a printed formula often has its
parts, with the rotations of both bodies drawn together, A_i^T A_j = A_ij. A slip in the printed
form is another one than a slip in the derivation's, so the catalogue needs both.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

from kincompile.calculus import expressions as ex
from kincompile.calculus.rotations import PlaneRotation, turned
from kincompile.checker.fault import Fault, Kind, term_faults
from kincompile.checker.formula_faults import times
from kincompile.checker.plain_text import described
from kincompile.derive.collected import factored, is_rate, like_terms, power, rates_term

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.derive.collected import Polynomial
    from kincompile.derive.derivation import RowBlock

HALF = Fraction(1, 2)
PARTS_OF_GAMMA = (
    (Kind.QUADRATIC_TERM, "-(Phi_q q_dot)_q q_dot is missing"),
    (Kind.CROSS_TERM, "-2 Phi_qt q_dot is missing"),
    (Kind.PHI_TT, "-Phi_tt is missing"),
)
"""The parts of gamma in order, and the faults of leaving them out."""


@dataclass(frozen=True, slots=True)
class CollectedTerm:
    """A product, or a vector with its scalars, times a polynomial in the rates."""

    product: ex.Expression
    rates: Polynomial

    @property
    def factors(self) -> tuple[ex.Scalar, ...]:
        """The terms of the polynomial: numbers with rates."""
        return tuple(rates_term(item, number) for item, number in self.rates.items())

    @property
    def expression(self) -> ex.Expression:
        """The term as a formula."""
        return times_product(ex.sum_of(self.factors), self.product)


def times_product(factor: ex.Scalar, product: ex.Expression) -> ex.Expression:
    """Return a multiple of a scalar or of a vector."""
    if isinstance(product, ex.Vector):
        return ex.scaled(factor, product)
    assert isinstance(product, ex.Scalar)
    return product * factor


def collected(expression: ex.Expression) -> tuple[CollectedTerm, ...]:
    """Return the terms whose sum is the expression."""
    found: dict[ex.Expression, Polynomial] = {}
    for others, core, rates in like_terms(expression, {}):
        factors = (
            power(_paired(base) if isinstance(base, ex.Dot) else base, n) for base, n in others
        )
        number, kept = ex.split_coefficient(ex.product_of(tuple(factors)))
        product = ex.product_of(kept) if core is None else ex.scaled(ex.product_of(kept), core)
        polynomial = found.setdefault(product, {})
        for item, n in rates.items():
            polynomial[item] = polynomial.get(item, Fraction(0)) + number * n
    kept_rates = {key: {k: n for k, n in item.items() if n} for key, item in found.items()}
    return tuple(CollectedTerm(key, rates) for key, rates in kept_rates.items() if rates)


def _paired(product: ex.Dot) -> ex.Scalar:
    """Return (R^a A_i u)^T R^b A_j v as u^T R^(b-a) A_ij v: the rotations drawn together."""
    left, right = sorted((product.left, product.right), key=_order)
    match left, right:
        case (ex.Rotated(PlaneRotation(first), u), ex.Rotated(PlaneRotation(second), v)):
            quarters = (right.order - left.order) % 4
            if first != second:
                return ex.dot(u, turned(second - first, v, quarters))
            for _ in range(quarters):
                v = ex.perpendicular(v)
            return ex.dot(u, v)
    return ex.dot(left, right)


def _order(vector: ex.Vector) -> tuple[int, str]:
    """Return a key: vectors without a rotation first, then by angle, so that like products meet."""
    if not isinstance(vector, ex.Rotated):
        return 0, repr(vector)
    (angle,) = vector.rotation.coordinates
    name = angle.name if isinstance(angle, ex.Symbol) else "~"
    return 1, f"{name} {vector!r}"


def perfect_square(rates: Polynomial) -> tuple[ex.Scalar, ex.Scalar, Fraction] | None:
    """Return (a, b, c) where a polynomial is c (a - b)^2 with rates a and b, else None."""
    match factored(rates):
        case (number, (ex.Power(ex.Sum((a, ex.Product((ex.Number(sign), b)))), 2),)) if sign == -1:
            return a, b, number
    return None


def missing_parts(block: RowBlock) -> Iterator[Fault[ex.Expression]]:
    """Yield gamma without one of its three parts, or with the cross term taken once."""
    for k, (kind, text) in enumerate(PARTS_OF_GAMMA):
        rest = (*block.gamma_terms[:k], *block.gamma_terms[k + 1 :])
        # Without its only term gamma is left zero, which has a name already.
        if any(term not in (ex.ZERO, ex.ZERO_VECTOR) for term in rest):
            yield Fault(kind, text, total(rest))
    quadratic, cross, second = block.gamma_terms
    once = total((quadratic, times(HALF, cross), second))
    yield Fault(Kind.FACTOR, "the 2 of 2 Phi_qt q_dot is missing", once)


def total(terms: tuple[ex.Expression, ...]) -> ex.Expression:
    """Return the sum of vectors or of scalars, as it stands."""
    vectors = tuple(item for item in terms if isinstance(item, ex.Vector))
    return (
        ex.VectorSum(vectors)
        if vectors
        else ex.Sum(tuple(item for item in terms if isinstance(item, ex.Scalar)))
    )


def wrong_velocities(terms: tuple[CollectedTerm, ...]) -> Iterator[Fault[ex.Expression]]:
    """Yield gamma with a slip in the terms with some velocities: forgotten, or a wrong square."""
    names = ("r_i_dot", "r_j_dot")
    coupled = [term for term in terms if any(name in repr(term.product) for name in names)]
    rest = tuple(term.expression for term in terms if term not in coupled)
    if coupled and rest:
        text = "the terms with w and r_j_dot - r_i_dot are missing"
        yield Fault(Kind.COUPLING, text, total(rest))
        halves = (times(HALF, term.expression) for term in coupled)
        yield Fault(
            Kind.FACTOR, "the 2 of 2 w (r_j_dot - r_i_dot) is missing", total((*rest, *halves))
        )
    for term in terms:
        if square := perfect_square(term.rates):
            others = tuple(item.expression for item in terms if item is not term)
            yield from _wrong_squares(others, term, square)
    parts: dict[ex.Scalar, list[ex.Expression]] = {}
    for product, factor in ((term.product, factor) for term in terms for factor in term.factors):
        parts.setdefault(_velocities(factor), []).append(times_product(factor, product))
    for velocity, own in parts.items() if len(parts) > 1 else ():
        if velocity != ex.ONE:
            kept = [item for other, items in parts.items() if other != velocity for item in items]
            multiple = partial(_plus_multiple, tuple(kept), total(tuple(own)))
            yield from term_faults(f"the part with {described(velocity)}", multiple)


def _plus_multiple(
    kept: tuple[ex.Expression, ...], own: ex.Expression, factor: Fraction
) -> ex.Expression:
    return total((*kept, times(factor, own)) if factor else kept)


def _wrong_squares(
    others: tuple[ex.Expression, ...],
    term: CollectedTerm,
    square: tuple[ex.Scalar, ex.Scalar, Fraction],
) -> Iterator[Fault[ex.Expression]]:
    """Yield gamma with a wrong square of the difference of two velocities a and b."""
    a, b, c = square
    one, other = described(a), described(b)
    for text, wrong in (
        (f"{one}^2 - {other}^2 stands where {{}} belongs", a**2 - b**2),
        (f"{other}^2 - {one}^2 stands where {{}} belongs", b**2 - a**2),
        (f"({one}^2 - {other}^2)^2 stands where {{}} belongs", (a**2 - b**2) ** 2),
        ("the mixed term of {} is missing", a**2 + b**2),
    ):
        result = total((*others, times_product(c * wrong, term.product)))
        yield Fault(Kind.SQUARES, text.format(f"({one} - {other})^2"), result)


def _velocities(term: ex.Scalar) -> ex.Scalar:
    _, factors = ex.split_coefficient(term)
    return ex.product_of(tuple(factor for factor in factors if is_rate(factor)))
