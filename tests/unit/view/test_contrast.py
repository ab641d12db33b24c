"""Colours of the page can be told from their paper: WCAG 2.2, AA, in both colour schemes."""

import re

import pytest

from kincompile.report.templates import read
from kincompile.view.shapes import HUES

SCHEMES = ("light", "dark")
TEXT, GRAPHICS = 4.5, 3.0


def palettes():
    """Return the colours of the style sheets by scheme and name."""
    text = read("view/style.css") + read("view/newton.css")
    pairs = re.findall(r"--([\w-]+): light-dark\((#\w{6}), (#\w{6})\)", text)
    assert len(pairs) > 15
    return {
        scheme: {name: colours[k] for name, *colours in pairs} for k, scheme in enumerate(SCHEMES)
    }


def luminance(colour):
    """Return the relative luminance of a colour, by its definition in WCAG."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    """Return the contrast ratio of two colours."""
    low, high = sorted(map(luminance, (one, other)))
    return (high + 0.05) / (low + 0.05)


def blended(colour, paper, part):
    mixed = (
        round(part * int(colour[k : k + 2], 16) + (1 - part) * int(paper[k : k + 2], 16))
        for k in (1, 3, 5)
    )
    return "#" + "".join(f"{x:02x}" for x in mixed)


def test_that_the_ratio_is_that_of_the_standard():
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=5e-3)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_that_text_is_read_on_paper_and_on_tint(scheme):
    palette = palettes()[scheme]
    names = ("ink", "quiet", "link", "bad", "velocity", "acceleration", "drive", "pole", "measure",
             "plot", "guess", "iterate")  # fmt: skip
    for name in names:
        for ground in ("paper", "tint"):
            assert contrast(palette[name], palette[ground]) >= TEXT, (name, ground)
    assert contrast(palette["ink"], palette["bad-tint"]) >= TEXT
    assert contrast(palette["paper"], palette["link"]) >= TEXT  # of a button that is pressed


@pytest.mark.parametrize("scheme", SCHEMES)
def test_that_edges_of_controls_and_of_bodies_are_seen(scheme):
    palette = palettes()[scheme]
    for ground in ("paper", "tint"):
        assert contrast(palette["edge"], palette[ground]) >= GRAPHICS
    for hue in HUES[scheme]:
        assert contrast(hue, palette["paper"]) >= TEXT  # names of bodies are written in it
        pale = blended(hue, palette["paper"], 0.22 if scheme == "light" else 0.32)
        assert contrast(hue, pale) >= GRAPHICS
        assert contrast(palette["ink"], pale) >= TEXT


@pytest.mark.parametrize("scheme", SCHEMES)
def test_that_numbers_are_read_in_the_strongest_cells_of_newtons_panel(scheme):
    palette = palettes()[scheme]
    (percent,) = re.findall(r"Math\.round\((\d+) \* part\)", read("view/newton_tables.js"))
    for name in ("bad", "positive", "negative"):
        cell = blended(palette[name], palette["paper"], int(percent) / 100)
        assert contrast(palette["ink"], cell) >= TEXT, name
