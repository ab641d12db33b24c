"""`drawing`: every type of constraint has its marks, in the right frame, at the right place."""

import itertools
import json

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.model.constraint import Constraint, constraint_type
from kincompile.model.joints import Revolute
from kincompile.view.drawing import drawing
from kincompile.view.joint_shapes import DRAWINGS
from kincompile.view.marks import (
    GROUND_FRAME,
    BodyFrame,
    Contour,
    Drive,
    FramePoint,
    Hull,
    Pin,
    Polygon,
    Rail,
    Slider,
    Span,
    Wheel,
)

GROUND = -1
FRAMES = {GROUND: GROUND_FRAME} | {k: BodyFrame(k, (3 * k, 3 * k + 1, 3 * k + 2)) for k in range(4)}


def at(body, point):
    """Return a point of a body, or of the ground."""
    return FramePoint(FRAMES[body], point)


def two_bodies(joint, *more, i_guess=(0, 0, 0), j_guess=(2, 1, 0.5)):
    """Return a mechanism of two bodies with the constraint that `joint` gives for them."""
    m = kc.Mechanism("two")
    a = m.parameter("a", 0.5)
    i, j = m.body("i", guess=i_guess), m.body("j", guess=j_guess)
    m.add(joint(m, i, j, a))
    for constraint in more:
        m.add(constraint(m, i, j, a))
    return m


def marks(m, kind, **options):
    return [mark for mark in drawing(m, **options).marks if isinstance(mark, kind)]


def test_that_every_type_of_constraint_is_drawn():
    assert set(DRAWINGS) == set(CONSTRAINTS.values())


def test_that_a_type_without_a_drawing_is_refused():
    @constraint_type
    class Strange(Constraint):
        body: BodyLike = argument.body("i")

        @staticmethod
        def Phi():
            return (kc.AbsoluteAngle.Phi()[0],)

    m = two_bodies(lambda m, i, j, a: Strange("A", i))
    with pytest.raises(kc.UnsupportedError, match=r"no drawing for the type Strange of 'A'"):
        drawing(m)


def test_that_a_type_of_ones_own_is_drawn_as_the_type_it_is_made_from():
    class Bearing(Revolute):
        pass

    (pin,) = marks(two_bodies(lambda m, i, j, a: Bearing("A", i, (1, 2), j, (3, 4))), Pin)
    assert pin == Pin("A", at(0, (1, 2)), at(1, (3, 4)))


def test_that_a_pin_names_the_ground_first_and_parameters_have_their_values():
    m = two_bodies(lambda m, i, j, a: kc.Revolute("A", i, (2 * a, a**2), m.ground, (3, 0)))
    (pin,) = marks(m, Pin)
    assert pin == Pin("A", at(GROUND, (3, 0)), at(0, (1, 0.25)))
    (pin,) = marks(m, Pin, p={"a": 2.0})
    assert pin.second == at(0, (4, 4))


def test_that_a_slider_has_a_rail_on_the_ground_as_long_as_its_motion():
    m = two_bodies(
        lambda m, i, j, a: kc.Translational("C", m.ground, (0, 1), (0, 2), j, (0.5, 0), (3, 0))
    )
    q = np.zeros((3, 6))
    q[:, 3:] = [(0, 1, np.pi / 2), (0, 4, np.pi / 2), (0, 9, np.pi / 2)]
    (rail,), (block,) = marks(m, Rail, q=q), marks(m, Slider, q=q)
    assert block == Slider("C", at(1, (0.5, 0)), (1, 0), FRAMES[1])
    # The point (0.5, 0) is at y = 1.5, 4.5, 9.5; the rail goes on a little at both ends.
    over = rail.end[1] - 9.5
    assert over > 0
    np.testing.assert_allclose((rail.start, rail.end), ((0, 1.5 - over), (0, 9.5 + over)))
    assert (rail.frame, rail.axis, rail.style) == (GROUND_FRAME, (0, 1), "guide")


