"""Derivatives on the graph: SymPy's and complex steps', on the domain, at its edge and off it."""

from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile.errors import InternalError
from kincompile.ir.differentiate import FUNCTIONS, derivative, tangents
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.inline import inline
from kincompile.ir.interpret import run
from kincompile.ir.lower import lower
from kincompile.model.expressions import SMOOTH
from kincompile.model.mechanism import system_of
from kincompile.model.spline import PeriodicSpline, fit

x, y, t, p = sympy.symbols("x y t p")
AT = {"x": 0.37, "y": -0.82, "t": 1.4, "p": 0.6}


def on_graph(expression: sympy.Expr, by: str, at: dict[str, float], order: int = 1) -> float:
    graph = Graph()
    node = Converter(graph, graph.input).convert(expression)
    return value(graph, derivative(graph, node, by, order), at)


def by_sympy(expression: sympy.Expr, by: str, at: dict[str, float], order: int = 1) -> float:
    graph = Graph()
    node = Converter(graph, graph.input).convert(expression.diff(sympy.Symbol(by), order))
    return value(graph, node, at)


def value(graph: Graph, node: int, at: dict[str, float]) -> float:
    with np.errstate(all="ignore"):
        return float(run(graph.nodes, {k: np.float64(v) for k, v in at.items()}, {})[node])


@pytest.mark.every(5)
@pytest.mark.parametrize(
    "function",
    [item for item in SMOOTH if item not in (sympy.Piecewise, PeriodicSpline, sympy.atan2)],
    ids=lambda item: item.__name__,
)
@pytest.mark.parametrize("order", [1, 2])
def test_that_every_function_has_its_derivative(function: Any, order: int) -> None:
    """The arguments cover the domains, their edges and what lies outside: NaN where it was."""
    for number in (-1.7, -1.0, -0.4, 0.0, 0.37, 1.0, 1.5, 1.7):
        at = {**AT, "x": number}
        for expression in (function(x), function(x) * y, t / function(x)):
            found, known = (rule(expression, "x", at, order) for rule in (on_graph, by_sympy))
            if np.isfinite(by_sympy(expression, "x", at)):
                np.testing.assert_allclose(found, known, 1e-12, 1e-12, err_msg=str(expression))
            elif order == 1 and expression.func is not sympy.Mul:
                assert not np.isfinite(found), (expression, number)


@pytest.mark.parametrize(
    "exponent", ["2", "3", "5", "-1", "-4", "1/2", "3/2", "-5/2", "2/3", "1.7"]
)
@pytest.mark.parametrize("order", [1, 2])
def test_that_powers_are_differentiated_as_powers(exponent: str, order: int) -> None:
    """At zero too, where the product rule would make zero times infinity of x^(3/2)."""
    expression = x ** sympy.sympify(exponent)
    for number in (-0.8, 0.0, 0.37):
        at = {**AT, "x": number}
        found, known = (rule(expression, "x", at, order) for rule in (on_graph, by_sympy))
        np.testing.assert_allclose(found, known, rtol=1e-13)


@pytest.mark.parametrize(
    "expression",
    [
        sympy.sqrt(x**2 + y**2), 1 / (x**2 + y**2), (x * y) ** 3 / (t + x) ** 2, x**y, 2**x, x**p,
        sympy.atan2(x, y), sympy.atan2(y * x, x + t), x / sympy.sqrt(y**2 + 1), (x + y) / x**3,
        sympy.exp(-p * x) * sympy.sin(t * x), sympy.sqrt(sympy.sqrt(x)) * x,
        sympy.Piecewise((x**2, x < 1), (2 * x - 1, True)),
        sympy.Piecewise((x, (x > 0) & (t < 1)), (sympy.sin(x), True)) ** 3,
    ],
    ids=str,
)  # fmt: skip
@pytest.mark.parametrize("order", [1, 2])
def test_that_other_rules_give_the_derivatives_of_sympy(expression: Any, order: int) -> None:
    for by in ("x", "y", "p", "t"):
        for number in (0.37, 1.0, 1.8):
            at = {**AT, "x": number}
            found, known = (rule(expression, by, at, order) for rule in (on_graph, by_sympy))
            np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-13)


def test_that_a_cotangent_keeps_its_digits_at_its_zero() -> None:
    """Written as 1 / tan its second derivative is the difference of two large numbers."""
    near = 1.5707963
    cot = float(np.cos(near) / np.sin(near))
    found = on_graph(sympy.cot(x), "x", {"x": near}, order=2)
    assert found == pytest.approx(2 * cot * (1 + cot**2), rel=1e-13)


smooth = st.sampled_from(
    [
        sympy.sin, sympy.cos, sympy.tanh, sympy.atan, sympy.asinh,
        lambda a: sympy.asin(sympy.sin(a) / 2), lambda a: sympy.acos(sympy.cos(a) / 3),
        lambda a: sympy.log(2 + sympy.cos(a)), lambda a: sympy.exp(sympy.sin(a)),
        lambda a: sympy.sec(sympy.atan(a)), lambda a: sympy.sqrt(1 + a**2),
        lambda a: (1 + a**2) ** sympy.Rational(-3, 2), lambda a: (2 + sympy.sin(a)) ** sympy.pi,
        lambda a: sympy.atan2(a, 2 + sympy.cos(a)), lambda a: sympy.acosh(2 + sympy.sin(a)),
        lambda a: sympy.atanh(sympy.sin(a) / 2), lambda a: a**3, lambda a: -a,
        lambda a: sympy.Piecewise((sympy.sin(a), x < y), (a**2, True)),
    ]
)  # fmt: skip
expressions = st.recursive(
    st.sampled_from([x, y, t, p, sympy.Rational(2, 3), sympy.Float(0.3), sympy.Integer(2)]),
    lambda inner: st.one_of(
        st.tuples(smooth, inner).map(lambda pair: pair[0](pair[1])),
        st.tuples(inner, inner).map(lambda pair: pair[0] + pair[1]),
        st.tuples(inner, inner).map(lambda pair: pair[0] * pair[1]),
        st.tuples(inner, inner).map(lambda pair: pair[0] / (2 + pair[1] ** 2)),
    ),
    max_leaves=6,
)


