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
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from kincompile.calculus import expressions as ex
from kincompile.calculus.rotations import PlaneRotation
from kincompile.calculus.space import EulerRotation, TurnedFrame
from kincompile.calculus.symbols import PlaneFrame
from kincompile.checker.agreement import ABSOLUTE, CLOSE, is_alike
from kincompile.checker.fault import Fault, Kind, whole_faults
from kincompile.checker.formula_faults import (
    Symbols,
    everywhere,
    one_place,
    rate_or_position,
    swaps,
    times,
)
from kincompile.checker.gamma_faults import collected, missing_parts, total, wrong_velocities
from kincompile.checker.plain_text import described
from kincompile.checker.vectors import (
    NumericExpansion,
    Shifted,
    column_values,
    component_values,
)
from kincompile.derive.collected import is_rate
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials
from kincompile.model.absolute import AbsoluteAngle
from kincompile.model.relative import RelativeAngle
from kincompile.names import rate

if TYPE_CHECKING:
    from kincompile.checker.fault import Index, NumericFault
    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States
    from kincompile.model.resolve import Joint

_ANY = ex.VectorSymbol("any")
"""Stands for the vector that a rotation turns, whichever it is."""

Parts = Mapping["Index", ex.Expression]
"""Formulas by number of the row block and of the coordinate."""


_ORDERS = {
    2: [(Kind.X_AND_Y, "x and y are swapped in the columns", [1, 0])],
    3: [
        (Kind.X_AND_Y, f"{'xyz'[a]} and {'xyz'[b]} are swapped in the columns", order)
        for a, b, order in ((0, 1, [1, 0, 2]), (0, 2, [2, 1, 0]), (1, 2, [0, 2, 1]))
    ],
    4: [(Kind.E0_LAST, "e0 stands last in the columns", [1, 2, 3, 0])],
}
"""Wrong orders of the columns of a vector coordinate, by the number of its components."""


