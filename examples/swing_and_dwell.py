"""An arm swings from 10 to 80 degrees in 0.4 s, dwells, and swings back: modified sine.

A rod lifts a slide with it, as in a pick-and-place unit.

Source: dimensions ours; the law is Neklutin's modified sine (VDI 2143), whose largest velocity is
1.760 times the mean one.
"""

import numpy as np

import kincompile as kc

mechanism = kc.Mechanism("swing_and_dwell", points=361)
a = mechanism.parameter("a", 0.2, unit="m")
length = mechanism.parameter("length", 0.35, unit="m")
low = mechanism.parameter("low", 10 * kc.deg, unit="rad")
high = mechanism.parameter("high", 80 * kc.deg, unit="rad")
rise = mechanism.parameter("rise", 0.4, unit="s")
dwell = mechanism.parameter("dwell", 0.2, unit="s")
mechanism.end = 2 * (rise + dwell)

arm = mechanism.body("arm", guess=(0, 0, low))
rod = mechanism.body("rod", guess=(0.2, 0.2, 1.6))
slide = mechanism.body("slide", guess=(0.2, 0.4, 0))

swing = kc.motion.sequence(
    [(0, low), (rise, high), (rise + dwell, high), (2 * rise + dwell, low)], law="modified sine"
)
mechanism.add(kc.Revolute("shaft", mechanism.ground, (0, 0), arm, (0, 0)))
mechanism.add(kc.Revolute("elbow", arm, (a, 0), rod, (-length / 2, 0)))
mechanism.add(kc.Revolute("wrist", rod, (length / 2, 0), slide, (0, 0)))
mechanism.add(kc.Translational("guide", mechanism.ground, (a, 0), (0, 1), slide, (0, 0), (0, 1)))
mechanism.add(kc.AbsoluteAngle("motor", arm, swing))

if __name__ == "__main__":
    module = kc.compile(mechanism)
    solution = kc.solve(module, np.linspace(0, mechanism.end, mechanism.points))
    print(solution.message)
    mean = np.radians(70) / 0.4
    fastest = solution["arm.phi_dot"].max()
    print(f"the arm's largest speed is {fastest / mean:.3f} times the mean of its swing")
    print(f"the slide is lifted by {1000 * np.ptp(solution['slide.y']):.1f} mm")
