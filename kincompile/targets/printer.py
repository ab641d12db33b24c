"""Nodes as text of a language: one printer, and what languages write differently as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from kincompile.errors import UnsupportedError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.ir.graph import Constant, Node

SUM, PRODUCT, SIGN, POWER, ATOM = range(5)
"""Binding strengths, loosest first."""

ELEMENTARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh",
    "atanh", "exp", "log", "sqrt", "pow",
)  # fmt: skip
"""Names of the elementary functions that a program may call: those of C's math.h."""


class Operation(NamedTuple):
    """How an operation is written.

    Attributes
    ----------
    text
        Its text, with ``{}`` for each operand.
    operands
        How strongly each operand must bind to stand without parentheses.
    strength
        How strongly the whole binds.
    """

    text: str
    operands: tuple[int, ...]
    strength: int


ARITHMETIC = {
    "add": Operation("{} + {}", (SUM, PRODUCT), SUM),
    "sub": Operation("{} - {}", (SUM, PRODUCT), SUM),
    "mul": Operation("{} * {}", (PRODUCT, SIGN), PRODUCT),
    "div": Operation("{} / {}", (PRODUCT, POWER), PRODUCT),
    "neg": Operation("-{}", (PRODUCT,), PRODUCT),
}
"""What all languages write alike."""

SQUARE = Operation("square({})", (SUM,), ATOM)
"""A square as a function, where a language has no power or a slow one."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a language writes expressions.

    Attributes
    ----------
    language
        Its name, for messages.
    functions
        Text of each elementary function, with ``{}`` for the arguments.
    pi
        The number pi.
    square
        A square, of which it may be a power or a function.
    select
        Text of a choice: condition, value where it holds, value elsewhere.
    table
        Text of a tabulated function: name of the table, order of the derivative, argument; with
        ``{mechanism}`` for the mechanism's name.
    signs
        Relations and connectives that are not those of Python's arrays.
    number
        Text of a whole or a floating-point number that is not negative.
    """

    language: str
    functions: Mapping[str, str]
    pi: str = "pi"
    square: Operation = SQUARE
    select: str = "({} ? {} : {})"
    table: str = "spline({}, {}, {})"
    signs: Mapping[str, str] = field(default_factory=dict)
    number: Callable[[float], str] = repr


class Printer:
    """Prints nodes as expressions; a node with a name is printed as its name.

    Parameters
    ----------
    dialect
        The language.
    nodes
        The code.
    names
        Names of nodes, by number.
    mechanism
        Name of the mechanism, with which those of tables begin in some languages.
    """

    def __init__(
        self,
        dialect: Dialect,
        nodes: Sequence[Node],
        names: Mapping[int, str],
        mechanism: str = "",
    ) -> None:
        self._dialect = dialect
        self._nodes = nodes
        self._names = names
        self._mechanism = mechanism
        self._operations = {
            **ARITHMETIC,
            "square": dialect.square,
            "pi": Operation(dialect.pi, (), ATOM),
            "select": Operation(dialect.select, (SUM, SUM, SUM), ATOM),
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
            text, operands, strength = self._operations[kind]
            return text.format(*map(self._at, content, operands)), strength
        if kind == "const":
            return self._number(content[0])
        return self._primary(kind, content), ATOM

    def _primary(self, kind: str, content: list[Any]) -> str:
        """Return a node that consists of a word or a sign, and operands."""
        match kind, content:
            case "call", [name, *arguments]:
                return self._function(name).format(", ".join(map(self.text, arguments)))
            case "compare" | "logic", [sign, a, b]:
                sign = self._dialect.signs.get(sign, sign)
                return f"({self.text(a)} {sign} {self.text(b)})"
            case "table", [name, order, a]:
                table = self._dialect.table
                return table.format(name, order, self.text(a), mechanism=self._mechanism)
        raise TypeError(f"cannot print {(kind, *content)!r}")

    def _at(self, node: int, strength: int) -> str:
        """Return a node as an operand, in parentheses where it binds too loosely."""
        text, own = self._print(node)
        return text if own >= strength else f"({text})"

    def _number(self, value: Constant) -> tuple[str, int]:
        """Return a number that is not negative as text, and how strongly that binds."""
        number = self._dialect.number
        if isinstance(value, Fraction):
            return f"{number(value.numerator)} / {number(value.denominator)}", PRODUCT
        return number(value), ATOM

    def _function(self, name: str) -> str:
        """Return the text of an elementary function."""
        if name not in self._dialect.functions:
            raise UnsupportedError(
                f"the {self._dialect.language} target has no function {name!r}; use another "
                "target, or write the expression with other functions"
            )
        return self._dialect.functions[name]