def test_that_between_moving_bodies_there_are_a_sleeve_and_a_slide():
    m = two_bodies(lambda m, i, j, a: kc.Translational("C", i, (1, 0), (1, 0), j, (2, 0), (1, 0)))
    (slide,), (block,) = marks(m, Span), marks(m, Slider)
    assert slide == Span("C", at(0, (1, 0)), at(1, (2, 0)), "slide")
    assert block.place == slide.first


@pytest.mark.parametrize("is_lever_first", [True, False])
def test_that_the_block_of_a_slotted_lever_is_the_body_at_the_crank_pin(is_lever_first):
    m = kc.Mechanism("whitworth")
    crank, lever, block = m.body("crank"), m.body("lever"), m.body("block")
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("C", m.ground, (0, -1), lever, (0, 0)))
    m.add(kc.Revolute("pin", crank, (2, 0), block, (0, 0)))
    sides = [(lever, (0, 0), (1, 0)), (block, (0, 0), (0, 1))]
    i, j = sides if is_lever_first else sides[::-1]
    m.add(kc.Translational("slot", *i, *j))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    (slot,), (block,) = marks(m, Rail), marks(m, Slider)
    assert (block.place, block.axis, block.guide) == (at(2, (0, 0)), (0, 1), FRAMES[2])
    assert (slot.frame, slot.axis, slot.style) == (FRAMES[1], (1, 0), "slot")
    assert slot.follower == block.place


def test_that_a_cylinder_takes_the_place_of_its_slide():
    m = two_bodies(
        lambda m, i, j, a: kc.Translational("C", i, (1, 0), (1, 0), j, (2, 0), (1, 0)),
        lambda m, i, j, a: kc.TranslationalDistance("D", i, (1, 0), (1, 0), j, (2, 0), 1 + kc.t),
    )
    assert [(span.joint, span.style) for span in marks(m, Span)] == [("D", "cylinder")]
    assert marks(m, Slider) == []


@pytest.mark.parametrize(("length", "style"), [(3, "rod"), (3 + kc.t, "cylinder")])
def test_that_a_distance_is_a_rod_or_a_cylinder(length, style):
    m = two_bodies(lambda m, i, j, a: kc.Distance("D", i, (0, 0), j, (1, 0), length))
    (span,) = marks(m, Span)
    # At the guess the points are at (0, 0) and (2, 1) + (cos 0.5, sin 0.5).
    barrel = 0.85 * np.hypot(2 + np.cos(0.5), 1 + np.sin(0.5)) if style == "cylinder" else 0
    assert (span.first, span.second, span.style) == (at(0, (0, 0)), at(1, (1, 0)), style)
    assert span.barrel == pytest.approx(barrel)
    m = two_bodies(lambda m, i, j, a: kc.AbsoluteDistance("D", i, (1, 0), (5, 5), length))
    (span,) = marks(m, Span)
    assert (span.first, span.second) == (at(GROUND, (5, 5)), at(0, (1, 0)))


@pytest.mark.parametrize(
    ("joint", "across"), [(kc.AbsoluteX, (0, 1)), (kc.AbsoluteY, (1, 0))], ids=["x", "y"]
)
def test_that_a_held_coordinate_is_a_rail_and_a_driven_one_an_arrow(joint, across):
    (rail,) = marks(two_bodies(lambda m, i, j, a: joint("X", j, (1, 0), 4)), Rail)
    held = 0 if joint is kc.AbsoluteX else 1
    assert rail.axis == across
    assert rail.start[held] == rail.end[held] == 4
    (drive,) = marks(two_bodies(lambda m, i, j, a: joint("X", j, (1, 0), kc.t)), Drive)
    assert drive == Drive("X", at(1, (1, 0)), (1, 0) if held == 0 else (0, 1))


