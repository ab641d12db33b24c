"""A double wishbone with its rack, from ten hardpoints: what a suspension is judged by.

Source: dimensions ours. A left wheel with the axes and signs of ISO 8855: x points forward, y to
the left, z up. The wheel moves up and down by `travel`, and the rack is pushed to the left by
`rack`.
"""

import numpy as np

import kincompile as kc
from kincompile import spatial
from kincompile.spatial import outputs

STRUT = (0.02, 0.5, 0.62)  # where the strut, which stands on C, meets the body
s = spatial.Sketch("double_wishbone_with_steering", end=2.0, points=81)
travel, rack = s.length("travel", 0.06), s.length("rack", 0.0)
s.ground(A=(0.15, 0.35, 0.16), B=(-0.2, 0.35, 0.17), D=(0.1, 0.42, 0.46), E=(-0.15, 0.42, 0.45))
s.joints(C=(0, 0.7, 0.15), F=(-0.02, 0.66, 0.44), G=(-0.12, 0.38, 0.2), H=(-0.13, 0.68, 0.2))
s.joints(W=(0, 0.75, 0.3), P=(0, 0.77, 0))
s.link("lower_arm", "A B C")
s.link("upper_arm", "D E F")
upright = s.link("upright", "C F H W P")
s.slider("rack_bar", "G", along=(0, 1, 0))
s.rod("tie_rod", "G H")
s.drive("rack_bar", rack)
s.drive("W.z", 0.3 + travel * (kc.t - 1))
mechanism = m = s.mechanism()

spin, foot = upright.direction((0, 1, 0)), s.point("P")
lower, upper = s.point("C"), s.point("F")  # the steering axis
m.output("camber", outputs.camber(spin), "rad")
m.output("toe", outputs.toe(spin), "rad")
m.output("caster", outputs.caster(lower, upper), "rad")
m.output("kingpin", outputs.kingpin(lower, upper), "rad")
m.output("scrub", outputs.scrub_radius(lower, upper, foot), "m")
m.output("trail", outputs.trail(lower, upper, foot), "m")
m.output("track", outputs.track(foot), "m")
m.output("roll_centre", outputs.roll_centre_height(foot), "m")
m.output("motion_ratio", outputs.motion_ratio(outputs.distance(lower, STRUT), s.point("W")))

if __name__ == "__main__":
    module = kc.compile(m)
    for push in (0.0, 0.02):
        solution = kc.solve(module, np.linspace(0, m.end, m.points), {"rack": push})
        print(solution.message)
        for name in ("camber", "toe", "caster", "kingpin"):
            angle = np.degrees(solution[name])
            print(f"{name} {angle[0]:+.4f}, {angle[40]:+.4f}, {angle[80]:+.4f} degrees")
        for name in ("scrub", "trail", "track", "roll_centre"):
            length = 1e3 * solution[name]
            print(f"{name} {length[0]:.2f}, {length[40]:.2f}, {length[80]:.2f} mm")
        ratio = solution["motion_ratio"]
        print(f"motion ratio {ratio[0]:.4f}, {ratio[40]:.4f}, {ratio[80]:.4f}")
