"""How an emitted module and a solution show themselves in a notebook."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from types import ModuleType

MOST_ROWS = 30
"""Rows of a table that are shown; of more, the first ones."""


def module_html(module: ModuleType) -> str:
    """Return an emitted module's sizes and coordinates as HTML."""
    header = ("column", "coordinate", "unit", "guess")
    rows = [
        (str(k), name, module.UNITS.get(name, ""), f"{guess:g}")
        for k, (name, guess) in enumerate(zip(module.COORDINATES, module.GUESS, strict=True))
    ]
    title = (
        f"emitted module, {module.N_COORDINATES} coordinates, {module.N_EQUATIONS} equations, "
        f"{len(module.PATTERN)} entries of Phi_q, {len(module.PARAMETERS)} parameters"
    )
    return table_html(module.NAME, title, header, rows)


def table_html(
    name: str, title: str, header: Iterable[str], rows: Sequence[tuple[str, ...]]
) -> str:
    """Return a name, a title and a table as HTML; all text is escaped."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>"
        for row in rows[:MOST_ROWS]
    )
    rest = len(rows) - MOST_ROWS
    more = f"<p>and {rest} more</p>" if rest > 0 else ""
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"
    return f"<p><b>{escape(name)}</b>: {escape(title)}</p>{table}"
