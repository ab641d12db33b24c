"""Legs that no output sees: left out of emitted transmissions, which give what all bodies give.

Beside the table of 60 digits, closed forms, and `kc.transmission`, which solves for all bodies.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial
from tests import transmission_models as models

GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "transmission_golden.json").read_text())
ANKLE = ["left", "right"], ["pitch", "roll"]
FOOT = [f"e{k}_foot" for k in range(4)]
AT = (0, 0, 0)


def emitted(model, ends):
    """Return the emitted module."""
    module: dict[str, Any] = {}
    exec(kc.emit(model, transmission=ends).source, module)
    return module


def poses(module, path):
    """Yield x and J along a path."""
    state, status = module["start"]()
    assert status == 0
    for u in path:
        x, slopes, status = module["transmission"](state, u)
        assert status == 0
        yield np.array(x), np.array(slopes)


def is_ankle(module, *, off=0.0, beyond=0.0):
    """Check that a module is T3-SPU by strokes, whose balls are so far off and beyond them."""
    assert list(module["COORDINATES"]) == FOOT
    table = GOLDEN["T3-SPU"]["poses"]
    rods = np.array([pose["u"] for pose in table])
    strokes = np.sqrt(rods**2 - off**2)
    found = poses(module, strokes + beyond)
    for pose, rod, stroke, (x, slopes) in zip(table, rods, strokes, found, strict=True):
        np.testing.assert_allclose(x, pose["x"], rtol=0, atol=1e-12)
        wanted = pose["J"] * (stroke / rod)
        np.testing.assert_allclose(slopes, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def ankle(joint, end=spatial.Spherical, *, along=(0, 0, -1), off=0.0, beyond=0.0, hung=0.0):
    """Return T3-SPU on cylinders in universal joints, and rods.

    Of a rod the slide ends `beyond` its ball, which is `off` the axis; the cylinder is `hung` so
    far beside its axis.
    """
    m, foot = models.foot_on_a_cross("legs")
    aside = np.array((-along[2], 0, along[0]))
    for name, side in models.SIDES:
        top, ball = (-0.045, side * 0.036, 0.24), (-0.052, side * 0.034, 0.015)
        cylinder, rod = m.body(f"cylinder_{name}", top), m.body(f"rod_{name}", ball)
        given = m.ground, top, (0, 1, 0), cylinder, hung * aside, aside
        m.add(spatial.Universal(f"top_{name}", *given))
        to = off * np.cross(along, aside) - beyond * np.array(along)
        if end is spatial.Universal:
            m.add(end(f"ball_{name}", foot, ball, (1, 0, 0), rod, to, (0, 1, 0)))
        else:
            m.add(end(f"ball_{name}", foot, ball, rod, to))
        if joint is spatial.Translational:
            across = np.cross(along, aside)
            m.add(joint(f"slide_{name}", cylinder, AT, along, aside, rod, AT, along, across))
        else:
            m.add(joint(f"slide_{name}", cylinder, AT, along, rod, AT, along))
        m.add(spatial.RelativeTranslation(name, cylinder, AT, along, rod, AT, 0.225 + beyond))
    return m


def test_rods_between_balls_are_left_out():
    module = emitted(models.ankle_with_rods(), ANKLE)
    assert list(module["COORDINATES"]) == FOOT
    path = [[-length for length in pose["u"]] for pose in GOLDEN["T3-SPU"]["poses"]]
    for pose, (x, slopes) in zip(GOLDEN["T3-SPU"]["poses"], poses(module, path), strict=True):
        np.testing.assert_allclose(x, pose["x"], rtol=0, atol=1e-13)
        np.testing.assert_allclose(-slopes, pose["J"], rtol=1e-9, atol=1e-11)


def test_a_rod_may_turn_in_its_cylinder_and_end_beyond_its_ball():
    is_ankle(emitted(ankle(spatial.Cylindrical, beyond=0.1), ANKLE), beyond=0.1)


def test_a_ball_beside_the_axis_is_at_a_distance_of_both_and_any_axis_will_do():
    turned = ankle(spatial.Translational, along=(0.6, 0, -0.8), off=0.02)
    is_ankle(emitted(turned, ANKLE), off=0.02)


def test_links_between_hinges_are_distances():
    module = emitted(models.crank_rocker(), (["motor"], ["rocker.phi"]))
    assert module["COORDINATES"] == ("phi_rocker",)
    module = emitted(models.five_bar(), (["motor_1", "motor_2"], ["end"]))
    assert module["COORDINATES"] == ("phi_rod_1",)
    table = GOLDEN["T6"]["poses"][:2]
    for pose, (x, slopes) in zip(table, poses(module, [x["u"] for x in table]), strict=True):
        np.testing.assert_allclose(x, pose["x"], rtol=0, atol=1e-13)
        np.testing.assert_allclose(slopes, pose["J"], rtol=1e-9, atol=1e-11)


def test_lengths_stay_parameters():
    """T1b by the parameters of T1a."""
    module = emitted(models.crank_rocker(), (["motor"], ["rocker.phi"]))
    p = [GOLDEN["T1b"]["parameters"][x] for x in "abcd"]
    one, other = GOLDEN["T1b"]["poses"][1:3]
    state, status = module["start"](p, one["u"], one["x"])
    assert status == 0
    x, slopes, _ = module["transmission"](state, other["u"])
    np.testing.assert_allclose(x, other["x"], rtol=0, atol=1e-13)
    np.testing.assert_allclose(slopes, other["J"], rtol=1e-10)


def lift(base=0.4, offset=0.1):
    """Return an arm and a cylinder in the plane, whose rod goes on by an offset."""
    m = kc.Mechanism("lift")
    length = m.parameter("offset", offset, "m")
    places = ("arm", (0, 0, 1.0)), ("cylinder", (base, 0, 2.2)), ("rod", (0.3, 0.2, 2.2))
    arm, cylinder, rod = (m.body(*x) for x in places)
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.Revolute("A", m.ground, (base, 0), cylinder, (0, 0)))
    slide = cylinder, (0, 0), (1, 0), rod, (0, 0)
    m.add(kc.Translational("slide", *slide, (1, 0)))
    m.add(kc.TranslationalDistance("stroke", *slide, 0.2))
    m.add(kc.Revolute("B", arm, (0.3, 0), rod, (length, 0)))
    return m


def test_a_cylinder_in_the_plane_is_the_law_of_cosines():
    m = lift()
    module = emitted(m, (["stroke"], ["phi_arm"]))
    assert module["COORDINATES"] == ("phi_arm",)
    strokes = np.linspace(0.1, 0.5, 9)
    for stroke, (x, _) in zip(strokes, poses(module, strokes[:, np.newaxis]), strict=True):
        cosine = (0.3**2 + 0.4**2 - (stroke + 0.1) ** 2) / (2 * 0.3 * 0.4)
        assert abs(x[0] - math.acos(cosine)) < 1e-12


def test_a_stroke_does_not_pass_through_zero_to_another_assembly():
    """The square of a stroke is that of the negative one; its points meet in between."""
    m = lift(base=0.3, offset=0.0)
    strokes = np.array([[0.2], [0.15], [0.12], [0.01], [0.0], [-0.01], [-0.15]])
    module = emitted(m, (["stroke"], ["phi_arm"]))
    assert module["COORDINATES"] == ("phi_arm",)
    state, _ = module["start"]()
    statuses = [module["transmission"](state, u)[2] for u in strokes]
    assert statuses == [0, 0, 0, 0, 2, 2, 2]
    state, _ = module["start"]()
    assert module["transmission_batch"](state, strokes)[2].tolist() == statuses


def sideways(angle):
    """Return a slider-crank in space: its rod ends in a cross, turned by an angle to the rod."""
    m, z = spatial.Mechanism("sideways"), (0, 0, 1)
    arm, block, rod = (m.body(name, (x, 0, 0)) for name, x in (("a", 0), ("b", 1.0), ("c", 0.3)))
    m.add(spatial.Revolute("O", m.ground, AT, z, arm, AT, z))
    m.add(spatial.Translational("S", m.ground, AT, (1, 0, 0), (0, 1, 0), block, AT, (1, 0, 0), z))
    m.add(spatial.Spherical("B", arm, (0.3, 0, 0), rod, AT))
    own = math.cos(angle), math.sin(angle), 0
    m.add(spatial.Universal("C", block, (0, 0, 0.1), z, rod, (0.8, 0, 0), own))
    return m


def test_a_rod_that_its_cross_does_not_let_turn_to_every_side_stays():
    """A cross whose axis is oblique to the rod ends its way; one across it does not."""
    ends = ["e3_a"], ["b.x"]
    assert "e0_c" not in emitted(sideways(math.pi / 2), ends)["COORDINATES"]
    oblique = sideways(1.2)
    assert "e0_c" in emitted(oblique, ends)["COORDINATES"]


@pytest.mark.slow
def test_a_rod_whose_turn_counts_stays():
    """Both ends are beside the axis about which universal joints turn the rod."""
    m = ankle(spatial.Cylindrical, spatial.Universal, off=0.02, hung=0.03)
    module = emitted(m, ANKLE)
    assert set(FOOT) < set(module["COORDINATES"])
    f = kc.transmission(m, *ANKLE)
    path = f.home.u + np.array([[0.0, 0.0], [0.004, -0.003], [0.008, 0.002]])
    wanted = f.at(path)
    assert wanted.success
    for x, slopes, found in zip(wanted.x, wanted.J, poses(module, path), strict=True):
        np.testing.assert_allclose(found[0], x, rtol=0, atol=1e-10)
        np.testing.assert_allclose(found[1], slopes, rtol=0, atol=1e-7 * np.abs(slopes).max())


def test_what_an_output_sees_stays():
    ends = ["left", "right"], ["pitch", "rod_left.x"]
    found = emitted(models.ankle_with_rods(), ends)["COORDINATES"]
    assert {"e0_rod_left", "e0_cylinder_left"} <= set(found)
    assert "e0_rod_right" not in found


@pytest.mark.parametrize("tied", [False, True])
def test_a_linkage_beside_that_no_input_moves_is_left_out(tied):
    alone, both = models.crank_rocker(), models.crank_rocker()
    other = both.body("other", (0.1, 0, 0.3))
    both.add(kc.Revolute("Q", both.ground, (0.1, 0), other, (0, 0)))
    rocker = next(body for body in both.bodies if body.name == "rocker")
    angle = both.parameter("angle", 0.3, "rad")
    both.add(kc.RelativeAngle("tie", rocker if tied else both.ground, other, angle))
    ends = ["motor"], ["rocker.phi"]
    found, wanted = emitted(both, ends), emitted(alone, ends)
    assert ("x_other" in found["COORDINATES"] or "phi_other" in found["COORDINATES"]) is tied
    path = [[1.5 + 0.1 * k] for k in range(9)]
    for here, there in zip(poses(found, path), poses(wanted, path), strict=True):
        np.testing.assert_allclose(here[0], there[0], rtol=0, atol=1e-13)
        np.testing.assert_allclose(here[1], there[1], rtol=1e-9)
