"""Conventions: what may differ between two right answers, found by numeric matching and named.

Phi and Phi_q say how an author wrote the rows: their order, signs and scales. nu and gamma have to
follow. So a row of gamma with the opposite sign is a convention where Phi_q has that sign as well,
and a mistake where it has not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compare.agreement import ABSOLUTE, agrees, multiple
from kincompile.compare.layouts import Layout, other_layouts, usual_layout
from kincompile.compare.rows import RowTable, checked_columns
from kincompile.compare.vectors import joint_values, with_roles_exchanged
from kincompile.model.resolve import Joint
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.compare.hand import Hand
    from kincompile.compare.reference import Block, Reference
    from kincompile.compare.states import Array, States

DEGREE = np.pi / 180
_ALIKE = 1e-7  # between rows of length 1, to sort the layouts that are examined
_MOST_TRIED = 24


@dataclass(frozen=True, slots=True)
class Convention:
    """A way of writing in which a hand derivation differs from the generated one.

    Attributes
    ----------
    kind
        For instance ``row sign``.
    text
        A sentence for people.
    rows
        Names of the equations that it concerns; empty where it concerns all.
    """

    kind: str
    text: str
    rows: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Scope:
    """What is compared: which equations, of one constraint or of the whole system, and where."""

    reference: Reference
    block: Block | None
    states: States

    @property
    def rows(self) -> tuple[int, ...]:
        """The equations."""
        if self.block is not None:
            return self.block.rows
        return tuple(range(len(self.reference.equations)))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The constraints."""
        return self.reference.blocks if self.block is None else (self.block,)


@dataclass(frozen=True, slots=True)
class Units:
    """Whether a hand derivation takes angles in degrees, and derives by degrees."""

    takes_degrees: bool = False
    per_degree: bool = False

    def column_factors(self, reference: Reference) -> Array:
        """Return what the columns of Phi_q are multiplied by, shape (n,)."""
        return np.where(reference.angular & self.per_degree, DEGREE, 1.0)

    @property
    def text(self) -> str:
        """What to tell the author."""
        parts = ["angles are taken in degrees"] if self.takes_degrees else []
        parts += ["derivatives are per degree"] if self.per_degree else []
        return "; ".join(parts)


@dataclass(frozen=True)
class Matching:
    """How the hand side is laid out against the generated side.

    Attributes
    ----------
    layout, units
        Columns of Phi_q, and the unit of angles.
    rows
        Generated equation of each row, as a position among the scope's rows.
    factors
        hand = factor * generated, by row and state, shape (rows, N).
    exchanged
        Positions of the rows whose constraint has the roles of its bodies exchanged.
    signs
        -1 for nu or gamma where the whole vector has the opposite sign.
    """

    layout: Layout
    units: Units
    rows: tuple[int, ...]
    factors: Array
    exchanged: frozenset[int] = frozenset()
    signs: Mapping[str, float] | None = None

    def sign(self, quantity: str) -> float:
        """Return the sign of a whole quantity."""
        return (self.signs or {}).get(quantity, 1.0)

    def is_plain(self, quantity: str, row: int) -> bool:
        """Return whether no convention concerns a row of a quantity."""
        return (
            not self.units.text
            and not (quantity == "Phi_q" and self.layout.convention)
            and self.rows[row] == row
            and row not in self.exchanged
            and self.sign(quantity) == 1
            and bool(np.all(self.factors[row] == 1))
        )


