"""A picture as SVG: an element of a page, or an image of its own."""

from __future__ import annotations

from base64 import b64encode
from typing import TYPE_CHECKING

from kincompile.report.mathml import index_text, letter_text
from kincompile.report.notation import has_prime, split_name
from kincompile.report.picture import INDEX, SYMBOL, svg_element
from kincompile.report.svg import element

if TYPE_CHECKING:
    from kincompile.report.picture import Picture, PictureLabel

FONT = "'Kincompile Math','Latin Modern Math','STIX Two Math','Cambria Math',serif"
"""Fonts of labels; the first is that of the page."""


def as_svg(picture: Picture) -> str:
    """Return a picture with its labels as an `svg` element of a page."""
    return svg_element(picture, "".join(_label(item, picture.height) for item in picture.labels))


def standalone_svg(picture: Picture) -> str:
    """Return a picture with its labels as the text of an image."""
    return as_svg(picture).replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"', 1)


def svg_address(picture: Picture) -> str:
    """Return a picture as the address of an image, which holds it."""
    svg = standalone_svg(picture)
    return f"data:image/svg+xml;base64,{b64encode(svg.encode()).decode()}"


def _label(label: PictureLabel, height: float) -> str:
    letter, index, _ = split_name(label.name)
    prime = "\N{PRIME}" if not label.is_vector or has_prime(letter, index) else ""
    text = letter_text(letter, bold=label.is_vector)
    if index:
        text += element("tspan", index_text(index), dy=4, font_size=f"{INDEX * SYMBOL:g}")
    if prime and label.name not in ("x", "y", "z"):  # of the ground
        text += element("tspan", prime, dy=-4 if index else 0)
    return element(
        "text", text, x=f"{label.x:.1f}", y=f"{height - label.y + SYMBOL / 3:.1f}",
        font_size=SYMBOL, font_family=FONT, text_anchor="middle", fill=label.colour,
        paint_order="stroke", stroke="#fff", stroke_opacity=".7", stroke_width=3,
    )  # fmt: skip
