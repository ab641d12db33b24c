"""Cams from the law of their follower, against envelopes by brute force and the motion itself."""

from collections.abc import Callable

import numpy as np
import pytest
import sympy

import kincompile as kc

LIFT, BASE, ROLLER, OFFSET = 0.02, 0.04, 0.01, 0.006
HEIGHT = np.sqrt((BASE + ROLLER) ** 2 - OFFSET**2)
PIVOT, ARM = (0.08, 0.0), 0.07
FINE = np.linspace(0, 2 * np.pi, 40001)[:-1]


def law(low, high) -> sympy.Expr:
    """Return a rise, a dwell, a fall and a dwell over one revolution."""
    degrees = [(0, low), (100, high), (160, high), (290, low), (360, low)]
    motion: sympy.Expr = kc.motion.sequence(
        [(a * kc.deg, value) for a, value in degrees], "modified sine"
    )
    return motion


def values(motion: sympy.Expr, at: np.ndarray, order: int = 0) -> np.ndarray:
    """Return a law by a difference of what the compiler makes of it."""
    m = kc.Mechanism("law")
    m.add(kc.AbsoluteX("x", m.body("cart"), (0, 0), motion))
    m.add(kc.AbsoluteY("y", "cart", (0, 0), 0))
    m.add(kc.AbsoluteAngle("phi", "cart", 0))
    found: np.ndarray = kc.solve(kc.compile(m), at)[f"x_cart{('', '_dot', '_ddot')[order]}"]
    return found


SWING = law(2.4, 2.4 + 0.35)
CAMS = {
    "roller": lambda: kc.motion.roller_cam(law(0, LIFT), BASE, ROLLER, offset=OFFSET),
    "oscillating": lambda: kc.motion.oscillating_cam(SWING, PIVOT, ARM, ROLLER),
    "flat": lambda: kc.motion.flat_cam(law(0, LIFT), BASE),
}


def centres(name: str) -> np.ndarray:
    """Return the path of the roller's centre in the frame of the cam, as complex numbers."""
    if name == "roller":
        path = OFFSET + 1j * (HEIGHT + values(law(0, LIFT), FINE))
    else:
        path = PIVOT[0] + ARM * np.exp(1j * values(SWING, FINE))
    return np.asarray(path * np.exp(-1j * FINE))


PATHS: dict[str, np.ndarray] = {}


def once(name: str, make: Callable[[], np.ndarray]) -> np.ndarray:
    """Return what has been made under a name, or make it."""
    if name not in PATHS:
        PATHS[name] = make()
    return PATHS[name]


def reach(name: str, angle: float) -> float:
    """Return how far a ray from the centre goes before any position of the follower stops it."""
    if name == "flat":
        cosine = np.cos(np.pi / 2 - FINE - angle)
        distance = BASE + once("lift", lambda: values(law(0, LIFT), FINE))
        return float((distance[cosine > 0.05] / cosine[cosine > 0.05]).min())
    z = once(name, lambda: centres(name))
    along, across = np.abs(z) * np.cos(angle - np.angle(z)), np.abs(z) * np.sin(angle - np.angle(z))
    hit = (along > 0) & (np.abs(across) <= ROLLER)
    return float((along[hit] - np.sqrt(ROLLER**2 - across[hit] ** 2)).min())


@pytest.mark.parametrize("name", CAMS)
def test_that_the_profile_is_the_envelope_of_the_follower(name):
    angles, radii = CAMS[name]().table
    for angle, radius in list(zip(angles, radii, strict=True))[::15]:
        assert radius == pytest.approx(reach(name, angle), abs=1e-8)


@pytest.mark.parametrize("name", CAMS)
def test_that_the_radius_of_curvature_is_that_of_three_neighbours(name):
    cam = CAMS[name]()
    z = cam.points @ np.array([1, 1j])
    a, b, c = np.roll(z, 1), z, np.roll(z, -1)
    # The circle through three points; clockwise along the profile.
    double_area = -np.imag(np.conj(b - a) * (c - b))
    radius = np.abs(b - a) * np.abs(c - b) * np.abs(c - a) / (2 * double_area)
    # Where two pieces of the law join, the curvature bends; between neighbours it is their mean.
    assert 1 / cam.radius_of_curvature == pytest.approx(1 / radius, rel=0.03, abs=0.1)
    assert np.median(np.abs(cam.radius_of_curvature / radius - 1)) < 1e-3


def test_that_the_pressure_angle_is_that_of_the_handbook():
    """Norton's for a translating roller: tan = (s' - e)/(s + sqrt(R^2 - e^2)), R to the centre."""
    cam = CAMS["roller"]()
    s, slope = (values(law(0, LIFT), cam.angle, order) for order in (0, 1))
    assert np.tan(cam.pressure_angle) == pytest.approx((slope - OFFSET) / (s + HEIGHT), abs=1e-12)
    assert f"{np.degrees(abs(cam.pressure_angle).max()):.4g} degrees" in repr(cam)
    assert not CAMS["flat"]().pressure_angle.any()


