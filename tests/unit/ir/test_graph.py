"""Folding never changes a value: random code against exact fractions."""

import operator
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.errors import ModelError
from kincompile.ir.graph import Graph, number_of, operands_of

VALUES = {"x": Fraction(3, 7), "y": Fraction(-5, 2), "z": Fraction(11)}
Recipe = Any
BINARY: Mapping[str, Callable[[Any, Any], Any]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
}  # fmt: skip


def exactly(recipe: Recipe, inputs: Mapping[str, Fraction]) -> Fraction:
    """Work a recipe out without the graph; division by zero raises."""
    match recipe:
        case ("const", value):
            return Fraction(value)
        case ("input", name):
            return inputs[name]
        case ("neg", a):
            return -exactly(a, inputs)
        case ("pow", a, exponent):
            power: Fraction = exactly(a, inputs) ** exponent
            return power
        case (operation, a, b):
            found: Fraction = BINARY[operation](exactly(a, inputs), exactly(b, inputs))
            return found
    raise AssertionError(recipe)


def node_of(recipe: Recipe, graph: Graph) -> int:
    """Carry a recipe out with the constructors of the graph."""
    match recipe:
        case ("const", value):
            return graph.const(value)
        case ("input", name):
            return graph.input(name)
        case ("neg", a):
            return graph.neg(node_of(a, graph))
        case ("pow", a, exponent):
            return graph.pow(node_of(a, graph), exponent)
        case (operation, a, b):
            made: int = getattr(graph, operation)(node_of(a, graph), node_of(b, graph))
            return made
    raise AssertionError(recipe)


def value_at(graph: Graph, node: int, inputs: Mapping[str, Fraction]) -> Fraction:
    """Work a node out with fractions."""
    match graph.nodes[node]:
        case ("const", value):
            return Fraction(value)
        case ("input", name):
            return inputs[name]
        case ("neg", a):
            return -value_at(graph, a, inputs)
        case ("square", a):
            return value_at(graph, a, inputs) ** 2
        case (operation, a, b):
            left, right = value_at(graph, a, inputs), value_at(graph, b, inputs)
            found: Fraction = BINARY[operation](left, right)
            return found
    raise AssertionError(graph.nodes[node])


constants = st.one_of(st.integers(-3, 3), st.fractions(-2, 2, max_denominator=4))
floats = st.sampled_from([0.5, -0.3, 2.0, 1.7])


def recipes_over(numbers: Any) -> Any:
    return st.recursive(
        st.one_of(
            st.tuples(st.just("const"), numbers),
            st.tuples(st.just("input"), st.sampled_from(list(VALUES))),
        ),
        lambda inner: st.one_of(
            st.tuples(st.sampled_from(list(BINARY)), inner, inner),
            st.tuples(st.just("neg"), inner),
            st.tuples(st.just("pow"), inner, st.integers(-2, 4)),
        ),
        max_leaves=8,
    )


recipes = recipes_over(constants)


@given(recipes)
@settings(max_examples=200)
def test_that_folding_keeps_the_value(recipe: Recipe) -> None:
    try:
        expected = exactly(recipe, VALUES)
    except ZeroDivisionError:
        return
    graph = Graph()
    assert value_at(graph, node_of(recipe, graph), VALUES) == expected


@given(recipes_over(floats))
@settings(max_examples=100)
def test_that_folding_floats_keeps_the_value_to_rounding(recipe: Recipe) -> None:
    graph = Graph()
    try:
        expected = float(exactly(recipe, VALUES))
        found = float(value_at(graph, node_of(recipe, graph), VALUES))
    except ZeroDivisionError:
        return
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(recipes, st.dictionaries(st.sampled_from(list(VALUES)), constants))
@settings(max_examples=200)
def test_that_binding_inputs_to_numbers_keeps_the_value(
    recipe: Recipe, bound: dict[str, Any]
) -> None:
    """An attribute that is a number goes through the folding constructors a second time."""
    values = VALUES | {name: Fraction(value) for name, value in bound.items()}
    try:
        expected = exactly(recipe, values)
        kernel = Graph()
        wanted = node_of(recipe, kernel)
        value_at(kernel, wanted, values)
    except ZeroDivisionError:
        return
    graph = Graph()
    inputs = {
        name: graph.const(bound[name]) if name in bound else graph.input(name) for name in VALUES
    }
    new = graph.instantiate(kernel.nodes, inputs)
    assert value_at(graph, new[wanted], values) == expected


@given(recipes)
def test_that_the_same_code_twice_adds_nothing(recipe: Recipe) -> None:
    graph = Graph()
    try:
        first = node_of(recipe, graph)
    except ZeroDivisionError:
        return
    size = len(graph.nodes)
    assert node_of(recipe, graph) == first
    assert len(graph.nodes) == size


@given(recipes)
def test_that_no_neutral_operation_is_left(recipe: Recipe) -> None:
    graph = Graph()
    try:
        node_of(recipe, graph)
    except ZeroDivisionError:
        return
    for node in graph.nodes:
        operands = [number_of(graph.nodes, k) for k in operands_of(node)]
        match node[0]:
            case "add" | "sub":
                assert 0 not in operands
            case "mul":
                assert not {0, 1, -1} & set(operands)
            case "div":
                assert operands[1] not in (1, -1)
                assert operands[0] is None or operands[1] is None or operands[1] == 0
            case "neg":
                assert graph.nodes[node[1]][0] != "neg"


