"""Free equations: their derivatives are SymPy's, without the questions that it asks itself."""

from typing import Any

import sympy

from kincompile.derive.equations import derivative, derive_equation


def test_that_sympy_is_not_asked_if_a_hyperbolic_cosine_is_finite(monkeypatch: Any) -> None:
    """It takes the remainder of the argument by pi, which takes minutes of a long one."""

    def asked(cls: Any, p: Any, q: Any) -> None:
        raise AssertionError(f"the remainder of {p} by {q}")

    monkeypatch.setattr(sympy.Mod, "eval", classmethod(asked))
    x, phi, a, b = sympy.symbols("x_of_this phi_of_this a_of_this b_of_this")
    Phi = sympy.sinh((a * sympy.cos(phi) - b * sympy.sin(phi) + x) / b)
    found = derive_equation(Phi, [x.name, phi.name])
    assert found.Phi_q[0] == sympy.cosh(Phi.args[0]) / b


def test_that_a_derivative_is_that_of_sympy() -> None:
    x, y = sympy.symbols("x y")
    sine, power = sympy.sin(x * y), x ** (y + 1)
    for item in (2 * x * y**2 * sine, (x + y) * sine * power + y, sympy.exp(x * sine), y):
        assert derivative(item, x) == item.diff(x)
