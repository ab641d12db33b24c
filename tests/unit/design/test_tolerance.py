"""Tolerances against the closed form of the slider-crank, and against what they must obey."""

import math
import re
from typing import Any

import numpy as np
import pytest
import sympy
from scipy import stats

import kincompile as kc

LAWS: Any = stats
TRIANGLE = LAWS.triang(0.5, -1e-4, 2e-4)
TRUNCATED = LAWS.truncnorm(-3, 3).std()
LIMITS = {"r": 1e-4, "L": 2e-4, "e": 1.5e-4, "theta": 1e-3}
SLOPES = (0.242582528546139, 1.02764844284442, 0.236772722416578, -0.099860654860897)


def slider(r=0.1, L=0.3, e=0.02, theta=1.1):  # noqa: N803
    """Return x of the slider, and the angle of the rod."""
    beta = math.asin((e - r * math.sin(theta)) / L)
    return r * math.cos(theta) + L * math.cos(beta), beta


def test_worst_case_rss_and_contributions_are_those_of_the_closed_form(slider_crank):
    found = kc.tolerance(slider_crank, LIMITS, of="slider.x", t=0.0)
    assert found.nominal[0, 0] == pytest.approx(slider()[0], abs=1e-14)
    np.testing.assert_allclose(found.slope[0, 0], SLOPES, rtol=1e-12)
    low, high = found.worst("slider.x")
    assert (low[0], high[0]) == pytest.approx((-0.000365164504646881, 0.000365164504646881))
    mean, sigma = found.rss("slider.x")
    assert (mean[0], 3 * sigma[0]) == pytest.approx((0.0, 0.000232517624817648), rel=1e-12)
    parts = (1.08845, 78.1335, 2.3331, 18.4449)
    np.testing.assert_allclose(found.contributions("slider.x")[0], parts, rtol=1e-5)
    assert found.sources == tuple(LIMITS)


def test_second_derivatives_shift_the_mean_by_the_closed_form(slider_crank):
    found = kc.tolerance(slider_crank, LIMITS, of="slider.x", t=0.0)
    assert found.mean_shift("slider.x")[0] == pytest.approx(-8.30608735156842e-9, rel=1e-11)
    bend = -(math.sin(1.1) ** 2) / (0.3 * math.cos(slider()[1]) ** 3)  # d2x/dr2
    assert found.shift[0, 0, 0] == pytest.approx(bend * (1e-4 / 3) ** 2 / 2, rel=1e-11)
    assert "mean shifted by -8.31e-09 m (second order)" in str(found)


def test_mean_shift_is_that_of_samples(slider_crank):
    # Large, one-sided and with a clearance, of an acceleration: all terms matter.
    given = {"r": (-5e-3, 15e-3), "L": kc.Deviation(-1e-2, 3e-2, "uniform")}
    found = kc.tolerance(
        slider_crank, given, of="slider.x_ddot", t=0.0, clearances={"B": 4e-3}, samples=4096
    )
    first, drawn = found.rss("slider.x_ddot")[0][0], found.samples("slider.x_ddot").mean()
    shift = found.mean_shift("slider.x_ddot")[0]
    assert drawn - first == pytest.approx(shift, rel=0.1)
    assert abs(shift) > 0.02 * abs(first)


def test_samples_are_exact_motions_and_agree_with_rss(slider_crank):
    found = kc.tolerance(slider_crank, LIMITS, of="slider.x", t=0.0, samples=2048)
    drawn = found.drawn
    assert drawn.failed == 0
    for k in (0, 100, 2047):
        own = {name: float(drawn.parameters[name][k]) for name in LIMITS}
        assert drawn.values[k, 0, 0] == pytest.approx(slider(**own)[0], abs=1e-13)
    assert drawn.values[:, 0, 0].std() == pytest.approx(7.7505874939216e-5, rel=2e-3)
    # The mean is shifted by half the second derivatives times the variances.
    assert found.samples("slider.x").mean() == pytest.approx(-8.306e-9, abs=5e-9)
    again = kc.tolerance(slider_crank, LIMITS, of="slider.x", t=0.0, samples=2048)
    np.testing.assert_array_equal(again.drawn.values, drawn.values)
    other = kc.tolerance(slider_crank, LIMITS, of="slider.x", t=0.0, samples=64, seed=1)
    assert not np.isin(other.drawn.values, drawn.values).any()


