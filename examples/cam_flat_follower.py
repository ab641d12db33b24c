"""A cam lifts a follower with a flat face, which slides straight up and down.

Source: section 2.7 of the constraint catalogue (cam, flat-faced follower); the dimensions are ours.
The cam's radius grows by `lift` over half a turn; it stays convex while lift < 2 base. The contact
parameter alpha_contact, the polar angle of the touching point on the cam, is a coordinate.
"""

import numpy as np
import sympy

import kincompile as kc

mechanism = kc.Mechanism("cam_flat_follower", end=1.0, points=121)
base = mechanism.parameter("base", 0.04, unit="m")
lift = mechanism.parameter("lift", 0.02, unit="m")
omega = mechanism.parameter("omega", 6.283185307179586, unit="rad/s")

cam = mechanism.body("cam")
follower = mechanism.body("follower", guess=(0, base + lift / 2, 0))
profile = base + lift * (1 - sympy.cos(kc.alpha)) / 2

mechanism.add(kc.Revolute("shaft", cam, (0, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.Translational("guide", mechanism.ground, (0, 0), (0, 1), follower, (0, 0), (0, 1)))
mechanism.add(
    kc.CamFlatFollower("contact", cam, (0, 0), profile, follower, (0, 0), (1, 0), guess=kc.pi / 2)
)
mechanism.add(kc.AbsoluteAngle("motor", cam, omega * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    height = solution["y_follower"]
    for name, k in (("lowest", height.argmin()), ("highest", height.argmax())):
        angle = np.degrees(solution["phi_cam"][k])
        print(f"{name}: {1000 * height[k]:.3f} mm at a cam angle of {angle:.0f} degrees")
