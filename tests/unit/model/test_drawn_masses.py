"""Masses, loads and outputs of drawings, beside mechanisms whose masses are given by hand."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial

G = 9.81
TIMES = np.linspace(0, 0.9, 7)


def press(**of_rod):
    """A slider-crank drawn with lengths as parameters."""
    s = kc.Sketch("press")
    s.gravity = (0, -G)
    s.ground(O=(0, 0))
    s.joints(A=(0.1, 0.05), B=(0.4, 0))
    s.link("crank", "O A", s.length("r", 0.1), mass=1.2, inertia=0.002, centre=(0.04, 0.01))
    s.link("rod", "A B", s.length("l", 0.3), **of_rod)
    s.slider("ram", "B", along=(1, 0), mass=1.5)
    s.drive("crank", 0.3 + 10 * kc.t)
    s.add(kc.Force("cut", "ram", "B", (-300, 0)))
    return s.mechanism()


def by_hand(mass, inertia, centre):
    """The same in bodies and joints."""
    m = kc.Mechanism("press")
    m.gravity = (0, -G)
    crank = m.body("crank", (0, 0, 0.3), mass=1.2, inertia=0.002, centre=(0.04, 0.01))
    rod = m.body("rod", (0.1, 0.03, -0.1), mass=mass, inertia=inertia, centre=centre)
    ram = m.body("ram", (0.4, 0, 0), mass=1.5, inertia=0.7)
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (0.1, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (0.3, 0), ram, (0, 0)))
    m.add(kc.Translational("ram_guide", m.ground, (0, 0), (1, 0), ram, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("drive_crank", crank, 0.3 + 10 * kc.t))
    m.add(kc.Force("cut", ram, (0, 0), (-300, 0)))
    return m


def forces_of(model, **given):
    return kc.forces(kc.solve(kc.compile(model), TIMES, given or None))


def assert_same(found, wanted):
    for name in ("F_x_O", "F_y_O", "F_x_B", "F_y_B", "drive_drive_crank", "T_ram_guide"):
        np.testing.assert_allclose(found[name], wanted[name], rtol=1e-10, atol=1e-8)


@pytest.mark.parametrize(
    ("given", "mass", "square", "centre"),
    [
        ({"mass": 0.8}, 0.8, 0.3**2 / 12, (0.15, 0)),
        ({"mass": 0.8, "width": 0.04}, 0.8, (0.3**2 + 0.04**2) / 12, (0.15, 0)),
        ({"mass": 0.8, "inertia": 0.8 * 0.01}, 0.8, 0.01, (0.15, 0)),
        ({"mass": 0.8, "centre": (0.1, 0.02)}, 0.8, 0.3**2 / 12, (0.1, 0.02)),
        (
            {"density": 7850, "width": 0.04},
            7850 * 0.3 * 0.04**2, (0.3**2 + 0.04**2) / 12, (0.15, 0),
        ),
        (
            {"density": 7850, "width": 0.04, "thickness": 0.01},
            7850 * 0.3 * 0.04 * 0.01, (0.3**2 + 0.04**2) / 12, (0.15, 0),
        ),
    ],
)  # fmt: skip
def test_that_a_drawn_link_is_a_straight_bar(given, mass, square, centre):
    assert_same(forces_of(press(**given)), forces_of(by_hand(mass, mass * square, centre)))


def test_that_the_mass_by_density_follows_the_length():
    module = kc.compile(press(density=7850, width=0.04))
    for length in (0.3, 0.45):
        M = module.M(module.GUESS, 0.0, [0.1, length])
        rod = slice(3, 6)
        mass, about_end = 7850 * length * 0.04**2, length**2 / 3 + 0.04**2 / 12
        np.testing.assert_allclose(np.diag(M)[rod], [mass, mass, mass * about_end], rtol=1e-12)


def test_that_a_link_of_three_joints_is_a_plate():
    """A right-angled triangle of legs a and b: its second moment about its centroid is known."""
    a, b, density, thickness = 0.3, 0.4, 2700.0, 0.01
    for order, corner in (("O A P", (0.0, b)), ("O A P", (0.0, -b))):
        s = kc.Sketch("plate")
        s.ground(O=(0, 0))
        s.joints(A=(a, 0), P=corner)
        s.link("plate", order, density=density, thickness=thickness)
        s.drive("plate", kc.t)
        module = kc.compile(s.mechanism())
        M = module.M(module.GUESS, 0.0)
        mass = density * thickness * a * b / 2
        about_origin = mass * (a**2 + b**2) / 6
        assert M[0, 0] == pytest.approx(mass, rel=1e-12)
        assert M[2, 2] == pytest.approx(about_origin, rel=1e-12)
        assert M[1, 2] == pytest.approx(mass * a / 3, rel=1e-12)
        assert M[0, 2] == pytest.approx(-mass * corner[1] / 3, rel=1e-12)


def test_that_joints_on_a_line_are_on_a_straight_bar():
    s = kc.Sketch("bar")
    s.ground(O=(0, 0))
    s.joints(A=(0.4, 0), P=(-0.2, 0))
    s.link("bar", "O A P", density=7850, width=0.05)
    s.drive("bar", kc.t)
    module = kc.compile(s.mechanism())
    M, mass = module.M(module.GUESS, 0.0), 7850 * 0.6 * 0.05**2
    expected = mass * ((0.6**2 + 0.05**2) / 12 + 0.1**2)
    np.testing.assert_allclose([M[0, 0], M[1, 2], M[2, 2]], [mass, 0.1 * mass, expected])


@pytest.mark.parametrize("end", [(0.4, 0.1, 0.8), (0.5, 0, 1), (0, 0, 0.5)])
def test_that_a_drawn_bar_in_space_has_its_inertia_along_and_across(end):
    s = spatial.Sketch("swing")
    s.gravity = (0, 0, -G)
    s.ground(A=(0, 0, 1))
    s.hinges(A=(0, 1, 0))
    s.joints(C=end)
    s.link("arm", "A C", density=7850, width=0.05)
    s.drive("arm", kc.t**2)
    module = kc.compile(s.mechanism())
    found = kc.forces(kc.solve(module, [0.0]))
    way, w = np.subtract(end, (0, 0, 1)), 0.05
    length = np.linalg.norm(way)
    mass = 7850 * length * w**2
    u = way / length
    along, across = mass * w**2 / 6, mass * (length**2 + w**2) / 12
    about_y = across + (along - across) * u[1] ** 2 + mass * (way[0] ** 2 + way[2] ** 2) / 4
    torque = 2 * about_y - G * mass * way[0] / 2  # t^2 turns x to -z
    assert found["drive_drive_arm"] == pytest.approx([torque], rel=1e-10, abs=1e-10)


BAD = [
    ({"width": 0.1}, "give its mass, or its density and width: one of the two"),
    ({"mass": 1, "density": 1, "width": 1}, "give its mass, or its density and width: one of"),
    ({"density": 7850}, "a density needs a width; give width="),
    ({"density": 7850, "thickness": 1}, "a density needs a width; give width="),
    ({"mass": 1, "width": -0.1}, "the width is -0.1; give a positive one"),
    ({"mass": "m_rod"}, "mass: .* give a number, or an expression"),
    ({"mass": sympy.Symbol("m_rod")}, "the mass is nan; give a positive one, of declared"),
]


@pytest.mark.parametrize(("given", "message"), BAD)
def test_that_a_mass_that_cannot_be_is_refused(given, message):
    with pytest.raises(kc.ModelError, match=f"link 'rod': {message}"):
        press(**given)


def test_that_plates_and_bars_in_space_say_what_they_lack():
    s = kc.Sketch("plate")
    s.ground(O=(0, 0))
    s.joints(A=(1, 0), P=(2, 0), Q=(0, 1))
    s.link("wide", "A P Q", mass=1, width=1)
    s.link("thin", "O A Q", density=1)
    s.joints(R=(1, 1))
    s.link("crossed", "O R A Q", mass=1)
    with pytest.raises(kc.ModelError) as error:
        s.mechanism()
    for message in (
        "link 'wide': a width is that of a straight bar; a plate has a thickness",
        "link 'thin': a density needs a thickness; give thickness=...",
        "link 'crossed': its edges cross; name its joints in their order around the plate",
    ):
        assert message in str(error.value)
    s = spatial.Sketch("bars")
    s.ground(A=(0, 0, 0))
    s.joints(B=(1, 0, 0), C=(0, 1, 0))
    s.link("thin", "A B", mass=1)
    s.link("three", "A B C", mass=1)
    s.slider("turned", "C", along="A B", mass=1)
    with pytest.raises(kc.ModelError) as error:
        s.mechanism()
    assert "link 'thin': a bar without width turns freely about itself" in str(error.value)
    assert "link 'three': of three joints or more give mass, inertia and centre" in str(error.value)


def test_that_a_slider_on_a_moving_guide_needs_an_inertia():
    s = kc.Sketch("whip")
    s.ground(O=(0, 0))
    s.joints(A=(1, 0), S=(0.5, 0))
    s.link("arm", "O A")
    s.slider("block", "S", along="O A", mass=1)
    s.drive("arm", kc.t)
    s.drive("block", 0.5)
    with pytest.raises(kc.ModelError, match="body 'block': it has a mass and no inertia"):
        s.mechanism().system()


FILE = """
kincompile = 1
name = "press"
gravity = [0, -9.81]
loads = [{ type = "Force", name = "cut", body = "ram", point = "B", force = [-300, 0] }]
outputs = [{ name = "reach", expression = "x_A + x_B", unit = "m" }]
[sketch]
lengths = { r = 0.1, l = 0.3 }
ground = { O = [0, 0] }
joints = { A = [0.1, 0.05], B = [0.4, 0] }
parts = [
{ link = "crank", joints = "O A", length = "r", mass = 1.2, inertia = 2e-3, centre = [0.04, 0.01] },
  { link = "rod", joints = "A B", length = "l", density = 7850, width = 0.04, thickness = "0.01" },
  { slider = "ram", joints = "B", along = [1, 0], mass = 1.5 },
  { drive = "crank", value = "0.3 + 10*t" },
]
"""


def test_that_a_file_says_the_same(tmp_path):
    path = tmp_path / "press.toml"
    path.write_text(FILE)
    model = kc.read_model(path)
    found = forces_of(model)
    assert_same(found, forces_of(press(density=7850, width=0.04, thickness=0.01)))
    again = tmp_path / "long.toml"
    again.write_text(model.to_toml())
    assert_same(forces_of(kc.read_model(again)), found)
    motion = kc.solve(kc.compile(model), TIMES)
    expected = 0.1 * np.cos(motion["crank.phi"]) + motion["ram.x"]
    np.testing.assert_allclose(motion["reach"], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('point = "B"', 'point = "C"', "no joint 'C' is drawn on this body; give one that is"),
        ('point = "B"', 'point = "O"', "no joint 'O' is drawn on this body"),
        ("width = 0.04", 'width = "w"', "line 13: .* there is no 'w'"),
        (
            "mass = 1.5",
            "mass = [1]",
            "line 14: .*, mass: expected a number or a formula",
        ),
    ],
)
def test_that_a_file_with_a_wrong_name_says_where(tmp_path, old, new, message):
    path = tmp_path / "press.toml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(kc.ModelError, match=message):
        kc.read_model(path)


def test_that_outputs_take_names_of_joints_and_of_points():
    s = kc.Sketch("four_bar")
    s.ground(O=(0, 0), C=(1, 0))
    s.joints(A=(0, 0.3), B=(0.9, 0.8), P=(0.6, 0.9))
    s.link("crank", "O A")
    s.link("coupler", "A B P")
    s.link("rocker", "C B")
    s.drive("crank", 2 * kc.pi * kc.t)
    s.output("mu", kc.outputs.transmission_angle("A", "B", "C"), "rad")
    m = s.mechanism()
    m.output("fast", 2 * kc.outputs.speed("P"))
    m.output("far", kc.outputs.distance("P", (0, 0)), "m")
    m.output("mu_too", kc.outputs.transmission_angle(s.point("A"), s.point("B"), s.point("C")))
    motion = kc.solve(kc.compile(m), TIMES)
    a, b, p = (np.array([motion[f"{name}.x"], motion[f"{name}.y"]]) for name in "ABP")
    to_a, to_c = a - b, np.array([[1], [0]]) - b
    cosine = (to_a * to_c).sum(axis=0) / np.hypot(*to_a) / np.hypot(*to_c)
    np.testing.assert_allclose(motion["mu"], np.arccos(cosine), rtol=1e-12)
    np.testing.assert_array_equal(motion["mu_ddot"], motion["mu_too_ddot"])
    np.testing.assert_allclose(motion["far"], np.hypot(*p), rtol=1e-12)
    np.testing.assert_allclose(
        motion["fast"], 2 * np.hypot(motion["P.x_dot"], motion["P.y_dot"]), rtol=1e-12
    )
    with pytest.raises(kc.ModelError, match="there is no joint or point 'D'"):
        m.output("bad", kc.outputs.distance("D", "A"))


def test_that_outputs_in_space_take_names_too():
    s = spatial.Sketch("swing")
    s.ground(A=(0, 0, 1), B=(0, 0.2, 1))
    s.joints(C=(0.5, 0.1, 0.9))
    s.link("arm", "A B C")
    s.drive("arm", kc.t)
    s.output("far", spatial.outputs.distance("C", "A"), "m")
    s.add(spatial.Force("load", "arm", "C", (0, 0, -3)))
    motion = kc.solve(kc.compile(s.mechanism()), TIMES)
    np.testing.assert_allclose(motion["far"], np.sqrt(0.5**2 + 0.1**2 + 0.1**2), rtol=1e-12)
    lever = kc.forces(motion)["drive_drive_arm"]
    np.testing.assert_allclose(lever, -3 * (motion["C.x"]), rtol=1e-10)
