"""The ankle of a humanoid robot: two linear actuators pitch and roll the foot.

Source: dimensions ours, of the order of robots of human size. The foot hangs on a universal joint,
pitch about y of the shank and roll about x of the foot; both actuators are behind it. As a function
it goes from their lengths to the angles of the joint, with Jacobian and torques.
"""

import numpy as np

import kincompile as kc
from kincompile import spatial
from kincompile.spatial import outputs

m = spatial.Mechanism("ankle", length_unit="m")
foot = m.body("foot", (0, 0, 0))
m.add(spatial.Universal("cross", m.ground, (0, 0, 0), (0, 1, 0), foot, (0, 0, 0), (1, 0, 0)))
for name, y_shank, y_foot in (("left", 0.036, 0.034), ("right", -0.036, -0.034)):
    shank, heel = (-0.045, y_shank, 0.24), (-0.052, y_foot, 0.015)
    m.add(spatial.Distance(name, m.ground, shank, foot, heel, 0.2251))
e_x, e_y = foot.direction((1, 0, 0)), foot.direction((0, 1, 0))
m.output("pitch", outputs.angle((1, 0, 0), e_x, about=(0, 1, 0)), "rad")
m.output("roll", outputs.angle((0, 1, 0), e_y, about=e_x), "rad")

if __name__ == "__main__":
    f = kc.transmission(m, inputs=["left", "right"], outputs=["pitch", "roll"])
    print(f)
    u = f.inverse([0.3, 0.1])  # lengths for a pose of the foot
    print("actuators", np.round(u, 6), "m")
    print("J", np.round(f.J(u), 3).tolist())
    print("forces for 35 Nm of pitch", np.round(f.effort(u, [35, 0]), 2), "N")
    print("forward again", np.round(f(u), 6), "rad")
