"""J, J_dot, effort and x by hand against those of a transmission: laid out, judged, explained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import sympy
from scipy.optimize import linear_sum_assignment  # type: ignore[attr-defined]

from kincompile.checker.agreement import (
    OF_ROW,
    ON_MANIFOLD,
    agrees,
    finite,
    is_close,
    tolerance,
)
from kincompile.checker.comparison import Convention, Diagnosis
from kincompile.checker.conventions import LOAD
from kincompile.checker.diagnosis import defined, looked_up
from kincompile.checker.entry_faults import TypedEntry
from kincompile.checker.fault import Fault, Kind
from kincompile.checker.judged import UNEXPLAINED, Judged, Laid
from kincompile.checker.reference import OF_TRANSMISSIONS
from kincompile.checker.transmission_faults import Matrix, MatrixFaults, misread, missing_terms
from kincompile.checker.transmission_maps import KINDS, Map, maps_at, turned
from kincompile.checker.transmission_reference import PoseStates
from kincompile.files.safe_expressions import extent
from kincompile.model.expressions import symbol_names
from kincompile.names import listed, rate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from kincompile.checker.conventions import Stated
    from kincompile.checker.fault import Index, NumericFault
    from kincompile.checker.judged import Spot
    from kincompile.checker.states import Array, States
    from kincompile.checker.transmission_reference import TransmissionReference
    from kincompile.checker.written import Written

Names = Sequence["str | None"]

MOST_PERMUTED = 16
"""Rows and columns whose order is looked for; that takes as many trials as rows squared."""
MOST_TAKEN_APART = 4000
"""Parts of the formulas that are corrected one by one; of longer ones the first entries are."""
NOT_ENERGY = "energy is not conserved: effort is not J^T of the velocities"


@dataclass(frozen=True, eq=False)
class LaidMap(Laid):
    """A quantity of a transmission as it is laid out: which map it is, and in which order."""

    quantity: str
    map: Map
    order: tuple[tuple[int, ...], tuple[int, ...]]  # of its rows and its columns

    def taken(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> LaidMap:
        """Return the quantity, laid out plainly so far, with other right rows and columns."""
        return replace(
            self,
            right=self.right[:, list(rows)][:, :, list(columns)],
            rows=[self.map.rows[k] for k in rows],
            columns=[self.map.columns[k] for k in columns],
            order=(rows, columns),
        )

    @property
    def matrix(self) -> Matrix:
        """The matrix by hand beside the right one."""
        rows, columns = tuple(self.rows), tuple(self.columns)
        return Matrix(self.quantity, self.given.values, self.right.values, rows, columns)

    def conventions(self) -> Iterator[Convention]:
        """Yield what is another way of writing."""
        if text := KINDS.get(self.map.kind, ""):
            yield Convention(self.map.kind, f"{self.quantity}: {text}.")
        if np.any(self.right.values != self.arranged(self.map.right.values)):
            text = f"{self.quantity}: angles are those of the mechanism but for whole turns."
            yield Convention("whole turns", text)
        for what, order, names in zip(
            ("rows", "columns"), self.order, (self.rows, self.columns), strict=True
        ):
            if list(order) != sorted(order):
                text = f"{self.quantity}: the {what} have another order: {listed(names, 30)}."
                yield Convention(f"order of {what}", text)

    def arranged(self, values: Array) -> Array:
        """Return values of the map, (N, rows, columns), in this order."""
        rows, columns = self.order
        found: Array = values[:, list(rows)][:, :, list(columns)]
        return found


class TransmissionComparer(Judged):
    """One comparison at some poses, from the layout to the report."""

    _reference: TransmissionReference
    _states: PoseStates

    def __init__(
        self,
        reference: TransmissionReference,
        readings: Mapping[str, Sequence[Written]],
        states: States,
        stated: Stated,
        strict: bool,
        convention: Convention | None = None,
    ) -> None:
        assert isinstance(states, PoseStates)
        super().__init__(reference, states, strict, convention)
        self._stated = stated
        self._maps = maps_at(
            reference, states, with_rates="J_dot" in readings, is_load=stated.is_load
        )
        self._faults = MatrixFaults(reference, states)
        self._found: dict[str, LaidMap] = {}
        for name in sorted(readings, key=OF_TRANSMISSIONS.index):  # J first: others belong to it
            self._found[name] = self._best(name, readings[name])
        self._adopt({
            name: replace(
                laid, is_plain=[not (convention or [*laid.conventions()])] * len(laid.rows)
            )
            for name, laid in self._found.items()
        })  # fmt: skip

    def _conventions(self) -> Iterator[Convention]:
        found = [item for laid in self._found.values() for item in laid.conventions()]
        return iter(dict.fromkeys(found))

    def _best(self, name: str, readings: Sequence[Written]) -> LaidMap:
        """Return the layout with the fewest mistakes, the plain one first."""
        best: LaidMap | None = None
        for written in readings:
            given = written.evaluate(self._states)
            for item in self._candidates(name, written):
                if written.shape != (len(item.rows), len(item.columns)):
                    continue
                right = item.right
                if name == "x":
                    right = turned(given.values, right, self._angular)
                plain = LaidMap(written, given, right, (), (), (), name, item, ((), ()))
                order = tuple(range(len(item.rows))), tuple(range(len(item.columns)))
                found = self._ordered(plain.taken(*order))
                if best is None or _is_better(found, best):
                    best = found
        assert best is not None, "shapes are checked before"
        return best

    @cached_property
    def _angular(self) -> Array:
        """Which outputs are angles, (n,)."""
        f = self._reference.f
        return np.array([f.units[name] == "rad" for name in f.outputs])

    def _candidates(self, name: str, written: Written) -> list[Map]:
        """Return the maps that a quantity may be: the one that is stated, or all."""
        found = self._maps[name]
        if name == "effort" and len(found) > 1:
            named = [item for item in found if item.effort in written.arguments]
            uses = any(written.uses(f"tau_{item}") for item in self._reference.f.outputs)
            return named or (found[:1] if uses else found)
        if name not in ("J", "J_dot"):
            return found
        stated = self._stated.kind or (found[0].kind if self._strict else "")
        laid = self._found.get("J")
        if name == "J_dot" and laid is not None and not laid.wrong_count:
            stated = laid.map.kind  # it is the rate of that J
        return [item for item in found if stated in ("", item.kind)]

    def _ordered(self, plain: LaidMap) -> LaidMap:
        """Return rows and columns in the order in which they are right, if there is one.

        Beside a J that is right its order is that of J_dot; that of effort and x may be too.
        """
        velocities, (count, width) = self._found.get("J"), plain.equal.shape
        if self._strict or max(count, width) > MOST_PERMUTED:
            return plain
        if velocities is not None and not velocities.wrong_count:
            names = velocities.rows, velocities.columns
            own = plain.taken(*(_order(x, names) for x in (plain.map.rows, plain.map.columns)))
            return (
                own if plain.quantity == "J_dot" or own.wrong_count < plain.wrong_count else plain
            )
        best = plain
        for rows, columns in _orders(plain) if plain.wrong_count else ():
            other = plain.taken(rows, columns)
            if _is_better(other, best):
                best = other
        return best

    def _later(self, spot: Spot) -> Callable[[], str]:
        """Return what gives a right value as text: a loop's formula is known by numbers alone."""
        name, row, column = spot
        right = self._laid[name].right.values[0, row, column]
        inputs = zip(self._reference.f.inputs, self._states.u[0], strict=True)
        where = ", ".join(f"{name} = {value:.6g}" for name, value in inputs)
        return lambda: f"{right:.9g} at {where}"

    def _diagnoses(self) -> dict[Spot, tuple[Diagnosis, ...]]:
        found: dict[Spot, tuple[Diagnosis, ...]] = {}
        for name, laid in self._found.items():
            added = f"; {self._energy[name]}." if name in self._energy else "."
            for place, items in self._explained(laid).items():
                spot = (name, *place)
                found[spot] = tuple(
                    replace(item, text=item.text.removesuffix(".") + added)
                    for item in items or (self._unexplained(spot),)
                )
        return found

    def _explained(self, laid: LaidMap) -> dict[Index, tuple[Diagnosis, ...]]:
        """Return the explanations of the entries that differ, none of what has no name."""
        left, found = defined(laid.shown(self._different(laid.quantity)))
        if not left:
            return found
        lost, parts = tolerance(laid.given, laid.right), 0

        def entry_of(place: Index) -> TypedEntry | None:
            nonlocal parts
            expression, (i, j) = laid.written.formula(*place), place
            parts += extent(expression)[0] if expression is not None else 0
            if expression is None or parts > MOST_TAKEN_APART:
                return None
            right = laid.right.values[:, i, j], lost[:, i, j]
            return TypedEntry(self._reference, laid.quantity, expression, self._states, right)

        faults, several = [*self._of_matrix(laid)], [*self._of_names(laid)]
        return found | looked_up(left, laid.right.values, faults, several, entry_of, tuple)

    def _unexplained(self, spot: Spot) -> Diagnosis:
        """Return the sentence about an entry outside the catalogue."""
        laid = self._found[spot[0]]
        if laid.quantity == "x" and self._is_another_assembly(laid):
            text = "these are the outputs of another assembly, on another branch."
            return Diagnosis(Kind.BRANCH, text)
        text = "no fault of the catalogue fits."
        if not laid.written.arguments and laid.written.expressions is None:
            text += " The values of an array belong to states: give states={'u': ...}."
        return Diagnosis(UNEXPLAINED, text)

    def _is_another_assembly(self, laid: LaidMap) -> bool:
        """Return whether outputs are those of another assembly, at two poses."""
        f, states, own = self._reference.f, self._states, self._reference.own
        for k in range(min(2, len(states))):
            p = dict(zip(own, states.p[k], strict=False))
            given = laid.given.values[k, :, 0]
            others = f.assemblies(states.u[k], p=p)[:, list(laid.order[0])]
            off = others - given
            turns = np.round(off / (2 * np.pi)) * self._angular[list(laid.order[0])]
            off = np.abs(off - 2 * np.pi * turns)
            if not np.any(np.all(off <= ON_MANIFOLD * (1 + np.abs(given)), axis=-1)):
                return False
        return True

    def _of_names(self, laid: LaidMap) -> Iterator[NumericFault]:
        if laid.written.takes_states:
            yield from misread(self._reference, self._states, laid.written, laid.right.values)

    def _of_matrix(self, laid: LaidMap) -> Iterator[NumericFault]:
        """Yield the faults of a whole quantity."""
        matrix = laid.matrix
        for other in self._maps[laid.quantity] if laid.map.is_matrix else ():
            if other.kind != laid.map.kind and other.right.values.shape == matrix.right.shape:
                kind = Kind.INVERSE if "du/dx" in other.kind else Kind.WHOLE_TRANSPOSED
                text = f"{KINDS[other.kind] or 'this is J: dx/du'}, and not {laid.map.kind}"
                if laid.quantity == "J_dot":
                    text = f"this is the rate of {other.kind}, and not that of {laid.map.kind}"
                yield from matrix.fault(kind, text, other.right.values)
        if laid.quantity == "effort":
            yield from self._of_effort(laid)
        if laid.quantity == "J_dot":
            yield from missing_terms(self._terms(laid), matrix)
        yield from self._faults.of(matrix)

    def _terms(self, laid: LaidMap) -> dict[str, Array]:
        """Return the terms of J_dot by rate, in the author's J if that is right, else by inputs."""
        velocities, names = self._found.get("J"), map(rate, self._reference.f.inputs)
        own = {name: laid.arranged(item) for name, item in zip(names, laid.map.terms, strict=True)}
        known = (
            velocities is not None
            and not velocities.wrong_count
            and velocities.map.kind == laid.map.kind
        )
        if velocities is None or not known or velocities.written.expressions is None:
            return own
        places = {
            (row, column): velocities.written.formula(i, k)
            for i, row in enumerate(velocities.rows)
            for k, column in enumerate(velocities.columns)
        }
        rows, columns = laid.rows, laid.columns
        formulas = [places[row, column] for row in rows for column in columns]
        values = self._reference.inputs(self._states)
        symbols = {item for formula in formulas if formula for item in symbol_names(formula)}
        for symbol in sorted(symbols):
            if (name := rate(symbol)) in values:
                slopes = [sympy.diff(item, sympy.Symbol(symbol)) for item in formulas]
                found = self._reference.evaluate(slopes, self._states)[0] * values[name][:, None]
                own[name] = found.reshape(-1, len(rows), len(columns))
        return own

    def _of_effort(self, laid: LaidMap) -> Iterator[NumericFault]:
        """Yield the faults of the matrix that effort is of the other side's efforts."""
        vector = laid.matrix
        text = "effort has the wrong sign"
        if not self._stated.is_load:
            text += f'; if {laid.map.effort} is a load, state effort = "{LOAD}" in [conventions]'
        yield from vector.fault(Kind.SIGN, text, -laid.right.values)
        matrix = self._effort_matrix(laid)
        if matrix is None:
            return
        f, tau, right = self._reference.f, laid.map.tau, laid.map.matrix
        transposed = np.swapaxes(right, 1, 2)
        ends = f.outputs if laid.map.effort == "tau_x" else f.inputs
        names = tuple(f"tau_{name}" for name in ends)
        right_rows = right[:, list(laid.order[0])]
        own = Matrix("effort", matrix, right_rows, tuple(laid.rows), names, is_of_terms=True)
        if right.shape[1] == right.shape[2]:
            inverse = np.linalg.inv(right)
            for kind, text, other in (
                (Kind.WHOLE_TRANSPOSED, "J", transposed),
                (Kind.INVERSE, "the inverse of J", np.swapaxes(inverse, 1, 2)),
                (Kind.INVERSE, "the transpose of the inverse of J", inverse),
            ):
                values = (other @ tau[..., None])[:, list(laid.order[0])]
                yield from vector.fault(kind, f"{text} stands where J^T belongs", values)
        # A fault of some entries of the matrix shows in the rows of effort in which they are.
        for fault in self._faults.of(own):
            values = own.right.copy()
            for (i, j), item in fault.result.items():
                values[:, i, j] = item
            if all(
                is_close(values[:, i, j], own.given[:, i, j])
                for i in {i for i, _ in fault.result}
                for j in range(values.shape[2])
            ):
                rows = {(i, 0): laid.given.values[:, i, 0] for i, _ in fault.result}
                yield Fault(fault.kind, fault.text, rows)

    def _effort_matrix(self, laid: LaidMap) -> Array | None:
        """Return the matrix by hand, (N, rows, columns), None where effort is no such product."""
        if not laid.written.takes_states:
            return None
        tau = laid.map.tau
        columns = []
        for unit in np.eye(tau.shape[1]):
            changed = replace(self._states, **{laid.map.effort: np.tile(unit, (len(tau), 1))})
            columns.append(laid.written.evaluate(changed).values[:, :, 0])
        matrix = np.stack(columns, axis=-1)
        found = np.einsum("kij,kj->ki", matrix, tau)
        lost = tolerance(laid.given, laid.right)[:, :, 0]
        off = np.abs(found - laid.given.values[:, :, 0])
        return matrix if np.all(off <= 10 * (lost + finite(OF_ROW * np.abs(found)))) else None

    @cached_property
    def _energy(self) -> dict[str, str]:
        """What is to be said of J and effort where they do not belong together."""
        velocities, effort = self._found.get("J"), self._found.get("effort")
        if effort is None or (
            not effort.wrong_count and (velocities is None or not velocities.wrong_count)
        ):
            return {}
        if velocities is None:
            return {"effort": NOT_ENERGY}
        if not velocities.wrong_count:
            return {"effort": f"{NOT_ENERGY}; J is right"}
        if not effort.wrong_count:
            return {"J": f"{NOT_ENERGY}; effort is right"}
        if self._belongs(velocities, effort):
            return {"effort": "it is J^T of your J, which is wrong: energy is conserved"}
        return {"effort": NOT_ENERGY}

    def _belongs(self, velocities: LaidMap, effort: LaidMap) -> bool:
        """Return whether the effort by hand is J^T of the J by hand."""
        matrix = self._effort_matrix(effort)
        own = np.empty_like(velocities.map.right.values)
        rows, columns = np.ix_(*velocities.order)
        own[:, rows, columns] = velocities.given.values
        own = velocities.map.as_J(own)
        if matrix is None or effort.map.effort != "tau_x":
            return False
        by_row = np.empty_like(matrix)
        by_row[:, list(effort.order[0])] = -matrix if self._stated.is_load else matrix
        return all(
            is_close(by_row[:, i, j], own[:, j, i]) for i, j in np.ndindex(*by_row.shape[1:])
        )


