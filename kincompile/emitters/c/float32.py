"""C text of doubles as C text of floats."""

from __future__ import annotations

import re

from kincompile.emitters.printer import ELEMENTARY
from kincompile.errors import UnsupportedError

FUNCTIONS = (*ELEMENTARY, "copysign", "fabs", "floor", "fmax", "fmin", "fmod")
"""Functions of math.h that have another name for floats."""
NAMES = tuple(f"{name}f" for name in FUNCTIONS)
"""These names."""

SMALLEST, LARGEST = 1.17549435e-38, 3.40282347e38
"""The numbers between which a float has all of its digits."""

TOKEN = re.compile(
    r'(?P<other>//[^\n]*|#include[^\n]*|"[^"\n]*")'
    r"|(?P<word>[A-Za-z_]\w*)"
    r"|(?P<number>(?:\d+\.\d*|\.\d+|\d+(?=e))(?:e[+-]?\d+)?)"
)


def in_float32(text: str) -> str:
    """Return a text of C with floats for doubles: types, numbers, functions of math.h.

    No number is of two types, so that nothing is computed with doubles on the way. A number that no
    float holds is refused.
    """
    return TOKEN.sub(_in_float32, text)


def _in_float32(found: re.Match[str]) -> str:
    text = found[0]
    if found["word"]:
        return "float" if text == "double" else f"{text}f" if text in FUNCTIONS else text
    if not found["number"]:
        return text
    value = float(text)
    if value != 0 and not SMALLEST <= value <= LARGEST:
        raise UnsupportedError(
            f"{text} is no number of float32, whose sizes go from 1.2e-38 to 3.4e38. "
            "Choose other units, or real='float64'."
        )
    return f"{text}f"
