"""The catalogue of faults in vectors: the formulas of a joint with one fault in them.

Every fault is a transformation of the generated formula, evaluated at the states of the comparison.
A fault is then found by comparing numbers. This is one of two levels: the formula in vectors (a
rotation transposed, s_i for s_j, a term of gamma forgotten), where a fault may show in several
entries at once. The other is each entry written out in sines and cosines: `entry_faults`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    ZERO_VECTOR,
    Expression,
    Number,
    Power,
    Rotated,
    Scalar,
    Sum,
    Symbol,
    Vector,
    VectorSum,
    VectorSymbol,
    product_of,
    split_coefficient,
    sum_of,
)
from kincompile.calculus.rotations import PlaneRotation
from kincompile.compare.agreement import agrees
from kincompile.compare.collected import CollectedTerm, collected, is_rate, perfect_square
from kincompile.compare.fault import (
    A_FOR_B,
    BLOCKS,
    COUPLING,
    CROSS_TERM,
    FACTOR,
    MISSING_SQUARE,
    MISSING_TERM,
    MIXED_ANGLES,
    MIXED_POINTS,
    PHI_TT,
    QUADRATIC_TERM,
    ROWS,
    SINE_COSINE,
    SQUARES,
    TRANSPOSED,
    X_AND_Y,
    Fault,
    whole_faults,
)
from kincompile.compare.formula_faults import Symbols, everywhere, one_place, swaps, times
from kincompile.compare.plain_text import described
from kincompile.compare.vectors import NumericExpansion, column_values, component_values
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials

if TYPE_CHECKING:
    from kincompile.compare.reference import Reference
    from kincompile.compare.states import Array, States
    from kincompile.derive.derivation import RowBlock
    from kincompile.model.resolve import Joint

HALF = Fraction(1, 2)
PARTS_OF_GAMMA = (
    (QUADRATIC_TERM, "-(Phi_q q_dot)_q q_dot is missing"),
    (CROSS_TERM, "-2 Phi_qt q_dot is missing"),
    (PHI_TT, "-Phi_tt is missing"),
)
"""The parts of gamma in order, and the faults of leaving them out."""
_ANY = VectorSymbol("any")
"""Stands for the vector that a rotation turns, whichever it is."""

Index = tuple[int, int]
"""Row and column of an entry; the column of a vector is 0."""

Parts = Mapping[Index, Expression]
"""Formulas by number of the row block and of the coordinate."""

NumericFault = Fault[Mapping[Index, "Array"]]
"""A fault with the numbers that stand in the entries where it shows, shape (N,) each."""


class JointFaults:
    """The faults of one quantity of a joint, on the level of vectors.

    Parameters
    ----------
    joint
        The joint, as its author sees the roles of its bodies.
    quantity
        Phi, Phi_q, nu or gamma.
    reference
        The system it belongs to.
    states
        Where to evaluate.
    """

    def __init__(self, joint: Joint, quantity: str, reference: Reference, states: States) -> None:
        self._joint = joint
        self._quantity = quantity
        self._blocks = derive(joint.template)
        self._partials = partials(joint.template)
        self._expansion = NumericExpansion(joint, reference, states)
        angles = frozenset(frame.phi.name for frame in joint.template.frames)
        partners = joint.written.partners()
        self._symbols = Symbols(angles, frozenset(joint.points), partners)
        self._parts = self._right_formulas()
        self._right = {place: self._values(place, item) for place, item in self._parts.items()}

    def faults(self) -> Iterator[NumericFault]:
        """Yield every fault that changes a number."""
        for fault in self.formulas():
            values = {place: self._values(place, item) for place, item in fault.result.items()}
            yield from self._if_different(fault.kind, fault.text, values)
        if self._quantity == "Phi_q":
            yield from self._exchanged_columns()
        elif len(self._right) == 1 and self._right[0, 0].shape[1] == 2:
            swapped = {(0, 0): self._right[0, 0][:, ::-1]}
            yield from self._if_different(ROWS, "its two rows are swapped", swapped)

    def _if_different(
        self, kind: str, text: str, values: Mapping[Index, Array]
    ) -> Iterator[NumericFault]:
        """Yield a fault with the entries in which the values of its parts are wrong, if any."""
        entries: dict[Index, Array] = {}
        for place, item in values.items():
            right = self._right[place]
            same = agrees(item, np.abs(item) + np.abs(right), right).all(axis=0)
            row, column = self._corner(place)
            for a, b in np.argwhere(~same):
                entries[row + int(a), column + int(b)] = item[:, a, b]
        if entries:
            yield Fault(kind, text, entries)

    def _right_formulas(self) -> Parts:
        if self._quantity != "Phi_q":
            return {(b, 0): getattr(item, self._quantity) for b, item in enumerate(self._blocks)}
        return {
            (b, k): item.entry
            for b, entries in enumerate(self._partials)
            for k, item in enumerate(entries)
        }

    def _values(self, place: Index, expression: Expression) -> Array:
        """Return the values of a part, shape (N, rows, columns)."""
        b, k = place
        with np.errstate(all="ignore"):
            if self._quantity != "Phi_q":
                return component_values(expression, self._expansion)[..., None]
            return column_values(self._partials[b][k].columns(expression), self._expansion)

    def _corner(self, place: Index) -> Index:
        """Return row and column of the first entry of a part."""
        b, k = place
        rows = sum(2 if isinstance(block.Phi, Vector) else 1 for block in self._blocks[:b])
        coordinates = self._joint.template.coordinates[:k] if self._quantity == "Phi_q" else ()
        return rows, sum(item.size for item in coordinates)

    def formulas(self) -> Iterator[Fault[Parts]]:
        """Yield every fault with the formulas that it changes."""
        for place, expression in self._parts.items():
            for fault in self._faults_of_part(place, expression):
                yield Fault(fault.kind, fault.text, {place: fault.result})
        blocks = range(len(self._blocks))
        for b in blocks:
            own = {place: item for place, item in self._parts.items() if place[0] == b}
            yield from _faults_everywhere(own, self._symbols)
            yield from _same_slips(own, self._symbols)
        if len(blocks) > 1:
            yield from _faults_everywhere(self._parts, self._symbols)
            yield from _same_slips(self._parts, self._symbols)
        if self._quantity == "Phi_q" and len(self._joint.bodies) == 2:
            yield from self._exchanged_blocks()

    def _faults_of_part(self, place: Index, expression: Expression) -> Iterator[Fault[Expression]]:
        name = self._quantity
        if name == "Phi_q":
            name = f"the derivative by {described(self._joint.template.coordinates[place[1]])}"
        zero = ZERO_VECTOR if isinstance(expression, Vector) else ZERO
        yield from whole_faults(
            self._quantity, name, lambda factor: times(factor, expression) if factor else zero
        )
        yield from one_place(_joined(expression), self._symbols)
        if isinstance(expression, Scalar):
            terms = collected(expression)
            if len(terms) > 1 or len(terms[0].factors if terms else ()) > 1:
                whole = Sum(tuple(term.expression for term in terms))
                yield from one_place(whole, self._symbols)
            if self._quantity == "gamma":
                yield from _wrong_velocities(terms)
        if self._quantity == "gamma":
            yield from _missing_parts_of_gamma(self._blocks[place[0]])

    def _exchanged_blocks(self) -> Iterator[Fault[Parts]]:
        """Yield the Jacobians with the blocks of bodies i and j in each other's place."""
        other = {0: 2, 1: 3, 2: 0, 3: 1}
        swapped = {(b, k): self._parts[b, other[k]] for b, k in self._parts if k in other}
        text = "the blocks of bodies i and j are swapped"
        yield Fault(BLOCKS, text, swapped)
        for b in range(len(self._blocks)):
            yield Fault(BLOCKS, text, {place: swapped[place] for place in swapped if place[0] == b})
            angles = {place: swapped[place] for place in ((b, 1), (b, 3))}
            yield Fault(BLOCKS, "the derivatives by phi_i and phi_j are swapped", angles)

    def _exchanged_columns(self) -> Iterator[NumericFault]:
        """Yield the Jacobians with the columns of x and y in each other's place."""
        for k, coordinate in enumerate(self._joint.template.coordinates):
            if isinstance(coordinate, VectorSymbol):
                text = f"the columns of x and y of {described(coordinate)} are swapped"
                places = [(b, k) for b in range(len(self._blocks))]
                for chosen in (*([place] for place in places), places):
                    swapped = {place: self._right[place][..., ::-1] for place in chosen}
                    yield from self._if_different(X_AND_Y, text, swapped)


