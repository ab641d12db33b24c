"""A rack and pinion: the pinion turns to and fro on the ground and drives the rack below it.

Source: section 2.6 of the constraint catalogue (rack and pinion); the dimensions are ours. The rack
travels R times the angle of the pinion.
"""

import numpy as np
import sympy

import kincompile as kc

mechanism = kc.Mechanism("rack_and_pinion", end=2.0, points=101)
R = mechanism.parameter("R", 0.05, unit="m")
swing = mechanism.parameter("swing", 2.0, unit="rad")

rack = mechanism.body("rack", guess=(0, -R, 0))
pinion = mechanism.body("pinion")

# At the start point (0, 0) of the rack touches the lowest point of the pinion, at its angle 3 pi/2.
mechanism.add(kc.Revolute("bearing", pinion, (0, 0), mechanism.ground, (0, 0)))
mechanism.add(
    kc.RackAndPinion("mesh", rack, (-0.2, 0), (0, 0), 0, pinion, (0, 0), R, 3 * kc.pi / 2)
)
mechanism.add(kc.AbsoluteAngle("guide", rack, 0))
mechanism.add(kc.AbsoluteAngle("motor", pinion, swing * sympy.sin(kc.pi * kc.t)))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    for k in (0, 25, 50, 75):
        angle, travel = solution["phi_pinion"][k], solution["x_rack"][k]
        print(f"t = {solution.t[k]:.1f}  pinion {angle:+.3f} rad, rack {travel:+.4f} m")
