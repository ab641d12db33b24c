"""Outputs of mechanisms in space that are often wanted, as expressions.

    from kincompile.spatial import outputs

    spin = upright.direction((0, 1, 0))
    m.output("camber", outputs.inclination(spin, (0, 0, 1)), "rad")

A direction is three components in the ground's frame: numbers, `SpatialBody.direction` of a
body-fixed vector, or `way` from one point to another. The angular velocity of a body is
`SpatialBody.omega`; `rate` gives the time derivative of anything.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias, cast

import sympy

from kincompile.model.expressions import as_sympy
from kincompile.model.outputs import AnyPoint, between, coordinates, length, scalar_product
from kincompile.model.outputs import acceleration as acceleration
from kincompile.model.outputs import distance as distance
from kincompile.model.outputs import mechanical_advantage as mechanical_advantage
from kincompile.model.outputs import speed as speed
from kincompile.model.outputs import transmission_angle as transmission_angle
from kincompile.model.outputs import velocity_ratio as velocity_ratio
from kincompile.model.points import rate as rate
from kincompile.space.bodies import require_three
from kincompile.space.suspension import camber as camber
from kincompile.space.suspension import caster as caster
from kincompile.space.suspension import kingpin as kingpin
from kincompile.space.suspension import motion_ratio as motion_ratio
from kincompile.space.suspension import roll_centre_height as roll_centre_height
from kincompile.space.suspension import scrub_radius as scrub_radius
from kincompile.space.suspension import toe as toe
from kincompile.space.suspension import track as track
from kincompile.space.suspension import trail as trail

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.expressions import Scalars

Direction: TypeAlias = "Scalars"
"""Three components in the ground's frame, of any length but zero."""


def way(start: AnyPoint, end: AnyPoint) -> tuple[sympy.Expr, ...]:
    """Return the vector from one point to another, points of bodies or fixed ones (x, y, z)."""
    ends = zip(coordinates(start), coordinates(end), strict=True)
    return tuple(there - here for here, there in ends)


def angle(u: Direction, v: Direction, about: Direction | None = None) -> sympy.Expr:
    """Return the angle from one direction to another [rad].

    Without an axis it lies between 0 and pi, and has no rate where it is one of them. About an axis
    it is that of what is seen along the axis, between -pi and pi, positive by the right-hand rule.
    Over whole turns: `spatial.JointAngle`.
    """
    u, v = _components(u), _components(v)
    if about is None:
        return between(u, v)
    w = _components(about)
    size = scalar_product(w, w)
    sine = length(w) * scalar_product(w, _cross(u, v))
    cosine = size * scalar_product(u, v) - scalar_product(u, w) * scalar_product(v, w)
    return cast("sympy.Expr", sympy.atan2(sine, cosine))


def inclination(u: Direction, normal: Direction) -> sympy.Expr:
    """Return the angle of a direction above a plane with this normal [rad], -pi/2 to pi/2."""
    u, w = _components(u), _components(normal)
    return cast("sympy.Expr", sympy.atan2(scalar_product(u, w), length(_cross(u, w))))


def _components(given: Direction) -> tuple[sympy.Expr, ...]:
    require_three(given, "a direction in space")
    return tuple(map(as_sympy, given))


def _cross(u: Sequence[sympy.Expr], v: Sequence[sympy.Expr]) -> tuple[sympy.Expr, ...]:
    return tuple(u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3))
