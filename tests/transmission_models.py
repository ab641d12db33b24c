"""Mechanisms of the tables in `transmission_golden.json`, to be taken as functions."""

import math

import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.spatial import outputs

SIDES = (("left", 1), ("right", -1))


def crank_rocker(a=0.04, b=0.12, c=0.08, d=0.13, *, psi=1.74, motor=1.5):
    """Return T1a, or with other lengths T1b; without a motor it is free."""
    m = kc.Mechanism("four_bar")
    lengths = [m.parameter(*given, "m") for given in zip("abcd", (a, b, c, d), strict=True)]
    crank = m.body("crank", (0, 0, 1.5))
    coupler = m.body("coupler", (a * math.cos(1.5), a * math.sin(1.5), 0.2))
    rocker = m.body("rocker", (d, 0, psi))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (lengths[0], 0), coupler, (0, 0)))
    m.add(kc.Revolute("C", coupler, (lengths[1], 0), rocker, (lengths[2], 0)))
    m.add(kc.Revolute("D", m.ground, (lengths[3], 0), rocker, (0, 0)))
    if motor is not None:
        m.add(kc.AbsoluteAngle("motor", crank, motor))
    return m


def foot_on_a_cross(name):
    """Return a foot that turns about pitch and roll, which are its outputs."""
    m = spatial.Mechanism(name)
    foot = m.body("foot", (0, 0, 0))
    at, first, second = (0, 0, 0), (0, 1, 0), (1, 0, 0)
    m.add(spatial.Universal("cross", m.ground, at, first, foot, at, second))
    x, y = foot.direction((1, 0, 0)), foot.direction((0, 1, 0))
    m.output("pitch", outputs.angle((1, 0, 0), x, about=(0, 1, 0)), "rad")
    m.output("roll", outputs.angle((0, 1, 0), y, about=x), "rad")
    return m, foot


def ankle():
    """Return T3-SPU: the actuators are distances."""
    m, foot = foot_on_a_cross("ankle")
    for name, side in SIDES:
        ends = (-0.045, side * 0.036, 0.24), (-0.052, side * 0.034, 0.015)
        m.add(spatial.Distance(name, m.ground, ends[0], foot, ends[1], 0.2251))
    return m


def ankle_with_rods():
    """Return T3-SPU with cylinders and rods as bodies, each pair of which may spin."""
    m, foot = foot_on_a_cross("ankle_with_rods")
    at, z = (0, 0, 0), (0, 0, 1)
    for name, side in SIDES:
        top, ball = (-0.045, side * 0.036, 0.24), (-0.052, side * 0.034, 0.015)
        cylinder, rod = m.body(f"cylinder_{name}", top), m.body(f"rod_{name}", ball)
        m.add(spatial.Spherical(f"top_{name}", m.ground, top, cylinder, at))
        m.add(spatial.Spherical(f"ball_{name}", foot, ball, rod, at))
        slide = cylinder, at, z, (1, 0, 0), rod, at, z, (0, 1, 0)
        m.add(spatial.Translational(f"slide_{name}", *slide))
        m.add(spatial.RelativeTranslation(name, cylinder, at, z, rod, at, -0.2251))
    return m


def five_bar(*, first=2.3, second=0.9, end=(-0.0024, 0.0956)):
    """Return T6; without a value its second motor is free."""
    m, rods = kc.Mechanism("five_bar"), []
    places = [0.9 if x is None else float(sympy.sympify(x).subs(kc.t, 0)) for x in (first, second)]
    for number, x, turned in ((1, -0.059, places[0]), (2, 0.059, places[1])):
        elbow = x + 0.09 * math.cos(turned), 0.09 * math.sin(turned)
        slope = math.atan2(end[1] - elbow[1], end[0] - elbow[0])
        arm = m.body(f"arm_{number}", (x, 0, turned))
        rods.append(m.body(f"rod_{number}", (*elbow, slope)))
        m.add(kc.Revolute(f"M{number}", m.ground, (x, 0), arm, (0, 0)))
        m.add(kc.Revolute(f"E{number}", arm, (0.09, 0), rods[-1], (0, 0)))
        value = first if number == 1 else second
        if value is not None:
            m.add(kc.AbsoluteAngle(f"motor_{number}", arm, value))
    m.add(kc.Revolute("P", rods[0], (0.12, 0), rods[1], (0.12, 0)))
    m.point("end", rods[0], (0.12, 0))
    return m


def differential():
    """Return T7a, two equations of free coordinates."""
    u_1, u_2, x_1, x_2 = sympy.symbols("m_1 m_2 x_1 x_2")
    first, second = u_1 / 50, u_2 / -60
    equations = x_1 - (first + second) / 4 - 0.1, x_2 - (first - second) / 3 + 0.2
    return kc.ConstraintSystem("differential", "m_1 m_2 x_1 x_2", equations)


def remote_drive():
    """Return T7b, the "four-bar linkage" transmission of ros2_control."""
    u_1, u_2, x_1, x_2 = sympy.symbols("m_1 m_2 x_1 x_2")
    equations = x_1 - u_1 / 100 - 0.1, 1.5 * (x_2 + 0.2) - (u_2 / -60 - u_1 / 100)
    return kc.ConstraintSystem("remote_drive", "m_1 m_2 x_1 x_2", equations)


def bevel_wrist():
    """Return T7c: its inputs are the motors, its side bevels turn half as fast."""
    u_1, u_2, x_1, x_2 = sympy.symbols("m_1 m_2 x_1 x_2")
    sides = u_1 / 2, u_2 / 2
    equations = x_1 - (sides[0] + sides[1]) / 2, x_2 - (sides[0] - sides[1]) * 2 / 3
    return kc.ConstraintSystem("bevel_wrist", "m_1 m_2 x_1 x_2", equations)
