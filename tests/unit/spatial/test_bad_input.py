"""What is refused in space, and what the messages say."""

import re
from collections.abc import Callable
from typing import Any

import pytest

import kincompile as kc
from kincompile import spatial
from tests.unit.spatial.test_double_cover import crossed_cranks
from tests.unit.spatial.test_motions import X, Y, Z

O = (0, 0, 0)  # noqa: E741

WRONG: dict[str, tuple[Callable[[Any, Any, Any], Any], str]] = {
    "zero_axis": (
        lambda g, a, b: spatial.Revolute("J", a, O, (0, 0, 0), b, O, Z),
        "Revolute 'J', axis_i: the axis has length zero; give a direction such as (1, 0, 0)",
    ),
    "shafts": (
        lambda g, a, b: spatial.Universal("J", a, O, X, b, O, 2 * X),
        "Universal 'J': axis_i and axis_j are parallel at the guess of a and b, and the joint "
        "keeps them at a right angle",
    ),
    "turned": (  # the guess of c turns its x axis into y
        lambda g, a, b: spatial.Universal("J", a, O, Y, "c", O, -X),
        "axis_i and axis_j are parallel at the guess of a and c",
    ),
    "slide": (
        lambda g, a, b: spatial.RevoluteCylindrical("J", g, O, Z, b, O, Z),
        "RevoluteCylindrical 'J': axis_i and axis_j are parallel at the guess of ground and b",
    ),
    "shafts_apart": (
        lambda g, a, b: spatial.ConstantVelocity("J", a, O, Z, X, b, O, -2 * Z, X),
        "ConstantVelocity 'J': axis_i and axis_j point against each other at the guess of a and b, "
        "and both should point along the shafts the same way; turn one of them round",
    ),
    "crosses": (
        lambda g, a, b: spatial.Translational("J", a, O, X, Y, b, O, X, Y),
        "Translational 'J': cross_i and cross_j are parallel at the guess of a and b",
    ),
    "cross": (
        lambda g, a, b: spatial.Fixed("J", a, O, X, Y, b, O, Z, -3 * Z),
        "Fixed 'J': cross_j lies along axis_j; give a direction at a right angle to the axis",
    ),
    "pair": (
        lambda g, a, b: spatial.Spherical("J", a, (0, 0), b, O),
        "Spherical 'J', point_i: (0, 0) is not a triple (xi, eta, zeta) of coordinates",
    ),
    "planar": (
        lambda g, a, b: kc.Revolute("J", a, (0, 0), b, (0, 0)),
        "Revolute 'J': it is a constraint of bodies in the plane, and those of this mechanism are "
        "in space; take spatial.Revolute",
    ),
    "angle": (
        lambda g, a, b: kc.AbsoluteAngle("J", a, 1),
        "take spatial.RelativeRotation from the ground",
    ),
    "cam": (
        lambda g, a, b: kc.CamFlatFollower("J", a, (0, 0), 1, b, (0, 0), (1, 0)),
        "it has none like it there",
    ),
    "pitch": (
        lambda g, a, b: spatial.Screw("J", a, O, X, Y, b, O, X, Y, 0),
        "Screw 'J', pitch: it is zero",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_messages(case: str) -> None:
    make, message = WRONG[case]
    m = spatial.Mechanism("wrong")
    a, b = m.body("a"), m.body("b", (1, 0, 0))
    m.body("c", O, axis=Z, angle=90 * kc.deg)
    m.add(make(m.ground, a, b))
    with pytest.raises(kc.ModelError, match=re.escape(message)):
        m.system()


def test_that_a_spatial_joint_of_planar_bodies_names_its_twin() -> None:
    m = kc.Mechanism("flat")
    a, b = m.body("a"), m.body("b")
    m.add(spatial.Spherical("J", a, O, b, O))
    m.add(spatial.Distance("K", a, O, b, O, 1))
    with pytest.raises(kc.ModelError, match=r"in space, .* in the plane; take Revolute") as e:
        m.system()
    assert "Distance 'K'" in str(e.value)
    assert "take kincompile.Distance" in str(e.value)


def test_that_points_that_cannot_meet_are_told_by_how_much() -> None:
    m = crossed_cranks(1.0)
    crank, rocker = m.bodies
    m.constraints[2] = spatial.Distance("rod", crank, (1, 0, 0), rocker, (0, 0, 2), 9.0)
    found = kc.solve(kc.compile(m), [0.0])
    assert not found.success
    # crank pin at (cos 0.3, sin 0.3, 0), the rocker's on the circle of radius 2 about (3, 0, 0)
    # in the x-z plane: along x, the farthest at (3 - x)^2 = least over all crank angles
    assert "rod is 9 m; it can be" in found.message
    most = float(re.findall(r"([\d.]+) m at most", found.message)[0])
    x, y = 0.955336489125606, 0.29552020666134
    assert most == pytest.approx((((3 - x) + 2) ** 2 + y**2) ** 0.5, abs=2e-3)
    assert "angle" in found.message
    assert "about (" in found.message


def test_that_inspect_counts_seven_coordinates_a_body() -> None:
    text = str(kc.inspect(crossed_cranks(1.0)))
    assert "14  coordinates         7 for each of 2 bodies" in text
    assert "crank (1.0, 0, 0)" in text
