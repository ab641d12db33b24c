"""Motions in space against closed forms that were worked out with 40 digits."""

from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial

X, Y, Z = np.eye(3)
TARGETS = ["numpy", "c"]

# t: x, x_dot, x_ddot of the slider
SLIDER = {
    0.0: (0.2, 0.24, 1.44),
    0.1: (0.228883891456028, 0.315179524099789, 0.101714557608865),
    0.3: (0.281325154069376, 0.160625249252231, -1.36777542551812),
    0.5: (0.283664901007662, -0.138865003152114, -1.41740291738079),
    0.8: (0.203915143568567, -0.260790490265719, 1.22170120300356),
    1.0: (0.190510058855511, 0.157439671391356, 2.03411445436457),
}


def slider_crank() -> spatial.Mechanism:
    m = spatial.Mechanism("spatial_slider_crank")
    crank = m.body("crank", (0, 0.1, 0.12))
    joint, pin = np.array([0, 0.1, 0.2]), np.array([0.2, 0, 0])
    along = (pin - joint) / 0.3
    side = np.cross(X, along) / np.linalg.norm(np.cross(X, along))
    frame = np.column_stack([along, side, np.cross(along, side)])
    rod = m.body("rod", (joint + pin) / 2, frame)
    slider = m.body("slider", pin)
    m.add(spatial.Revolute("O", m.ground, (0, 0.1, 0.12), X, crank, (0, 0, 0), X))
    m.add(spatial.Spherical("A", crank, (0, 0, 0.08), rod, (-0.15, 0, 0)))
    m.add(spatial.Universal("B", rod, (0.15, 0, 0), Y, slider, (0, 0, 0), X))
    m.add(spatial.Translational("C", m.ground, (0, 0, 0), X, Y, slider, (0, 0, 0), X, Z))
    m.add(spatial.RelativeRotation("motor", m.ground, X, Z, crank, X, Z, 6 * kc.t))
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_slider_crank(target: str) -> None:
    solution = kc.solve(kc.compile(slider_crank(), target=target), list(SLIDER))
    assert solution.success
    found = np.column_stack([solution[f"x_slider{end}"] for end in ("", "_dot", "_ddot")])
    np.testing.assert_allclose(found, list(SLIDER.values()), rtol=0, atol=2e-13)
    p, p_dot = (
        np.stack([solution[f"e{k}_rod{end}"] for k in range(4)], axis=-1) for end in ("", "_dot")
    )
    np.testing.assert_allclose(np.sum(p * p_dot, axis=-1), 0, atol=1e-14)
    # omega = 2 E p_dot, E = [-e, e~ + e0 I]
    e0, e = p[:, :1], p[:, 1:]
    omega = 2 * (e0 * p_dot[:, 1:] - p_dot[:, :1] * e + np.cross(e, p_dot[:, 1:]))
    np.testing.assert_allclose(omega[0], (1.92, -0.96, 0.48), atol=1e-13)


def delta_robot(theta: Any) -> spatial.Mechanism:
    """Return the robot with its arms driven by three angles below the horizontal."""
    m = spatial.Mechanism("delta_robot")
    platform = m.body("platform", (0.05, 0.02, -0.44))
    for k in range(3):
        turn = 2 * np.pi * k / 3
        out, hinge = np.array([np.cos(turn), np.sin(turn), 0]), [-np.sin(turn), np.cos(turn), 0]
        frame = np.column_stack([out, hinge, Z])
        start = float(theta[k].subs(kc.t, 0))
        c, s = np.cos(start), np.sin(start)
        arm_frame = frame @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        arm = m.body(f"arm_{k}", 0.2 * out, arm_frame)
        m.add(spatial.Revolute(f"hinge_{k}", m.ground, 0.2 * out, hinge, arm, (0, 0, 0), Y))
        # a positive turn about the hinge lowers the arm
        motor = spatial.RelativeRotation(f"motor_{k}", m.ground, hinge, out, arm, Y, X, theta[k])
        m.add(motor)
        for side, shift in (("a", 0.04), ("b", -0.04)):
            m.add(
                spatial.Distance(
                    f"rod_{k}{side}",
                    arm,
                    (0.25, shift, 0),
                    platform,
                    0.05 * out + shift * np.array(hinge),
                    0.5,
                )
            )
    return m


PLATFORM = {
    0.0: (0.0508989265709321, 0.0186259702186008, -0.441919284266348),
    0.5: (0.0240556635973585, -0.0140168655364167, -0.446597755104515),
    1.0: (0.013817032075951, -0.0256411497748343, -0.459639616520703),
    2.0: (0.0516302821000036, 0.00283726745099806, -0.500114354391823),
}
ACCELERATION = {
    0.0: (-0.000926859914193208, 0.00521062838806572, 0.0202047837429124),
    2.0: (-0.0152878028425347, -0.0925743276252026, 0.07919872007418),
}


def test_delta_robot() -> None:
    import sympy

    t = kc.t
    theta = (
        0.3 + 0.2 * sympy.sin(t),
        0.5 + 0.1 * t,
        0.6 - 0.15 * sympy.sin(2 * t),
    )
    solution = kc.solve(kc.compile(delta_robot(theta)), list(PLATFORM))
    assert solution.success, solution.message
    place = np.column_stack([solution[f"{axis}_platform"] for axis in "xyz"])
    np.testing.assert_allclose(place, list(PLATFORM.values()), rtol=0, atol=1e-13)
    rates = np.column_stack([solution[f"{axis}_platform_ddot"] for axis in "xyz"])
    np.testing.assert_allclose(rates[[0, -1]], list(ACCELERATION.values()), rtol=0, atol=1e-12)
    np.testing.assert_allclose(abs(solution["e0_platform"]), 1, atol=1e-14)
