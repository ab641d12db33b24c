"""`kc.Sketch`: what it makes is a plain `Mechanism`; all that is wrong is told at once."""

import math

import mpmath
import numpy as np
import pytest
import sympy
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli


def four_bar():
    """Return the drawing of a four-bar with a coupler point, its crank and its guess rough."""
    s = kc.Sketch("four_bar", length_unit="cm")
    s.ground(O=(0, 0), C=(4, 0))
    s.joints(A=(1.1, 0.2), B=(3, 2.9), P=(1.5, 3))
    return s


def problems_of(draw):
    """Return what is wrong with a drawing."""
    s = four_bar()
    draw(s)
    with pytest.raises(kc.ModelError) as caught:
        s.mechanism()
    return caught.value.problems


def test_that_it_makes_the_mechanism_that_one_writes_by_hand():
    s = four_bar()
    a, b, c = s.length("a", 1.0), s.length("b", 3.5), s.length("c", 3.0)
    s.link("crank", "O A", a)
    s.link("coupler", "A B P", AB=b, AP=3.0, BP=1.5)
    s.link("rocker", "C B", c)
    s.drive("crank", 2 * kc.pi * kc.t)

    m = kc.Mechanism("four_bar", length_unit="cm")
    for name, default in (("a", 1.0), ("b", 3.5), ("c", 3.0)):
        m.parameter(name, default, "cm")
    crank = m.body("crank", guess=(0, 0, math.atan2(0.2, 1.1)))
    coupler = m.body("coupler", guess=(1.1, 0.2, math.atan2(2.9 - 0.2, 3 - 1.1)))
    rocker = m.body("rocker", guess=(4, 0, math.atan2(2.9, -1)))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (a, 0), coupler, (0, 0)))
    m.add(kc.Revolute("C", m.ground, (4, 0), rocker, (0, 0)))
    m.add(kc.Revolute("B", coupler, (b, 0), rocker, (c, 0)))
    m.add(kc.AbsoluteAngle("drive_crank", crank, 2 * kc.pi * kc.t))
    m.point("P", coupler, s.place("coupler", "P"))
    assert s.mechanism() is s.mechanism()
    assert s.mechanism().to_toml() == m.to_toml()
    assert kc.emit(s.mechanism()).source == kc.emit(m).source


def test_that_a_triangle_has_its_lengths_at_all_parameters_and_its_apex_where_it_is_drawn():
    s = four_bar()
    lengths = s.length("a", 2.0), s.length("b", 1.8), s.length("c", 1.2)
    s.link("left", "A B P", AB=lengths[0], AP=lengths[1], BP=lengths[2])
    s.link("right", "B A P", AB=lengths[0], AP=lengths[1], BP=lengths[2])
    for values in ((2.0, 1.8, 1.2), (2.5, 1.5, 1.4), (1.0, 1.5, 0.8)):
        base, near, far = values
        numbers = dict(zip(lengths, values, strict=True))
        xi, eta = (float(part.subs(numbers)) for part in s.place("left", "P"))
        assert eta > 0
        assert (math.hypot(xi, eta), math.hypot(xi - base, eta)) == pytest.approx((near, far))
        xi, eta = (float(part.subs(numbers)) for part in s.place("right", "P"))
        assert eta < 0
        assert (math.hypot(xi, eta), math.hypot(xi - base, eta)) == pytest.approx((far, near))


def test_that_joints_of_a_larger_link_follow_one_after_the_other():
    s = kc.Sketch("plate")
    s.ground(A=(0, 0))
    s.joints(B=(4, 0), C=(4, 3), D=(0, 3), E=(2, -1))
    s.link("plate", "A B C D E", AB=4, AC=5, BC=3, CD=4, BD=5, AE=math.sqrt(5), BE=math.sqrt(5))
    for joint, place in {"C": (4, 3), "D": (0, 3), "E": (2, -1)}.items():
        found = [float(part) for part in s.place("plate", joint)]
        assert found == pytest.approx(place, abs=1e-14)


