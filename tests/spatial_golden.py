"""Golden rows of every spatial constraint, worked out apart from this package, as one mechanism."""

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import sympy

import kincompile as kc
from kincompile import spatial

DATA = json.loads(
    (Path(__file__).parent / "data" / "spatial_golden.json").read_text(encoding="utf-8")
)
GIVEN: dict[str, Any] = DATA["state"]
ROWS: dict[str, Any] = {row["constraint"]: row for row in DATA["rows"]}
C = 2 + 0.3 * sympy.sin(2 * kc.t)

POINTS = (GIVEN["s_i"], "j", GIVEN["s_j"])
AXES = (GIVEN["h_i"], "j", GIVEN["h_j"])
PLACED = (GIVEN["s_i"], GIVEN["h_i"], "j", GIVEN["s_j"])
BOTH = (*PLACED, GIVEN["h_j"])
TRIADS = (GIVEN["s_i"], GIVEN["h_i"], GIVEN["f_i"], "j", GIVEN["s_j"], GIVEN["h_j"], GIVEN["f_j"])
BODY = (GIVEN["s_i"],)

CASES: dict[str, Callable[[], list[Any]]] = {
    "norm": list,
    "absolute_x_y_z": lambda: [
        kind(axis, "i", *BODY, C)
        for axis, kind in zip(
            "xyz", (spatial.AbsoluteX, spatial.AbsoluteY, spatial.AbsoluteZ), strict=True
        )
    ],
    "absolute_distance": lambda: [spatial.AbsoluteDistance("a", "i", *BODY, GIVEN["c"], C)],
    "absolute_dot1": lambda: [spatial.Dot1("a", "ground", GIVEN["u"], "i", GIVEN["a_i"], C)],
    "absolute_dot2": lambda: [
        spatial.Dot2("a", "ground", GIVEN["c"], GIVEN["u"], "i", GIVEN["s_i"], C)
    ],
    "absolute_orientation": lambda: [spatial.AbsoluteOrientation("a", "i", (0.1, -0.2, 0.3), C)],
    "dot1": lambda: [spatial.Dot1("a", "i", GIVEN["a_i"], "j", GIVEN["a_j"], C)],
    "dot2": lambda: [spatial.Dot2("a", "i", GIVEN["s_i"], GIVEN["a_i"], "j", GIVEN["s_j"], C)],
    "dot2_reversed": lambda: [
        spatial.Dot2("a", "j", GIVEN["s_j"], GIVEN["a_j"], "i", GIVEN["s_i"], C)
    ],
    "coordinate_difference": lambda: [
        kind(axis, "i", *POINTS, C)
        for axis, kind in zip(
            "xyz", (spatial.RelativeX, spatial.RelativeY, spatial.RelativeZ), strict=True
        )
    ],
    "distance": lambda: [spatial.Distance("a", "i", *POINTS, C)],
    "spherical": lambda: [spatial.Spherical("a", "i", *POINTS)],
    "parallel1": lambda: [of_triads(spatial.Parallel("a", "i", *AXES))],
    "parallel2": lambda: [of_triads(spatial.PointOnLine("a", "i", *PLACED))],
    "in_plane": lambda: [spatial.InPlane("a", "i", *PLACED)],
    "planar_joint": lambda: [of_triads(spatial.Planar("a", "i", *BOTH))],
    "universal": lambda: [spatial.Universal("a", "i", *BOTH)],
    "revolute": lambda: [of_triads(spatial.Revolute("a", "i", *BOTH))],
    "cylindrical": lambda: [of_triads(spatial.Cylindrical("a", "i", *BOTH))],
    "translational": lambda: [spatial.Translational("a", "i", *TRIADS)],
    "fixed": lambda: [spatial.Fixed("a", "i", *TRIADS)],
    "screw": lambda: [spatial.Screw("a", "i", *TRIADS, GIVEN["pitch"])],
    "revolute_cylindrical": lambda: [of_triads(spatial.RevoluteCylindrical("a", "i", *BOTH))],
    "revolute_spherical": lambda: [spatial.RevoluteSpherical("a", "i", *PLACED, C)],
    "constant_velocity": lambda: [spatial.ConstantVelocity("a", "i", *TRIADS)],
    "relative_rotation": lambda: [
        spatial.RelativeRotation(
            "a", "i", GIVEN["h_i"], GIVEN["f_i"], "j", GIVEN["h_j"], GIVEN["f_j"], C
        )
    ],
    "relative_rotation_sine": lambda: [sine_form()],
    "relative_rotation_cosine": lambda: [
        spatial.Dot1("a", "i", GIVEN["f_i"], "j", GIVEN["f_j"], sympy.cos(C))
    ],
    "relative_translation": lambda: [spatial.RelativeTranslation("a", "i", *PLACED, C)],
}


