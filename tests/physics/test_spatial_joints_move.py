"""Every spatial joint moves a mechanism whose motion is known from mechanics, not from its rows.

Axes are inclined, so that nothing is right by symmetry; angles go by the right-hand rule.
"""

from functools import partial
from typing import Any

import numpy as np
import pytest
import sympy
from sympy import acos, asin, atan2, cos, sin, sqrt

import kincompile as kc
from kincompile import spatial
from kincompile.model.bodies import Body
from kincompile.space.catalogue import CONSTRAINTS
from tests.physics.moves import Cases, Moving, assert_that_it_moves, motor

CASES = Cases()
t = kc.t
X, Y, Z = np.eye(3)
O = np.zeros(3)  # noqa: E741
GROWING = 1 + 0.3 * t + 0.2 * t**2
"""What a driver says: it grows, ever faster."""
AXIS, CROSS = np.array([1, 2, 2]) / 3, np.array([2, 1, -2]) / 3
"""An inclined axis, and a direction at a right angle to it."""
THIRD = np.cross(AXIS, CROSS)


def turned(vector: Any, axis: Any, angle: Any) -> Any:
    """Return a vector turned about a unit axis, by the formula of Rodrigues."""
    v, n = sympy.Matrix(vector), sympy.Matrix(axis)
    return v * cos(angle) + n.cross(v) * sin(angle) + n * (n.dot(v) * (1 - cos(angle)))


def place(name: str, vector: Any) -> dict[str, Any]:
    """Return the coordinates of a point, or of the origin of a body, as columns."""
    return {f"{name}.{axis}": item for axis, item in zip("xyz", vector, strict=True)}


def spin(name: str, vector: Any) -> dict[str, Any]:
    """Return an angular velocity as columns."""
    return {f"{name}.omega_{axis}": item for axis, item in zip("xyz", vector, strict=True)}


def held(m: spatial.Mechanism, body: Body) -> Body:
    """Return a body that does not turn, with the orientation of its guess."""
    e = np.array([float(item) for item in body.guess[4:]])
    vector, value = (e, 1) if e.any() else (X, 0)
    m.add(spatial.AbsoluteOrientation(f"hold_{body.name}", body, vector, value))
    return body


def crank(m: spatial.Mechanism, name: str = "crank", law: Any = None) -> Body:
    """Return a body that a motor turns about an inclined axis through the origin."""
    body, law = m.body(name, O, axis=AXIS, angle=0.1), motor() if law is None else law
    m.add(spatial.Revolute(f"pin_{name}", m.ground, O, AXIS, body, O, 3 * AXIS))
    m.add(spatial.RelativeRotation(f"motor_{name}", m.ground, AXIS, CROSS, body, AXIS, CROSS, law))
    return body


def hinged_boom() -> tuple[spatial.Mechanism, Body]:
    """Return a boom that hangs in a hinge without a driver, and has its length along the cross."""
    m = spatial.Mechanism("boom")
    boom = m.body("boom", O, axis=AXIS, angle=0.6)
    m.add(spatial.Revolute("hinge", m.ground, O, AXIS, boom, O, AXIS))
    m.add(spatial.JointAngle("swing", m.ground, AXIS, CROSS, boom, AXIS, CROSS, guess=0.6))
    return m, boom


@CASES.of("RelativeRotation")
def turns_a_crank_by_the_right_hand_rule() -> Moving:
    m = spatial.Mechanism("crank")
    m.point("tip", crank(m), (0.3, -0.2, 0.5))
    rate = sympy.diff(motor(), t)
    return m, place("tip", turned((0.3, -0.2, 0.5), AXIS, motor())) | spin("crank", AXIS * rate)


@CASES.of("Normalization")
def turns_with_parameters_of_length_one() -> Moving:
    m = spatial.Mechanism("crank")
    crank(m)
    half = motor() / 2
    vector = {f"e{k}_crank": AXIS[k - 1] * sin(half) for k in (1, 2, 3)}
    return m, {"e0_crank": cos(half), **vector}


@CASES.of("JointAngle")
def counts_several_turns_of_a_crank() -> Moving:
    m = spatial.Mechanism("crank")
    body = crank(m, law=20 * motor())
    m.add(spatial.JointAngle("turns", m.ground, 2 * AXIS, CROSS, body, AXIS, CROSS, guess=4))
    return m, {"theta_turns": 20 * motor()}