def test_that_a_turning_drive_is_at_the_bearing():
    m = two_bodies(
        lambda m, i, j, a: kc.Revolute("B", i, (1, 0), j, (2, 0)),
        lambda m, i, j, a: kc.Revolute("A", m.ground, (0, 0), i, (-1, 0)),
        lambda m, i, j, a: kc.AbsoluteAngle("motor", i, kc.t),
        lambda m, i, j, a: kc.RelativeAngle("gear", i, j, 2 * kc.t),
        lambda m, i, j, a: kc.AbsoluteAngle("held", j, 1),
    )
    assert marks(m, Drive) == [
        Drive("motor", at(0, (-1, 0)), None), Drive("gear", at(1, (2, 0)), None),
    ]  # fmt: skip


def test_that_gears_are_wheels_and_a_negative_radius_is_an_internal_one():
    m = two_bodies(lambda m, i, j, a: kc.Gear("G", i, (0, 0), -4 * a, 0.1, j, (1, 0), a, kc.pi))
    ring, planet = marks(m, Wheel)
    assert ring == Wheel("G", at(0, (0, 0)), 2, 0.1, is_internal=True)
    assert planet == Wheel("G", at(1, (1, 0)), 0.5, np.pi, is_internal=False)


def test_that_a_rack_goes_from_p_to_q_and_as_far_as_the_pinion_rolls():
    m = two_bodies(
        lambda m, i, j, a: kc.RackAndPinion("R", i, (0, 0), (3, 0), 0, j, (0, 0), a, 0),
        j_guess=(7, 0.5, 0),
    )
    (rack,) = marks(m, Rail)
    assert (rack.start, rack.end, rack.style) == ((0, 0), (7, 0), "rack")
    assert [link.frame for link in marks(m, Hull)] == []  # the rack is its body


def test_that_a_cam_has_the_radius_of_its_profile():
    profile = 2 + sympy.cos(kc.alpha)
    m = two_bodies(
        lambda m, i, j, a: kc.CamFlatFollower("F", i, (1, 0), profile, j, (0, 0), (0, 2))
    )
    (cam,), (face,) = marks(m, Contour), marks(m, Rail)
    angles = 2 * np.pi * np.arange(len(cam.points)) / len(cam.points)
    radii = np.hypot(*(np.array(cam.points) - (1, 0)).T)
    np.testing.assert_allclose(radii, 2 + np.cos(angles), rtol=1e-12)
    # The face is at least as long as the cam is wide, 3 to each side.
    assert (face.style, face.axis) == ("face", (0, 1))
    assert face.start[1] <= -3 < 3 <= face.end[1]


def test_that_a_table_of_radii_is_a_profile():
    angles = np.linspace(0, 2 * np.pi, 13)[:-1]
    table = (angles.tolist(), (1 + 0.1 * np.cos(angles)).tolist())
    m = two_bodies(lambda m, i, j, a: kc.PointFollower("P", i, (0, 0), j, (0, 0), table))
    (slot,), (pin,) = marks(m, Contour), marks(m, Pin)
    assert (slot.frame, slot.style, pin.second) == (FRAMES[1], "slot", at(0, (0, 0)))
    radii = np.hypot(*np.array(slot.points).T)
    assert 0.899 < radii.min() < radii.max() < 1.101


def test_that_a_body_is_the_hull_of_its_joint_points():
    corners = [(0, 0), (2, 0), (1, 0.2), (0, 2), (2, 0), (1, 0)]
    more = [
        lambda m, i, j, a, k=k, at=at: kc.AbsoluteX(f"x{k}", i, at, kc.t)
        for k, at in enumerate(corners[1:])
    ]
    m = two_bodies(lambda m, i, j, a: kc.AbsoluteX("x", i, corners[0], kc.t), *more)
    hull = next(link for link in marks(m, Hull) if link.frame == FRAMES[0])
    assert set(hull.points) == {(0, 0), (2, 0), (0, 2)}