def _faults_everywhere(parts: Parts, symbols: Symbols) -> Iterator[Fault[Parts]]:
    """Yield the formulas with one symbol mistaken for another wherever it occurs."""
    leaves: dict[Expression, None] = {}

    def collect(node: Expression) -> None:
        match node:
            case VectorSymbol():
                leaves[node] = None
            case Rotated(PlaneRotation(Symbol())):
                leaves[replace(node, vector=_ANY)] = None

    _changed(parts, collect)
    for leaf in leaves:
        for fault in swaps(leaf, symbols):
            result = _changed(parts, partial(_replaced, leaf, fault.result))
            yield Fault(fault.kind, f"{fault.text}, throughout", result)
    yield from _exchanged_names(parts, symbols)


def _same_slips(parts: Parts, symbols: Symbols) -> Iterator[Fault[Parts]]:
    """Yield the formulas with the same slip for every body."""

    def slip(kind: str, node: Expression) -> Expression | None:
        if kind == MISSING_SQUARE:
            is_square = isinstance(node, Power) and node.exponent == 2 and is_rate(node)
            return node.base if isinstance(node, Power) and is_square else None
        if not isinstance(node, Rotated):
            return None
        return next((item.result for item in swaps(node, symbols) if item.kind == kind), None)

    texts = {
        A_FOR_B: "A stands where B belongs, or B where A, for every body",
        TRANSPOSED: "the rotations of all bodies are transposed",
        SINE_COSINE: "sine and cosine are swapped for every body",
        MISSING_SQUARE: "w stands where w^2 belongs, for every body",
    }
    for kind, text in texts.items():
        yield Fault(kind, text, _changed(parts, partial(slip, kind)))


