"""A comparison as a page: one HTML file without scripts, pictures or anything from a network."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from kincompile.compare.entries import Entry, Verdict
from kincompile.targets.templates import fill

if TYPE_CHECKING:
    from collections.abc import Sequence

TEMPLATE = "report/comparison.html.jinja"

_CLASSES = {
    Verdict.EQUAL: "equal",
    Verdict.CONVENTION: "convention",
    Verdict.MANIFOLD: "manifold",
    Verdict.DIFFERENT: "different",
}


def page(
    title: str,
    summary: str,
    verdict: Verdict,
    conventions: Sequence[str],
    entries: Sequence[Entry],
    reveal: bool,
) -> str:
    """Return a comparison as an HTML page.

    Parameters
    ----------
    title, summary, verdict
        What was compared, and how it came out.
    conventions
        Sentences.
    entries
        All entries, quantity by quantity, row by row.
    reveal
        Whether to show the right formulas and values.
    """
    quantities = dict.fromkeys(entry.quantity for entry in entries)
    data = {
        "title": escape(title),
        "summary": escape(summary),
        "verdict": verdict.value,
        "verdict_class": _CLASSES[verdict],
        "conventions": [escape(text) for text in conventions],
        "tables": [_table(entries, name) for name in quantities],
        "details": [_details(entry, reveal) for entry in entries if entry.difference],
        "legend": [(css, item.value) for item, css in _CLASSES.items()],
    }
    return fill(TEMPLATE, data)


def _anchor(entry: Entry) -> str:
    return escape(f"{entry.quantity}-{entry.row}-{entry.column or ''}", quote=True)


def _table(every: Sequence[Entry], quantity: str) -> dict[str, Any]:
    """Return a quantity as a table of cells, one row for each equation."""
    entries = [entry for entry in every if entry.quantity == quantity]
    columns = list(dict.fromkeys(entry.column for entry in entries))
    rows: dict[str, list[dict[str, str]]] = {}
    for entry in entries:
        rows.setdefault(entry.row, []).append(_cell(entry))
    return {
        "name": escape(quantity),
        "columns": [escape(column) for column in columns if column is not None],
        "rows": [{"name": escape(name), "cells": cells} for name, cells in rows.items()],
    }


def _cell(entry: Entry) -> dict[str, str]:
    return {
        "text": escape(entry.hand) or "&middot;",
        "css": _CLASSES[entry.verdict],
        "verdict": entry.verdict.value,
        "link": _anchor(entry) if entry.difference else "",
    }


def _details(entry: Entry, reveal: bool) -> dict[str, Any]:
    """Return what is said of an entry that is not right."""
    assert entry.difference is not None
    state = ", ".join(f"{name} = {value:.4g}" for name, value in entry.difference.state.items())
    values = f"yours {entry.difference.hand:.6g}"
    if reveal:
        values += f", right {entry.difference.generated:.6g}"
    return {
        "anchor": _anchor(entry),
        "label": escape(entry.label),
        "css": _CLASSES[entry.verdict],
        "verdict": entry.verdict.value,
        "hand": escape(entry.hand),
        "right": escape(entry.generated) if reveal else "",
        "diagnoses": [
            {"text": escape(item.text), "detail": escape(item.detail) if reveal else ""}
            for item in entry.diagnoses
        ],
        "values": escape(values),
        "state": escape(state),
    }
