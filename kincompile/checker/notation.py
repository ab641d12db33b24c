r"""What people write instead of plain text: Greek letters, LaTeX, degree signs, complex numbers.

    \Phi_q = \begin{bmatrix} 1 & 0 & \frac{L}{2}\sin\phi_1 \\ 0 & 1 & -\cos\phi_1 \end{bmatrix}
    nu = [0, 0, 30°]

A text without a backslash and without other than ASCII characters stays as it is, so that
messages can name places in it.
"""

from __future__ import annotations

import re
import unicodedata
from keyword import iskeyword
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.files.formula_text import Source
from kincompile.files.safe_expressions import FUNCTIONS
from kincompile.files.text_places import TextPlace
from kincompile.model.expressions import NotAnExpressionError

if TYPE_CHECKING:
    from collections.abc import Collection

IMAGINARY = sympy.Symbol("imaginary unit")
"""Stands for the imaginary unit until the real part is taken; no name of a model has a blank."""

_SIGNS = str.maketrans({
    "\u2212": "-", "\u2013": "-", "\u00b7": "*", "\u00d7": "*", "\u22c5": "*", "\u00f7": "/",
    "\u00b2": "^2", "\u00b3": "^3", "\u2074": "^4",
})  # fmt: skip
_DEGREES = re.compile(r"(\d+\.?\d*|\.\d+)\s*(?:°|\^\{?\\circ\}?)")
_NAME = r"(?:[A-Za-z][A-Za-z0-9]*(?:_(?:\{\w+\}|\w+))?)"
_MATRIX = re.compile(r"\\(begin|end)\s*\{[a-zA-Z]*(?:matrix|array)\}(?:\{[lcr|]*\})?")
_DOT = re.compile(
    r"\\(d{1,2}ot)\s*(?:\{\s*(" + _NAME + r")\s*\}|([A-Za-z]+))\s*((?:_(?:\{\w+\}|\w+))?)"
)
_FRACTION = re.compile(r"\\[dt]?frac\s*")
_FUNCTION = r"(?:arc)?(?:sin|cos|tan)|sqrt|exp|ln|log"
_POWER = re.compile(rf"\\?\b({_FUNCTION})\s*\^\s*(?:\{{(\d+)\}}|(\d))\s*")
_BARE = re.compile(rf"(?<![A-Za-z])({_FUNCTION})\s*({_NAME})(?!\w|\()")
_FONTS = re.compile(r"\\(?:mathbf|mathrm|boldsymbol|bm|text|operatorname)\s*\{(\\?\w+)\}")
_NO_INK = re.compile(r"\\(?:left|right|big|Big|[,;:! ]|quad|displaystyle)(?![a-zA-Z])")
_ELEMENTWISE = re.compile(r"(?<=[\w)])\.(?=[/^]|\*(?!\*))")
"""The dot of MATLAB's operators: 0.5.*sin(phi).^2."""
_FACTORS = re.compile(r"(?<=[\w)])[ \t]+(?=[A-Za-z0-9(])|(?<=\))(?=[\w(])")
_TOKEN = re.compile(r"(?:\d+(?:[.,]\d*)?|\.\d+)(?:[eE][+-]?\d+(?!\w))?|[A-Za-z_]\w*|\*\*|\S")
_VALUE = re.compile(r"[\w.)]")
_COEFFICIENT = re.compile(r"\s*[-+]?\s*(\d+(?:[.,]\d+)?)\s*/\s*(\d+(?:[.,]\d+)?)")
_THOUSANDS = re.compile(r"[1-9]\d{0,2},\d{3}")
IN_DEGREES = ("sind", "cosd", "tand")
"""Functions of an angle in degrees, which no formula here has."""
MOST = 20_000
"""Characters of a text that is rewritten."""


def plain(text: str) -> str:
    """Return a text as one types it, in ASCII."""
    text = _ELEMENTWISE.sub("", re.sub(r"(?<![\w.])1[ij]\b", "I", text))
    if len(text) > MOST or (text.isascii() and "\\" not in text and "_{" not in text):
        return text
    text = _DEGREES.sub(r"(\1*pi/180)", text.translate(_SIGNS))
    text = _without_greek(text)
    return _without_latex(text) if "\\" in text or "{" in text else text


