"""Linkages of the literature, `kc.linkages`: their lines and paths by circles that meet."""

# ruff: noqa: N806 - joints have the capital letters of the drawings

import math

import numpy as np
import pytest

import kincompile as kc
from tests.physics.test_sketched_mechanisms import meet

DEVIATION = 0.00975373308636
"""Of Hoeken's and Chebyshev's line, with a stroke of 4: computed with 30 digits, two ways."""

NAMES = (
    "chebyshev", "dwell_six_bar", "evans", "hoeken", "jansen", "klann", "peaucellier", "roberts",
    "watt",
)  # fmt: skip


def path(sketch, times=None, joint="P", p=None):
    """Return times and the complex path of a joint; the motion starts as drawn, without a word."""
    mechanism = sketch.mechanism()
    times = np.linspace(0, mechanism.end, mechanism.points) if times is None else times
    solution = kc.solve(kc.compile(mechanism), times, p)
    assert solution.success, solution.message
    return times, solution[f"{joint}.x"] + 1j * solution[f"{joint}.y"]


@pytest.mark.parametrize("name", NAMES)
def test_that_a_template_has_lengths_as_parameters_and_a_scale(name):
    joint = "G" if name in {"klann", "jansen"} else "P"
    draw = getattr(kc.linkages, name)
    (_, small), (_, large) = (path(draw(scale), joint=joint) for scale in (1.0, 50.0))
    np.testing.assert_allclose(large, 50 * small, rtol=0, atol=1e-10 * np.abs(large).max())
    mechanism = draw(length_unit="cm").mechanism()
    assert {item.unit for item in mechanism.parameters} == {"cm"}
    assert len(mechanism.parameters) >= 2
    times, _ = path(draw(), joint=joint)
    longer = {item.name: 1.01 * item.default for item in mechanism.parameters}
    if name != "klann":  # whose places on the ground are numbers
        _, scaled = path(draw(), times, joint, longer)
        np.testing.assert_allclose(scaled, 1.01 * small, rtol=0, atol=1e-10 * np.abs(small).max())


@pytest.mark.parametrize("draw", [kc.linkages.hoeken, kc.linkages.chebyshev])
def test_that_two_cognates_have_the_known_deviation_from_a_line(draw):
    _, P = path(draw(), np.linspace(0, 0.5, 20001))
    assert P.imag.min() == pytest.approx(4, abs=1e-12)
    assert np.ptp(P.imag) == pytest.approx(DEVIATION, abs=1e-9)
    assert P.real[[0, -1]] == pytest.approx([4, 0], abs=1e-12)


def test_that_hoeken_and_chebyshev_have_one_path():
    (_, first), (_, second) = path(kc.linkages.hoeken()), path(kc.linkages.chebyshev())
    np.testing.assert_allclose(first, second, rtol=0, atol=1e-12)


def test_that_the_middle_of_watts_coupler_leaves_the_line_with_the_fifth_power():
    t, P = path(kc.linkages.watt())
    A = -2 + 0.5j + 2 * np.exp(1j * np.radians(20) * (2 * t - 1))
    B = meet(A, 1, np.full_like(A, 2 - 0.5j), 2, -1)
    np.testing.assert_allclose(P, (A + B) / 2, rtol=0, atol=1e-12)
    near = np.abs(t - 0.5) < 0.2
    np.testing.assert_allclose(P.real[near], P.imag[near] ** 5 / 32, rtol=0, atol=2e-5)
    assert 5e-3 < np.abs(P.real).max() < 6.2e-3


def test_that_the_tip_of_robertss_coupler_is_on_the_line_at_three_places():
    _, P = path(kc.linkages.roberts())
    np.testing.assert_allclose(P[[0, 180, 360]], [0, 1, 2], rtol=0, atol=1e-12)
    assert np.abs(P.imag).max() == pytest.approx(0.0136, abs=1e-4)
    # A is at equal distances from O and P; so is B from P and C; they are 1 apart.
    between = P[1:-1]
    A, B = meet(0, 1.2, between, 1.2, +1), meet(between, 1.2, 2, 1.2, +1)
    np.testing.assert_allclose(np.abs(A - B), 1, rtol=0, atol=1e-9)


def test_that_a_longer_rocker_brings_the_point_of_evans_nearer_to_the_line():
    t, P = path(kc.linkages.evans())
    A = np.exp(1j * np.radians(30) * (2 * t - 1))
    B = meet(A, 1, np.full_like(A, math.sqrt(3) - 1j), 1, +1)
    np.testing.assert_allclose(P, 2 * A - B, rtol=0, atol=1e-12)
    assert np.abs(P.real).max() == pytest.approx(0.0055, abs=5e-5)
    assert np.ptp(P.imag) == pytest.approx(2, abs=1e-12)
    _, longer = path(kc.linkages.evans(), p={"CB": 4.0, "C_y": 4.0})
    assert np.abs(longer.real).max() < np.abs(P.real).max() / 3


@pytest.mark.parametrize("p", [{}, {"OA": 5.4, "AP": 3.4, "OC": 1.4}])
def test_that_the_line_of_peaucelliers_cell_is_exact(p):
    t, P = path(kc.linkages.peaucellier(), p=p)
    arm, side, crank = (({"OA": 5, "AP": 3, "OC": 1.5} | p)[key] for key in ("OA", "AP", "OC"))
    np.testing.assert_allclose(P.real, (arm**2 - side**2) / (2 * crank), rtol=0, atol=1e-12)
    along = P.real * np.tan(np.radians(40) * (2 * t - 1))
    np.testing.assert_allclose(P.imag, along, rtol=0, atol=1e-12)


def test_that_the_six_bar_rests_on_the_circle_of_its_coupler_point():
    """Its output by circles that meet, and its rest by counting on a fine grid."""
    model = kc.linkages.dwell_six_bar().mechanism()
    t = np.linspace(0, 1, 72001)
    A, C, E = np.exp(2j * np.pi * t), 3.5, 9.26 + 8.5j
    B = meet(A, 4.5, np.full_like(A, C), 4.5, +1)
    P = meet(A, 8.457, B, 4.5, -1)
    D = meet(P, 4.175, np.full_like(A, E), 2.5, +1)
    phi = np.unwrap(np.angle(D - E))
    solution = kc.solve(kc.compile(model), t[::200])
    np.testing.assert_allclose(solution["output.phi"], phi[::200], rtol=0, atol=1e-11)
    within = np.radians(0.1)
    near = np.flatnonzero(phi >= phi.max() - within)
    assert near[-1] - near[0] == near.size - 1
    rest = solution.dwell("output.phi", within, "max")
    assert rest.time == pytest.approx(t[near[-1]] - t[near[0]], abs=1e-4)
    assert 360 * rest.time == pytest.approx(126.5, abs=0.05)  # as the docstring says
    assert 360 * np.array([rest.start, rest.stop]) == pytest.approx([120, 247], abs=0.6)
    assert np.degrees(np.ptp(phi)) == pytest.approx(36.1, abs=0.05)
    circle = solution.roundness("P", (130 / 360, 230 / 360))
    assert circle.radius == pytest.approx(4.175, abs=0.005)
    assert circle.deviation < 1e-3


def test_that_a_scale_that_is_no_size_is_refused_with_the_lengths():
    with pytest.raises(kc.ModelError, match="the length is 0; give one that is positive"):
        kc.linkages.peaucellier(0.0).mechanism()
