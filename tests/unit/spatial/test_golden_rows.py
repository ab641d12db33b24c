"""Every spatial constraint against golden rows that were worked out apart from this package."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial

DATA = json.loads(
    (Path(__file__).parents[2] / "data" / "spatial_golden.json").read_text(encoding="utf-8")
)
GIVEN: dict[str, Any] = DATA["state"]
ROWS: dict[str, Any] = {row["constraint"]: row for row in DATA["rows"]}
C = 2 + 0.3 * sympy.sin(2 * kc.t)

POINTS = (GIVEN["s_i"], "j", GIVEN["s_j"])
AXES = (GIVEN["h_i"], "j", GIVEN["h_j"])
PLACED = (GIVEN["s_i"], GIVEN["h_i"], "j", GIVEN["s_j"])
BOTH = (*PLACED, GIVEN["h_j"])
TRIADS = (GIVEN["s_i"], GIVEN["h_i"], GIVEN["f_i"], "j", GIVEN["s_j"], GIVEN["h_j"], GIVEN["f_j"])
APART = (*TRIADS[:5], [-x for x in GIVEN["h_j"]], GIVEN["f_j"])
"""The golden file's axes of a constant velocity joint both point away from it, ours alike."""
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
    "constant_velocity": lambda: [spatial.ConstantVelocity("a", "i", *APART)],
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

    return WithTriads(*(getattr(constraint, name) for name in ("name", *constraint.arguments())))


def turned(vector: Any, index: str) -> Any:
    """Return A v in the body's symbols, by the quaternion product p v p*."""
    e0, *e = sympy.symbols([f"e{k}_{index}" for k in range(4)])
    axis, v = sympy.Matrix(e), sympy.Matrix(vector)
    return (e0**2 - axis.dot(axis)) * v + 2 * axis * axis.dot(v) + 2 * e0 * axis.cross(v)


def sine_form() -> kc.Equation:
    f_i, g_i, f_j = (turned(GIVEN[key], key[-1]) for key in ("f_i", "g_i", "f_j"))
    return kc.Equation("a", g_i.dot(f_j) * sympy.cos(C) - f_i.dot(f_j) * sympy.sin(C))


def mechanism(constraints: list[Any]) -> spatial.Mechanism:
    m = spatial.Mechanism("golden")
    for index in "ij":
        m.body(index, GIVEN[f"r_{index}"])
    for item in constraints:
        m.add(item)
    return m


Q = np.array([*GIVEN["r_i"], *GIVEN["p_i"], *GIVEN["r_j"], *GIVEN["p_j"]])
Q_DOT = np.array([*GIVEN["r_dot_i"], *GIVEN["p_dot_i"], *GIVEN["r_dot_j"], *GIVEN["p_dot_j"]])


def golden_rows(name: str, found: Any) -> Any:
    """Return the rows of a constraint as the golden file has them, in the columns of the bodies.

    Of a screw, whose angle is a coordinate, the last is what the last two say without it.
    """
    if name != "screw":
        return found[: len(ROWS[name]["Phi"])]
    turn, advance = found[4:6]
    return np.array([*found[:4], advance - GIVEN["pitch"] / (2 * np.pi) * turn])


def at_angle(name: str, columns: Any, angle: float) -> Any:
    """Return the coordinates of the bodies with the angle of a screw."""
    return np.append(columns, angle) if name == "screw" else columns


def test_that_every_golden_row_has_a_case() -> None:
    assert CASES.keys() == ROWS.keys()


@pytest.mark.parametrize("name", CASES)
def test_module(name: str) -> None:
    golden = ROWS[name]
    module = kc.compile(mechanism(CASES[name]()))
    q, q_dot, t = at_angle(name, Q, 0.3), at_angle(name, Q_DOT, -0.7), GIVEN["t"]
    Phi = golden_rows(name, module.Phi(q, t)) - golden["Phi"]
    if name == "screw":  # the advance of a whole turn does not count
        Phi[-1] -= GIVEN["pitch"] * round(Phi[-1] / GIVEN["pitch"])
    assert abs(Phi).max() < 1e-9
    Phi_q = golden_rows(name, module.Phi_q(q, t))
    np.testing.assert_allclose(Phi_q[:, :14], golden["Phi_q"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(Phi_q[:, 14:], 0, rtol=0, atol=1e-15)
    nu = golden_rows(name, module.nu(q, t))
    np.testing.assert_allclose(nu, golden["nu"], rtol=0, atol=1e-9)
    gamma = golden_rows(name, module.gamma(q, q_dot, t))
    np.testing.assert_allclose(gamma, golden["gamma"], rtol=0, atol=1e-9)


QUICK = ("revolute", "screw", "relative_rotation", "universal")
"""Constraints whose matrices are compared in every run."""


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=[] if x in QUICK else [pytest.mark.slow]) for x in CASES]
)
def test_system_matrices(name: str) -> None:
    m, golden = mechanism(CASES[name]()), ROWS[name]
    symbols = [*m.q.flat(), *m.q_dot.flat()]
    values = [*at_angle(name, Q, 0.3), *at_angle(name, Q_DOT, -0.7)]
    numbers = {kc.t: GIVEN["t"]} | dict(zip(symbols, values, strict=True))
    for key in ("Phi_q", "nu", "gamma"):
        found = np.array(getattr(m, key).xreplace(numbers).evalf(), dtype=float)
        found = golden_rows(name, found)[:, :14]
        np.testing.assert_allclose(np.squeeze(found), np.squeeze(golden[key]), rtol=0, atol=1e-9)