def explicit(text: str, place: TextPlace | None, names: Collection[str]) -> str:
    """Return one formula with its products written out, and its decimal commas as points.

    ``5.2sin(phi)``, ``4.5 phi_dot^2 Cos(phi)`` and ``2(x + y)(x - y)`` are products; ``a(b)`` stays
    as it is: a name that is no function is refused there. A fraction of two numbers and a blank at
    the beginning of a term are its coefficient, ``1/2 sin(phi)``; ``1/2sin(phi)`` is refused.

    Raises
    ------
    ExpressionError
        If a product or a comma can be read in two ways, or a function takes degrees.
    """
    if len(text) > MOST:
        return text
    source, before, end = Source(text, place or TextPlace()), "", 0
    parts: list[str] = []
    divided = [False]  # in each open bracket, whether a / stands in the term
    begins = [0]  # and where the term begins
    takes_two = [False]  # whether a comma separates arguments there
    for found in _TOKEN.finditer(text):
        token, at = found[0], found.start()
        if token[0].isdigit() and "," in token:
            token = _decimal(token, takes_two[-1], source, at)
        elif token.lower() in IN_DEGREES and token not in names:
            raise source.error(
                f"{token} takes degrees; angles are in radians here: write {token[:-1].lower()}", at
            )
        elif token not in names and token not in FUNCTIONS and token.lower() in FUNCTIONS:
            token = token.lower()
        gap = text[end:at]
        if _is_product(before, token, gap):
            if divided[-1]:
                _require_coefficient(text[begins[-1] : end], gap, source, at)
                divided[-1] = False
            gap = f"*{gap[1:]}"
        if token in "([":
            calls = before if before in FUNCTIONS or before == "Piecewise" else ""
            takes_two.append(before == "Piecewise" or (
                FUNCTIONS[calls][2] > 1 if calls else before[:1].isalpha() or takes_two[-1]
            ))  # fmt: skip
            divided.append(False)
            begins.append(found.end())
        elif token in ")]" and len(divided) > 1:
            takes_two.pop()
            divided.pop()
            begins.pop()
        elif token.endswith((*"+-,<>=",)) and before not in ("", "^", "**", "*", "/"):
            divided[-1], begins[-1] = False, found.end()
        elif token == "/":
            divided[-1] = True
        parts += [gap, token]
        before, end = token, found.end()
    return "".join([*parts, text[end:]])


def _require_coefficient(term: str, gap: str, source: Source, at: int) -> None:
    """Refuse a quotient before a factor, unless it is a fraction of numbers and a blank."""
    numbers = _COEFFICIENT.fullmatch(term)
    if numbers is None:
        raise source.error(
            "a quotient before a product without a sign can be read in two ways; write (a/b)*c or "
            "a/(b*c)",
            at,
        )
    if not gap:
        a, b = numbers.groups()
        raise source.error(
            f"{a}/{b} before a factor can be read as ({a}/{b})*c or {a}/({b}*c); write one of "
            f"these, or a blank after {a}/{b} for the first",
            at,
        )


def _is_product(before: str, token: str, gap: str) -> bool:
    """Return whether two parts of a formula that follow each other are factors."""
    if before in ("", ".") or not _VALUE.match(before[-1]) or iskeyword(before) or iskeyword(token):
        return False
    if before[0].isalpha() or before[0] == "_":
        # A name before a bracket is a call, and refused unless it is a function.
        return before not in FUNCTIONS and gap != "" and token[0].isalpha()
    if before == "0" and not gap and token[0] in "xXoObB":
        return False  # a number in another base, which is refused
    return token == "(" or token[0].isalpha()


def _decimal(token: str, takes_two: bool, source: Source, at: int) -> str:
    """Return a number with a comma as one with a point, where that is what it means."""
    if takes_two or token.endswith(","):
        return token
    if _THOUSANDS.fullmatch(token):
        whole, part = token.split(",")
        raise source.error(
            f"{token} can be read in two ways; write {whole}.{part} or {whole}{part}", at
        )
    return token.replace(",", ".")


def _without_greek(text: str) -> str:
    """Return a text with the names of Greek letters, and dots above letters as rates."""
    letters = []
    for letter in unicodedata.normalize("NFKD", text):
        name = unicodedata.name(letter, "")
        if name.startswith("GREEK"):
            word = name.split(" WITH ")[0].split()[-1]
            word = "phi" if name == "GREEK PHI SYMBOL" else word.lower()
            letters.append(word.capitalize() if "CAPITAL" in name else word)
        else:
            letters.append(letter)
    text = "".join(letters)
    for mark, ending in (("\u0307", "_dot"), ("\u0308", "_ddot")):
        text = re.sub(rf"([A-Za-z]+){mark}(_?\w*)", rf"\1\2{ending}", text)
    return text


