"""SVG: elements with their attributes, texts, and lines through points."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

ROUND = {"stroke_linecap": "round", "stroke_linejoin": "round"}
"""Attributes of drawings, whose lines have round ends and corners."""


def element(tag: str, inside: str = "", **attributes: object) -> str:
    """Return an element with what is inside it; an attribute that is "" is left out.

    A name is written as in Python: ``stroke_width`` for ``stroke-width``, ``class_`` for ``class``.
    Inside and values come escaped, but for quotes; `label` escapes its text.
    """
    given = ""
    for name, value in attributes.items():
        if value != "":
            quoted = str(value).replace('"', "&quot;")
            given += f' {name.rstrip("_").replace("_", "-")}="{quoted}"'
    return f"<{tag}{given}>{inside}</{tag}>" if inside else f"<{tag}{given}/>"


def label(text: str, **attributes: object) -> str:
    """Return a text, which is escaped, as an element."""
    return element("text", escape(text), **attributes)


def outline(
    points: Iterable[Iterable[float]],
    is_closed: bool,
    pair: Callable[[Iterable[float]], str],
) -> str:
    """Return the data of a path through points, each written as a pair; NaN interrupts it."""
    pieces: list[str] = []
    is_down = False
    for point in points:
        if any(map(math.isnan, point)):
            is_down = False
            continue
        pieces.append(f"{'L' if is_down else 'M'}{pair(point)}")
        is_down = True
    return "".join(pieces) + "Z" * is_closed
