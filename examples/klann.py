"""Joe Klann's leg: a crank, two rockers, and a knee that lifts the foot G off a straight stride.

Source: the linkage of US patent 6,260,862, with lengths as published at boim.com/Walkin8r.
"""

import numpy as np

import kincompile as kc

s = kc.Sketch("klann", length_unit="mm", end=4.0, points=361)
s.ground(A=(0, 0), B=(-38.8, -12.5), D=(-14.6, 41.9))
s.joints(C=(17, 0), H=(-20, 4), F=(-55, 12), E=(-40, 65), G=(-40, -40))
s.link("crank", "A C", 17.5)
s.link("connecting_rod", "C F H", CF=73.4, CH=38.8, FH=35.2)
s.link("lower_rocker", "B H", 23.7)
s.link("upper_rocker", "D E", 34.1)
s.link("leg", "E F G", EF=57.7, FG=59.0, EG=111.7)
s.drive("crank", -kc.pi / 2 * kc.t)
mechanism = s.mechanism()

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    x, y = solution["G.x"], solution["G.y"]
    print(f"the foot steps {x.max() - x.min():.3f} mm and lifts {y.max() - y.min():.3f} mm")
    down = y < y.min() + 2
    print(f"for {100 * down.mean():.0f} % of the turn it is within 2 mm of the ground")
