"""Loads of bodies in space: forces, torques, springs, and the mass of a body.

As in the plane each is a virtual work and a kinetic energy in the vector calculus, from which mass
matrix, generalised forces with their gyroscopic terms, and Jacobians are derived.
"""

from __future__ import annotations

from dataclasses import replace
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
from kincompile.calculus.space import AXES, f_i, f_j, g_i, g_j, i, j
from kincompile.model import arguments as argument
from kincompile.model import loads
from kincompile.model.arguments import BodyLike, PointLike, ValueLike
from kincompile.model.constraint import constraint_type
from kincompile.model.load import Load
from kincompile.space.bodies import SPATIAL
from kincompile.space.constraint import SpatialConstraint
from kincompile.space.joints import JointAngle
from kincompile.space.triads import with_triads

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.derive.loads import Work
    from kincompile.model.constraint import Element, Numbers

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


class Turning(loads.Turning):
    """A load of the angle about a hinge; the types are its subclasses."""

    bodies = SPATIAL
    completed = staticmethod(with_triads)

    @classmethod
    def turning(cls) -> Scalar:
        """Return h_j^T omega_j - h_i^T omega_i, as the rate of f along g on either body."""
        return dot(j.A(g_j), cls.rate_of(j.A(f_j))) - dot(i.A(g_i), cls.rate_of(i.A(f_i)))

    @classmethod
    def couple(cls, torque: Scalar) -> tuple[Work, ...]:
        """Return the work of a torque about the hinge on body j, and its opposite on body i.

        It is that of a force along g at the tip of f.
        """
        return (torque * j.A(g_j), j.A(f_j)), (torque * i.A(g_i), -i.A(f_i))


@constraint_type
class Crosses(Turning):
    """A load of the angle of a cross from another; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    axis_i: PointLike = argument.axis("h_i", on="i")
    cross_i: PointLike = argument.cross("f_i", on="i")
    j: BodyLike = argument.body("j")
    axis_j: PointLike = argument.axis("h_j", on="j")
    cross_j: PointLike = argument.cross("f_j", on="j")


@constraint_type
class TorsionSpring(loads.TorsionSpring, Crosses):
    """A spring, a damper and an actuator about a hinge between two bodies.

    It turns body j back with stiffness (angle - free_angle) + damping angle_dot + torque, with the
    angle of the cross of body j from that of body i, about the axis of body i. It is counted over
    any number of turns, by a `JointAngle` that the mechanism gets with it, ``<name>_angle``.
    """

    source = SpatialLoad.source
    angle: ValueLike | None = argument.measured(
        "theta",
        "The angle over whole turns, where a coordinate has it: `theta` of a JointAngle or Screw.",
        default=None,
    )

    @classmethod
    def turned(cls) -> Scalar:
        """Return the coordinate that counts whole turns."""
        return Symbol("theta")

    def with_own(self) -> tuple[Element, ...]:
        """Return the coordinate of its angle, where none is given, and itself."""
        if self.angle is not None:
            return (self,)
        first, second = (self.i, self.axis_i, self.cross_i), (self.j, self.axis_j, self.cross_j)
        counted = JointAngle(f"{self.name}_angle", *first, *second)
        return counted, replace(self, angle=counted.theta)

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Refuse a cross along its axis, and a spring without effect."""
        return SpatialConstraint.problem(numbers) or loads.TorsionSpring.problem(numbers)


@constraint_type
class Hinge(Turning):
    """A load of a hinge, whose angle does not matter; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    axis_i: PointLike = argument.axis("h_i", on="i")
    j: BodyLike = argument.body("j")
    axis_j: PointLike = argument.axis("h_j", on="j")


@constraint_type
class HingeFriction(loads.HingeFriction, Hinge):
    """Dry friction in a hinge: Coulomb's law, smoothed where the hinge is nearly at rest.

    The torque is moment w/sqrt(w^2 + velocity^2) against the angular velocity w of body j about the
    axis of body i, so it does not hold a hinge at rest, but lets it creep.
    """


@constraint_type
class SliderFriction(loads.SliderFriction):
    """Dry friction on a guide: Coulomb's law, smoothed where the slider is nearly at rest.

    The force is force v/sqrt(v^2 + velocity^2) against the velocity v with which the point of body
    j slides along the axis of body i, so it does not hold a slider at rest, but lets it creep.
    """

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
    item.__name__: item
    for item in (
        Force, FollowerForce, Torque, FollowerTorque, Spring, TorsionSpring, HingeFriction,
        SliderFriction,
    )
}  # fmt: skip
"""The types by name; the mass of a body is not one of them."""
