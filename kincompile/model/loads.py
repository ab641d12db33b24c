"""The catalogue of loads: springs, forces and torques, friction, and the mass of a body.

Each is a virtual work in the vector calculus, so that generalised forces and their Jacobians are
derived. Positive is a spring that pulls, and a torque that turns body j counterclockwise.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from kincompile.calculus.expressions import (
    Norm,
    Number,
    Root,
    Scalar,
    Symbol,
    VectorSymbol,
    dot,
)
from kincompile.calculus.symbols import i, j
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, PointLike, ValueLike
from kincompile.model.constraint import constraint_type
from kincompile.model.load import Load

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.derive.loads import Work
    from kincompile.model.constraint import Numbers

__all__ = (  # noqa: RUF022 - in the order of the tables, simple ones first
    "Force", "FollowerForce", "Torque", "Spring", "TorsionSpring", "HingeFriction",
    "SliderFriction",
)  # fmt: skip

F, k, c, length_0, angle_0 = (Symbol(name) for name in ("F", "k", "c", "l_0", "phi_0"))
v_0, g, s_c = Symbol("v_0"), VectorSymbol("g"), VectorSymbol("s_C")
m, J = Symbol("m"), Symbol("J")
HALF = Number(Fraction(1, 2))


def _friction_problem(numbers: Numbers) -> str | None:
    (velocity,), (size,) = numbers("v_0"), numbers("F")
    if velocity is not None and velocity <= 0:
        return f"the velocity of the smoothed law is {velocity:g}; give a small positive one"
    if size is not None and size < 0:
        return f"friction of {size:g} would drive; give what it is when sliding, positive"
    return None


def _nothing_problem(numbers: Numbers) -> str | None:
    if all(numbers(symbol) == (0,) for symbol in ("k", "c", "F")):
        return "it has no stiffness, no damping and no force; give one of them"
    return None


@constraint_type
class Force(Load):
    """A force on a point of a body, whose components are along the fixed axes."""

    body: BodyLike = argument.body("i")
    point: PlaceLike = argument.point("s_i", on="i")
    force: PointLike = argument.loads("f", "(F_x, F_y) [force] along the fixed axes")

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the force and the point."""
        (point,) = cls.points()
        return ((cls.vector("f"), point),)


@constraint_type
class FollowerForce(Load):
    """A force on a point of a body, whose components are along the axes of the body."""

    body: BodyLike = argument.body("i")
    point: PlaceLike = argument.point("s_i", on="i")
    force: PointLike = argument.loads("f", "(F_xi, F_eta) [force] along the body's axes")

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the turned force and the point."""
        (frame,), (point,) = cls.frames(), cls.points()
        return ((frame.A(cls.vector("f")), point),)


@constraint_type
class Torque(Load):
    """A torque on a body; what it is supported by does not move."""

    body: BodyLike = argument.body("i")
    torque: ValueLike = argument.load("F", "Torque [force times length], counterclockwise")

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the torque and the angle of the body."""
        return ((F, i.phi),)


@constraint_type
class Spring(Load):
    """A spring, a damper and an actuator between two points, along the line between them.

    It pulls with stiffness (l - free_length) + damping l_dot + force, with l the distance of the
    points.
    """

    source = "Haug 6.2"
    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")
    stiffness: ValueLike = argument.attribute("k", "Stiffness [force per length]", default=0)
    free_length: ValueLike = argument.attribute(
        "l_0", "Length without force [length]", "length", default=0
    )
    damping: ValueLike = argument.attribute("c", "Damping [force per velocity]", default=0)
    force: ValueLike = argument.load("F", "Further pull [force]", default=0)

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the force that pulls, against the distance."""
        first, second = cls.points()
        length = Norm(second - first)
        return ((-(k * (length - length_0) + c * cls.rate_of(length) + F), length),)

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Refuse a negative length, and a spring without stiffness, damping or force."""
        (length,) = numbers("l_0")
        if length is not None and length < 0:
            return f"the free length is {length:g}; a length is not negative"
        return _nothing_problem(numbers)


class Turning(Load):
    """A load of the angle between two bodies; the types are its subclasses."""

    @classmethod
    def turned(cls) -> Scalar:
        """Return the angle of body j from body i, over whole turns."""
        return j.phi - i.phi

    @classmethod
    def turning(cls) -> Scalar:
        """Return its rate."""
        return cls.rate_of(j.phi - i.phi)

    @classmethod
    def couple(cls, torque: Scalar) -> tuple[Work, ...]:
        """Return the work of a torque on body j, and its opposite on body i."""
        return ((torque, j.phi - i.phi),)