@settings(max_examples=150, deadline=None)
@given(expressions)
def test_that_random_equations_have_the_derivatives_of_complex_steps(inner: sympy.Expr) -> None:
    """Phi_q, nu and gamma of a free equation, gamma by a step from the velocity of Phi."""
    if inner.has(sympy.atan2):  # NumPy's has no complex numbers
        return
    program = lower(
        kc.ConstraintSystem("random", "x y", [x - y / 3 + inner, y - t], parameters={"p": 0.6})
    )
    kernel, names = program.instances[0].kernel, program.instances[0].constraint.columns
    (Phi,), (nu,), (gamma,) = (
        [node for _, _, node in kernel.outputs[name]] for name in ("Phi", "nu", "gamma")
    )
    graph = Graph(kernel.nodes)
    motion = {graph.input(str(name)): graph.input(f"{name}_dot") for name in names}
    motion[graph.input("t")] = graph.const(1)
    (velocity,) = tangents(graph, [Phi], motion)
    at = {name: np.float64(number) for name, number in AT.items()}
    at |= {"x_dot": np.float64(0.7), "y_dot": np.float64(-1.3)}

    def slope(node: int, direction: dict[str, float]) -> Any:
        moved = {name: at[name] + 1e-30j * rate for name, rate in direction.items()}
        return run(graph.nodes, at | moved, {})[node].imag / 1e-30

    values = run(graph.nodes, at, {})
    along = {"x": 0.7, "y": -1.3, "t": 1.0}
    pairs = [(nu, -slope(Phi, {"t": 1.0})), (velocity, slope(Phi, along))]
    pairs += [(gamma, -slope(velocity, along))]
    pairs += [
        (node, slope(Phi, {str(names[column]): 1.0})) for _, column, node in kernel.outputs["Phi_q"]
    ]
    found, known = zip(*((values[node], number) for node, number in pairs), strict=True)
    np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-12)


def test_that_a_table_is_differentiated_by_its_own_polynomials() -> None:
    angles = np.linspace(0, 2 * np.pi, 13)[:-1]
    table = fit(angles, 2 + 0.3 * np.cos(angles))
    graph = Graph()
    node = graph.table("rho", 0, graph.mul(graph.const(2), graph.input("x")))
    for order in (1, 2, 3):
        slope = derivative(graph, node, "x", order)
        found = run(graph.nodes, {"x": 0.3}, {"rho": table})[slope]
        assert found == pytest.approx(2**order * table(0.6, order), rel=1e-14)


def test_that_what_does_not_depend_on_the_direction_has_a_plain_zero() -> None:
    graph = Graph()
    node = graph.mul(graph.input("x"), graph.call("sin", graph.input("y")))
    before = len(graph.nodes)
    found = tangents(graph, [node, graph.input("x")], {graph.input("t"): graph.const(1)})
    assert [graph.value_of(item) for item in found] == [0, 0]
    assert len(graph.nodes) <= before + 3  # t, one and zero


def test_that_a_chain_of_a_thousand_functions_needs_no_recursion() -> None:
    graph = Graph()
    node = graph.input("x")
    for _ in range(1_000):
        node = graph.call("sin", graph.add(node, graph.input("t")))
    found = derivative(graph, node, "x")
    assert np.isfinite(value(graph, found, AT))


def test_that_an_operation_without_a_rule_is_named() -> None:
    graph = Graph()
    node = graph.call("erf", graph.input("x"))
    with pytest.raises(InternalError, match=r"'call'.*erf"):
        derivative(graph, node, "x")
    assert "erf" not in FUNCTIONS


def test_that_every_example_can_be_differentiated_by_its_parameters(example: Any) -> None:
    """Phi, Phi_q, nu and gamma by each parameter, against complex steps of the same code."""
    program = lower(system_of(example.model))
    code = inline(program)
    random = np.random.default_rng(3)
    at: dict[str, Any] = {"t": 0.3}
    for item in program.coordinates:
        at[item.name] = item.guess + 0.1 * random.normal()
        at[f"{item.name}_dot"], at[f"{item.name}_ddot"] = random.normal(size=2)
    at |= {item.name: 1.01 * (item.default or 0.0) + 0.001 for item in program.parameters}
    outputs = [
        entry.node
        for section in code.sections
        for entries in section.entries.values()
        for entry in entries
    ]
    for parameter in program.parameters:
        graph = Graph(code.nodes)
        found = tangents(graph, outputs, {graph.input(parameter.name): graph.const(1)})
        ours = np.array(run(graph.nodes, at, program.tables), dtype=float)[found]
        moved = {**at, parameter.name: at[parameter.name] + 1e-30j}
        known = np.imag(np.array(run(code.nodes, moved, program.tables)))[outputs] / 1e-30
        np.testing.assert_allclose(ours, known, rtol=1e-13, atol=1e-13, err_msg=parameter.name)