@CASES.of("JointAngle")
def counts_against_a_hinge_whose_axis_points_the_other_way() -> Moving:
    m = spatial.Mechanism("crank")
    body = crank(m)
    m.add(spatial.JointAngle("back", body, -AXIS, CROSS, m.ground, -AXIS, CROSS, guess=0.2))
    return m, {"theta_back": motor()}


@CASES.of("Revolute")
def an_arm_and_a_wrist_about_one_direction() -> Moving:
    m = spatial.Mechanism("robot")
    arm, wrist = crank(m, "arm"), m.body("wrist", CROSS, axis=AXIS, angle=1.2)
    m.add(spatial.Revolute("elbow", arm, CROSS, AXIS, wrist, O, AXIS))
    m.add(spatial.RelativeRotation("motor", arm, AXIS, CROSS, wrist, AXIS, CROSS, GROWING))
    m.point("tip", wrist, CROSS / 2)
    angle = motor() + GROWING
    tip = turned(CROSS, AXIS, motor()) + turned(CROSS / 2, AXIS, angle)
    return m, place("tip", tip) | spin("wrist", AXIS * sympy.diff(angle, t))


@CASES.of("Fixed")
def a_body_welded_on_a_crank() -> Moving:
    m = spatial.Mechanism("weld")
    body, other = crank(m), m.body("other", X, axis=AXIS, angle=0.2)
    m.add(spatial.Fixed("weld", body, X, Z, Y, other, O, Z, Y))
    m.point("tip", other, (0, 0.3, 0.4))
    return m, place("tip", turned((1, 0.3, 0.4), AXIS, motor()))


@CASES.of("Translational")
def slides_out_of_a_boom_that_swings() -> Moving:
    m = spatial.Mechanism("telescope")
    boom, stick = crank(m, "boom"), m.body("stick", CROSS, axis=AXIS, angle=0.2)
    m.add(spatial.Translational("guide", boom, O, CROSS, AXIS, stick, O, CROSS, THIRD))
    m.add(spatial.RelativeTranslation("stroke", boom, CROSS, 2 * CROSS, stick, O, GROWING))
    m.point("tip", stick, AXIS / 2)
    tip = turned(CROSS * (1 + GROWING) + AXIS / 2, AXIS, motor())
    return m, place("tip", tip) | spin("stick", AXIS * sympy.diff(motor(), t))


@CASES.of("RelativeTranslation")
def counts_along_the_axis_from_the_point_on_it() -> Moving:
    m = spatial.Mechanism("slide")
    block = held(m, m.body("block", (1, 1, 1), axis=Y, angle=0.4))
    m.add(spatial.PointOnLine("rail", m.ground, X, AXIS, block, O))
    m.add(spatial.RelativeTranslation("stroke", m.ground, X - Y, 5 * AXIS, block, O, GROWING))
    # The origin is as far along the axis as the point from which it is counted, and C more.
    return m, place("block", X + AXIS * (GROWING + AXIS @ -Y))


@CASES.of("Cylindrical")
def turns_and_slides() -> Moving:
    m = spatial.Mechanism("drill")
    drill = m.body("drill", O, axis=AXIS, angle=0.1)
    m.add(spatial.Cylindrical("bush", m.ground, O, AXIS, drill, O, AXIS))
    m.add(spatial.RelativeRotation("spin", m.ground, AXIS, CROSS, drill, AXIS, CROSS, motor()))
    m.add(spatial.RelativeTranslation("feed", m.ground, O, AXIS, drill, O, GROWING))
    m.point("tip", drill, CROSS)
    return m, place("tip", sympy.Matrix(AXIS * GROWING) + turned(CROSS, AXIS, motor()))


