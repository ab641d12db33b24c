"""A comparison on the terminal: a table in colours, and the same without them for a pipe."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.compare.entries import SEVERITY, Entry, Verdict, told
from kincompile.tables import indented, table

if TYPE_CHECKING:
    from collections.abc import Sequence

COLOURS = {
    Verdict.EQUAL: "green",
    Verdict.CONVENTION: "cyan",
    Verdict.MANIFOLD: "yellow",
    Verdict.DIFFERENT: "bold red",
}


def plain(title: str, conventions: Sequence[str], entries: Sequence[Entry], *, reveal: bool) -> str:
    """Return a comparison as plain text.

    Parameters
    ----------
    title
        What was compared.
    conventions
        Sentences.
    entries
        All entries.
    reveal
        Whether to show the right formulas.
    """
    header = ["", *(verdict.value for verdict in Verdict)]
    rows = [[name, *map(str, numbers)] for name, numbers in _counts(entries)]
    lines = [title, "", *indented(table(header, rows, header[1:]))]
    if conventions:
        lines += ["", "Conventions", *indented(conventions)]
    for _, about in _told(entries, reveal):
        lines += ["", *about]
    return "\n".join([*lines, "", _closing(entries)]) + "\n"


def coloured(
    title: str, conventions: Sequence[str], entries: Sequence[Entry], *, reveal: bool
) -> Any:
    """Return a comparison for `rich` to print, with the arguments of `plain`."""
    # rich takes a tenth of a second to import, and a pipe has no colours.
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    counts = Table(title=title, title_justify="left")
    counts.add_column("")
    for verdict in Verdict:
        counts.add_column(verdict.value, justify="right", style=COLOURS[verdict])
    for name, numbers in _counts(entries):
        counts.add_row(name, *(str(number) if number else "" for number in numbers))
    parts: list[Any] = [counts]
    parts += [Text(text, style=COLOURS[Verdict.CONVENTION]) for text in conventions]
    if found := _told(entries, reveal):
        parts.append(_details(found))
    parts.append(Text(_closing(entries), style=COLOURS[_worst(entries)]))
    return Group(*parts)


def _counts(entries: Sequence[Entry]) -> list[tuple[str, list[int]]]:
    """Return for every quantity how many entries have which verdict."""
    return [
        (name, [sum(e.quantity == name and e.verdict is v for e in entries) for v in Verdict])
        for name in dict.fromkeys(entry.quantity for entry in entries)
    ]


def _told(entries: Sequence[Entry], reveal: bool) -> list[tuple[Entry, list[str]]]:
    return [(entry, lines) for entry in entries if (lines := told(entry, reveal))]


def _worst(entries: Sequence[Entry]) -> Verdict:
    return max((entry.verdict for entry in entries), key=SEVERITY.index)


def _closing(entries: Sequence[Entry]) -> str:
    return f"Verdict: {_worst(entries).value}."


def _details(found: list[tuple[Entry, list[str]]]) -> Any:
    from rich.table import Table
    from rich.text import Text

    details = Table("entry", "verdict", "why", show_lines=True)
    for entry, lines in found:
        style = COLOURS[entry.verdict]
        why = Text("\n".join(line.strip() for line in lines[1:]))
        details.add_row(Text(entry.label), Text(entry.verdict.value, style=style), why)
    return details
