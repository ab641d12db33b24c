"""The catalogue of faults: what a joint's formulas give when one slip has been made in them.

Every fault is a transformation of the generated formula, evaluated at the states of the comparison.
Looking up what a student did wrong is then a comparison of numbers. Two levels are covered: the
formula in vectors (a rotation transposed, s_i for s_j, a term of gamma forgotten), where a slip
may show in several entries at once, and each entry written out in sines and cosines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    ZERO_VECTOR,
    Expression,
    Power,
    Rotated,
    Scalar,
    Sum,
    Symbol,
    Vector,
    VectorSum,
    VectorSymbol,
    as_scalar,
    split_coefficient,
    sum_of,
)
from kincompile.calculus.rotations import PlaneRotation
from kincompile.compare import mutations
from kincompile.compare.agreement import agrees
from kincompile.compare.collected import Group, collected, perfect_square
from kincompile.compare.mutations import (
    HALF,
    MINUS_ONE,
    TWO,
    Mutation,
    Symbols,
    everywhere,
    one_place,
    swaps,
    times,
)
from kincompile.compare.plain_text import described
from kincompile.compare.vectors import column_values, component_values, numeric_expansion
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials

if TYPE_CHECKING:
    from kincompile.calculus.expand import Expansion
    from kincompile.compare.reference import Reference
    from kincompile.compare.states import Array, States
    from kincompile.derive.derivation import RowBlock
    from kincompile.model.resolve import Joint

WHOLE_SIGN = "whole sign"
LEFT_ZERO = "left zero"
BLOCKS = "body blocks swapped"
X_AND_Y = "x and y columns swapped"
CROSS_TERM = "cross term 2 Phi_qt q_dot missing"
QUADRATIC_TERM = "(Phi_q q_dot)_q q_dot missing"
PHI_TT = "Phi_tt missing"
COUPLING = "coupling 2 w (r_j_dot - r_i_dot) missing"
SQUARES = "w_j^2 - w_i^2 for (w_j - w_i)^2"
REVERSED = "driver's rate reversed"

Place = tuple[int, int]
"""Row of the constraint and column of its own coordinates; the column of a vector is 0."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault, and the numbers that it gives in the entries where it shows.

    Attributes
    ----------
    kind
        The fault in a few words.
    text
        What is wrong, and where.
    values
        By entry, what stands there with the fault, shape (N,).
    detail
        What the right formula has there, for those who may see it.
    """

    kind: str
    text: str
    values: Mapping[Place, Array]
    detail: str = ""


Variant = tuple[str, str, Mapping[tuple[int, int], Expression]]
"""Kind, text, and the changed expressions by row block and coordinate."""


class VectorFaults:
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
        self._expansion: Expansion = numeric_expansion(joint, reference, states)
        frames = joint.template.frames
        self._symbols = Symbols(
            frozenset(frame.phi.name for frame in frames),
            frozenset(joint.points),
            joint.written.partners(),
        )
        self._right = {place: self._values(place, item) for place, item in self._parts().items()}

    def faults(self) -> Iterator[Fault]:
        """Yield every fault that changes a number."""
        for kind, text, changed in self.variants():
            values: dict[Place, Array] = {}
            for place, expression in changed.items():
                values.update(self._differing(place, self._values(place, expression)))
            if values:
                yield Fault(kind, text, values)
        if self._quantity == "Phi_q":
            yield from self._exchanged_columns()

    def _parts(self) -> dict[Place, Expression]:
        """Return the expressions by number of the row block and of the coordinate."""
        parts: dict[Place, Expression] = {}
        for b, block in enumerate(self._blocks):
            if self._quantity == "Phi_q":
                parts.update({(b, k): item.entry for k, item in enumerate(self._partials[b])})
            else:
                parts[b, 0] = getattr(block, self._quantity)
        return parts

    def _values(self, place: Place, expression: Expression) -> Array:
        """Return the values of a part, shape (N, rows, columns)."""
        b, k = place
        with np.errstate(all="ignore"):
            if self._quantity != "Phi_q":
                return component_values(expression, self._expansion)[..., None]
            return column_values(self._partials[b][k].columns(expression), self._expansion)

    def _corner(self, place: Place) -> Place:
        """Return row and column of the first entry of a part."""
        b, k = place
        rows = sum(2 if isinstance(block.Phi, Vector) else 1 for block in self._blocks[:b])
        coordinates = self._joint.template.coordinates[:k] if self._quantity == "Phi_q" else ()
        return rows, sum(item.size for item in coordinates)

    def _differing(self, place: Place, values: Array) -> dict[Place, Array]:
        """Return the entries of a part in which values are wrong."""
        right = self._right[place]
        same = agrees(values, np.abs(values) + np.abs(right), right).all(axis=0)
        row, column = self._corner(place)
        return {(row + int(a), column + int(b)): values[:, a, b] for a, b in np.argwhere(~same)}

    def variants(self) -> Iterator[Variant]:
        """Yield every faulty formula: kind, text, and what stands where with the fault."""
        parts = self._parts()
        for place, expression in parts.items():
            for mutation in self._mutations(place, expression):
                yield mutation.kind, mutation.text, {place: mutation.expression}
        for b in range(len(self._blocks)):
            own = {place: item for place, item in parts.items() if place[0] == b}
            yield from _global_variants(own, self._symbols)
        if len(self._blocks) > 1:
            yield from _global_variants(parts, self._symbols)
        if self._quantity == "Phi_q":
            yield from self._exchanged_blocks(parts)

    def _mutations(self, place: Place, expression: Expression) -> Iterator[Mutation]:
        """Yield the faults of one part."""
        yield from self._as_a_whole(place, expression)
        yield from one_place(expression, self._symbols)
        if isinstance(expression, Scalar):
            groups = collected(expression)
            if len(groups) > 1 or len(groups[0].terms if groups else ()) > 1:
                whole = Sum(tuple(group.expression for group in groups))
                yield from one_place(whole, self._symbols)
            if self._quantity == "gamma":
                yield from _gamma_groups(groups)
        if self._quantity == "gamma":
            yield from _gamma_terms(self._blocks[place[0]])

    def _as_a_whole(self, place: Place, expression: Expression) -> Iterator[Mutation]:
        name = self._name(place)
        signs = {"nu": REVERSED, "gamma": WHOLE_SIGN}
        sign = times(MINUS_ONE, expression)
        zero = ZERO_VECTOR if isinstance(expression, Vector) else ZERO
        yield Mutation(
            signs.get(self._quantity, mutations.SIGN), f"{name} has the wrong sign", sign
        )
        yield Mutation(LEFT_ZERO, f"{name} is left zero", zero)
        for word, number in (("twice", TWO), ("half", HALF)):
            text = f"{name} is {word} what it should be"
            yield Mutation(mutations.FACTOR, text, times(number, expression))

    def _name(self, place: Place) -> str:
        if self._quantity != "Phi_q":
            return self._quantity
        coordinate = self._joint.template.coordinates[place[1]]
        return f"the derivative by {described(coordinate)}"

    def _exchanged_blocks(self, parts: Mapping[Place, Expression]) -> Iterator[Variant]:
        """Yield the Jacobians with the blocks of bodies i and j in each other's place."""
        if len(self._joint.bodies) < 2:
            return
        text = "the blocks of bodies i and j are swapped"
        other = {0: 2, 1: 3, 2: 0, 3: 1}
        own = {place: parts[place[0], other[place[1]]] for place in parts if place[1] in other}
        yield BLOCKS, text, own
        for b in range(len(self._blocks)):
            yield BLOCKS, text, {place: item for place, item in own.items() if place[0] == b}
            angles = {(b, 1): parts[b, 3], (b, 3): parts[b, 1]}
            yield BLOCKS, "the derivatives by phi_i and phi_j are swapped", angles

    def _exchanged_columns(self) -> Iterator[Fault]:
        for k, coordinate in enumerate(self._joint.template.coordinates):
            if not isinstance(coordinate, VectorSymbol):
                continue
            text = f"the columns of x and y of {described(coordinate)} are swapped"
            every: dict[Place, Array] = {}
            for b in range(len(self._blocks)):
                values = self._differing((b, k), self._right[b, k][..., ::-1])
                every.update(values)
                if values:
                    yield Fault(X_AND_Y, text, values)
            if every:
                yield Fault(X_AND_Y, text, every)


