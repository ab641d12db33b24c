"""`kc.plot_mechanism`: pins, bars, sliders, gears and cams stand where closed forms put them."""

import sys

import numpy as np
import pytest

import kincompile as kc
from kincompile.view.shapes import DRIVER_COLOUR, GROUND_COLOUR, HUES

pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from matplotlib import pyplot as plt
from matplotlib.colors import to_rgba

R, L = 0.1, 0.3


BODY = HUES["light"]
"""Colours of bodies, those of the page."""


@pytest.fixture(scope="module")
def slider_crank():
    m = kc.Mechanism("slider_crank", length_unit="dm")
    r = m.parameter("r", R)
    crank = m.body("crank")
    rod = m.body("rod", guess=(0.25, 0, 0))
    slider = m.body("slider", guess=(0.4, 0, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (r, 0), rod, (-L / 2, 0)))
    m.add(kc.Revolute("B", rod, (L / 2, 0), slider, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), slider, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    return m


def slider_crank_position(angle):
    """Return q and the points A and B, from the triangle O A B."""
    a = R * np.array((np.cos(angle), np.sin(angle)))
    beta = -np.arcsin(a[1] / L)
    b = np.array((a[0] + L * np.cos(beta), 0.0))
    middle = (a + b) / 2
    return np.array((0, 0, angle, *middle, beta, *b, 0)), a, b


def areas(ax, colour=None):
    """Return the corners of the areas, or of those with a face of a colour."""
    chosen = [
        area
        for area in ax.patches
        if colour is None or area.get_facecolor()[:3] == to_rgba(colour)[:3]
    ]
    return [area.get_xy()[:-1] for area in chosen]


def lines(ax, colour):
    return [
        np.column_stack(line.get_data())
        for line in ax.lines
        if to_rgba(line.get_color())[:3] == to_rgba(colour)[:3]
    ]


def has_line(ax, colour, points):
    return any(
        line.shape == np.shape(points) and np.allclose(line, points, atol=1e-12)
        for line in lines(ax, colour)
    )


def is_bar(points, start, end):
    """Whether an area is a bar with round ends, everywhere as far from its middle line."""
    start, along = np.array(start), np.subtract(end, start)
    part = np.clip((points - start) @ along / (along @ along), 0, 1)
    far = np.hypot(*(points - start - part[:, None] * along).T)
    return len(points) > 20 and np.ptp(far) < 1e-9 and 0 < far[0] < 0.2 * np.hypot(*along)


def has_bar(ax, colour, start, end):
    return any(is_bar(points, start, end) for points in areas(ax, colour))


def centres(polygons):
    return np.array([points.mean(axis=0) for points in polygons])


def test_that_pins_bars_and_slider_are_those_of_the_triangle(slider_crank):
    q, a, b = slider_crank_position(0.7)
    ax = kc.plot_mechanism(slider_crank, q)
    pins = centres(areas(ax, "white"))
    np.testing.assert_allclose(pins, [(0, 0), a, b], atol=1e-12)
    assert has_bar(ax, BODY[0], (0, 0), a)
    assert has_bar(ax, BODY[1], a, b)
    (block,) = areas(ax, BODY[2])
    np.testing.assert_allclose(block.mean(axis=0), b, atol=1e-12)
    assert np.ptp(block[:, 0]) > np.ptp(block[:, 1]) > 0
    assert ax.get_aspect() == 1
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == (
        "x [dm]", "y [dm]", "slider_crank",
    )  # fmt: skip


def test_that_an_open_joint_is_a_red_line(slider_crank):
    q, _, b = slider_crank_position(0.7)
    moved = q.copy()
    moved[6] += 0.05  # the slider leaves the rod
    assert has_line(kc.plot_mechanism(slider_crank, moved), "red", [b, (b[0] + 0.05, 0)])
    assert has_line(kc.plot_mechanism(slider_crank, q), "red", [b, b])  # nothing to be seen


def test_that_the_guess_is_drawn_without_a_position(slider_crank):
    ax = kc.plot_mechanism(slider_crank)
    np.testing.assert_allclose(centres(areas(ax, "white"))[-1], (0.4, 0), atol=1e-12)


def test_that_parameters_change_the_shapes(slider_crank):
    q, _, _ = slider_crank_position(0.7)
    ax = kc.plot_mechanism(slider_crank, q, p={"r": 0.2})
    assert has_bar(ax, BODY[0], (0, 0), (0.2 * np.cos(0.7), 0.2 * np.sin(0.7)))


MECHANISMS = (
    "cam_by_table", "cam_flat_follower", "double_pendulum", "four_bar", "gear_train",
    "inverted_slider_crank", "rack_and_pinion", "simple_pendulum", "slider_crank", "slot_follower",
    "wrecker_boom",
)  # fmt: skip


@pytest.mark.parametrize("name", MECHANISMS)
def test_that_everything_lies_within_the_limits(example_named, name):
    example = example_named(name)
    require_all_within(kc.plot_mechanism(example.model, example.solution.q[7]))


@pytest.mark.parametrize("kind", [kc.AbsoluteX, kc.AbsoluteY])
def test_that_the_arrow_of_a_driver_lies_within_the_limits(kind):
    m = kc.Mechanism("pulled")
    block = m.body("block", guess=(1, 1, 0))
    m.add(kind("pull", block, (0, 0), 1 + kc.t))
    ax = kc.plot_mechanism(m)
    require_all_within(ax)
    (arrow,) = lines(ax, DRIVER_COLOUR)
    along = np.ptp(arrow, axis=0) > 0
    assert along.tolist() == [kind is kc.AbsoluteX, kind is kc.AbsoluteY]


def require_all_within(ax):
    (x_low, x_high), (y_low, y_high) = ax.get_xlim(), ax.get_ylim()
    points = np.concatenate([*areas(ax), *(np.column_stack(line.get_data()) for line in ax.lines)])
    x, y = points[np.isfinite(points).all(axis=1)].T
    assert x_low <= x.min() <= x.max() <= x_high
    assert y_low <= y.min() <= y.max() <= y_high


def test_that_gears_have_their_radius_and_turn(example_named):
    example = example_named("gear_train")
    solution = example.solution
    k = 13
    ax = kc.plot_mechanism(example.model, solution.q[k])
    sun, planet = areas(ax, BODY[0])[0], areas(ax, BODY[2])[0]
    x, y = solution["x_planet"][k], solution["y_planet"][k]
    np.testing.assert_allclose(np.hypot(*sun.T), 0.02, rtol=1e-12)
    np.testing.assert_allclose(np.hypot(*(planet - (x, y)).T), 0.03, rtol=1e-12)
    # The arm turns at a fifth of the sun's speed, and carries the planet's centre.
    angle = 2 * np.pi * solution.t[k] / 5
    np.testing.assert_allclose((x, y), (0.05 * np.cos(angle), 0.05 * np.sin(angle)), atol=1e-12)
    turned = 2 * np.pi * solution.t[k]
    assert has_line(ax, BODY[0], [(0, 0), (0.02 * np.cos(turned), 0.02 * np.sin(turned))])
    ring = next(line for line in lines(ax, GROUND_COLOUR) if len(line) > 60)
    np.testing.assert_allclose(np.hypot(*ring.T), 0.08, rtol=1e-12)


def test_that_a_cam_has_its_profile_and_touches_the_face(example_named):
    example = example_named("cam_flat_follower")
    k = 31
    solution = example.solution
    ax = kc.plot_mechanism(example.model, solution.q[k])
    cam = max(areas(ax, BODY[0]), key=len)
    polar = np.arctan2(*cam.T[::-1]) - solution["phi_cam"][k]
    np.testing.assert_allclose(np.hypot(*cam.T), 0.04 + 0.01 * (1 - np.cos(polar)), rtol=1e-9)
    (face,) = [line for line in lines(ax, BODY[1]) if len(line) == 2]
    # The highest of 180 points of the profile is next to the point of contact.
    np.testing.assert_allclose(face[:, 1], cam[:, 1].max(), rtol=2e-4)


def test_that_names_are_written_once_a_place(slider_crank):
    q, _, b = slider_crank_position(0.7)
    texts = kc.plot_mechanism(slider_crank, q, names=True).texts
    assert {text.get_text() for text in texts} == {"O, motor", "A", "B, guide"}
    at_slider = next(text for text in texts if text.get_text() == "B, guide")
    np.testing.assert_allclose(at_slider.xy, b, atol=1e-4)


def test_that_axes_are_taken_and_given_back(slider_crank):
    _, ax = plt.subplots()
    assert kc.plot_mechanism(slider_crank, ax=ax) is ax
    assert ax.get_title() == ""


def test_that_a_wrong_position_is_refused(slider_crank):
    with pytest.raises(kc.InputError, match=r"shape \(8,\), but .*\(9,\): x_crank, .*one row"):
        kc.plot_mechanism(slider_crank, np.zeros(8))
    q = np.zeros(9)
    q[4] = np.nan
    with pytest.raises(kc.InputError, match=r"not finite \(y_rod\).*solution.status is 0"):
        kc.plot_mechanism(slider_crank, q)


def test_that_a_wrong_parameter_is_refused(slider_crank):
    with pytest.raises(kc.InputError, match=r"no parameter 'R'; .*parameters are: r"):
        kc.plot_mechanism(slider_crank, p={"R": 1.0})


def test_that_free_equations_are_not_drawn(example_named):
    with pytest.raises(kc.InputError, match=r"has no bodies.*solution\.plot\(\)"):
        kc.plot_mechanism(example_named("problem_3_5_6").model)


def test_that_missing_matplotlib_is_named(slider_crank, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(kc.UnsupportedError, match=r"matplotlib is not .*'\.\[plot\]'"):
        kc.plot_mechanism(slider_crank)