def follower(name: str) -> tuple[kc.Mechanism, str]:
    """Return a cam of the profile with its follower, and the coordinate that follows the law."""
    m = kc.Mechanism("cam")
    cam = m.body("cam")
    m.add(kc.Revolute("shaft", m.ground, (0, 0), cam, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", cam, kc.t))
    table, top = CAMS[name]().table, float(np.pi / 2)
    if name == "oscillating":
        end = PIVOT[0] + ARM * np.exp(2.4j)
        arm = m.body("arm", (*PIVOT, 2.4))
        m.add(kc.Revolute("pin", m.ground, PIVOT, arm, (0, 0)))
        guess = (float(np.angle(end)), float(np.angle(-end)) - 2.4)
        m.add(kc.CamFollower("c", cam, (0, 0), table, arm, (ARM, 0), ROLLER, guess=guess))
        return m, "phi_arm"
    x = OFFSET if name == "roller" else 0.0
    slide = m.body("slide", (x, HEIGHT if name == "roller" else BASE, 0))
    m.add(kc.Translational("guide", m.ground, (x, 0), (0, 1), slide, (0, 0), (0, 1)))
    if name == "roller":
        m.add(kc.CamFollower("c", cam, (0, 0), table, slide, (0, 0), ROLLER, guess=(top, -top)))
    else:
        m.add(kc.CamFlatFollower("c", cam, (0, 0), table, slide, (0, 0), (1, 0), guess=top))
    return m, "y_slide"


@pytest.mark.parametrize("name", CAMS)
def test_that_the_cam_moves_its_follower_by_the_law(name):
    m, column = follower(name)
    t = np.linspace(0, 2 * np.pi, 500)
    solution = kc.solve(kc.compile(m), t)
    assert solution.success, solution.message
    wanted = values(SWING if name == "oscillating" else law(0, LIFT), t)
    start = {"roller": HEIGHT, "flat": BASE, "oscillating": 0.0}[name]
    assert solution[column] - start == pytest.approx(wanted, abs=2e-8)
    slope = values(SWING if name == "oscillating" else law(0, LIFT), t, 1)
    assert solution[f"{column}_dot"] == pytest.approx(slope, abs=5e-6)


def test_that_an_undercut_is_found_where_the_curve_turns_back():
    cam = kc.motion.flat_cam(law(0, LIFT), 0.004)
    s, bend = (values(law(0, LIFT), cam.angle, order) for order in (0, 2))
    wanted = 0.004 + s + bend <= 0
    assert wanted.any()
    found = np.any([(a <= cam.angle) & (cam.angle <= b) for a, b in cam.undercut], axis=0)
    assert (found == wanted).all()
    assert "the cam is undercut at cam angles of" in repr(cam)
    with pytest.raises(kc.ModelError, match=r"undercut .* take a larger base circle"):
        _ = cam.table


def test_that_a_roller_that_is_too_large_undercuts():
    """The path of its centre is the same; the least radius of curvature of that decides."""
    angles, prime = (0, 70, 130, 200, 360), 0.03
    lifts = (0, LIFT, LIFT, 0, 0)
    points = [(a * kc.deg, value) for a, value in zip(angles, lifts, strict=True)]
    steep = kc.motion.sequence(points, "modified sine")
    path = kc.motion.roller_cam(steep, prime - 1e-4, 1e-4)
    convex = float(path.radius_of_curvature[path.radius_of_curvature > 0].min()) + 1e-4
    for roller, is_cut in ((0.99 * convex, False), (1.01 * convex, True)):
        cam = kc.motion.roller_cam(steep, prime - roller, roller)
        assert bool(cam.undercut) == is_cut


LINEAR = kc.motion.law("linear")(kc.t)
WRONG = {
    "open": (lambda: kc.motion.flat_cam(kc.t, 1), "its value is 0 at 0 and 6.28319 at 2 pi"),
    "corner": (lambda: kc.motion.flat_cam(LINEAR, 1), "has corners at t = 0, 1"),
    "symbol": (lambda: kc.motion.flat_cam(sympy.Symbol("h"), 1), "the law contains h"),
    "text": (lambda: kc.motion.flat_cam("t", 1), "'t' is not a number or a SymPy expression"),
    "base": (lambda: kc.motion.roller_cam(0, -1, True), "base is -1: give a positive number"),
    "points": (lambda: kc.motion.flat_cam(0, 1, points=3), "points is 3: give a whole number"),
    "offset": (lambda: kc.motion.roller_cam(0, 1, 0.1, offset=2), "the offset 2 lies beyond"),
    "pivot": (lambda: kc.motion.oscillating_cam(0, 3, 1, 1), "pivot is 3: give a point"),
}


@pytest.mark.parametrize("name", WRONG)
def test_that_what_is_wrong_is_said(name):
    call, message = WRONG[name]
    with pytest.raises(kc.ModelError) as caught:
        call()
    assert message in str(caught.value)
