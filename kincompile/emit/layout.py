"""Text in lines of readable length: lists, tables, long expressions."""

from __future__ import annotations

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


def quoted(names: Iterable[str]) -> list[str]:
    """Return names in quotes, followed by commas, as many a line as fit."""
    return wrapped([f'"{name}"' for name in names])


def labelled(label: str, items: Iterable[str]) -> list[str]:
    """Return a label and items behind it, continued below the first item."""
    lines = wrapped(items, WIDTH - 6)
    lines[-1] = lines[-1].rstrip(",")
    return [f"{label if k == 0 else '':<5} {line}" for k, line in enumerate(lines)]


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows with their columns aligned."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def broken(text: str, width: int = WIDTH) -> list[str]:
    """Return a long expression in lines, broken before a plus or minus outside all parentheses."""
    if len(text) <= width:
        return [text]
    pieces, depth, start = [], 0, 0
    for k, character in enumerate(text):
        depth += character in "(["
        depth -= character in ")]"
        if depth == 0 and text[k : k + 3] in (" + ", " - "):
            pieces.append(text[start:k])
            start = k + 1
    pieces.append(text[start:])
    lines = [pieces[0]]
    for piece in pieces[1:]:
        if len(lines[-1]) + len(piece) + 1 <= width:
            lines[-1] += f" {piece}"
        else:
            lines.append(piece)
    return lines
