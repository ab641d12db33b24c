"""A five-bar parallel robot: two motors move a point in the plane.

Source: dimensions ours, of the order of table robots. Its outputs are the components of a point;
J is singular where an arm and its rod are in line (input singularity), and infinite where both rods
are (output singularity), where the two assemblies meet.
"""

import numpy as np

import kincompile as kc

m = kc.Mechanism("five_bar", length_unit="m")
arm_1, arm_2 = m.body("arm_1", (-0.059, 0, 2.3)), m.body("arm_2", (0.059, 0, 0.9))
rod_1, rod_2 = m.body("rod_1", (-0.119, 0.067, 0.24)), m.body("rod_2", (0.115, 0.07, 2.92))
m.add(kc.Revolute("M1", m.ground, (-0.059, 0), arm_1, (0, 0)))
m.add(kc.Revolute("M2", m.ground, (0.059, 0), arm_2, (0, 0)))
m.add(kc.Revolute("E1", arm_1, (0.09, 0), rod_1, (0, 0)))
m.add(kc.Revolute("E2", arm_2, (0.09, 0), rod_2, (0, 0)))
m.add(kc.Revolute("P", rod_1, (0.12, 0), rod_2, (0.12, 0)))
m.add(kc.AbsoluteAngle("motor_1", arm_1, 2.3))
m.add(kc.AbsoluteAngle("motor_2", arm_2, 0.9))
m.point("end", rod_1, (0.12, 0))

if __name__ == "__main__":
    f = kc.transmission(m, inputs=["motor_1", "motor_2"], outputs=["end"])
    print(f)
    u = f.inverse([0.02, 0.15])
    print("motors", np.round(u, 6), "rad")
    print("J", np.round(f.J(u), 5).tolist())
    print("all working modes", np.round(f.modes([0.02, 0.15]), 6).tolist())
    print("torques for a force (3, -6) N", np.round(f.effort(u, [3, -6]), 4), "Nm")
