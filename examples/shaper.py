"""A shaper: a crank pin runs in a lever's slot, and its end pulls the ram: slow forth, fast back.

Source: dimensions ours. With pivots d = 0.45 m apart and a crank of r = 0.1 m the time ratio
of the strokes is (pi + 2 asin(r/d)) / (pi - 2 asin(r/d)) = 1.332802.
"""

import numpy as np

import kincompile as kc

s = kc.Sketch("shaper", end=1.0, points=361)
s.ground(O=(0, 0), C=(0, -s.length("d", 0.45)))
s.joints(A=(0.1, 0), D=(0.14, 0.24), R=(-0.15, 0.26))
s.link("crank", "O A", s.length("r", 0.1))
s.link("lever", "C D", s.length("lever_length", 0.7))
s.slot("A", along="C D")
s.link("rod", "D R", s.length("rod_length", 0.3))
ram = s.slider("ram", "R", along=(1, 0))
s.drive("crank", 2 * kc.pi * kc.t)
mechanism = s.mechanism()
mechanism.output("feed", ram.x, "m")

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    feed = solution.measures()["feed"]
    print(f"the ram's stroke is {feed.stroke:.6f} m")
    print(f"the slow stroke takes {feed.time_ratio:.6f} times as long as the fast one")
