"""A planetary gear train: a driven sun, an arm that carries a planet, and a fixed ring.

Source: section 2.6 of the constraint catalogue (gear set, internal gear); the dimensions are ours.
The ring is part of the ground and an internal gear, which a negative radius says. With the radii
given the arm turns once while the sun turns five times: 1 + ring / sun.
"""

import numpy as np

import kincompile as kc

mechanism = kc.Mechanism("gear_train", end=5.0, points=101)
R_sun = mechanism.parameter("R_sun", 0.02, unit="m")
R_planet = mechanism.parameter("R_planet", 0.03, unit="m")
omega = mechanism.parameter("omega", 6.283185307179586, unit="rad/s")
R_ring = R_sun + 2 * R_planet
R_arm = R_sun + R_planet

ground = mechanism.ground
sun = mechanism.body("sun")
arm = mechanism.body("arm")
planet = mechanism.body("planet", guess=(R_arm, 0, 0))

centre = (0, 0)
mechanism.add(kc.Revolute("sun_bearing", sun, centre, ground, centre))
mechanism.add(kc.Revolute("arm_bearing", arm, centre, ground, centre))
mechanism.add(kc.Revolute("planet_bearing", planet, centre, arm, (R_arm, 0)))
mechanism.add(kc.Gear("sun_mesh", sun, centre, R_sun, 0, planet, centre, R_planet, kc.pi))
mechanism.add(kc.Gear("ring_mesh", ground, centre, -R_ring, 0, planet, centre, R_planet, kc.pi))
mechanism.add(kc.AbsoluteAngle("motor", sun, omega * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    for name in ("sun", "arm", "planet"):
        print(f"turns of the {name}: {solution[f'phi_{name}'][-1] / (2 * np.pi):.6f}")