class Matcher:
    """Finds the matching that explains the most, the plain one first."""

    def __init__(self, scope: Scope, hands: Mapping[str, Hand]) -> None:
        self._scope = scope
        self._hands = hands
        self._reference = scope.reference

    def match(self) -> Matching:
        """Return how the hand side is laid out."""
        usual = self._usual_layout()
        best = self._rows_matched(usual, Units())
        for units in (Units(True, False), Units(True, True), Units(False, True)):
            if not best.is_whole and self._reference.angular.any():
                best = best.better(self._rows_matched(usual, units))
        if "Phi_q" in self._hands and best.share < 0.5:
            for layout in self._promising(usual):
                best = best.better(self._rows_matched(layout, Units()))
                if best.is_whole:
                    break
        # A relative angle counted from the other body flips nu as well: its roles come first.
        matching = self._with_signs(self._with_roles(best.matching))
        return self._with_roles(matching)

    def _promising(self, usual: Layout) -> list[Layout]:
        """Return the other layouts that are worth a closer look, the best first.

        The look at all of them is quick: rows in the usual order, each divided by its length.
        Where rows and columns both have another order, it sees nothing; then a few are tried.
        """
        layouts = list(other_layouts(self._reference, usual, len(self._scope.rows)))
        values, _ = self._hands["Phi_q"].evaluate(self._scope.states)
        hand = _directions(np.nan_to_num(values))
        plain = np.ones(len(self._reference.coordinates))
        scores = []
        for layout in layouts:
            generated = _placed(self._values["Phi_q"], layout, plain)
            known = ~np.isnan(generated[0, 0])
            right = _directions(generated[..., known])
            # The columns of the ground count in the length of a row by hand, and only there.
            written = _directions(hand[..., known])
            close = np.minimum(np.abs(written - right).max(axis=(0, 2)),
                               np.abs(written + right).max(axis=(0, 2)))  # fmt: skip
            scores.append(int(np.sum(close <= _ALIKE)))
        if max(scores, default=0) == 0:
            return layouts[:_MOST_TRIED]
        order = sorted(range(len(layouts)), key=lambda k: -scores[k])
        return [layouts[k] for k in order[:_MOST_TRIED]]

    def expected(self, matching: Matching, states: States) -> dict[str, Array]:
        """Return what each quantity should be, by its author's conventions, (N, rows, columns).

        Columns of the ground hold NaN.
        """
        generated = self._generated(states, matching)
        rows = list(matching.rows)
        result = {}
        for quantity in self._hands:
            values = generated[quantity][:, rows] * matching.sign(quantity)
            if quantity == "Phi_q":
                values = _placed(
                    values, matching.layout, matching.units.column_factors(self._reference)
                )
            result[quantity] = values * self._factors(matching, states)[:, :, None]
        return result

    def written(self, matching: Matching, states: States) -> dict[str, tuple[Array, Array]]:
        """Return values and sizes of the hand side, (N, rows, columns) each."""
        if matching.units.takes_degrees:
            states = states.in_degrees(self._reference.angular)
        return {name: hand.evaluate(states) for name, hand in self._hands.items()}

    def _factors(self, matching: Matching, states: States) -> Array:
        """Return the factors of the rows at any states with the parameters of the comparison."""
        by_group = dict(zip(self._scope.states.group.tolist(), matching.factors.T, strict=True))
        return np.stack([by_group[k] for k in states.group.tolist()])

    def _usual_layout(self) -> Layout:
        if "Phi_q" not in self._hands:
            return Layout(tuple(range(len(self._reference.coordinates))))
        width = self._hands["Phi_q"].shape[1]
        layout = usual_layout(self._reference, self._scope.block, width)
        assert layout is not None, "shapes are checked before"
        return layout

    @cached_property
    def _values(self) -> dict[str, Array]:
        values = self._reference.values(self._scope.states)
        rows = list(self._scope.rows)
        return {name: values.of(name)[:, rows] for name in ("Phi", "Phi_q", "nu", "gamma")}

    def _generated(self, states: States, matching: Matching) -> dict[str, Array]:
        """Return the generated quantities of the scope, in the roles the author gave."""
        if states is self._scope.states:
            values = dict(self._values)
        else:
            found = self._reference.values(states)
            rows = list(self._scope.rows)
            values = {name: found.of(name)[:, rows] for name in self._values}
        for block in self._scope.blocks:
            positions = self._positions(block)
            if matching.exchanged.issuperset(positions) and positions:
                other = self._exchanged(block, states)
                assert other is not None
                for name in values:
                    values[name] = values[name].copy()
                    values[name][:, positions] = other[name]
        return values

    def _positions(self, block: Block) -> list[int]:
        first = self._scope.rows[0]
        return [row - first for row in block.rows]

    def _exchanged(self, block: Block, states: States) -> dict[str, Array] | None:
        """Return a constraint's quantities with the roles of bodies i and j exchanged."""
        if not isinstance(block.constraint, Joint):
            return None
        other = with_roles_exchanged(block.constraint)
        if other is None:
            return None
        found = joint_values(other, self._reference, states)
        Phi_q = np.zeros((len(states), len(block.rows), len(self._reference.coordinates)))
        for k, name in enumerate(other.columns):
            if name is not None:
                Phi_q[:, :, self._reference.coordinates.index(name)] = found.Phi_q[:, :, k]
        vectors = {"Phi": found.Phi, "nu": found.nu, "gamma": found.gamma}
        return {"Phi_q": Phi_q, **{name: item[..., None] for name, item in vectors.items()}}

    def _rows_matched(self, layout: Layout, units: Units) -> _Candidate:
        """Find order and factors of the rows under a layout."""
        count = len(self._scope.rows)
        plain = Matching(
            layout, units, tuple(range(count)), np.ones((count, len(self._scope.states)))
        )
        written = self.written(plain, self._scope.states)
        signature = [name for name in ("Phi_q", "Phi") if name in self._hands]
        may_scale = bool(signature)
        signature = signature or list(self._hands)
        expected = {name: self._values[name] for name in signature}
        if "Phi_q" in expected:
            factors = units.column_factors(self._reference)
            expected["Phi_q"] = _placed(expected["Phi_q"], layout, factors)
        table = RowTable(
            [written[name] for name in signature],
            [expected[name] for name in signature],
            self._scope.states.group,
            may_scale,
        )
        rows, found = table.assigned()
        factors = np.stack([item.factor for item in found])
        matching = replace(plain, rows=tuple(rows), factors=factors)
        shares = [item.share for item in found]
        return _Candidate(matching, shares)

    def _with_signs(self, matching: Matching) -> Matching:
        """Find out whether nu or gamma has the opposite sign as a whole."""
        written = self.written(matching, self._scope.states)
        expected = self.expected(matching, self._scope.states)
        flipped, telling = {}, {}
        for name in ("nu", "gamma"):
            if name in self._hands:
                values, sizes = written[name]
                nonzero = np.any(np.abs(expected[name]) > ABSOLUTE, axis=(0, 2))
                opposite = agrees(values, sizes, -expected[name]).all(axis=(0, 2))
                flipped[name] = bool(nonzero.any()) and bool(opposite.all())
                telling[name] = int(nonzero.sum())
        # One row alone may be a slip. It is a convention where several agree, or all there is.
        every = all(flipped[name] for name in flipped if telling[name])
        signs = {name: -1.0 for name, is_flipped in flipped.items()
                 if is_flipped and (every or telling[name] > 1)}  # fmt: skip
        return replace(matching, signs=signs)

    def _with_roles(self, matching: Matching) -> Matching:
        """Exchange the roles of i and j in the constraints that this explains entirely.

        Phi or Phi_q has to show it: in gamma alone the exchange of a revolute joint is its sign.
        """
        if not {"Phi", "Phi_q"}.intersection(self._hands):
            return matching
        states = self._scope.states
        written = self.written(matching, states)
        right = self._right_rows(matching, written)
        for block in self._scope.blocks:
            positions = self._positions(block)
            rows = [k for k, target in enumerate(matching.rows) if target in positions]
            if all(right[k] for k in rows):
                continue
            trial = self._exchanged_trial(matching, block, positions, rows)
            if trial is not None and self._is_natural(trial, rows):
                now = self._right_rows(trial, written)
                if all(now[k] for k in rows):
                    matching = trial
        return matching

    def _is_natural(self, trial: Matching, rows: list[int]) -> bool:
        """Return whether the rows have the sign that the exchanged roles give them.

        Exchanged and written with the opposite sign, a relative angle has its usual Phi_q and a
        reversed nu: without Phi that is a driver's rate reversed.
        """
        return "Phi" in self._hands or bool(np.all(trial.factors[rows] > 0))

    def _exchanged_trial(
        self, matching: Matching, block: Block, positions: Sequence[int], rows: list[int]
    ) -> Matching | None:
        """Return the matching with one constraint exchanged and the factors that it then has."""
        if self._exchanged(block, self._scope.states) is None:
            return None
        factors = matching.factors.copy()
        factors[rows] = 1.0
        exchanged = matching.exchanged | frozenset(positions)
        trial = replace(matching, exchanged=exchanged, factors=factors)
        written = self.written(trial, self._scope.states)
        expected = self.expected(trial, self._scope.states)
        for name in ("Phi_q", "Phi"):
            if name in self._hands:
                values, sizes = written[name]
                for k in rows:
                    found = multiple(
                        *checked_columns(values[:, k], sizes[:, k], expected[name][:, k]),
                        self._scope.states.group,
                    )
                    factors[k] = found.factor
                break
        return replace(trial, factors=factors)

    def _right_rows(
        self, matching: Matching, written: Mapping[str, tuple[Array, Array]]
    ) -> list[bool]:
        """Return for every row whether all its quantities agree."""
        expected = self.expected(matching, self._scope.states)
        right = np.ones(len(matching.rows), dtype=bool)
        for name, (values, sizes) in written.items():
            equal = agrees(values, sizes, expected[name]) | np.isnan(expected[name])
            right &= np.asarray(equal.all(axis=(0, 2)))
        return [bool(item) for item in right]


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A matching, and how well it explains each row."""

    matching: Matching
    shares: list[float]

    @property
    def is_whole(self) -> bool:
        return all(share == 1.0 for share in self.shares)

    @property
    def share(self) -> float:
        """Share of the rows that are explained entirely."""
        return float(np.mean([share == 1.0 for share in self.shares]))

    def better(self, other: _Candidate) -> _Candidate:
        """Return the other one only where it explains more rows, and most of them."""
        return other if other.share > self.share and other.share >= 0.5 else self


def _directions(values: Array) -> Array:
    """Return rows of length 1; their signs stay."""
    length = np.sqrt(np.sum(values**2, axis=-1, keepdims=True))
    return np.asarray(values / np.where(length == 0, 1.0, length))


def _placed(values: Array, layout: Layout, factors: Array) -> Array:
    """Put the columns of Phi_q in the order of a layout."""
    absent = np.full(values.shape[:-1], np.nan)
    columns = [
        absent if column is None else values[..., column] * factors[column]
        for column in layout.columns
    ]
    return np.stack(columns, axis=-1)


def conventions_found(matching: Matching, names: Sequence[str]) -> tuple[Convention, ...]:
    """Return the conventions of a matching in words; `names` are those of the scope's equations."""
    found = []
    if matching.layout.convention:
        text = matching.layout.convention
        kind = "ground columns" if "ground" in text else "order of columns"
        found.append(Convention(kind, f"Phi_q: {text}."))
    if matching.units.text:
        found.append(Convention("degrees", f"{matching.units.text}."))
    moved = [k for k, target in enumerate(matching.rows) if k != target]
    if moved:
        pairs = listed([f"row {k + 1} is {names[matching.rows[k]]}" for k in moved], 30)
        rows = tuple(names[matching.rows[k]] for k in moved)
        found.append(Convention("order of rows", f"the rows have another order: {pairs}.", rows))
    found += _row_conventions(matching, names)
    for name, sign in (matching.signs or {}).items():
        if sign < 0:
            found.append(Convention(f"sign of {name}", f"{name} has the opposite sign throughout."))
    return tuple(found)


def _row_conventions(matching: Matching, names: Sequence[str]) -> list[Convention]:
    found = []
    exchanged = tuple(names[k] for k in sorted(matching.exchanged))
    if exchanged:
        text = f"{listed(exchanged)}: the roles of bodies i and j are exchanged."
        found.append(Convention("roles of i and j", text, exchanged))
    opposite, scaled = [], []
    for target, factor in zip(matching.rows, matching.factors, strict=True):
        if np.all(factor == -1):
            opposite.append(names[target])
        elif np.any(factor != 1):
            scaled.append((names[target], factor))
    if opposite:
        text = f"{listed(opposite)}: written with the opposite sign."
        found.append(Convention("row sign", text, tuple(opposite)))
    for name, factor in scaled:
        size = f"{factor[0]:.6g}" if np.ptp(factor) <= 1e-9 * abs(factor[0]) else (
            "a factor that depends on parameters"
        )  # fmt: skip
        text = f"{name}: written as {size} times the generated equation."
        found.append(Convention("row scale", text, (name,)))
    return found
