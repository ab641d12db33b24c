"""Mechanisms whose motion has a closed form."""

import pytest

import kincompile as kc


@pytest.fixture
def slider_crank():
    m = kc.Mechanism("slider_crank", end=1.0, points=1)
    r, length, e = (
        m.parameter("r", 0.1, "m"),
        m.parameter("L", 0.3, "m"),
        m.parameter("e", 0.02, "m"),
    )
    theta = m.parameter("theta", 1.1, "rad")
    m.parameter("unused", 1.0, "m")
    crank, rod = m.body("crank", (0, 0, 1.1)), m.body("rod", (0.05, 0.09, -0.2))
    slider = m.body("slider", (0.33, 0.02, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (r, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (length, 0), slider, (0, 0)))
    m.add(kc.Translational("D", m.ground, (0, e), (1, 0), slider, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, theta + kc.t))
    return m


def fourbar(name="four_bar", **values):
    """Return a four-bar whose crank turns by t, with a point P in the frame of its rod."""
    m = kc.Mechanism(name, end=6.283185307179586, points=73)
    lengths = {"r1": 3.7, "r2": 2.0, "r3": 4.0, "r4": 2.7, "u": 1.7, "v": 1.7, **values}
    r1, r2, r3, r4, u, v = (m.parameter(key, value, "m") for key, value in lengths.items())
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (1.7, 1, 0.8))
    rocker = m.body("rocker", (3.7, 0, 1.9))
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (r2, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (r3, 0), rocker, (r4, 0)))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, (r1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    m.point("P", rod, (u, v))
    return m
