"""A screw jack with a lever: turns of a spindle lift a carriage, which turns a lever.

The screw holds the carriage but for its turning, which a guide prevents by one equation. It counts
its turns: eight of them in this motion. The thread is left-handed, its pitch negative: the carriage
rises where the spindle turns to the left.

Source: dimensions ours.
"""

import numpy as np
import sympy

import kincompile as kc
from kincompile import spatial

X, Y, Z, origin = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)

mechanism = m = spatial.Mechanism("screw_jack", end=1.6, points=201)
pitch = m.parameter("pitch", -0.005, "m")
length = m.parameter("lever", 0.25, "m")
rod = m.parameter("rod", 0.22, "m")
pivot, start = (0.3, 0, 0.1), (0, 0, 0.12)

spindle, carriage = m.body("spindle", origin), m.body("carriage", start)
lever = m.body("lever", pivot, axis=Y, angle=0.98)
m.add(spatial.Revolute("bearing", m.ground, origin, Z, spindle, origin, Z))
m.add(spatial.Screw("screw", spindle, start, Z, X, carriage, origin, Z, X, pitch))
m.add(spatial.Dot1("guide", m.ground, Y, carriage, X, 0))
m.add(spatial.Revolute("pivot", m.ground, pivot, Y, lever, origin, Y))
m.add(spatial.Distance("rod", carriage, (0.05, 0.03, 0), lever, (-length, 0, 0), rod))
turning = 10 * sympy.pi * kc.t + 0.5 * sympy.sin(3 * kc.t)
m.add(spatial.RelativeRotation("motor", m.ground, Z, X, spindle, Z, X, turning))
m.add(spatial.JointAngle("psi", m.ground, Y, X, lever, Y, X, guess=0.98))

if __name__ == "__main__":
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    print(solution.message)
    heights = 1e3 * solution["z_carriage"]
    print(f"the carriage rises from {heights[0]:.4f} to {heights[-1]:.4f} mm")
    print(f"the lever turns to {solution['theta_psi'][-1]:.6f} rad")
