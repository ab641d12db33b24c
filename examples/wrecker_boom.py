"""The boom of a wrecker: a cylinder lifts it, and its extension, with the hook, slides out.

Source: "The wrecker boom" of the reference cases: full coordinates, two kinematic drivers, zero
degrees of freedom. The source lecture does not publish its dimensions: those used here are ours.

The chassis stands still and is the ground, its origin on the road below the pivot of the boom. Both
drivers follow the cycloidal law: velocity and acceleration are zero at the start and at the end.
The outlines are what the bodies look like on a page; the motion does not know them.
"""

import numpy as np
import sympy

import kincompile as kc

mechanism = kc.Mechanism("wrecker_boom", end=8.0, points=161)
duration = mechanism.parameter("duration", 8.0, unit="s")
cylinder_length = mechanism.parameter("cylinder_length", 1.05, unit="m")
cylinder_stroke = mechanism.parameter("cylinder_stroke", 0.70, unit="m")
extension_reach = mechanism.parameter("extension_reach", 0.30, unit="m")
extension_stroke = mechanism.parameter("extension_stroke", 1.70, unit="m")

chassis = mechanism.ground
beam = [
    (-1.62, -0.12), (-0.45, -0.16), (-0.28, -0.28), (-0.12, -0.28), (0.05, -0.16), (1.5, -0.12),
    (1.5, 0.12), (-1.62, 0.12),
]  # fmt: skip
claw = [
    (-0.035, 0.47), (0.035, 0.47), (0.035, 0.2), (0.12, 0.12), (0.14, 0), (0.08, -0.1),
    (-0.04, -0.13), (-0.14, -0.06), (-0.16, 0.04), (-0.09, 0.05), (-0.07, -0.02), (-0.02, -0.06),
    (0.05, -0.04), (0.075, 0.01), (0.06, 0.08), (-0.035, 0.17),
]  # fmt: skip
box = [(-1.3, -0.07), (1.38, -0.07), (1.38, 0.07), (-1.3, 0.07)]
tube = [(-0.53, -0.08), (0.45, -0.08), (0.45, 0.08), (-0.53, 0.08)]
piston = [(-0.45, -0.04), (0.52, -0.04), (0.52, 0.04), (-0.45, 0.04)]

boom = mechanism.body("boom", guess=(1.5, 1.9, 0.2), outline=beam)
extension = mechanism.body("extension", guess=(2.0, 2.0, 0.2), outline=box)
barrel = mechanism.body("barrel", guess=(0.9, 1.2, 1.0), outline=tube)
rod = mechanism.body("rod", guess=(1.1, 1.3, 1.0), outline=piston)
hook = mechanism.body("hook", guess=(3.3, 1.8, 0.0), outline=claw)

along = (1, 0)
pivot, mouth, lug = (-1.5, 0), (1.5, 0), (-0.2, -0.2)  # on the boom, 3 m long
tip = (1.3, 0)  # of the extension, 2.6 m long
foot, head = (-0.45, 0), (0.45, 0)  # the ends of the cylinder, on barrel and rod

mechanism.add(kc.Revolute("boom_pivot", chassis, (0, 1.6), boom, pivot))
mechanism.add(kc.Translational("telescope", boom, mouth, along, extension, tip, along))
mechanism.add(kc.Revolute("barrel_pin", chassis, (0.7, 0.8), barrel, foot))
mechanism.add(kc.Translational("cylinder", barrel, foot, along, rod, head, along))
mechanism.add(kc.Revolute("rod_pin", boom, lug, rod, head))
mechanism.add(kc.Revolute("eye", extension, tip, hook, (0, 0.4)))
mechanism.add(kc.AbsoluteAngle("plumb", hook, 0))

elapsed = kc.t / duration
progress = elapsed - sympy.sin(2 * kc.pi * elapsed) / (2 * kc.pi)
length = cylinder_length + cylinder_stroke * progress
reach = extension_reach + extension_stroke * progress
mechanism.add(kc.TranslationalDistance("lift", barrel, foot, along, rod, head, length))
mechanism.add(kc.TranslationalDistance("extend", boom, mouth, along, extension, tip, reach))
mechanism.output("height", hook.y, "m")

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    angle = np.degrees(solution["phi_boom"])
    x_hook, y_hook = solution["x_hook"], solution["y_hook"]
    print(f"boom angle from {angle[0]:.2f} to {angle[-1]:.2f} degrees")
    print(f"hook from ({x_hook[0]:.3f}, {y_hook[0]:.3f}) to ({x_hook[-1]:.3f}, {y_hook[-1]:.3f}) m")
    speed = np.hypot(solution["x_hook_dot"], solution["y_hook_dot"])
    print(f"the hook is fastest at t = {solution.t[speed.argmax()]:.2f} s: {speed.max():.3f} m/s")
