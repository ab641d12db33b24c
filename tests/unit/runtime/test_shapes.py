"""Straightness, roundness and dwells against closed forms and linkages of the literature."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

import kincompile as kc
from kincompile.runtime.results.shapes import nearest_circle, nearest_line


def solved(sketch, points=181):
    m = sketch.mechanism()
    return kc.solve(kc.compile(m), np.linspace(0, m.end, points))


def peaucellier():
    """Peaucellier's cell draws a straight line (1864)."""
    s = kc.Sketch("peaucellier", length_unit="mm", end=1.0)
    s.ground(O=(0, 0), C=(30, 0))
    s.joints(A=(60, 0), B=(97.5, 65), D=(97.5, -65), P=(135, 0))
    s.link("crank", "C A", 30)
    for name, ends, size in (
        ("one", "O B", 120), ("two", "O D", 120), ("three", "A B", 75), ("four", "A D", 75),
        ("five", "B P", 75), ("six", "D P", 75),
    ):  # fmt: skip
        s.link(name, ends, size)
    s.point("P")
    s.drive("crank", 0.8 * kc.t - 0.4)
    return s


def hoeken():
    """Hoeken's linkage, with lengths 1 : 2 : 2.5 : 2.5 and the tracing point at 5."""
    s = kc.Sketch("hoeken", length_unit="mm", end=1.0)
    s.ground(O=(0, 0), C=(200, 0))
    s.joints(A=(100, 0), B=(150, 245), P=(200, 490))
    s.link("crank", "O A", 100)
    s.link("coupler", "A B P", AB=250, P=(500, 0))
    s.link("rocker", "C B", 250)
    s.point("P")
    s.drive("crank", 2 * kc.pi * kc.t)
    return s


def hoeken_path(theta):
    """Return the path of Hoeken's tracing point by the intersection of two circles."""
    a = 100 * np.exp(1j * theta)
    way = 200 - a
    size = np.abs(way)
    b = a + way / size * (size / 2 + 1j * np.sqrt(250**2 - (size / 2) ** 2))
    return 2 * b - a


def test_that_peaucelliers_line_is_straight():
    found = solved(peaucellier())
    near = found.straightness("P")
    assert near.deviation <= 1e-10 * 1e-2 * 135  # 1e-12 of its size
    x = (120**2 - 75**2) / (2 * 30)  # at this distance from O
    assert near.place[0] == pytest.approx(x, abs=1e-9)
    assert abs(near.direction[1]) == pytest.approx(1, abs=1e-12)
    # its crank's joint goes round C
    round_ = found.roundness("A")
    assert round_.deviation <= 1e-11
    assert (*round_.place, round_.radius) == pytest.approx((30, 0, 30), abs=1e-9)


def test_how_straight_hoekens_path_is():
    part = (0.25, 0.75)
    near = solved(hoeken()).straightness("P", part)
    path = hoeken_path(2 * np.pi * np.linspace(*part, 90 * 8 + 1))
    rows = np.column_stack((path.real, path.imag))
    # numpy's straight line, the path being nearly level: its offsets across the slope
    slope, height = np.polyfit(path.real, path.imag, 1)
    off = (path.imag - slope * path.real - height) / math.hypot(1, slope)
    assert near.deviation == pytest.approx(np.abs(off).max(), rel=1e-3)
    direct = nearest_line(rows)
    assert near.deviation == pytest.approx(np.abs(direct.offsets).max(), abs=1e-8)
    assert near.rms == pytest.approx(np.sqrt(np.mean(direct.offsets**2)), abs=1e-8)
    assert (near.start, near.stop) == part
    assert near.deviation < 0.01 * np.ptp(path.real)  # that is what it is for


@pytest.mark.parametrize(("steps", "slack"), [(24, 1e-6), (60, 1e-8), (180, 1e-10)])
def test_that_a_path_is_farthest_between_the_times_that_were_looked_at(steps, slack):
    """Against the greatest distance of the closed form, from the same line and circle."""
    found = solved(hoeken(), steps + 1)
    place, u = np.array([123.0, 400.0]), np.array([0.8, 0.6])
    near = found.straightness("P", line=(place, place + u))
    circle = found.roundness("P", circle=(150.0, 300.0, 90.0))

    def off(t):
        path = hoeken_path(2 * np.pi * t) - complex(*place)
        return np.abs((path * np.conj(complex(*u))).imag)

    def away(t):
        return np.abs(np.abs(hoeken_path(2 * np.pi * t) - (150 + 300j)) - 90)

    for measured, by_hand in ((near, off), (circle, away)):
        t = np.linspace(0, 1, 400_001)
        assert measured.deviation == pytest.approx(by_hand(t).max(), rel=slack)
        # its own time is an extreme: the slope of the closed form is zero there
        h = 1e-5
        assert abs(by_hand(measured.t + h) - by_hand(measured.t - h)) / (2 * h) < 1.0


def test_that_points_have_one_rule_of_names():
    """A joint that is no output is a column as other points are; a column is no point."""
    found = solved(hoeken())
    np.testing.assert_array_equal(found["x_B"], found["B.x"])
    for name in ("x_B", "B.x"):
        with pytest.raises(kc.InputError, match="Name the point: 'B'"):
            found.straightness(name)
    with pytest.raises(kc.InputError, match="x_nothing"):
        found["x_nothing"]


def test_that_a_part_can_be_a_range_of_a_column():
    found = solved(hoeken())
    by_angle = found.straightness("P", {"crank.phi": (0.5 * math.pi, 1.5 * math.pi)})
    by_time = found.straightness("P", (0.25, 0.75))
    assert by_angle.deviation == pytest.approx(by_time.deviation, rel=1e-6)


