r"""What people write instead of plain text: Greek letters, LaTeX, degree signs, complex numbers.

    \Phi_q = \begin{bmatrix} 1 & 0 & \frac{L}{2}\sin\phi_1 \\ 0 & 1 & -\cos\phi_1 \end{bmatrix}
    nu = [0, 0, 30°]

A text without a backslash and without other than ASCII characters stays as it is, so that
messages can name places in it.
"""

from __future__ import annotations

import re
import unicodedata

import numpy as np
import sympy

from kincompile.model.expressions import NotAnExpressionError

IMAGINARY = sympy.Symbol("imaginary unit")
"""Stands for the imaginary unit until the real part is taken; no name of a model has a blank."""

_SIGNS = str.maketrans({
    "\u2212": "-", "\u2013": "-", "\u00b7": "*", "\u00d7": "*", "\u22c5": "*", "\u00f7": "/",
    "\u00b2": "^2", "\u00b3": "^3", "\u2074": "^4",
})  # fmt: skip
_DEGREES = re.compile(r"(\d+\.?\d*|\.\d+)\s*(?:°|\^\{?\\circ\}?)")
_NAME = r"(?:[A-Za-z][A-Za-z0-9]*(?:_\{?\w+\}?)?)"
_MATRIX = re.compile(r"\\(begin|end)\s*\{[a-zA-Z]*(?:matrix|array)\}(?:\{[lcr|]*\})?")
_DOT = re.compile(r"\\(d{1,2}ot)\s*(?:\{\s*(" + _NAME + r")\s*\}|([A-Za-z]+))\s*((?:_\{?\w+\}?)?)")
_FRACTION = re.compile(r"\\[dt]?frac\s*")
_FUNCTION = r"(?:arc)?(?:sin|cos|tan)|sqrt|exp|ln|log"
_POWER = re.compile(rf"\\?\b({_FUNCTION})\s*\^\s*(?:\{{(\d+)\}}|(\d))\s*")
_BARE = re.compile(rf"(?<![A-Za-z])({_FUNCTION})\s*({_NAME})(?!\w|\()")
_FONTS = re.compile(r"\\(?:mathbf|mathrm|boldsymbol|bm|text|operatorname)\s*\{(\\?\w+)\}")
_NO_INK = re.compile(r"\\(?:left|right|big|Big|[,;:! ]|quad|displaystyle)(?![a-zA-Z])")
_FACTORS = re.compile(r"(?<=[\w)])[ \t]+(?=[A-Za-z0-9(])|(?<=\))(?=[\w(])")
MOST = 20_000
"""Characters of a text that is rewritten."""


def plain(text: str) -> str:
    """Return a text as one types it, in ASCII."""
    text = re.sub(r"(?<![\w.])1[ij]\b", "I", text)
    if len(text) > MOST or (text.isascii() and "\\" not in text):
        return text
    text = _DEGREES.sub(r"(\1*pi/180)", text.translate(_SIGNS))
    text = _without_greek(text)
    return _without_latex(text) if "\\" in text or "{" in text else text


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
    text = re.sub(r"_\{(\w+)\}", r"_\1", text)
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
