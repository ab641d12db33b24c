"""A comparison as plain text, as a table in colours, as a page and as Gradescope's results."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from kincompile.compare.comparison import Verdict
from kincompile.tables import indented, table
from kincompile.targets.templates import fill, read

if TYPE_CHECKING:
    from rich.console import Group

    from kincompile.compare.comparison import ComparedEntry, Comparison

COLOURS = {
    Verdict.EQUAL: "green",
    Verdict.CONVENTION: "cyan",
    Verdict.MANIFOLD: "yellow",
    Verdict.DIFFERENT: "bold red",
}


def as_text(found: Comparison, reveal: bool) -> str:
    """Return a comparison as plain text."""
    header = ["", *(verdict.value for verdict in Verdict)]
    rows = [[name, *map(str, numbers)] for name, numbers in found.counts()]
    lines = [found.title, "", *indented(table(header, rows, header[1:]))]
    if found.conventions:
        lines += ["", "Conventions", *indented([item.text for item in found.conventions])]
    for entry in found.entries:
        if explanation := entry.explanation(reveal):
            lines += ["", *explanation]
    return "\n".join([*lines, "", _closing(found)]) + "\n"


def as_coloured_table(found: Comparison, reveal: bool) -> Group:
    """Return a comparison for `rich` to print."""
    # rich takes a tenth of a second to import, and a pipe has no colours.
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    counts = Table(title=found.title, title_justify="left")
    counts.add_column("")
    for verdict in Verdict:
        counts.add_column(verdict.value, justify="right", style=COLOURS[verdict])
    for name, numbers in found.counts():
        counts.add_row(name, *(str(number) if number else "" for number in numbers))
    details = Table("entry", "verdict", "why", show_lines=True)
    for entry in found.entries:
        if explanation := entry.explanation(reveal):
            shown = Text(entry.verdict.value, style=COLOURS[entry.verdict])
            why = Text("\n".join(line.strip() for line in explanation[1:]))
            details.add_row(Text(entry.label), shown, why)
    return Group(
        counts,
        *(Text(item.text, style=COLOURS[Verdict.CONVENTION]) for item in found.conventions),
        *([details] if details.row_count else []),
        Text(_closing(found), style=COLOURS[found.verdict]),
    )


def _closing(found: Comparison) -> str:
    return f"Verdict: {found.verdict.value}."


def as_page(found: Comparison, reveal: bool) -> str:
    """Return a comparison as one HTML file without scripts, pictures or anything from a network."""
    rows = {name: found.rows(name) for name in found.quantities}
    columns = {
        name: dict.fromkeys(e.column for e in found.entries if e.quantity == name and e.column)
        for name in rows
    }
    details = [(entry, _at_a_state(entry, reveal)) for entry in found.entries if entry.difference]
    return fill(
        "report/comparison.html.jinja",
        {
            "found": found, "verdicts": list(Verdict), "rows": rows, "columns": columns,
            "details": details, "reveal": reveal, "style": read("report/comparison.css").rstrip(),
        },
    )  # fmt: skip


def _at_a_state(entry: ComparedEntry, reveal: bool) -> str:
    """Return the values of an entry at the state where it differs most."""
    assert entry.difference is not None
    values = f"yours {entry.difference.hand:.6g}"
    if reveal:
        values += f", right {entry.difference.generated:.6g}"
    state = ", ".join(f"{name} = {value:.4g}" for name, value in entry.difference.state.items())
    return f"For instance {values}, at {state}"


def as_gradescope(found: Comparison, reveal: bool) -> str:
    """Return a comparison as ``results.json``: one test for each row."""
    tests = [
        _test(f"{quantity}, {row}", entries, reveal)
        for quantity in found.quantities
        for row, entries in found.rows(quantity).items()
    ]
    output = "\n".join([found.summary, *(item.text for item in found.conventions)])
    return as_json({"output": output, "visibility": "visible", "tests": tests})


def _test(name: str, entries: list[ComparedEntry], reveal: bool) -> dict[str, Any]:
    """Return the test of one row: a point where all entries are accepted."""
    is_wrong = not all(entry.accepted for entry in entries)
    lines = [line for entry in entries for line in entry.explanation(reveal)]
    return {
        "name": name,
        "score": 0 if is_wrong else 1,
        "max_score": 1,
        "status": "failed" if is_wrong else "passed",
        "output": "\n".join(lines) or "right",
        "visibility": "visible",
    }


def as_json(data: dict[str, Any]) -> str:
    """Return plain data as JSON."""
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
