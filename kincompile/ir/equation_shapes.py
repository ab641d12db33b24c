"""Expressions of equal structure share their code: free equations a kernel, drivers their slopes.

The structure of an expression is its code with symbols numbered in order of occurrence and numbers
taken for attributes: ``phi_a - 1.5*phi_b`` and ``phi_c - 2.5*phi_d`` both are ``q_1 + c_1*q_2``.
Exponents and the factor -1 stay what they are, because they decide about the code.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.ir.differentiate import derivative_code
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.kernels import differentiated
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from kincompile.ir.graph import Node
    from kincompile.ir.program import Kernel
    from kincompile.model.resolve import FreeEquation

_COMMUTATIVE = (sympy.Add, sympy.Mul)


@dataclass(frozen=True, slots=True)
class SharedEquation:
    """A free equation as an instance of the kernel of its structure."""

    kernel: Kernel
    columns: tuple[str, ...]  # name of the coordinate of each of the kernel's columns
    # The name of a coordinate, a rate, a parameter or of time, or the number, that each of the
    # kernel's inputs stands for.
    values: Mapping[str, str | sympy.Number]


class EquationShapes:
    """The kernels of free equations and the derivatives of functions, one a structure.

    Any name but t and those of the coordinates is a parameter.
    """

    def __init__(self, coordinates: Collection[str]) -> None:
        self._coordinates = coordinates
        self._kernels: dict[Any, Kernel] = {}
        self._derivatives: dict[Any, tuple[Node, ...]] = {}

    def shared(self, equation: FreeEquation) -> SharedEquation:
        """Return an equation as an instance of a kernel."""
        shape = _Shape(self._coordinates)
        Phi = tuple(shape.convert(item) for item in equation.expressions)
        columns = {new: old for old, new in shape.symbols.items() if old in self._coordinates}
        key = tuple(shape.graph.nodes), Phi
        if key not in self._kernels:
            self._kernels[key] = differentiated(shape.graph, Phi, tuple(columns))
        rates = {rate(new): rate(old) for new, old in columns.items()}
        return SharedEquation(self._kernels[key], tuple(columns.values()), shape.values() | rates)

    def derivative(
        self, value: sympy.Expr, variable: str, order: int
    ) -> tuple[tuple[Node, ...], Mapping[str, str | sympy.Number]]:
        """Return the code of a driver, a profile, or one of their derivatives by a variable.

        The last node is the value; each input stands for the symbol that is named, or the number.
        """
        shape = _Shape(self._coordinates)
        node = shape.convert(value)
        own = shape.symbols.get(variable, variable)
        key = tuple(shape.graph.nodes), node, own, order
        if key not in self._derivatives:
            self._derivatives[key] = derivative_code(shape.graph, node, own, order)
        return self._derivatives[key], shape.values()


class _Shape(Converter):
    """Writes an expression in names of its own, in an order that no name or number decides."""

    def __init__(self, coordinates: Collection[str]) -> None:
        self.graph = Graph()
        super().__init__(self.graph, self._symbol)
        self.symbols: dict[str, str] = {}  # names in the code, in order of occurrence
        self._coordinates = coordinates
        self._numbers: list[sympy.Number] = []

    def values(self) -> dict[str, str | sympy.Number]:
        """Return the name, or the number, that each name in the code stands for."""
        names: dict[str, str | sympy.Number] = {new: old for old, new in self.symbols.items()}
        return names | {f"c_{k}": number for k, number in enumerate(self._numbers, 1)}

    def _symbol(self, name: str) -> int:
        if name not in self.symbols:
            kind = "q" if name in self._coordinates else "p"
            self.symbols[name] = "t" if name == "t" else f"{kind}_{len(self.symbols) + 1}"
        return self.graph.input(self.symbols[name])

    def _attribute(self, value: sympy.Number) -> int:
        if abs(value) == 1:
            return super()._attribute(value)
        self._numbers.append(value)
        return self.graph.input(f"c_{len(self._numbers)}")

    def _ordered(self, value: sympy.Add | sympy.Mul) -> list[sympy.Expr]:
        return sorted(value.args, key=self._order)

    def _order(self, value: sympy.Basic) -> str:
        """Return the structure of a term, whatever the names and numbers, to sort it by."""
        if isinstance(value, sympy.Symbol):
            kind = "t" if value.name == "t" else "q" if value.name in self._coordinates else "p"
            return self.symbols.get(value.name, kind)  # one that occurred before is known by it
        if isinstance(value, sympy.Number):
            return "-1" if value is sympy.S.NegativeOne else "c"
        operands = [self._order(item) for item in value.args]
        if isinstance(value, _COMMUTATIVE):
            operands.sort()
        return f"{type(value).__name__}({','.join(operands)})"
