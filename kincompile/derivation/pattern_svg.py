"""The pattern of a sparse matrix as a picture with the names of its rows and columns."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kincompile.derivation.document import Pattern

CELL = 18
CHARACTER = 6.8
"""Width of a character of the labels, which are set in a monospaced font of 11 pixels."""


def pattern_svg(pattern: Pattern) -> str:
    """Return the picture; a filled square is an entry that can differ from zero, and a link."""
    left = 10 + CHARACTER * max(map(len, pattern.rows), default=0)
    top = 10 + CHARACTER * max(map(len, pattern.columns), default=0)
    width = left + CELL * len(pattern.columns) + 4
    height = top + CELL * len(pattern.rows) + 4
    parts = [
        f'<svg class="pattern" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" role="img" aria-label="Pattern of the Jacobian">',
        *_bands(pattern, left, top),
        *_labels(pattern, left, top),
        *_entries(pattern, left, top),
        "</svg>",
    ]
    return "".join(parts)


def _bands(pattern: Pattern, left: float, top: float) -> list[str]:
    length = CELL * len(pattern.columns)
    return [
        f'<rect class="band{k % 2}" x="{left:.0f}" y="{top + CELL * first:.0f}" '
        f'width="{length}" height="{CELL * count}"/>'
        for k, (first, count) in enumerate(pattern.bands)
    ]


def _labels(pattern: Pattern, left: float, top: float) -> list[str]:
    rows = [
        f'<text x="{left - 5:.0f}" y="{top + CELL * (k + 0.72):.1f}" text-anchor="end">'
        f"{escape(name)}</text>"
        for k, name in enumerate(pattern.rows)
    ]
    columns = [
        f'<text transform="translate({left + CELL * (k + 0.72):.1f} {top - 5:.0f}) rotate(-90)">'
        f"{escape(name)}</text>"
        for k, name in enumerate(pattern.columns)
    ]
    return rows + columns


def _entries(pattern: Pattern, left: float, top: float) -> list[str]:
    names = pattern.rows, pattern.columns
    return [
        f'<a href="#{escape(anchor)}"><rect class="entry" x="{left + CELL * column + 2:.0f}" '
        f'y="{top + CELL * row + 2:.0f}" width="{CELL - 4}" height="{CELL - 4}">'
        f"<title>{escape(names[0][row])} by {escape(names[1][column])}</title></rect></a>"
        for (row, column), anchor in pattern.entries.items()
    ]