def test_that_a_body_of_one_joint_goes_to_its_origin():
    m = two_bodies(lambda m, i, j, a: kc.Revolute("A", m.ground, (0, 0), i, (-1, 0)))
    first, second = marks(m, Hull)
    assert (first.frame, first.points) == (FRAMES[0], ((-1, 0), (0, 0)))
    assert (second.frame, second.points) == (FRAMES[1], ((0, 0),))  # no joint at all: a dot


def test_that_a_frame_is_wherever_in_q_its_columns_are():
    q = np.array([9.0, np.pi / 2, 2.0, 9.0, 1.0])
    place = FramePoint(BodyFrame(0, (4, 2, 1)), (3, 4)).at(q)
    np.testing.assert_allclose(place, (1 - 4, 2 + 3), atol=1e-12)


def test_that_points_are_where_rotation_and_translation_put_them():
    q = np.array([[1.0, 2.0, np.pi / 2, 5.0, 6.0, np.pi]])
    np.testing.assert_allclose(at(0, (3, 4)).at(q), [(1 - 4, 2 + 3)], atol=1e-12)
    np.testing.assert_allclose(at(1, (3, 4)).at(q), [(5 - 3, 6 - 4)], atol=1e-12)
    np.testing.assert_array_equal(at(GROUND, (3, 4)).at(q), [(3, 4)])


def test_that_the_extent_holds_every_mark_and_leaves_out_what_is_not_finite(example):
    drawn = drawing(example.model, q=example.solution.q)
    left, right, low, high = drawn.extent(
        [*example.solution.q, np.full(drawn_size(example), np.nan)]
    )
    assert left < right
    assert low < high
    for mark, q in itertools.product(drawn.marks, example.solution.q[::40]):
        if isinstance(mark, Pin) and np.isfinite(q).all():
            x, y = mark.second.at(q)
            assert left < x < right
            assert low < y < high


def drawn_size(example):
    return len(example.module.COORDINATES)


def test_that_a_system_without_bodies_has_no_marks(example_named):
    drawn = drawing(example_named("problem_3_5_6").model)
    assert (drawn.bodies, drawn.marks) == ((), ())
    assert all(joint.place is None for joint in drawn.joints)


def test_that_joints_are_pointed_at_where_they_are(example):
    drawn = drawing(example.model)
    system = example.model.system()
    assert [joint.name for joint in drawn.joints] == [item.name for item in system.constraints]
    rows = [row for joint in drawn.joints for row in range(joint.rows[0], sum(joint.rows))]
    assert rows == list(range(len(system.equations)))


def test_that_a_drawing_is_plain_data(example):
    data = json.loads(json.dumps(drawing(example.model).to_json(), allow_nan=False))
    kinds = {mark["kind"] for mark in data["marks"]}
    assert kinds <= {
        "hull", "polygon", "pin", "rail", "slider", "span", "wheel", "contour", "drive", "dot",
    }  # fmt: skip
    assert data["bodies"] == [body.name for body in example.model.system().bodies]


def test_that_an_outline_takes_the_place_of_the_link_and_hides_what_slides_in_it():
    m = kc.Mechanism("telescope")
    a = m.parameter("a", 2.0)
    outer = m.body("outer", outline=[(0, 0), (a, 0), (a, 1), (0, 1)])
    inner = m.body("inner", guess=(1, 0, 0), outline=[(0, 0), (1, 0), (0, 1)])
    m.add(kc.Translational("slide", outer, (0, 0), (1, 0), inner, (1, 0), (1, 0)))
    m.add(kc.TranslationalDistance("reach", outer, (0, 0), (1, 0), inner, (1, 0), kc.t))
    drawn = drawing(m, {"a": 3.0})
    assert drawn.marks == (
        Polygon(FRAMES[1], ((0, 0), (1, 0), (0, 1))),
        Polygon(FRAMES[0], ((0, 0), (3, 0), (3, 1), (0, 1))),
    )
