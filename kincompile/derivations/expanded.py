"""The emitted code written out: a node of the program as a formula in sines and cosines.

Nothing is derived here. The formula has the operations of the node, in the same order; names that
the emitted module gives to intermediate values are replaced by what they stand for.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from kincompile.calculus.expressions import Number, Pi, Power, Product, Scalar, Sum, Symbol
from kincompile.report.formulas import Call, Choice, Decimal, Quotient, Relation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.ir.graph import Constant, Node

MINUS_ONE = Number(Fraction(-1))


class Writer:
    """Writes nodes as formulas; a node used twice is one formula."""

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._nodes = nodes
        self._done: dict[int, Scalar] = {}

    def formula(self, node: int) -> Scalar:
        """Return a node as a formula in coordinates, rates, parameters and t."""
        if node not in self._done:
            self._done[node] = self._formula(node)
        return self._done[node]

    def _formula(self, node: int) -> Scalar:
        match self._nodes[node]:
            case ("const", value):
                return number(value)
            case ("pi",):
                return Pi()
            case ("input", name):
                return Symbol(name)
            case ("add", a, b):
                return Sum((*_terms(self.formula(a)), self.formula(b)))
            case ("sub", a, b):
                return Sum((*_terms(self.formula(a)), minus(self.formula(b))))
            case ("neg", a):
                return minus(self.formula(a))
            case ("mul", a, b):
                return Product((*_factors(self.formula(a)), self.formula(b)))
            case ("div", a, b):
                return Quotient(self.formula(a), self.formula(b))
            case ("square", a):
                return Power(self.formula(a), 2)
            case other:
                return self._function(other)

    def _function(self, node: Node) -> Scalar:
        match node:
            case ("call", name, *arguments):
                return Call(name, tuple(self.formula(k) for k in arguments))
            case ("table", name, order, a):
                return Call(f"{name}{chr(39) * order}", (self.formula(a),))
            case ("select", condition, a, b):
                return Choice(self.formula(condition), self.formula(a), self.formula(b))
            case ("compare" | "logic", relation, a, b):
                return Relation(relation, self.formula(a), self.formula(b))
        raise TypeError(f"cannot write {node!r}")


def number(value: Constant) -> Scalar:
    """Return a number of the code as a formula: exact where it is exact."""
    return Decimal(value, 15) if isinstance(value, float) else Number(Fraction(value))


def minus(value: Scalar) -> Scalar:
    """Return a value with its sign changed, as the code does it."""
    if isinstance(value, Number):
        return Number(-value.value)
    return Product((MINUS_ONE, *_factors(value)))


def _terms(value: Scalar) -> tuple[Scalar, ...]:
    return value.terms if isinstance(value, Sum) else (value,)


def _factors(value: Scalar) -> tuple[Scalar, ...]:
    return value.factors if isinstance(value, Product) else (value,)
