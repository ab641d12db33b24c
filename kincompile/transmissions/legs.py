"""Legs that no output sees, as the distances that they keep.

A rod with two balls, a cylinder with its rod, or a link between two hinges touches the rest of a
mechanism in two points. Where its inside is rigid for given inputs, all that it demands of the rest
is a distance of these two: its equations inside do not change as it moves as a whole. So its bodies
and their equations are left out, and the rest has fewer unknowns. The distance is read off the
leg's own equations, with its first body in the place of the ground: they are linear in where the
others are. A leg stays whose own joints do not take it to every direction, as a universal joint
does not whose axis is oblique to the leg.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import sympy

from kincompile.calculus.expand import Expansion
from kincompile.model.expressions import as_sympy, evaluate, symbol_names
from kincompile.model.points import PlacedPoint
from kincompile.model.relative import Distance as PlanarDistance
from kincompile.model.resolve import FreeEquation, Joint
from kincompile.model.symbolic import SymbolicEnvironment
from kincompile.space.primitives import Distance

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.calculus.expressions import Components, Rotation
    from kincompile.model.bodies import Body
    from kincompile.model.symbolic import Bound
    from kincompile.model.system import ConstraintSystem

    Array = NDArray[np.float64]
    Place = tuple[sympy.Expr, ...]
    Values = Mapping[str, sympy.Expr]

TOUCHING = ("Revolute", "Spherical", "Universal")
"""Joints in which two points coincide, by their first rows."""
FREE = ("Revolute", "Spherical", "Normalization")
"""Constraints of a leg, one with its end, that leave it every direction."""
HOLDING = {"Universal": "h", "Dot1": "a"}
"""Constraints that keep two directions at a right angle, and the symbol of these."""
NOISE = 1e-9
"""Rounding errors of the position, in numbers of size one."""


def without_legs(
    system: ConstraintSystem, inputs: Collection[str], outputs: Sequence[str], q: Array
) -> tuple[ConstraintSystem, Array]:
    """Return a system without the legs that no output sees, and its position.

    Without the bodies too that hang on the ground beside what inputs move and outputs see, such as
    the other leg of a robot.

    Parameters
    ----------
    system
        Nothing in it depends on time.
    inputs
        Names of the parameters that change.
    outputs
        Names of the coordinates and outputs that are wanted; others are left out with the legs.
    q
        A position at the default values of the parameters.
    """
    seen = [x for x in system.observers if any(row.name in outputs for row in x.rows)]
    values = {x.name: float(v) for x, v in zip(system.coordinates, q, strict=True)}
    kept = {*outputs, *(column for x in seen for column in x.columns)}
    if beside := _beside(system, {*kept, *inputs}):
        bodies = [x for x in system.bodies if not beside.isdisjoint(x.coordinates)]
        rest = [x for x in system.constraints if beside.isdisjoint(x.columns)]
        system = system.rewritten(rest, []).without([x.name for x in bodies], seen)
    while True:
        wanted = kept.union(*(x.columns for x in system.constraints if not _is_plain(x)))
        bodies = [x for x in system.bodies if wanted.isdisjoint(x.coordinates)]
        legs = (_Leg(system, own, values) for own in _rigid(system, bodies))
        found = next(((leg, rod) for leg in legs if (rod := leg.rod()) is not None), None)
        if found is None:
            return system, np.array([values[x.name] for x in system.coordinates])
        leg, rod = found
        rest = [x for x in system.constraints if not (leg.touches(x) or leg.holds(x))]
        system = system.rewritten(rest, [rod]).without(leg.names, seen)


def _beside(system: ConstraintSystem, wanted: Collection[str | None]) -> set[str]:
    """Return coordinates of bodies that no equation joins to any of these symbols."""
    groups: list[set[str]] = []
    for item in system.constraints:
        own = {x for x in item.columns if x is not None} | _symbols(item).intersection(wanted)
        joined = [group for group in groups if not group.isdisjoint(own)]
        groups = [x for x in groups if x not in joined] + [own.union(*joined)]
    of_bodies = {x for body in system.bodies for x in body.coordinates}
    apart = (group for group in groups if group.isdisjoint(wanted) and group <= of_bodies)
    return set().union(*apart)


def _symbols(item: Joint | FreeEquation) -> set[str]:
    """Return the names of the symbols in a constraint."""
    if isinstance(item, FreeEquation):
        values: list[Any] = [*item.expressions]
    else:
        points = (x for point in item.points.values() for x in point)
        values = [*item.scalars.values(), *points, *item.profiles.values()]
    return set().union(*(symbol_names(as_sympy(x)) for x in values))


def lengths_of(system: ConstraintSystem, inputs: Collection[str]) -> list[sympy.Expr]:
    """Return the distances between points that depend on inputs, parameters of the system.

    Where one passes through zero the points meet, and a rod that ends there may point anywhere.
    """
    found = (
        as_sympy(x.scalars["C"])
        for x in system.constraints
        if isinstance(x, Joint) and x.type_name == "Distance"
    )
    return [x for x in found if not symbol_names(x).isdisjoint(inputs)]


def _is_plain(item: Any) -> bool:
    """Return whether a constraint reads coordinates of its bodies alone, or holds a spin."""
    if isinstance(item, FreeEquation):
        return bool(item.spinning)
    own = {name for body in item.bodies for name in body.coordinates}
    return own.issuperset(x for x in item.columns if x is not None)


def _names(item: Any) -> set[str]:
    """Return the names of the bodies that a constraint touches."""
    return {body.name for body in item.bodies if not body.is_ground}


def _between(system: ConstraintSystem, names: Sequence[str]) -> list[Joint]:
    """Return the constraints of two bodies out of several, and of no other one."""
    return [
        x
        for x in system.constraints
        if isinstance(x, Joint) and len(_names(x)) == 2 and _names(x) <= set(names)
    ]


def _rows(items: Sequence[Any]) -> int:
    """Return how many equations constraints have."""
    return sum(len(x.equation_names) for x in items)


def _rigid(system: ConstraintSystem, bodies: Sequence[Body]) -> list[list[Body]]:
    """Return groups of bodies that hold each other, but for a turn about an axis in space."""
    groups = [[body] for body in bodies]
    for one, other in combinations(bodies, 2):
        enough = (3,) if one.kind.frame.size == 2 else (6, 5)
        if _rows(_between(system, (one.name, other.name))) in enough:
            first, second = (next(x for x in groups if body in x) for body in (one, other))
            if first is not second:
                groups.remove(second)
                first += second
    return groups


class _Held(SymbolicEnvironment):
    """Leaves of a template in SymPy, where bodies are turned by numbers."""

    def __init__(self, bound: Bound, given: Values) -> None:
        super().__init__(bound)
        self._given: dict[Any, sympy.Expr] = dict(given)

    def entries(self, rotation: Rotation, expand: Expansion) -> Components:
        """Return the numbers of a rotation; whole ones have no rounding errors."""
        found = (sympy.sympify(x).subs(self._given) for x in super().entries(rotation, expand))
        return tuple(map(_exact, found))

    def rows(self) -> list[sympy.Expr]:
        """Return the components of all that the template has."""
        expand, template = Expansion(self, self._bound.template.dimension), self._bound.template
        found = (x for expression in template.Phi for x in expand.components(expression))
        return [sympy.expand(sympy.sympify(x).subs(self._given)) for x in found]


@dataclass(frozen=True, eq=False)
class _Leg:
    """Bodies that may be a leg, the first one in the place of the ground."""

    system: ConstraintSystem
    bodies: Sequence[Body]
    values: Mapping[str, float]  # of all coordinates

    @property
    def names(self) -> list[str]:
        """Names of the bodies."""
        return [body.name for body in self.bodies]

    @property
    def size(self) -> int:
        """Number of components of a point."""
        return self.bodies[0].kind.frame.size

    def touches(self, item: Any) -> bool:
        """Return whether a constraint is one of these bodies."""
        return not _names(item).isdisjoint(self.names)

    def holds(self, item: Any) -> bool:
        """Return whether a constraint holds a spin of one of these bodies, which nothing sees."""
        return isinstance(item, FreeEquation) and item.spinning in self.names

    def rod(self) -> PlanarDistance | Distance | None:
        """Return the distance that takes the place of the leg; None where it is no leg."""
        joints = [x for x in self.system.constraints if isinstance(x, Joint)]
        touched = [x for x in joints if self.touches(x)]
        inside = _between(self.system, self.names)
        ends = [x for x in touched if x not in inside and x.type_name in TOUCHING]
        # The distance of two points is one equation too many; others hold what spins.
        held = [x for x in self.system.constraints if self.holds(x)]
        unknown = sum(len(x.coordinates) for x in self.bodies)
        if len(ends) != 2 or _rows(touched) + _rows(held) != unknown + 1:
            return None
        (one, first), (other, second) = (self._end(x, is_own=False) for x in ends)
        places = self._places(inside)
        if one is other or places is None or not self._may_spin(inside, ends):
            return None
        points = [self._point(places, *self._end(x, is_own=True)) for x in ends]
        apart = [a - b for a, b in zip(*points, strict=True)]
        others = [x for x in touched if x not in inside and x.type_name not in FREE]
        length = self._length(apart)
        if length is None or not all(self._gives_way(x, places, apart) for x in others):
            return None
        kind = PlanarDistance if self.size == 2 else Distance
        return kind(ends[0].name, one, first, other, second, length)

    def _end(self, joint: Joint, *, is_own: bool) -> tuple[Body, Place]:
        """Return a body and its point in a joint: the leg's own, or that of the rest."""
        side = next(k for k, x in enumerate(joint.bodies) if (x.name in self.names) is is_own)
        return joint.bodies[side], tuple(map(as_sympy, joint.points[("s_i", "s_j")[side]]))

    def _places(self, inside: Sequence[Joint]) -> Values | None:
        """Return the coordinates of the bodies where the first one is the ground, by name.

        None where parameters turn bodies, or the equations do not give their places.
        """
        first, *others = self.bodies
        given = dict(zip(first.coordinates, map(sympy.Integer, first.kind.ground), strict=True))
        for body in others:
            turns = self._turned(first, body)
            given |= zip(body.coordinates[self.size :], map(sympy.Float, turns), strict=True)
        unknown = [sympy.Symbol(x) for body in others for x in body.coordinates[: self.size]]
        rows = [row for joint in inside for row in _Held(joint, given).rows()]
        moving = [row for row in rows if not row.free_symbols.isdisjoint(unknown)]
        if any(row.free_symbols for row in rows if row not in moving):
            return None
        if not unknown:
            return given
        try:
            matrix, right = sympy.linear_eq_to_matrix(moving, unknown)
        except sympy.polys.solvers.PolyNonlinearError:
            return None
        if matrix.free_symbols or matrix.rows != matrix.cols or matrix.rank() < matrix.rows:
            return None
        solved = matrix.inv().applyfunc(_exact) * right
        return given | dict(zip((x.name for x in unknown), solved, strict=True))

    def _turned(self, first: Body, body: Body) -> list[float]:
        """Return how a body is turned relative to the first one: phi, or Euler parameters."""
        a, b = (
            np.array([self.values[name] for name in x.coordinates[self.size :]])
            for x in (first, body)
        )
        if self.size == 2:
            return [float(b[0] - a[0])]
        vector = a[0] * b[1:] - b[0] * a[1:] - np.cross(a[1:], b[1:])
        return [float(a @ b), *vector.tolist()]

    def _gives_way(self, item: Any, places: Values, apart: Sequence[sympy.Expr]) -> bool:
        """Return whether a spin of the leg meets a constraint whichever way the leg points.

        One at a right angle does where the leg's own direction is across the leg.
        """
        symbol = HOLDING.get(item.type_name)
        if symbol is None or item.scalars.get("C", 0) != 0:
            return False
        body, side = next(x for x in zip(item.bodies, "ij", strict=True) if x[0] in self.bodies)
        own = tuple(map(as_sympy, item.points[f"{symbol}_{side}"]))
        ends = (self._point(places, body, x) for x in (own, (sympy.Integer(0),) * self.size))
        parts = zip(*ends, apart, strict=True)
        along = sympy.expand(sympy.Add(*((tip - root) * part for tip, root, part in parts)))
        return all(abs(float(x)) <= NOISE for x in along.as_coefficients_dict().values())

    def _may_spin(self, inside: Sequence[Joint], ends: Sequence[Joint]) -> bool:
        """Return whether nothing turns inside, or both points are on the axis."""
        if self.size == 2 or _rows(inside) == 6 * (len(self.bodies) - 1):
            return True
        axes = [x for x in inside if "h_j" in x.points]
        if len(self.bodies) != 2 or len(axes) != 1:
            return False
        side = dict(zip((x.name for x in axes[0].bodies), "ij", strict=True))
        for body, point in (self._end(x, is_own=True) for x in ends):
            at, along = (axes[0].points[f"{x}_{side[body.name]}"] for x in "sh")
            apart = [as_sympy(a) - as_sympy(b) for a, b in zip(point, at, strict=True)]
            if not _is_along(apart, list(map(as_sympy, along))):
                return False
        return True

    def _point(self, places: Values, body: Body, point: Place) -> list[sympy.Expr]:
        """Return the components of a point of a body in the frame of the first one."""
        bound = PlacedPoint("", body.coordinates, point, frame=body.kind.frame("i"))
        return _Held(bound, places).rows()

    def _length(self, apart: Sequence[sympy.Expr]) -> sympy.Expr | None:
        """Return the distance of two points, positive at the defaults of the parameters."""
        parts = [x for x in map(sympy.expand, apart) if x != 0]
        square = sympy.expand(sympy.Add(*(x**2 for x in parts)))
        root = parts[0] if len(parts) == 1 else sympy.powdenest(sympy.sqrt(square), force=True)
        value = evaluate(root, {x.name: float(x.default or 0.0) for x in self.system.parameters})
        return cast("sympy.Expr", root if value > 0 else -root) if value else None


def _is_along(vector: Sequence[sympy.Expr], axis: Sequence[sympy.Expr]) -> bool:
    """Return whether a vector is zero or has the direction of an axis."""
    across = sympy.Matrix(vector).cross(sympy.Matrix(axis)).applyfunc(sympy.expand)
    if any(x.free_symbols for x in (*vector, *axis)):
        return bool(across.is_zero_matrix)
    a, b, c = (np.linalg.norm(np.array(x, dtype=float)) for x in (vector, axis, across))
    return bool(c <= NOISE * a * b)


def _exact(number: sympy.Expr) -> sympy.Expr:
    """Return a number, a whole one without rounding errors."""
    whole = round(number)
    return sympy.Integer(whole) if abs(number - whole) < NOISE else number
