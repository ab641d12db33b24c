"""A simple pendulum, driven to turn once a second.

Source: reference case R1 (Example 3.2.1, simplePend.adm): one body, the pin (1, 0) of the body held
at the ground point (1, 1), phi = pi/2 + 2 pi t.
"""

import numpy as np

import kincompile as kc

mechanism = kc.Mechanism("simple_pendulum", end=1.0, points=101)
pendulum = mechanism.body("pendulum", guess=(1, 0, kc.pi / 2))

mechanism.add(kc.Revolute("pin", pendulum, (1, 0), mechanism.ground, (1, 1)))
mechanism.add(kc.AbsoluteAngle("motor", pendulum, kc.pi / 2 + 2 * kc.pi * kc.t))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    print("at t = 0    q =", solution.q[0].round(6), " q_dot =", solution.q_dot[0].round(6))
    print("at t = 0.37 q =", solution.q[37].round(6), " q_dot =", solution.q_dot[37].round(6))
