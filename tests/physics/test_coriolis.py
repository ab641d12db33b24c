"""A bead on a turning rod: the only place where the mixed term 2 Phi_qt q_dot does not vanish.

In the joints time stands alone, in C(t); in a free equation it may stand beside a coordinate.
"""

import numpy as np
import pytest
import sympy

import kincompile as kc


def free_equations():
    x, y = sympy.symbols("x y")
    return kc.ConstraintSystem(
        "bead",
        coordinates=(x, y),
        equations=[
            x * sympy.sin(0.7 * kc.t) - y * sympy.cos(0.7 * kc.t),
            x**2 + y**2 - (1 + 0.3 * kc.t**2) ** 2,
        ],
        guess=(1, 0),
    )


def mechanism_with_equations():
    m = kc.Mechanism("bead_with_body")
    bead = m.body("bead", guess=(1, 0, 0))
    m.add(kc.AbsoluteAngle("level", bead, 0))
    m.add(kc.Equation("rod", bead.x * sympy.sin(0.7 * kc.t) - bead.y * sympy.cos(0.7 * kc.t)))
    m.add(kc.Equation("spool", bead.x**2 + bead.y**2 - (1 + 0.3 * kc.t**2) ** 2))
    return m


@pytest.mark.parametrize("model", [free_equations, mechanism_with_equations])
def test_the_acceleration_of_a_bead_on_a_turning_rod(model):
    t = np.linspace(0, 2, 21)
    solution = kc.solve(kc.compile(model()), t, throw=True)
    radius, rate, second, omega = 1 + 0.3 * t**2, 0.6 * t, 0.6, 0.7
    outward, sideways = np.exp(1j * omega * t), 1j * np.exp(1j * omega * t)
    expected = [
        radius * outward,
        rate * outward + radius * omega * sideways,
        # centripetal, and Coriolis 2 omega r_dot
        (second - radius * omega**2) * outward + 2 * omega * rate * sideways,
    ]
    for values, z in zip((solution.q, solution.q_dot, solution.q_ddot), expected, strict=True):
        np.testing.assert_allclose(values[:, 0] + 1j * values[:, 1], z, rtol=0, atol=1e-13)
