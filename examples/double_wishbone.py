"""A double wishbone: the strut between S and T moves the wheel up and down, and its camber follows.

Source: dimensions ours. P is where the tyre meets the road, W the centre of the wheel.
"""

import numpy as np
import sympy

import kincompile as kc

s = kc.Sketch("double_wishbone", end=2.0, points=121)
s.ground(A=(0.35, 0.2), C=(0.4, 0.44), T=(0.46, 0.62))
s.joints(B=(0.7, 0.19), D=(0.67, 0.43), S=(0.6, 0.19), W=(0.75, 0.3), P=(0.75, 0))
s.link("lower_arm", "A B S", AB=s.length("lower", 0.35), S=(0.25, 0))
s.link("upper_arm", "C D", s.length("upper", 0.27))
s.link("upright", "B D W P")
s.drive("S T", 0.45 + s.length("stroke", 0.04) * sympy.sin(kc.pi * kc.t))
mechanism = s.mechanism()
point = {item.name: item for item in mechanism.outputs}
upwards = ((0, 0), (0, 1))
mechanism.output("camber", kc.outputs.angle(upwards, (point["P"], point["W"])), "rad")

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    camber = np.degrees(solution["camber"])
    print(f"camber from {camber.min():+.3f} to {camber.max():+.3f} degrees")
    rise, track = (solution[name] - solution[name][0] for name in ("W.y", "P.x"))
    print(f"while the wheel moves from {1e3 * rise.min():+.2f} to {1e3 * rise.max():+.2f} mm")
    print(f"and the track changes from {1e3 * track.min():+.2f} to {1e3 * track.max():+.2f} mm")