class JointFaults:
    """The faults of one quantity of a joint, on the level of vectors."""

    def __init__(self, joint: Joint, quantity: str, reference: Reference, states: States) -> None:
        self._joint = joint
        self._quantity = quantity
        self._reference = reference
        self._states = states
        self._blocks = derive(joint.template)
        self._partials = partials(joint.template)
        self._expansion = NumericExpansion(joint, reference, states)
        angles = frozenset(
            frame.phi.name for frame in joint.template.frames if isinstance(frame, PlaneFrame)
        )
        partners = joint.written.partners()
        places = frozenset(
            item.name
            for item in joint.template.coordinates
            if isinstance(item, ex.VectorSymbol) and item.name.startswith("r_")
        )
        self._symbols = Symbols(angles, frozenset(joint.points), places, partners)
        self._parts = self._right_formulas()
        self._right = {place: self._values(place, item) for place, item in self._parts.items()}

    def faults(self) -> Iterator[NumericFault]:
        """Yield every fault that changes a number."""
        for fault in self.formulas():
            values = {place: self._values(place, item) for place, item in fault.result.items()}
            yield from self._if_different(fault.kind, fault.text, values)
        if self._quantity == "Phi_q":
            yield from self._exchanged_columns()
            yield from self._about_global_axes()
            yield from self._opposite_rows()
        else:
            yield from self._exchanged_rows()

    def other_vectors(self, given: Mapping[Index, Array]) -> Iterator[NumericFault]:
        """Yield body-fixed vectors that are no attributes, fitted to entries by hand, (N,) each.

        A formula is linear in each vector in its place. The vector is another one in each set of
        parameters, and all entries of its place are fitted together.
        """
        for place, expression in self._parts.items():
            row, column = self._corner(place)
            right = self._right[place]
            places = np.ndindex(*right.shape[1:])
            own = [(a, b) for a, b in places if (row + a, column + b) in given]
            if not own:
                continue
            wrong = right.copy()
            for a, b in own:
                wrong[:, a, b] = given[row + a, column + b]
            for name in sorted(self._symbols.vectors):
                if (off := self._offsets(place, expression, name, wrong - right)) is not None:
                    text = f"another vector stands where {name} belongs"
                    if np.allclose(off, off[0]):
                        text += f"; it is off by ({', '.join(f'{x:.4g}' for x in off[0])})"
                    result = {(row + a, column + b): wrong[:, a, b] for a, b in own}
                    yield Fault(Kind.OTHER_VECTOR, text, result)

    def _offsets(
        self, place: Index, expression: ex.Expression, name: str, off: Array
    ) -> Array | None:
        """Return what is added to a vector, by set of parameters; None if nothing explains it."""
        size = len(self._joint.points[name])

        def moved(offset: Array) -> Array:
            leaf, new = ex.VectorSymbol(name, size), Shifted(name, size, tuple(offset))
            changed = everywhere(expression, lambda node: new if node == leaf else None)
            return self._values(place, changed) - self._right[place]

        slopes = np.stack([moved(unit) for unit in np.eye(size)], axis=-1)
        twice = moved(np.full(size, 2.0))
        if not np.any(slopes) or not np.allclose(twice, 2 * slopes.sum(axis=-1), atol=ABSOLUTE):
            return None
        groups, found = self._states.group, []
        for group in np.unique(groups):
            matrix = slopes[groups == group].reshape(-1, size)
            numbers = off[groups == group].ravel()
            found.append(np.linalg.lstsq(matrix, numbers, rcond=None)[0])
            allowed = CLOSE * np.max(np.abs(off))
            if not np.allclose(matrix @ found[-1], numbers, rtol=CLOSE, atol=allowed):
                return None
        return np.array(found)

    def _if_different(
        self, kind: str, text: str, values: Mapping[Index, Array]
    ) -> Iterator[NumericFault]:
        """Yield a fault with the entries in which the values of its parts are wrong, if any."""
        entries: dict[Index, Array] = {}
        for place, item in values.items():
            right = self._right[place]
            item = np.broadcast_to(item, right.shape)
            same = is_alike(item, right).all(axis=0)
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

    def _values(self, place: Index, expression: ex.Expression) -> Array:
        b, k = place
        with np.errstate(all="ignore"):
            if self._quantity != "Phi_q":
                return component_values(expression, self._expansion)[..., None]
            columns = column_values(self._partials[b][k].columns(expression), self._expansion)
        if k % 2 == 0 or k // 2 >= len(self._joint.bodies):
            return columns
        return self._reference.in_axes(columns, self._joint.bodies[k // 2], self._states)

    def _corner(self, place: Index) -> Index:
        b, k = place
        size = self._joint.template.dimension
        rows = sum(size if isinstance(block.Phi, ex.Vector) else 1 for block in self._blocks[:b])
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
        if isinstance(self._joint.written, AbsoluteAngle | RelativeAngle):
            yield from _in_degrees(self._parts)

    def _faults_of_part(
        self, place: Index, expression: ex.Expression
    ) -> Iterator[Fault[ex.Expression]]:
        name = self._quantity
        if name == "Phi_q":
            name = f"the derivative by {described(self._joint.template.coordinates[place[1]])}"
        zero = ex.ZERO_VECTOR if isinstance(expression, ex.Vector) else ex.ZERO
        yield from whole_faults(
            self._quantity, name, lambda factor: times(factor, expression) if factor else zero
        )
        yield from one_place(_joined(expression), self._symbols)
        terms = collected(expression)
        if isinstance(expression, ex.Scalar) and sum(len(term.rates) for term in terms) > 1:
            yield from one_place(total(tuple(term.expression for term in terms)), self._symbols)
        if self._quantity == "gamma":
            yield from wrong_velocities(terms)
        if self._quantity == "gamma":
            yield from missing_parts(self._blocks[place[0]])

    def _exchanged_blocks(self) -> Iterator[Fault[Parts]]:
        other = {0: 2, 1: 3, 2: 0, 3: 1}
        swapped = {(b, k): self._parts[b, other[k]] for b, k in self._parts if k in other}
        text = "the blocks of bodies i and j are exchanged"
        yield Fault(Kind.BLOCKS, text, swapped)
        for b in range(len(self._blocks)):
            yield Fault(
                Kind.BLOCKS, text, {place: swapped[place] for place in swapped if place[0] == b}
            )
            angles = {place: swapped[place] for place in ((b, 1), (b, 3))}
            yield Fault(Kind.BLOCKS, "the derivatives by phi_i and phi_j are swapped", angles)

    def _opposite_rows(self) -> Iterator[NumericFault]:
        """Yield the Jacobians with a row that has another sign than Phi."""
        for b in range(len(self._blocks)):
            own = {place: item for place, item in self._right.items() if place[0] == b}
            count = own[b, 0].shape[1]
            for signs in (*(1 - 2 * np.eye(count)), -np.ones(count))[count == 1 :]:
                values = {place: item * signs[:, None] for place, item in own.items()}
                text = "all its entries have the wrong sign"
                yield from self._if_different(Kind.SIGN, text, values)

    def _exchanged_rows(self) -> Iterator[NumericFault]:
        rows = np.concatenate([*self._right.values()], axis=1)
        starts = np.cumsum([item.shape[1] for item in self._right.values()])[:-1]
        for a, b in combinations(range(rows.shape[1]), 2):
            swapped = rows.copy()
            swapped[:, [a, b]] = rows[:, [b, a]]
            values = dict(zip(self._right, np.split(swapped, starts, axis=1), strict=True))
            text = f"its rows {a + 1} and {b + 1} are swapped"
            yield from self._if_different(Kind.ROWS, text, values)

    def _exchanged_columns(self) -> Iterator[NumericFault]:
        """Yield the Jacobians with the columns of x and y in each other's place."""
        for k, coordinate in enumerate(self._joint.template.coordinates):
            if not isinstance(coordinate, ex.VectorSymbol):
                continue
            places = [(b, k) for b in range(len(self._blocks))]
            for kind, text, order in _ORDERS[coordinate.size]:
                text = f"{text} of {described(coordinate)}"
                for chosen in (*([place] for place in places), places):
                    swapped = {place: self._right[place][..., order] for place in chosen}
                    yield from self._if_different(kind, text, swapped)

    def _about_global_axes(self) -> Iterator[NumericFault]:
        """Yield the Jacobians with small rotations about the global axes, Phi_pi = Phi_pi' A^T."""
        turned: dict[Index, Array] = {}
        for k, frame in enumerate(self._joint.template.frames):
            if isinstance(frame, TurnedFrame):
                entries = np.broadcast_arrays(*self._expansion.entries(frame.rotation))
                back = np.stack(entries).reshape(3, 3, -1).transpose(2, 1, 0)
                places = [(b, 2 * k + 1) for b in range(len(self._blocks))]
                turned |= {place: self._right[place] @ back for place in places}
        text = "the small rotations are about the global axes, not about those of the body"
        for chosen in (*([place] for place in turned), list(turned)):
            values = {place: turned[place] for place in chosen}
            yield from self._if_different(Kind.GLOBAL_OMEGA, text, values)


def _faults_everywhere(parts: Parts, symbols: Symbols) -> Iterator[Fault[Parts]]:
    """Yield the formulas with one symbol mistaken for another wherever it occurs."""
    leaves: dict[ex.Expression, None] = {}

    def collect(node: ex.Expression) -> None:
        match node:
            case ex.VectorSymbol():
                leaves[node] = None
            case ex.Rotated(PlaneRotation(ex.Symbol())):
                leaves[replace(node, vector=_ANY)] = None
            case ex.Rotated(EulerRotation(), _, ()):
                leaves[replace(node, vector=_ANY)] = None

    _changed(parts, collect)
    for leaf in leaves:
        for fault in swaps(leaf, symbols):
            result = _changed(parts, partial(_replaced, leaf, fault.result))
            yield Fault(fault.kind, f"{fault.text}, throughout", result)
    yield from _exchanged_names(parts, symbols)


def _same_slips(parts: Parts, symbols: Symbols) -> Iterator[Fault[Parts]]:
    """Yield the formulas with the same slip for every body."""

    def slip(kind: str, node: ex.Expression) -> ex.Expression | None:
        if kind == Kind.MISSING_SQUARE:
            is_square = isinstance(node, ex.Power) and node.exponent == 2 and is_rate(node)
            return node.base if isinstance(node, ex.Power) and is_square else None
        if not isinstance(node, ex.Rotated | ex.RotationSlope | ex.VectorSymbol):
            return None
        return next((item.result for item in swaps(node, symbols) if item.kind == kind), None)

    texts = {
        Kind.A_FOR_B: "A stands where B belongs, or B where A, for every body",
        Kind.TRANSPOSED: "the rotations of all bodies are transposed",
        Kind.SINE_COSINE: "sine and cosine are swapped for every body",
        Kind.TILDE: "the sign of the tilde is wrong for every body",
        Kind.GLOBAL_OMEGA: "the global omega stands where the body's own omega' belongs, "
        "for every body",
        Kind.MISSING_SQUARE: "w stands where w^2 belongs, for every body",
    }
    for kind, text in texts.items():
        yield Fault(kind, text, _changed(parts, partial(slip, kind)))
    for belongs, stands in (("positions", "velocities"), ("velocities", "positions")):
        text = f"{stands} stand where {belongs} belong, for every body"
        yield Fault(Kind.MIXED_RATES, text, _changed(parts, partial(_instead, belongs)))


def _instead(belongs: str, node: ex.Expression) -> ex.Expression | None:
    """Return the velocity of a position, or the position of a velocity that belongs there."""
    other = rate_or_position(node)
    is_velocity = isinstance(node, ex.VectorSymbol) and node.name.endswith(rate(""))
    return other if is_velocity == (belongs == "velocities") else None


def _in_degrees(parts: Parts) -> Iterator[Fault[Parts]]:
    """Yield the formulas of a driven angle whose author mixes degrees and radians."""
    per_degree = (ex.Number(Fraction(1, 180)), ex.Pi())
    for text, factors in (
        (
            "the driver is in degrees, and the angle in radians",
            (ex.Number(Fraction(180)), ex.Power(ex.Pi(), -1)),
        ),
        ("the driver is in radians already: pi/180 is too much", per_degree),
    ):

        def change(
            node: ex.Expression, factors: tuple[ex.Scalar, ...] = factors
        ) -> ex.Expression | None:
            return ex.Product((*factors, node)) if isinstance(node, ex.TimeFunction) else None

        yield Fault(Kind.DRIVER_DEGREES, text, _changed(parts, change))


def _joined(expression: ex.Expression) -> ex.Expression:
    """Return a sum with equal terms joined, as it is written: one slip is in both of them."""
    if not isinstance(expression, ex.Sum):
        return expression
    numbers: dict[tuple[ex.Scalar, ...], Fraction] = {}
    for term in expression.terms:
        number, factors = ex.split_coefficient(term)
        numbers[tuple(factors)] = numbers.get(tuple(factors), Fraction(0)) + number
    return ex.Sum(tuple(ex.product_of((ex.Number(n), *rest)) for rest, n in numbers.items() if n))


def _changed(parts: Parts, change: Callable[[ex.Expression], ex.Expression | None]) -> Parts:
    return {place: everywhere(item, change) for place, item in parts.items()}


def _replaced(leaf: ex.Expression, new: ex.Expression, node: ex.Expression) -> ex.Expression | None:
    """Return the replacement of a vector, or of a rotation whichever vector it turns."""
    if not isinstance(leaf, ex.Rotated):
        return new if node == leaf else None
    if isinstance(node, ex.Rotated) and replace(node, vector=_ANY) == leaf:
        return everywhere(new, lambda inner: node.vector if inner == _ANY else None)
    return None


def _exchanged_names(parts: Parts, symbols: Symbols) -> Iterator[Fault[Parts]]:

    def angles(node: ex.Expression) -> ex.Expression | None:
        match node:
            case ex.Rotated(PlaneRotation(ex.Symbol(name))) if other := symbols.other_angle(name):
                return replace(node, rotation=PlaneRotation(ex.Symbol(other)))
        return None

    def points(node: ex.Expression) -> ex.Expression | None:
        if isinstance(node, ex.VectorSymbol) and (partner := symbols.partners.get(node.name)):
            return ex.VectorSymbol(partner, node.size)
        return None

    if symbols.angles == {"phi_i", "phi_j"}:
        text = "phi_i and phi_j are exchanged throughout"
        yield Fault(Kind.MIXED_ANGLES, text, _changed(parts, angles))
    text = "the points of bodies i and j are exchanged throughout"
    yield Fault(Kind.MIXED_POINTS, text, _changed(parts, points))
