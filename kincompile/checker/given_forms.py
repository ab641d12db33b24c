"""The forms in which a hand-in may be: by the coordinates, and in space by small rotations too.

In Haug's r-omega form Phi_q has columns of r and small rotations, and no norm rows. A rotation by
pi' about the axes of a body changes p by dp = G^T pi'/2. So Phi_pi' = Phi_p G^T/2, and with
p_ddot = G^T omega'_dot/2 - (omega'^T omega') p/4 the right side for (r_ddot, omega'_dot) is
gamma + (omega'^T omega') Phi_p p/4, summed over the bodies: a change of basis of the values of the
r-p form. About the global axes Phi_pi = Phi_pi' A^T, and gamma is the same: omega_dot = A
omega'_dot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.calculus.expand import times_g
from kincompile.calculus.expressions import VectorSymbol
from kincompile.calculus.space import EulerRotation
from kincompile.checker.comparison import Convention
from kincompile.checker.conventions import GLOBAL
from kincompile.checker.layouts import expected_widths, usual_layout
from kincompile.checker.reference import MATRICES, OF_LOADS, QUANTITIES, Reference, Values
from kincompile.errors import InputError
from kincompile.model.small_rotations import (
    BY_OMEGA,
    BY_P,
    is_norm,
    turned_columns,
    turned_constraints,
    turned_rows,
)
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Mapping, Sequence

    from kincompile.calculus.expressions import Components
    from kincompile.checker.conventions import Stated
    from kincompile.checker.reference import ConstraintBlock, Kept
    from kincompile.checker.states import Array, States
    from kincompile.model.bodies import Body
    from kincompile.model.matrices import EquationRow
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem


@dataclass(frozen=True, slots=True)
class Subject:
    """What is compared: the equations of a system, or of one constraint, at some states."""

    reference: Reference
    block: ConstraintBlock | None
    states: States

    @property
    def rows(self) -> tuple[int, ...]:
        """The equations, as rows of the system."""
        if self.block is not None:
            return self.block.rows
        return tuple(range(len(self.reference.equations)))

    @property
    def blocks(self) -> tuple[ConstraintBlock, ...]:
        """The constraints."""
        return self.reference.blocks if self.block is None else (self.block,)

    def kept(self, key: Hashable, make: Callable[[], Kept]) -> Kept:
        """Return what `make` gives; what belongs to the random states is made once."""
        if self.states is not self.reference.random:
            return make()
        if key not in self.reference.kept:
            self.reference.kept[key] = make()
        found: Kept = self.reference.kept[key]
        return found

    def in_degrees(self, states: States) -> States:
        """Return states with angles and their rates as numbers of degrees."""
        if states is not self.states:
            return states.in_degrees(self.reference.base.angular)
        return self.kept("degrees", lambda: states.in_degrees(self.reference.base.angular))

    def near(self, rows: Sequence[int]) -> States | None:
        """Return states near the guess at which some of the system's equations hold, if any."""
        return self.kept(("near", tuple(rows)), lambda: self.reference.near(rows, self.states))


@dataclass(frozen=True)
class Forms:
    """The forms that a hand-in may have, the system's own first."""

    reference: Reference
    stated: Stated
    constraint: str | None  # name of the one constraint that is checked; all where None

    @cached_property
    def all(self) -> list[tuple[Reference, ConstraintBlock | None]]:
        """The forms, one alone where it is stated.

        Raises
        ------
        InputError
            If there is no such constraint, or a form is stated that the mechanism does not have.
        """
        name, found = self.constraint, self._references()
        if self.stated.form not in ("", *found):
            raise InputError(
                f"the convention form = {self.stated.form!r} is one of mechanisms in space, not "
                f"of their norm rows; here it is: {listed(found)}"
            )
        return [
            (reference, None if name is None else reference.block(name))
            for form, reference in found.items()
            if self.stated.form in ("", form)
        ]

    def _references(self) -> dict[str, Reference]:
        base = self.reference
        found = {BY_P: base}
        block = None if self.constraint is None else base.block(self.constraint)
        if base.spins and (block is None or not is_norm(block.constraint)):
            for form, is_global in ((BY_OMEGA, False), (GLOBAL, True)):
                if form not in base.kept:  # with the system, for the next hand-in
                    base.kept[form] = TurnedReference(base, is_global)
                found[form] = base.kept[form]
        return found

    def shape_problems(self, name: str, rows: int, columns: int) -> list[str]:
        """Return what is wrong with the shape of a quantity in every form."""
        problems = [_shape_problems(*form, name, rows, columns) for form in self.all]
        if not all(problems):
            return []
        turned = [f"in the r-omega form: {item}" for own in problems[1:2] for item in own]
        return [*problems[0], *turned]

    def fitting(
        self, shapes: Mapping[str, tuple[int, int]]
    ) -> list[tuple[Reference, ConstraintBlock | None]]:
        """Return the forms that have the shapes of all quantities.

        Raises
        ------
        InputError
            If there is none, though each quantity has one.
        """
        found = [
            form
            for form in self.all
            if not any(_shape_problems(*form, name, *shape) for name, shape in shapes.items())
        ]
        if not found:
            sizes = [f"{name} is {rows} x {columns}" for name, (rows, columns) in shapes.items()]
            raise InputError(
                f"{listed(sizes)}: that is two forms; Phi_q has seven columns a body, and every "
                "quantity has norm rows, or Phi_q has six, and none has them"
            )
        return found


