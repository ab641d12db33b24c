"""Problem 3.5.6 in reduced coordinates: three free equations in x2, y2 and phi3.

Source: reference case R3 (source lecture). The mechanism locks up at t = 4.5, where sin(phi3) = -1
and Phi_q is singular; from there on no position exists. The time grid therefore ends at t = 4.
"""

import numpy as np
import sympy

import kincompile as kc

x2, y2, phi3 = sympy.symbols("x2 y2 phi3")
quarter, reach = sympy.Rational("0.25"), sympy.Rational("0.6")
radius = kc.t / 10 + sympy.Rational("0.4")

system = kc.ConstraintSystem(
    "problem_3_5_6",
    coordinates=(x2, y2, phi3),
    equations=[
        x2 + quarter * sympy.sin(phi3) - reach,
        y2 - quarter * sympy.cos(phi3),
        x2**2 + y2**2 - radius**2,
    ],
    guess=(0.2, 0.2, kc.pi / 4),
    end=4.0,
    points=41,
)

if __name__ == "__main__":
    module = kc.compile(system)
    solution = kc.solve(module, np.linspace(0, system.end, system.points))
    print(solution.message)
    for t in (0, 1, 2, 4):
        print(f"t = {t}  (x2, y2, phi3) =", solution.q[10 * t].round(6))
    print("past the lock-up:", kc.solve(module, np.linspace(0, 5, 51)).message)
