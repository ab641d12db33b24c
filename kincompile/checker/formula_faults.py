"""Faults in a formula written in vectors: each gives the formula that would result.

A fault changes one place (`one_place`), or one symbol wherever it occurs (`everywhere`). The result
is a formula of the same kind, to be evaluated like the right one; nothing is simplified.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

from kincompile.calculus import expressions as ex
from kincompile.calculus.rotations import PlaneRotation
from kincompile.calculus.space import EulerRotation
from kincompile.checker.fault import Fault, Kind, term_faults
from kincompile.checker.plain_text import described
from kincompile.checker.vectors import Exchanged, WrongTilde
from kincompile.derive.collected import is_rate
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

HIGHEST_ORDER = 2
"""Of the derivatives of a function that one mistakes for each other."""

_MINUS_ONE = ex.Number(Fraction(-1))


@dataclass(frozen=True, slots=True)
class Symbols:
    """The names of a joint's angles and of its body-fixed vectors."""

    angles: frozenset[str]
    vectors: frozenset[str]
    positions: frozenset[str]  # of the bodies: r_i, r_j
    partners: Mapping[str, str]  # the vector that each vector is easily mistaken for, by name

    def other_angle(self, name: str) -> str | None:
        """Return the angle of the other body."""
        others = self.angles - {name} if name in self.angles else ()
        return next(iter(others), None)


def times(factor: Fraction | int, expression: ex.Expression) -> ex.Expression:
    """Return a multiple of a formula, as it is."""
    number = ex.Number(Fraction(factor))
    if isinstance(expression, ex.Vector):
        return ex.Scaled(number, expression)
    return _product((number, expression))


def _product(factors: tuple[Any, ...]) -> ex.Scalar:
    """Return a product as it stands; numbers alone are multiplied, for nothing expands those."""
    if not all(isinstance(factor, ex.Number) for factor in factors):
        return ex.Product(factors)
    value = Fraction(1)
    for factor in factors:
        value *= factor.value
    return ex.Number(value)


def one_place(expression: ex.Expression, symbols: Symbols) -> Iterator[Fault[ex.Expression]]:
    """Yield the formulas with one fault at one place."""
    yield from _here(expression, symbols)
    for child, rebuilt in _children(expression):
        for inner in one_place(child, symbols):
            yield replace(inner, result=rebuilt(inner.result))


def _here(node: ex.Expression, symbols: Symbols) -> Iterator[Fault[ex.Expression]]:
    match node:
        case ex.Sum(terms):
            yield from _terms(terms, ex.Sum)
        case ex.VectorSum(terms):
            yield from _terms(terms, ex.VectorSum)
        case ex.Product(factors):
            yield from _factors(factors)
        case ex.Scaled(factor, vector) if not isinstance(factor, ex.Product):
            yield from _dropped(factor, vector)
        case ex.Power(base, 2):
            text = f"{described(base)} stands where {described(node)} belongs"
            yield Fault(Kind.MISSING_SQUARE if is_rate(base) else Kind.MISSING_FACTOR, text, base)
        case ex.TimeFunction(_, order):
            if order:
                kind = Kind.SECOND_DERIVATIVE if order == 2 else Kind.DRIVER_RATE
                yield Fault(kind, f"{described(node)} is taken as zero", ex.ZERO)
            yield from _wrong_orders(node)
        case ex.ProfileFunction():
            yield from _wrong_orders(node)
        case ex.Cross(left, right):
            name = f"{described(left)}~"
            yield Fault(Kind.TILDE, f"the sign of {name} is wrong", times(-1, node))
            yield Fault(Kind.MISSING_RATE, f"the factor {name} is missing", right)
        case ex.Rotated() | ex.VectorSymbol() | ex.RotationSlope():
            yield from swaps(node, symbols)


def _wrong_orders(node: ex.TimeFunction | ex.ProfileFunction) -> Iterator[Fault[ex.Expression]]:
    """Yield the neighbours of a function in the row of its derivatives."""
    for order in (node.order - 1, node.order + 1):
        if 0 <= order <= HIGHEST_ORDER:
            other = replace(node, order=order)
            text = f"{described(other)} stands where {described(node)} belongs"
            yield Fault(Kind.MIXED_ORDERS, text, other)


def _terms(
    terms: tuple[Any, ...], build: Callable[[Any], ex.Expression]
) -> Iterator[Fault[ex.Expression]]:
    for k, term in enumerate(terms):
        multiple = partial(_with_multiple, terms, k, build)
        yield from term_faults(f"the term {described(term)}", multiple)


def _with_multiple(
    terms: tuple[Any, ...], k: int, build: Callable[[Any], ex.Expression], factor: Fraction
) -> ex.Expression:
    own = (times(factor, terms[k]),) if factor else ()
    return build((*terms[:k], *own, *terms[k + 1 :]))


