"""Mechanisms in space for the tests of what is drawn of them."""

import numpy as np

import kincompile as kc
from kincompile import spatial

X, Y, Z = np.eye(3)


def slider_crank(name: str = "spatial_slider_crank") -> spatial.Mechanism:
    """Return a crank about x whose rod, with a ball and a cross, moves a slider along x."""
    m = spatial.Mechanism(name, end=1.0, points=41)
    r = m.parameter("r", 0.08, unit="m")
    crank = m.body("crank", (0, 0.1, 0.12))
    joint, pin = np.array([0, 0.1, 0.2]), np.array([0.2, 0, 0])
    rod = m.body("rod", (joint + pin) / 2, x=pin - joint, y=(0, 1, 1))
    slider = m.body("slider", pin)
    m.add(spatial.Revolute("O", m.ground, (0, 0.1, 0.12), X, crank, (0, 0, 0), X))
    m.add(spatial.Spherical("A", crank, (0, 0, r), rod, (-0.15, 0, 0)))
    m.add(spatial.Universal("B", rod, (0.15, 0, 0), Y, slider, (0, 0, 0), X))
    m.add(spatial.Translational("C", m.ground, (0, 0, 0), X, Y, slider, (0, 0, 0), X, Z))
    m.add(spatial.RelativeRotation("motor", m.ground, X, Z, crank, X, Z, 6 * kc.t))
    m.point("tip", rod, (0, 0.05, 0))
    return m
