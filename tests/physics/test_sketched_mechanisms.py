"""Mechanisms drawn with `kc.Sketch` against dyads: circles that meet, in complex numbers."""

# ruff: noqa: N806 - joints have the capital letters of the drawings

import inspect
import math
import runpy

import numpy as np
import pytest

import kincompile as kc


def meet(p, reach_p, q, reach_q, side):
    """Return where two circles meet, on the left of p to q for side = 1, on the right for -1."""
    base = q - p
    along = (np.abs(base) ** 2 + reach_p**2 - reach_q**2) / (2 * np.abs(base))
    across = np.sqrt(reach_p**2 - along**2)
    return p + base / np.abs(base) * (along + side * 1j * across)


def watched(example, link, joint, p=None):
    """Return the path of a joint, from the motion of a link and the place that the sketch says.

    It is that of the point of this name.
    """
    sketch = runpy.run_path(str(example.path))["s"]
    values = {item.name: item.default for item in example.model.system().parameters} | (p or {})
    xi, eta = (
        complex(part.subs(values)) if hasattr(part, "subs") else part
        for part in sketch.place(link, joint)
    )
    t = np.linspace(0, example.model.end, 361)
    solution = kc.solve(example.module, t, p)
    assert solution.success
    origin = solution[f"{link}.x"] + 1j * solution[f"{link}.y"]
    path = origin + np.exp(1j * solution[f"{link}.phi"]) * (xi + 1j * eta)
    point = solution[f"{joint}.x"] + 1j * solution[f"{joint}.y"]
    np.testing.assert_allclose(point, path, rtol=0, atol=1e-12 * np.abs(path).max())
    return t, path


def jansen_foot(t, a=38.0, b=41.5, c=39.3, d=40.1, e=55.8, f=39.4, g=36.7, h=65.7, i=49.0,
                j=50.0, k=61.9, l=7.8, m=15.0):  # fmt: skip  # noqa: E741
    """Return the foot of Jansen's leg: five dyads, one after the other."""
    A = m * np.exp(2j * math.pi * t)
    B = -a - 1j * l
    C = meet(B, b, A, j, +1)
    E = meet(B, c, A, k, -1)
    D = meet(B, d, C, e, +1)
    F = meet(D, f, E, g, -1)
    return meet(E, i, F, h, +1)


@pytest.mark.parametrize("p", [None, {"h": 60.0, "e": 54.0, "m": 14.0, "a": 37.0}])
def test_that_the_foot_of_the_jansen_leg_goes_where_dyads_say(example_named, p):
    t, foot = watched(example_named("jansen"), "leg", "G", p)
    expected = jansen_foot(t, **(p or {}))
    np.testing.assert_allclose(foot, expected, rtol=0, atol=1e-9)
    assert 60 < np.ptp(foot.real) < 90  # a step, not a point


def test_that_the_jansen_leg_takes_at_most_twenty_lines_and_no_law_of_cosines():
    text = inspect.getsource(kc.linkages.jansen).split('"""')[2]
    assert len(text.strip().splitlines()) <= 20
    assert not any(word in text for word in ("sqrt", "cos(", " ** "))
    for number in (38.0, 41.5, 39.3, 40.1, 55.8, 39.4, 36.7, 65.7, 49.0, 50.0, 61.9):
        assert str(number) in text


def test_that_the_foot_of_the_klann_leg_goes_where_dyads_say(example_named):
    t, foot = watched(example_named("klann"), "leg", "G")
    C = 17.5 * np.exp(-0.5j * math.pi * t)
    H = meet(-38.8 - 12.5j, 23.7, C, 38.8, +1)
    F = meet(C, 73.4, H, 35.2, -1)
    E = meet(-14.6 + 41.9j, 34.1, F, 57.7, -1)
    np.testing.assert_allclose(foot, meet(E, 111.7, F, 59.0, +1), rtol=0, atol=1e-9)
    stride = np.sort(foot.imag)[: t.size // 3]  # a third of the turn, the foot is on the ground
    assert np.ptp(stride) < 0.05 * np.ptp(foot.real)


def test_that_the_shaper_has_the_time_ratio_of_its_geometry(example_named):
    example = example_named("shaper")
    solution = kc.solve(example.module, np.linspace(0, 1, 20001))
    lever = solution["lever.phi"]
    r, d = 0.1, 0.45
    assert lever.max() - math.pi / 2 == pytest.approx(math.asin(r / d), abs=1e-8)
    forth = (solution.t[lever.argmax()] - solution.t[lever.argmin()]) % 1.0
    ratio = (math.pi + 2 * math.asin(r / d)) / (math.pi - 2 * math.asin(r / d))
    assert forth / (1 - forth) == pytest.approx(ratio, abs=5e-4)
    D = 0.7 * np.exp(1j * lever) - 1j * d
    R = D.real - np.sqrt(0.3**2 - (0.26 - D.imag) ** 2)
    np.testing.assert_allclose(solution["ram.x"], R, rtol=0, atol=1e-12)
    assert f"{ratio:.6f}" in inspect.cleandoc(example.path.read_text(encoding="utf-8"))


def test_that_the_wheel_of_a_double_wishbone_has_the_camber_of_dyads(example_named):
    t, wheel = watched(example_named("double_wishbone"), "upright", "P")
    A, C, T = 0.35 + 0.2j, 0.4 + 0.44j, 0.46 + 0.62j
    strut = 0.45 + 0.04 * np.sin(math.pi * t)
    S = meet(A, 0.25, T, strut, -1)
    B = A + (S - A) * 0.35 / 0.25
    drawn_B, drawn_D, drawn_P = 0.7 + 0.19j, 0.67 + 0.43j, 0.75 + 0j
    D = meet(C, 0.27, B, abs(drawn_D - drawn_B), +1)
    expected = B + (drawn_P - drawn_B) * (D - B) / (drawn_D - drawn_B)
    np.testing.assert_allclose(wheel, expected, rtol=0, atol=1e-12)


def test_that_a_sketched_gear_train_turns_as_willis_says():
    s = kc.Sketch("planetary", end=1.0)
    sun, planet = s.length("sun_radius", 0.02), s.length("planet_radius", 0.03)
    s.ground(O=(0, 0))
    s.joints(P=(0.03, 0.04))  # 0.05 from O, at an angle
    s.wheel("sun", "O")
    s.link("arm", "O P", sun + planet)
    s.wheel("planet", "P")
    s.gear("inner", "sun", "O", sun, "planet", "P", planet)
    s.gear("outer", "ground", "O", -(sun + 2 * planet), "planet", "P", planet)
    s.drive("sun", kc.pi * kc.t)
    solution = kc.solve(kc.compile(s.mechanism()), np.linspace(0, 1, 11))
    turned = solution["arm.phi"] - solution["arm.phi"][0]
    np.testing.assert_allclose(turned, math.pi * solution.t / (1 + 0.08 / 0.02), atol=1e-12)
    assert solution["arm.phi"][0] == pytest.approx(math.atan2(4, 3))  # as drawn
    assert solution["planet.phi"][0] == pytest.approx(0, abs=1e-12)
