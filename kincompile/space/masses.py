"""The mass of a body in space, as it is given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.space.loads import Mass

if TYPE_CHECKING:
    from kincompile.model.bodies import Body
    from kincompile.model.scope import Scope


def mass_of(body: Body, gravity: Any, scope: Scope) -> Mass | None:
    """Return the mass of a body as a load, None where it has none or a problem was noted."""
    where = f"body {body.name!r}"
    if not body.is_heavy:
        return None
    if body.mass is None or body.inertia is None:
        scope.problems.append(
            f"{where}: give a mass and an inertia, about the centre of mass and along the axes of "
            "the body: inertia=(J_xi, J_eta, J_zeta), or a matrix of three rows"
        )
        return None
    rows = _rows(body.inertia)
    if rows is None:
        scope.problems.append(
            f"{where}: its inertia {body.inertia!r} is not (J_xi, J_eta, J_zeta), and no matrix of "
            "three rows of three"
        )
        return None
    return Mass(body.name, body, body.mass, *rows, body.centre, gravity)


def _rows(given: Any) -> tuple[Any, Any, Any] | None:
    """Return the rows of a matrix of inertia; principal moments are its diagonal."""
    try:
        rows = list(given)
        if len(rows) != 3:
            return None
        if not any(hasattr(row, "__len__") for row in rows):
            a, b, c = rows
            return (a, 0, 0), (0, b, 0), (0, 0, c)
        first, second, third = (tuple(row) for row in rows)
    except TypeError:
        return None
    return (first, second, third) if {len(first), len(second), len(third)} == {3} else None
