"""Formulas as presentation MathML: SymPy's printer, with the textbook's notation mixed in."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.pretty.pretty_symbology import greek_unicode

from kincompile.derivation.notation import Notation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from xml.dom.minidom import Element

    from kincompile.derivation.formulas import Formula, Glyph

OPERATORS = {
    "-": "\N{MINUS SIGN}", "<=": "\N{LESS-THAN OR EQUAL TO}", ">=": "\N{GREATER-THAN OR EQUAL TO}",
    "==": "=", "!=": "\N{NOT EQUAL TO}",
}  # fmt: skip
VARTHETA = "\N{GREEK THETA SYMBOL}"
DOTS = ("", "\N{DOT ABOVE}", "\N{DIAERESIS}")


class MathMLPrinter(Notation, MathMLPresentationPrinter):
    """Prints formulas as the children of a `math` element.

    Letters are upright or slanted by style sheet (class "v" is a bold vector): not every device has
    the mathematical alphabets of Unicode in a font.
    """

    def __init__(self, abbreviations: Mapping[Any, Glyph] | None = None) -> None:
        super().__init__({"mul_symbol": "&InvisibleTimes;"})  # type: ignore[no-untyped-call]
        self.abbreviations = abbreviations or {}

    def math(self, formula: Formula) -> str:
        """Return a formula as a `math` element."""
        return f"<math>{_xml(self._print(formula))}</math>"

    def display(self, formula: Formula) -> str:
        """Return a formula as `math` elements, between which a line may be broken."""
        pieces = (_xml(piece) for piece in self.pieces(formula))
        return "<wbr>".join(f'<math displaystyle="true">{piece}</math>' for piece in pieces)

    def _element(self, tag: str, *children: Element | str, **attributes: str) -> Element:
        element = self.dom.createElement(tag)
        for name, value in attributes.items():
            element.setAttribute(name.rstrip("_"), value)
        for child in children:
            node = self.dom.createTextNode(escape(child)) if isinstance(child, str) else child
            element.appendChild(node)
        return element

    def row(self, parts: Sequence[Element]) -> Element:
        """Return things side by side."""
        return parts[0] if len(parts) == 1 else self._element("mrow", *parts)

    def letter(self, name: str, *, bold: bool = False) -> Element:
        """Return a letter, a Greek letter by its name, or a word."""
        text = VARTHETA if name == "vartheta" else greek_unicode.get(name, name)
        if bold:
            return self._element("mi", text, class_="v", mathvariant="normal")
        if len(text) > 1:
            return self._element("mi", text, class_="w", mathvariant="normal")
        return self._element("mi", text)

    def index_text(self, index: str) -> Element:
        """Return the text of an index."""
        if index.isdigit():
            return self.numeral(index)
        if len(index) == 1:
            return self._element("mi", index)
        kind = "u" if len(index) > 2 else "i"
        return self._element("mi", index, class_=kind, mathvariant="normal")

    def operator(self, text: str) -> Element:
        """Return an operator or a bracket."""
        text = OPERATORS.get(text, text)
        return self._element("mo", text)

    def leading(self, text: str) -> Element:
        """Return an operator at the beginning of a continued line, spaced as within one."""
        return self._element("mo", OPERATORS.get(text, text), form="infix")

    def numeral(self, text: str) -> Element:
        """Return a number."""
        return self._element("mn", text)

    def dotted(self, base: Element, dots: int) -> Element:
        """Return something with dots over it."""
        mark = DOTS[dots] if dots < len(DOTS) else f"({dots})"
        dot = self._element("mo", mark, stretchy="false")
        return self._element("mover", base, dot, accent="true")

    def scripts(self, base: Element, index: Element | None, exponent: Element | None) -> Element:
        """Return something with an index, an exponent, or both."""
        if index is not None and exponent is not None:
            return self._element("msubsup", base, index, exponent)
        if index is not None:
            return self._element("msub", base, index)
        return base if exponent is None else self._element("msup", base, exponent)

    def fraction(self, numerator: Element, denominator: Element) -> Element:
        """Return a fraction."""
        return self._element("mfrac", numerator, denominator)

    def function(self, name: str) -> Element:
        """Return the name of a function."""
        text = self._element("mi", name, class_="w", mathvariant="normal")
        space = self._element("mspace", width="0.17em")
        return self._element("mrow", text, space)

    def root(self, value: Element) -> Element:
        """Return a square root."""
        return self._element("msqrt", value)

    def thin_space(self) -> Element:
        """Return what stands between factors."""
        return self._element("mspace", width="0.14em")

    def array(self, rows: Sequence[Sequence[Element]]) -> Element:
        """Return a matrix in brackets, which are borders: they need no font that stretches."""
        lines = [self._element("mtr", *(self._element("mtd", x) for x in row)) for row in rows]
        return self._element("mtable", *lines, class_="m")

    def _print_Integer(self, expr: Any) -> Element:
        minus = [self.operator("-")] if expr < 0 else []
        return self.row([*minus, self.numeral(str(abs(expr)))])

    def _print_Function(self, expr: Any) -> Element:
        parts: list[Element] = []
        for k, item in enumerate(expr.args):
            parts += [self.operator(",")] if k else []
            parts.append(self._print(item))
        return self.row([self.function(expr.func.__name__), self._fenced(self.row(parts))])

    def _print_exp(self, expr: Any) -> Element:
        return self.scripts(self._print_Exp1(expr), None, self._print(expr.args[0]))

    def _print_Exp1(self, expr: Any) -> Element:
        del expr
        return self._element("mi", "e", class_="u", mathvariant="normal")

    def _print_PeriodicSpline(self, expr: Any) -> Element:
        name = self.letter(expr.table_name)
        primes = self.operator("\N{PRIME}" * expr.order) if expr.order else None
        return self.row([self.scripts(name, None, primes), self._fenced(self._print(expr.args[0]))])


def _xml(element: Element) -> str:
    """Return an element in ASCII; SymPy's own minus is a hyphen, which is too short."""
    text = element.toxml().replace("<mo>-</mo>", "<mo>\N{MINUS SIGN}</mo>")
    return text.encode("ascii", "xmlcharrefreplace").decode()
