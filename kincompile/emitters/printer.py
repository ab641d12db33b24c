"""Nodes as text of a language: one printer, and what languages write differently as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from kincompile.errors import UnsupportedError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.ir.graph import Node

SUM, PRODUCT, SIGN, POWER, ATOM = range(5)
"""Binding strengths, loosest first."""

ELEMENTARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh",
    "atanh", "exp", "log", "sqrt", "pow",
)  # fmt: skip
"""Names of the elementary functions that a program may call: those of C's math.h."""

Operation = tuple[str, tuple[int, ...], int]
"""Text with ``{}`` for each operand, the strength below which an operand needs parentheses, and the
strength of the whole."""

ARITHMETIC: Mapping[str, Operation] = {
    "add": ("{} + {}", (SUM, PRODUCT), SUM),
    "sub": ("{} - {}", (SUM, PRODUCT), SUM),
    "mul": ("{} * {}", (PRODUCT, SIGN), PRODUCT),
    "div": ("{} / {}", (PRODUCT, POWER), PRODUCT),
    "neg": ("-{}", (PRODUCT,), PRODUCT),
}
"""What all languages write alike."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a language writes expressions."""

    language: str  # its name, for messages
    functions: Mapping[str, str]  # text of each elementary function, with ``{}`` for the arguments
    # pi, nan, square: the number pi; not a number; a square, which is a power or a function
    pi: str = "pi"
    nan: str = "NaN"
    square: Operation = ("square({})", (SUM,), ATOM)
    # Text of a choice: condition, value where it holds, value elsewhere.
    select: str = "({} ? {} : {})"
    # Text of a tabulated function: name of the table, order of the derivative, argument; with
    # ``{mechanism}`` for the mechanism's name.
    table: str = "spline({}, {}, {})"
    # Relations and connectives that differ from those of NumPy.
    signs: Mapping[str, str] = field(default_factory=dict)
    # Text of a whole or a floating-point number that is not negative.
    number: Callable[[float], str] = repr


class Printer:
    """Prints nodes as expressions; a node with a name is printed as its name.

    In some languages the names of tables begin with that of the mechanism.
    """

    def __init__(
        self,
        dialect: Dialect,
        nodes: Sequence[Node],
        names: Mapping[int, str],
        mechanism: str = "",
    ) -> None:
        self._dialect, self._nodes, self._names = dialect, nodes, names
        self._mechanism = mechanism
        self._operations = {
            **ARITHMETIC,
            "square": dialect.square,
            "pi": (dialect.pi, (), ATOM),
            "nan": (dialect.nan, (), ATOM),
            "select": (dialect.select, (SUM, SUM, SUM), ATOM),
        }

    def text(self, node: int) -> str:
        """Return a node as text: its name if it has one."""
        return self._print(node)[0]

    def definition(self, node: int) -> str:
        """Return what a node with a name is."""
        return self._written_out(node)[0]

    def _print(self, node: int) -> tuple[str, int]:
        """Return a node as text, and how strongly that binds."""
        name = self._names.get(node)
        return self._written_out(node) if name is None else (name, ATOM)

    def _written_out(self, node: int) -> tuple[str, int]:
        """Return a node in terms of its operands, and how strongly that binds."""
        kind, *content = self._nodes[node]
        if kind in self._operations:
            text, strengths, strength = self._operations[kind]
            return text.format(*map(self._at, content, strengths)), strength
        if kind != "const":
            return self._primary(kind, content), ATOM
        value, number = content[0], self._dialect.number
        if isinstance(value, Fraction):
            return f"{number(value.numerator)} / {number(value.denominator)}", PRODUCT
        return number(value), ATOM

    def _at(self, node: int, strength: int) -> str:
        """Return a node as an operand, in parentheses where it binds too loosely."""
        text, own = self._print(node)
        return text if own >= strength else f"({text})"

    def _primary(self, kind: str, content: list[Any]) -> str:
        """Return a node that has a word or a sign beside its operands."""
        dialect = self._dialect
        match kind, content:
            case "call", [name, *arguments] if name in dialect.functions:
                return dialect.functions[name].format(", ".join(map(self.text, arguments)))
            case "compare" | "logic", [sign, a, b]:
                return f"({self.text(a)} {dialect.signs.get(sign, sign)} {self.text(b)})"
            case "table", [name, order, a]:
                return dialect.table.format(name, order, self.text(a), mechanism=self._mechanism)
            case "call", [name, *_]:
                raise UnsupportedError(
                    f"the {dialect.language} target has no function {name!r}; use another target, "
                    "or write the expression with other functions"
                )
        raise TypeError(f"cannot print {(kind, *content)!r}")
