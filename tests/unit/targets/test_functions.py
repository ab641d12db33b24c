"""Every supported function in an emitted module: at a point, on a batch, and with complex steps."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.model.expressions import SMOOTH
from kincompile.model.spline import PeriodicSpline

x, y = sympy.symbols("x y")
P = sympy.Piecewise
ONE_ARGUMENT = [f for f in SMOOTH if f not in (P, PeriodicSpline, sympy.atan2, sympy.acosh)]

EXPRESSIONS = {
    **{function.__name__: function(x / 2) for function in ONE_ARGUMENT},
    "acosh": sympy.acosh(1 + x**2),
    "atan2": sympy.atan2(x - 1, y),
    "sqrt": sympy.sqrt(1 + x**2),
    "a root below": 1 / sympy.sqrt(1 + x * y),
    "a rational power": (1 + x) ** sympy.Rational(5, 3),
    "a real power": (1 + x) ** sympy.Float(0.3) * sympy.pi**x,
    "a high power": (x - y) ** 11 + x**-3,
    "e": sympy.E**y - sympy.E,
    "pieces": P((x**2, x < 0.5), (x - 0.25, True)),
    "pieces by both": P((x, (x < 0.3) & (y > 0)), (y, (x > 0.6) | (y <= -0.5)), (1 + x, True)),
    "pieces of time": x * P((kc.t**2, kc.t < 0.2), (0.4 * kc.t - 0.04, True)),
    "pieces in pieces": sympy.sin(P((P((x, y < 0), (2 * x, True)), x < 0.4), (y, True))),
    "covered without True": P((x**2, x < 0.5), (x - 0.25, x >= 0.5)),
    "a chosen exponent": P((1 / x, sympy.Ne(x, 0)), (0, True)),
}
POINTS = np.array([[0.37, 0.62], [0.81, -0.44], [0.22, 0.31], [0.55, -0.71]])


@pytest.fixture(scope="module", params=EXPRESSIONS)
def both(request: pytest.FixtureRequest) -> tuple[Any, Any]:
    """An expression as an equation of a module, and as SymPy has it."""
    expression = EXPRESSIONS[request.param]
    return kc.compile(kc.ConstraintSystem("f", "x y", [expression + x, y - x])), expression + x


def exact(expression: Any, point: Any, t: float) -> float:
    return float(expression.subs({x: point[0], y: point[1], kc.t: t}).evalf(30))


@pytest.mark.parametrize("t", [0.1, 0.7])
def test_that_a_function_is_that_function(both: tuple[Any, Any], t: float) -> None:
    module, expression = both
    expected = [exact(expression, point, t) for point in POINTS.tolist()]
    np.testing.assert_allclose(module.Phi(POINTS, t)[:, 0], expected, rtol=1e-13)
    found = [module.Phi(point, t)[0] for point in POINTS]
    np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_that_its_derivatives_are_its_derivatives(both: tuple[Any, Any]) -> None:
    module, expression = both
    x_dot, y_dot = 0.7, -1.3
    line = expression.subs({x: x + x_dot * kc.t, y: y + y_dot * kc.t}, simultaneous=True)
    for point in POINTS.tolist():
        found = module.Phi_q(np.array(point), 0.1)[0]
        expected = [exact(expression.diff(symbol), point, 0.1) for symbol in (x, y)]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
        if not expression.has(kc.t):
            bend = exact(line.diff(kc.t, 2), point, 0.0)
            gamma = module.gamma(np.array(point), np.array([x_dot, y_dot]), 0.1)[0]
            np.testing.assert_allclose(gamma, -bend, rtol=1e-11, atol=1e-12)


def test_that_a_complex_step_gives_the_derivative(both: tuple[Any, Any]) -> None:
    module, _ = both
    if "atan2" in str(both[1]):
        return
    for point in POINTS:
        columns = module.Phi(point + 1e-30j * np.eye(2), 0.1).imag[:, 0] / 1e-30
        np.testing.assert_allclose(columns, module.Phi_q(point, 0.1)[0], rtol=1e-12, atol=1e-13)
