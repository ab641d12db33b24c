"""The pictures of joints in space: what they look like, and a mechanism of each for its vectors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from kincompile import spatial
from kincompile.model.arguments import Kind
from kincompile.view.drawing import drawing
from kincompile.view.svg import as_svg

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from kincompile.model.constraint import Constraint

X, Y, Z = np.eye(3)
ORIGIN = np.zeros(3)
SHORT = 0.06

JOINTS: Mapping[str, Callable[[Any, Any, Any], tuple[Any, ...]]] = {
    "Spherical": lambda g, a, b: (g, a, b, ORIGIN),
    "Revolute": lambda g, a, b: (g, a, X, b, ORIGIN, X),
    "Cylindrical": lambda g, a, b: (g, a - SHORT * X, X, b, ORIGIN, X),
    "Translational": lambda g, a, b: (g, a - SHORT * X, X, Y, b, ORIGIN, X, Z),
    "Universal": lambda g, a, b: (g, a, X, b, ORIGIN, Y),
    "ConstantVelocity": lambda g, a, b: (g, a, X, Y, b, ORIGIN, Z, Y),
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


VECTORS = {
    "s_i": (0.11, 0.04, 0.17),
    "s_j": (-0.13, 0.02, 0.11),
    "h_i": (0.3, 0.2, 1),
    "f_i": (1, 0, 0),
    "h_j": (0.2, 0, 1),
    "f_j": (0.9, 0.5, 0),
    "a_i": (0, 0.5, 0.8),
    "a_j": (0.8, 0.2, 0.4),
    "c": (0.1, -0.12, 0.05),
    "u": (0.1, -0.2, 0.3),
}
"""Points and directions of a constraint in the frames of its bodies, by symbol."""

CROSSED = {"h_j": (0.3, 1, 0), "f_j": (-0.4, 1, 0)}
"""Those where a right angle is kept."""

STANDS = {"i": ((0.02, 0.16, -0.06), (0.2, -0.1, 0.4)), "j": ((0.28, 0.36, 0.0), (-0.1, 0.3, -0.3))}
"""Place and rotation vector [rad] of each body."""

LENGTH, ANGLE = 0.12, 0.7
"""Lengths and angles that a constraint is given."""


def alone(kind: type[Constraint]) -> spatial.Mechanism:
    """Return a mechanism of two bodies with one constraint of a type."""
    m = spatial.Mechanism(kind.__name__)
    given: dict[str, Any] = {}
    crossed = [symbol for symbol in getattr(kind, "right_angle", ()) if symbol in CROSSED]
    vectors = {**VECTORS, **{symbol: CROSSED[symbol] for symbol in crossed}}
    for name, item in kind.arguments().items():
        if item.kind is Kind.BODY:
            place, turn = STANDS[item.symbol]
            given[name] = m.body(item.symbol, place, Rotation.from_rotvec(turn))
        elif item.symbol in vectors:
            given[name] = vectors[item.symbol]
        else:
            given[name] = ANGLE if item.unit == "rad" else LENGTH
    m.add(kind("joint", **given))
    return m