def _factors(factors: tuple[ex.Scalar, ...]) -> Iterator[Fault[ex.Expression]]:
    for k, factor in enumerate(factors):
        rest = (*factors[:k], *factors[k + 1 :])
        yield from _dropped(factor, _product(rest))


def _dropped(factor: ex.Scalar, rest: ex.Expression) -> Iterator[Fault[ex.Expression]]:
    """Yield the product without a factor; a sign is no factor here."""
    if isinstance(factor, ex.Number):
        if abs(factor.value) == 2:
            signed = times(factor.value / 2, rest)
            yield Fault(Kind.FACTOR, f"a factor {factor.value} is missing", signed)
        return
    kind = Kind.MISSING_FACTOR
    if is_rate(factor):
        kind = Kind.MISSING_SQUARE if isinstance(factor, ex.Power) else Kind.MISSING_RATE
    yield Fault(kind, f"the factor {described(factor)} is missing", rest)


def swaps(node: ex.Expression, symbols: Symbols) -> Iterator[Fault[ex.Expression]]:
    """Yield the mistakes for a rotation or a body-fixed vector; each result stands in its place."""
    if isinstance(node, ex.RotationSlope):
        yield from _wrong_slopes(node)
    if isinstance(node, ex.Rotated):
        yield from _wrong_rotations(node, symbols)
    if isinstance(node, ex.VectorSymbol) and node.name in symbols.vectors:
        swapped = Exchanged(node.name, node.size)
        if node.size == 2:
            yield Fault(Kind.XI_ETA, f"xi and eta of {node.name} are swapped", swapped)
        partner = symbols.partners.get(node.name)
        if partner is not None:
            text = f"{partner} stands where {node.name} belongs"
            yield Fault(Kind.MIXED_POINTS, text, ex.VectorSymbol(partner, node.size))
    if isinstance(node, ex.VectorSymbol) and node.name in ("omega_i", "omega_j"):
        text = f"the global {node.name} stands where {described(node)} of the body belongs"
        p = ex.VectorSymbol(node.name.replace("omega", "p"), 4)
        yield Fault(Kind.GLOBAL_OMEGA, text, ex.Rotated(EulerRotation(p), node))
    if (other := rate_or_position(node)) is not None:
        yield Fault(
            Kind.MIXED_RATES, f"{described(other)} stands where {described(node)} belongs", other
        )


def rate_or_position(node: ex.Expression) -> ex.VectorSymbol | None:
    """Return the velocity of a position r_i, or the position of its velocity; else None."""
    if not isinstance(node, ex.VectorSymbol) or not node.name.startswith("r_"):
        return None
    position = node.name.removesuffix(rate(""))
    return ex.VectorSymbol(rate(position) if node.name == position else position, node.size)


def _wrong_rotations(node: ex.Rotated, symbols: Symbols) -> Iterator[Fault[ex.Expression]]:
    if isinstance(node.rotation, EulerRotation):
        yield from _wrong_slopes(node)
    if not isinstance(node.rotation, PlaneRotation):
        return
    angle, vector, along = node.rotation.angle, node.vector, node.along
    letter, other_letter = tuple(node.rotation.letters)[:: -1 if along else 1]
    index = described(angle).removeprefix("phi_") if isinstance(angle, ex.Symbol) else "(theta)"
    name = f"{letter}_{index}"
    other = ex.Rotated(node.rotation, vector, () if along else (ex.ONE,))
    yield Fault(Kind.A_FOR_B, f"{other_letter}_{index} stands where {name} belongs", other)
    # (R^k A)^T = R^-k A(-phi), and R^-1 = -R.
    back = ex.Rotated(PlaneRotation(ex.Product((_MINUS_ONE, angle))), vector, along)
    transposed = times(-1, back) if along else back
    yield Fault(Kind.TRANSPOSED, f"{name} is transposed", transposed)
    if along:
        yield Fault(Kind.TRANSPOSED, f"the angle has the wrong sign in {name}", back)
    if isinstance(vector, ex.VectorSymbol) and vector.name.startswith("s_"):
        for text, origin in _other_origins(index, symbols):
            arm: ex.Vector = ex.VectorSum((*origin, ex.Rotated(node.rotation, vector)))
            arm = ex.Perpendicular(arm) if along else arm
            text = f"{text} stands where that from the body's own, A_{index} s_{index}, belongs"
            yield Fault(Kind.ARM, text, arm)
    complement = ex.Sum(
        (ex.Product((ex.Number(Fraction(1, 2)), ex.Pi())), ex.Product((_MINUS_ONE, angle)))
    )
    exchanged = ex.Rotated(PlaneRotation(complement), vector, along)
    yield Fault(Kind.SINE_COSINE, f"sine and cosine are swapped in {name}", exchanged)
    mixed = symbols.other_angle(angle.name) if isinstance(angle, ex.Symbol) else None
    if mixed is not None:
        text = f"{mixed} stands where phi_{index} belongs, in {name}"
        yield Fault(
            Kind.MIXED_ANGLES, text, ex.Rotated(PlaneRotation(ex.Symbol(mixed)), vector, along)
        )