def _order(own: Names, orders: Sequence[Names]) -> tuple[int, ...]:
    """Return rows or columns in the order that another quantity has for their names."""
    names = next((x for x in orders if set(x) == set(own)), own)
    return tuple(map(own.index, names))


def _orders(plain: LaidMap) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Yield the right rows and columns that rows and columns by hand may be.

    Each row is taken for each right one. The entries that both have say which columns they are;
    with these all rows are found, and with the rows all columns.
    """
    given, right = plain.given[:, :, None, :, None], plain.right[:, None, :, None, :]
    equal = np.all(agrees(given, right), axis=0)  # by row, right row, column and right column
    count, _, width, _ = equal.shape
    every = np.arange(count), np.arange(width)
    alike = equal.any(axis=1).mean(axis=0)  # what columns share, in whatever rows
    for row, other in product(range(count), repeat=2):
        columns = _assigned(equal[row, other] + 0.5 * alike) if count > 1 else every[1]
        for _ in range(2):
            rows = _assigned(equal[:, :, every[1], columns].sum(axis=2))
            columns = _assigned(equal[every[0], rows].sum(axis=0)) if count > 1 else columns
        yield tuple(rows.tolist()), tuple(columns.tolist())


def _assigned(score: Array) -> Array:
    """Return which column each row is assigned to, by the largest sum; its own where it may be."""
    size = len(score)
    return np.asarray(linear_sum_assignment(score + np.eye(size) / (4 * size), maximize=True)[1])


def _is_better(other: LaidMap, best: LaidMap) -> bool:
    """Return whether a layout explains all that another one does, and most of the rest."""
    if other.wrong_count >= best.wrong_count:
        return False
    is_most = 2 * other.wrong_count <= other.equal.size
    same = other.equal.shape == best.equal.shape
    return is_most and (not same or bool(np.all(other.equal[best.equal])))
