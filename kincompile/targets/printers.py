"""Nodes as text of a target language."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

from kincompile.errors import UnsupportedError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.ir.graph import Constant, Node

SUM, PRODUCT, SIGN, POWER, ATOM = range(5)
"""Binding strengths, loosest first."""


class PythonPrinter:
    """Prints nodes as Python expressions; a node with a name is printed as its name."""

    powers: ClassVar[str] = "{0}**2"

    def __init__(self, nodes: Sequence[Node], names: Mapping[int, str]) -> None:
        self._nodes = nodes
        self._names = names

    def text(self, node: int, *, own: bool = False) -> str:
        """Return a node as text; with `own`, its definition although it has a name."""
        return self._print(node, own=own)[0]

    def _print(self, node: int, *, own: bool = False) -> tuple[str, int]:
        if node in self._names and not own:
            return self._names[node], ATOM
        match self._nodes[node]:
            case ("const", value):
                return self.number(value)
            case ("pi",):
                return "pi", ATOM
            case ("add", a, b):
                return f"{self._at(a, SUM)} + {self._at(b, PRODUCT)}", SUM
            case ("sub", a, b):
                return f"{self._at(a, SUM)} - {self._at(b, PRODUCT)}", SUM
            case ("mul", a, b):
                return f"{self._at(a, PRODUCT)} * {self._at(b, SIGN)}", PRODUCT
            case ("div", a, b):
                return f"{self._at(a, PRODUCT)} / {self._at(b, POWER)}", PRODUCT
            case ("neg", a):
                return f"-{self._at(a, PRODUCT)}", PRODUCT
            case ("square", a):
                return self.powers.format(self._at(a, ATOM)), POWER
            case ("call", name, *arguments):
                return f"{name}({', '.join(self.text(k) for k in arguments)})", ATOM
            case ("select", condition, a, b):
                return f"where({self.text(condition)}, {self.text(a)}, {self.text(b)})", ATOM
            case ("compare", relation, a, b):
                return f"({self.text(a)} {relation} {self.text(b)})", ATOM
            case ("logic", connective, a, b):
                return f"({self.text(a)} {connective} {self.text(b)})", ATOM
            case ("table", name, order, a):
                return f"spline({name}, {order}, {self.text(a)})", ATOM
        raise TypeError(f"cannot print {self._nodes[node]!r}")

    def _at(self, node: int, strength: int) -> str:
        """Return a node as an operand, in parentheses where it binds too loosely."""
        text, own = self._print(node)
        return text if own >= strength else f"({text})"

    def number(self, value: Constant) -> tuple[str, int]:
        """Return a non-negative number as text."""
        if isinstance(value, Fraction):
            return f"{value.numerator} / {value.denominator}", PRODUCT
        return repr(value), ATOM


class CPrinter(PythonPrinter):
    """Prints nodes as C expressions of doubles; `square` and others are the template's."""

    def _print(self, node: int, *, own: bool = False) -> tuple[str, int]:
        if node in self._names and not own:
            return self._names[node], ATOM
        match self._nodes[node]:
            case ("pi",):
                return "PI", ATOM
            case ("square", a):
                return f"square({self.text(a)})", ATOM
            case ("call", name, *arguments):
                return self._call(name, [self.text(k) for k in arguments]), ATOM
            case ("select", condition, a, b):
                return f"({self.text(condition)} ? {self.text(a)} : {self.text(b)})", ATOM
            case ("logic", connective, a, b):
                return f"({self.text(a)} {connective * 2} {self.text(b)})", ATOM
            case ("table", name, order, a):
                return f"spline(&{name}, {order}, {self.text(a)})", ATOM
        return super()._print(node, own=own)

    def _call(self, name: str, arguments: list[str]) -> str:
        """Return a call; cosine and sine say by `far` that an angle is out of their reach."""
        if name in C_ANGLE_FUNCTIONS:
            return f"{C_ANGLE_FUNCTIONS[name]}({', '.join(arguments)}, exact, &far)"
        if name not in C_FUNCTIONS:
            raise UnsupportedError(
                f"the C target has no function {name!r}; use the NumPy target, or write the "
                "expression with other functions"
            )
        return f"{name}({', '.join(arguments)})"

    def number(self, value: Constant) -> tuple[str, int]:
        """Return a non-negative number as text: a double, since C divides integers to integers."""
        if isinstance(value, Fraction):
            return f"{float(value.numerator)!r} / {float(value.denominator)!r}", PRODUCT
        return repr(float(value)), ATOM


