"""Plots of the tables in benchmarks/README.md."""

from __future__ import annotations

import re

from matplotlib.figure import Figure

from docs.builders.pictures import svg_text
from docs.builders.places import ROOT

TABLE = re.compile(
    r"^#### (?P<title>\w+), \d+ points.*?\n\n\| contender \|.*?\n\|[ -|]*\n(?P<rows>(?:\|.*\n)+)",
    re.MULTILINE,
)
"""A table of whole analyses: contenders, their median, the ratio to plain C."""

OURS, OTHERS = "#2563eb", "#9aa5b4"


def tables() -> dict[str, list[tuple[str, float]]]:
    """Return contenders and their milliseconds, by the mechanism of the table."""
    text = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    return {
        match["title"]: [
            (name.strip(), float(figure))
            for name, figure in re.findall(r"^\| (.*?) \| ([\d.e+]+)", match["rows"], re.MULTILINE)
        ]
        for match in TABLE.finditer(text)
    }


def plots() -> dict[str, str]:
    """Return a bar chart of each table by the name of its file."""
    return {f"benchmark_{title}.svg": _bars(rows) for title, rows in tables().items()}


def with_plots(text: str) -> str:
    """Return the page with a plot below the heading of each table."""
    for title in tables():
        text = re.sub(
            rf"^(#### {title}, .*)$",
            rf"\1\n\n![Milliseconds of each contender](benchmark_{title}.svg)",
            text,
            flags=re.MULTILINE,
        )
    return text


def _bars(rows: list[tuple[str, float]]) -> str:
    """Return the bars of a table, the fastest on top, over a logarithmic axis."""
    figure = Figure(figsize=(8, 0.34 * len(rows) + 0.8), layout="constrained")
    ax = figure.subplots()
    names = [name.strip("*") for name, _ in rows]
    colours = [OURS if "kincompile" in name else OTHERS for name, _ in rows]
    bars = ax.barh(names, [figure for _, figure in rows], color=colours, log=True)
    ax.bar_label(bars, fmt="%.3g", padding=3)
    ax.invert_yaxis()
    ax.set_xlabel("ms for 10,000 points (logarithmic)")
    ax.spines[["top", "right"]].set_visible(False)
    ax.margins(x=0.12)
    return svg_text(figure)
