"""Figures of matplotlib as HTML, for a notebook; without matplotlib there are none."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

RESOLUTION = 100
"""Of images [dots per inch]."""


def figure_html(title: str, size: tuple[float, float], draw: Callable[[Figure], object]) -> str:
    """Return a figure as an image element that carries its own bytes.

    Parameters
    ----------
    title
        What the image shows, for those who cannot see it.
    size
        Width and height [inch].
    draw
        Draws into the empty figure, of which pyplot does not know.

    Returns
    -------
    str
        HTML; "" where matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return ""
    figure = Figure(figsize=size, layout="constrained", dpi=RESOLUTION)
    draw(figure)
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    data = b64encode(buffer.getvalue()).decode("ascii")
    return f'<p><img alt="{escape(title)}" src="data:image/png;base64,{data}"/></p>'
