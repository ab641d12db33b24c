"""Theo Jansen's leg from its eleven holy numbers: a crank turns, the foot G walks.

Source: the linkage of the Strandbeest: eleven numbers a to k that Theo Jansen has published and
two more, l and m: parameters of the drawing that `kc.linkages.jansen` makes, and `jansen.toml`
shows. `mechanism.to_toml()` is the same mechanism in bodies and joints.
"""

import numpy as np

import kincompile as kc

s = kc.linkages.jansen()
mechanism = s.mechanism()

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    x, y = solution["G.x"], solution["G.y"]
    print(f"the foot steps {x.max() - x.min():.3f} mm and lifts {y.max() - y.min():.3f} mm")
    down = y < y.min() + 2
    print(f"for {100 * down.mean():.0f} % of the turn it is within 2 mm of the ground")
