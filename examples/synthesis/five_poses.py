"""A body goes exactly through five poses: all dyads, the four-bars that they make, a cognate.

Source: theory of Burmester, Roberts's theorem; the poses are those of docs/synthesis.md, ours.
"""

import numpy as np

import kincompile as kc

poses = [(1.6, 1.4, 0.5), (1.1, 2.9, 0.4), (-0.2, 3.4, 0.5), (-1.8, 2.8, 0.7), (-2.3, 1.7, 0.9)]
dyads = kc.synthesis.dyads(poses)
linkages = kc.synthesis.four_bars(poses)
mechanism = linkages[0].sketch("five_poses", length_unit="cm").mechanism()

if __name__ == "__main__":
    for dyad in dyads:
        print(f"({dyad.centre[0]:.3f}, {dyad.centre[1]:.3f}), length {dyad.length:.3f} cm")
    works = [item for item in linkages if item.passage.works]
    print(f"{len(linkages)} four-bars, of which {len(works)} go through the poses in their order")
    print(linkages[0].passage.message)
    times = np.linspace(0, 1, mechanism.points)
    motion = kc.solve(kc.compile(mechanism), np.union1d(times, linkages[0].passage.times))
    print(motion.message)
    found = [(motion["P.x"] - x, motion["P.y"] - y) for x, y, _ in poses]
    print(f"off the poses by {max(np.hypot(*off).min() for off in found):.1e} cm")
    for other in kc.synthesis.cognates(linkages[0]):
        print("the same path: " + ", ".join(f"{length:.3f}" for length in other.lengths))