def test_a_given_line_and_circle():
    found = solved(hoeken())
    level = found.straightness("P", (0.25, 0.75), line=((0, 400), (1, 400)))
    path = hoeken_path(2 * np.pi * np.linspace(0.25, 0.75, 400_001))
    assert level.deviation == pytest.approx(np.abs(path.imag - 400).max(), abs=1e-8)
    circle = found.roundness("B", circle=(200, 1, 250))
    assert circle.deviation == pytest.approx(1.0, rel=0.05)


def test_the_nearest_circle_is_that_of_least_squares():
    rng = np.random.default_rng(4)
    angle = np.linspace(0.3, 2.0, 40)
    rows = np.column_stack((3 + 2 * np.cos(angle), 1 + 2 * np.sin(angle)))
    rows += 0.05 * rng.standard_normal(rows.shape)
    solve: Any = least_squares
    expected = solve(
        lambda v: np.hypot(rows[:, 0] - v[0], rows[:, 1] - v[1]) - v[2], [3, 1, 2], xtol=1e-15
    )
    found = nearest_circle(rows)
    np.testing.assert_allclose([*found.place, found.radius], expected.x, atol=1e-6)
    assert np.sum(found.offsets**2) <= 2 * expected.cost * (1 + 1e-9)


def yoke(start=0.0):
    """A Scotch yoke, x = 50 cos."""
    s = kc.Sketch("yoke", length_unit="mm", end=1.0)
    s.ground(O=(0, 0))
    s.joints(A=(50, 0))
    s.link("crank", "O A", 50)
    s.point("A")
    s.drive("crank", 2 * kc.pi * kc.t + start)
    return s


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_the_dwell_of_a_scotch_yoke(start):
    """It is within 1 mm of its end for 2 acos(1 - 1/50), over the end of the turn too."""
    found = solved(yoke(start), 91)
    half = math.acos(1 - 1 / 50)
    for at in ("max", "min", -50.0):
        rest = found.dwell("A.x", 1.0, at)
        assert rest.time == pytest.approx(2 * half / math.tau, rel=1e-7)
        assert rest.travel["drive_crank"] == pytest.approx(2 * half, rel=1e-7)
    middle = ((math.pi - start) % math.tau) / math.tau
    assert (rest.start + rest.stop) / 2 % 1 == pytest.approx(middle, abs=1e-7)
    assert rest.at == -50.0


def test_the_dwell_of_a_slider_crank():
    """Longer at the outer end: by brentq on the closed form."""
    s = kc.Sketch("pump", length_unit="mm", end=1.0)
    s.ground(O=(0, 0))
    s.joints(A=(60, 0), B=(260, 0))
    s.link("crank", "O A", 60)
    s.link("rod", "A B", 200)
    s.slider("ram", "B", along=(1, 0))
    s.drive("crank", 2 * kc.pi * kc.t + 0.5)
    found = solved(s, 121)

    def x(phi):
        return 60 * math.cos(phi) + math.sqrt(200**2 - (60 * math.sin(phi)) ** 2)

    outer = brentq(lambda phi: x(phi) - 259.5, 0, 1)
    inner = math.pi - brentq(lambda phi: x(phi) - 140.5, 2, math.pi)
    assert found.dwell("ram.x", 0.5).travel["drive_crank"] == pytest.approx(2 * outer, rel=1e-7)
    assert found.dwell("ram.x", 0.5, "min").time == pytest.approx(inner / math.pi, rel=1e-7)
    assert inner > outer


def test_what_is_never_reached():
    rest = solved(yoke()).dwell("A.x", 1.0, 60.0)
    assert rest.time == 0
    assert "never within 1 of 60 mm" in str(rest)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda s: s.straightness("P", (0.8, 0.2)), "two times in their order"),
        (lambda s: s.straightness("P", "often"), "give two times"),
        (lambda s: s.straightness("Q"), "Q"),
        (lambda s: s.straightness("P", (math.nan, 1)), "give two times"),
        (lambda s: s.straightness("P", {"crank.phi": 1}), "give two times"),
        (lambda s: s.straightness("P", line=((1, 1), (1, 1))), "a line is two places apart"),
        (lambda s: s.straightness("P", line=((math.nan, 1), (1, 1))), "a line is two places apart"),
        (lambda s: s.straightness("P", line="x = 0"), "a line is two places apart"),
        (lambda s: s.straightness("P", line=((0, 1),)), "a line is two places apart"),
        (lambda s: s.roundness("P", circle=(0, 0, 0)), "and a positive radius"),
        (lambda s: s.roundness("P", circle=(0, 0, -1)), "and a positive radius"),
        (lambda s: s.roundness("P", circle=(0, 0)), "and a positive radius"),
        (lambda s: s.dwell("P.x", -1), "give a positive tolerance"),
        (lambda s: s.dwell("P.x", "wide"), "give a positive tolerance"),
        (lambda s: s.dwell("P.x", 1, math.nan), "give 'max', 'min' or a value"),
        (lambda s: s.dwell("P.x", 1, "top"), "give 'max', 'min' or a value"),
    ],
)
def test_what_cannot_be_asked(ask, words):
    with pytest.raises(kc.InputError, match=words):
        ask(solved(hoeken(), 11))


@pytest.mark.parametrize("ask", [lambda s: s.straightness("P"), lambda s: s.dwell("P.x", 1)])
def test_that_one_point_is_no_motion(ask):
    with pytest.raises(kc.InputError, match="has no motion to measure"):
        ask(solved(hoeken(), 1))