def test_that_a_link_without_lengths_is_as_drawn_and_one_with_a_place_has_it():
    s = four_bar()
    h = s.length("h", 0.25)
    s.link("drawn", "A B P")
    s.link("placed", "A B P", P=(h, 0))
    reach = math.hypot(1.9, 2.7)
    assert s.place("drawn", "B") == pytest.approx((reach, 0))
    expected = ((0.4 * 1.9 + 2.8 * 2.7) / reach, (2.8 * 1.9 - 0.4 * 2.7) / reach)
    assert s.place("drawn", "P") == pytest.approx(expected, abs=1e-14)
    assert s.place("placed", "P") == (h, 0)


def test_that_places_of_the_drawing_may_depend_on_parameters():
    s = kc.Sketch("arm")
    s.ground(O=(0, 0), C=(0, s.length("h", 2.0)))
    s.joints(A=(1, 0))
    s.link("arm", "O A")
    s.link("stay", "C A")
    h = sympy.Symbol("h")
    assert s.place("stay", "A") == (sympy.sqrt(1 + h**2), 0)


def test_that_three_lengths_on_one_line_put_the_joint_on_it():
    s = four_bar()
    a = s.length("a", 2.0)
    s.link("numbers", "A B P", AB=2, AP=3, BP=1)
    s.link("symbols", "A B P", AB=a, AP=3 * a / 2, BP=a / 2)
    assert s.place("numbers", "P") == (3, 0)
    assert s.place("symbols", "P") == (3 * a / 2, 0)


@pytest.mark.parametrize(
    ("along", "y"), [("G H", lambda x: 0.5 - x / 2), ((2, -1), lambda x: 0.1 - (x - 1.9) / 2)]
)
def test_that_a_slider_and_a_slot_keep_a_joint_on_their_line(along, y):
    def solved(guided):
        s = kc.Sketch("slider_crank")
        s.ground(O=(0, 0), G=(0, 0.5), H=(2, -0.5))
        s.joints(A=(0.5, 0), B=(1.9, 0.1))
        s.link("crank", "O A", 0.5)
        s.link("rod", "A B", 1.5)
        guided(s)
        s.drive("crank", 2 * kc.pi * kc.t)
        solution = kc.solve(kc.compile(s.mechanism()), np.linspace(0, 1, 40))
        assert solution.success
        angle = solution["rod.phi"]
        x, y = (solution[f"rod.{name}"] for name in "xy")
        return x + 1.5 * np.cos(angle), y + 1.5 * np.sin(angle), solution

    sliding = solved(lambda s: s.slider("block", "B", along))
    slotted = solved(lambda s: s.slot("B", along))
    np.testing.assert_allclose(sliding[:2], slotted[:2], atol=1e-12)
    np.testing.assert_allclose(sliding[1], y(sliding[0]), atol=1e-12)
    np.testing.assert_allclose(sliding[2]["block.phi"], 0, atol=1e-12)
    np.testing.assert_allclose(sliding[2]["block.x"], sliding[0], atol=1e-12)


def test_that_a_slider_on_a_moving_link_keeps_its_angle_to_it():
    s = kc.Sketch("telescope")
    s.ground(O=(0, 0))
    s.joints(A=(3, 4), T=(6, 8), K=(6, 9))
    s.link("boom", "O A")
    s.slider("inner", "T K", along="O A")
    s.drive("boom", 0.3 + kc.t)
    s.drive("inner", 7 + kc.t)
    solution = kc.solve(kc.compile(s.mechanism()), [0.0, 0.5])
    np.testing.assert_allclose(solution["inner.phi"], [0.3, 0.8], atol=1e-12)
    reach = np.hypot(solution["inner.x"], solution["inner.y"])
    np.testing.assert_allclose(reach, [7, 7.5], atol=1e-12)
    assert s.place("inner", "K") == pytest.approx((0.8, 0.6))


def test_what_can_be_driven():
    s = four_bar()
    s.link("crank", "O A", 1.0)
    s.link("coupler", "A B P")
    s.slider("ram", "P", along=(1, 0), on="coupler")
    for what in ("crank", "ram", "A C", "P.x", "P.y"):
        s.drive(what, kc.t + 1)
    s.drive("coupler", kc.t, against="crank")
    found = {item.name: type(item).__name__ for item in s.mechanism().constraints}
    assert {name: kind for name, kind in found.items() if name.startswith("drive")} == {
        "drive_crank": "AbsoluteAngle",
        "drive_ram": "TranslationalDistance",
        "drive_A_C": "Distance",
        "drive_P_x": "AbsoluteX",
        "drive_P_y": "AbsoluteY",
        "drive_coupler": "RelativeAngle",
    }


