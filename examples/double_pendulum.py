"""A double pendulum: the upper arm swings as sin(10 t), the tip of the lower stays on the floor.

Source: reference case R6 (Project 1 of 2013, project1.adm, identical to dpendKIN.adm).
"""

import numpy as np
import sympy

import kincompile as kc

mechanism = kc.Mechanism("double_pendulum", end=1.0, points=201)
upper = mechanism.body("upper", guess=(1, 0, 0))
lower = mechanism.body("lower", guess=(5, 0, 0))

mechanism.add(kc.Revolute("hinge", upper, (-1, 0), mechanism.ground, (0.2, 0.5)))
mechanism.add(kc.Revolute("elbow", upper, (1, 0), lower, (-3, 0)))
mechanism.add(kc.AbsoluteY("floor", lower, (3, 0), 0))
mechanism.add(kc.AbsoluteAngle("swing", upper, sympy.sin(10 * kc.t)))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    print("at t = 0   q =", solution.q[0].round(6))
    print("at t = 0.1 q =", solution.q[20].round(6))
    print("at t = 0.5 q =", solution.q[100].round(6))