def screw(pitch: float, *, is_turned: bool) -> Moving:
    """Return a screw that is turned, or pushed along its axis; a positive pitch is right-handed."""
    m = spatial.Mechanism("jack")
    spindle = m.body("spindle", AXIS, axis=AXIS, angle=0.1)
    thread = (m.ground, O, AXIS, CROSS, spindle, O, AXIS, CROSS, pitch)
    angle = motor() if is_turned else 2 * sympy.pi * GROWING / pitch
    m.add(spatial.Screw("nut", *thread, guess=float(angle.subs(t, 0))))
    if is_turned:
        turning = (m.ground, AXIS, CROSS, spindle, AXIS, CROSS)
        m.add(spatial.RelativeRotation("motor", *turning, motor()))
    else:
        m.add(spatial.RelativeTranslation("press", m.ground, O, AXIS, spindle, O, GROWING))
    m.point("tip", spindle, CROSS)
    tip = sympy.Matrix(AXIS * angle * pitch / (2 * np.pi)) + turned(CROSS, AXIS, angle)
    rate = AXIS * sympy.diff(angle, t)
    return m, {"theta_nut": angle} | place("tip", tip) | spin("spindle", rate)


@CASES.of("Screw")
def a_right_handed_screw_advances_along_the_thumb() -> Moving:
    return screw(0.7, is_turned=True)


@CASES.of("Screw")
def a_left_handed_screw_goes_back() -> Moving:
    return screw(-0.7, is_turned=True)


@CASES.of("Screw")
def a_screw_that_is_pushed_turns() -> Moving:
    return screw(4.0, is_turned=False)


def two_shafts(bend: float) -> tuple[spatial.Mechanism, Body, Body, Any]:
    """Return two shafts through the origin, the second bent about y, and the second axis.

    A motor turns the first. The second lies on its axis; the joint holds its origin.
    """
    m = spatial.Mechanism("shafts")
    axis = np.array([np.sin(bend), 0, np.cos(bend)])
    first, second = m.body("i"), m.body("j", O, axis=Y, angle=bend)
    m.add(spatial.Revolute("bearing", m.ground, -Z, Z, first, -Z, Z))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, first, Z, X, motor()))
    m.add(spatial.PointOnLine("line", m.ground, O, axis, second, Z))
    return m, first, second, axis


def hooke(bend: float) -> Moving:
    """Return Hooke's joint; the arm of the cross in the fork of the first shaft is along its x."""
    m, first, second, axis = two_shafts(bend)
    m.add(spatial.Universal("cross", first, O, X, second, O, Y))
    rate = sympy.diff(motor(), t)
    # With the first arm square to the plane of the shafts, the second shaft is slowest.
    ratio = np.cos(bend) / (1 - (np.sin(bend) * cos(motor())) ** 2)
    return m, spin("j", axis * rate * ratio)


@CASES.of("Universal")
def hookes_joint_bent_by_half_a_radian() -> Moving:
    return hooke(0.5)


@CASES.of("Universal")
def hookes_joint_bent_by_one_radian() -> Moving:
    return hooke(1.0)


@CASES.of("Universal")
def hookes_joint_that_is_straight() -> Moving:
    return hooke(0.0)


def constant_velocity(bend: float) -> Moving:
    m, first, second, axis = two_shafts(bend)
    m.add(spatial.ConstantVelocity("cv", first, O, Z, X, second, O, Z, X))
    m.point("tip", second, X)
    rate = sympy.diff(motor(), t)
    # The second shaft is the first, bent: in its bent frame it turns as the first in its own.
    return m, spin("j", axis * rate) | place("tip", turned(turned(X, Z, motor()), Y, bend))


@CASES.of("ConstantVelocity")
def a_constant_velocity_joint_that_is_straight() -> Moving:
    return constant_velocity(0.0)


@CASES.of("ConstantVelocity")
def a_constant_velocity_joint_bent_by_a_tenth_of_a_radian() -> Moving:
    return constant_velocity(0.1)


@CASES.of("ConstantVelocity")
def a_constant_velocity_joint_bent_by_half_a_radian() -> Moving:
    return constant_velocity(0.5)


@CASES.of("ConstantVelocity")
def a_constant_velocity_joint_bent_by_one_radian() -> Moving:
    return constant_velocity(1.0)


@CASES.of("ConstantVelocity")
def a_constant_velocity_joint_turned_round_by_half_a_turn() -> Moving:
    """The rows hold there too, which the guess says: as fast, the same way."""
    m, first, second, axis = two_shafts(0.5)
    m.add(spatial.ConstantVelocity("cv", first, O, Z, X, second, O, Z, -X))
    m.point("tip", second, X)
    rate = sympy.diff(motor(), t)
    return m, spin("j", axis * rate) | place("tip", turned(turned(X, Z, motor()), Y, 0.5))


