"""Numbers and expressions as users give them."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy
from sympy.physics.mechanics import dynamicsymbols

from kincompile.model.expressions import (
    NOT_SMOOTH,
    SMOOTH,
    NotAnExpressionError,
    as_expression,
    depends_on,
    evaluate,
    smoothness_problem,
    symbol_names,
    unknown_problem,
)
from kincompile.model.spline import PeriodicSpline

x, y, t = sympy.symbols("x y t")


@pytest.mark.parametrize(
    ("given", "expected", "kind"),
    [
        (2, 2, int),
        (2.5, 2.5, float),
        (np.int64(3), 3, int),
        (np.float32(0.5), 0.5, float),
        (np.float64(0.1), 0.1, float),
        (Fraction(1, 3), sympy.Rational(1, 3), sympy.Rational),
        (sympy.Integer(4), 4, int),
        (sympy.Rational(2, 3), sympy.Rational(2, 3), sympy.Rational),
        (sympy.pi, sympy.pi, sympy.Expr),
        (sympy.Symbol("x", positive=True) + 1, x + 1, sympy.Expr),
        (dynamicsymbols("x") + dynamicsymbols("y"), x + y, sympy.Expr),
        (sympy.Eq(x, y), x - y, sympy.Expr),
    ],
)
def test_that_a_number_or_an_expression_is_taken(given: Any, expected: Any, kind: Any) -> None:
    found = as_expression(given)
    assert found == expected
    assert isinstance(found, kind)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (True, "True is a truth value"),
        (float("nan"), "nan is not finite"),
        (np.float32("inf"), "inf is not finite"),
        (sympy.zoo * x, "not finite"),
        (sympy.sqrt(-2) * x, "not real"),
        (sympy.acos(3), "not real"),
        ("x", "'x' is not a number or a SymPy expression"),
        (None, "None is not a number"),
        (sympy.true, "True is not a number"),
        (sympy.Lambda(x, x), "is not a number"),
        (10**309, "beyond 1e308"),
    ],
)
def test_that_anything_else_says_what_it_is(given: Any, message: str) -> None:
    with pytest.raises(NotAnExpressionError, match=message):
        as_expression(given)


ELEMENTARY = [item for item in SMOOTH if item not in (sympy.Piecewise, PeriodicSpline)]


@pytest.mark.parametrize("function", ELEMENTARY, ids=lambda item: item.__name__)
def test_that_smooth_functions_and_their_derivatives_are_smooth(function: Any) -> None:
    """What is let through can be differentiated three times and still be compiled."""
    expression = function(x, y) if function is sympy.atan2 else function(x)
    for order in range(4):
        assert smoothness_problem(expression.diff(x, order)) is None


@pytest.mark.parametrize("function", NOT_SMOOTH, ids=lambda item: item.__name__)
def test_that_functions_with_corners_are_not(function: Any) -> None:
    value = function(x, 2) if function in (sympy.Min, sympy.Max, sympy.Mod) else function(x)
    assert "has no continuous derivative" in (smoothness_problem(1 + value) or "")


@pytest.mark.parametrize(
    ("value", "values", "expected"),
    [
        (2, {}, 2.0),
        (x + 1, {"x": 2}, 3.0),
        (x + y, {"x": 2}, None),
        (sympy.sqrt(x), {"x": -1.0}, None),
        (1 / x, {"x": 0.0}, None),
        (sympy.pi / 2, {}, np.pi / 2),
        (sympy.Float("1e300") * x, {"x": 1e300}, None),
        (sympy.Piecewise((1, x < 0), (2, True)), {"x": 3.0}, 2.0),
    ],
)
def test_that_an_expression_has_a_value_where_it_is_a_number(
    value: Any, values: dict[str, float], expected: float | None
) -> None:
    assert evaluate(value, values) == (None if expected is None else pytest.approx(expected))


def test_that_names_are_found() -> None:
    assert symbol_names(x * sympy.sin(t) + 1) == {"x", "t"}
    assert symbol_names(3) == set()
    assert depends_on(x + t, ["t"])
    assert not depends_on(x, ["t"])
    assert not depends_on(2.0, ["t"])


def test_that_what_nobody_declared_is_listed() -> None:
    assert unknown_problem(x + 1, ["x"], "here") is None
    message = unknown_problem(x + y + sympy.Symbol("z"), {"x", "yy"}, "here") or ""
    assert message.startswith("here contains y, z, which are not declared; did you mean 'yy'?")
    assert message.endswith("use one of: x, yy")
