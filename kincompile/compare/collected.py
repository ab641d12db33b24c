"""A scalar formula multiplied out and collected by u^T A_ij v, as textbooks print it.

The derivation keeps d = r_j + A_j s_j - r_i - A_i s_i together; a printed formula often has its
parts, with the rotations of both bodies drawn together, A_i^T A_j = A_ij. A slip in the printed
form is another one than a slip in the derivation's, so the catalogue needs both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    Dot,
    Number,
    Power,
    Product,
    Rotated,
    Scalar,
    Scaled,
    Sum,
    Symbol,
    Vector,
    VectorSum,
    dot,
    perpendicular,
    product_of,
    split_coefficient,
    sum_of,
)
from kincompile.calculus.rotations import PlaneRotation, turned

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True, slots=True)
class CollectedTerm:
    """A product of vectors times a sum of factors: numbers, attributes and rates."""

    product: Scalar
    factors: tuple[Scalar, ...]

    @property
    def expression(self) -> Scalar:
        """The term as a formula."""
        return self.product * sum_of(self.factors)


def collected(expression: Scalar) -> tuple[CollectedTerm, ...]:
    """Return the terms whose sum is the expression."""
    found: dict[Scalar, Scalar] = {}
    for term in _terms(expression):
        number, factors = split_coefficient(term)
        vectors = [item for item in factors if isinstance(item, Dot)]
        # In one order, so that w_i w_j and w_j w_i are one term.
        rest = sorted((item for item in factors if not isinstance(item, Dot)), key=repr)
        key = product_of(tuple(vectors)) if vectors else ONE
        found[key] = found.get(key, ZERO) + product_of((Number(number), *rest))
    sums = {key: factor.terms if isinstance(factor, Sum) else (factor,)
            for key, factor in found.items()}  # fmt: skip
    return tuple(CollectedTerm(key, factors) for key, factors in sums.items() if factors != (ZERO,))


def _terms(expression: Scalar) -> Iterator[Scalar]:
    """Yield the terms of an expression, multiplied out."""
    match expression:
        case Sum(terms):
            for term in terms:
                yield from _terms(term)
        case Product(factors):
            yield from _multiplied(factors)
        case Power(base, 2) if isinstance(base, Sum):
            yield from _multiplied((base, base))
        case Dot(left, right):
            for a, u in _vector_terms(left):
                for b, v in _vector_terms(right):
                    yield a * b * _paired(u, v)
        case _:
            yield expression


def _multiplied(factors: tuple[Scalar, ...]) -> Iterator[Scalar]:
    first, *rest = factors
    if not rest:
        yield from _terms(first)
        return
    for left in _terms(first):
        for right in _multiplied(tuple(rest)):
            yield product_of((left, right))


def _vector_terms(vector: Vector) -> Iterator[tuple[Scalar, Vector]]:
    match vector:
        case VectorSum(terms):
            for term in terms:
                yield from _vector_terms(term)
        case Scaled(factor, inner):
            for outer in _terms(factor):
                for own, leaf in _vector_terms(inner):
                    yield product_of((outer, own)), leaf
        case _:
            yield ONE, vector


def _paired(left: Vector, right: Vector) -> Scalar:
    """Return (R^a A_i u)^T R^b A_j v as u^T R^(b-a) A_ij v: the rotations drawn together."""
    left, right = sorted((left, right), key=_order)
    match left, right:
        case (Rotated(PlaneRotation(first), u), Rotated(PlaneRotation(second), v)):
            quarters = (right.order - left.order) % 4
            if first != second:
                return dot(u, turned(second - first, v, quarters))
            for _ in range(quarters):
                v = perpendicular(v)
            return dot(u, v)
    return dot(left, right)


def _order(vector: Vector) -> tuple[int, str]:
    """Return a key: vectors without a rotation first, then by angle, so that like products meet."""
    if not isinstance(vector, Rotated):
        return 0, repr(vector)
    (angle,) = vector.rotation.coordinates
    name = angle.name if isinstance(angle, Symbol) else "~"
    return 1, f"{name} {vector!r}"


def perfect_square(terms: tuple[Scalar, ...]) -> tuple[Symbol, Symbol, Scalar] | None:
    """Return (a, b, c) where the terms are c (a - b)^2 with rates a and b, else None."""
    squares: dict[Symbol, Scalar] = {}
    mixed: dict[frozenset[Scalar], Scalar] = {}
    for term in terms:
        number, factors = split_coefficient(term)
        rates = [f for f in factors if is_rate(f)]
        rest = product_of((Number(number), *(f for f in factors if not is_rate(f))))
        if len(rates) == 1 and isinstance(rates[0], Power) and isinstance(rates[0].base, Symbol):
            squares[rates[0].base] = rest
        elif len(rates) == 2:
            mixed[frozenset(rates)] = rest
        else:
            return None
    if len(squares) != 2 or len(mixed) != 1:
        return None
    (a, c), (b, other) = sorted(squares.items(), key=lambda item: item[0].name, reverse=True)
    matches = c == other and mixed.get(frozenset((a, b))) == -2 * c
    return (a, b, c) if matches else None


def is_rate(factor: Scalar) -> bool:
    """Return whether a factor is an angular velocity or a power of one."""
    base = factor.base if isinstance(factor, Power) else factor
    return isinstance(base, Symbol) and base.name.endswith("_dot")
