"""Bennett's linkage: four hinges, neither parallel nor through one point, and it moves.

Gruebler's count says -2. It moves because opposite links are alike and their lengths are as the
sines of their twists; three of the 20 equations of its joints repeat others, which `inspect` names.

Source: G. T. Bennett, A new mechanism, Engineering 76 (1903); dimensions ours.
"""

import numpy as np

import kincompile as kc
from kincompile import spatial

X, Z, origin = (1, 0, 0), (0, 0, 1), (0, 0, 0)

mechanism = m = spatial.Mechanism("bennett", end=4.0, points=201)
links = [(0.25, 0.6, 0.8), (0.4, 0.96, 0.28)] * 2  # length, sine and cosine of the twist
start = 0.5
# tan(theta_1/2) tan(theta_2/2) = sin((alpha + beta)/2)/sin((beta - alpha)/2); theta_3 = -theta_1
angles = (start, 2 * np.arctan(2.6 / np.tan(start / 2)), -start)

# The frame of a link stands at its far hinge, z along it and x along the link.
bodies, turn, place = [m.ground], np.eye(3), np.zeros(3)
for k, (angle, (a, s, c)) in enumerate(zip(angles, links, strict=False)):
    u, v = np.cos(angle), np.sin(angle)
    place = place + turn @ (a * u, a * v, 0)
    turn = turn @ np.array([[u, -v * c, v * s], [v, u * c, -u * s], [0, s, c]])
    # A guess; rounded, it has the same digits on every processor.
    bodies.append(m.body(f"link_{k + 1}", place.round(9), turn.round(9)))
bodies.append(m.ground)
for k, (a, s, c) in enumerate(links):
    near = (bodies[k + 1], (-a, 0, 0), (0, s, c))
    m.add(spatial.Revolute(f"hinge_{k + 1}", bodies[k], origin, Z, *near))
m.add(
    spatial.RelativeRotation(
        "motor", m.ground, Z, X, bodies[1], (0, 0.6, 0.8), X, start + 1.2 * kc.t
    )
)
second = (bodies[2], (0, 0.96, 0.28), X)
m.add(spatial.JointAngle("second", bodies[1], Z, X, *second, guess=round(angles[1], 9)))

if __name__ == "__main__":
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    print(solution.message)
    print(f"the second hinge turns from {angles[1]:.6f} to {solution['theta_second'][-1]:.6f} rad")
