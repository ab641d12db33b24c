"""A joint's formulas in vectors, evaluated in numbers: the leaves of an expansion are arrays.

The expansion is the compiler's own (`Expansion`), with other leaves. So a formula with a fault in
it, written in vectors, gets its numbers in the same way as the right one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.calculus import expressions as ex
from kincompile.calculus.expand import Expansion, cross_product
from kincompile.calculus.space import EulerRotation
from kincompile.checker.reference import Values
from kincompile.derive.derivation import derive
from kincompile.model.symbolic import SymbolicEnvironment
from kincompile.quantities import OF_EQUATIONS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from fractions import Fraction

    import sympy

    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States
    from kincompile.model.resolve import Joint

_COMPOUND = (
    ex.Angle,
    ex.Circular,
    ex.Cross,
    ex.Dot,
    ex.Norm,
    ex.Perpendicular,
    ex.Power,
    ex.Product,
    ex.Rotated,
    ex.Scaled,
    ex.Sum,
    ex.TimesG,
    ex.VectorSum,
)


class Exchanged(ex.VectorSymbol):
    """A body-fixed vector whose components xi and eta are exchanged: a fault."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Shifted(ex.VectorSymbol):
    """A body-fixed vector with something added to it: to find which vector stands for it."""

    offset: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class WrongTilde(EulerRotation):
    """Euler parameters whose B(p, s) has the wrong sign of s~: a fault.

    B(p, s) = 2 [(e0 I + e~) s, e s^T - (e0 I + e~) s~].
    """

    def components(
        self,
        entries: ex.Components,
        vector: ex.Components,
        along: tuple[ex.Components, ...],
        expand: Callable[[ex.Expression], ex.Components],
    ) -> ex.Components:
        """Return A v as it is, of B(p, v) w the wrong one."""
        right = EulerRotation.components(self, entries, vector, along, expand)
        if not along:
            return right
        (e0, *e), (_, *f) = along if len(along) == 2 else (expand(self.p), *along)
        turned = cross_product(vector, tuple(f))
        more = zip(right, turned, cross_product(tuple(e), turned), strict=True)
        return tuple(a + 4 * (e0 * b + c) for a, b, c in more)


class NumericEnvironment:
    """The leaves of a joint's template as arrays over states."""

    def __init__(self, joint: Joint, reference: Reference, states: States) -> None:
        self._symbolic = SymbolicEnvironment(joint)
        self._reference = reference
        self._states = states

    def _number(self, expression: sympy.Expr) -> ex.Value:
        values, _ = self._reference.evaluate([expression], self._states)
        return values[:, 0]

    def number(self, value: Fraction) -> ex.Value:
        """Return an exact number."""
        return np.full(len(self._states), float(value))

    def pi(self) -> ex.Value:
        """Return pi."""
        return np.full(len(self._states), np.pi)

    def symbol(self, symbol: ex.Symbol) -> ex.Value:
        """Return a coordinate, a rate or a scalar attribute."""
        return self._number(self._symbolic.symbol(symbol))

    def vector(self, symbol: ex.VectorSymbol) -> ex.Components:
        """Return a position, a velocity or a body-fixed vector; its components may be exchanged."""
        plain = ex.VectorSymbol(symbol.name, symbol.size)
        components = tuple(self._number(item) for item in self._symbolic.vector(plain))
        if isinstance(symbol, Shifted):
            return tuple(a + b for a, b in zip(components, symbol.offset, strict=True))
        return components[::-1] if isinstance(symbol, Exchanged) else components

    def time_function(self, function: ex.TimeFunction) -> ex.Value:
        """Return C(t) or one of its derivatives."""
        return self._number(self._symbolic.time_function(function))

    def profile(self, profile: ex.ProfileFunction) -> ex.Value:
        """Return rho(alpha) or one of its derivatives at the contact parameter."""
        return self._number(self._symbolic.profile(profile))

    def entries(self, rotation: ex.Rotation, expand: Expansion) -> ex.Components:
        """Return the numbers of a rotation that all vectors share."""
        return expand.entries(rotation)

    def call(self, function: str, *values: ex.Value) -> ex.Value:
        """Return an elementary function."""
        return getattr(np, {"atan2": "arctan2"}.get(function, function))(*values)


class NumericExpansion(Expansion):
    """The expansion of a joint's template to arrays over states.

    A thousand formulas with a fault share all their parts but one with the right formula, as the
    same objects: those are looked up by identity. To hash a formula takes longer than to add it up.
    """

    def __init__(self, joint: Joint, reference: Reference, states: States) -> None:
        super().__init__(NumericEnvironment(joint, reference, states), joint.template.dimension)
        self._known: dict[int, tuple[ex.Expression, Any]] = {}

    def scalar(self, expression: ex.Scalar) -> ex.Value:
        """Return the value of a scalar expression."""
        if isinstance(expression, _COMPOUND):
            return self._kept(expression, self._scalar)
        return super().scalar(expression)

    def vector(self, expression: ex.Vector) -> ex.Components:
        """Return the components of a vector expression."""
        if isinstance(expression, _COMPOUND):
            components: ex.Components = self._kept(expression, self._vector)
            return components
        return super().vector(expression)

    def _kept(self, expression: Any, evaluate: Callable[[Any], Any]) -> Any:
        if id(expression) not in self._known:  # with the value the object is kept, and its id
            self._known[id(expression)] = expression, evaluate(expression)
        return self._known[id(expression)][1]


def component_values(expression: ex.Expression, expansion: Expansion) -> Array:
    """Return the values of an expression, shape (N, components)."""
    return np.stack(expansion.components(expression), axis=-1)


def column_values(columns: Iterable[ex.Expression], expansion: Expansion) -> Array:
    """Return columns of Phi_q side by side, shape (N, rows, columns)."""
    return np.stack([component_values(column, expansion) for column in columns], axis=-1)


def joint_values(joint: Joint, reference: Reference, states: States) -> Values:
    """Evaluate a joint by itself."""
    expansion = NumericExpansion(joint, reference, states)
    arrays = {}
    for quantity in OF_EQUATIONS:
        formulas = [getattr(block, quantity.name) for block in derive(joint.template)]
        values = column_values if quantity.is_matrix else component_values
        arrays[quantity.name] = np.concatenate([values(item, expansion) for item in formulas], 1)
    return Values(arrays)


def with_roles_exchanged(joint: Joint) -> Joint | None:
    """Return the joint with bodies i and j in each other's place, or None if there is none.

    Every attribute of body i must have its counterpart on body j: an axis on body i alone makes
    the other order another type of joint.
    """
    symbols = [*joint.scalars, *joint.points, *joint.profiles]
    sided = {name for name in symbols if name.endswith(("_i", "_j"))}
    if len(joint.bodies) != 2 or {_other(name) for name in sided} != sided:
        return None
    if any(name in joint.points for name in ("s_P", "s_Q")):
        return None
    width = sum(item.size for item in joint.template.frames[0].coordinates)
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
    if name.endswith("_i"):
        return name[:-1] + "j"
    return name[:-1] + "i" if name.endswith("_j") else name
