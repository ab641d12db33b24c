"""Expressions of equal structure are differentiated once; free equations share one kernel.

The structure of an expression is what is left when its symbols are numbered in order of occurrence
and its numbers are taken for attributes: ``phi_a - 1.5*phi_b`` and ``phi_c - 2.5*phi_d`` both are
``q_1 + c_1*q_2``. Exponents and signs stay what they are, because they decide about the code.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.ir.from_sympy import FUNCTIONS, RECIPROCALS, Converter
from kincompile.ir.graph import Graph
from kincompile.ir.kernels import equation_kernel
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from kincompile.ir.graph import Node
    from kincompile.ir.program import Kernel
    from kincompile.model.resolve import FreeEquation

_COMMUTATIVE = (sympy.Add, sympy.Mul)
_KNOWN = (*_COMMUTATIVE, sympy.Pow, *FUNCTIONS, *RECIPROCALS)


class _Unknown(Exception):  # noqa: N818 - no error, but the end of a search
    """An equation with an operation whose structure is not looked into: splines, conditions."""


@dataclass(frozen=True, slots=True)
class SharedEquation:
    """A free equation as an instance of the kernel of its structure.

    Attributes
    ----------
    columns
        Name of the coordinate of each of the kernel's columns.
    values
        What each of the kernel's inputs stands for: the name of a coordinate, a rate, a parameter,
        of time, or a number.
    """

    kernel: Kernel
    columns: tuple[str, ...]
    values: Mapping[str, str | sympy.Number]


@dataclass(frozen=True, slots=True)
class SharedValue:
    """A derivative of an expression as an instance of the code of its structure.

    Attributes
    ----------
    nodes
        The code; the last node is the value.
    values
        What each of its inputs stands for: the name of a symbol, or a number.
    """

    nodes: tuple[Node, ...]
    values: Mapping[str, str | sympy.Number]


class EquationShapes:
    """The kernels of free equations and the derivatives of functions, one a structure.

    Parameters
    ----------
    coordinates
        Names of the coordinates; any other name but t is a parameter.
    """

    def __init__(self, coordinates: Collection[str]) -> None:
        self._coordinates = coordinates
        self._kernels: dict[Any, Kernel] = {}
        self._derivatives: dict[Any, tuple[Node, ...]] = {}

    def shared(self, equation: FreeEquation) -> SharedEquation | None:
        """Return an equation as an instance of a kernel; None where it needs one of its own."""
        shape = _Shape(self._coordinates)
        try:
            trees = tuple(shape.tree(item) for item in equation.expressions)
        except _Unknown:
            return None
        columns = {new: old for old, new in shape.symbols.items() if old in self._coordinates}
        if trees not in self._kernels:
            alike = replace(
                equation,
                expressions=tuple(_expression(tree) for tree in trees),
                columns=tuple(columns),
            )
            self._kernels[trees] = equation_kernel(alike)
        rates = {rate(new): rate(old) for new, old in columns.items()}
        return SharedEquation(self._kernels[trees], tuple(columns.values()), shape.values() | rates)

    def derivative(self, value: sympy.Expr, variable: str, order: int) -> SharedValue | None:
        """Return a derivative of a driver or of a profile; None where it has code of its own."""
        shape = _Shape(self._coordinates)
        try:
            tree = shape.tree(value)
        except _Unknown:
            return None
        own = shape.symbols.get(variable, variable)
        key = tree, own, order
        if key not in self._derivatives:
            graph = Graph()
            found = Converter(graph, graph.input).convert(
                _expression(tree).diff(sympy.Symbol(own), order)
            )
            self._derivatives[key] = tuple(graph.nodes[: found + 1])
        return SharedValue(self._derivatives[key], shape.values())


@dataclass(slots=True)
class _Shape:
    """The structure of an equation while it is read.

    Attributes
    ----------
    symbols
        Name in the kernel of each name that occurs, in order of occurrence.
    numbers
        The numbers that occur, in order.
    """

    coordinates: Collection[str]
    symbols: dict[str, str] = field(default_factory=dict)
    numbers: list[sympy.Number] = field(default_factory=list)

    def values(self) -> dict[str, str | sympy.Number]:
        """Return what each name in the kernel stands for."""
        names: dict[str, str | sympy.Number] = {new: old for old, new in self.symbols.items()}
        return names | {f"c_{k}": number for k, number in enumerate(self.numbers, 1)}

    def tree(self, value: sympy.Basic) -> Any:
        """Return the structure: a name, a literal number, or an operation and its operands."""
        if isinstance(value, sympy.Symbol):
            return self._symbol(value.name)
        if isinstance(value, sympy.Number | sympy.NumberSymbol):
            return value
        operands = value.args
        if isinstance(value, _COMMUTATIVE):
            operands = tuple(sorted(operands, key=self._order))
            return (value.func, *(self._term(item) for item in operands))
        if value.func not in _KNOWN:
            raise _Unknown
        return (value.func, *(self.tree(item) for item in operands))

    def _term(self, value: sympy.Basic) -> Any:
        """Return a term or a factor, where a number is an attribute, but a sign is not."""
        if isinstance(value, sympy.Number) and value is not sympy.S.NegativeOne:
            self.numbers.append(value)
            return f"c_{len(self.numbers)}"
        return self.tree(value)

    def _symbol(self, name: str) -> str:
        if name not in self.symbols:
            kind = "q" if name in self.coordinates else "p"
            self.symbols[name] = "t" if name == "t" else f"{kind}_{len(self.symbols) + 1}"
        return self.symbols[name]

    def _order(self, value: sympy.Basic) -> str:
        """Return what terms are sorted by: their structure, whatever the names and numbers."""
        if isinstance(value, sympy.Symbol):
            return "t" if value.name == "t" else "q" if value.name in self.coordinates else "p"
        if isinstance(value, sympy.Number):
            return "-1" if value is sympy.S.NegativeOne else "c"
        operands = [self._order(item) for item in value.args]
        if isinstance(value, _COMMUTATIVE):
            operands.sort()
        return f"{type(value).__name__}({','.join(operands)})"


def _expression(tree: Any) -> Any:
    """Return a structure as an expression."""
    if isinstance(tree, str):
        return sympy.Symbol(tree)
    if isinstance(tree, tuple):
        function, *operands = tree
        return function(*(_expression(item) for item in operands))
    return tree
