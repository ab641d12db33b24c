"""Pictures of the site on dark paper: those that have colours for light paper alone get others.

A Sphinx extension. Hue and strength of a colour stay, its lightness is turned round, so that paper
becomes dark and ink light; a browser takes them where the scheme of the site is dark.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sphinx.application import Sphinx

TO_CONES = np.array([
    (0.4122214708, 0.5363325363, 0.0514459929), (0.2119034982, 0.6806995451, 0.1073969566),
    (0.0883024619, 0.2817188376, 0.6299787005),
])  # fmt: skip
TO_OKLAB = np.array([
    (0.2104542553, 0.7936177850, -0.0040720468), (1.9779984951, -2.4285922050, 0.4505937099),
    (0.0259040371, 0.7827717662, -0.8086757660),
])  # fmt: skip
"""From linear sRGB to cones, and from their cube roots to OKLab (B. Ottosson, 2020)."""

SCHEME = "prefers-color-scheme"
COLOUR = re.compile(r"(fill|stroke)(=\"|: ?)(#[0-9a-fA-F]{6}|#[0-9a-fA-F]{3}\b)")
DARK_PAPER, LIGHT_INK = 0.21, 0.93
"""Lightness that white and ink (0.26) take."""

VIVID, READABLE = 0.08, 0.66
"""A stronger colour than this is of a line or of a name: it is at least so light."""


def setup(app: Sphinx) -> dict[str, bool]:
    """Change pictures when the site is made."""
    app.connect("build-finished", lambda app, _: darken(Path(app.outdir)))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def darken(site: Path) -> None:
    """Give the pictures of a site colours on dark paper."""
    for path in (site / "_images").glob("*.svg"):
        text = path.read_text(encoding="utf-8")
        if SCHEME not in text:
            path.write_text(with_dark_colours(text), encoding="utf-8")


def with_dark_colours(svg: str) -> str:
    """Return a picture with rules for dark paper, which select by the colours it is drawn in."""
    rules = {
        (kind, colour): f'[{kind}="{colour}"],[style*="{kind}: {colour}"]'
        f"{{{kind}:{on_dark_paper(colour)}!important}}"
        for kind, _, colour in COLOUR.findall(svg)
    }
    style = f"svg{{fill:{on_dark_paper('#1d2430')}}}{''.join(rules.values())}"
    return re.sub(
        r"(<svg\b[^>]*>)", rf"\1<style>@media({SCHEME}:dark){{{style}}}</style>", svg, count=1
    )


def on_dark_paper(colour: str) -> str:
    """Return a colour of the same hue, whose lightness is turned round."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    shown = np.array([int(digits[k : k + 2], 16) for k in (0, 2, 4)]) / 255
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    lab = TO_OKLAB @ np.cbrt(TO_CONES @ linear)
    lab[0] = DARK_PAPER + (1 - lab[0]) * (LIGHT_INK - DARK_PAPER) / (1 - 0.26)
    if np.hypot(lab[1], lab[2]) > VIVID:
        lab[0] = max(lab[0], READABLE)
    found = np.linalg.solve(TO_CONES, np.linalg.solve(TO_OKLAB, lab) ** 3).clip(0, 1)
    coded = np.where(found <= 0.0031308, 12.92 * found, 1.055 * found ** (1 / 2.4) - 0.055)
    return "#" + "".join(f"{value:02x}" for value in np.round(255 * coded).clip(0, 255).astype(int))
