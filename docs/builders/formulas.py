"""Formulas of the site and of the course: LaTeX as MathML, which browsers draw without a script."""

from __future__ import annotations

import re

from latex2mathml.converter import convert

SPACE = '<mspace width="0.17em"/>'
FUNCTION = re.compile(
    r"(</m\w+>)?(<mi>(?:sin|cos|atan2|rank)</mi>)(?=(<m(?:i|n|sub|over|frac)\b)?)"
)
"""A function, the end of what it is multiplied by, and the beginning of an argument."""


def as_mathml(text: str, display: str = "inline") -> str:
    """Return a formula as the derivations set theirs, with what latex2mathml leaves to the reader.

    That are the phi of the book, accents close to their letters, no space after a sign, and one
    around the name of a function.
    """
    found = convert(text.strip(), display=display).replace("\n", " ")
    found = found.replace("&#x003D5;", "&#x003C6;").replace("<mover>", '<mover accent="true">')
    sign = r"(<mo[^>]*>&#x0002(?:8|C);</mo>)<mo>&#x02212;</mo>"
    return FUNCTION.sub(_spaced, re.sub(sign, r'\1<mo form="prefix">&#x02212;</mo>', found))


def _spaced(match: re.Match[str]) -> str:
    before, name, after = match.groups()
    is_factor = before and before != "</mo>"
    return f"{before or ''}{SPACE if is_factor else ''}{name}{SPACE if after else ''}"
