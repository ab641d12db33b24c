"""The mechanisms that are compiled: the four-bar of the examples, and another of its types."""

from __future__ import annotations

import kincompile as kc


def four_bar() -> kc.Mechanism:
    """Return the four-bar of reference case R11, as in examples/four_bar.py: frames at mid-link."""
    m = kc.Mechanism("four_bar")
    a, b, c, d = (m.parameter(name, value, "m") for name, value in LENGTHS.items())
    omega = m.parameter("omega", OMEGA, "rad/s")
    crank = m.body("crank", guess=(5, 0, 0))
    coupler = m.body("coupler", guess=(20, 10, kc.pi / 4))
    rocker = m.body("rocker", guess=(20, 9, 1.5 * kc.pi))
    m.add(kc.Revolute("A", crank, (-a / 2, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (a / 2, 0), coupler, (-b / 2, 0)))
    m.add(kc.Revolute("C", coupler, (b / 2, 0), rocker, (-c / 2, 0)))
    m.add(kc.Revolute("D", rocker, (c / 2, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, omega * kc.t))
    return m


def crank_rocker() -> kc.Mechanism:
    """Return a second mechanism of the same joint types.

    Body frames at the pins, other names and numbers, a driver that starts at an angle: nothing but
    the joint types is the same.
    """
    m = kc.Mechanism("crank_rocker")
    r1, r2, r3, r4 = (
        m.parameter(f"r{k}", value, "m") for k, value in enumerate((4.0, 1.0, 3.5, 2.5), 1)
    )
    start = m.parameter("start", 0.5, "rad")
    rate = m.parameter("rate", 2.0, "rad/s")
    arm = m.body("arm", guess=(0, 0, 0.5))
    bar = m.body("bar", guess=(0.9, 0.5, 0.6))
    swing = m.body("swing", guess=(4, 0, 1.7))
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.Revolute("P", arm, (r2, 0), bar, (0, 0)))
    m.add(kc.Revolute("Q", bar, (r3, 0), swing, (r4, 0)))
    m.add(kc.Revolute("R", swing, (0, 0), m.ground, (r1, 0)))
    m.add(kc.AbsoluteAngle("drive", arm, start + rate * kc.t))
    return m


LENGTHS = {"a": 10.0, "b": 26.0, "c": 18.0, "d": 20.0}
"""Lengths of crank, coupler, rocker and ground of the four-bar."""

OMEGA = 1.5
"""Speed of its crank."""
