"""A slider-crank in full coordinates: crank, connecting rod and slider, three coordinates each.

Source: reference case R5 (sliderCrankKIN.adm). The crank turns as t^2, so that it starts at rest
with a non-zero acceleration.
"""

import numpy as np

import kincompile as kc

mechanism = kc.Mechanism("slider_crank", end=2.0, points=201)
crank = mechanism.body("crank", guess=(2, 0, 0))
rod = mechanism.body("rod", guess=(7, 0, 0))
slider = mechanism.body("slider", guess=(10, 0, 0))

mechanism.add(kc.Revolute("main_bearing", crank, (-2, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.Revolute("crank_pin", crank, (2, 0), rod, (-3, 0)))
mechanism.add(kc.Revolute("wrist_pin", rod, (3, 0), slider, (0, 0)))
mechanism.add(kc.AbsoluteY("guide_height", slider, (0, 0), 0))
mechanism.add(kc.AbsoluteAngle("guide_angle", slider, 0))
mechanism.add(kc.AbsoluteAngle("motor", crank, kc.t**2))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    for t in (0, 1, 2):
        x, x_dot, x_ddot = (
            solution[name][100 * t] for name in ("x_slider", "x_slider_dot", "x_slider_ddot")
        )
        print(f"t = {t}  slider: x = {x:.6f}, x_dot = {x_dot:.6f}, x_ddot = {x_ddot:.6f}")