def test_rates_and_several_columns_over_time(slider_crank):
    times = np.linspace(0, 6, 13)
    found = kc.tolerance(slider_crank, {"L": 1e-4}, of=["rod.phi_dot", "slider.x"], t=times)
    assert found.columns == ("phi_rod_dot", "x_slider")
    h = 1e-6
    slopes = (np.array([slider(theta=1.1 + t, L=0.3 + s)[0] for t in times]) for s in (h, -h))
    up, down = slopes
    np.testing.assert_allclose(found.slope[:, 1, 0], (up - down) / (2 * h), atol=1e-8)
    assert found.units["phi_rod_dot"] == "rad/s"
    widest = found.widest("slider.x")
    assert found.worst("slider.x")[1][widest] == found.worst("slider.x")[1].max()


def test_two_limits_shift_the_mean(slider_crank):
    found = kc.tolerance(slider_crank, {"L": (-1e-4, 3e-4)}, of="slider.x", t=0.0)
    slope = SLOPES[1]
    low, high = found.worst("slider.x")
    assert (low[0], high[0]) == pytest.approx((-1e-4 * slope, 3e-4 * slope))
    mean, sigma = found.rss("slider.x")
    assert (mean[0], sigma[0]) == pytest.approx((1e-4 * slope, 2e-4 / 3 * slope))


@pytest.mark.parametrize(
    ("distribution", "sigma"),
    [
        ("normal", 1e-4 / 3),
        ("uniform", 1e-4 / math.sqrt(3)),
        ("truncated", 1e-4 / 3 * TRUNCATED),
        (TRIANGLE, 1e-4 / math.sqrt(6)),
    ],
)
def test_distributions_have_their_standard_deviation(slider_crank, distribution, sigma):
    given = kc.Deviation(-1e-4, 1e-4, distribution)
    found = kc.tolerance(slider_crank, {"L": given}, of="slider.x", t=0.0, samples=1024)
    assert found.rss("slider.x")[1][0] == pytest.approx(sigma * SLOPES[1], rel=1e-12)
    lengths = found.drawn.parameters["L"] - 0.3
    assert lengths.std() == pytest.approx(sigma, rel=0.02)
    if distribution != "normal":
        assert np.abs(lengths).max() <= 1e-4 * (1 + 1e-12)


def test_clearance_is_a_link_of_that_length_in_any_direction(slider_crank):
    found = kc.tolerance(
        slider_crank, {}, of="slider.x", t=0.0, clearances={"B": 1e-5}, samples=512
    )
    assert found.sources == ("clearance of B",)
    # dx = (cos beta, sin beta) . d / cos beta for a shift d of the pin: it pushes along the rod.
    most = 1e-5 / math.cos(slider()[1])
    low, high = found.worst("slider.x")
    assert (low[0], high[0]) == pytest.approx((-most, most), rel=1e-9)
    assert found.rss("slider.x")[1][0] == pytest.approx(most / math.sqrt(2), rel=1e-9)
    shifts = [found.drawn.parameters[name] for name in ("clearance_xi_B", "clearance_eta_B")]
    np.testing.assert_allclose(np.hypot(*shifts), 1e-5, rtol=1e-12)
    assert np.abs(found.samples("slider.x")).max() == pytest.approx(most, rel=1e-3)
    assert found.samples("slider.x").std() == pytest.approx(most / math.sqrt(2), rel=1e-2)


def test_samples_that_cannot_move_are_counted(slider_crank):
    wide = {"L": kc.Deviation(-0.26, 0.1, "uniform")}
    times = np.linspace(0, 6, 13)
    found = kc.tolerance(slider_crank, wide, of="slider.x", t=times, samples=16)
    assert 0 < found.drawn.failed < 16
    assert len(found.drawn.values) == 16 - found.drawn.failed
    assert "did not move through all times" in str(found)


