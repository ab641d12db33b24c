"""Formulas as LaTeX: SymPy's printer, with the textbook's notation mixed in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy.printing.latex import LatexPrinter

from kincompile.report.notation import GREEK
from kincompile.report.pieces import Breakable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.report.formulas import Formula, Glyph

OPERATORS = {
    "-": "-", "<=": r"\le", ">=": r"\ge", "==": "=", "!=": r"\ne", "|": r"\vert",
    "\N{LOGICAL AND}": r"\wedge", "\N{LOGICAL OR}": r"\vee",
    "\N{PARTIAL DIFFERENTIAL}": r"\partial", "\N{MULTIPLICATION SIGN}": r"\times",
    "\N{DOT OPERATOR}": r"\cdot",
}  # fmt: skip
FUNCTIONS = frozenset({"sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log"})
DOTS = ("", r"\dot", r"\ddot", r"\dddot")
SPECIAL = {
    "\\": r"\textbackslash{}", "_": r"\_", "&": r"\&", "%": r"\%", "#": r"\#", "$": r"\$",
    "{": r"\{", "}": r"\}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}",
    "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}",
    "\N{MINUS SIGN}": "$-$", "\N{MULTIPLICATION SIGN}": r"$\times$", "\N{EN DASH}": "--",
}  # fmt: skip


def escape(text: str) -> str:
    """Return plain text as LaTeX."""
    return "".join(SPECIAL.get(character, character) for character in text)


class TexPrinter(Breakable, LatexPrinter):
    """Prints formulas as LaTeX in mathematical mode; amsmath is all that it needs."""

    def __init__(
        self, abbreviations: Mapping[Any, Glyph] | None = None, *, is_breakable: bool = False
    ) -> None:
        self._space = r"\,\allowbreak" if is_breakable else r"\,"
        super().__init__({"mul_symbol": None})  # type: ignore[no-untyped-call]
        self.abbreviations = abbreviations or {}

    def math(self, formula: Formula) -> str:
        """Return a formula, without dollar signs."""
        return str(self._print(formula))

    def _row(self, parts: Sequence[str]) -> str:
        return " ".join(parts)

    def _letter(self, name: str, *, bold: bool = False) -> str:
        if name in GREEK:
            return rf"\boldsymbol{{\{name}}}" if bold else rf"\{name}"
        if bold:
            return rf"\mathbf{{{name}}}"
        return name if len(name) == 1 else rf"\mathrm{{{escape(name)}}}"

    def _index_text(self, index: str) -> str:
        return index if len(index) <= 2 or index.isdigit() else rf"\mathrm{{{escape(index)}}}"

    def _operator(self, text: str) -> str:
        if text.startswith("\N{PRIME}"):
            return r"\prime" * len(text)
        return OPERATORS.get(text, text)

    def _leading(self, text: str) -> str:
        return f"{{}} {self._operator(text)}"

    def _numeral(self, text: str) -> str:
        return text.replace("\N{MINUS SIGN}", "-")

    def _dotted(self, base: str, dots: int) -> str:
        return rf"{DOTS[dots]}{{{base}}}" if dots < len(DOTS) else rf"{base}^{{({dots})}}"

    def _tilded(self, base: str) -> str:
        return rf"\tilde{{{base}}}"

    def _scripts(self, base: str, index: str | None, exponent: str | None) -> str:
        below = "" if index is None else f"_{{{index}}}"
        above = "" if exponent is None else f"^{{{exponent}}}"
        return f"{{{base}}}{below}{above}" if below or above else base

    def _fenced_with(self, value: str, exponent: str) -> str:
        """Return something in brackets with an exponent, which is put on the bracket.

        What stands within the brackets can then be broken into lines.
        """
        return f"( {value} )^{{{exponent}}}"

    def _fraction(self, numerator: str, denominator: str) -> str:
        return rf"\frac{{{numerator}}}{{{denominator}}}"

    def _function(self, name: str) -> str:
        return rf"\{name}" if name in FUNCTIONS else rf"\operatorname{{{escape(name)}}}"

    def _root(self, value: str) -> str:
        return rf"\sqrt{{{value}}}"

    def _thin_space(self) -> str:
        return self._space

    def _array(self, rows: Sequence[Sequence[str]]) -> str:
        lines = r" \\ ".join(" & ".join(row) for row in rows)
        return rf"\begin{{bmatrix}} {lines} \end{{bmatrix}}"

    def _print_Integer(self, expr: Any) -> str:
        return str(expr)
