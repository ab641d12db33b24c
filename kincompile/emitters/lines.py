"""Text in lines of readable length: lists, tables, long expressions."""

from __future__ import annotations

import re
from textwrap import wrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

WIDTH = 96


def wrapped(items: Iterable[str], width: int = WIDTH - 4) -> list[str]:
    """Return items followed by commas, as many a line as fit."""
    lines: list[str] = []
    for item in items:
        if lines and len(lines[-1]) + len(item) + 2 <= width:
            lines[-1] += f" {item},"
        else:
            lines.append(f"{item},")
    return lines


def indented(lines: Iterable[str], level: int = 1) -> str:
    """Return lines as one text, each indented by a level or more."""
    return "\n".join(f"{'    ' * level}{line}".rstrip() for line in lines)


def braced(head: Iterable[str], body: Iterable[str]) -> list[str]:
    """Return a function: its first lines with the opening brace, and its statements."""
    return [*head, *indented(body).split("\n"), "}"]


def quoted(names: Iterable[str]) -> list[str]:
    """Return names in quotes, followed by commas, as many a line as fit."""
    return wrapped([f'"{name}"' for name in names])


def labelled(label: str, items: Iterable[str]) -> list[str]:
    """Return a label and items after it, continued below the first item."""
    lines = wrapped(items, WIDTH - 6)
    lines[-1] = lines[-1].rstrip(",")
    return [f"{label if k == 0 else '':<5} {line}" for k, line in enumerate(lines)]


def table(rows: Sequence[Sequence[str]], gap: int = 2) -> list[str]:
    """Return rows with their columns aligned, `gap` blanks apart."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        (" " * gap)
        .join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        .rstrip()
        for row in rows
    ]


def pieces(text: str, width: int = WIDTH - 8) -> list[str]:
    """Return a text in pieces that give it when they are joined."""
    lines = wrap(text, width, break_long_words=False, break_on_hyphens=False)
    return [f"{line} " for line in lines[:-1]] + lines[-1:]


def commented(text: str, width: int = WIDTH - 8) -> list[str]:
    """Return a text as comment lines, the later ones deeper."""
    if len(text) <= width:
        return [f"# {text}"]
    lines = wrap(text, width, subsequent_indent="     ", break_on_hyphens=False)
    return [f"# {line}" for line in lines]


def broken(text: str, width: int = WIDTH - 8, marks: str = "[+-]") -> list[str]:
    """Return a long expression in lines, broken before a plus or minus, or other marks.

    Those outside all parentheses come first, those within only where a line is still too long; such
    a line is indented by the parentheses around it.
    """
    if len(text) <= width:
        return [text]
    spans, depths = [(0, len(text))], {0: 0}
    for depth, breaks in sorted(_breaks(text, marks).items()):
        spans = [part for span in spans for part in _parts(span, breaks, width)]
        depths |= dict.fromkeys(breaks, depth)
    return ["    " * depths[start] + text[start:stop].strip() for start, stop in spans]


def _breaks(text: str, marks: str) -> dict[int, list[int]]:
    """Return where marks stand, by the number of parentheses around them."""
    breaks: dict[int, list[int]] = {}
    depth = 0
    for found in re.finditer(rf"[()\[\]]|(?<= )(?:{marks})(?= )", text):
        if found[0] in "()[]":
            depth += 1 if found[0] in "([" else -1
        else:
            breaks.setdefault(depth, []).append(found.start())
    return breaks


def _parts(span: tuple[int, int], breaks: Iterable[int], width: int) -> list[tuple[int, int]]:
    """Return a span of text cut into as few parts as fit, at some of the breaks."""
    first, last = span
    if last - first <= width:
        return [span]
    parts, start, previous = [], first, first
    for stop in (*(k for k in breaks if first < k < last), last):
        if stop - start > width and previous > start:
            parts.append((start, previous))
            start = previous
        previous = stop
    return [*parts, (start, last)]
