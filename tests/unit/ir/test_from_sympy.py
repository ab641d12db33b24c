"""SymPy's expressions as code: the same numbers as lambdify, over every supported function."""

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.errors import InternalError
from kincompile.ir.from_sympy import FUNCTIONS, QUOTIENTS, Converter
from kincompile.ir.graph import Graph, number_of
from kincompile.ir.interpret import run
from kincompile.model.expressions import SMOOTH
from kincompile.model.spline import PeriodicSpline, fit

x, y, t = sympy.symbols("x y t")
POINTS = {"x": 0.37, "y": -0.82, "t": 1.4}


def evaluated(expression: sympy.Basic, values: dict[str, float] = POINTS) -> float:
    """Return the number that the code of an expression gives."""
    graph = Graph()
    node = Converter(graph, graph.input).convert(expression)
    with np.errstate(all="ignore"):
        return float(run(graph.nodes, values, {})[node])


def by_lambdify(expression: sympy.Basic, values: dict[str, float] = POINTS) -> float:
    function = sympy.lambdify((x, y, t), expression, "numpy")
    with np.errstate(all="ignore"):
        return float(function(*(np.float64(values[name]) for name in ("x", "y", "t"))))


inside = {sympy.asin: 0.4, sympy.acos: 0.4, sympy.atanh: 0.4, sympy.acosh: 1.7, sympy.log: 1.7}


@pytest.mark.parametrize(
    "function",
    [item for item in SMOOTH if item not in (sympy.Piecewise, PeriodicSpline, sympy.atan2)],
    ids=lambda item: item.__name__,
)
def test_that_every_function_is_that_function(function: type[sympy.Function]) -> None:
    at = {**POINTS, "x": inside.get(function, 0.37)}
    assert evaluated(function(x), at) == pytest.approx(by_lambdify(function(x), at), rel=1e-14)


@pytest.mark.parametrize(("a", "b"), [(0.3, -0.7), (-0.3, -0.7), (0.0, -1.0), (-0.2, 0.1)])
def test_that_atan2_knows_all_quadrants(a: float, b: float) -> None:
    at = {**POINTS, "x": a, "y": b}
    assert evaluated(sympy.atan2(x, y), at) == pytest.approx(float(np.arctan2(a, b)), rel=1e-15)


def test_that_no_supported_function_is_missing() -> None:
    assert {*FUNCTIONS, *QUOTIENTS, sympy.Piecewise, PeriodicSpline} == set(SMOOTH)


numbers = st.one_of(
    st.integers(-3, 3).map(sympy.Integer),
    st.fractions(-2, 2, max_denominator=5).map(
        lambda value: sympy.Rational(value.numerator, value.denominator)
    ),
    st.sampled_from([sympy.Float(0.3), sympy.pi, sympy.E, sympy.sqrt(2)]),
)
# Arguments are kept within the functions' domains, where the two sides are both numbers.
smooth = st.sampled_from(
    [
        sympy.sin, sympy.cos, sympy.tanh, sympy.atan, sympy.asinh,
        lambda a: sympy.asin(sympy.sin(a) / 2), lambda a: sympy.log(2 + sympy.cos(a)),
        lambda a: sympy.exp(sympy.sin(a)), lambda a: sympy.sec(sympy.atan(a)),
        lambda a: sympy.sqrt(1 + a**2), lambda a: 1 / (1 + a**2),
        lambda a: (1 + a**2) ** sympy.Rational(-3, 2), lambda a: (2 + sympy.sin(a)) ** sympy.pi,
        lambda a: (2 + sympy.cos(a)) ** sympy.Float(0.3), lambda a: a**3, lambda a: -a,
    ]
)  # fmt: skip
conditions = st.sampled_from(
    [x < 1, t >= 2, (x > 0) & (y <= 1), (t < 1) | (y > 0), sympy.Ne(x, 0), ~((x < 0) | (y > 1))]
)
expressions = st.recursive(
    st.one_of(numbers, st.sampled_from([x, y, t])),
    lambda inner: st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: a - b, inner, inner),
        st.builds(lambda a, b: a * b, inner, inner),
        st.builds(lambda a, b: a / (1 + b**2), inner, inner),
        st.builds(lambda function, a: function(a), smooth, inner),
        st.builds(
            lambda a, condition, b: sympy.Piecewise((a, condition), (b, True)),
            inner, conditions, inner,
        ),
    ),
    max_leaves=6,
)  # fmt: skip


@given(expressions)
@settings(max_examples=120)
def test_that_random_expressions_have_the_value_of_lambdify(expression: sympy.Expr) -> None:
    assert evaluated(expression) == pytest.approx(by_lambdify(expression), rel=1e-9, abs=1e-9)


@given(expressions)
@settings(max_examples=60)
def test_that_derivatives_have_the_value_of_lambdify(expression: sympy.Expr) -> None:
    slope = expression.diff(x)
    assert evaluated(slope) == pytest.approx(by_lambdify(slope), rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (sympy.Piecewise((1, t < 1), (2, t < 2), (3, True)), 2),
        (sympy.Piecewise((1, t < 1), (2, t >= 1)), 2),
        (sympy.Piecewise((1, (t > 1) & (x > 0) & (y < 0)), (2, True)), 1),
        (sympy.Piecewise((1, sympy.Xor(t > 1, x > 0)), (2, True)), 2),
        (sympy.Piecewise((1, sympy.Not(sympy.Or(t > 5, x > 5))), (2, True)), 1),
        (sympy.Piecewise((1, sympy.ITE(t > 1, x > 5, y > 5)), (2, True)), 2),
    ],
)
def test_that_the_first_piece_that_holds_is_taken(expression: sympy.Expr, expected: float) -> None:
    assert evaluated(expression) == expected


def test_that_a_spline_is_a_table() -> None:
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    table = fit(angles, 1 + 0.2 * np.cos(angles))
    rho = PeriodicSpline.of("rho", table)(x)
    graph = Graph()
    node = Converter(graph, graph.input).convert(rho.diff(x))
    assert graph.nodes[node] == ("table", "rho", 1, graph.input("x"))
    assert run(graph.nodes, POINTS, {"rho": table})[node] == table(POINTS["x"], 1)


def test_that_exact_numbers_stay_exact() -> None:
    graph = Graph()
    convert = Converter(graph, graph.input).convert
    assert number_of(graph.nodes, convert(sympy.Rational(-2, 6))) == sympy.Rational(-1, 3)
    assert graph.nodes[convert(sympy.pi)] == ("pi",)
    assert number_of(graph.nodes, convert(3)) == 3


def test_that_a_product_is_one_division_at_most() -> None:
    graph = Graph()
    Converter(graph, graph.input).convert(2 * x / y / t**2)
    assert [node[0] for node in graph.nodes].count("div") == 1


def test_that_an_expression_is_converted_once() -> None:
    asked = []

    def leaf(name: str) -> int:
        asked.append(name)
        return graph.input(name)

    graph = Graph()
    converter = Converter(graph, leaf)
    assert converter.convert(sympy.sin(x)) == converter.convert(sympy.sin(x))
    assert asked == ["x"]


def test_that_what_the_checks_let_through_by_mistake_is_our_bug() -> None:
    graph = Graph()
    with pytest.raises(InternalError, match=r"passed the checks but cannot be compiled.*bug"):
        Converter(graph, graph.input).convert(sympy.gamma(x))