def _global_variants(parts: Mapping[Place, Expression], symbols: Symbols) -> Iterator[Variant]:
    """Yield the formulas with one thing taken for another wherever it occurs."""
    leaves: dict[Expression, None] = {}

    def collect(node: Expression) -> None:
        match node:
            case VectorSymbol():
                leaves[node] = None
            case Rotated(PlaneRotation(Symbol())):
                leaves[replace(node, vector=_ANY)] = None

    for expression in parts.values():
        everywhere(expression, collect)
    for leaf in leaves:
        for kind, text, new in swaps(leaf, symbols):
            change = _replacing(leaf, new)
            changed = {place: everywhere(item, change) for place, item in parts.items()}
            yield kind, f"{text}, throughout", changed
    yield from _exchanged_names(parts, symbols)


_ANY = VectorSymbol("any")
"""Stands for whatever is turned."""


def _replacing(leaf: Expression, new: Expression) -> Callable[[Expression], Expression | None]:
    """Return what replaces a vector, or a rotation whatever it turns."""

    def change(node: Expression) -> Expression | None:
        if not isinstance(leaf, Rotated):
            return new if node == leaf else None
        if isinstance(node, Rotated) and replace(node, vector=_ANY) == leaf:
            turned = node.vector
            return everywhere(new, lambda inner: turned if inner == _ANY else None)
        return None

    return change


