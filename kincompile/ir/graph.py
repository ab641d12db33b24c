"""Straight-line code as a hash-consed graph: an expression written twice is one node.

This is value numbering. A node is a tuple ``(operation, *operands)``; operands of arithmetic are
the numbers of earlier nodes. The constructors fold constants, zeros and ones and carry signs
outward, so that an attribute that happens to be zero costs nothing in the emitted code, and
``a - b`` and ``b - a`` share their work.
"""

from __future__ import annotations

import sys
from fractions import Fraction
from math import isqrt, sqrt
from typing import TYPE_CHECKING, Any

from kincompile.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence

Node = tuple[Any, ...]
Constant = int | float | Fraction

LARGEST = sys.float_info.max
EXACT = 2**53
"""Below this a float that is a whole number may be written as one."""


class Graph:
    """A growing table of nodes, each value once."""

    def __init__(self, nodes: Sequence[Node] = ()) -> None:
        self.nodes: list[Node] = []
        self._index: dict[Node, int] = {}
        for node in nodes:
            self._intern(node)

    def _intern(self, node: Node) -> int:
        found = self._index.get(node)
        if found is None:
            found = self._index[node] = len(self.nodes)
            self.nodes.append(node)
        return found

    def const(self, value: Constant) -> int:
        """Return a number; a whole number is kept as an int, a fraction of floats exactly.

        Raises
        ------
        ModelError
            If the number, a product of constants perhaps, is beyond the range of floats.
        """
        if not -LARGEST <= value <= LARGEST:
            raise ModelError(
                "a constant of the model is beyond 1e308, the range of floating-point numbers; "
                "choose other units"
            )
        if isinstance(value, Fraction) and max(abs(value.numerator), value.denominator) > LARGEST:
            value = float(value)  # such as (10^400 + 1) / 10^400
        if -EXACT < value < EXACT and value == (whole := int(value)):
            value = whole
        elif isinstance(value, Fraction) and value.denominator == 1:
            value = value.numerator
        if value < 0:
            return self._intern(("neg", self._intern(("const", -value))))
        return self._intern(("const", value))

    def pi(self) -> int:
        """Return pi."""
        return self._intern(("pi",))

    def nan(self) -> int:
        """Return NaN, for a quantity without a value."""
        return self._intern(("nan",))

    def input(self, name: Hashable) -> int:
        """Return a named input."""
        return self._intern(("input", name))

    def value_of(self, node: int) -> Constant | None:
        """Return the number a node stands for, None where it is not a plain number."""
        return number_of(self.nodes, node)

    def add(self, a: int, b: int) -> int:
        """Return a + b."""
        x, y = self.value_of(a), self.value_of(b)
        if x is not None and y is not None:
            return self.const(x + y)
        if x == 0:
            return b
        if y == 0:
            return a
        minus_a, minus_b = self._negated(a), self._negated(b)
        if minus_b is not None:
            return self.sub(a, minus_b)
        if minus_a is not None:
            return self.sub(b, minus_a)
        for difference, taken in ((a, b), (b, a)):
            if self.nodes[difference][0] == "sub" and self.nodes[difference][2] == taken:
                return int(self.nodes[difference][1])
        swapped = self._index.get(("add", b, a))
        return self._intern(("add", a, b)) if swapped is None else swapped

    def sub(self, a: int, b: int) -> int:
        """Return a - b."""
        if a == b:
            return self.const(0)
        x, y = self.value_of(a), self.value_of(b)
        if x is not None and y is not None:
            return self.const(x - y)
        if y == 0:
            return a
        if x == 0:
            return self.neg(b)
        minus_a, minus_b = self._negated(a), self._negated(b)
        if minus_b is not None:
            return self.add(a, minus_b)
        if minus_a is not None:
            return self.neg(self.add(minus_a, b))
        if self.nodes[a][0] == "add" and b in self.nodes[a][1:]:
            first, second = self.nodes[a][1:]
            return int(first if b == second else second)
        reverse = self._index.get(("sub", b, a))
        return self._intern(("sub", a, b)) if reverse is None else self.neg(reverse)

    def neg(self, a: int) -> int:
        """Return -a."""
        inner = self._negated(a)
        if inner is not None:
            return inner
        if self.nodes[a] == ("const", 0):
            return a
        return self._intern(("neg", a))

    def mul(self, a: int, b: int) -> int:
        """Return a b."""
        x, y = self.value_of(a), self.value_of(b)
        if x is not None and y is not None:
            return self.const(x * y)
        if 0 in (x, y):
            return self.const(0)
        if x == 1:
            return b
        if y == 1:
            return a
        minus_a, minus_b = self._negated(a), self._negated(b)
        if minus_a is not None:
            return self.neg(self.mul(minus_a, b))
        if minus_b is not None:
            return self.neg(self.mul(a, minus_b))
        if y is not None:
            a, b, x = b, a, y
        if x is not None:
            return self._scale(x, a, b)
        if a == b:
            return self._intern(("square", a))
        swapped = self._index.get(("mul", b, a))
        return self._intern(("mul", a, b)) if swapped is None else swapped

    def _scale(self, value: Constant, number: int, b: int) -> int:
        """Multiply by a positive number, gathering it with a number already in front."""
        operation, *operands = self.nodes[b]
        if operation == "mul" and (inner := self.value_of(operands[0])) is not None:
            return self.mul(self.const(value * inner), operands[1])
        if operation == "div" and isinstance(value, int | Fraction):
            inner = self.value_of(operands[1])
            if isinstance(inner, int):
                return self.mul(self.const(Fraction(value) / inner), operands[0])
        if isinstance(value, Fraction):
            return self.div(self.mul(self.const(value.numerator), b), self.const(value.denominator))
        return self._intern(("mul", number, b))

    def div(self, a: int, b: int) -> int:
        """Return a / b."""
        x, y = self.value_of(a), self.value_of(b)
        if x == 0 and y != 0:
            return a
        if y == 1:
            return a
        if x is not None and y:
            exact = isinstance(x, int | Fraction) and isinstance(y, int | Fraction)
            return self.const(Fraction(x) / Fraction(y) if exact else x / y)
        minus_a, minus_b = self._negated(a), self._negated(b)
        if minus_a is not None:
            return self.neg(self.div(minus_a, b))
        if minus_b is not None:
            return self.neg(self.div(a, minus_b))
        return self._intern(("div", a, b))

    def pow(self, a: int, exponent: Constant) -> int:
        """Return a to a constant power: by repeated squaring, of the root for a half of one."""
        if exponent in (0, 1):
            return a if exponent else self.const(1)
        if isinstance(exponent, float) or exponent.denominator > 2:
            return self.call("pow", a, self.const(exponent))
        if exponent < 0:
            return self.div(self.const(1), self.pow(a, -exponent))
        if exponent.denominator == 2:
            return self.pow(self.call("sqrt", a), exponent.numerator)
        square = self.square(self.pow(a, exponent // 2))
        return self.mul(square, a) if exponent % 2 else square

    def square(self, a: int) -> int:
        """Return a squared."""
        inner = self._negated(a)
        a = a if inner is None else inner
        value = self.value_of(a)
        return self._intern(("square", a)) if value is None else self.const(value * value)

    def call(self, name: str, *arguments: int) -> int:
        """Return an elementary function of its arguments."""
        if len(arguments) == 1:
            value = self.value_of(arguments[0])
            if value == 0 and name in AT_ZERO:
                return self.const(AT_ZERO[name])
            if value is not None and name == "sqrt" and (root := _root(value)) is not None:
                return self.const(root)
        return self._intern(("call", name, *arguments))

    def select(self, condition: int, a: int, b: int) -> int:
        """Return a where the condition holds, else b."""
        return a if a == b else self._intern(("select", condition, a, b))

    def compare(self, relation: str, a: int, b: int) -> int:
        """Return the truth of ``a relation b``."""
        return self._intern(("compare", relation, a, b))

    def logic(self, connective: str, *operands: int) -> int:
        """Return a conjunction or disjunction, ``&`` or ``|``."""
        first, *rest = operands
        for operand in rest:
            first = self._intern(("logic", connective, first, operand))
        return first

    def table(self, name: str, order: int, a: int) -> int:
        """Return a tabulated function, or its derivative of the given order, at a."""
        return self._intern(("table", name, order, a))

    def linear(self, name: str, size: int, index: int, operands: Sequence[int]) -> int:
        """Return a component of a small linear system's solution, or its determinant.

        ``name`` is ``"solve"`` or ``"determinant"``; the operands are the matrix row by row, and
        for ``"solve"`` the right side after it.
        """
        return self._intern(("linear", name, size, index, *operands))

    def _negated(self, a: int) -> int | None:
        content = self.nodes[a]
        return content[1] if content[0] == "neg" else None

    def apply(self, operation: Sequence[str], operands: Sequence[int]) -> int:
        """Return ``("add",)``, ``("call", "sin")`` or the like on nodes of this graph."""
        kind, *name = operation
        return int(getattr(self, kind)(*name, *operands))

    def instantiate(self, nodes: Sequence[Node], inputs: Mapping[Any, int]) -> list[int]:
        """Copy code into this graph with its inputs bound; return the new number of each node.

        Copying runs through the folding constructors: this is where an attribute that is zero
        removes its terms.
        """
        new: list[int] = []
        for operation, *operands in nodes:
            if operation == "input":
                new.append(inputs[operands[0]])
            elif operation == "const":
                new.append(self.const(operands[0]))
            elif operation in ("add", "sub", "mul", "div"):
                apply: Callable[[int, int], int] = getattr(self, operation)
                new.append(apply(new[operands[0]], new[operands[1]]))
            elif operation in ("neg", "square"):
                new.append(getattr(self, operation)(new[operands[0]]))
            elif operation == "call":
                new.append(self.call(operands[0], *[new[k] for k in operands[1:]]))
            else:
                new.append(self._copy(operation, operands, new))
        return new

    def _copy(self, operation: str, operands: list[Any], new: list[int]) -> int:
        match operation, operands:
            case "pi", _:
                return self.pi()
            case "nan", _:
                return self.nan()
            case "logic", [name, *arguments]:
                return self.logic(name, *(new[k] for k in arguments))
            case "compare", [relation, a, b]:
                return self.compare(relation, new[a], new[b])
            case "select", [condition, a, b]:
                return self.select(new[condition], new[a], new[b])
            case "table", [name, order, a]:
                return self.table(name, order, new[a])
        raise TypeError(f"unknown operation {operation!r}")


AT_ZERO = {"cos": 1, "sin": 0, "tan": 0, "sqrt": 0, "exp": 1, "sinh": 0, "cosh": 1, "tanh": 0}
"""Elementary functions that are exact numbers at zero."""


def number_of(nodes: Sequence[Node], node: int) -> Constant | None:
    """Return the number a node stands for, None where it is not a plain number."""
    content = nodes[node]
    if content[0] == "const":
        value: Constant = content[1]
        return value
    if content[0] == "neg":
        inner = number_of(nodes, content[1])
        return None if inner is None else -inner
    return None


_FIRST_OPERAND = {
    "const": 2, "input": 2, "call": 2, "compare": 2, "logic": 2, "table": 3, "linear": 4,
}  # fmt: skip
"""Where the operands begin, if not right after the operation's name."""


def operands_of(node: Node) -> tuple[int, ...]:
    """Return the nodes a node depends on."""
    return node[_FIRST_OPERAND.get(node[0], 1) :]


def reachable(nodes: Sequence[Node], outputs: Iterable[int]) -> list[int]:
    """Return the nodes that some outputs depend on, themselves included, in order."""
    found, waiting = set(outputs), list(outputs)
    while waiting:
        for operand in operands_of(nodes[waiting.pop()]):
            if operand not in found:
                found.add(operand)
                waiting.append(operand)
    return sorted(found)


def depending_on(nodes: Sequence[Node], inputs: Iterable[int]) -> set[int]:
    """Return the nodes that depend on any of the inputs."""
    found = set(inputs)
    for node, content in enumerate(nodes):
        if not found.isdisjoint(operands_of(content)):
            found.add(node)
    return found


def pruned(nodes: Sequence[Node], outputs: Iterable[int]) -> tuple[list[Node], dict[int, int]]:
    """Return the code that some outputs need, and the new number of each node that is left."""
    kept = reachable(nodes, outputs)
    number = {node: k for k, node in enumerate(kept)}
    return [_renumbered(nodes[node], number) for node in kept], number


def _renumbered(node: Node, number: Mapping[int, int]) -> Node:
    first = len(node) - len(operands_of(node))
    return (*node[:first], *(number[operand] for operand in node[first:]))


def _root(value: Constant) -> Constant | None:
    """Return a square root that is known: of a float, or of a number that has an exact one."""
    if value < 0:
        return None
    if isinstance(value, float):
        return sqrt(value)
    root = Fraction(isqrt(value.numerator), isqrt(value.denominator))
    return root if root * root == value else None