def test_that_a_joint_of_three_links_is_two_pins():
    s = four_bar()
    for name in ("one", "two", "three"):
        s.link(name, "A B P")
    pins = [item for item in s.mechanism().constraints if item.name.startswith("A")]
    assert [(pin.name, pin.i.name, pin.j.name) for pin in pins] == [
        ("A", "one", "two"),
        ("A_three", "one", "three"),
    ]


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (
            lambda s: s.link("coupler", "A B P", AB=10.0, AP=3.0, BP=2.5),
            "link 'coupler': P, A and B make no triangle: A B = 10 cm is 4.5 cm longer than P A and"
            " P B together (5.5 cm)",
        ),
        (lambda s: s.link("arm", "A"), "link 'arm' has 1 joints, and needs 2 or more; a body with"),
        (lambda s: s.link("arm", "A X"), "link 'arm': unknown joints X; joints are: O, C,"),
        (lambda s: s.link("arm", "A A"), "link 'arm': A, A names a joint twice"),
        (lambda s: s.link("arm", "A B", 0), "link 'arm', A B: the length is 0; give one that is"),
        (lambda s: s.link("arm", "A B", -2.5), "link 'arm', A B: the length is -2.5; give one"),
        (lambda s: s.link("arm", "A B", sympy.Symbol("q")), "arm', A B: q has no value at the"),
        (lambda s: s.link("arm", "A B", "2"), "arm', A B: '2' is not a number or a SymPy"),
        (lambda s: s.link("arm", "A B", math.nan), "arm', A B: nan is not finite"),
        (lambda s: s.link("arm", "A B P", 2), "arm' has 3 joints: name each length by its two"),
        (lambda s: s.link("arm", "A B", AX=2), "arm', AX: AX is not a pair of its joints A, B;"),
        (lambda s: s.link("arm", "A B P", AP=2), "arm': P has only A P: give its lengths to two"),
        (lambda s: s.link("arm", "A B P", A=(0, 0)), "arm', A: A and B carry the frame"),
        (lambda s: s.link("arm", "A B P", P=3), "arm', P: 3 is not a place (xi, eta) in the frame"),
        (
            lambda s: s.link("arm", "A B P", AP=2, BP=2, P=(1, 1)),
            "arm': the link is over-dimensioned; remove the lengths A P, B P",
        ),
        (
            lambda s: (s.joints(Q=(2.05, 1.55)), s.link("arm", "A B Q", AQ=2, BQ=3)),
            "arm': the drawing has Q on the line through A and B; draw it on the side",
        ),
        (
            lambda s: s.link("arm", "A B P", AB=s.length("u", 2), AP=3, BP=s.length("w", 1)),
            "arm': P, A, B are on one line, and another value of a parameter would tear them",
        ),
        (lambda s: (s.joints(Q=(3, 2.9)), s.link("arm", "B Q")), "B and Q are drawn at one place"),
        (lambda s: s.joints(A=(1, 1)), "joint 'A' is drawn twice"),
        (lambda s: s.joints(Q=(1, 2, 3)), "joint 'Q': (1, 2, 3) is not a place (x, y)"),
        (lambda s: s.joints(Q="12"), "joint 'Q': '12' is not a place (x, y)"),
        (lambda s: None, "no link has the joints A, B, P; name them in a link, or do not draw"),
        (lambda s: (s.link("arm", "A B"), s.link("arm", "B P")), "there is a link 'arm' already"),
        (lambda s: s.link("ground", "A B"), "there is a link 'ground' already; draw its joints"),
        (lambda s: s.slider("ram", "P", along="A B"), "slider 'ram': no link has both A and B"),
        (lambda s: s.slider("ram", "P", along=3), "slider 'ram': 3 is not two joints of one link"),
        (lambda s: s.slider("ram", "P", along=(0, 0)), "the direction (0, 0) has zero length"),
        (lambda s: s.slider("ram", "P", (1, 0), "arm"), "slider 'ram': there is no link 'arm'"),
        (lambda s: s.slot("P", along=(1, 0)), "slot of 'P': no link has the joint 'P' yet"),
        (lambda s: s.slot("A B", along=(1, 0)), "slot of 'A B' has 2 joints, and needs 1"),
        (lambda s: s.wheel("disc", "A B"), "wheel 'disc' has 2 joints, and needs 1"),
        (lambda s: s.drive("crnk", kc.t), "drive of 'crnk': drive a link, a slider, the distance"),
        (lambda s: s.drive("A.x", kc.t), "drive of 'A.x': no link has the joint 'A' yet"),
        (lambda s: s.drive("A B", kc.t), "drive of 'A B': no link has the joint 'B' yet"),
        (
            lambda s: s.gear("mesh", "sun", "A", 1, "planet", "B", 2),
            "gear 'mesh': there is no link 'planet'; links so far are: ground",
        ),
        (
            lambda s: (s.link("arm", "A B"), s.place("arm", "P")),
            "the link 'arm' has no joint 'P'; it has A, B",
        ),
    ],
)  # fmt: skip
def test_what_is_said_of_a_bad_drawing(draw, message):
    assert any(message in problem for problem in problems_of(draw)), problems_of(draw)


