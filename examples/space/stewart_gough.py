"""A Stewart-Gough platform: six legs of given lengths carry a platform wherever it shall be.

Source: dimensions ours. A leg is the distance of its two balls, which is a driver.
"""

import numpy as np
import sympy

import kincompile as kc
from kincompile import spatial

mechanism = m = spatial.Mechanism("stewart_gough", end=2.0, points=201)
base = m.parameter("base", 0.6, "m")
top = m.parameter("top", 0.35, "m")
height = m.parameter("height", 0.7, "m")
stroke = m.parameter("stroke", 0.04, "m")

platform = m.body("platform", (0, 0, height))
spread = 12 * sympy.pi / 180
rest = sympy.sqrt(
    height**2 + base**2 + top**2 - 2 * base * top * sympy.cos(sympy.pi / 3 - 2 * spread)
)
for k in range(6):
    side = 1 - 2 * (k % 2)  # balls come in pairs, and a leg goes to the next pair
    below = sympy.pi / 3 * 2 * (k // 2) + side * spread
    above = sympy.pi / 3 * (2 * (k // 2) + side) - side * spread
    foot = (base * sympy.cos(below), base * sympy.sin(below), 0)
    ball = (top * sympy.cos(above), top * sympy.sin(above), 0)
    way = stroke * sympy.sin(sympy.pi * kc.t + k) - stroke * sympy.sin(k)
    m.add(spatial.Distance(f"leg_{k + 1}", m.ground, foot, platform, ball, rest + way))

if __name__ == "__main__":
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    print(solution.message)
    turned = spatial.orientation(solution, platform)
    print(f"the platform turns by up to {np.degrees(turned.magnitude().max()):.3f} degrees")
    for axis in "xyz":
        way = 1e3 * solution[f"{axis}_platform"]
        print(f"{axis} from {way.min():.3f} to {way.max():.3f} mm")
