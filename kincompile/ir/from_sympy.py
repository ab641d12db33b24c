"""SymPy expressions as straight-line code."""

from __future__ import annotations

from fractions import Fraction
from functools import cache, reduce
from typing import TYPE_CHECKING, cast

import sympy
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanFunction

from kincompile.errors import InternalError
from kincompile.ir.graph import Graph, pruned
from kincompile.model.laws import MotionLaw
from kincompile.model.spline import PeriodicSpline

if TYPE_CHECKING:
    from collections.abc import Callable

    from sympy.functions.elementary.piecewise import ExprCondPair

    from kincompile.ir.graph import Node
    from kincompile.model.expressions import Scalar

FUNCTIONS = {
    sympy.sin: "sin", sympy.cos: "cos", sympy.tan: "tan",
    sympy.asin: "asin", sympy.acos: "acos", sympy.atan: "atan", sympy.atan2: "atan2",
    sympy.sinh: "sinh", sympy.cosh: "cosh", sympy.tanh: "tanh",
    sympy.asinh: "asinh", sympy.acosh: "acosh", sympy.atanh: "atanh",
    sympy.exp: "exp", sympy.log: "log",
}  # fmt: skip
QUOTIENTS = {sympy.cot: ("cos", "sin"), sympy.sec: (None, "cos"), sympy.csc: (None, "sin")}
RELATIONS = {
    sympy.Lt: "<", sympy.Le: "<=", sympy.Gt: ">", sympy.Ge: ">=", sympy.Eq: "==", sympy.Ne: "!=",
}  # fmt: skip


class Converter:
    """Writes SymPy expressions into a graph; `leaf` gives the node of a symbol by name."""

    def __init__(self, graph: Graph, leaf: Callable[[str], int]) -> None:
        self._graph = graph
        self._leaf = leaf
        self._done: dict[sympy.Basic, int] = {}

    def convert(self, value: Scalar | sympy.Basic) -> int:
        """Return the node of a number or expression."""
        if not isinstance(value, sympy.Basic):
            return self._graph.const(value)
        if value not in self._done:
            self._done[value] = self._convert(value)
        return self._done[value]

    def _convert(self, value: sympy.Basic) -> int:
        graph = self._graph
        if isinstance(value, sympy.Symbol):
            return self._leaf(value.name)
        if isinstance(value, sympy.Number):
            return self._number(value)
        if isinstance(value, sympy.NumberSymbol):
            return graph.pi() if value is sympy.pi else graph.const(float(value))
        if isinstance(value, sympy.Add):
            return self._add(value)
        if isinstance(value, sympy.Mul):
            return self._mul(value)
        if isinstance(value, sympy.Pow):
            return self._pow(value.base, value.exp)
        if isinstance(value, sympy.Piecewise):
            return self._piecewise(value)
        return self._function(value)

    def _number(self, value: sympy.Number) -> int:
        if isinstance(value, sympy.Rational):
            return self._graph.const(Fraction(int(value.p), int(value.q)))
        return self._graph.const(float(value))

    def _attribute(self, value: sympy.Number) -> int:
        """Return the node of a number that is a term, or stands in front of a product."""
        return self._number(value)

    def _ordered(self, value: sympy.Add | sympy.Mul) -> list[sympy.Expr]:
        """Return terms in reading order, a positive one first, or factors in reading order."""
        if isinstance(value, sympy.Mul):
            factors: list[sympy.Expr] = value.as_ordered_factors()
            return factors
        terms: list[sympy.Expr] = value.as_ordered_terms()
        terms.sort(key=lambda term: bool(term.could_extract_minus_sign()))
        return terms

    def _add(self, value: sympy.Add) -> int:
        nodes = [
            self._attribute(term) if isinstance(term, sympy.Number) else self.convert(term)
            for term in self._ordered(value)
        ]
        return reduce(self._graph.add, nodes)

    def _mul(self, value: sympy.Mul) -> int:
        """Multiply: one number in front, and one division at most."""
        graph = self._graph
        number, above, below = graph.const(1), graph.const(1), graph.const(1)
        for factor in self._ordered(value):
            base, exponent = factor.as_base_exp()
            if isinstance(factor, sympy.Number):
                number = graph.mul(number, self._attribute(factor))
            elif exponent.is_Rational and exponent.is_negative:
                below = graph.mul(below, self._pow(base, -exponent))
            else:
                above = graph.mul(above, self.convert(factor))
        return graph.div(graph.mul(number, above), below)

    def _pow(self, base: sympy.Expr, exponent: sympy.Expr) -> int:
        graph = self._graph
        if isinstance(exponent, sympy.Rational) and exponent.q <= 2:
            return graph.pow(self.convert(base), Fraction(int(exponent.p), int(exponent.q)))
        return graph.call("pow", self.convert(base), self.convert(exponent))

    def _piecewise(self, value: sympy.Piecewise) -> int:
        *pieces, last = cast("tuple[ExprCondPair, ...]", value.args)
        node = self.convert(last.expr)
        for piece in reversed(pieces):
            node = self._graph.select(self._condition(piece.cond), self.convert(piece.expr), node)
        return node

    def _condition(self, value: sympy.Basic) -> int:
        graph = self._graph
        if isinstance(value, Relational):
            relation = RELATIONS[value.func]
            return graph.compare(relation, self.convert(value.lhs), self.convert(value.rhs))
        if isinstance(value, sympy.And | sympy.Or):
            connective = "&" if isinstance(value, sympy.And) else "|"
            return graph.logic(connective, *(self._condition(item) for item in value.args))
        if isinstance(value, BooleanFunction):
            return self._condition(sympy.to_nnf(value, simplify=False))
        raise InternalError(f"the condition {value} passed the checks but cannot be compiled")

    def _function(self, value: sympy.Basic) -> int:
        graph = self._graph
        if isinstance(value, PeriodicSpline):
            return graph.table(value.table_name, value.order, self.convert(value.args[0]))
        if isinstance(value, MotionLaw):
            law: type[MotionLaw] = type(value)
            nodes, last = _law_code(law)
            arguments = map(self.convert, value.args)
            return graph.instantiate(nodes, dict(zip(("u", "ramp"), arguments, strict=False)))[last]
        if value.func in FUNCTIONS:
            return graph.call(FUNCTIONS[value.func], *(self.convert(item) for item in value.args))
        if value.func in QUOTIENTS:
            above, below = QUOTIENTS[value.func]
            inner = self.convert(value.args[0])
            dividend = graph.call(above, inner) if above else graph.const(1)
            return graph.div(dividend, graph.call(below, inner))
        raise InternalError(f"{value} passed the checks but cannot be compiled")


@cache
def _law_code(law: type[MotionLaw]) -> tuple[list[Node], int]:
    """Return the code of a motion law in its own symbols, and the node of its value."""
    graph = Graph()
    node = Converter(graph, graph.input).convert(law.written_out())
    nodes, new = pruned(graph.nodes, [node])
    return nodes, new[node]
