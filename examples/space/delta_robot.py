"""A Delta robot: three arms, and pairs of rods that keep the platform parallel to the base.

Source: R. Clavel's robot, dimensions ours. The platform is driven along a path, and what its
motors must do are the joint angles: the inverse problem, by the equations of the forward one.
"""

import numpy as np
import sympy

import kincompile as kc
from kincompile import spatial

X, Y, Z, origin = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)

mechanism = m = spatial.Mechanism("delta_robot", end=2.0, points=201)
base = m.parameter("base", 0.2, "m")
arm_length = m.parameter("arm", 0.25, "m")
rod = m.parameter("rod", 0.5, "m")
top = m.parameter("platform", 0.05, "m")
half = 0.04  # of the distance between the rods of a pair

t = kc.t
path = (0.08 * sympy.sin(2 * t), 0.05 * sympy.cos(3 * t), -0.5 + 0.04 * sympy.sin(t))
platform = m.body("platform", (0, 0.05, -0.5))
for k in range(3):
    c, s = sympy.cos(2 * sympy.pi * k / 3), sympy.sin(2 * sympy.pi * k / 3)
    out, hinge = (c, s, 0), (-s, c, 0)
    place = (base * c, base * s, 0)
    # x goes out along the arm, which hangs at 35 degrees or so; y is the hinge, about which a
    # positive turn lowers it
    arm = m.body(f"arm_{k + 1}", place, x=(0.8 * c, 0.8 * s, -0.6), y=hinge)
    m.add(spatial.Revolute(f"hinge_{k + 1}", m.ground, place, hinge, arm, origin, Y))
    for side, shift in (("a", half), ("b", -half)):
        ball = (top * c - shift * s, top * s + shift * c, 0)
        ends = (arm, (arm_length, shift, 0), platform, ball)
        m.add(spatial.Distance(f"rod_{k + 1}{side}", *ends, rod))
    m.add(spatial.JointAngle(f"motor_{k + 1}", m.ground, hinge, out, arm, Y, X, guess=0.6))
for kind, value in zip(
    (spatial.AbsoluteX, spatial.AbsoluteY, spatial.AbsoluteZ), path, strict=True
):
    m.add(kind(f"path_{kind.__name__[-1].lower()}", platform, origin, value))

if __name__ == "__main__":
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    print(solution.message)
    for k in (1, 2, 3):
        angle, rate = solution[f"theta_motor_{k}"], solution[f"theta_motor_{k}_dot"]
        print(f"motor {k}: {angle.min():.6f} to {angle.max():.6f} rad")
        print(f"    at up to {abs(rate).max():.6f} rad/s")
    turned = spatial.orientation(solution, platform)
    print(f"the platform turns by {turned.magnitude().max():.1e} rad")
