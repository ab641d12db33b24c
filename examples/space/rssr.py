"""An RSSR linkage: a crank and a rocker about crossed axes, and a rod with a ball at either end.

Source: dimensions ours. The rod is a distance: its own rotation about itself moves nothing.
"""

import numpy as np

import kincompile as kc
from kincompile import spatial

X, Y, Z, origin = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)

mechanism = m = spatial.Mechanism("rssr", end=2.0, points=201)
a = m.parameter("crank", 0.1, "m")
b = m.parameter("rod", 0.32, "m")
c = m.parameter("rocker", 0.25, "m")
place = (m.parameter("d", 0.3, "m"), 0.05, m.parameter("h", -0.12, "m"))

crank = m.body("crank", origin)
rocker = m.body("rocker", place)
m.add(spatial.Revolute("O", m.ground, origin, Z, crank, origin, Z))
m.add(spatial.Revolute("P", m.ground, place, Y, rocker, origin, Y))
pin, end = m.point("A", crank, (a, 0, 0)), m.point("B", rocker, (0, 0, c))
m.add(spatial.Distance("rod", pin, end, b))
m.add(spatial.RelativeRotation("motor", m.ground, Z, X, crank, Z, X, kc.pi * kc.t))
swing = spatial.JointAngle("swing", m.ground, Y, Z, rocker, Y, Z)
m.add(swing)
m.output(
    "transmission",
    spatial.outputs.transmission_angle(pin, end, m.point("P", rocker, origin)),
    "rad",
)

if __name__ == "__main__":
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    print(solution.message)
    angle, pressure = np.degrees(solution["theta_swing"]), np.degrees(solution["transmission"])
    print(f"the rocker swings from {angle.min():.3f} to {angle.max():.3f} degrees")
    print(f"transmission angle from {pressure.min():.3f} to {pressure.max():.3f} degrees")
