"""A formula multiplied out and collected by u^T A_ij v, as textbooks print it.

The derivation keeps d = r_j + A_j s_j - r_i - A_i s_i together; a printed formula often has its
parts, with the rotations of both bodies drawn together, A_i^T A_j = A_ij. A slip in the printed
form is another one than a slip in the derivation's, so the catalogue needs both.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from kincompile.calculus import expressions as ex
from kincompile.calculus.rotations import PlaneRotation, turned
from kincompile.derive.collected import factored, like_terms, power, rates_term

if TYPE_CHECKING:
    from kincompile.derive.collected import Polynomial


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
