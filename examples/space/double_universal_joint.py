"""Two universal joints: what the first makes uneven the second makes even, if the yokes agree.

The shafts have the angle beta between them, and the last is parallel to the first. With the yokes
of the middle shaft in one plane, phase = 0, the last turns as the first does, exactly; at 90
degrees tan(theta_3) = tan(theta_1)/cos(beta)^2. The middle shaft is held by its crosses alone.
"""

import numpy as np
import sympy

import kincompile as kc
from kincompile import spatial

X, Y, Z, origin = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)

mechanism = m = spatial.Mechanism("double_universal_joint", end=2.0, points=201)
beta = m.parameter("beta", 35 * kc.deg, "rad")
phase = m.parameter("phase", 0, "rad")
length = m.parameter("length", 0.4, "m")
speed = m.parameter("speed", 3.0, "rad/s")
c, s = sympy.cos(beta), sympy.sin(beta)
along, cross = (c, s, 0), (length * c, length * s, 0)
apart = 0.1  # bearings from their crosses
behind, beyond = (-apart, 0, 0), (apart, 0, 0)

first = m.body("first", origin)
middle = m.body("middle", origin, axis=Z, angle=beta)
last = m.body("last", cross)
m.add(spatial.Revolute("bearing", m.ground, behind, X, first, behind, X))
m.add(spatial.Universal("U", first, origin, Y, middle, origin, Z))
yoke = (0, -sympy.sin(phase), sympy.cos(phase))
other = (0, sympy.cos(phase), sympy.sin(phase) * c)  # at a right angle to it at t = 0
m.add(spatial.Universal("V", middle, (length, 0, 0), yoke, last, origin, other))
end = (cross[0] + apart, *cross[1:])
m.add(spatial.Cylindrical("end", m.ground, end, X, last, beyond, X))
m.add(spatial.RelativeRotation("motor", m.ground, X, Y, first, X, Y, speed * kc.t))
m.add(spatial.JointAngle("middle", m.ground, along, Z, middle, X, Z))
m.add(spatial.JointAngle("last", m.ground, X, Z, last, X, Z))

if __name__ == "__main__":
    module = kc.compile(m)
    for yokes in (0.0, np.pi / 2):
        solution = kc.solve(module, np.linspace(0, m.end, m.points), {"phase": yokes})
        print(solution.message)
        for shaft in ("middle", "last"):
            rate = solution[f"theta_{shaft}_dot"]
            print(f"{np.degrees(yokes):.0f}: {shaft} {rate.min():.6f} to {rate.max():.6f} rad/s")