def _without_latex(text: str) -> str:
    # In [1 \phi_1] a blank separates; elsewhere it is a product.
    has_products = "[" not in text or any(mark in text for mark in ("&", "\\left", "\\frac", ","))
    text = text.replace("\\\\", ";")
    text = re.sub(r"\\left\s*[\[(]\s*(?=\\begin)", "", text)
    text = re.sub(r"(\\end\{\w+\}\s*)\\right\s*[\])]", r"\1", text)
    text = _NO_INK.sub(" ", _FONTS.sub(r"\1", text))
    text = _MATRIX.sub(lambda found: "[" if found[1] == "begin" else "]", text)
    text = text.replace("&", ",").replace("\\cdot", "*").replace("\\times", "*")
    text = re.sub(r"\\(?!d{1,2}ot\b|[dt]?frac\b)([A-Za-z]+)", r"\1", text)
    text = re.sub(r"\bvar(phi|theta)", r"\1", text)
    text = _DOT.sub(lambda found: f"{found[2] or found[3]}{found[4]}_{found[1]}", text)
    # SymPy prints phi_crank_dot as \phi_{crank dot}.
    text = re.sub(r"_\{(\w+(?: \w+)*)\}", lambda found: f"_{found[1].replace(' ', '_')}", text)
    while found := _FRACTION.search(text):
        above, middle = _argument(text, found.end())
        below, end = _argument(text, middle)
        text = f"{text[: found.start()]}(({above})/({below})){text[end:]}"
    while found := _POWER.search(text):
        inner, end = _argument(text, found.end())
        power = found[2] or found[3]
        text = f"{text[: found.start()]}({found[1]}({inner}))^({power}){text[end:]}"
    text = text.replace("{", "(").replace("}", ")")
    text = _BARE.sub(r"\1(\2)", text)
    text = re.sub(r"(?<![\w.])(\d+\.?\d*)(?=[A-Za-z])", r"\1*", text)
    if not has_products:
        return text
    text = re.sub(rf"\b({_FUNCTION})\s+\(", r"\1(", text)
    return _FACTORS.sub("*", text)


def _argument(text: str, start: int) -> tuple[str, int]:
    """Return the argument that begins at an offset, without its brackets, and where it ends."""
    while start < len(text) and text[start].isspace():
        start += 1
    if start < len(text) and text[start] in "({":
        depth = 0
        for k in range(start, len(text)):
            depth += (text[k] in "({") - (text[k] in ")}")
            if depth == 0:
                return text[start + 1 : k], k + 1
    found = re.compile(rf"{_NAME}|\d+").match(text, start)
    end = found.end() if found else min(start + 1, len(text))
    return text[start:end], end


def real(expression: sympy.Expr) -> sympy.Expr:
    """Return an expression with an imaginary unit in it without one.

    Raises
    ------
    NotAnExpressionError
        If it is not real.
    """
    if IMAGINARY not in expression.free_symbols:
        return expression
    symbols = sorted(expression.free_symbols - {IMAGINARY}, key=str)
    reals = {symbol: sympy.Dummy(str(symbol), real=True) for symbol in symbols}
    whole = expression.xreplace({**reals, IMAGINARY: sympy.I})
    part, rest = whole.replace(_is_turn, _cosine_and_sine).as_real_imag()
    numbers = np.random.default_rng(1).uniform(0.4, 1.6, len(reals))
    at = dict(zip(reals.values(), map(sympy.Float, numbers), strict=True))
    size, off = (abs(complex(item.xreplace(at).evalf())) for item in (part, rest))
    if part.has(sympy.I) or not off <= 1e-9 * (1 + size):
        raise NotAnExpressionError(f"{expression} is not real")
    back = {other: symbol for symbol, other in reals.items()}
    found: sympy.Expr = part.xreplace(back)
    return found


def _is_turn(node: sympy.Basic) -> bool:
    return isinstance(node, sympy.exp) and node.has(sympy.I)


def _cosine_and_sine(turn: sympy.Expr) -> sympy.Expr:
    """Return exp(a + ib) as exp(a) (cos(b) + i sin(b)), of which conjugate terms cancel."""
    size, angle = turn.as_base_exp()[1].as_real_imag()
    found: sympy.Expr = sympy.exp(size) * (sympy.cos(angle) + sympy.I * sympy.sin(angle))
    return found
