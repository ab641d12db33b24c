"""Every planar joint moves a mechanism whose motion is known from mechanics, not from its rows.

Which way a shaft turns, which way a value counts, on which side a point is: rows that are derived
without a slip say nothing of that.
"""

import numpy as np
import pytest
import sympy
from sympy import acos, asin, atan2, cos, sin, sqrt

import kincompile as kc
from kincompile.model.bodies import Body
from kincompile.model.catalogue import CONSTRAINTS
from tests.physics.moves import Cases, Moving, assert_that_it_moves, motor

CASES = Cases()
t, O = kc.t, (0, 0)  # noqa: E741
GROWING = 1 + 0.3 * t + 0.2 * t**2
"""What a driver says: it grows, ever faster."""


def ladder() -> tuple[kc.Mechanism, Body]:
    """Return a ladder of length 4 whose top stands on a wall above its foot, without a driver."""
    m = kc.Mechanism("ladder")
    rod = m.body("rod", (0.5, 1.9, 1.8))
    m.add(kc.AbsoluteY("floor", rod, (-2, 0), 0))
    return m, rod


@CASES.of("AbsoluteX")
def pulls_the_foot_of_a_ladder_to_the_right() -> Moving:
    m, rod = ladder()
    m.add(kc.AbsoluteX("wall", rod, (2, 0), 0))
    m.add(kc.AbsoluteX("pull", rod, (-2, 0), GROWING))
    return m, {
        "x_rod": GROWING / 2,
        "y_rod": sqrt(16 - GROWING**2) / 2,
        "phi_rod": kc.pi - acos(GROWING / 4),
    }


@CASES.of("AbsoluteY")
def lifts_the_top_of_a_ladder() -> Moving:
    m, rod = ladder()
    m.add(kc.AbsoluteX("wall", rod, (2, 0), 0))
    m.add(kc.AbsoluteY("lift", rod, (2, 0), GROWING))
    return m, {"y_rod": GROWING / 2, "phi_rod": kc.pi - asin(GROWING / 4)}


def crank(m: kc.Mechanism, name: str = "crank", at: tuple[float, float] = O) -> Body:
    """Return a body that turns about a pin on the ground."""
    body: Body = m.body(name, (*at, 0.2))
    m.add(kc.Revolute(f"pin_{name}", m.ground, at, body, O))
    return body


@CASES.of("AbsoluteAngle")
def turns_a_crank_counterclockwise() -> Moving:
    m = kc.Mechanism("crank")
    body = crank(m, at=(1, 2))
    m.add(kc.AbsoluteAngle("motor", body, motor()))
    m.point("tip", body, (0.5, 0))
    return m, {"tip.x": 1 + cos(motor()) / 2, "tip.y": 2 + sin(motor()) / 2}


@CASES.of("AbsoluteDistance")
def a_rope_that_is_let_out_lowers_a_boom() -> Moving:
    m = kc.Mechanism("boom")
    boom = crank(m, "boom")
    m.add(kc.AbsoluteDistance("rope", boom, (2, 0), (0, 3), 2 * GROWING))
    return m, {"phi_boom": asin((13 - 4 * GROWING**2) / 12)}


def table_and_tool() -> tuple[kc.Mechanism, Body, Body]:
    """Return a table that moves to the right, and a tool that does not turn."""
    m = kc.Mechanism("machine")
    table, tool = m.body("table", (0, 0, 0.2)), m.body("tool", (1, 1, 0.5))
    m.add(kc.AbsoluteX("feed", table, O, t**2))
    m.add(kc.AbsoluteY("bed", table, O, 0))
    m.add(kc.AbsoluteAngle("tilt", table, 0.2))
    m.add(kc.AbsoluteAngle("upright", tool, 0.5))
    return m, table, tool


@CASES.of("RelativeX")
def carries_a_tool_to_the_right_of_a_table() -> Moving:
    m, table, tool = table_and_tool()
    m.add(kc.RelativeX("offset", table, (0.4, 0), tool, (0, 0.3), GROWING))
    m.add(kc.AbsoluteY("height", tool, O, 1))
    start = 0.4 * np.cos(0.2) + 0.3 * np.sin(0.5)
    return m, {"x_tool": t**2 + GROWING + start}


@CASES.of("RelativeY")
def lifts_a_tool_above_a_table() -> Moving:
    m, table, tool = table_and_tool()
    m.add(kc.RelativeY("height", table, (0.4, 0), tool, (0, 0.3), GROWING))
    m.add(kc.RelativeX("offset", table, O, tool, O, 0))
    start = 0.4 * np.sin(0.2) - 0.3 * np.cos(0.5)
    return m, {"y_tool": GROWING + start, "x_tool": t**2}


