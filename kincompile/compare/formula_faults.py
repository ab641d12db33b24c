"""Faults in a formula written in vectors: each gives the formula that would result.

A fault changes one place (`one_place`), or one symbol wherever it occurs (`everywhere`). The result
is a formula of the same kind, to be evaluated like the right one; nothing is simplified.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    Cross,
    Dot,
    Expression,
    Number,
    Perpendicular,
    Pi,
    Power,
    Product,
    ProfileFunction,
    Rotated,
    RotationSlope,
    RowOfSlope,
    Scalar,
    Scaled,
    Sum,
    Symbol,
    TimeFunction,
    TimesG,
    Vector,
    VectorSum,
    VectorSymbol,
    scaled,
    split_factor,
)
from kincompile.calculus.rotations import PlaneRotation
from kincompile.calculus.space import EulerRotation
from kincompile.compare.fault import (
    A_FOR_B,
    DRIVER_RATE,
    FACTOR,
    GLOBAL_OMEGA,
    MISSING_FACTOR,
    MISSING_RATE,
    MISSING_SQUARE,
    MIXED_ANGLES,
    MIXED_ORDERS,
    MIXED_POINTS,
    MIXED_RATES,
    SECOND_DERIVATIVE,
    SINE_COSINE,
    TILDE,
    TRANSPOSED,
    XI_ETA,
    Fault,
    term_faults,
)
from kincompile.compare.plain_text import described
from kincompile.compare.vectors import Exchanged, WrongTilde
from kincompile.derive.collected import is_rate
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

HIGHEST_ORDER = 2
"""Of the derivatives of a function that one mistakes for each other."""

_MINUS_ONE = Number(Fraction(-1))


@dataclass(frozen=True, slots=True)
class Symbols:
    """The names of a joint's angles and of its body-fixed vectors.

    Attributes
    ----------
    angles, vectors
        The names.
    partners
        The vector that each vector is easily mistaken for, by name.
    """

    angles: frozenset[str]
    vectors: frozenset[str]
    partners: Mapping[str, str]

    def other_angle(self, name: str) -> str | None:
        """Return the angle of the other body."""
        others = self.angles - {name} if name in self.angles else ()
        return next(iter(others), None)


def times(factor: Fraction | int, expression: Expression) -> Expression:
    """Return a multiple of a formula, as it is."""
    number = Number(Fraction(factor))
    if isinstance(expression, Vector):
        return Scaled(number, expression)
    return _product((number, expression))


def _product(factors: tuple[Any, ...]) -> Scalar:
    """Return a product as it stands; numbers alone are multiplied, for nothing expands those."""
    if not all(isinstance(factor, Number) for factor in factors):
        return Product(factors)
    value = Fraction(1)
    for factor in factors:
        value *= factor.value
    return Number(value)


def one_place(expression: Expression, symbols: Symbols) -> Iterator[Fault[Expression]]:
    """Yield the formulas with one fault at one place."""
    yield from _here(expression, symbols)
    for child, rebuilt in _children(expression):
        for inner in one_place(child, symbols):
            yield replace(inner, result=rebuilt(inner.result))


def _here(node: Expression, symbols: Symbols) -> Iterator[Fault[Expression]]:
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
            yield Fault(MISSING_SQUARE if is_rate(base) else MISSING_FACTOR, text, base)
        case TimeFunction(_, order):
            if order:
                kind = SECOND_DERIVATIVE if order == 2 else DRIVER_RATE
                yield Fault(kind, f"{described(node)} is taken as zero", ZERO)
            yield from _wrong_orders(node)
        case ProfileFunction():
            yield from _wrong_orders(node)
        case Cross(left, right):
            name = f"{described(left)}~"
            yield Fault(TILDE, f"the sign of {name} is wrong", times(-1, node))
            yield Fault(MISSING_RATE, f"the factor {name} is missing", right)
        case Rotated() | VectorSymbol() | RotationSlope():
            yield from swaps(node, symbols)


def _wrong_orders(node: TimeFunction | ProfileFunction) -> Iterator[Fault[Expression]]:
    """Yield the neighbours of a function in the row of its derivatives."""
    for order in (node.order - 1, node.order + 1):
        if 0 <= order <= HIGHEST_ORDER:
            other = replace(node, order=order)
            text = f"{described(other)} stands where {described(node)} belongs"
            yield Fault(MIXED_ORDERS, text, other)


def _terms(
    terms: tuple[Any, ...], build: Callable[[Any], Expression]
) -> Iterator[Fault[Expression]]:
    for k, term in enumerate(terms):
        multiple = partial(_with_multiple, terms, k, build)
        yield from term_faults(f"the term {described(term)}", multiple)


def _with_multiple(
    terms: tuple[Any, ...], k: int, build: Callable[[Any], Expression], factor: Fraction
) -> Expression:
    """Return a sum with a multiple of one of its terms."""
    own = (times(factor, terms[k]),) if factor else ()
    return build((*terms[:k], *own, *terms[k + 1 :]))


def _factors(factors: tuple[Scalar, ...]) -> Iterator[Fault[Expression]]:
    for k, factor in enumerate(factors):
        rest = (*factors[:k], *factors[k + 1 :])
        yield from _dropped(factor, _product(rest))


def _dropped(factor: Scalar, rest: Expression) -> Iterator[Fault[Expression]]:
    """Yield the product without a factor; a sign is no factor here."""
    if isinstance(factor, Number):
        if abs(factor.value) == 2:
            signed = times(factor.value / 2, rest)
            yield Fault(FACTOR, f"a factor {factor.value} is missing", signed)
        return
    kind = MISSING_FACTOR
    if is_rate(factor):
        kind = MISSING_SQUARE if isinstance(factor, Power) else MISSING_RATE
    yield Fault(kind, f"the factor {described(factor)} is missing", rest)


def swaps(node: Expression, symbols: Symbols) -> Iterator[Fault[Expression]]:
    """Yield the mistakes for a rotation or a body-fixed vector; each result stands in its place."""
    if isinstance(node, RotationSlope):
        yield from _wrong_slopes(node)
    if isinstance(node, Rotated):
        yield from _wrong_rotations(node, symbols)
    if isinstance(node, VectorSymbol) and node.name in symbols.vectors:
        swapped = Exchanged(node.name, node.size)
        if node.size == 2:
            yield Fault(XI_ETA, f"xi and eta of {node.name} are swapped", swapped)
        partner = symbols.partners.get(node.name)
        if partner is not None:
            text = f"{partner} stands where {node.name} belongs"
            yield Fault(MIXED_POINTS, text, VectorSymbol(partner, node.size))
    if isinstance(node, VectorSymbol) and node.name in ("omega_i", "omega_j"):
        text = f"the global {node.name} stands where {described(node)} of the body belongs"
        p = VectorSymbol(node.name.replace("omega", "p"), 4)
        yield Fault(GLOBAL_OMEGA, text, Rotated(EulerRotation(p), node))
    if (other := rate_or_position(node)) is not None:
        yield Fault(
            MIXED_RATES, f"{described(other)} stands where {described(node)} belongs", other
        )


def rate_or_position(node: Expression) -> VectorSymbol | None:
    """Return the velocity of a position r_i, or the position of its velocity; else None."""
    if not isinstance(node, VectorSymbol) or not node.name.startswith("r_"):
        return None
    position = node.name.removesuffix(rate(""))
    return VectorSymbol(rate(position) if node.name == position else position, node.size)


def _wrong_rotations(node: Rotated, symbols: Symbols) -> Iterator[Fault[Expression]]:
    if isinstance(node.rotation, EulerRotation):
        yield from _wrong_slopes(node)
    if not isinstance(node.rotation, PlaneRotation):
        return
    angle, vector, along = node.rotation.angle, node.vector, node.along
    letter, other_letter = tuple(node.rotation.letters)[:: -1 if along else 1]
    index = described(angle).removeprefix("phi_") if isinstance(angle, Symbol) else "(theta)"
    name = f"{letter}_{index}"
    other = Rotated(node.rotation, vector, () if along else (ONE,))
    yield Fault(A_FOR_B, f"{other_letter}_{index} stands where {name} belongs", other)
    # (R^k A)^T = R^-k A(-phi), and R^-1 = -R.
    back = Rotated(PlaneRotation(Product((_MINUS_ONE, angle))), vector, along)
    transposed = times(-1, back) if along else back
    yield Fault(TRANSPOSED, f"{name} is transposed", transposed)
    if along:
        yield Fault(TRANSPOSED, f"the angle has the wrong sign in {name}", back)
    complement = Sum((Product((Number(Fraction(1, 2)), Pi())), Product((_MINUS_ONE, angle))))
    exchanged = Rotated(PlaneRotation(complement), vector, along)
    yield Fault(SINE_COSINE, f"sine and cosine are swapped in {name}", exchanged)
    mixed = symbols.other_angle(angle.name) if isinstance(angle, Symbol) else None
    if mixed is not None:
        text = f"{mixed} stands where phi_{index} belongs, in {name}"
        yield Fault(MIXED_ANGLES, text, Rotated(PlaneRotation(Symbol(mixed)), vector, along))


def _wrong_slopes(node: Rotated | RotationSlope) -> Iterator[Fault[Expression]]:
    """Yield the mistakes for A s, B(p, s) and A s~ of Euler parameters."""
    assert isinstance(node.rotation, EulerRotation)
    is_small = isinstance(node, RotationSlope) and node.is_small
    is_slope = not is_small and (isinstance(node, RotationSlope) or bool(node.along))
    name = f"{'B' if is_slope else 'A'}_{node.rotation.p.name.removeprefix('p_')}"
    back = replace(node, rotation=replace(node.rotation, is_back=True))
    text = f"the signs of e~ are wrong in {name}" if is_slope else f"{name} is transposed"
    yield Fault(TRANSPOSED, text, back)
    if is_slope:
        yield Fault(FACTOR, f"the 2 of {name} is missing", times(Fraction(1, 2), node))
        wrong = replace(node, rotation=WrongTilde(node.rotation.p))
        yield Fault(TILDE, f"the sign of {described(node.vector)}~ is wrong in {name}", wrong)
    if is_small:
        text = f"the sign of {described(node.vector)}~ is wrong in {described(node)}"
        yield Fault(TILDE, text, times(-1, node))


def everywhere(
    expression: Expression, change: Callable[[Expression], Expression | None]
) -> Expression:
    """Replace every node for which `change` returns another; None keeps a node."""
    rebuilt = expression
    for k, (child, _) in enumerate(_children(expression)):
        # Each replacement rebuilds the node, so the place of the next part is looked up again.
        _, replaced = list(_children(rebuilt))[k]
        rebuilt = replaced(everywhere(child, change))
    changed = change(rebuilt)
    return rebuilt if changed is None else changed


def _children(node: Expression) -> Iterator[tuple[Any, Callable[[Any], Expression]]]:
    """Yield the parts of a node, each with the function that puts another in its place.

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
        case RotationSlope(rotation, vector, is_small):
            yield vector, lambda new: RotationSlope(rotation, new, is_small)
        case Cross(left, right):
            yield left, lambda new: Cross(new, right)
            yield right, lambda new: Cross(left, new)
        case TimesG(p, vector, is_transposed):
            yield vector, lambda new: TimesG(p, new, is_transposed)
        case RowOfSlope(left, slope):
            yield left, lambda new: RowOfSlope(new, slope)
            yield slope, lambda new: _row_of(left, new)


def _row_of(left: Vector, slope: Vector) -> Expression:
    """Return left^T slope, a number of the slope in front."""
    factor, inner = split_factor(slope)
    assert isinstance(inner, RotationSlope)
    return scaled(factor, RowOfSlope(left, inner))


def _sequence(
    parts: tuple[Any, ...], build: Callable[[Any], Expression]
) -> Iterator[tuple[Any, Callable[[Any], Expression]]]:
    def replacing(k: int) -> Callable[[Any], Expression]:
        return lambda new: build((*parts[:k], new, *parts[k + 1 :]))

    for k, part in enumerate(parts):
        yield part, replacing(k)
