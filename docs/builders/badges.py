"""The badges of the README: what pyproject.toml says, in one picture that no host has to serve."""

from __future__ import annotations

import tomllib

import kincompile as kc
from docs.builders.places import ROOT

CHARACTER, MARGIN, HEIGHT = 6.6, 8, 20
"""Widths and height of a badge, px: letters of 11 px in DejaVu Sans are 6.6 px wide."""


def badges() -> str:
    """Return the version, the Pythons that the tests run on and the licence, as an SVG."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lead = "Programming Language :: Python :: 3."
    pythons = [item for item in project["classifiers"] if item.startswith(lead)]
    facts = {
        "kincompile": kc.__version__,
        "Python": " | ".join(item.rpartition(" ")[2] for item in pythons),
        "license": project["license"]["text"],
    }
    marks, left = [], 0.0
    for key, value in facts.items():
        for text, colour in ((key, "#39424e"), (value, "#1f6a45")):
            width = CHARACTER * len(text) + 2 * MARGIN
            marks.append(
                f'<rect x="{left:g}" width="{width:g}" height="{HEIGHT}" fill="{colour}"/>'
            )
            marks.append(f'<text x="{left + width / 2:g}" y="14">{text}</text>')
            left += width
        left += MARGIN
    said = ", ".join(f"{key} {value}" for key, value in facts.items())
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left:g}" height="{HEIGHT}" role="img" '
        f'aria-label="{said}" font-family="DejaVu Sans, Verdana, sans-serif" font-size="11" '
        'fill="#ffffff" text-anchor="middle">'
    )
    return "\n".join([head, *marks, "</svg>", ""])