def _shape_problems(
    reference: Reference, block: ConstraintBlock | None, name: str, rows: int, columns: int
) -> list[str]:
    """Return what is wrong with the shape of a quantity in one form."""
    found = []
    names = reference.equations if block is None else block.constraint.equation_names
    names = reference.base.coordinates if name in OF_LOADS else names
    if rows != len(names):
        expected = f"{len(names)}, one for each of: {listed(names, 60)}"
        found.append(f"{name} has {rows} rows; expected {expected}")
    if name == "M" and columns != len(names):
        found.append(f"M has {columns} columns; expected {len(names)}, as many as rows")
    if name == "Phi_q" and usual_layout(reference, block, columns) is None:
        widths = expected_widths(reference, block)
        found.append(f"Phi_q has {columns} columns; expected {widths}")
    if name not in MATRICES and columns != 1:
        found.append(f"{name} has {columns} columns; it is a vector: expected one")
    return found


BODY_FIXED = Convention(
    "r-omega form",
    "Phi_q has the columns (Phi_r, Phi_pi') of each body and no norm rows; gamma belongs to "
    "(r_ddot, omega'_dot).",
)
ABOUT_GLOBAL_AXES = Convention(
    "global omega",
    "Phi_q has the columns (Phi_r, Phi_pi) of each body and no norm rows; small rotations and "
    "omega are about the global axes.",
)