def test_report_names_the_greatest_contribution_first(slider_crank):
    found = kc.tolerance(slider_crank, LIMITS, of="slider.x", t=0.0, samples=64)
    lines = str(found).splitlines()
    assert lines[0] == "slider_crank: tolerances of r, L, e, theta at 1 time"
    assert "worst case -0.0003652 to +0.0003652 m" in str(found)
    rows = [line.split()[0] for line in lines[-4:]]
    assert rows == ["L", "theta", "e", "r"]
    assert "Monte Carlo" in found.to_html()
    html = found.to_html()
    assert "<img" not in html
    assert html.count("<svg") == 2
    used = set(re.findall(r"var\(--(\w+)\)", html))
    assert used == set(re.findall(r"--(\w+): ", html))  # a notebook has none of our colours


def test_plots_show_bands_and_bars(slider_crank):
    found = kc.tolerance(slider_crank, LIMITS, of="slider.x", t=[0.0, 0.5, 1.0], samples=64)
    ax = found.plot("slider.x")
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["worst case", "RSS, three sigma", "99.73 % of samples"]
    bars = found.tornado("slider.x", t=0.0)
    assert [text.get_text() for text in bars.get_yticklabels()] == ["r", "e", "theta", "L"]
    widths = sorted(abs(bar.get_width()) for bar in bars.patches)
    assert widths[-1] == pytest.approx(2e-4 * SLOPES[1])


def test_all_that_is_wrong_is_said_at_once(slider_crank):
    with pytest.raises(kc.InputError) as caught:
        kc.tolerance(slider_crank, {"q": 1, "r": -1, "L": (2, 1), "e": "x"}, clearances={"B": 0})
    text = str(caught.value)
    assert "5 problems" in text
    assert "no parameter 'q'" in text
    assert "the tolerance of 'r' is -1" in text
    assert "the tolerance of 'L': a deviation goes from 2 to 1" in text
    assert "the tolerance of 'e' is 'x'" in text
    assert "the clearance of 'B' is 0" in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tolerances": {"unused": 0.1}}, "'unused' moves none of x_slider"),
        ({"tolerances": {"L": 0.1}, "clearances": {"X": 1e-5}}, "no joint 'X'"),
        ({"tolerances": {"L": 0.1}, "clearances": {"motor": 1e-5}}, "no joint 'motor'"),
        ({"tolerances": {}}, "there are no tolerances"),
        ({"tolerances": {"L": 0.1}, "samples": -1}, "samples is -1"),
        ({"tolerances": {"L": 0.1}, "of": ["speed_dot_dot"]}, "has no column"),
        ({"tolerances": {"L": 0.1}, "of": ["speed_ddot"]}, "output 'speed' has no second rate"),
        ({"tolerances": {"L": 0.1}, "of": ["slidr.x"]}, "has no column 'slidr.x'"),
    ],
)
def test_bad_input_says_what_and_where(slider_crank, arguments, words):
    slider_crank.output("speed", sympy.Symbol("x_slider_dot"))
    with pytest.raises(kc.InputError, match=words):
        kc.tolerance(slider_crank, **{"of": "slider.x", "t": 0.0, **arguments})


def test_result_refuses_what_it_does_not_have(slider_crank):
    found = kc.tolerance(slider_crank, {"L": 1e-4}, of="slider.x", t=0.0)
    with pytest.raises(kc.InputError, match=r"no column 'rod\.phi'"):
        found.worst("rod.phi")
    with pytest.raises(kc.InputError, match="without samples"):
        found.samples("slider.x")


def test_deviation_checks_its_values():
    with pytest.raises(kc.InputError, match="there is no distribution 'gauss'"):
        kc.Deviation(-1, 1, "gauss")
    with pytest.raises(kc.InputError, match="give finite numbers"):
        kc.Deviation(-1, math.nan)
    with pytest.raises(kc.InputError, match="sigmas is 0"):
        kc.Deviation(-1, 1, sigmas=0)


def test_free_equations_are_refused():
    system = kc.ConstraintSystem("free", coordinates="x", equations=[sympy.Symbol("x") - kc.t])
    with pytest.raises(kc.InputError, match="takes a Mechanism, not a ConstraintSystem"):
        kc.tolerance(system, {"a": 1})
