"""A picture as an `svg` element of a page."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from kincompile.view.shapes import FILL

if TYPE_CHECKING:
    from kincompile.view.picture import Picture, PicturePath

DASHES = {"--": "5 4", ":": "1.5 3"}


def svg_element(picture: Picture, labels: str = "") -> str:
    """Return a picture as an element, with labels over it."""
    width, height = round(picture.width), round(picture.height)
    paths = "".join(_path(item, picture.height) for item in picture.paths)
    return (
        f'<svg class="figure" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" aria-label="{escape(picture.title)}" '
        f'stroke-linecap="round" stroke-linejoin="round"><title>{escape(picture.title)}</title>'
        f"{paths}{labels}</svg>"
    )


def _path(path: PicturePath, height: float) -> str:
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