@CASES.of("RelativeAngle")
def turns_a_wrist_counterclockwise_on_an_arm() -> Moving:
    m = kc.Mechanism("robot")
    arm, wrist = crank(m, "arm"), m.body("wrist", (1, 0, 1))
    m.add(kc.Revolute("elbow", arm, (1, 0), wrist, O))
    m.add(kc.AbsoluteAngle("shoulder", arm, t))
    m.add(kc.RelativeAngle("motor", arm, wrist, GROWING))
    m.point("tip", wrist, (0.5, 0))
    return m, {
        "phi_wrist": t + GROWING,
        "tip.x": cos(t) + cos(t + GROWING) / 2,
        "tip.y": sin(t) + sin(t + GROWING) / 2,
    }


@CASES.of("Distance")
def a_cylinder_that_extends_lifts_a_boom() -> Moving:
    m = kc.Mechanism("lift")
    boom = crank(m, "boom")  # its pins and the cylinder's are an isosceles triangle
    m.add(kc.Distance("cylinder", m.ground, (1, 0), boom, (1, 0), GROWING / 2))
    return m, {"phi_boom": 2 * asin(GROWING / 4)}


@CASES.of("Revolute")
def the_coupler_of_a_parallelogram_goes_round_without_turning() -> Moving:
    m = kc.Mechanism("parallelogram")
    first, second = crank(m, "first"), crank(m, "second", at=(2, 0))
    coupler = m.body("coupler", (1, 0.2, 0))
    m.add(kc.Revolute("A", first, (1, 0), coupler, O))
    m.add(kc.Revolute("B", second, (1, 0), coupler, (2, 0)))
    m.add(kc.AbsoluteAngle("motor", first, motor()))
    return m, {"x_coupler": cos(motor()), "y_coupler": sin(motor()), "phi_coupler": 0 * t,
               "phi_second": motor()}  # fmt: skip


@CASES.of("Revolute")
def a_slider_crank() -> Moving:
    m = kc.Mechanism("engine")
    wheel, rod, piston = crank(m, "wheel"), m.body("rod", (1, 0, 0)), m.body("piston", (3, 0, 0))
    m.add(kc.Revolute("A", wheel, (1, 0), rod, O))
    m.add(kc.Revolute("B", rod, (3, 0), piston, O))
    m.add(kc.Translational("bore", m.ground, O, (1, 0), piston, O, (1, 0)))
    m.add(kc.AbsoluteAngle("motor", wheel, motor()))
    return m, {"x_piston": cos(motor()) + sqrt(9 - sin(motor()) ** 2),
               "phi_rod": -asin(sin(motor()) / 3)}  # fmt: skip


def telescope(axis_j: tuple[float, float], turned: float) -> Moving:
    """Return a stick that slides out of a boom while the boom swings up: polar coordinates."""
    m = kc.Mechanism("telescope")
    boom, stick = crank(m, "boom"), m.body("stick", (1, 0, turned))
    m.add(kc.AbsoluteAngle("swing", boom, motor()))
    m.add(kc.Translational("guide", boom, (0.1, 0), (2, 0), stick, O, axis_j))
    m.add(kc.TranslationalDistance("stroke", boom, (0.2, 0.7), (3, 0), stick, O, GROWING))
    out = 0.2 + GROWING
    return m, {"x_stick": out * cos(motor()), "y_stick": out * sin(motor()),
               "phi_stick": motor() + turned}  # fmt: skip


@CASES.of("Translational")
def slides_out_of_a_boom_that_swings() -> Moving:
    return telescope((1, 0), 0)


@CASES.of("Translational")
def slides_with_axes_that_point_oppositely() -> Moving:
    return telescope((-1, 0), 0)


@CASES.of("TranslationalDistance")
def counts_along_the_axis_from_the_point_on_it() -> Moving:
    return telescope((0, 1), -np.pi / 2)


@CASES.of("RevoluteTranslational")
def a_pin_goes_to_the_left_of_a_slot_that_turns() -> Moving:
    m = kc.Mechanism("slot")
    lever, follower = crank(m, "lever"), m.body("follower", (1, 1, 0))
    m.add(kc.AbsoluteAngle("motor", lever, motor()))
    m.add(kc.AbsoluteX("guide", follower, (0.3, 0), 1))
    m.add(kc.AbsoluteAngle("upright", follower, 0))
    m.add(kc.RevoluteTranslational("slot", lever, (0.4, 0), (2, 0), follower, (0.3, 0), GROWING))
    return m, {"y_follower": (GROWING + sin(motor())) / cos(motor())}


def gears(radius_i: float, radius_j: float, rate: float) -> Moving:
    """Return two gears on fixed pins: the second turns at so much of the rate of the first."""
    m = kc.Mechanism("gears")
    first, second = crank(m, "first"), crank(m, "second", at=(radius_i + radius_j, 0))
    m.add(kc.Gear("mesh", first, O, radius_i, 0, second, O, radius_j, kc.pi))
    m.add(kc.AbsoluteAngle("motor", first, motor(0)))
    return m, {"phi_second": rate * motor(0)}


@CASES.of("Gear")
def external_gears_turn_opposite_ways() -> Moving:
    return gears(0.4, 0.6, -0.4 / 0.6)


@CASES.of("Gear")
def a_ring_gear_turns_as_its_pinion() -> Moving:
    return gears(0.4, -1.0, 0.4)


