"""Loads of bodies in space: forces, torques, springs, and the mass of a body.

As in the plane each is a virtual work and a kinetic energy in the vector calculus, from which mass
matrix, generalised forces with their gyroscopic terms, and Jacobians are derived.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from kincompile.calculus.expressions import (
    Number,
    Scalar,
    Symbol,
    TimesG,
    Vector,
    VectorSymbol,
    dot,
    vector_sum,
)
from kincompile.model import arguments as argument
from kincompile.model import loads
from kincompile.model.arguments import BodyLike, PointLike, ValueLike
from kincompile.model.constraint import constraint_type
from kincompile.model.load import Load
from kincompile.space.bodies import SPATIAL
from kincompile.space.symbols import AXES, i

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.derive.loads import Work
    from kincompile.model.constraint import Numbers

m = Symbol("m")
f, g, s_c = (VectorSymbol(name, 3) for name in ("f", "g", "s_C"))
J = tuple(VectorSymbol(f"J_{row}", 3) for row in "123")
HALF = Number(Fraction(1, 2))


class SpatialLoad(Load):
    """A load of bodies in space; every type is a subclass, or one of a planar type."""

    bodies = SPATIAL


@constraint_type
class Force(loads.Force):
    """A force on a point of a body, whose components are along the fixed axes."""

    bodies = SPATIAL
    force: PointLike = argument.loads("f", "(F_x, F_y, F_z) [force] along the fixed axes")


@constraint_type
class FollowerForce(loads.FollowerForce):
    """A force on a point of a body, whose components are along the axes of the body."""

    bodies = SPATIAL
    force: PointLike = argument.loads("f", "(F_xi, F_eta, F_zeta) [force] along the body's axes")


@constraint_type
class Spring(loads.Spring):
    """A spring, a damper and an actuator between two points, along the line between them.

    It pulls with stiffness (l - free_length) + damping l_dot + force, with l the distance of the
    points.
    """

    source = SpatialLoad.source
    bodies = SPATIAL


def _couples(components: tuple[Scalar, ...]) -> tuple[Work, ...]:
    """Return the work of a torque with components along a body's axes.

    About each axis it is that of a unit force at the tip of the second axis along the third one.
    """
    return tuple(
        (component * i.A(AXES[n - 1]), i.A(AXES[n - 2])) for n, component in enumerate(components)
    )


@constraint_type
class Torque(SpatialLoad):
    """A torque on a body, whose components are along the fixed axes."""

    body: BodyLike = argument.body("i")
    torque: PointLike = argument.loads("f", "(T_x, T_y, T_z) [force times length], fixed axes")

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return couples about the axes of the body."""
        return _couples(tuple(dot(f, i.A(axis)) for axis in AXES))


@constraint_type
class FollowerTorque(SpatialLoad):
    """A torque on a body, whose components are along the axes of the body."""

    body: BodyLike = argument.body("i")
    torque: PointLike = argument.loads("f", "(T_xi, T_eta, T_zeta) [force times length]")

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return couples about the axes of the body."""
        return _couples(tuple(dot(f, axis) for axis in AXES))


@constraint_type
class Mass(SpatialLoad):
    """The mass of a body in space: inertia and weight."""

    body: BodyLike = argument.body("i")
    mass: ValueLike = argument.attribute("m", "Mass")
    row_1: PointLike = argument.point("J_1", on="i", what="First row of the inertia")
    row_2: PointLike = argument.point("J_2", on="i", what="Second row of the inertia")
    row_3: PointLike = argument.point("J_3", on="i", what="Third row of the inertia")
    centre: PointLike = argument.point("s_C", on="i", what="Centre of mass")
    gravity: PointLike = argument.point("g", on="ground", what="Acceleration of gravity")

    @classmethod
    def kinetic_energy(cls) -> Scalar:
        """Return m v^T v/2 + omega'^T J omega'/2 with omega' = 2 G p_dot (Haug 9.3)."""
        v = cls.rate_of(i.point(s_c))
        omega: Vector = 2 * TimesG(i.p, i.rates[1])  # type: ignore[arg-type]  # p_dot, a vector
        turned = vector_sum(tuple(dot(row, omega) * e for row, e in zip(J, AXES, strict=True)))
        return HALF * m * dot(v, v) + HALF * dot(omega, turned)

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the weight and the centre of mass."""
        return ((m * g, i.point(s_c)),)

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Refuse a mass that is not positive, and an inertia that no body can have."""
        (mass,) = numbers("m")
        if mass is not None and mass <= 0:
            return f"the mass is {mass:g}, and must be positive"
        rows = [numbers(f"J_{row}") for row in "123"]
        if any(value is None for row in rows for value in row):
            return None
        matrix = np.array(rows, dtype=float)
        size = np.abs(matrix).max()
        if np.abs(matrix - matrix.T).max() > SMALL * size:
            return "the matrix of inertia is not symmetric"
        moments = np.linalg.eigvalsh(matrix)
        shown = ", ".join(f"{value:g}" for value in moments)
        if moments[0] <= 0:
            return f"the principal moments of inertia are {shown}, and must be positive"
        if moments[2] > (1 + SMALL) * (moments[0] + moments[1]):
            return (
                f"the principal moments of inertia are {shown}: no body has one that is more than "
                "the sum of the others"
            )
        return None


SMALL = 1e-9
"""Part of an inertia that may be a rounding error."""

LOADS: Mapping[str, type[Load]] = {
    item.__name__: item for item in (Force, FollowerForce, Torque, FollowerTorque, Spring)
}
"""The types by name; the mass of a body is not one of them."""
