"""A four-bar whose counterweights keep its centre of mass in place: nothing shakes the ground.

Source: full force balance of Berkof and Lowen (1969), dimensions ours.
With `share` = 0 there are no counterweights, with 1 the balance is complete.
"""

import numpy as np

import kincompile as kc

mechanism = kc.Mechanism("balanced_four_bar", end=2 * kc.pi / 20, points=361)
a, b, c, d = (
    mechanism.parameter(name, length, unit="m")
    for name, length in (("a", 0.1), ("b", 0.3), ("c", 0.2), ("d", 0.32))
)
share = mechanism.parameter("share", 1.0)
omega = mechanism.parameter("omega", 20.0, unit="rad/s")

m_a, m_b, m_c = 0.5, 1.2, 0.8
xi, eta = 0.14, 0.02  # centre of mass of the coupler, from B along BC and across it
J_a, J_b, J_c = 0.0006, 0.01, 0.003

# Moments m s of the whole links about A and D, for which the total does not depend on any angle.
crank_x, crank_y = m_b * a * (xi / b - 1), m_b * a * eta / b
rocker_x, rocker_y = -m_b * c * xi / b, -m_b * c * eta / b
# The links alone are uniform; counterweights of these masses give what is missing.
w_a, w_c = 4.0 * share, 3.0 * share
s_a = ((share * (crank_x - m_a * a / 2) + m_a * a / 2) / (m_a + w_a), share * crank_y / (m_a + w_a))
s_c = (
    (share * (rocker_x - m_c * c / 2) + m_c * c / 2) / (m_c + w_c),
    share * rocker_y / (m_c + w_c),
)

crank = mechanism.body("crank", (0, 0, 0), mass=m_a + w_a, inertia=J_a + 0.02 * share, centre=s_a)
coupler = mechanism.body("coupler", (0.1, 0, 0.6), mass=m_b, inertia=J_b, centre=(xi, eta))
rocker = mechanism.body(
    "rocker", (0.32, 0, 1.8), mass=m_c + w_c, inertia=J_c + 0.02 * share, centre=s_c
)
mechanism.gravity = (0, -9.81)

mechanism.add(kc.Revolute("A", mechanism.ground, (0, 0), crank, (0, 0)))
mechanism.add(kc.Revolute("B", crank, (a, 0), coupler, (0, 0)))
mechanism.add(kc.Revolute("C", coupler, (b, 0), rocker, (c, 0)))
mechanism.add(kc.Revolute("D", mechanism.ground, (d, 0), rocker, (0, 0)))
mechanism.add(kc.AbsoluteAngle("motor", crank, omega * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    times = np.linspace(0, float(mechanism.end), mechanism.points)
    solution = kc.solve(module, times)
    print(solution.message)
    for part in (0.0, 0.5, 1.0):
        found = kc.forces(kc.solve(module, times, {"share": part}))
        swing = np.ptp(found.ground.force, axis=0).max()
        peak = found.measures()["motor.drive"].peak
        print(f"share {part}: shaking force swings by {swing:.3f} N, torque peak {peak:.3f} N m")
