"""Linkages of the literature, `kc.linkages`: their lines and paths by circles that meet."""

# ruff: noqa: N806 - joints have the capital letters of the drawings

import math

import numpy as np
import pytest

import kincompile as kc
from tests.physics.test_sketched_mechanisms import meet

DEVIATION = 0.00975373308636
"""Of Hoeken's and Chebyshev's line, with a stroke of 4: computed with 30 digits, two ways."""

NAMES = ("chebyshev", "evans", "hoeken", "jansen", "klann", "peaucellier", "roberts", "watt")


def path(sketch, times=None, joint="P", p=None):
    """Return times and the complex path of a joint; the motion starts as drawn, without a word."""
    mechanism = sketch.mechanism()
    times = np.linspace(0, 1, mechanism.points) if times is None else times
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


def test_that_jansens_leg_is_the_example(example_named):
    model = example_named("jansen").model
    assert kc.emit(kc.linkages.jansen().mechanism()).source == kc.emit(model).source


def test_that_klanns_leg_is_the_example(example_named):
    example = example_named("klann")
    t, foot = path(kc.linkages.klann(), joint="G")
    solution = kc.solve(example.module, 4 * t)
    expected = solution["G.x"] + 1j * solution["G.y"]
    np.testing.assert_allclose(foot, expected, rtol=0, atol=1e-10)


def test_that_a_scale_that_is_no_size_is_refused_with_the_lengths():
    with pytest.raises(kc.ModelError, match="the length is 0; give one that is positive"):
        kc.linkages.peaucellier(0.0).mechanism()