@constraint_type
class TorsionSpring(Turning):
    """A spring, a damper and an actuator about a hinge between two bodies.

    It turns body j back, towards body i, with stiffness (angle - free_angle) + damping angle_dot +
    torque, with the angle phi_j - phi_i.
    """

    source = "Haug 6.2"
    i: BodyLike = argument.body("i")
    j: BodyLike = argument.body("j")
    stiffness: ValueLike = argument.attribute("k", "Stiffness [torque per rad]", default=0)
    free_angle: ValueLike = argument.attribute(
        "phi_0", "Angle without torque [rad]", "rad", default=0
    )
    damping: ValueLike = argument.attribute("c", "Damping [torque per rad/s]", default=0)
    torque: ValueLike = argument.load("F", "Further torque, against the turn [torque]", default=0)

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the torque that turns back, against the angle."""
        return cls.couple(-(k * (cls.turned() - angle_0) + c * cls.turning() + F))

    problem = staticmethod(_nothing_problem)


@constraint_type
class HingeFriction(Turning):
    """Dry friction in a hinge: Coulomb's law, smoothed where the hinge is nearly at rest.

    The torque is moment w/sqrt(w^2 + velocity^2) against the relative angular velocity w, so it
    does not hold a hinge at rest, but lets it creep.
    """

    i: BodyLike = argument.body("i")
    j: BodyLike = argument.body("j")
    moment: ValueLike = argument.load("F", "Torque of friction when sliding, positive")
    velocity: ValueLike = argument.attribute(
        "v_0", "Angular velocity [rad/s] below which the law is smooth", default=0.01
    )

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the torque against the sliding, and the angle."""
        return cls.couple(_against(cls.turning()))

    problem = staticmethod(_friction_problem)


@constraint_type
class SliderFriction(Load):
    """Dry friction on a guide: Coulomb's law, smoothed where the slider is nearly at rest.

    The force is force v/sqrt(v^2 + velocity^2) against the velocity v with which the point of body
    j slides along the axis of body i, so it does not hold a slider at rest, but lets it creep.
    """

    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    axis_i: PointLike = argument.axis("v_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")
    force: ValueLike = argument.load("F", "Force of friction when sliding, positive")
    velocity: ValueLike = argument.attribute(
        "v_0", "Velocity [length per s] below which the law is smooth", default=0.001
    )

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the force against the sliding, and the way along the axis."""
        (body, _), (first, second) = cls.frames(), cls.points()
        axis = cls.vector("v_i")
        way = dot(body.A(axis), second - first) / Norm(axis)
        return ((_against(cls.rate_of(way)), way),)

    problem = staticmethod(_friction_problem)


def _against(velocity: Scalar) -> Scalar:
    """Return the smoothed law of Coulomb, -F v/sqrt(v^2 + v_0^2)."""
    return -(F * velocity / Root(velocity**2 + v_0**2))


@constraint_type
class Mass(Load):
    """The mass of a body, made by `Mechanism.body`: inertia and weight."""

    body: BodyLike = argument.body("i")
    mass: ValueLike = argument.attribute("m", "Mass")
    inertia: ValueLike = argument.attribute("J", "Moment of inertia about the centre of mass")
    centre: PointLike = argument.point("s_C", on="i", what="Centre of mass")
    gravity: PointLike = argument.point("g", on="ground", what="Acceleration of gravity")

    @classmethod
    def kinetic_energy(cls) -> Scalar:
        """Return m v^T v / 2 + J w^2 / 2, with the velocity of the centre of mass."""
        v = cls.rate_of(i.point(s_c))
        return HALF * m * dot(v, v) + HALF * J * cls.rate_of(i.phi) ** 2

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return the weight and the centre of mass."""
        return ((m * g, i.point(s_c)),)

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Refuse a mass or an inertia that is not positive."""
        for symbol, what in (("m", "mass"), ("J", "inertia about the centre of mass")):
            (value,) = numbers(symbol)
            if value is not None and value <= 0:
                return f"the {what} is {value:g}, and must be positive"
        return None


LOADS: Mapping[str, type[Load]] = {name: globals()[name] for name in __all__}
"""The types by name, in the order of the list above; the mass of a body is not one of them."""