def of_triads(constraint: Any) -> Any:
    """Return a constraint with the triads of the golden state, which it would choose itself."""
    kind = type(constraint)

    class WithTriads(kind):  # type: ignore[misc, valid-type]
        @staticmethod
        def completed(points: Any, defaults: Any) -> Any:
            given = {key: GIVEN[key] for key in ("f_i", "f_j") if f"h{key[1:]}" in points}
            return kind.completed({**points, **given}, defaults)

    return with_name(constraint, constraint.name, WithTriads)


def with_name(constraint: Any, name: str, kind: type | None = None) -> Any:
    """Return a constraint by another name, and of another type if one is given."""
    if isinstance(constraint, kc.Equation):
        return kc.Equation(name, *constraint.expressions)
    return (kind or type(constraint))(
        name, *(getattr(constraint, item) for item in constraint.arguments())
    )


def turned(vector: Any, index: str) -> Any:
    """Return A v in the body's symbols, by the quaternion product p v p*."""
    e0, *e = sympy.symbols([f"e{k}_{index}" for k in range(4)])
    axis, v = sympy.Matrix(e), sympy.Matrix(vector)
    return (e0**2 - axis.dot(axis)) * v + 2 * axis * axis.dot(v) + 2 * e0 * axis.cross(v)


def sine_form() -> kc.Equation:
    f_i, g_i, f_j = (turned(GIVEN[key], key[-1]) for key in ("f_i", "g_i", "f_j"))
    return kc.Equation("a", g_i.dot(f_j) * sympy.cos(C) - f_i.dot(f_j) * sympy.sin(C))


def mechanism(*names: str) -> spatial.Mechanism:
    """Return two bodies with constraints between them, called as in the golden file."""
    m = spatial.Mechanism("golden")
    for index in "ij":
        m.body(index, GIVEN[f"r_{index}"], GIVEN[f"p_{index}"])
    for name in names:
        for k, item in enumerate(CASES[name]()):
            m.add(with_name(item, f"{name}_{k}"))
    return m


ANGLE, ANGLE_DOT = 0.3, -0.7
"""Of the screw, whose angle is a coordinate: the last."""
Q = np.array([*GIVEN["r_i"], *GIVEN["p_i"], *GIVEN["r_j"], *GIVEN["p_j"], ANGLE])
Q_DOT = np.array(
    [*GIVEN["r_dot_i"], *GIVEN["p_dot_i"], *GIVEN["r_dot_j"], *GIVEN["p_dot_j"], ANGLE_DOT]
)


def rows_of(name: str, equations: Any, found: Any) -> Any:
    """Return the rows of a constraint as the golden file has them, in the columns of the bodies.

    Of a screw the last is what the last two say without its angle.
    """
    wanted = "norm_i" if name == "norm" else name
    own = [
        k
        for k, item in enumerate(equations)
        if re.fullmatch(rf"{wanted}(_\d)?", item.split(".")[0])
    ]
    rows = np.asarray(found)[own]
    if name == "screw":
        turn, advance = rows[4:6]
        rows = np.array([*rows[:4], advance - GIVEN["pitch"] / (2 * np.pi) * turn])
    return rows[:, :14] if rows.ndim > 1 else rows


def assert_golden(names: Iterable[str], equations: Any, found: Any) -> None:
    """Compare Phi, Phi_q, nu and gamma of constraints at the golden state."""
    for name in names:
        golden = ROWS[name]
        for quantity, values in found.items():
            away = rows_of(name, equations, values) - golden[quantity]
            if (name, quantity) == ("screw", "Phi"):  # the advance of a whole turn does not count
                away[-1] -= GIVEN["pitch"] * round(away[-1] / GIVEN["pitch"])
            assert np.abs(away).max() < 1e-9, (name, quantity)
