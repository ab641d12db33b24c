"""A crank-rocker: one motor, and the angle of the rocker with the ratio of the rates.

Source: dimensions ours. The ratio omega_rocker/omega_crank is the textbook's,
a sin(phi_coupler - phi_crank) / (c sin(phi_coupler - phi_rocker)): zero at the two dead points of
the rocker, where the torque that the motor needs is zero too.
"""

import numpy as np

import kincompile as kc

m = kc.Mechanism("crank_rocker", length_unit="m")
lengths = {"a": 0.04, "b": 0.12, "c": 0.08, "d": 0.13}
a, b, c, d = (m.parameter(name, value, "m") for name, value in lengths.items())
crank, coupler = m.body("crank", (0, 0, 1.5)), m.body("coupler", (0, 0.04, 0.3))
rocker = m.body("rocker", (0.13, 0, 1.7))
m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
m.add(kc.Revolute("B", crank, (a, 0), coupler, (0, 0)))
m.add(kc.Revolute("C", coupler, (b, 0), rocker, (c, 0)))
m.add(kc.Revolute("D", m.ground, (d, 0), rocker, (0, 0)))
m.add(kc.AbsoluteAngle("motor", crank, 1.5))

if __name__ == "__main__":
    f = kc.transmission(m, inputs=["motor"], outputs=["rocker.phi"])
    print(f)
    turn = np.linspace(1.5, 1.5 + 2 * np.pi, 13)[:, np.newaxis]
    poses = f.at(turn)
    print("rocker", np.round(poses.x[:, 0], 4).tolist(), "rad")
    print("ratio of the rates", np.round(poses.J[:, 0, 0], 4).tolist())
    print("torque of the motor for 2 Nm", np.round(f.effort(turn, [2])[:3, 0], 4).tolist(), "Nm")
