"""A delta robot: three motors move a platform, which six rods keep from turning.

Source: dimensions ours, of the order of pick-and-place robots. The two rods of an arm are a
parallelogram. Motors are counted from the horizontal, downwards; the platform hangs below.
"""

import numpy as np

import kincompile as kc
from kincompile import spatial

BASE, ARM, ROD, TOP, HALF, DOWN = 0.2, 0.25, 0.5, 0.05, 0.04, 0.6  # m, and rad
C, S = np.cos(DOWN), np.sin(DOWN)

m = spatial.Mechanism("delta", length_unit="m")
platform = m.body("platform", (0, 0, -0.48))
for k in (1, 2, 3):
    turn = 2 * np.pi * (k - 1) / 3
    out = np.round([np.cos(turn), np.sin(turn), 0], 15) + 0.0
    across = np.round([-np.sin(turn), np.cos(turn), 0], 15) + 0.0
    frame = np.column_stack([out, across, (0, 0, 1)]) @ [[C, 0, S], [0, 1, 0], [-S, 0, C]]
    arm, hinge, x, y = m.body(f"arm_{k}", BASE * out, frame), BASE * out, (1, 0, 0), (0, 1, 0)
    m.add(spatial.Revolute(f"hinge_{k}", m.ground, hinge, across, arm, (0, 0, 0), y))
    m.add(spatial.RelativeRotation(f"motor_{k}", m.ground, across, out, arm, y, x, DOWN))
    for side, shift in (("a", HALF), ("b", -HALF)):
        ends = arm, (ARM, shift, 0), platform, TOP * out + shift * across
        m.add(spatial.Distance(f"rod_{k}{side}", *ends, ROD))
m.point("tool", platform, (0, 0, 0))

if __name__ == "__main__":
    f = kc.transmission(m, inputs=["motor_1", "motor_2", "motor_3"], outputs=["tool"])
    print(f)
    u = f.inverse([0, 0.05, -0.5])
    print("motors", np.round(u, 6), "rad")
    print("J", np.round(f.J(u), 4).tolist())
    print("torques to carry 10 N", np.round(f.effort(u, [0, 0, 10]), 3), "Nm")
