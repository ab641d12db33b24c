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
