"""An inverted slider-crank: the crank pin carries a slider on a guide that swings on the ground.

Source: reference case R12 (Aarhus E25, Assignment 2): crank length 4, guide length 16, crank angle
80 degrees + 1.5 t. The translational joint connects two moving bodies.
"""

import numpy as np

import kincompile as kc

DEGREE = kc.pi / 180

mechanism = kc.Mechanism("inverted_slider_crank", end=4.0, points=401)
crank = mechanism.body("crank", guess=(0.724, 1.864, 80 * DEGREE))
slider = mechanism.body("slider", guess=(1.45, 2, 15 * DEGREE))
guide = mechanism.body("guide", guess=(-0.174821119075, 1.663292392775, 15 * DEGREE))

mechanism.add(kc.Revolute("crank_bearing", crank, (-2, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.Revolute("crank_pin", crank, (2, 0), slider, (0, -2)))
mechanism.add(kc.Translational("sleeve", slider, (0, 0), (1, 0), guide, (8, 0), (1, 0)))
mechanism.add(kc.Revolute("guide_bearing", guide, (-8, 0), mechanism.ground, (-8, 0)))
mechanism.add(kc.AbsoluteAngle("motor", crank, 80 * DEGREE + 1.5 * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    for t in (0, 1, 2, 4):
        print(f"t = {t}  phi_guide = {solution['phi_guide'][100 * t]:.6f}")
