"""Plots as SVG: their elements, read by an XML parser, stand where the numbers are."""

import itertools
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


@pytest.mark.parametrize("ends", [(-1.3e-4, 2.2e-4), (0.0, 12.0), (-987654.0, 0.0), (1e8, 4e8)])
def test_that_no_numbers_and_names_meet(ends):
    """With 6 units a letter, which is more than a digit of 11 units has."""
    x = np.linspace(ends[0], ends[1], 5)
    layers = [Layer("line", x, X[:5], name=name) for name in ("worst case", "RSS", "samples")]
    across, _, _ = read(*layers)
    found = ET.fromstring(plot_svg("", "", "deviation of x_ram_dot [m/s]", layers))
    texts = [(item.text or "", item.attrib) for item in found if item.tag == "text"]
    shown = [(text, float(at["x"])) for text, at in texts if at.get("text-anchor") == "middle"]
    rows = [[(at, at, text) for text, at in shown if text]]
    rows.append([(float(at["x"]), 0, text) for text, at in texts if at.get("y") == "13"])
    assert len(rows[1]) == 4
    assert len(across) >= 2
    numbers = sorted((at - 3 * len(text), at + 3 * len(text)) for at, _, text in rows[0])
    names = sorted(
        (x - 6 * len(text), x) if x else (0.0, 6.0 * len(text)) for x, _, text in rows[1]
    )
    for own in (numbers, names):
        assert all(a[1] <= b[0] for a, b in itertools.pairwise(own))
