"""A disc cam known by twelve measured radii lifts a pointed follower.

Source: section 2.7 of the constraint catalogue (point-follower); the dimensions are ours. Between
the measured radii the profile is a periodic spline of degree five, so that the acceleration has no
kinks. alpha_contact, the polar angle of the tip on the cam, is a coordinate.
"""

import numpy as np

import kincompile as kc

RADII = (40, 40, 42, 47, 53, 58, 60, 58, 53, 47, 42, 40)  # mm, every 30 degrees

mechanism = kc.Mechanism("cam_by_table", end=1.0, points=121)
omega = mechanism.parameter("omega", 6.283185307179586, unit="rad/s")

cam = mechanism.body("cam")
follower = mechanism.body("follower", guess=(0, 0.1, 0))
angles = [2 * np.pi * k / len(RADII) for k in range(len(RADII))]
profile = (angles, [radius / 1000 for radius in RADII])

mechanism.add(kc.Revolute("shaft", cam, (0, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.Translational("guide", "ground", (0, 0), (0, 1), follower, (0, 0), (0, 1)))
mechanism.add(kc.PointFollower("contact", follower, (0, -0.05), cam, (0, 0), profile, guess=1.6))
mechanism.add(kc.AbsoluteAngle("motor", cam, omega * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    tip = solution["y_follower"] - 0.05
    at = int(tip.argmax())
    angle = np.degrees(solution["phi_cam"][at])
    print(f"highest: {1000 * tip[at]:.3f} mm at a cam angle of {angle:.0f} degrees")
