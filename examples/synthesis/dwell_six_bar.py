"""A six-bar that rests while its crank turns by 126 degrees, and a fit that makes it 151.

Source: the construction of the textbooks, an arc of a symmetric coupler curve and a dyad as long as
its radius; dimensions ours. `kincompile fit examples/synthesis/dwell_six_bar.toml` is the same fit.
"""

import numpy as np

import kincompile as kc

mechanism = kc.linkages.dwell_six_bar().mechanism()
degree = np.pi / 180
targets = [
    kc.targets.dwell("output.phi", (0.29, 0.71), at=160 * degree, within=0.1 * degree),
    kc.targets.value("output.phi", [124 * degree], [0.0], within=0.1 * degree),
    kc.targets.moves(),
]
bounds = {
    "E_x": (8.3, 10.2), "E_y": (7.6, 9.4), "OC": (3.1, 3.9), "AB": (4.0, 5.0), "AP": (7.6, 9.3),
    "PD": (3.7, 4.6), "ED": (2.2, 2.8),
}  # fmt: skip

if __name__ == "__main__":
    found = kc.fit(mechanism, targets, bounds=bounds, samples=8, starts=2)
    print(found.message)
    for title, model in (("drawn", mechanism), ("fitted", found.model)):
        solution = kc.solve(kc.compile(model), np.linspace(0, 1, 361))
        rest = solution.dwell("output.phi", 0.1 * degree, "max")
        swing = np.ptp(solution["output.phi"]) / degree
        print(f"{title}: rests for {360 * rest.time:.1f} degrees, swings by {swing:.1f} degrees")
