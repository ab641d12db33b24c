"""A picture as SVG: an element of a page, or an image of its own."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from kincompile.derivation.mathml import index_text, letter_text
from kincompile.derivation.notation import BODY_FIXED, split_name
from kincompile.view.shapes import FILL
from kincompile.view.svg import DASHES

if TYPE_CHECKING:
    from kincompile.view.picture import Picture, PictureLabel, PicturePath

FONT = "'Kincompile Math','Latin Modern Math','STIX Two Math','Cambria Math',serif"
"""Fonts of labels; the first is that of the page."""

SIZE = 15
"""Height of labels [points]."""


def as_svg(picture: Picture) -> str:
    """Return a picture as an `svg` element of a page."""
    width, height = round(picture.width), round(picture.height)
    paths = "".join(_path(item, picture.height) for item in picture.paths)
    labels = "".join(_label(item, picture.height) for item in picture.labels)
    return (
        f'<svg class="figure" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" aria-label="{escape(picture.title)}" '
        f'stroke-linecap="round" stroke-linejoin="round"><title>{escape(picture.title)}</title>'
        f"{paths}{labels}</svg>"
    )


def svg_address(picture: Picture) -> str:
    """Return a picture as the address of an image, which holds it."""
    svg = as_svg(picture).replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"', 1)
    return f"data:image/svg+xml;base64,{b64encode(svg.encode()).decode()}"


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


def _label(label: PictureLabel, height: float) -> str:
    """Return a symbol with its index, and with the prime of what is given in a body's frame."""
    letter, index, _ = split_name(label.name)
    prime = "\N{PRIME}" if not label.is_vector or letter in BODY_FIXED else ""
    below = f'<tspan dy="4" font-size="{0.7 * SIZE:g}">{index_text(index)}</tspan>' if index else ""
    above = f'<tspan dy="{-4 if index else 0}">{prime}</tspan>' if prime else ""
    if label.name in ("x", "y"):  # of the ground
        above = ""
    text = letter_text(letter, bold=label.is_vector)
    return (
        f'<text x="{label.x:.1f}" y="{height - label.y + SIZE / 3:.1f}" font-size="{SIZE}" '
        f'font-family="{FONT}" text-anchor="middle" fill="{label.colour}" '
        f'paint-order="stroke" stroke="#fff" stroke-opacity=".7" stroke-width="3">'
        f"{text}{below}{above}</text>"
    )
