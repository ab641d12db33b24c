"""Plain text tables, the same on a terminal, in a pipe and in a file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import NOISE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[str] = ()
) -> list[str]:
    """Return the lines of a table whose columns are as wide as their widest cell.

    Parameters
    ----------
    header
        Titles of the columns.
    rows
        Cells as text, as many in each row as there are titles.
    right
        Titles of the columns that are aligned to the right: numbers.

    Returns
    -------
    list of str
        The titles and one line a row, two blanks between columns and none at the end.
    """
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    aligned = [
        (str.rjust if title in right else str.ljust, width)
        for title, width in zip(header, widths, strict=True)
    ]
    return [
        "  ".join(
            put(cell, width) for cell, (put, width) in zip(row, aligned, strict=True)
        ).rstrip()
        for row in (header, *rows)
    ]


def indented(lines: Sequence[str]) -> list[str]:
    """Return the lines two blanks further to the right."""
    return [f"  {line}" if line else line for line in lines]


def counted(number: int, what: str) -> str:
    """Return a number with its noun, in the plural where there is not exactly one."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def pose(q: Sequence[float]) -> str:
    """Return where a body is: x, y and its angle; in space x, y, z, an angle and its axis."""
    q = without_noise(q, max(map(abs, q))).tolist()
    if len(q) == 3:
        x, y, phi = q
        return f"at ({x:.4g}, {y:.4g}), angle {phi:.4g} rad"
    x, y, z, e0, *e = q
    size = math.hypot(*e)
    angle = 2 * math.atan2(size, e0)
    about = ", ".join(f"{item / (size or 1.0):.4g}" for item in e)
    return f"at ({x:.4g}, {y:.4g}, {z:.4g}), angle {angle:.4g} rad about ({about})"


def without_noise(values: ArrayLike, size: float) -> NDArray[np.float64]:
    """Return the values, with zero for those that are rounding errors beside a size."""
    return np.where(np.abs(values) <= NOISE * size, 0.0, values)