def test_that_a_name_that_may_be_two_pairs_is_refused():
    s = kc.Sketch("names")
    s.ground(A=(0, 0))
    s.joints(AB=(1, 0), BA=(0, 1))
    s.link("plate", "A AB BA", ABA=1)
    with pytest.raises(kc.ModelError, match="this may be A AB, A BA; write the two joints with _"):
        s.mechanism()


def test_that_all_mistakes_are_told_at_once_and_each_once():
    def draw(s):
        s.link("crank", "O X")
        s.link("coupler", "A B P", AB=9, AP=1, BP=1)
        s.link("rocker", "B")
        s.drive("rockr", kc.t)
        s.drive("rockr", kc.t)

    found = problems_of(draw)
    assert len(found) == 4
    assert [problem.split(" ")[0] for problem in found] == ["link", "link", "link", "drive"]


def test_that_the_command_line_says_what_to_do_with_a_sketch_and_with_a_bad_one(tmp_path):
    path = tmp_path / "drawn.py"
    path.write_text("import kincompile as kc\ns = kc.Sketch('drawn')\n")
    done = CliRunner().invoke(cli, ["run", str(path)])
    assert (done.exit_code, "s.mechanism()" in done.output) == (2, True)
    path.write_text(path.read_text() + "s.joints(A=(0, 0))\nmechanism = s.mechanism()\n")
    done = CliRunner().invoke(cli, ["run", str(path)])
    assert (done.exit_code, "line 4: no link has the joints A" in done.output) == (2, True)


def test_that_it_shows_its_sizes():
    s = four_bar()
    s.link("crank", "O A", 1.0)
    assert repr(s) == "<Sketch 'four_bar': 5 joints, 1 links; .mechanism() makes the model>"


def test_that_the_precision_of_mpmath_changes_no_text(example_named):
    example = example_named("jansen")
    with mpmath.workdps(60):
        model = kc.read(example.path.with_suffix(".toml"))
    assert kc.emit(model).source == example.source


def excavator():
    """Return a boom and a stick, each moved by a cylinder, with the eyes of both."""
    s = kc.Sketch("excavator", end=1.0, points=3)
    s.ground(O=(0, 1.8), Q=(0.6, 1.2))
    s.joints(R=(1.6, 3.0), S=(1.9, 3.6), T=(4.5, 3.2), U=(4.0, 4.0), Tip=(5.4, 0.1))
    s.link("boom", "O R S T")
    s.link("stick", "U T Tip")
    for ends, first, second in (("Q R", (0.6, 1.2), (1.6, 3.0)), ("S U", (1.9, 3.6), (4.0, 4.0))):
        s.drive(ends, math.dist(first, second) + 0.1 * kc.t)
    return s


def test_that_free_ends_and_what_is_named_are_columns():
    """The eyes of cylinders crowd no table; without a free end the last of them is a column."""
    s = excavator()
    assert [point.name for point in s.mechanism().outputs] == ["Tip"]
    s = excavator()
    s.point("S")
    assert [point.name for point in s.mechanism().outputs] == ["S", "Tip"]
    s = kc.Sketch("boom", end=1.0, points=3)
    s.ground(O=(0, 0), Q=(1, 0))
    s.joints(R=(1, 1))
    s.link("boom", "O R")
    s.drive("Q R", 1 + kc.t / 2)
    assert [point.name for point in s.mechanism().outputs] == ["R"]
