"""Formulas as presentation MathML: SymPy's printer, with the textbook's notation mixed in."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.pretty.pretty_symbology import greek_unicode

from kincompile.report.pieces import Breakable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from xml.dom.minidom import Element

    from kincompile.report.formulas import Formula, Glyph

OPERATORS = {
    "-": "\N{MINUS SIGN}", "<=": "\N{LESS-THAN OR EQUAL TO}", ">=": "\N{GREATER-THAN OR EQUAL TO}",
    "==": "=", "!=": "\N{NOT EQUAL TO}",
}  # fmt: skip
VARTHETA = "\N{GREEK THETA SYMBOL}"
DOTS = ("", "\N{DOT ABOVE}", "\N{DIAERESIS}")


def _alphabet(latin: str, greek: str, capital_greek: str) -> dict[int, int]:
    ranges = (("A", "Z", latin, 0), ("a", "z", latin, 26), ("\u03b1", "\u03c9", greek, 0),
              ("\u0391", "\u03a9", capital_greek, 0))  # fmt: skip
    return {
        code: ord(to) + start + code - ord(first)
        for first, last, to, start in ranges
        if to
        for code in range(ord(first), ord(last) + 1)
    }


BOLD = _alphabet("\U0001d400", "\U0001d6c2", "\U0001d6a8") | {ord("0"): 0x1D7CE}
SLANTED = _alphabet("\U0001d434", "\U0001d6fc", "") | {
    ord("h"): ord("\N{PLANCK CONSTANT}"), ord(VARTHETA): 0x1D717,
}  # fmt: skip
"""Bold and slanted letters of Unicode; the page brings a font that has them."""


def letter_text(name: str, *, bold: bool) -> str:
    """Return a letter, a Greek one by its name, bold or slanted; a word is upright."""
    text = VARTHETA if name == "vartheta" else greek_unicode.get(name, name)
    if bold:
        return text.translate(BOLD)
    return text.translate(SLANTED) if len(text) == 1 else text


def index_text(index: str) -> str:
    """Return an index: one or two letters are slanted, a word is upright."""
    return index.translate(SLANTED) if len(index) <= 2 else index


class MathMLPrinter(Breakable, MathMLPresentationPrinter):
    """Prints formulas as the children of a `math` element.

    Letters are those of Unicode's mathematical alphabets, and brackets grow with what they hold:
    for devices without a mathematical font, a page has one (`templates/report/math.css`).
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

    def _row(self, parts: Sequence[Element]) -> Element:
        return parts[0] if len(parts) == 1 else self._element("mrow", *parts)

    def _letter(self, name: str, *, bold: bool = False) -> Element:
        return self._upright(letter_text(name, bold=bold))

    def _upright(self, text: str) -> Element:
        return self._element("mi", text, mathvariant="normal")

    def _index_text(self, index: str) -> Element:
        if index.isdigit():
            return self._numeral(index)
        return self._upright(index_text(index))

    def _operator(self, text: str) -> Element:
        text = OPERATORS.get(text, text)
        return self._element("mo", text)

    def _bracket(self, text: str) -> Element:
        return self._element("mo", text, stretchy="false")

    def _leading(self, text: str) -> Element:
        return self._element("mo", OPERATORS.get(text, text), form="infix")

    def _numeral(self, text: str) -> Element:
        return self._element("mn", text)

    def _dotted(self, base: Element, dots: int) -> Element:
        mark = DOTS[dots] if dots < len(DOTS) else f"({dots})"
        dot = self._element("mo", mark, stretchy="false")
        return self._element("mover", base, dot, accent="true")

    def _tilded(self, base: Element) -> Element:
        mark = self._element("mo", "~", stretchy="false")
        return self._element("mover", base, mark, accent="true")

    def _scripts(self, base: Element, index: Element | None, exponent: Element | None) -> Element:
        if index is not None and exponent is not None:
            return self._element("msubsup", base, index, exponent)
        if index is not None:
            return self._element("msub", base, index)
        return base if exponent is None else self._element("msup", base, exponent)

    def _fraction(self, numerator: Element, denominator: Element) -> Element:
        return self._element("mfrac", numerator, denominator)

    def _function(self, name: str) -> Element:
        space = self._element("mspace", width="0.17em")
        return self._element("mrow", self._upright(name), space)

    def _root(self, value: Element) -> Element:
        return self._element("msqrt", value)

    def _thin_space(self) -> Element:
        return self._element("mspace", width="0.14em")

    def _array(self, rows: Sequence[Sequence[Element]]) -> Element:
        lines = [self._element("mtr", *(self._element("mtd", x) for x in row)) for row in rows]
        left, right = (self._element("mo", text, stretchy="true") for text in "[]")
        return self._element("mrow", left, self._element("mtable", *lines), right)

    def _print_Integer(self, expr: Any) -> Element:
        minus = [self._operator("-")] if expr < 0 else []
        return self._row([*minus, self._numeral(str(abs(expr)))])

    def _print_Function(self, expr: Any) -> Element:
        return self._row([self._function(expr.func.__name__), self._listed(expr.args)])

    def _print_exp(self, expr: Any) -> Element:
        return self._scripts(self._print_Exp1(expr), None, self._print(expr.args[0]))

    def _print_Exp1(self, expr: Any) -> Element:
        del expr
        return self._upright("e")


def _xml(element: Element) -> str:
    """Return an element in ASCII; SymPy's own minus is a hyphen, which is too short."""
    text = element.toxml().replace("<mo>-</mo>", "<mo>\N{MINUS SIGN}</mo>")
    return text.encode("ascii", "xmlcharrefreplace").decode()