def _joined(expression: Expression) -> Expression:
    """Return a sum with equal terms joined, as it is written: one slip is in both of them."""
    if not isinstance(expression, Sum):
        return expression
    numbers: dict[tuple[Scalar, ...], Fraction] = {}
    for term in expression.terms:
        number, factors = split_coefficient(term)
        numbers[tuple(factors)] = numbers.get(tuple(factors), Fraction(0)) + number
    return Sum(tuple(product_of((Number(n), *rest)) for rest, n in numbers.items() if n))


def _changed(parts: Parts, change: Callable[[Expression], Expression | None]) -> Parts:
    return {place: everywhere(item, change) for place, item in parts.items()}


def _replaced(leaf: Expression, new: Expression, node: Expression) -> Expression | None:
    """Return the replacement of a vector, or of a rotation whichever vector it turns."""
    if not isinstance(leaf, Rotated):
        return new if node == leaf else None
    if isinstance(node, Rotated) and replace(node, vector=_ANY) == leaf:
        return everywhere(new, lambda inner: node.vector if inner == _ANY else None)
    return None


def _exchanged_names(parts: Parts, symbols: Symbols) -> Iterator[Fault[Parts]]:
    """Yield the formulas with two names exchanged wherever they occur."""

    def angles(node: Expression) -> Expression | None:
        match node:
            case Rotated(PlaneRotation(Symbol(name))) if other := symbols.other_angle(name):
                return replace(node, rotation=PlaneRotation(Symbol(other)))
        return None

    def points(node: Expression) -> Expression | None:
        if isinstance(node, VectorSymbol) and (partner := symbols.partners.get(node.name)):
            return VectorSymbol(partner)
        return None

    if symbols.angles == {"phi_i", "phi_j"}:
        text = "phi_i and phi_j are exchanged throughout"
        yield Fault(MIXED_ANGLES, text, _changed(parts, angles))
    text = "the points of bodies i and j are exchanged throughout"
    yield Fault(MIXED_POINTS, text, _changed(parts, points))


