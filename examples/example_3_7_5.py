"""Example 3.7.5: a slider-crank as three free equations; the length l of its rod is a parameter.

Source: reference case R4 (source lecture, which gives l no number; 1.5 is ours). The crank has
length 1. With l < 1 the mechanism locks up at t = (12 / pi) asin(l), with l = 1 it bifurcates at
t = 6.
"""

import numpy as np
import sympy

import kincompile as kc

x2, phi1, phi2, rod = sympy.symbols("x2 phi1 phi2 l")

system = kc.ConstraintSystem(
    "example_3_7_5",
    coordinates=(x2, phi1, phi2),
    equations=[
        -x2 + sympy.cos(phi1) + rod * sympy.sin(phi2),
        sympy.sin(phi1) - rod * sympy.cos(phi2),
        phi1 - kc.pi * kc.t / 12,
    ],
    parameters={rod: 1.5},
    guess=(1 + rod, 0, kc.pi / 2),
    end=24.0,
    points=241,
)

if __name__ == "__main__":
    module = kc.compile(system)
    solution = kc.solve(module, np.linspace(0, system.end, system.points))
    print(solution.message)
    for t in (2, 4, 6):
        print(f"t = {t}  (x2, phi1, phi2) =", solution.q[10 * t].round(6))
    print("with l = 0.5:", kc.solve(module, np.linspace(0, 3, 31), p={"l": 0.5}).message)
