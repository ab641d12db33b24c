"""The mass of a link that is drawn in space: of a straight bar between its two joints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

from kincompile.model.drawn_masses import known_masses
from kincompile.model.expressions import as_sympy
from kincompile.model.link_shape import ShapeError
from kincompile.model.sketch_parts import minus

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.scope import Point


def mass_of_bar(
    joints: Sequence[Point], given: Mapping[str, Any], values: dict[str, float]
) -> dict[str, Any]:
    """Return mass, inertia and centre of a link; nothing where nothing is said of its mass.

    Along a bar of length l and a square section of width w the moment of inertia is m w^2/6, and at
    a right angle to it m (l^2 + w^2)/12.

    Parameters
    ----------
    joints
        Places of its joints, in the axes of the ground.
    given
        The arguments of `spatial.Sketch.link`.
    values
        The parameters at their defaults.

    Raises
    ------
    ShapeError
        Where too much is given, or too little.
    """
    known = known_masses(given, values, "width")
    if not known or {"mass", "inertia", "centre"} == known.keys():
        return known
    if len(joints) != 2:
        raise ShapeError("of three joints or more give mass, inertia and centre")
    if "width" not in known and "inertia" not in known:
        raise ShapeError("a bar without width turns freely about itself; give width=... or inertia")
    way = [as_sympy(part) for part in minus(joints[1], joints[0])]
    square = sympy.Add(*(part**2 for part in way))
    width = as_sympy(known.get("width", 0))
    mass = known.get("mass")
    if mass is None:
        mass = 1.0 * known["density"] * width**2 * sympy.sqrt(square)
    across, less = (square + width**2) / 12, (1 - width**2 / square) / 12
    inertia = [
        tuple(mass * (across * int(i == k) - less * way[i] * way[k]) for k in range(3))
        for i in range(3)
    ]
    own = {"mass": mass, "inertia": inertia, "centre": tuple(part / 2 for part in way)}
    return own | {name: known[name] for name in own if name in known}
