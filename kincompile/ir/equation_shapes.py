"""Free equations of equal structure share one kernel.

The structure of an equation is what is left when its symbols are numbered in order of occurrence
and its numbers are taken for attributes: ``phi_a - 1.5*phi_b`` and ``phi_c - 2.5*phi_d`` both are
``q_1 + c_1*q_2``. Exponents and signs stay what they are, because they decide about the code.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.ir.from_sympy import FUNCTIONS, RECIPROCALS
from kincompile.ir.kernels import equation_kernel
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

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


class EquationShapes:
    """The kernels of free equations, one a structure.

    Parameters
    ----------
    coordinates
        Names of the coordinates; any other name but t is a parameter.
    """

    def __init__(self, coordinates: Collection[str]) -> None:
        self._coordinates = coordinates
        self._kernels: dict[Any, Kernel] = {}

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
        values: dict[str, str | sympy.Number] = {new: old for old, new in shape.symbols.items()}
        values |= {rate(new): rate(old) for new, old in columns.items()}
        values |= {f"c_{k}": number for k, number in enumerate(shape.numbers, 1)}
        return SharedEquation(self._kernels[trees], tuple(columns.values()), values)


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
