"""Freedoms that nothing sees are held, and everything else moves as it would without them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial
from kincompile.further import held_system
from kincompile.model.expressions import evaluate
from kincompile.model.mechanism import changed
from tests import transmission_models

X, Y, Z, O = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)  # noqa: E741 - the origin
EXAMPLES = Path(__file__).parents[3] / "examples" / "space"
T = np.linspace(0, 2, 17)
ENDS = np.array([(0.1, 0, 0), (0.3, 0.05, 0.13)])
ROD = "rod may spin about its own axis; nothing sees it, so it is held"


def cranks(name, place, axis, *, motor=True, turned=0.0, **masses):
    """Return a crank about z and a rocker about an axis, to be joined by a rod."""
    m = spatial.Mechanism(name, end=2.0)
    crank = m.body("crank", O, **masses)
    rocker = m.body("rocker", place, axis=axis, angle=turned, **masses)
    m.add(spatial.Revolute("O", m.ground, O, Z, crank, O, Z))
    m.add(spatial.Revolute("P", m.ground, place, axis, rocker, O, axis))
    if motor:
        m.add(spatial.RelativeRotation("motor", m.ground, Z, X, crank, Z, X, kc.pi * kc.t))
    return m, crank, rocker


def add_rod(m, crank, rocker, ends, local, how, **masses):
    """Join two cranks at the ends of a rod: by a distance, or by a body with two balls."""
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    if how == "distance":
        m.add(spatial.Distance("rod", crank, local[0], rocker, local[1], length))
        return
    rod = m.body("rod", tuple(ends[0]), x=tuple(way), y=(0.2, 1, 0.1), **masses)
    m.add(spatial.Spherical("A", crank, local[0], rod, O))
    m.add(spatial.Spherical("B", rod, (length, 0, 0), rocker, local[1]))
    if how == "by hand":
        m.add(spatial.Dot1("hand", m.ground, Z, rod, Y, 0))


def rssr(how="balls", *, motor=True):
    """Return a crank, a rocker about a skew axis, and a rod between balls."""
    m, crank, rocker = cranks("rssr", (0.3, 0.05, -0.12), Y, motor=motor)
    add_rod(m, crank, rocker, ENDS, ((0.1, 0, 0), (0, 0, 0.25)), how)
    m.add(spatial.JointAngle("swing", m.ground, Y, Z, rocker, Y, Z))
    return m


def drag_link(how):
    """Return two cranks that make whole turns about parallel axes, and the rod with them."""
    m, crank, rocker = cranks("drag_link", (0.05, 0, 0.02), Z, turned=np.pi / 2)
    ends = np.array([(0.2, 0, 0), (0.05, 0.2, 0.02)])
    add_rod(m, crank, rocker, ends, ((0.2, 0, 0), (0.2, 0, 0)), how)
    m.add(spatial.JointAngle("swing", m.ground, Z, X, rocker, Z, X, guess=1.5))
    return m


def moved(model):
    """Return the motion of a model."""
    return kc.solve(kc.compile(model), T)


@pytest.fixture(scope="module")
def held():
    """Return the motion of the linkage whose rod is held."""
    return moved(rssr())


def assert_the_same(found, wanted, columns, orders=("", "_dot", "_ddot")):
    assert found.success, found.message
    for name in columns:
        for order in orders:
            other = wanted[f"{name}{order}"]
            np.testing.assert_allclose(found[f"{name}{order}"], other, atol=2e-11)


def test_that_a_rod_between_balls_is_held_and_everything_else_moves_as_with_a_distance(held):
    assert_the_same(held, moved(rssr("distance")), ["theta_swing", "e0_crank", "x_rocker"])
    assert held.message.endswith(f" {ROD}.")
    assert "held" not in moved(rssr("distance")).message


def test_that_points_on_the_axis_are_those_of_a_rod_that_is_held_by_hand(held):
    by_hand = moved(rssr("by hand"))
    assert_the_same(held, by_hand, ["x_rod", "y_rod", "z_rod"])
    found, wanted = (spatial.orientation(x, "rod").apply(X) for x in (held, by_hand))
    np.testing.assert_allclose(found, wanted, atol=1e-12)
    assert "held" not in by_hand.message


def test_that_a_rod_that_makes_a_whole_turn_is_held_as_well_as_by_hand():
    found, by_hand = (moved(drag_link(how)) for how in ("balls", "by hand"))
    assert_the_same(found, by_hand, ["theta_swing", "x_rod", "y_rod"])
    directions = spatial.orientation(found, "rod").apply(X)
    assert (directions @ directions[0]).min() < -0.95
    assert found.condition.max() < 1.5 * by_hand.condition.max()


def test_that_inspect_names_what_is_held_and_what_would_hold_it_otherwise():
    found = kc.inspect(rssr(motor=False))
    assert found.held == ("spin of rod",)
    text = found.to_text()
    assert f"{ROD} by held_rod. To choose how, take a Universal in place of A." in text
    assert "with 1 held freedom" in text
    assert [x.text for x in found.missing_drivers] == ["RelativeRotation of crank at O"]
    assert kc.inspect(rssr("by hand")).held == ()


def test_that_the_derivation_has_the_equation_and_says_why():
    text = kc.derivation(rssr(), constraint="held_rod").to_markdown()
    assert f"{ROD}. Any numbers in it would do." in text


def with_rod(change):
    """Return the linkage with something more on its rod."""
    m = rssr()
    change(m, m.bodies[-1])
    return m


def add_wheel(m, rod):
    wheel = m.body("wheel", tuple(ENDS[0]))
    m.add(spatial.Revolute("W", rod, (0.1, 0, 0), X, wheel, O, X))


def add_knob(m, crank):
    """Add a ball in two sockets, with three freedoms of its own."""
    knob, cap = m.body("knob", tuple(ENDS[0])), m.body("cap", tuple(ENDS[0]))
    m.add(spatial.Spherical("K", crank, (0.1, 0, 0), knob, O))
    m.add(spatial.Spherical("L", knob, O, cap, O))
    for name, *axes in (("a", X, Y), ("b", X, Z), ("c", Y, Z)):
        m.add(spatial.Dot1(name, m.ground, axes[0], cap, axes[1], 0))


def two_rods_in_series():
    """Return rods from ball to ball to ball: the ball in the middle moves."""
    m = spatial.Mechanism("series")
    a, b, c = (m.body(name, (x, 0, 0)) for name, x in (("a", 0), ("b", 0.3), ("c", 0.5)))
    m.add(spatial.Spherical("A", m.ground, O, a, O))
    m.add(spatial.Spherical("B", a, (0.3, 0, 0), b, O))
    m.add(spatial.Spherical("C", b, (0.2, 0, 0), c, O))
    m.add(spatial.Translational("T", m.ground, O, X, Y, c, O, X, Z))
    m.add(spatial.RelativeTranslation("stroke", m.ground, O, X, c, O, 0.4 + 0.01 * kc.t))
    return m


def shaft_in_two_bearings():
    m = spatial.Mechanism("shaft")
    shaft = m.body("shaft", O)
    m.add(spatial.Revolute("A", m.ground, O, Z, shaft, O, Z))
    m.add(spatial.Spherical("B", m.ground, (0, 0, 1), shaft, (0, 0, 1)))
    return m


def shaft_of_two_parts():
    m = spatial.Mechanism("parts")
    a, b = m.body("a", O), m.body("b", (0, 0, 1))
    m.add(spatial.Revolute("A", m.ground, O, Z, a, O, Z))
    m.add(spatial.Fixed("flange", a, (0, 0, 1), Z, X, b, O, Z, X))
    m.add(spatial.Spherical("B", m.ground, (0, 0, 2), b, (0, 0, 1)))
    return m


def arm_with_a_tool():
    m = spatial.Mechanism("arm")
    arm, tool = m.body("arm", O), m.body("tool", (1, 0, 0))
    m.add(spatial.Revolute("A", m.ground, O, Z, arm, O, Z))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, arm, Z, X, kc.t))
    m.add(spatial.Revolute("spindle", arm, (1, 0, 0), X, tool, O, X))
    return m


def cardan_shaft_without_a_motor():
    m = spatial.Mechanism("cardan")
    a, b = m.body("a", O), m.body("b", O, axis=Y, angle=0.4)
    m.add(spatial.Cylindrical("A", m.ground, O, X, a, O, X))
    m.add(spatial.Universal("U", a, O, Y, b, O, Z))
    m.add(spatial.Revolute("B", m.ground, O, (np.cos(0.4), 0, -np.sin(0.4)), b, O, X))
    return m


def double_pendulum():
    m = kc.Mechanism("pendulum")
    a, b = m.body("a"), m.body("b", (1, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), a, (0, 0)))
    m.add(kc.Revolute("B", a, (1, 0), b, (0, 0)))
    return m


def gears():
    m = kc.Mechanism("gears")
    carrier, a, b = m.body("carrier"), m.body("a"), m.body("b", (3, 0, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), carrier, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", carrier, kc.t))
    m.add(kc.Revolute("A", carrier, (0, 0), a, (0, 0)))
    m.add(kc.Revolute("B", carrier, (3, 0), b, (0, 0)))
    m.add(kc.Gear("mesh", a, (0, 0), 1, 0, b, (0, 0), 2, kc.pi))
    return m


CASES = {
    "a motor that is missing": (lambda: rssr(motor=False), ["spin of rod"]),
    "a point beside the axis": (
        lambda: with_rod(lambda m, rod: m.point("tip", rod, (0.1, 0.02, 0))), []
    ),
    "a point on the axis": (
        lambda: with_rod(lambda m, rod: m.point("tip", rod, (0.1, 0, 0))), ["spin of rod"]
    ),
    "a velocity of the rod": (
        lambda: with_rod(lambda m, rod: m.output("spin", rod.omega_fixed[0])), []
    ),
    "a wheel on the rod": (lambda: with_rod(add_wheel), ["spin of rod"]),
    "rods in series": (two_rods_in_series, ["spin of a", "spin of b"]),
    "struts": (
        transmission_models.ankle_with_rods, ["spin of cylinder_left", "spin of cylinder_right"]
    ),
    "a shaft": (shaft_in_two_bearings, []),
    "a shaft of two parts": (shaft_of_two_parts, []),
    "a tool": (arm_with_a_tool, []),
    "a shaft with a joint": (cardan_shaft_without_a_motor, []),
    "links": (double_pendulum, []),
    "gears": (gears, []),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_that_what_nothing_sees_is_held_and_nothing_else(case):
    make, wanted = CASES[case]
    assert sorted(held_system(make().system()).held) == wanted


def test_that_the_rods_of_a_delta_robot_are_held_and_its_motors_move_as_with_distances():
    """The example, whose six rods become bodies between balls."""
    m: Any = kc.read_model(EXAMPLES / "delta_robot.py")
    flat = moved(m)
    made, lengths = changed(m, bodies=[*m.bodies], constraints=[]), [0.2, 0.25, 0.5, 0.05]
    numbers = {x.name: length for x, length in zip(m.parameters, lengths, strict=True)}
    for item in m.constraints:
        if type(item).__name__ != "Distance":
            made.constraints.append(item)
            continue
        ends = []
        for body, point in ((item.i, item.point_i), (item.j, item.point_j)):
            local = [evaluate(x, numbers) for x in point]
            place = [flat[f"{x}_{body.name}"][0] for x in "xyz"]
            ends.append(place + spatial.orientation(flat, body)[0].apply(local))
        rod = made.body(item.name, tuple(ends[0]), x=tuple(ends[1] - ends[0]), y=(0.3, 1, 0.2))
        made.add(spatial.Spherical(f"{item.name}_i", item.i, item.point_i, rod, O))
        made.add(spatial.Spherical(f"{item.name}_j", rod, (0.5, 0, 0), item.j, item.point_j))
    assert made.held == tuple(f"spin of rod_{k}{side}" for k in (1, 2, 3) for side in "ab")
    assert m.held == ()
    found = moved(made)
    assert_the_same(found, flat, [f"theta_motor_{k}" for k in (1, 2, 3)])
    assert found["x_rod_1a_dot"].std() > 0.01


def test_that_a_ball_in_two_sockets_has_three_freedoms_that_are_held():
    m = rssr("distance")
    add_knob(m, m.bodies[0])
    assert held_system(m.system()).held == ("spin of knob",) * 3
    assert moved(m).success


def four_bar(last, *, pin):
    """Return a planar four-bar in space, whose crank and coupler may share a pin of its own."""
    m = spatial.Mechanism("four_bar", end=2.0)
    elbow = (0.04 * np.cos(1), 0.04 * np.sin(1), 0)
    crank = m.body("crank", O, axis=Z, angle=1.0)
    coupler = m.body("coupler", elbow, axis=Z, angle=0.2)
    rocker = m.body("rocker", (0.13, 0, 0), axis=Z, angle=1.74)
    shared = m.body("pin", elbow) if pin else coupler
    m.add(spatial.Revolute("O", m.ground, O, Z, crank, O, Z))
    m.add(spatial.Revolute("B", crank, (0.04, 0, 0), Z, shared, O, Z))
    if pin:
        m.add(spatial.Revolute("B2", shared, O, Z, coupler, O, Z))
    axes = (Z, Z) if last is spatial.Revolute else ((), ())
    ends = (coupler, (0.12, 0, 0), axes[0]), (rocker, (0.08, 0, 0), axes[1])
    m.add(last("C", *(x for end in ends for x in end if x != ())))
    m.add(spatial.Revolute("D", m.ground, (0.13, 0, 0), Z, rocker, O, Z))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, crank, Z, X, 1 + kc.t))
    return m


@pytest.mark.filterwarnings("ignore::kincompile.errors.RedundantConstraintWarning")
@pytest.mark.parametrize("last", [spatial.Revolute, spatial.Spherical])
def test_that_redundant_equations_and_a_held_pin_work_together(last):
    found, wanted = (moved(four_bar(last, pin=pin)) for pin in (True, False))
    assert_the_same(found, wanted, ["e0_rocker", "e3_coupler", "x_coupler"])
    assert "pin may spin about its own axis" in found.message


def test_that_a_pin_is_held_in_the_plane():
    def linkage(*, pin):
        m = transmission_models.crank_rocker(motor=1.5 + kc.t)
        if pin:
            crank, coupler, *_ = m.bodies
            joint = next(x for x in m.constraints if x.name == "B")
            m.constraints.remove(joint)
            shared = m.body("pin", (*coupler.guess[:2], 0.3))
            m.add(kc.Revolute("B", crank, joint.point_i, shared, (0, 0)))
            m.add(kc.Revolute("B2", shared, (0, 0), coupler, joint.point_j))
        return m

    found = moved(linkage(pin=True))
    assert_the_same(found, moved(linkage(pin=False)), ["phi_rocker", "x_coupler"])
    np.testing.assert_allclose(found["phi_pin"], 0.3, atol=1e-12)
    assert "phi_pin may change; nothing sees it, so it is held" in found.message


def test_that_a_ball_of_three_hinges_lets_its_rod_spin_and_it_is_held(held):
    m, crank, rocker = cranks("hinges", (0.3, 0.05, -0.12), Y)
    first, second, rod = (m.body(name, tuple(ENDS[0])) for name in ("first", "second", "rod"))
    m.add(spatial.Revolute("h1", crank, (0.1, 0, 0), Z, first, O, Z))
    m.add(spatial.Revolute("h2", first, O, Y, second, O, Y))
    m.add(spatial.Revolute("h3", second, O, X, rod, O, X))
    m.add(spatial.Spherical("B", rod, tuple(ENDS[1] - ENDS[0]), rocker, (0, 0, 0.25)))
    m.add(spatial.JointAngle("swing", m.ground, Y, Z, rocker, Y, Z))
    found = moved(m)
    assert_the_same(found, held, ["theta_swing"])
    assert "rod may spin" in found.message


PLACES = {"crank": O, "rod": (0.75, 0, 0.25), "rocker": (1.2, 0, 0)}


@pytest.mark.slow
def test_that_balls_of_hinges_that_begin_in_line_hold_one_spin_though_drivers_lead_away():
    """At the guess the first and the last hinge of each ball are in line: the crank is locked."""
    m = spatial.Mechanism("in_line")
    crank, rod, rocker = (m.body(x, at) for x, at in PLACES.items())
    m.add(spatial.Revolute("O", m.ground, O, Z, crank, O, Z))
    m.add(spatial.Revolute("P", m.ground, (1.2, 0, 0), Y, rocker, O, Y))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, crank, Z, X, m.parameter("a", 0.3)))
    ends = (
        ("A", crank, (0.3, 0, 0), rod, (-0.45, 0, -0.25)),
        ("B", rod, (0.45, 0, 0.25), rocker, (0, 0, 0.5)),
    )
    for name, i, point_i, j, point_j in ends:
        first, second = m.body(f"{name}1"), m.body(f"{name}2")
        m.add(spatial.Revolute(f"{name}x", i, point_i, X, first, O, X))
        m.add(spatial.Revolute(f"{name}y", first, O, Y, second, O, Y))
        m.add(spatial.Revolute(f"{name}z", second, O, X, j, point_j, X))
    assert len(m.held) == 1
    m.point("end", rocker, (0, 0, 0.5))
    with pytest.warns(kc.AssemblyWarning, match=r"there are at least \d+ assemblies at t = 0"):
        solution = kc.solve(kc.compile(m), [0.0])
    end = np.array([solution[f"end.{x}"][0] for x in "xyz"])
    apart = end - 0.3 * np.array([np.cos(0.3), np.sin(0.3), 0])
    assert np.linalg.norm(apart) == pytest.approx(2 * np.hypot(0.45, 0.25), abs=1e-12)


def heavy(centre, *, motor=True):
    """Return the linkage with masses, its rod with a centre that may lie beside its axis."""
    mass = {"mass": 1.0, "inertia": (0.002, 0.01, 0.01)}
    m, crank, rocker = cranks("heavy", (0.3, 0.05, -0.12), Y, motor=motor, **mass)
    local = (0.1, 0, 0), (0, 0, 0.25)
    add_rod(m, crank, rocker, ENDS, local, "balls", centre=centre, **mass)
    m.gravity = (0, 0, -9.81)
    return m


def test_that_forces_say_where_they_depend_on_how_a_freedom_is_held():
    said = kc.forces(moved(heavy((0.16, 0.01, 0)))).remarks()[-1]
    assert said.startswith(f"{ROD}. Loads or its inertia would turn it, and forces depend on how")
    assert "lambda_held_rod is up to 0." in said


def test_that_masses_move_what_drivers_leave_free():
    assert held_system(heavy((0.16, 0.01, 0)).system()).held == ("spin of rod",)
    assert held_system(heavy((0.16, 0.01, 0), motor=False).system()).held == ()


def test_that_a_body_which_angles_alone_hold_lacks_a_joint():
    m = kc.Mechanism("forgotten_joint")
    crank, block, rod = (m.body(name, guess=(1, k, 0)) for k, name in enumerate(("a", "b", "c")))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    m.add(kc.Revolute("A", crank, (1, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", m.ground, (1, 0), rod, (0, 0)))
    m.add(kc.RelativeAngle("left", crank, block, 0.5))
    m.add(kc.RelativeAngle("right", rod, block, 0.5))
    found = kc.inspect(m)
    assert found.held == ()
    assert set(found.free) == {"b"}
