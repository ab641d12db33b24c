"""The wrecker boom against the geometry of a triangle and a straight line, derived here."""

import numpy as np
import pytest

import kincompile as kc

# The pins of boom and cylinder on the chassis, and the lug seen from the boom's pivot.
PIVOT, FOOT = 1.6j, 0.7 + 0.8j
LUG = 1.3 - 0.2j


def law(t, duration=8.0):
    """Return the cycloidal law from 0 to 1, with its two derivatives."""
    w = 2 * np.pi / duration
    turn = w * t
    rates = turn - np.sin(turn), w * (1 - np.cos(turn)), w**2 * np.sin(turn)
    return [rate / (2 * np.pi) for rate in rates]


def boom_angle(length):
    """Return the angle of the boom by the law of cosines in the triangle pivot, foot, lug."""
    base, side = FOOT - PIVOT, abs(LUG)
    opening = np.arccos((abs(base) ** 2 + side**2 - length**2) / (2 * abs(base) * side))
    return np.angle(base) + opening - np.angle(LUG)


@pytest.fixture(scope="module")
def solution(example_named):
    return example_named("wrecker_boom").solution


def test_that_it_lifts_and_extends_over_its_whole_time(solution):
    assert solution.success
    assert solution["phi_boom"][-1] - solution["phi_boom"][0] > np.radians(40)
    assert solution["y_hook"][-1] - solution["y_hook"][0] > 3


def test_the_angle_of_the_boom(solution):
    length = 1.05 + 0.7 * law(solution.t)[0]
    np.testing.assert_allclose(solution["phi_boom"], boom_angle(length), rtol=0, atol=1e-13)
    np.testing.assert_allclose(solution["phi_extension"], solution["phi_boom"], rtol=0, atol=1e-13)


def test_the_way_of_the_hook(solution):
    reach = 0.3 + 1.7 * law(solution.t)[0]
    angle = boom_angle(1.05 + 0.7 * law(solution.t)[0])
    tip = PIVOT + (3 + reach) * np.exp(1j * angle)
    hook = solution["x_hook"] + 1j * solution["y_hook"]
    np.testing.assert_allclose(hook, tip - 0.4j, rtol=0, atol=1e-13)
    assert not solution["phi_hook"].any()


def test_the_speed_of_the_boom(solution):
    # From l^2 = a^2 + b^2 - 2 a b cos(opening): l l_dot = a b sin(opening) phi_dot, and again.
    progress, rate, second = law(solution.t)
    length, length_dot, length_ddot = 1.05 + 0.7 * progress, 0.7 * rate, 0.7 * second
    base, side = abs(FOOT - PIVOT), abs(LUG)
    cos = (base**2 + side**2 - length**2) / (2 * base * side)
    sin = np.sqrt(1 - cos**2)
    phi_dot = length * length_dot / (base * side * sin)
    phi_ddot = (length_dot**2 + length * length_ddot) / (base * side * sin)
    phi_ddot -= phi_dot**2 * cos / sin
    np.testing.assert_allclose(solution["phi_boom_dot"], phi_dot, rtol=0, atol=1e-13)
    np.testing.assert_allclose(solution["phi_boom_ddot"], phi_ddot, rtol=0, atol=1e-12)


def test_that_it_starts_and_ends_at_rest(solution):
    ends = [0, -1]
    np.testing.assert_allclose(solution.q_dot[ends], 0, atol=1e-14)
    np.testing.assert_allclose(solution.q_ddot[ends], 0, atol=1e-14)
    assert np.abs(solution.q_dot).max() > 0.5


def test_that_the_cylinder_stays_straight(solution):
    lug = PIVOT + LUG * np.exp(1j * solution["phi_boom"])
    np.testing.assert_allclose(solution["phi_barrel"], np.angle(lug - FOOT), rtol=0, atol=1e-13)
    np.testing.assert_allclose(solution["phi_rod"], solution["phi_barrel"], rtol=0, atol=1e-13)


def test_that_other_strokes_need_no_recompiling(example_named):
    module = example_named("wrecker_boom").module
    changed = {"cylinder_stroke": 0.4, "extension_stroke": 0.9, "duration": 5.0}
    solution = kc.solve(module, np.linspace(0, 5, 26), p=changed, throw=True)
    length = 1.05 + 0.4 * law(solution.t, 5.0)[0]
    np.testing.assert_allclose(solution["phi_boom"], boom_angle(length), rtol=0, atol=1e-13)


def test_that_a_cylinder_longer_than_the_triangle_is_a_failure_in_time(example_named):
    module = example_named("wrecker_boom").module
    longest = abs(FOOT - PIVOT) + abs(LUG)
    stroke = 1.1 * (longest - 1.05)
    t = np.linspace(0, 8, 81)
    solution = kc.solve(module, t, p={"cylinder_stroke": stroke})
    assert not solution.success
    good = 1.05 + stroke * law(t)[0] < longest
    np.testing.assert_array_equal(solution.status == kc.Status.CONVERGED, good)
