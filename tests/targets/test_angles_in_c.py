"""C's own atan2, which takes several lanes at once: all quadrants, all sizes, the axes."""

import numpy as np
import sympy

import kincompile as kc


def test_that_atan2_is_right_to_two_units_in_the_last_place() -> None:
    x, y, angle = sympy.symbols("x y angle")
    equations = [x - sympy.cos(kc.t), y - sympy.sin(kc.t), angle - sympy.atan2(y, x)]
    system = kc.ConstraintSystem("angles", [x, y, angle], equations)
    module = kc.compile(system, target="c")
    random, n = np.random.default_rng(5), 100_000
    size, turn = 10 ** random.uniform(-12, 12, n), random.uniform(-np.pi, np.pi, n)
    q = np.column_stack([size * np.cos(turn), size * np.sin(turn), np.zeros(n)])
    q[:6, :2] = [(1, 0), (-1, 0), (0, 1), (0, -1), (0, 0), (1, 1)]
    found, wanted = -module.Phi(q, 0.0)[:, 2], np.arctan2(q[:, 1], q[:, 0])
    assert np.all(np.abs(found - wanted) <= 2 * np.spacing(np.abs(wanted)))


def test_that_cosines_of_large_angles_are_those_of_the_library() -> None:
    """Beyond 1e5 rad, in the same strip as small ones, and of a cosine of such an angle."""
    x, y, z, angle = sympy.symbols("x y z angle")
    turned = sympy.cos(angle)
    equations = [x - turned, y - sympy.sin(angle), z - sympy.sin(7 * turned), angle - kc.t]
    module = kc.compile(kc.ConstraintSystem("far", [x, y, z, angle], equations), target="c")
    angles = np.array([0.3, -2e5, 1e9, 2.0, 1e15, -7.0])
    q = np.column_stack([np.zeros((6, 3)), angles])
    wanted = np.column_stack([np.cos(angles), np.sin(angles), np.sin(7 * np.cos(angles))])
    np.testing.assert_allclose(-module.Phi(q, 0.0)[:, :3], wanted, rtol=0, atol=2e-15)


def test_that_each_quantity_has_its_cosines_whichever_is_asked_for() -> None:
    """Alone and together, at small and large angles, against NumPy's: one pass serves all."""
    x, y, angle = sympy.symbols("x y angle")
    equations = [x - sympy.cos(angle), y - sympy.sin(2 * kc.t), angle - sympy.sin(3 * kc.t)]
    system = kc.ConstraintSystem("shared", [x, y, angle], equations)
    compiled, written = kc.compile(system, target="c"), kc.compile(system)
    random = np.random.default_rng(1)
    q, q_dot = random.uniform(-3, 3, (2, 40, 3))
    q[7, 2], t = 3e5, np.linspace(0, 2e5, 40)
    for name, given in {"Phi_q": (q, t), "nu": (q, t), "gamma": (q, q_dot, t)}.items():
        for first in (0, 20):  # strips whose angles are all within reach, and not
            part = [x[first:] for x in given]
            found, wanted = getattr(compiled, name)(*part), getattr(written, name)(*part)
            np.testing.assert_allclose(found, wanted, rtol=1e-13, atol=1e-13, err_msg=name)
    for found, wanted in zip(
        compiled.kinematics(q, q_dot, t), written.kinematics(q, q_dot, t), strict=True
    ):
        np.testing.assert_allclose(found, wanted, rtol=1e-13, atol=1e-13)
