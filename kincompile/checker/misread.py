"""Faults that show in several entries, of any formulas: joints or free equations.

A coordinate that is read as another, or with the wrong sign, gives the right formulas at another
state. Columns that are exchanged are the right columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.checker.fault import Kind, showing
from kincompile.model.resolve import FreeEquation

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator

    from kincompile.checker.fault import NumericFault
    from kincompile.checker.reference import ConstraintBlock, Reference
    from kincompile.checker.states import Array, States

MOST_IN_PLANE = 3
"""Columns of a body."""
MOST_MISREAD = 14
"""Coordinates of which each is read as each other."""


@dataclass(frozen=True)
class Misread:
    """The formulas of a constraint, as they are when a part of them is taken for another."""

    reference: Reference
    block: ConstraintBlock
    quantity: str
    states: States
    right_at: Callable[[States], Array]  # the quantity of the system at states, (N, rows, columns)

    def faults(self) -> Iterator[NumericFault]:
        """Yield the formulas with one coordinate read as another, or with the wrong sign."""
        base, states = self.reference.base, self.states
        names, columns = base.coordinates, self.block.constraint.columns
        own = [base.columns[name] for name in columns if name in base.columns]
        for k in own:
            kind, text = self._reversed(names[k])
            back = replace(states, q=_with(states.q, k, -states.q[:, k]))
            yield from self._read(kind, text, back)
            column = self.reference.columns.get(names[k])
            if column is None:
                continue  # an Euler parameter, where columns are those of a small rotation
            # The same in Phi, before it was differentiated.
            back = replace(back, q_dot=_with(states.q_dot, k, -states.q_dot[:, k]))
            yield from self._read(kind, text, back, column)
        if isinstance(self.block.constraint, FreeEquation) and len(own) <= MOST_MISREAD:
            for a, b in permutations(own, 2):
                text = f"{names[b]} stands where {names[a]} belongs, throughout"
                read = replace(states, q=_with(states.q, a, states.q[:, b]))
                yield from self._read(Kind.OTHER_VARIABLE, text, read)

    def exchanged_columns(self, columns: Collection[int]) -> Iterator[NumericFault]:
        """Yield two columns of Phi_q in each other's place, in all rows or in one."""
        right, names = self.right_at(self.states), self.reference.coordinates
        for a, b in combinations(sorted(columns), 2):
            other = right.copy()
            other[:, :, [a, b]] = right[:, :, [b, a]]
            text = f"the columns of {names[a]} and {names[b]} are exchanged"
            yield from self._different(Kind.COLUMNS, text, other, (a, b))

    def _read(
        self, kind: str, text: str, states: States, reversed_column: int | None = None
    ) -> Iterator[NumericFault]:
        """Yield the formulas at other states; in Phi_q with one column reversed, as Phi has it."""
        with np.errstate(all="ignore"):
            other = self.right_at(states).copy()
        if self.quantity == "Phi_q" and reversed_column is not None:
            other[:, :, reversed_column] *= -1
        yield from self._different(kind, text, other, range(other.shape[-1]))
        names = self.reference.coordinates
        # In space what stands by r is often copied right, and p alone differentiated.
        for own in self.reference.body_columns if self.quantity == "Phi_q" else ():
            if len(own) > MOST_IN_PLANE:
                by = f"{names[own[3]]} to {names[own[-1]]}"
                yield from self._different(kind, f"{text}, by {by}", other, own[3:])

    def _different(
        self, kind: str, text: str, other: Array, columns: Iterable[int]
    ) -> Iterator[NumericFault]:
        """Yield a fault in all rows of the constraint, and in each of them."""
        right, rows = self.right_at(self.states), self.block.rows
        for chosen in (rows, *((row,) for row in rows if len(rows) > 1)):
            yield from showing(kind, text, other, right, [(i, j) for j in columns for i in chosen])

    def _reversed(self, name: str) -> tuple[str, str]:
        """Return kind and text of a coordinate with the wrong sign."""
        text, symbol = f"the sign of {name} is wrong throughout", sympy.Symbol(name)
        turned = (
            function.has(symbol)
            for row in self.block.rows
            for function in self.reference.expression("Phi", row, 0).atoms(sympy.sin, sympy.cos)
        )
        if name.startswith("e0_") or any(turned):
            return Kind.TRANSPOSED, f"{text}, as where its rotation is transposed"
        return Kind.SIGN, text


def _with(values: Array, column: int, new: Array) -> Array:
    """Return values, (N, n), with another column."""
    changed = values.copy()
    changed[:, column] = new
    return changed