class TurnedReference(Reference):
    """The formulas of a system in space by r and small rotations, at states of unit p.

    Parameters
    ----------
    base
        The same system by r and p.
    is_global
        Whether rotations are about the global axes, not the body's own.
    """

    def __init__(self, base: Reference, is_global: bool = False) -> None:
        self._share(base)
        self.is_global = is_global
        self.convention = ABOUT_GLOBAL_AXES if is_global else BODY_FIXED
        bodies, first = self.system.bodies, sum(map(len, base.body_columns))
        free = base.coordinates[first:]
        self._keys = (*(name for body in bodies for name in turned_columns(body)), *free)
        self.coordinates = self._keys
        if is_global:
            names = (f"{letter}_{body.name}" for body in bodies for letter in _GLOBAL_LETTERS)
            self.coordinates = (*names, *free)
        self.constraints = turned_constraints(self.system)
        self.equations = tuple(name for item in self.constraints for name in item.equation_names)
        self.columns = {name: k for k, name in enumerate(self._keys)}
        self.body_columns = tuple(range(6 * k, 6 * k + 6) for k in range(len(bodies)))
        turns = np.tile([False] * 6, len(bodies))
        sizes = np.tile([base.sizes[0]] * 3 + [1.0] * 3, len(bodies))
        self.angular = np.concatenate([turns, base.angular[first:]])
        self.sizes = np.concatenate([sizes, base.sizes[first:]])
        arms = np.tile([base.arms[0]] * 3 + [1.0] * 3, len(bodies))
        self.arms = np.concatenate([arms, base.arms[first:]])
        rows = np.split(np.arange(len(base.equations)), self.system.row_offsets[1:])
        pairs = list(zip(self.system.constraints, rows, strict=True))
        self._kept_rows = [int(row) for item, own in pairs if not is_norm(item) for row in own]
        self._norm_rows = [int(row) for item, own in pairs if is_norm(item) for row in own]

    def another(self, model: Mechanism | ConstraintSystem) -> Reference:
        """Return the formulas of another system of these coordinates, in this form."""
        return TurnedReference(self.base.another(model), self.is_global)

    @cached_property
    def _rows(self) -> list[EquationRow]:
        rows = turned_rows(self.constraints, self.system.bodies)
        return [self._about_global_axes(row) for row in rows] if self.is_global else rows

    def _about_global_axes(self, row: EquationRow) -> EquationRow:
        entries = dict(row.Phi_q)
        for body in self.system.bodies:
            names = turned_columns(body)[3:]
            own = tuple(entries.get(name, sympy.S.Zero) for name in names)
            entries |= dict(zip(names, turned_vector(body.symbols[3:], own), strict=True))
        return replace(row, Phi_q=entries)

    def expression(self, quantity: str, row: int, column: int) -> sympy.Expr:
        """Return an entry as a SymPy expression."""
        if quantity != "Phi_q":
            return super().expression(quantity, row, column)
        found: sympy.Expr = sympy.sympify(self._rows[row].Phi_q.get(self._keys[column], 0))
        return found

    def values(self, states: States) -> Values:
        """Evaluate the generated quantities, once at each states."""
        if states not in self._values:
            found = self.base.values(states)
            own = {name: found.of(name)[:, self._kept_rows] for name in QUANTITIES}
            arrays = self.expressed(own, states)
            vectors = {name: arrays[name][..., 0] for name in QUANTITIES if name != "Phi_q"}
            self._values[states] = Values({**arrays, **vectors})
        return self._values[states]

    def expressed(self, values: Mapping[str, Array], states: States) -> Mapping[str, Array]:
        """Return quantities of the r-p form, (N, rows, 1 or n) each, in this one."""
        Phi_q, gamma, blocks = values["Phi_q"], values["gamma"], []
        for body, own in zip(self.system.bodies, self.base.body_columns, strict=True):
            p, p_dot = (item[:, own[3:]] for item in (states.q, states.q_dot))
            by_p = Phi_q[:, :, own[3:]]
            square = np.sum(_times_g(p, p_dot) ** 2, axis=-1) * 4
            gamma = gamma + square[:, None, None] / 4 * (by_p @ p[:, :, None])
            blocks += [Phi_q[:, :, own[:3]], by_p @ self._slopes(body, states)]
        rest = Phi_q[:, :, sum(map(len, self.base.body_columns)) :]
        return {**values, "Phi_q": np.concatenate([*blocks, rest], axis=-1), "gamma": gamma}

    def _slopes(self, body: Body, states: States) -> Array:
        """Return the derivative of p by a small rotation of a body, G^T/2 or E^T/2, (N, 4, 3)."""
        p = self._p(body, states)
        columns = [_times_g(p, unit, is_transposed=True) / 2 for unit in np.eye(3)]
        return self.in_axes(np.stack(columns, axis=-1), body, states)

    def _p(self, body: Body, states: States) -> Array:
        own = self.base.body_columns[self.system.bodies.index(body)]
        return np.asarray(states.q[:, own[3:]])

    def in_axes(self, block: Array, body: Body, states: States) -> Array:
        """Return columns by pi' of a body, (N, rows, 3), as columns by this form's rotations."""
        if not self.is_global or body.is_ground:
            return block
        p = tuple(self._p(body, states).T[..., None])
        return np.stack(turned_vector(p, tuple(np.moveaxis(block, -1, 0))), axis=-1)

    def gradient(self, Phi_q: Callable[[States], Array]) -> Callable[[States], Array]:
        """Return by r and p what is given by r and small rotations, constant along p."""

        def by_p(states: States) -> Array:
            unit = self.normalised(states)
            values, blocks = Phi_q(unit), []
            for body, own in zip(self.system.bodies, self.body_columns, strict=True):
                slopes = np.swapaxes(self._slopes(body, unit), 1, 2)
                size = np.linalg.norm(self._p(body, states), axis=-1)[:, None, None]
                blocks += [values[:, :, own[:3]], 4 * values[:, :, own[3:]] @ slopes / size]
            return np.concatenate([*blocks, values[:, :, 6 * len(self.body_columns) :]], axis=-1)

        return by_p

    def normalised(self, states: States) -> States:
        """Return states with p of length one, and p_dot at a right angle to it."""
        q, q_dot = states.q.copy(), states.q_dot.copy()
        for own in self.base.body_columns:
            p, p_dot = q[:, own[3:]], q_dot[:, own[3:]]
            p = p / np.linalg.norm(p, axis=-1, keepdims=True)
            q[:, own[3:]] = p
            q_dot[:, own[3:]] = p_dot - p * np.sum(p * p_dot, axis=-1, keepdims=True)
        return replace(states, q=q, q_dot=q_dot)

    def near(self, rows: Sequence[int], like: States) -> States | None:
        """Return states near the assembled guess at which some of the equations and norms hold."""
        return self.base.near([*(self._kept_rows[k] for k in rows), *self._norm_rows], like)

    def about_guess(self, like: States) -> States:
        """Return states with other positions, about the assembled guess."""
        return self.normalised(self.base.about_guess(like))


def turned_vector(p: Components, vector: Components) -> Components:
    """Return A v, which as a row is v^T A^T."""
    rotation = EulerRotation(VectorSymbol("p", 4))
    entries = rotation.entries((p,), lambda name, value: NotImplemented)
    return rotation.components(entries, vector, (), lambda item: p)


_GLOBAL_LETTERS = ("x", "y", "z", "pi_x", "pi_y", "pi_z")


def _times_g(p: Array, vector: Array, is_transposed: bool = False) -> Array:
    """Return G v or G^T v by state, (N, 3) or (N, 4); a vector may be the same at all states."""
    parts = times_g(tuple(p.T), tuple(vector.T), is_transposed)
    return np.stack(parts, axis=-1)
