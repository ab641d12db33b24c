"""Suspension outputs against the instant centre of a wishbone in one plane, and a mirrored wheel.

`test_examples.py` has all of them over the motion of a double wishbone, by its own geometry.
"""

from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial
from kincompile.spatial import outputs

A, C, D, F, P = (0.35, 0.2), (0.7, 0.15), (0.42, 0.46), (0.66, 0.44), (0.77, 0.0)
TIE = 0.25  # height of the inner end of the tie rod
ANGLES = ("camber", "toe", "caster", "kingpin")


def crossing(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return where the line through a and b meets that through c and d."""
    a, b, c, d = (np.array(x, dtype=float) for x in (a, b, c, d))
    s, _ = np.linalg.solve(np.column_stack((b - a, c - d)), c - a)
    return a + s * (b - a)


def wishbone(side: int, back: float = 0.0) -> spatial.Mechanism:
    """Arms and tie rod that turn about lines along x; seen from behind they meet in one point."""
    centre = crossing(A, C, D, F)
    inner = np.array((0.4, TIE))
    outer = inner + 0.3 * (inner - centre) / np.linalg.norm(inner - centre)
    s = spatial.Sketch("wishbone", end=0.1, points=3)

    def at(x: float, place: Any) -> Any:
        return x, side * float(place[0]), float(place[1])

    s.ground(A=at(0.1, A), B=at(-0.1, A), D=at(0.1, D), E=at(-0.1, D), G=at(-0.12, inner))
    s.joints(C=at(0, C), F=at(-back, F), H=at(-0.12, outer), P=at(0, P), W=at(0, (0.75, 0.3)))
    s.link("lower", "A B C")
    s.link("upper", "D E F")
    upright = s.link("upright", "C F H P W")
    s.rod("tie", "G H")
    s.drive("W.z", 0.3 + kc.t)
    m = s.mechanism()
    spin, (c, f, p) = upright.direction((0, 1, 0)), (s.point(name) for name in "CFP")
    for name, value in (
        ("camber", outputs.camber(spin, side)),
        ("toe", outputs.toe(spin, side)),
        ("caster", outputs.caster(c, f)),
        ("kingpin", outputs.kingpin(c, f, side)),
    ):
        m.output(name, value, "rad")
    m.output("scrub", outputs.scrub_radius(c, f, p, side))
    m.output("trail", outputs.trail(c, f, p))
    m.output("track", outputs.track(p, side))
    m.output("height", outputs.roll_centre_height(p))
    m.output("ratio", outputs.motion_ratio(outputs.distance(c, at(0.02, (0.5, 0.6))), p))
    return m


def test_the_roll_centre_lies_on_the_line_from_the_instant_centre() -> None:
    found = kc.solve(kc.compile(wishbone(1)), [0.0])
    centre = crossing(A, C, D, F)
    expected = crossing(P, centre, (0, 0), (0, 1))[1]
    assert found["height"][0] == pytest.approx(expected, abs=1e-12)
    # the wheel turns about that centre: camber changes by 1 rad for its distance from the centre
    across = 0.75 - centre[0]
    assert found["camber_dot"][0] == pytest.approx(-1 / across, abs=1e-12)
    upright = [found[name][0] for name in ("camber", "toe", "caster", "trail")]
    np.testing.assert_allclose(upright, 0, atol=1e-14)
    assert found["kingpin"][0] == pytest.approx(np.arctan2(0.7 - 0.66, 0.44 - 0.15), abs=1e-14)
    assert found["scrub"][0] == pytest.approx(0.77 - (0.7 + 0.15 * 0.04 / 0.29), abs=1e-14)


def test_that_a_right_wheel_has_the_signs_of_a_left_one() -> None:
    left, right = (
        kc.solve(kc.compile(wishbone(side, 0.03)), [0.0, 0.03, 0.06]) for side in (1, -1)
    )
    assert left["caster"][0] == pytest.approx(np.arctan2(0.03, 0.29), abs=1e-14)
    assert left["trail"][0] == pytest.approx(0.15 * 0.03 / 0.29, abs=1e-14)
    for name in (*ANGLES, "scrub", "trail", "track", "height", "ratio"):
        np.testing.assert_allclose(right[name], left[name], rtol=0, atol=1e-12, err_msg=name)
        assert np.ptp(left[name]) > 1e-6 or name == "toe", name
    np.testing.assert_allclose(right["W.y"], -left["W.y"], rtol=0, atol=1e-12)


def test_that_a_side_is_a_sign() -> None:
    with pytest.raises(kc.ModelError, match="give 1 for a left one, -1 for a right"):
        outputs.toe((0, 1, 0), side=0)
