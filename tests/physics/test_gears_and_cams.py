"""Gear train, rack and pinion, cam and slot against closed forms that are derived here."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import kincompile as kc


def times(example):
    return np.linspace(0, example.model.end, example.model.points)


@pytest.mark.parametrize("radii", [(0.02, 0.03), (0.05, 0.01), (0.013, 0.0425)])
def test_the_speeds_of_the_planetary_gear_train(example_named, radii):
    # On the planet, the point at the ring stands still and the point at the sun moves with it:
    # v_centre is half of omega R_sun, the planet turns back at v_centre / R_planet.
    example = example_named("gear_train")
    sun, planet = radii
    p = {"R_sun": sun, "R_planet": planet, "omega": 2.5}
    solution = kc.solve(example.module, times(example), p=p, throw=True)
    speed = 2.5 * sun / 2
    angles = {"sun": 2.5, "arm": speed / (sun + planet), "planet": -speed / planet}
    for name, rate in angles.items():
        np.testing.assert_allclose(
            solution[f"phi_{name}"], rate * solution.t, rtol=1e-12, atol=1e-13
        )
        np.testing.assert_allclose(solution[f"phi_{name}_dot"], rate, rtol=1e-12)
        np.testing.assert_allclose(solution[f"phi_{name}_ddot"], 0, atol=1e-12)


def test_that_the_teeth_of_sun_and_planet_roll_without_slip(example_named):
    solution = example_named("gear_train").solution
    arm = solution["phi_arm"]
    on_sun = 0.02 * (arm - solution["phi_sun"])  # arc from the sun's mark to the contact
    on_planet = 0.03 * (solution["phi_planet"] - arm)
    np.testing.assert_allclose(on_sun, on_planet, rtol=0, atol=1e-14)


@pytest.mark.parametrize("radius", [0.05, 0.012])
def test_that_the_rack_travels_the_arc_of_the_pinion(example_named, radius):
    example = example_named("rack_and_pinion")
    p = {"R": radius, "swing": 1.7}
    solution = kc.solve(example.module, times(example), p=p, throw=True)
    angle = 1.7 * np.sin(np.pi * solution.t)
    np.testing.assert_allclose(solution["phi_pinion"], angle, rtol=0, atol=1e-14)
    np.testing.assert_allclose(solution["x_rack"], radius * angle, rtol=0, atol=1e-14)
    np.testing.assert_allclose(solution["y_rack"], -radius, rtol=1e-14)
    rate = radius * 1.7 * np.pi * np.cos(np.pi * solution.t)
    np.testing.assert_allclose(solution["x_rack_dot"], rate, rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        solution["x_rack_ddot"], -radius * np.pi**2 * angle, rtol=0, atol=1e-13
    )


def support(rho, direction):
    """Return the height and angle of the highest point of rho(alpha) in each direction."""
    alpha = np.linspace(-np.pi, np.pi, 20_000, endpoint=False)
    height = rho(alpha) * np.cos(alpha - direction[:, np.newaxis])
    k = height.argmax(axis=1)
    rows = np.arange(len(direction))
    low, mid, high = (height[rows, (k + step) % alpha.size] for step in (-1, 0, 1))
    offset = (low - high) / (2 * (low - 2 * mid + high))
    return mid - (low - high) * offset / 4, alpha[k] + offset * (alpha[1] - alpha[0])


@pytest.mark.parametrize("lift", [0.02, 0.035])
def test_that_the_flat_follower_rises_by_the_support_function(example_named, lift):
    example = example_named("cam_flat_follower")
    solution = kc.solve(example.module, times(example), p={"lift": lift}, throw=True)

    def rho(alpha):
        return 0.04 + lift * (1 - np.cos(alpha)) / 2

    height, alpha = support(rho, np.pi / 2 - solution["phi_cam"])
    np.testing.assert_allclose(solution["y_follower"], height, rtol=0, atol=1e-12)
    turn = solution["alpha_contact"] - alpha
    np.testing.assert_allclose(np.cos(turn), 1, atol=1e-9)


def test_that_the_flat_follower_lifts_by_what_the_radius_grows(example_named):
    height = example_named("cam_flat_follower").solution["y_follower"]
    np.testing.assert_allclose([height.min(), height.max()], [0.04, 0.06], rtol=1e-12)


def test_that_a_follower_of_a_table_moves_as_the_spline_of_scipy(example_named):
    example = example_named("cam_by_table")
    radii = np.array([40, 40, 42, 47, 53, 58, 60, 58, 53, 47, 42, 40, 40]) / 1000
    spline = make_interp_spline(np.linspace(0, 2 * np.pi, 13), radii, k=5, bc_type="periodic")
    omega = 2 * np.pi
    alpha = (np.pi / 2 - omega * example.solution.t) % (2 * np.pi)
    solution = example.solution
    np.testing.assert_allclose(solution["y_follower"] - 0.05, spline(alpha), rtol=0, atol=1e-12)
    rates = solution["y_follower_dot"], solution["y_follower_ddot"]
    np.testing.assert_allclose(rates[0], -omega * spline(alpha, 1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(rates[1], omega**2 * spline(alpha, 2), rtol=0, atol=1e-11)


@pytest.mark.parametrize("wave", [0.01, 0.004])
def test_the_rocker_on_the_slotted_disc(example_named, wave):
    # The slot's polar angle alpha gives the distance rho of the pin from the shaft; the triangle
    # shaft, pivot, pin then gives both the turn of the disc and the angle of the rocker.
    example = example_named("slot_follower")
    solution = kc.solve(example.module, times(example), p={"wave": wave}, throw=True)
    alpha = solution["alpha_pin"]
    rho = 0.05 + wave * np.cos(2 * alpha)
    bearing = np.arccos((0.1**2 + rho**2 - 0.085**2) / (2 * 0.1 * rho))
    np.testing.assert_allclose(bearing - alpha, solution["phi_disc"], rtol=0, atol=1e-12)
    rocker = np.angle(rho * np.exp(1j * bearing) - 0.1)
    np.testing.assert_allclose(solution["phi_rocker"], rocker, rtol=0, atol=1e-12)


def test_that_the_pin_goes_round_the_slot_once_a_turn(example_named):
    solution = example_named("slot_follower").solution
    travel = solution["alpha_pin"][-1] - solution["alpha_pin"][0]
    np.testing.assert_allclose(travel, -2 * np.pi, rtol=1e-12)
    np.testing.assert_allclose(solution["phi_rocker"][-1], solution["phi_rocker"][0], rtol=1e-12)