@CASES.of("Planar")
def a_plate_slides_on_an_inclined_table() -> Moving:
    m = spatial.Mechanism("table")
    plate = m.body("plate", X, axis=AXIS, angle=0.2)
    m.add(spatial.Planar("slide", m.ground, O, AXIS, plate, O, AXIS))
    m.add(spatial.RelativeRotation("turn", m.ground, AXIS, CROSS, plate, AXIS, CROSS, motor()))
    m.add(spatial.AbsoluteX("push", plate, O, GROWING))
    m.add(spatial.AbsoluteY("shove", plate, O, t))
    m.point("tip", plate, THIRD)
    origin = sympy.Matrix([GROWING, t, -(GROWING + 2 * t) / 2])  # on x + 2 y + 2 z = 0
    return m, place("tip", origin + turned(THIRD, AXIS, motor()))


@CASES.of("InPlane")
def a_foot_on_an_inclined_floor() -> Moving:
    m = spatial.Mechanism("floor")
    block = held(m, m.body("block", X))
    m.add(spatial.InPlane("floor", m.ground, Z, AXIS, block, -Z / 2))
    m.add(spatial.AbsoluteX("push", block, O, GROWING))
    m.add(spatial.AbsoluteY("shove", block, O, t))
    return m, {"z_block": 1.5 - (GROWING + 2 * t) / 2}


@CASES.of("PointOnLine")
def a_bead_on_a_wire() -> Moving:
    m = spatial.Mechanism("wire")
    bead = held(m, m.body("bead", X))
    m.add(spatial.PointOnLine("wire", m.ground, Y, AXIS, bead, Z / 4))
    m.add(spatial.AbsoluteX("pull", bead, O, GROWING))
    return m, place("bead", (GROWING, 1 + 2 * GROWING, 2 * GROWING - 0.25))


@CASES.of("Spherical")
def a_ball_carries_a_body_that_does_not_turn() -> Moving:
    m = spatial.Mechanism("wheel")
    body, gondola = crank(m), held(m, m.body("gondola", X))
    m.add(spatial.Spherical("ball", body, CROSS, gondola, Z / 2))
    return m, place("gondola", turned(CROSS, AXIS, motor()) - sympy.Matrix(Z) / 2)


@CASES.of("Parallel")
def an_axis_follows_that_of_a_crank() -> Moving:
    m = spatial.Mechanism("top")
    frame, top = crank(m, "frame"), m.body("top", O, axis=AXIS, angle=0.2)
    m.add(spatial.Spherical("foot", m.ground, O, top, O))
    m.add(spatial.Parallel("axes", frame, CROSS, top, 2 * CROSS))
    m.add(spatial.RelativeRotation("spin", frame, CROSS, AXIS, top, CROSS, AXIS, GROWING))
    m.point("tip", top, THIRD)
    return m, place("tip", turned(turned(THIRD, CROSS, GROWING), AXIS, motor()))


@CASES.of("Dot1")
def the_cosine_of_an_angle_grows_while_the_angle_falls() -> Moving:
    m, boom = hinged_boom()
    m.add(spatial.Dot1("cosine", m.ground, 2 * CROSS, boom, 3 * CROSS, 4 * GROWING))
    return m, {"theta_swing": acos(4 * GROWING / 6)}


@CASES.of("Dot2")
def goes_along_a_vector_as_far_as_the_value_by_its_length() -> Moving:
    m = spatial.Mechanism("slide")
    block = held(m, m.body("block", X))
    m.add(spatial.PointOnLine("rail", m.ground, X, AXIS, block, O))
    m.add(spatial.Dot2("way", m.ground, X, 2 * AXIS, block, O, GROWING))
    return m, place("block", X + AXIS * (GROWING / 2))


@CASES.of("AbsoluteDistance")
def a_rope_that_is_let_out_lowers_a_boom() -> Moving:
    m, boom = hinged_boom()
    m.add(spatial.AbsoluteDistance("rope", boom, 2 * CROSS, 3 * THIRD, 2 * GROWING))
    return m, {"theta_swing": asin((13 - 4 * GROWING**2) / 12)}


