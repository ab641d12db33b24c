"""A four-bar linkage whose lengths are parameters; body frames at mid-link.

Source: reference case R11 (Aarhus E25, Assignment 1): lengths 10, 26, 18, ground 20, phi = 1.5 t.
"""

import numpy as np

import kincompile as kc

mechanism = kc.Mechanism("four_bar", end=10.0, points=1001)
a = mechanism.parameter("a", 10.0, unit="m")
b = mechanism.parameter("b", 26.0, unit="m")
c = mechanism.parameter("c", 18.0, unit="m")
d = mechanism.parameter("d", 20.0, unit="m")
omega = mechanism.parameter("omega", 1.5, unit="rad/s")

crank = mechanism.body("crank", guess=(5, 0, 0))
coupler = mechanism.body("coupler", guess=(20, 10, kc.pi / 4))
rocker = mechanism.body("rocker", guess=(20, 9, 1.5 * kc.pi))

mechanism.add(kc.Revolute("A", crank, (-a / 2, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.Revolute("B", crank, (a / 2, 0), coupler, (-b / 2, 0)))
mechanism.add(kc.Revolute("C", coupler, (b / 2, 0), rocker, (-c / 2, 0)))
mechanism.add(kc.Revolute("D", rocker, (c / 2, 0), mechanism.ground, (d, 0)))
mechanism.add(kc.AbsoluteAngle("motor", crank, omega * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    for t in (0, 1, 5, 10):
        coupler_angle, rocker_angle = (
            solution[name][100 * t] for name in ("phi_coupler", "phi_rocker")
        )
        print(f"t = {t:<2}  phi_coupler = {coupler_angle:.6f}, phi_rocker = {rocker_angle:.6f}")
