"""Free equations: differentiated by the coordinates that occur, and by time."""

import sympy

from kincompile.derive.equations import derive_equation

x, y, x_dot, y_dot, t, L = sympy.symbols("x y x_dot y_dot t L")


def test_that_a_pendulum_with_a_moving_support_is_derived() -> None:
    found = derive_equation((x - sympy.sin(t)) ** 2 + y**2 - L**2, ["x", "y"])
    assert found.Phi_q == (2 * x - 2 * sympy.sin(t), 2 * y)
    assert sympy.expand(found.nu - 2 * (x - sympy.sin(t)) * sympy.cos(t)) == 0
    by_q_q, by_q_t, by_t_t = found.gamma_terms
    assert sympy.expand(by_q_q + 2 * x_dot**2 + 2 * y_dot**2) == 0
    assert sympy.expand(by_q_t - 4 * sympy.cos(t) * x_dot) == 0
    by_hand = -2 * sympy.cos(t) ** 2 - 2 * (x - sympy.sin(t)) * sympy.sin(t)
    assert sympy.expand(by_t_t - by_hand) == 0
    assert sympy.expand(found.gamma - by_q_q - by_q_t - by_t_t) == 0


def test_that_only_the_named_coordinates_are_differentiated_by() -> None:
    found = derive_equation(x * y * L, ["x"])
    assert found.Phi_q == (y * L,)
    assert found.gamma == 0
