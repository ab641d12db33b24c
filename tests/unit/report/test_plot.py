"""Plots as SVG: their elements, read by an XML parser, stand where the numbers are."""

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from kincompile.report.plot import Layer, plot_svg

X = np.linspace(0, 10, 11)


def places(d):
    """Return the corners of a path."""
    return np.array([pair.split() for pair in re.findall(r"[ML]([\d.]+ [\d.]+)", d)], dtype=float)


def read(*layers, **options):
    """Return the numbers beside the axes with their places, and the paths of the layers."""
    found = ET.fromstring(plot_svg("what it shows", "t [s]", "y < z [m]", layers, **options))
    assert found.attrib["aria-label"] == "what it shows"
    texts = [(item.text or "", item.attrib) for item in found if item.tag == "text"]
    assert "y < z [m]" in [text for text, _ in texts]
    ticks = [(float(text), at) for text, at in texts if re.fullmatch(r"-?[\d.e+-]+", text)]
    across = {value: float(at["x"]) for value, at in ticks if at["text-anchor"] == "middle"}
    up = {value: float(at["y"]) - 4 for value, at in ticks if at["text-anchor"] == "end"}
    paths = [x.attrib for x in found if x.tag == "path" and x.attrib["stroke" if "stroke" in
             x.attrib else "fill"] != "var(--line)"]  # fmt: skip
    return across, up, paths


@pytest.mark.parametrize("factor", [1e-7, 1.0, 3e8])
def test_that_points_stand_beside_the_numbers_of_the_axes(factor):
    y = factor * (X - 3)
    across, up, (line, dots) = read(Layer("line", X, y), Layer("dots", X, y))
    assert 4 <= len(across) <= 9
    assert 4 <= len(up) <= 9
    wanted = np.interp(X, sorted(across), [across[value] for value in sorted(across)])
    np.testing.assert_allclose(places(line["d"])[:, 0], wanted, atol=0.11)
    values = sorted(up)
    inside = (y >= values[0]) & (y <= values[-1])
    heights = np.interp(y[inside], values, [up[value] for value in values])
    np.testing.assert_allclose(places(line["d"])[inside, 1], heights, atol=1.0)
    np.testing.assert_array_equal(places(dots["d"]), places(line["d"]))


def test_that_what_was_not_found_is_left_out_and_a_path_has_one_scale():
    y = np.where(X == 4, np.nan, X**2)
    _, _, (band, line, dots) = read(
        Layer("band", X, y, y + 1), Layer("line", X, y), Layer("dots", X, y, name="found")
    )
    assert [line["d"].count(letter) for letter in "ML"] == [2, 8]
    assert dots["d"].count("h0") == 10
    assert band["d"].count("L") + 1 == 20
    across, up, _ = read(Layer("line", X, X / 7), is_true=True)
    scales = [np.ptp(list(ends.values())) / np.ptp(list(ends)) for ends in (across, up)]
    assert scales[0] == pytest.approx(scales[1], rel=0.01)


def test_that_nothing_and_one_value_can_be_plotted():
    read(Layer("line", X, np.full(11, np.nan)))
    _, up, _ = read(Layer("line", X, np.full(11, 5.0)))
    assert min(up) < 5 < max(up)
