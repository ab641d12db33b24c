"""A spatial slider-crank: the crank's axis and the slider's guide are parallel, and apart.

Source: Haug, Computer Aided Kinematics and Dynamics, chapters 10 and 12; a benchmark of IFToMM.
"""

import numpy as np
import sympy

import kincompile as kc
from kincompile import spatial

X, Y, Z, origin = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)

mechanism = m = spatial.Mechanism("spatial_slider_crank", end=1.0, points=201)
a = m.parameter("crank", 0.08, "m")
b = m.parameter("rod", 0.3, "m")
omega = m.parameter("omega", 6.0, "rad/s")
centre = (0, 0.1, 0.12)

crank = m.body("crank", centre)
rod = m.body("rod", (0.1, 0.05, 0.1), x=(2, -1, -2), y=(0, 2, -1))  # x along it, y across the guide
slider = m.body("slider", (0.2, 0, 0))
m.add(spatial.Revolute("O", m.ground, centre, X, crank, origin, X))
m.add(spatial.Spherical("A", crank, (0, 0, a), rod, (-b / 2, 0, 0)))
m.add(spatial.Universal("B", rod, (b / 2, 0, 0), Y, slider, origin, X))
m.add(spatial.Translational("C", m.ground, origin, X, Y, slider, origin, X, Z))
m.add(spatial.RelativeRotation("motor", m.ground, X, Z, crank, X, Z, omega * kc.t))
pin = m.point("A", rod, (-b / 2, 0, 0))
along = tuple(end - start for start, end in zip(pin.coordinates, slider.symbols[:3], strict=True))
m.output("transmission", sympy.acos(along[0] / b), "rad")

if __name__ == "__main__":
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    print(solution.message)
    stroke = np.ptp(solution["x_slider"])
    print(f"stroke {1e3 * stroke:.3f} mm, from {solution['x_slider'].min():.6f} m")
    print(
        f"start: v = {solution['x_slider_dot'][0]:.6f} m/s, a = {solution['x_slider_ddot'][0]:.6f}"
    )
    print(
        f"rod's angle to the guide up to {np.degrees(solution['transmission'].max()):.3f} degrees"
    )
