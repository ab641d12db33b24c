"""Outputs of a wheel suspension, as expressions of the points and axes of a model.

Axes and signs are those of ISO 8855:2011: x points forward, y to the left, z up, all fixed in the
vehicle body, which is the ground of the model. `side` is -1 for a right wheel. Toe is positive
where the front of the wheel points inward, camber where its top leans outward, caster where the top
of the steering axis leans back, kingpin inclination where it leans inward; the scrub radius is
positive where the tyre touches the road outside the steering axis, the trail where it does so
behind it. `lower` and `upper` are points of the steering axis, such as the ball joints, `contact`
is where the tyre meets the road, and `spin` the axis of the wheel to the left, (0, 1, 0) at zero
camber and toe.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

from kincompile.errors import ModelError
from kincompile.model.expressions import as_sympy
from kincompile.model.outputs import AnyPoint, coordinates, length, velocity_ratio
from kincompile.space.bodies import require_three

if TYPE_CHECKING:
    from kincompile.model.expressions import Scalar, Scalars


def camber(spin: Scalars, side: int = 1) -> sympy.Expr:
    """Return the camber angle [rad], positive where the top leans outward."""
    x, y, z = _three(spin, "the axis of a wheel")
    return as_sympy(-_sign(side) * _angle(z, length((x, y))))


def toe(spin: Scalars, side: int = 1) -> sympy.Expr:
    """Return the toe angle [rad], positive where the front points inward (ISO 8855, 7.1.6).

    Of a wheel that is steered it is the steer angle with that sign.
    """
    x, y, _ = _three(spin, "the axis of a wheel")
    return as_sympy(_sign(side) * _angle(x, y))


def caster(lower: AnyPoint, upper: AnyPoint) -> sympy.Expr:
    """Return the caster angle [rad], seen along y, positive where the top leans back."""
    x, _, z = _axis(lower, upper)
    return _angle(-x, z)


def kingpin(lower: AnyPoint, upper: AnyPoint, side: int = 1) -> sympy.Expr:
    """Return the inclination of the steering axis [rad], seen along x, positive inward."""
    _, y, z = _axis(lower, upper)
    return _angle(-_sign(side) * y, z)


def scrub_radius(lower: AnyPoint, upper: AnyPoint, contact: AnyPoint, side: int = 1) -> sympy.Expr:
    """Return how far outside the steering axis the tyre touches the road [length], along y.

    It is measured at the height of `contact`, as the trail is.
    """
    return as_sympy(_sign(side) * _behind(lower, upper, contact)[1])


def trail(lower: AnyPoint, upper: AnyPoint, contact: AnyPoint) -> sympy.Expr:
    """Return how far behind the steering axis the tyre touches the road [length], along x."""
    return -_behind(lower, upper, contact)[0]


def track(contact: AnyPoint, side: int = 1) -> sympy.Expr:
    """Return the track of an axle that is symmetric about y = 0 [length]."""
    return as_sympy(2 * _sign(side) * _place(contact)[1])


def roll_centre_height(contact: AnyPoint) -> sympy.Expr:
    """Return the height of the roll centre above the road [length], of an axle symmetric about y=0.

    In the transverse plane the instant centre of the wheel lies on the line at a right angle to the
    velocity of `contact`; that line meets y = 0 in the roll centre. It needs a wheel that travels
    up or down, and one that is not steered at that time.
    """
    _, y, z = _place(contact)
    return as_sympy(y * velocity_ratio(y, z))


def motion_ratio(spring: Scalar, wheel: AnyPoint) -> sympy.Expr:
    """Return by how much a spring becomes shorter for a rise of a point of the wheel.

    `spring` is its length, such as `distance(S, T)`. The rate at the wheel is that of the spring
    times the square of it, where the ratio stays the same.
    """
    return -velocity_ratio(spring, _place(wheel)[2])


def _angle(sine: sympy.Expr, cosine: sympy.Expr) -> sympy.Expr:
    found: sympy.Expr = sympy.atan2(sine, cosine)
    return found


def _sign(side: int) -> int:
    if side not in (1, -1):
        raise ModelError(f"the side of a wheel is {side!r}: give 1 for a left one, -1 for a right")
    return int(side)


def _three(given: Scalars, what: str) -> tuple[sympy.Expr, ...]:
    require_three(given, what)
    return tuple(map(as_sympy, given))


def _place(point: AnyPoint) -> tuple[sympy.Expr, ...]:
    return _three(coordinates(point), "a point of a suspension")


def _axis(lower: AnyPoint, upper: AnyPoint) -> tuple[sympy.Expr, ...]:
    """Return the vector along the steering axis, upward."""
    ends = zip(_place(lower), _place(upper), strict=True)
    return tuple(high - low for low, high in ends)


def _behind(lower: AnyPoint, upper: AnyPoint, contact: AnyPoint) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the way in x and y from the steering axis to a point, at the height of the point."""
    start, (x, y, z), place = _place(lower), _axis(lower, upper), _place(contact)
    up = (place[2] - start[2]) / z
    return place[0] - start[0] - up * x, place[1] - start[1] - up * y
