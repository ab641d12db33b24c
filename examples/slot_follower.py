"""A slotted disc swings a rocker: the pin at the end of the rocker runs in the disc's curved slot.

Source: section 2.7 of the constraint catalogue (point-follower); the dimensions are ours. The slot
is a closed curve about the centre of the disc with two lobes, so that the rocker swings twice a
turn. alpha_pin, the polar angle of the pin in the slot, is a coordinate.
"""

import numpy as np
import sympy

import kincompile as kc

mechanism = kc.Mechanism("slot_follower", end=1.0, points=121)
mean = mechanism.parameter("mean", 0.05, unit="m")
wave = mechanism.parameter("wave", 0.01, unit="m")
arm = mechanism.parameter("arm", 0.085, unit="m")
omega = mechanism.parameter("omega", 6.283185307179586, unit="rad/s")

disc = mechanism.body("disc")
rocker = mechanism.body("rocker", guess=(0.06, 0.02, 2.6))
slot = mean + wave * sympy.cos(2 * kc.alpha)

mechanism.add(kc.Revolute("shaft", disc, (0, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.Revolute("pivot", rocker, (-arm / 2, 0), mechanism.ground, (0.1, 0)))
mechanism.add(kc.PointFollower("pin", rocker, (arm / 2, 0), disc, (0, 0), slot, guess=1.0))
mechanism.add(kc.AbsoluteAngle("motor", disc, omega * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    angle = np.degrees(solution["phi_rocker"])
    print(f"the rocker swings between {angle.min():.2f} and {angle.max():.2f} degrees")
    print(f"at the end of the turn it is back at {angle[-1]:.2f}, where it was: {angle[0]:.2f}")