def _exchanged_names(parts: Mapping[Place, Expression], symbols: Symbols) -> Iterator[Variant]:
    """Yield the formulas with two names exchanged wherever they occur."""
    if symbols.angles == {"phi_i", "phi_j"}:
        other = {"phi_i": Symbol("phi_j"), "phi_j": Symbol("phi_i")}

        def angles(node: Expression) -> Expression | None:
            match node:
                case Rotated(PlaneRotation(Symbol(name) as angle)):
                    return replace(node, rotation=PlaneRotation(other.get(name, angle)))
            return None

        changed = {place: everywhere(item, angles) for place, item in parts.items()}
        yield mutations.MIXED_ANGLES, "phi_i and phi_j are exchanged throughout", changed

    def points(node: Expression) -> Expression | None:
        if isinstance(node, VectorSymbol) and (partner := symbols.partners.get(node.name)):
            return VectorSymbol(partner)
        return None

    changed = {place: everywhere(item, points) for place, item in parts.items()}
    yield mutations.MIXED_POINTS, "the points of bodies i and j are exchanged throughout", changed


def _gamma_terms(block: RowBlock) -> Iterator[Mutation]:
    """Yield gamma without one of its three terms, or with the cross term taken once."""
    names = (
        (QUADRATIC_TERM, "-(Phi_q q_dot)_q q_dot is missing"),
        (CROSS_TERM, "-2 Phi_qt q_dot is missing"),
        (PHI_TT, "-Phi_tt is missing"),
    )
    for k, (kind, text) in enumerate(names):
        rest = [term for number, term in enumerate(block.gamma_terms) if number != k]
        # Without its only term gamma is left zero, which has a name already.
        if any(term not in (ZERO, ZERO_VECTOR) for term in rest):
            yield Mutation(kind, text, _sum(rest))
    quadratic, cross, second = block.gamma_terms
    once = _sum([quadratic, times(HALF, cross), second])
    yield Mutation(mutations.FACTOR, "the 2 of 2 Phi_qt q_dot is missing", once)


def _sum(terms: list[Any]) -> Expression:
    """Return a sum as it stands, of vectors or of scalars."""
    parts = tuple(terms)
    return VectorSum(parts) if any(isinstance(item, Vector) for item in parts) else Sum(parts)


def _gamma_groups(groups: tuple[Group, ...]) -> Iterator[Mutation]:
    """Yield gamma with slips in its velocities, as it is printed."""
    positions = [g for g in groups if "r_i_dot" in repr(g.product) or "r_j_dot" in repr(g.product)]
    rest = [group.expression for group in groups if group not in positions]
    if positions and rest:
        yield Mutation(
            COUPLING, "the terms with w and r_j_dot - r_i_dot are missing", sum_of(tuple(rest))
        )
        halves = [HALF * group.expression for group in positions]
        text = "the 2 of 2 w (r_j_dot - r_i_dot) is missing"
        yield Mutation(mutations.FACTOR, text, Sum((*rest, *halves)))
    for group in groups:
        square = perfect_square(group.terms)
        if square is not None:
            yield from _wrong_squares(groups, group, square)
    yield from _without_rates(groups)


def _wrong_squares(
    groups: tuple[Group, ...], group: Group, square: tuple[Symbol, Symbol, Scalar]
) -> Iterator[Mutation]:
    a, b, c = square
    rest = [item.expression for item in groups if item is not group]
    for first, second in ((a, b), (b, a)):
        wrong = c * (first**2 - second**2) * group.product
        name = f"{described(first)}^2 - {described(second)}^2"
        text = f"{name} stands where ({described(a)} - {described(b)})^2 belongs"
        yield Mutation(SQUARES, text, Sum((*rest, wrong)))
    without = c * (a**2 + b**2) * group.product
    text = f"the mixed term of ({described(a)} - {described(b)})^2 is missing"
    yield Mutation(SQUARES, text, Sum((*rest, without)))


def _without_rates(groups: tuple[Group, ...]) -> Iterator[Mutation]:
    """Yield gamma without all terms that have the same velocities in front."""
    every = [(group.product, term) for group in groups for term in group.terms]
    for key in dict.fromkeys(_rates(term) for _, term in every):
        kept = tuple(term * product for product, term in every if _rates(term) != key)
        if key != ONE and kept:
            text = f"the terms with {described(key)} are missing"
            yield Mutation(mutations.MISSING_TERM, text, Sum(kept))


def _rates(term: Scalar) -> Scalar:
    """Return the angular velocities in a term."""
    _, factors = split_coefficient(term)
    rates: Scalar = as_scalar(1)
    for factor in factors:
        base = factor.base if isinstance(factor, Power) else factor
        if isinstance(base, Symbol) and base.name.endswith("_dot"):
            rates = rates * factor
    return rates
