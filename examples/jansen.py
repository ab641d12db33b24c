"""Theo Jansen's leg from its eleven holy numbers: a crank turns, the foot G walks.

Source: the linkage of the Strandbeest: eleven numbers a to k that Theo Jansen has published and
two more, l and m. The drawing below is rough: lengths give the shapes, and the drawing says on
which side a joint is. `mechanism.to_toml()` is the same mechanism in bodies and joints.
"""

import numpy as np

import kincompile as kc

s = kc.Sketch("jansen", length_unit="mm", end=1.0, points=361)
s.ground(O=(0, 0), B=(-s.length("a", 38.0), -s.length("l", 7.8)))
s.joints(A=(15, 0), C=(-20, 30), D=(-70, 15), E=(-25, -45), F=(-60, -30), G=(-30, -95))
s.link("crank", "O A", s.length("m", 15.0))
s.link("upper_rod", "A C", s.length("j", 50.0))
s.link("lower_rod", "A E", s.length("k", 61.9))
s.link("plate", "B C D", BC=s.length("b", 41.5), BD=s.length("d", 40.1), CD=s.length("e", 55.8))
s.link("rocker", "B E", s.length("c", 39.3))
s.link("side_rod", "D F", s.length("f", 39.4))
s.link("leg", "E F G", EF=s.length("g", 36.7), FG=s.length("h", 65.7), EG=s.length("i", 49.0))
s.drive("crank", 2 * kc.pi * kc.t)
mechanism = s.mechanism()

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    x, y = solution["G.x"], solution["G.y"]
    print(f"the foot steps {x.max() - x.min():.3f} mm and lifts {y.max() - y.min():.3f} mm")
    down = y < y.min() + 2
    print(f"for {100 * down.mean():.0f} % of the turn it is within 2 mm of the ground")
