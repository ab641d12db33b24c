"""The mass of a body: as it is given, or that of a plate with its outline."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast

import sympy

from kincompile.model.expressions import NotAnExpressionError, as_expression, as_sympy
from kincompile.model.loads import Mass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.bodies import Body
    from kincompile.model.scope import Scope


def mass_of(body: Body, gravity: Any, scope: Scope) -> Mass | None:
    """Return the mass of a body as a load, None where it has none or a problem was noted."""
    where = f"body {body.name!r}"
    if body.density is not None or body.thickness is not None:
        return _of_plate(body, where, gravity, scope)
    if body.mass is None and body.inertia is None:
        if tuple(body.centre or (0, 0)) != (0, 0):
            scope.problems.append(f"{where}: it has a centre of mass and no mass; give mass=...")
        return None
    if body.mass is None or body.inertia is None:
        has = "a mass and no inertia" if body.inertia is None else "an inertia and no mass"
        scope.problems.append(
            f"{where}: it has {has}; give both, the inertia about the centre of mass (of a rod of "
            "length l, mass*l**2/12)"
        )
        return None
    return Mass(
        body.name, body, cast("Any", body.mass), cast("Any", body.inertia), body.centre, gravity
    )


def _of_plate(body: Body, where: str, gravity: Any, scope: Scope) -> Mass | None:
    given = (body.density, body.thickness)
    if None in given or not len(body.outline):
        scope.problems.append(
            f"{where}: a mass from the outline needs outline=..., density=... and thickness=..."
        )
        return None
    if body.mass is not None or body.inertia is not None or tuple(body.centre) != (0, 0):
        scope.problems.append(
            f"{where}: it has density and thickness, from which mass, inertia and centre follow; "
            "leave those out"
        )
        return None
    try:
        density, thickness = (as_sympy(as_expression(item)) for item in given)
        corners = [tuple(as_sympy(as_expression(x)) for x in corner) for corner in body.outline]
        area, centre, second = plate(cast("Any", corners))
    except (NotAnExpressionError, TypeError, ValueError, ZeroDivisionError):
        scope.problems.append(f"{where}: the outline, the density or the thickness is no number")
        return None
    if area == 0:
        scope.problems.append(f"{where}: its outline has no area; give corners around a plate")
        return None
    mass = density * thickness * area
    return Mass(body.name, body, mass, density * thickness * second, centre, gravity)


def plate(
    corners: Sequence[tuple[sympy.Expr, sympy.Expr]],
) -> tuple[sympy.Expr, tuple[sympy.Expr, sympy.Expr], sympy.Expr]:
    """Return area, centroid and polar second moment about the centroid of a polygon.

    The corners may go around either way; edges must not cross.
    """
    area, moment_x, moment_y, second = (sympy.S.Zero for _ in range(4))
    for (a, b), (c, d) in pairwise([*corners, corners[0]]):
        cross = a * d - c * b
        area += cross / 2
        moment_x += (a + c) * cross / 6
        moment_y += (b + d) * cross / 6
        second += cross * (a**2 + a * c + c**2 + b**2 + b * d + d**2) / 12
    if area == 0:
        return area, (area, area), area
    x, y = moment_x / area, moment_y / area
    about = second - area * (x**2 + y**2)
    # Clockwise corners turn every sign.
    sign = sympy.sign(area) if area.is_number else sympy.S.One
    return sign * area, (x, y), sign * about
