"""Derivatives of straight-line code, in the same graph: forward tangents along a direction.

A direction gives some inputs a rate, a node each; the tangent of every other node follows from
those of its operands by one rule an operation. What does not depend on these inputs costs nothing,
and what a derivative shares with the value, or with another derivative, is one node.

Products, quotients, powers and roots are one thing, a number times powers of bases. They are
differentiated, multiplied and written as such: by the product rule alone the slope of
``sqrt(x)*x`` would be zero times infinity at zero, and nothing would cancel.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from kincompile.errors import InternalError
from kincompile.ir.graph import Constant, operands_of, pruned

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from kincompile.ir.graph import Graph, Node

    Tangent = Callable[[int], int]
    Product = tuple[Constant, dict[int, Constant]]


def tangents(graph: Graph, outputs: Sequence[int], direction: Mapping[int, int]) -> list[int]:
    r"""Return the derivatives :math:`\sum_k f_{x_k} d_k` of nodes f along a direction d.

    Derivatives are added to the graph. The direction is the rate :math:`d_k` of each input
    :math:`x_k` that changes, both nodes; 1 for a partial derivative. Any node may stand in it, and
    is then taken for an input. A derivative is a plain zero where an output does not depend on the
    direction.
    """
    zero = graph.const(0)
    found = dict(direction)
    parts = _parts(graph, outputs, direction)
    for node in sorted(parts):
        tangent = zero
        if any(found[part] != zero for part in parts[node]):
            tangent = _tangent(graph, node, found.__getitem__)
        found[node] = tangent
    return [found[node] for node in outputs]


def negated_tangents(
    graph: Graph, outputs: Sequence[int], direction: Mapping[int, int]
) -> list[int]:
    """Return the tangents of nodes with the opposite sign, which is carried into sums."""
    terms = [list(_terms(graph, node)) for node in outputs]
    found = iter(tangents(graph, [node for sums in terms for node, _ in sums], direction))
    totals = []
    for sums in terms:
        signed = [graph.neg(next(found)) if sign > 0 else next(found) for _, sign in sums]
        # A positive term first, so that no minus stands in front of the sum.
        signed.sort(key=lambda node: graph.nodes[node][0] == "neg")
        total = signed[0]
        for node in signed[1:]:
            total = graph.add(total, node)
        totals.append(total)
    return totals


def derivative(graph: Graph, node: int, variable: str, order: int = 1) -> int:
    """Return the derivative of a node by an input, of any order; of order 0 it is the node."""
    by = {graph.input(variable): graph.const(1)}
    for _ in range(order):
        (node,) = tangents(graph, [node], by)
    return node


def derivative_code(graph: Graph, node: int, variable: str, order: int) -> tuple[Node, ...]:
    """Return the code of a derivative of a node by an input; its last node is the value."""
    return tuple(pruned(graph.nodes, [derivative(graph, node, variable, order)])[0])


def _terms(graph: Graph, node: int) -> Iterable[tuple[int, int]]:
    """Yield the terms of a sum with their signs, in order."""
    waiting = [(node, 1)]
    while waiting:
        node, sign = waiting.pop()
        match graph.nodes[node]:
            case "add", a, b:
                waiting += (b, sign), (a, sign)
            case "sub", a, b:
                waiting += (b, -sign), (a, sign)
            case "neg", a:
                waiting.append((a, -sign))
            case _:
                yield node, sign


def _parts(
    graph: Graph, outputs: Iterable[int], direction: Mapping[int, int]
) -> dict[int, tuple[int, ...]]:
    """Return the nodes whose tangents are needed, and those that each follows from."""
    parts: dict[int, tuple[int, ...]] = {}
    waiting = list(outputs)
    while waiting:
        node = waiting.pop()
        if node not in parts and node not in direction:
            if _is_product(graph, node):
                parts[node] = tuple(_product(graph, [(node, 1)])[1])
            else:
                parts[node] = operands_of(graph.nodes[node])
            waiting += parts[node]
    return parts


def _tangent(graph: Graph, node: int, d: Tangent) -> int:
    """Return the derivative of a node by those of its parts."""
    if _is_product(graph, node):
        return _product_rule(graph, node, d)
    match graph.nodes[node]:
        case "add" | "sub" as operation, a, b:
            return _sum(graph, operation, d(a), d(b))
        case "select", condition, a, b:
            return graph.select(condition, d(a), d(b))
        case "table", name, order, a:
            return _multiplied(graph, (d(a), 1), (graph.table(name, order + 1, a), 1))
        case "call", "pow", a, b:
            return _general_power_rule(graph, node, (a, d(a)), (b, d(b)))
        case "call", "atan2", y, x:
            above = _sum(
                graph, "sub", _multiplied(graph, (x, 1), (d(y), 1)),
                _multiplied(graph, (y, 1), (d(x), 1)),
            )  # fmt: skip
            return _multiplied(graph, (above, 1), (graph.add(graph.square(x), graph.square(y)), -1))
        case "call", name, a if name in FUNCTIONS:
            return _multiplied(graph, (d(a), 1), *FUNCTIONS[name](graph, node, a))
        case "compare" | "logic", *_:
            return graph.const(0)
    raise InternalError(f"the derivative of {graph.nodes[node]} is not known")


def _general_power_rule(
    graph: Graph, node: int, base: tuple[int, int], exponent: tuple[int, int]
) -> int:
    """Return the derivative of node = a^b, where a and b are given with their rates."""
    (a, a_rate), (b, b_rate) = base, exponent
    lowered = [(node, 1), (a, -1)]
    if not _is_product(graph, a):
        lowered = [(graph.call("pow", a, graph.sub(b, graph.const(1))), 1)]
    by_a = _multiplied(graph, (a_rate, 1), (b, 1), *lowered)
    return graph.add(by_a, _multiplied(graph, (b_rate, 1), (node, 1), (graph.call("log", a), 1)))


def _plus_one(graph: Graph, a: int) -> int:
    return graph.add(graph.square(a), graph.const(1))


def _one_minus(graph: Graph, a: int) -> int:
    return graph.sub(graph.const(1), graph.square(a))


HALF = Fraction(1, 2)
FUNCTIONS: Mapping[str, Callable[[Graph, int, int], Sequence[tuple[int, Constant]]]] = {
    "sin": lambda graph, _, a: [(graph.call("cos", a), 1)],
    "cos": lambda graph, _, a: [(graph.neg(graph.call("sin", a)), 1)],
    "tan": lambda graph, f, _: [(_plus_one(graph, f), 1)],
    "asin": lambda graph, _, a: [(_one_minus(graph, a), -HALF)],
    "acos": lambda graph, _, a: [(graph.const(-1), 1), (_one_minus(graph, a), -HALF)],
    "atan": lambda graph, _, a: [(_plus_one(graph, a), -1)],
    "sinh": lambda graph, _, a: [(graph.call("cosh", a), 1)],
    "cosh": lambda graph, _, a: [(graph.call("sinh", a), 1)],
    "tanh": lambda graph, f, _: [(_one_minus(graph, f), 1)],
    "asinh": lambda graph, _, a: [(_plus_one(graph, a), -HALF)],
    "acosh": lambda graph, _, a: [  # two roots, so that it is NaN below -1 too
        (graph.sub(a, graph.const(1)), -HALF),
        (graph.add(a, graph.const(1)), -HALF),
    ],
    "atanh": lambda graph, _, a: [(_one_minus(graph, a), -1)],
    "exp": lambda _, f, __: [(f, 1)],
    "log": lambda _, __, a: [(a, -1)],
}
"""The derivative of f = f(a) by a, given the nodes of f and a: bases and exponents of a product."""


def _is_product(graph: Graph, node: int) -> bool:
    """Return whether a node is a product of powers with constant exponents."""
    match graph.nodes[node]:
        case (("mul" | "div" | "square" | "neg"), *_):
            return True
        case "call", name, *arguments:
            return name == "sqrt" or (name == "pow" and graph.value_of(arguments[1]) is not None)
    return False


def _product(graph: Graph, powers: Iterable[tuple[int, Constant]]) -> Product:
    """Return a product of powers of nodes as a number and the exponent of each base, in order."""
    number: Constant = 1
    exponents: dict[int, Constant] = {}
    waiting = list(powers)[::-1]
    while waiting:
        node, power = waiting.pop()
        match graph.nodes[node]:
            case "const", value if value and power == int(power):
                exact = Fraction(value) if isinstance(value, int) else value
                number *= exact ** int(power)
            case "neg", a if power == int(power):
                number *= (-1) ** int(power)
                waiting.append((a, power))
            case "mul", a, b if power == int(power):
                waiting += (b, power), (a, power)
            case "div", a, b if power == int(power):
                waiting += (b, -power), (a, power)
            case "square", a if power == int(power):
                waiting.append((a, 2 * power))
            case "call", "sqrt", a:
                exponents[a] = exponents.get(a, 0) + power * HALF
            case "call", "pow", a, b if (value := graph.value_of(b)) is not None:
                exponents[a] = exponents.get(a, 0) + power * value
            case _:
                exponents[node] = exponents.get(node, 0) + power
    return number, {base: exponent for base, exponent in exponents.items() if exponent}


def _multiplied(graph: Graph, *powers: tuple[int, Constant]) -> int:
    """Return the node of a product of powers: one number in front, and one division at most."""
    number, exponents = _product(graph, powers)
    above = below = one = graph.const(1)
    pi_first = sorted(exponents.items(), key=lambda item: graph.nodes[item[0]] != ("pi",))
    for base, exponent in pi_first:
        if exponent > 0:
            above = graph.mul(above, graph.pow(base, exponent))
        else:
            below = graph.mul(below, graph.pow(base, -exponent))
    if below != one and isinstance(number, Fraction):
        below = graph.mul(graph.const(number.denominator), below)
        number = number.numerator
    return graph.div(graph.mul(graph.const(number), above), below)


def _product_rule(graph: Graph, node: int, d: Tangent) -> int:
    """Return the derivative of a product of powers: a term for each base that changes."""
    number, exponents = _product(graph, [(node, 1)])
    total = graph.const(0)
    for base, exponent in exponents.items():
        factor = graph.const(number * exponent)
        # With base^-1 apart, the factors of a base that is a product itself cancel.
        slope = (factor, 1), (base, -1), (d(base), 1)
        term = _multiplied(graph, *exponents.items(), *slope)
        total = _sum(graph, "add", total, term)
    return total


def _sum(graph: Graph, operation: str, a: int, b: int) -> int:
    """Return a + b or a - b, with a number that both have in front taken out."""
    (first, x), (second, y) = _scaled(graph, a), _scaled(graph, b)
    if abs(first) != abs(second) or abs(first) == 1:
        return graph.apply([operation], [a, b])
    if first != second:
        operation = "sub" if operation == "add" else "add"
    return graph.mul(graph.const(first), graph.apply([operation], [x, y]))


def _scaled(graph: Graph, node: int) -> tuple[Constant, int]:
    """Return the number in front of a node, and the rest."""
    match graph.nodes[node]:
        case "neg", a:
            factor, rest = _scaled(graph, a)
            return -factor, rest
        case "mul", a, b if (factor_of_a := graph.value_of(a)) is not None:
            return factor_of_a, b
    return 1, node