@CASES.of("Gear")
def a_pinion_turns_as_its_ring_gear() -> Moving:
    return gears(-1.0, 0.25, 4)


@CASES.of("Gear")
def a_planet_rolls_around_a_fixed_sun() -> Moving:
    m = kc.Mechanism("planet")
    arm, planet = crank(m, "arm"), m.body("planet", (1.5, 0.3, 0.6))
    m.add(kc.Revolute("pin", arm, (1.5, 0), planet, O))
    m.add(kc.Gear("mesh", m.ground, O, 1, 0, planet, O, 0.5, kc.pi))
    m.add(kc.AbsoluteAngle("motor", arm, motor()))
    # The point at the sun stands still: v = 1.5 w of the centre is 0.5 w of the planet.
    return m, {"phi_planet": 3 * motor()}


@CASES.of("RackAndPinion")
def a_wheel_rolls_up_a_ramp() -> Moving:
    m, radius, slope = kc.Mechanism("ramp"), 0.5, 0.3
    along = (2 * np.cos(slope), 2 * np.sin(slope))
    wheel = m.body("wheel", (1, 1, 0))
    m.add(kc.RackAndPinion("roll", m.ground, O, along, slope, wheel, O, radius, 1.2))
    m.add(kc.TranslationalDistance("pull", m.ground, O, along, wheel, O, GROWING))
    # At Q, 2 up the ramp, the mark of the wheel points down at the ramp.
    at_q = slope - sympy.pi / 2 + 2 * sympy.pi - 1.2
    return m, {"phi_wheel": at_q + (2 - GROWING) / radius,
               "x_wheel": GROWING * np.cos(slope) - radius * np.sin(slope)}  # fmt: skip


@CASES.of("RackAndPinion")
def a_pinion_that_turns_counterclockwise_pushes_a_rack_below_it_to_the_right() -> Moving:
    m = kc.Mechanism("steering")
    rack, pinion = m.body("rack", (0, -0.5, 0)), crank(m, "pinion")
    m.add(kc.RackAndPinion("mesh", rack, O, (1, 0), 0, pinion, O, 0.5, 3 * kc.pi / 2))
    m.add(kc.AbsoluteAngle("motor", pinion, motor()))
    m.add(kc.AbsoluteAngle("level", rack, 0))
    return m, {"x_rack": 0.5 * motor() - 1, "y_rack": -0.5 + 0 * t}


ECCENTRIC = 0.3
"""How far the centre of a round cam is from its shaft."""


def round_cam() -> tuple[kc.Mechanism, Body, Body]:
    """Return a cam that a motor turns, and a follower that goes up and down above it."""
    m = kc.Mechanism("cam")
    cam, follower = crank(m, "cam"), m.body("follower", (0, 1.4, 0))
    m.add(kc.AbsoluteAngle("motor", cam, motor()))
    m.add(kc.AbsoluteX("guide", follower, O, 0))
    m.add(kc.AbsoluteAngle("upright", follower, 0))
    return m, cam, follower


@CASES.of("CamFollower")
def a_roller_on_an_eccentric_disc() -> Moving:
    m, cam, follower = round_cam()
    m.add(kc.CamFollower("touch", cam, (ECCENTRIC, 0), 1.0, follower, O, 0.4, guess=(1.4, -1.6)))
    height = ECCENTRIC * sin(motor()) + sqrt(1.4**2 - (ECCENTRIC * cos(motor())) ** 2)
    up = atan2(height - ECCENTRIC * sin(motor()), -ECCENTRIC * cos(motor()))  # centre to centre
    return m, {"y_follower": height, "alpha_i_touch": up - motor(),
               "alpha_j_touch": up - sympy.pi}  # fmt: skip


@CASES.of("CamFlatFollower")
def a_flat_follower_on_an_eccentric_disc() -> Moving:
    m, cam, follower = round_cam()
    m.add(kc.CamFlatFollower("touch", cam, (ECCENTRIC, 0), 1.0, follower, O, (1, 0), guess=1.4))
    return m, {"y_follower": 1 + ECCENTRIC * sin(motor()), "alpha_touch": sympy.pi / 2 - motor()}


@CASES.of("PointFollower")
def a_knife_edge_on_a_cam() -> Moving:
    m, cam, follower = round_cam()
    profile = 1 + ECCENTRIC * cos(kc.alpha)
    m.add(kc.PointFollower("touch", follower, (0, -0.2), cam, O, profile, guess=1.4))
    top = sympy.pi / 2 - motor()  # what of the turning cam points up
    return m, {"y_follower": profile.subs(kc.alpha, top) + 0.2, "alpha_touch": top}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", CASES)
def test_that_it_moves_as_mechanics_says(name: str) -> None:
    kind, make = CASES[name]
    assert_that_it_moves(CONSTRAINTS[kind], make)


def test_that_every_type_has_a_case() -> None:
    assert {kind for kind, _ in CASES.values()} == CONSTRAINTS.keys()
