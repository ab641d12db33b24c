"""A joint's formulas in vectors, evaluated in numbers: the leaves of an expansion are arrays.

The walk is the compiler's own (`Expansion`); only what the leaves stand for differs. So a formula
with a fault in it, written in vectors, gets its numbers in the same way as the right one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.calculus.expand import Expansion, Pair, Value
from kincompile.calculus.expressions import Expression, Scalar, Vector
from kincompile.compare.reference import Values
from kincompile.derive.derivation import derive
from kincompile.model.expressions import alpha, t
from kincompile.model.matrices import entry_columns
from kincompile.names import rate

if TYPE_CHECKING:
    from fractions import Fraction

    from kincompile.compare.reference import Reference
    from kincompile.compare.states import Array, States
    from kincompile.model.resolve import Joint

EXCHANGED = "~"
"""At the end of a vector's name: its components xi and eta are exchanged (a fault)."""


class NumericEnvironment:
    """The leaves of a joint's template as arrays over states."""

    def __init__(self, joint: Joint, reference: Reference, states: States) -> None:
        self._joint = joint
        self._reference = reference
        self._states = states
        self._known: dict[str, Any] = {}
        self._contacts: dict[str, sympy.Symbol] = {}
        for frame, body in zip(joint.template.frames, joint.bodies, strict=True):
            self._known[frame.r.name] = (body.x, body.y)
            self._known[frame.r_dot.name] = (body.x_dot, body.y_dot)
            self._known[frame.phi.name] = body.phi
            self._known[frame.phi_dot.name] = body.phi_dot
        names = joint.columns[3 * len(joint.bodies) :]
        for contact, name in zip(joint.template.contacts, names, strict=True):
            self._contacts[contact.rho().name] = sympy.Symbol(str(name))
            self._known[contact.alpha.name] = sympy.Symbol(str(name))
            self._known[contact.alpha_dot.name] = sympy.Symbol(rate(str(name)))

    def _number(self, expression: Any) -> Value:
        values, _ = self._reference.evaluate([sympy.sympify(expression)], self._states)
        return values[:, 0]

    def number(self, value: Fraction) -> Value:
        """Return an exact number."""
        return np.full(len(self._states), float(value))

    def pi(self) -> Value:
        """Return pi."""
        return np.full(len(self._states), np.pi)

    def symbol(self, name: str) -> Value:
        """Return a coordinate, a rate or a scalar attribute."""
        return self._number(self._known[name] if name in self._known else self._joint.scalars[name])

    def vector(self, name: str) -> Pair:
        """Return a position, a velocity or a body-fixed vector; its components may be exchanged."""
        plain = name.removesuffix(EXCHANGED)
        x, y = self._known[plain] if plain in self._known else self._joint.points[plain]
        pair = self._number(x), self._number(y)
        return pair if plain == name else (pair[1], pair[0])

    def time_function(self, name: str, order: int) -> Value:
        """Return C(t) or one of its derivatives."""
        return self._number(sympy.sympify(self._joint.scalars[name]).diff(t, order))

    def profile(self, name: str, order: int) -> Value:
        """Return rho(alpha) or one of its derivatives at the contact parameter."""
        rho = self._joint.profiles[name].diff(alpha, order)
        return self._number(rho.subs(alpha, self._contacts[name]))

    def cos_sin(self, angle: Scalar, expand: Expansion) -> Pair:
        """Return cosine and sine of an angle."""
        value = expand.scalar(angle)
        return np.cos(value), np.sin(value)

    def sqrt(self, value: Value) -> Value:
        """Return a square root."""
        return np.sqrt(value)


def numeric_expansion(joint: Joint, reference: Reference, states: States) -> Expansion:
    """Return what expands expressions of a joint's template to arrays over states."""
    return Expansion(NumericEnvironment(joint, reference, states))


def component_values(expression: Expression, expansion: Expansion) -> Array:
    """Return the values of an expression, shape (N, 1) or (N, 2)."""
    return np.stack(expansion.components(expression), axis=-1)


def entry_values(
    entry: Expression, is_vector_row: bool, is_position: bool, expansion: Expansion
) -> Array:
    """Return a block of Phi_q, shape (N, rows, columns)."""
    columns = entry_columns(entry, is_vector_row, is_position, expansion)
    return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)


def joint_values(joint: Joint, reference: Reference, states: States) -> Values:
    """Evaluate a joint by itself."""
    expansion = numeric_expansion(joint, reference, states)
    coordinates = joint.template.coordinates
    blocks = derive(joint.template)
    Phi_q = [
        np.concatenate(
            [
                entry_values(
                    entry, isinstance(block.Phi, Vector), isinstance(item, Vector), expansion
                )
                for item, entry in zip(coordinates, block.Phi_q, strict=True)
            ],
            axis=-1,
        )
        for block in blocks
    ]
    Phi, nu, gamma = (
        np.concatenate(
            [component_values(getattr(block, name), expansion) for block in blocks], axis=-1
        )
        for name in ("Phi", "nu", "gamma")
    )
    return Values(Phi, np.concatenate(Phi_q, axis=1), nu, gamma)


def with_roles_exchanged(joint: Joint) -> Joint | None:
    """Return the joint with bodies i and j in each other's place, or None where that is none.

    Every attribute of body i must have its counterpart on body j: an axis on body i alone makes
    the other order another type of joint.
    """
    symbols = [*joint.scalars, *joint.points, *joint.profiles]
    sided = {name for name in symbols if name.endswith(("_i", "_j"))}
    if len(joint.bodies) != 2 or {_other(name) for name in sided} != sided:
        return None
    if any(name in joint.points for name in ("s_P", "s_Q")):
        return None
    width = 3
    bodies, contacts = joint.columns[: 2 * width], joint.columns[2 * width :]
    return replace(
        joint,
        bodies=joint.bodies[::-1],
        scalars={_other(name): value for name, value in joint.scalars.items()},
        points={_other(name): value for name, value in joint.points.items()},
        profiles={_other(name): value for name, value in joint.profiles.items()},
        columns=(*bodies[width:], *bodies[:width], *contacts[::-1]),
    )


def _other(name: str) -> str:
    """Return the name of the same attribute on the other body."""
    if name.endswith("_i"):
        return name[:-1] + "j"
    return name[:-1] + "i" if name.endswith("_j") else name