@CASES.of("Distance")
def a_cylinder_that_extends_lifts_a_boom() -> Moving:
    m, boom = hinged_boom()  # its pins and the cylinder's are an isosceles triangle
    m.add(spatial.Distance("cylinder", m.ground, CROSS, boom, CROSS, GROWING / 2))
    return m, {"theta_swing": 2 * asin(GROWING / 4)}


@CASES.of("AbsoluteOrientation")
def turns_about_the_vector_by_the_right_hand_rule() -> Moving:
    m = spatial.Mechanism("top")
    top = m.body("top", O, axis=AXIS, angle=0.1)
    m.add(spatial.Spherical("foot", m.ground, O, top, O))
    m.add(spatial.AbsoluteOrientation("turn", top, AXIS, sin(motor() / 2)))
    m.point("tip", top, X)
    return m, place("tip", turned(X, AXIS, motor()))


@CASES.of("RevoluteSpherical")
def a_rod_on_a_hinge_holds_a_ball_up() -> Moving:
    m = spatial.Mechanism("stay")
    block = held(m, m.body("block", (1, 0.1, 3)))
    m.add(spatial.RevoluteSpherical("rod", m.ground, O, (0, 2, 0), block, X / 2, 4.0))
    m.add(spatial.AbsoluteX("pull", block, O, GROWING))
    return m, place("block", (GROWING, 0 * t, sqrt(16 - (GROWING + 0.5) ** 2)))


@CASES.of("RevoluteCylindrical")
def a_guide_follows_a_crank_pin() -> Moving:
    """The guide turns about z where it stands; the pin of a crank, 2 away, slides along its x."""
    m = spatial.Mechanism("quick_return")
    wheel, guide = m.body("wheel", 2 * X, axis=Z, angle=0.2), m.body("guide")
    m.add(spatial.Revolute("pin", m.ground, 2 * X, Z, wheel, O, Z))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, wheel, Z, X, motor()))
    m.add(spatial.RevoluteCylindrical("slide", wheel, X, Z, guide, O, X))
    m.add(spatial.PointOnLine("post", m.ground, O, Z, guide, O))
    m.add(spatial.Dot1("upright", m.ground, Z, guide, Y, 0))
    angle = atan2(sin(motor()), 2 + cos(motor()))
    return m, spin("guide", Z * sympy.diff(angle, t)) | {"z_guide": 0 * t}


AXES = {"X": X, "Y": Y, "Z": Z}


def coordinate(kind: str, letter: str) -> Moving:
    """Return a block that is pulled along one of the axes, by a point on a body that moves."""
    m = spatial.Mechanism("block")
    block, base = held(m, m.body("block", X, axis=Y, angle=0.3)), crank(m, "base")
    point, start, carried = (0.1, 0.2, 0.4), (0.3, -0.1, 0.2), sympy.zeros(3, 1)
    way = sympy.Matrix(AXES[letter]) * GROWING
    for axis in "XYZ":
        value = GROWING if axis == letter else 0
        if kind == "Absolute":
            m.add(getattr(spatial, f"Absolute{axis}")(axis, block, point, value))
        else:
            carried = turned(start, AXIS, motor())
            m.add(getattr(spatial, f"Relative{axis}")(axis, base, start, block, point, value))
    return m, place("block", way + carried - turned(point, Y, 0.3))


for KIND in ("Absolute", "Relative"):
    for LETTER in AXES:
        CASES[f"{KIND}{LETTER} pulls_a_block"] = (
            f"{KIND}{LETTER}",
            partial(coordinate, KIND, LETTER),
        )

QUICK = (
    "a_right_handed_screw_advances_along_the_thumb",
    "a_constant_velocity_joint_bent_by_half_a_radian",
)
"""The cases of every run: those whose sense is not plain from a formula."""


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize(
    "name",
    [pytest.param(x, marks=[] if x.endswith(QUICK) else [pytest.mark.slow]) for x in CASES],
)
def test_that_it_moves_as_mechanics_says(name: str) -> None:
    kind, make = CASES[name]
    assert_that_it_moves(CONSTRAINTS[kind], make)


def test_that_every_type_has_a_case() -> None:
    assert {kind for kind, _ in CASES.values()} == CONSTRAINTS.keys()
