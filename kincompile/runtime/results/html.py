"""How an emitted module and a solution show themselves in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.html import table_html

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Compiled
    from kincompile.runtime.results.columns import MotionTable

MOST_ROWS = 30
"""Rows of a table that are shown; of more, the first ones."""


def module_html(code: Compiled) -> str:
    """Return an emitted module's sizes and coordinates as HTML."""
    header = ("column", "coordinate", "unit", "guess")
    rows: list[tuple[str, ...]] = [
        (str(k), name, code.units.get(name, ""), f"{guess:g}")
        for k, (name, guess) in enumerate(zip(code.coordinates, code.guess, strict=True))
    ]
    title = (
        f"emitted module, {len(code.coordinates)} coordinates, {len(code.equations)} equations, "
        f"{len(code.pattern)} entries of Phi_q, {len(code.parameters)} parameters"
    )
    return _first_rows(code.name, title, header, rows)


def solution_html(solution: MotionTable) -> str:
    """Return the first, last, smallest and largest value of each coordinate as HTML.

    Of variants, the smallest and the largest alone.
    """
    t = solution.t
    title = f"{t.size} points from t = {t[0]:g} to {t[-1]:g}. {solution.message}"
    ends = (0, -1) if solution.q.ndim == 2 else ()
    header = ("coordinate", "unit", *(f"t = {t[k]:g}" for k in ends), "smallest", "largest")
    rows: list[tuple[str, ...]] = []
    for name in solution.names:
        values = solution.column(name).values.ravel()
        numbers = (*values[list(ends)], *_extremes(values))
        rows.append((name, solution.units.get(name, ""), *(f"{x:.6g}" for x in numbers)))
    return _first_rows(solution.name, title, header, rows)


def _extremes(values: NDArray[np.float64]) -> tuple[np.float64 | float, np.float64 | float]:
    """Return the smallest and the largest finite value; NaN without any."""
    found = values[np.isfinite(values)]
    return (found.min(), found.max()) if found.size else (np.nan, np.nan)


def _first_rows(name: str, title: str, header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Return a table of the first rows, and how many there are besides."""
    rest = len(rows) - MOST_ROWS
    more = f"<p>and {rest} more</p>" if rest > 0 else ""
    return table_html(name, title, header, rows[:MOST_ROWS]) + more