def _missing_parts_of_gamma(block: RowBlock) -> Iterator[Fault[Expression]]:
    """Yield gamma without one of its three parts, or with the cross term taken once."""
    for k, (kind, text) in enumerate(PARTS_OF_GAMMA):
        rest = (*block.gamma_terms[:k], *block.gamma_terms[k + 1 :])
        # Without its only term gamma is left zero, which has a name already.
        if any(term not in (ZERO, ZERO_VECTOR) for term in rest):
            yield Fault(kind, text, _sum(rest))
    quadratic, cross, second = block.gamma_terms
    once = _sum((quadratic, times(HALF, cross), second))
    yield Fault(FACTOR, "the 2 of 2 Phi_qt q_dot is missing", once)


def _sum(terms: tuple[Expression, ...]) -> Expression:
    """Return a sum as it stands, of vectors or of scalars."""
    vectors = tuple(item for item in terms if isinstance(item, Vector))
    return (
        VectorSum(vectors)
        if vectors
        else Sum(tuple(item for item in terms if isinstance(item, Scalar)))
    )


def _wrong_velocities(terms: tuple[CollectedTerm, ...]) -> Iterator[Fault[Expression]]:
    """Yield gamma with faults in its velocities, as it is printed."""
    names = ("r_i_dot", "r_j_dot")
    coupled = [term for term in terms if any(name in repr(term.product) for name in names)]
    rest = tuple(term.expression for term in terms if term not in coupled)
    if coupled and rest:
        text = "the terms with w and r_j_dot - r_i_dot are missing"
        yield Fault(COUPLING, text, sum_of(rest))
        halves = (HALF * term.expression for term in coupled)
        yield Fault(FACTOR, "the 2 of 2 w (r_j_dot - r_i_dot) is missing", Sum((*rest, *halves)))
    for term in terms:
        if square := perfect_square(term.factors):
            others = tuple(item.expression for item in terms if item is not term)
            yield from _wrong_squares(others, term, square)
    every = [(term.product, factor) for term in terms for factor in term.factors]
    for velocity in dict.fromkeys(_velocities(factor) for _, factor in every):
        kept = [factor * product for product, factor in every if _velocities(factor) != velocity]
        if velocity != ONE and kept:
            text = f"the terms with {described(velocity)} are missing"
            yield Fault(MISSING_TERM, text, Sum(tuple(kept)))


def _wrong_squares(
    others: tuple[Scalar, ...], term: CollectedTerm, square: tuple[Symbol, Symbol, Scalar]
) -> Iterator[Fault[Expression]]:
    """Yield gamma with a wrong square of the difference of two velocities a and b."""
    a, b, c = square
    right = f"({described(a)} - {described(b)})^2"
    for first, second in ((a, b), (b, a)):
        text = f"{described(first)}^2 - {described(second)}^2 stands where {right} belongs"
        wrong = c * (first**2 - second**2) * term.product
        yield Fault(SQUARES, text, Sum((*others, wrong)))
    without = c * (a**2 + b**2) * term.product
    yield Fault(SQUARES, f"the mixed term of {right} is missing", Sum((*others, without)))


def _velocities(term: Scalar) -> Scalar:
    """Return the product of the angular velocities in a term."""
    _, factors = split_coefficient(term)
    return product_of(tuple(factor for factor in factors if is_rate(factor)))
