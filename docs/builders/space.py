"""The picture of what joints in space look like."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import spatial
from kincompile.view.drawing import drawing
from kincompile.view.svg import as_svg

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

X, Y, Z = np.eye(3)
ORIGIN = np.zeros(3)
SHORT = 0.06

JOINTS: Mapping[str, Callable[[Any, Any, Any], tuple[Any, ...]]] = {
    "Spherical": lambda g, a, b: (g, a, b, ORIGIN),
    "Revolute": lambda g, a, b: (g, a, X, b, ORIGIN, X),
    "Cylindrical": lambda g, a, b: (g, a - SHORT * X, X, b, ORIGIN, X),
    "Translational": lambda g, a, b: (g, a - SHORT * X, X, Y, b, ORIGIN, X, Z),
    "Universal": lambda g, a, b: (g, a, X, b, ORIGIN, Y),
    "ConstantVelocity": lambda g, a, b: (g, a, X, Y, b, ORIGIN, Z, X),
    "Screw": lambda g, a, b: (g, a - SHORT * X, X, Y, b, ORIGIN, X, Y, 0.01),
    "Planar": lambda g, a, b: (g, a, Z, b, ORIGIN, Z),
    "Fixed": lambda g, a, b: (g, a, Z, X, b, ORIGIN, Z, X),
    "InPlane": lambda g, a, b: (g, a, Z, b, ORIGIN),
    "PointOnLine": lambda g, a, b: (g, a - SHORT * X, X, b, ORIGIN),
    "RevoluteCylindrical": lambda g, a, b: (g, a, X, b, SHORT * Y, Y),
    "RevoluteSpherical": lambda g, a, b: (g, a - 2 * SHORT * X, Y, b, ORIGIN, 2 * SHORT),
    "Distance": lambda g, a, b: (g, a - 2 * SHORT * X, b, ORIGIN, 2 * SHORT),
}
"""What follows the name of each joint, between the ground at a place and a body."""

COLUMNS, WIDE, TALL = 5, 0.24, 0.24
"""How they are arranged."""

SIZE = 0.008
"""Size of marks."""


def joints_in_space() -> str:
    """Return every joint between the ground, grey, and a body, as SVG."""
    m = spatial.Mechanism("joints_in_space")
    for k, (name, arguments) in enumerate(JOINTS.items()):
        row, column = divmod(k, COLUMNS)
        place = WIDE * column * (X + Y) / 2**0.5 - TALL * row * Z
        body = m.body(f"body_{k}", place)
        m.point(name, body, (0, 0, SHORT))
        m.add(getattr(spatial, name)(f"joint_{k}", *arguments(m.ground, place, body)))
    q = np.array([float(item.guess) for item in m.system().coordinates])
    drawn = replace(drawing(m), size=SIZE)
    return as_svg(drawn, q[None], "Joints in space: the ground is grey, the body coloured.")
