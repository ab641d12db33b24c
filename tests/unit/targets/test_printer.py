"""Text of random code, evaluated by Python itself, has the value of the code."""

import ast
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.emitters.numpy.text import NUMPY
from kincompile.emitters.printer import Printer
from kincompile.ir.graph import Graph, operands_of

VALUES = {"x": Fraction(3, 7), "y": Fraction(-5, 2)}


class Exactly(ast.NodeTransformer):
    """Replace the integers of a text by fractions, so that 1 / 3 is a third."""

    def visit_Constant(self, node: ast.Constant) -> Any:
        return ast.Call(ast.Name("Fraction", ast.Load()), [node], [])

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        node.left = self.visit(node.left)
        if not isinstance(node.op, ast.Pow):  # the exponent stays
            node.right = self.visit(node.right)
        return node


def evaluated(text: str, names: dict[str, Fraction]) -> Fraction:
    tree = ast.fix_missing_locations(Exactly().visit(ast.parse(text, mode="eval")))
    found: Fraction = eval(compile(tree, "<text>", "eval"), {"Fraction": Fraction, **names})
    return found


def value_of(graph: Graph, node: int) -> Fraction:
    match graph.nodes[node]:
        case ("const", value):
            return Fraction(value)
        case ("input", name):
            return VALUES[name]
        case ("neg", a):
            return -value_of(graph, a)
        case ("square", a):
            return value_of(graph, a) ** 2
        case ("add", a, b):
            return value_of(graph, a) + value_of(graph, b)
        case ("sub", a, b):
            return value_of(graph, a) - value_of(graph, b)
        case ("mul", a, b):
            return value_of(graph, a) * value_of(graph, b)
        case ("div", a, b):
            return value_of(graph, a) / value_of(graph, b)
    raise AssertionError(graph.nodes[node])


# As they come, without the folding constructors: every shape of a tree must print right.
nodes = st.lists(
    st.one_of(
        st.tuples(st.just("const"), st.sampled_from([0, 1, 2, 7, Fraction(2, 3)])),
        st.tuples(st.just("input"), st.sampled_from(list(VALUES))),
        st.tuples(st.sampled_from(["neg", "square"]), st.integers(0, 30)),
        st.tuples(
            st.sampled_from(["add", "sub", "mul", "div"]), st.integers(0, 30), st.integers(0, 30)
        ),
    ),
    min_size=2,
    max_size=9,
)


def code(drawn: list[Any]) -> Graph:
    """Return a graph of these nodes, operands taken from the nodes before."""
    graph = Graph()
    graph.nodes = [("input", "x")]
    for operation, *operands in drawn:
        if operation not in ("const", "input"):
            operands = [operand % len(graph.nodes) for operand in operands]
        graph.nodes.append((operation, *operands))
    return graph


@given(nodes)
@settings(max_examples=300)
def test_that_the_text_has_the_value_of_the_code(drawn: list[Any]) -> None:
    graph = code(drawn)
    last = len(graph.nodes) - 1
    names = {k: name for k, (operation, name, *_) in enumerate(graph.nodes) if operation == "input"}
    try:
        expected = value_of(graph, last)
    except ZeroDivisionError:
        return
    assert evaluated(Printer(NUMPY, graph.nodes, names).text(last), VALUES) == expected


@given(nodes)
def test_that_a_named_node_is_printed_as_its_name(drawn: list[Any]) -> None:
    graph = code(drawn)
    names = {k: f"n_{k}" for k in range(len(graph.nodes))}
    printer = Printer(NUMPY, graph.nodes, names)
    for k, node in enumerate(graph.nodes):
        assert printer.text(k) == f"n_{k}"
        if node[0] not in ("const", "input"):
            own = printer.definition(k)
            assert all(f"n_{operand}" in own for operand in operands_of(node))


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda g, x, y: g.sub(x, g.sub(y, g.square(x))), "x - (y - x**2)"),
        (lambda g, x, y: g.mul(g.add(x, y), y), "(x + y) * y"),
        (lambda g, x, y: g.div(x, g.mul(x, y)), "x / (x * y)"),
        (lambda g, x, y: g.square(g.add(x, y)), "(x + y)**2"),
        (lambda g, x, y: g.neg(g.mul(x, y)), "-x * y"),
        (lambda g, x, y: g.neg(g.add(x, y)), "-(x + y)"),
        (lambda g, x, y: g.call("atan2", g.add(x, y), y), "atan2(x + y, y)"),
        (lambda g, x, y: g.mul(g.const(Fraction(1, 3)), x), "x / 3"),
        (lambda g, x, _: g.add(x, g.const(Fraction(1, 3))), "x + 1 / 3"),
        (lambda g, x, _: g.mul(g.pi(), x), "pi * x"),
        (lambda g, x, y: g.select(g.compare("<", x, y), x, y), "where((x < y), x, y)"),
        (lambda g, x, y: g.logic("&", g.compare("<", x, y), g.pi()), "((x < y) & pi)"),
        (lambda g, x, _: g.table("rho_a", 2, x), "f.spline(rho_a, 2, x)"),
    ],
)  # fmt: skip
def test_that_text_reads_well(make: Any, text: str) -> None:
    graph = Graph()
    x, y = graph.input("x"), graph.input("y")
    assert Printer(NUMPY, graph.nodes, {x: "x", y: "y"}).text(make(graph, x, y)) == text


def test_that_an_unknown_node_is_not_printed() -> None:
    with pytest.raises(TypeError, match="cannot print"):
        Printer(NUMPY, [("magic", 0)], {}).text(0)
