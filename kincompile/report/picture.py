"""A still picture as data, paths and labels, and its SVG. LaTeX reads the same paths."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from kincompile.report.svg import ROUND, element, outline

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

DASHES = {"--": "5 4", ":": "1.5 3"}
"""Lengths of dashes and gaps, in widths of a line."""

SYMBOL, INDEX = 15, 0.7
"""Height of labels [points], and that of their index in parts of it."""

FILL = 0.22
"""Opacity of the pale areas, those of bodies."""


@dataclass(frozen=True, slots=True, eq=False)
class PicturePath:
    """A line or an area on the picture."""

    points: Array  # corners [points], y upwards
    # stroke, fill: colours; "" for none.
    stroke: str
    fill: str
    width: float  # of the line
    opacity: float = 1.0  # of the whole; the area of a body is paler by `FILL`
    is_pale: bool = False  # whether the area has the pale colour of its line
    dash: str = ""  # "--", ":" or "" for an unbroken line


@dataclass(frozen=True, slots=True)
class PictureLabel:
    """A symbol by its name, such as `s_i`, centred at a point."""

    x: float
    y: float
    name: str
    colour: str
    is_vector: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """Paths and labels, from back to front, in a frame of some width and height [points]."""

    title: str
    width: float
    height: float
    paths: tuple[PicturePath, ...]
    labels: tuple[PictureLabel, ...]


def svg_element(picture: Picture, labels: str = "") -> str:
    """Return a picture as an `svg` element of a page, with labels over it."""
    width, height, title = round(picture.width), round(picture.height), escape(picture.title)
    paths = "".join(svg_path(item, picture.height) for item in picture.paths)
    return element(
        "svg", f"<title>{title}</title>{paths}{labels}", class_="figure",
        viewBox=f"0 0 {width} {height}", width=width, height=height, role="img", aria_label=title,
        **ROUND,
    )  # fmt: skip


def svg_path(path: PicturePath, height: float) -> str:
    """Return the element of a path in a picture of a height."""
    is_drawn = bool(path.stroke and path.width)

    def pair(point: Iterable[float]) -> str:
        x, y = point
        return f"{x:.1f} {height - y:.1f}"

    return element(
        "path",
        d=outline(np.asarray(path.points).tolist(), bool(path.fill), pair),
        fill=path.fill or "none",
        fill_opacity=FILL if path.is_pale else "",
        stroke=path.stroke if is_drawn else "",
        stroke_width=path.width if is_drawn else "",
        opacity=f"{path.opacity:.3g}" if path.opacity != 1 else "",
        stroke_dasharray=DASHES[path.dash] if path.dash else "",
    )
