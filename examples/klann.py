"""Joe Klann's leg: a crank, two rockers, and a knee that lifts the foot G off a straight stride.

Source: the linkage of US patent 6,260,862, with lengths as published at boim.com/Walkin8r,
drawn by `kc.linkages.klann`.
"""

import numpy as np

import kincompile as kc

s = kc.linkages.klann()
mechanism = s.mechanism()

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    x, y = solution["G.x"], solution["G.y"]
    print(f"the foot steps {x.max() - x.min():.3f} mm and lifts {y.max() - y.min():.3f} mm")
    down = y < y.min() + 2
    print(f"for {100 * down.mean():.0f} % of the turn it is within 2 mm of the ground")