@pytest.fixture
def graph() -> Graph:
    return Graph()


def test_that_equal_values_meet(graph: Graph) -> None:
    x, y = graph.input("x"), graph.input("y")
    assert graph.input("x") == x
    assert graph.add(x, y) == graph.add(y, x)
    assert graph.mul(x, y) == graph.mul(y, x)
    assert graph.neg(graph.sub(x, y)) == graph.sub(y, x)
    assert graph.mul(x, x) == graph.square(graph.neg(x)) == graph.pow(x, 2)
    assert graph.mul(graph.neg(x), graph.neg(y)) == graph.mul(x, y)


def test_that_numbers_gather_in_front(graph: Graph) -> None:
    x = graph.input("x")
    assert graph.mul(graph.const(2), graph.mul(x, graph.const(3))) == graph.mul(graph.const(6), x)
    assert graph.mul(graph.const(2), graph.div(x, graph.const(2))) == x


def test_that_a_fraction_is_kept_exactly(graph: Graph) -> None:
    third = graph.div(graph.const(1), graph.const(3))
    assert graph.value_of(third) == Fraction(1, 3)
    assert graph.value_of(graph.mul(third, graph.const(3))) == 1
    assert isinstance(graph.value_of(graph.const(2.0)), int)


def test_that_a_number_over_zero_is_left_to_run_time(graph: Graph) -> None:
    assert graph.nodes[graph.div(graph.const(1), graph.const(0))][0] == "div"


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("cos", 0, 1), ("sin", 0, 0), ("tan", 0, 0), ("exp", 0, 1), ("sinh", 0, 0), ("cosh", 0, 1),
        ("tanh", 0, 0), ("sqrt", 0, 0), ("sqrt", 9, 3), ("sqrt", 0.25, 0.5),
        ("sqrt", Fraction(4, 9), Fraction(2, 3)),
    ],
)  # fmt: skip
def test_that_functions_of_special_numbers_are_numbers(
    graph: Graph, name: str, value: Any, expected: Any
) -> None:
    assert graph.value_of(graph.call(name, graph.const(value))) == expected


@pytest.mark.parametrize(("name", "value"), [("cos", 1), ("sqrt", 2), ("sqrt", -4)])
def test_that_other_functions_of_numbers_stay(graph: Graph, name: str, value: Any) -> None:
    assert graph.value_of(graph.call(name, graph.const(value))) is None


def test_that_a_selection_between_equal_values_is_the_value(graph: Graph) -> None:
    x = graph.input("x")
    positive = graph.compare(">", x, graph.const(0))
    assert graph.select(positive, x, x) == x
    assert graph.nodes[graph.select(positive, x, graph.neg(x))][0] == "select"


def test_that_all_operations_can_be_copied() -> None:
    kernel = Graph()
    x, y = kernel.input("x"), kernel.input("y")
    both = kernel.logic("&", kernel.compare("<", x, y), kernel.compare(">", y, kernel.pi()))
    kernel.select(both, kernel.table("rho", 1, x), kernel.call("atan2", x, y))
    copy = Graph()
    new = copy.instantiate(kernel.nodes, {"x": copy.input("x"), "y": copy.input("y")})
    assert copy.nodes == kernel.nodes
    assert new == list(range(len(kernel.nodes)))


def test_that_an_unknown_operation_cannot_be_copied(graph: Graph) -> None:
    with pytest.raises(TypeError, match="unknown operation 'magic'"):
        graph.instantiate([("magic", 0)], {})


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        (("const", 2), ()), (("pi",), ()), (("input", "x"), ()), (("neg", 3), (3,)),
        (("call", "cos", 3), (3,)), (("table", "rho", 1, 4), (4,)), (("add", 1, 2), (1, 2)),
        (("linear", "solve", 1, 0, 5, 6), (5, 6)), (("compare", "<", 1, 2), (1, 2)),
        (("logic", "&", 1, 2), (1, 2)), (("select", 1, 2, 3), (1, 2, 3)),
    ],
)  # fmt: skip
def test_that_the_operands_of_a_node_are_nodes(node: Any, expected: Any) -> None:
    assert operands_of(node) == expected


@pytest.mark.parametrize("value", [1e200, 1.5e-7, 10**200, Fraction(10**200, 3), 2.0**60])
def test_that_large_and_small_constants_keep_their_value(graph: Graph, value: Any) -> None:
    assert graph.value_of(graph.const(value)) == value
    assert isinstance(value, int) or not isinstance(graph.value_of(graph.const(value)), int)


@pytest.mark.parametrize("value", [10**200, 1e200, 1.5e160, Fraction(10**200, 3)])
def test_that_a_product_beyond_floats_is_refused(graph: Graph, value: Any) -> None:
    with pytest.raises(ModelError, match=r"beyond 1e308, the range of .*; choose other units"):
        graph.mul(graph.const(value), graph.const(value))


def test_that_a_fraction_of_numbers_beyond_floats_is_a_constant():
    graph = Graph()
    assert graph.value_of(graph.const(Fraction(10**400 + 1, 10**400))) == 1
    assert graph.value_of(graph.const(Fraction(-3 * 10**400, 2 * 10**400 + 1))) == -1.5
    assert graph.value_of(graph.const(Fraction(1, 10**400))) == 0
    with pytest.raises(ModelError, match="beyond 1e308"):
        graph.const(Fraction(10**800, 10**400))