def _other_origins(index: str, symbols: Symbols) -> Iterator[tuple[str, tuple[ex.Vector, ...]]]:
    """Yield other points than the body's origin to take an arm from, with the way to that."""
    own = f"r_{index}"
    if own in symbols.positions:
        way = (ex.VectorSymbol(own),)
        yield f"the arm from the origin of the ground, r_{index} + A_{index} s_{index},", way
        for other in symbols.positions - {own}:
            there = ex.Scaled(_MINUS_ONE, ex.VectorSymbol(other))
            yield f"the arm from the origin of body {other.removeprefix('r_')}", (*way, there)


def _wrong_slopes(node: ex.Rotated | ex.RotationSlope) -> Iterator[Fault[ex.Expression]]:
    """Yield the mistakes for A s, B(p, s) and A s~ of Euler parameters."""
    assert isinstance(node.rotation, EulerRotation)
    is_small = isinstance(node, ex.RotationSlope) and node.is_small
    is_slope = not is_small and (isinstance(node, ex.RotationSlope) or bool(node.along))
    name = f"{'B' if is_slope else 'A'}_{node.rotation.p.name.removeprefix('p_')}"
    back = replace(node, rotation=replace(node.rotation, is_back=True))
    text = f"the signs of e~ are wrong in {name}" if is_slope else f"{name} is transposed"
    yield Fault(Kind.TRANSPOSED, text, back)
    if is_slope:
        yield Fault(Kind.FACTOR, f"the 2 of {name} is missing", times(Fraction(1, 2), node))
        wrong = replace(node, rotation=WrongTilde(node.rotation.p))
        yield Fault(Kind.TILDE, f"the sign of {described(node.vector)}~ is wrong in {name}", wrong)
    if is_small:
        text = f"the sign of {described(node.vector)}~ is wrong in {described(node)}"
        yield Fault(Kind.TILDE, text, times(-1, node))


def everywhere(
    expression: ex.Expression, change: Callable[[ex.Expression], ex.Expression | None]
) -> ex.Expression:
    """Replace every node for which `change` returns another; None keeps a node."""
    rebuilt = expression
    for k, (child, _) in enumerate(_children(expression)):
        # Each replacement rebuilds the node, so the place of the next part is looked up again.
        _, replaced = list(_children(rebuilt))[k]
        rebuilt = replaced(everywhere(child, change))
    changed = change(rebuilt)
    return rebuilt if changed is None else changed


_PARTS: Mapping[type, tuple[str, ...]] = {
    ex.Sum: ("terms",),
    ex.VectorSum: ("terms",),
    ex.Product: ("factors",),
    ex.Power: ("base",),
    ex.Dot: ("left", "right"),
    ex.Scaled: ("factor", "vector"),
    ex.Rotated: ("vector",),
    ex.Perpendicular: ("vector",),
    ex.RotationSlope: ("vector",),
    ex.Cross: ("left", "right"),
    ex.TimesG: ("vector",),
    ex.RowOfSlope: ("left", "slope"),
}
"""The parts of a node that faults are looked for in.

Angles other than a body's own, and lengths of constant vectors, are taken as given.
"""


def _children(node: Any) -> Iterator[tuple[Any, Callable[[Any], ex.Expression]]]:
    """Yield the parts of a node, each with the function that puts another in its place."""
    for name in _PARTS.get(type(node), ()):
        part = getattr(node, name)
        if not isinstance(part, tuple):
            yield part, partial(_with, node, name)
            continue
        for k, item in enumerate(part):
            yield item, partial(_with_item, node, name, k)


def _with_item(node: Any, name: str, k: int, new: Any) -> ex.Expression:
    items = getattr(node, name)
    return _with(node, name, (*items[:k], new, *items[k + 1 :]))


def _with(node: Any, name: str, new: Any) -> ex.Expression:
    """Return a node with another part; numbers alone are multiplied, one of a slope is in front."""
    if isinstance(node, ex.Product):
        return _product(new)
    if name != "slope":
        changed: ex.Expression = replace(node, **{name: new})
        return changed
    factor, slope = ex.split_factor(new)
    assert isinstance(slope, ex.RotationSlope)
    return ex.scaled(factor, ex.RowOfSlope(node.left, slope))
