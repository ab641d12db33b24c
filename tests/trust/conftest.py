"""Mechanisms that go wrong, or look as if they did."""

import warnings

import numpy as np
import pytest

import kincompile as kc


def double_parallelogram(*, driven=True, third=1.0):
    """Return three parallel cranks under one coupler; the third may have another length."""
    m = kc.Mechanism("double_parallelogram")
    cranks = [m.body(f"crank{k}", guess=(2 * k + 0.35, 0.35, 0.8)) for k in range(3)]
    coupler = m.body("coupler", guess=(2.7, 0.7, 0))
    lengths = (1.0, 1.0, third)
    for k, (crank, length) in enumerate(zip(cranks, lengths, strict=True)):
        m.add(kc.Revolute(f"foot{k}", m.ground, (2 * k, 0), crank, (-length / 2, 0)))
    for k, (crank, length) in enumerate(zip(cranks, lengths, strict=True)):
        m.add(kc.Revolute(f"head{k}", crank, (length / 2, 0), coupler, (2 * k - 2, 0)))
    if driven:
        m.add(kc.AbsoluteAngle("motor", cranks[0], kc.t + 0.8))
    return m


def scott_russell_pair():
    """Return a rod that a crank holds by its middle and two guides by its ends: one is enough."""
    m = kc.Mechanism("scott_russell")
    crank = m.body("crank", guess=(0.4, 0.3, 0.6))
    rod = m.body("rod", guess=(0.8, 0.6, -0.6))
    m.add(kc.Revolute("bearing", m.ground, (0, 0), crank, (-0.5, 0)))
    m.add(kc.Revolute("middle", crank, (0.5, 0), rod, (0, 0)))
    m.add(kc.AbsoluteY("floor", rod, (1, 0), 0))
    m.add(kc.AbsoluteX("wall", rod, (-1, 0), 0))
    m.add(kc.AbsoluteAngle("motor", crank, 0.3 + kc.t / 2))
    return m


def four_bar(lengths=(0.2, 0.5, 0.4, 0.5), *, start=1.0, speed=1.0, unit="m", guess=None):
    """Return crank, coupler and rocker on a ground link; a guess is the angles of the three."""
    a, b, c, d = lengths
    m = kc.Mechanism("four_bar", length_unit=unit)
    angles = guess or (start, 0.4, 1.2)
    turn = [np.array([np.cos(phi), np.sin(phi)]) for phi in angles]
    places = [turn[0] * a / 2, turn[0] * a + turn[1] * b / 2, np.array([d, 0]) + turn[2] * c / 2]
    crank, coupler, rocker = (
        m.body(name, guess=(*place.tolist(), phi))
        for name, place, phi in zip(("crank", "coupler", "rocker"), places, angles, strict=True)
    )
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-a / 2, 0)))
    m.add(kc.Revolute("B", crank, (a / 2, 0), coupler, (-b / 2, 0)))
    m.add(kc.Revolute("C", coupler, (b / 2, 0), rocker, (c / 2, 0)))
    m.add(kc.Revolute("D", m.ground, (d, 0), rocker, (-c / 2, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, start + speed * kc.t))
    return m


def five_bar(*, drivers=2):
    """Return five links in a loop with two degrees of freedom, and so many drivers."""
    m = kc.Mechanism("five_bar")
    names = ("left", "left_rod", "right_rod", "right")
    guesses = ((-0.25, 0.45, 2.0), (0.0, 1.2, 0.9), (0.9, 1.2, 2.2), (1.25, 0.45, 1.1))
    bodies = [m.body(name, guess=guess) for name, guess in zip(names, guesses, strict=True)]
    left, left_rod, right_rod, right = bodies
    m.add(kc.Revolute("A", m.ground, (0, 0), left, (-0.5, 0)))
    m.add(kc.Revolute("B", left, (0.5, 0), left_rod, (-0.6, 0)))
    m.add(kc.Revolute("C", left_rod, (0.6, 0), right_rod, (0.6, 0)))
    m.add(kc.Revolute("D", right_rod, (-0.6, 0), right, (0.5, 0)))
    m.add(kc.Revolute("E", m.ground, (1, 0), right, (-0.5, 0)))
    motors = ((left, 2.0), (right, 1.1), (left_rod, 0.9), (right_rod, 2.2))
    for k, (body, angle) in enumerate(motors[:drivers], 1):
        m.add(kc.AbsoluteAngle(f"motor{k}", body, angle + kc.t / (3 + k)))
    return m


@pytest.fixture
def compiled():
    """Return `kc.compile` without the warning of redundant constraints."""

    def compiled(model):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kc.RedundantConstraintWarning)
            return kc.compile(model)

    return compiled


@pytest.fixture(scope="session")
def build():
    """Return the mechanisms of this folder by name."""
    makers = (double_parallelogram, scott_russell_pair, four_bar, five_bar)
    return {maker.__name__: maker for maker in makers}
