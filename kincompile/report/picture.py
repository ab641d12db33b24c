"""A still picture as data, paths and labels, and its SVG. LaTeX reads the same paths."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

DASHES = {"--": "5 4", ":": "1.5 3"}
"""Lengths of dashes and gaps, in widths of a line."""

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
    width, height = round(picture.width), round(picture.height)
    paths = "".join(svg_path(item, picture.height) for item in picture.paths)
    return (
        f'<svg class="figure" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" aria-label="{escape(picture.title)}" '
        f'stroke-linecap="round" stroke-linejoin="round"><title>{escape(picture.title)}</title>'
        f"{paths}{labels}</svg>"
    )


def svg_path(path: PicturePath, height: float) -> str:
    """Return the element of a path in a picture of a height."""
    points = "L".join(f"{x:.1f} {height - y:.1f}" for x, y in np.asarray(path.points).tolist())
    style = f'fill="{path.fill or "none"}"'
    if path.is_pale:
        style += f' fill-opacity="{FILL}"'
    if path.stroke and path.width:
        style += f' stroke="{path.stroke}" stroke-width="{path.width}"'
    if path.opacity != 1:
        style += f' opacity="{path.opacity:.3g}"'
    if path.dash:
        style += f' stroke-dasharray="{DASHES[path.dash]}"'
    return f'<path d="M{points}{"Z" if path.fill else ""}" {style}/>'