class JavaScriptPrinter(PythonPrinter):
    """Prints nodes as JavaScript expressions; `square` and `spline` are the template's."""

    def _print(self, node: int, *, own: bool = False) -> tuple[str, int]:
        if node in self._names and not own:
            return self._names[node], ATOM
        match self._nodes[node]:
            case ("pi",):
                return "Math.PI", ATOM
            case ("square", a):
                return f"square({self.text(a)})", ATOM
            case ("call", name, *arguments):
                return self._call(name, ", ".join(self.text(k) for k in arguments)), ATOM
            case ("select", condition, a, b):
                return f"({self.text(condition)} ? {self.text(a)} : {self.text(b)})", ATOM
            case ("compare", "==" | "!=" as relation, a, b):
                return f"({self.text(a)} {relation}= {self.text(b)})", ATOM
            case ("logic", connective, a, b):
                return f"({self.text(a)} {connective * 2} {self.text(b)})", ATOM
        return super()._print(node, own=own)

    def _call(self, name: str, arguments: str) -> str:
        if name not in JAVASCRIPT_FUNCTIONS:
            raise UnsupportedError(
                f"the JavaScript target has no function {name!r}; use the NumPy target, or write "
                "the expression with other functions"
            )
        return f"Math.{name}({arguments})"


class OctavePrinter(PythonPrinter):
    """Prints nodes as Octave expressions; `either` and `in_reals` are the template's.

    Parameters
    ----------
    nodes, names
        As for `PythonPrinter`.
    mechanism
        Name of the mechanism, with which the functions of its tables begin.
    """

    powers = "{0}^2"

    def __init__(self, nodes: Sequence[Node], names: Mapping[int, str], mechanism: str) -> None:
        super().__init__(nodes, names)
        self._mechanism = mechanism

    def _print(self, node: int, *, own: bool = False) -> tuple[str, int]:
        if node in self._names and not own:
            return self._names[node], ATOM
        match self._nodes[node]:
            case ("call", name, *arguments):
                return self._call(name, ", ".join(self.text(k) for k in arguments)), ATOM
            case ("select", condition, a, b):
                return f"either({self.text(condition)}, {self.text(a)}, {self.text(b)})", ATOM
            case ("compare", "!=", a, b):
                return f"({self.text(a)} ~= {self.text(b)})", ATOM
            case ("logic", connective, a, b):
                return f"({self.text(a)} {connective * 2} {self.text(b)})", ATOM
            case ("table", name, order, a):
                return f"{self._mechanism}_{name}({order}, {self.text(a)})", ATOM
        return super()._print(node, own=own)

    def _call(self, name: str, arguments: str) -> str:
        """Return a call; outside the domain of a function there is no number, nor a complex one."""
        if name not in OCTAVE_FUNCTIONS:
            raise UnsupportedError(
                f"the Octave target has no function {name!r}; use the NumPy target, or write the "
                "expression with other functions"
            )
        call = f"{OCTAVE_FUNCTIONS[name]}({arguments})"
        return f"in_reals({call})" if name in OCTAVE_PARTIAL else call


OCTAVE_PARTIAL = frozenset({"asin", "acos", "acosh", "atanh", "log", "sqrt", "pow"})
"""Functions that are complex for some real numbers."""

OCTAVE_FUNCTIONS = {
    **{name: name for name in (
        "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh",
        "acosh", "atanh", "exp", "log", "sqrt",
    )},
    "pow": "power",
}  # fmt: skip
"""Octave's names of elementary functions."""

C_ANGLE_FUNCTIONS = {"cos": "cosine", "sin": "sine"}
"""Functions that the C target has of its own, so that compilers take several points at once."""

C_FUNCTIONS = frozenset({
    "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh",
    "exp", "log", "sqrt", "pow",
})  # fmt: skip
"""Functions of C's math.h."""

JAVASCRIPT_FUNCTIONS = C_FUNCTIONS | {"sin", "cos"}
"""Functions of JavaScript's Math, which has C's names."""
