"""Slips of the pen in a formula written in vectors: each gives the formula that would result.

A mutation changes one place (`one_place`), or one thing wherever it occurs (`everywhere`). What
comes out is a formula of the same kind, to be evaluated like the right one; nothing is simplified.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    Dot,
    Expression,
    Number,
    Perpendicular,
    Pi,
    Power,
    Product,
    Rotated,
    Scalar,
    Scaled,
    Sum,
    Symbol,
    TimeFunction,
    Vector,
    VectorSum,
    VectorSymbol,
)
from kincompile.calculus.rotations import PlaneRotation
from kincompile.compare.plain_text import described
from kincompile.compare.vectors import Exchanged

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

SIGN = "sign"
FACTOR = "factor 2 or 1/2"
MISSING_TERM = "missing term"
SINE_COSINE = "sine and cosine swapped"
TRANSPOSED = "rotation transposed"
A_FOR_B = "A where B belongs, or B where A"
MIXED_ANGLES = "phi_i and phi_j mixed"
MIXED_POINTS = "s_i and s_j mixed"
XI_ETA = "xi and eta swapped"
MISSING_FACTOR = "chain-rule factor missing"
MISSING_SQUARE = "velocity square missing"
MISSING_RATE = "velocity factor missing"
SECOND_DERIVATIVE = "driver's second derivative forgotten"
DRIVER_RATE = "driver's rate forgotten"


HALF = Number(Fraction(1, 2))
TWO = Number(Fraction(2))
MINUS_ONE = Number(Fraction(-1))


@dataclass(frozen=True, slots=True)
class Mutation:
    """A formula with one fault.

    Attributes
    ----------
    kind
        The fault in a few words.
    text
        What is wrong, and where.
    expression
        The formula that results.
    """

    kind: str
    text: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Symbols:
    """What a joint has: names of its bodies' angles and of its body-fixed vectors.

    Attributes
    ----------
    angles, vectors
        The names.
    partners
        By the name of a vector, the one that is easily taken for it.
    """

    angles: frozenset[str]
    vectors: frozenset[str]
    partners: Mapping[str, str]

    def other_angle(self, name: str) -> str | None:
        """Return the angle of the other body."""
        others = self.angles - {name} if name in self.angles else ()
        return next(iter(others), None)


def times(factor: Number, expression: Any) -> Expression:
    """Return a multiple of a formula, as it is."""
    if isinstance(expression, Vector):
        return Scaled(factor, expression)
    return _product((factor, expression))


def _product(factors: tuple[Any, ...]) -> Scalar:
    """Return a product as it stands; numbers alone are multiplied, for nothing expands those."""
    if not all(isinstance(factor, Number) for factor in factors):
        return Product(factors)
    value = Fraction(1)
    for factor in factors:
        value *= factor.value
    return Number(value)


def one_place(expression: Expression, symbols: Symbols) -> Iterator[Mutation]:
    """Yield the formulas with one fault at one place."""
    yield from _here(expression, symbols)
    for child, rebuilt in _children(expression):
        for inner in one_place(child, symbols):
            yield Mutation(inner.kind, inner.text, rebuilt(inner.expression))


def _here(node: Expression, symbols: Symbols) -> Iterator[Mutation]:
    match node:
        case Sum(terms):
            yield from _terms(terms, Sum)
        case VectorSum(terms):
            yield from _terms(terms, VectorSum)
        case Product(factors):
            yield from _factors(factors)
        case Scaled(factor, vector) if not isinstance(factor, Product):
            yield from _dropped(factor, vector)
        case Power(base, 2):
            text = f"{described(base)} stands where {described(node)} belongs"
            yield Mutation(MISSING_SQUARE if _is_rate(base) else MISSING_FACTOR, text, base)
        case TimeFunction(name, order) if order:
            kind = SECOND_DERIVATIVE if order == 2 else DRIVER_RATE
            yield Mutation(kind, f"{name}{chr(39) * order} is taken as zero", ZERO)
        case Rotated() | VectorSymbol():
            for kind, text, new in swaps(node, symbols):
                yield Mutation(kind, text, new)


def _terms(terms: tuple[Any, ...], build: Callable[[Any], Expression]) -> Iterator[Mutation]:
    for k, term in enumerate(terms):
        before, after = terms[:k], terms[k + 1 :]
        name = f"the term {described(term)}"
        yield Mutation(MISSING_TERM, f"{name} is missing", build((*before, *after)))
        for kind, text, factor in (
            (SIGN, f"{name} has the wrong sign", MINUS_ONE),
            (FACTOR, f"{name} is counted twice", TWO),
            (FACTOR, f"{name} is counted half", HALF),
        ):
            yield Mutation(kind, text, build((*before, times(factor, term), *after)))


def _factors(factors: tuple[Scalar, ...]) -> Iterator[Mutation]:
    for k, factor in enumerate(factors):
        rest = (*factors[:k], *factors[k + 1 :])
        yield from _dropped(factor, _product(rest))


def _dropped(factor: Scalar, rest: Expression) -> Iterator[Mutation]:
    """Yield what is left where a factor is forgotten; a sign is no factor here."""
    if isinstance(factor, Number):
        if abs(factor.value) == 2:
            sign = Number(factor.value / 2)
            yield Mutation(FACTOR, f"a factor {factor.value} is missing", times(sign, rest))
        return
    base = factor.base if isinstance(factor, Power) else factor
    kind = MISSING_FACTOR
    if _is_rate(base):
        kind = MISSING_SQUARE if isinstance(factor, Power) else MISSING_RATE
    yield Mutation(kind, f"the factor {described(factor)} is missing", rest)


def _is_rate(node: Scalar) -> bool:
    return isinstance(node, Symbol) and node.name.endswith("_dot")


def swaps(node: Expression, symbols: Symbols) -> Iterator[tuple[str, str, Expression]]:
    """Yield what may stand in the place of a rotation or of a body-fixed vector by mistake."""
    if isinstance(node, Rotated):
        yield from _wrong_rotations(node, symbols)
    if isinstance(node, VectorSymbol) and node.name in symbols.vectors:
        swapped = Exchanged(node.name, node.size)
        yield XI_ETA, f"xi and eta of {node.name} are swapped", swapped
        partner = symbols.partners.get(node.name)
        if partner is not None:
            text = f"{partner} stands where {node.name} belongs"
            yield MIXED_POINTS, text, VectorSymbol(partner)


def _wrong_rotations(node: Rotated, symbols: Symbols) -> Iterator[tuple[str, str, Expression]]:
    if not isinstance(node.rotation, PlaneRotation):
        return
    angle, vector, along = node.rotation.angle, node.vector, node.along
    letter, other_letter = tuple(node.rotation.letters)[:: -1 if along else 1]
    index = described(angle).removeprefix("phi_") if isinstance(angle, Symbol) else "(theta)"
    name = f"{letter}_{index}"
    other = Rotated(node.rotation, vector, () if along else (ONE,))
    yield A_FOR_B, f"{other_letter}_{index} stands where {name} belongs", other
    # (R^k A)^T = R^-k A(-phi), and R^-1 = -R.
    back = Rotated(PlaneRotation(Product((MINUS_ONE, angle))), vector, along)
    transposed = times(MINUS_ONE, back) if along else back
    yield TRANSPOSED, f"{name} is transposed", transposed
    if along:
        yield TRANSPOSED, f"the angle has the wrong sign in {name}", back
    complement = Sum((Product((HALF, Pi())), Product((MINUS_ONE, angle))))
    exchanged = Rotated(PlaneRotation(complement), vector, along)
    yield SINE_COSINE, f"sine and cosine are swapped in {name}", exchanged
    mixed = symbols.other_angle(angle.name) if isinstance(angle, Symbol) else None
    if mixed is not None:
        text = f"{mixed} stands where phi_{index} belongs, in {name}"
        yield MIXED_ANGLES, text, Rotated(PlaneRotation(Symbol(mixed)), vector, along)


def everywhere(
    expression: Expression, change: Callable[[Expression], Expression | None]
) -> Expression:
    """Replace every node for which `change` gives another; what it leaves alone stays."""
    rebuilt = expression
    for k, (_, _) in enumerate(list(_children(expression))):
        # Each replacement rebuilds the node, so its parts are looked up again.
        child, build = list(_children(rebuilt))[k]
        rebuilt = build(everywhere(child, change))
    changed = change(rebuilt)
    return rebuilt if changed is None else changed


def _children(node: Expression) -> Iterator[tuple[Any, Callable[[Any], Expression]]]:
    """Yield the parts of a node, each with what puts another in its place.

    Angles other than a body's own, and lengths of constant vectors, are taken as given.
    """
    match node:
        case Sum(terms):
            yield from _sequence(terms, Sum)
        case VectorSum(terms):
            yield from _sequence(terms, VectorSum)
        case Product(factors):
            yield from _sequence(factors, _product)
        case Power(base, exponent):
            yield base, lambda new: Power(new, exponent)
        case Dot(left, right):
            yield left, lambda new: Dot(new, right)
            yield right, lambda new: Dot(left, new)
        case Scaled(factor, vector):
            yield factor, lambda new: Scaled(new, vector)
            yield vector, lambda new: Scaled(factor, new)
        case Rotated(rotation, vector, along):
            yield vector, lambda new: Rotated(rotation, new, along)
        case Perpendicular(vector):
            yield vector, Perpendicular


def _sequence(
    parts: tuple[Any, ...], build: Callable[[Any], Expression]
) -> Iterator[tuple[Any, Callable[[Any], Expression]]]:
    def replacing(k: int) -> Callable[[Any], Expression]:
        return lambda new: build((*parts[:k], new, *parts[k + 1 :]))

    for k, part in enumerate(parts):
        yield part, replacing(k)
