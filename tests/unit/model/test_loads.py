"""Masses and forces as written: what is refused, and what a file says of them."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.files.data_text import read_toml
from kincompile.model.loads import LOADS
from kincompile.model.masses import plate


def arm(**mass):
    """Return a mechanism of one arm on a hinge, and the arm."""
    m = kc.Mechanism("arm")
    body = m.body("arm", (1, 0, 0), **mass)
    m.add(kc.Revolute("pin", m.ground, (0, 0), body, (-1, 0)))
    return m, body


@pytest.mark.parametrize(
    ("mass", "message"),
    [
        ({"mass": 0, "inertia": 1}, "'arm': the mass is 0, and must be positive"),
        ({"mass": -2, "inertia": 1}, "'arm': the mass is -2, and must be positive"),
        ({"mass": 2, "inertia": 0}, "inertia about the centre of mass is 0, and must be positive"),
        (
            {"mass": 2, "inertia": -1},
            "inertia about the centre of mass is -1, and must be positive",
        ),
        ({"mass": 2}, "body 'arm': it has a mass and no inertia; give both"),
        ({"inertia": 2}, "body 'arm': it has an inertia and no mass; give both"),
        ({"centre": (1, 0)}, "body 'arm': it has a centre of mass and no mass; give mass"),
        ({"mass": 2, "inertia": 1, "centre": 3}, "'arm', centre: 3 is not a pair"),
        ({"mass": float("nan"), "inertia": 1}, "nan is not finite"),
        ({"mass": "heavy", "inertia": 1}, "'heavy' is not a number or a SymPy expression"),
        ({"mass": 1 + kc.t, "inertia": 1}, "depends on t; an attribute is fixed in its body"),
        ({"density": 7850}, "a mass from the outline needs outline"),
        (
            {"outline": [(0, 0), (1, 0), (0, 1)], "density": 1, "thickness": 1, "mass": 3},
            "it has density and thickness, from which mass, inertia and centre follow",
        ),
        (
            {"outline": [(0, 0), (1, 0), (2, 0)], "density": 1, "thickness": 1},
            "its outline has no area",
        ),
    ],
)
def test_that_a_mass_that_is_none_is_refused(mass, message):
    m, _ = arm(**mass)
    with pytest.raises(kc.ModelError, match=message.replace("(", r"\(")):
        m.system()


def bad_loads():
    """Yield a load and what is wrong with it."""
    m, body = arm()
    g = m.ground
    yield kc.Force("f", "rod", (0, 0), (1, 0)), "there is no body 'rod' in this mechanism"
    yield kc.Force("f", g, (0, 0), (1, 0)), "the ground feels no force; name a body"
    yield kc.Force("f", body, (0, 0), 3), "force: 3 is not a force of 2 components"
    yield kc.Force("f", body, (0, 0), (sympy.Symbol("u"), 0)), "contains u, which is not declared"
    yield kc.Torque("f", body, sympy.Abs(body.phi)), "has no continuous derivative"
    yield kc.Torque("f", body, sympy.Symbol("phi_arm_ddot")), "cannot depend on accelerations"
    yield kc.Spring("f", body, (0, 0), body, (1, 0), 3), "a load between two bodies needs two"
    yield kc.Spring("f", g, (0, 0), body, (0, 0), 3, -1), "the free length is -1"
    yield kc.Spring("f", g, (0, 0), body, (0, 0)), "it has no stiffness, no damping and no force"
    yield kc.TorsionSpring("f", g, body), "it has no stiffness, no damping and no force"
    yield kc.Spring("f", g, (0, 0), body, (0, 0), body.x), "an attribute is fixed in its body"
    yield kc.HingeFriction("f", g, body, -1), "friction of -1 would drive"
    yield kc.HingeFriction("f", g, body, 1, 0), "the velocity of the smoothed law is 0"
    yield kc.SliderFriction("f", g, (0, 0), (0, 0), body, (0, 0), 1), "the axis has length zero"
    yield kc.Torque("pin", body, 1), "the load 'pin' has the name of another load or a constraint"
    yield kc.Torque("a b", body, 1), "a load is named 'a b'"
    yield kc.Spring("f", g, (0, 0), body, (0, 0), 30 * kc.deg, 30 * kc.deg), "is in degrees"


@pytest.mark.parametrize(("load", "message"), list(bad_loads()))
def test_that_a_load_that_is_none_is_refused(load, message):
    m, _ = arm()
    m.add(load)
    with pytest.raises(kc.ModelError, match=message):
        m.system()


@pytest.mark.parametrize(
    ("units", "lengths", "message"),
    [
        ({"k": "N"}, "m", "stiffness: the parameter 'k' has the unit N, and a force per length is"),
        ({"k": "N/mm^2"}, "m", "has the unit N/mm"),
        ({"heavy": "m"}, "m", "Mass 'arm', mass: .* has the unit m, and a mass is wanted"),
        ({"inertia": "kg*m"}, "m", "inertia: .* a moment of inertia is wanted"),
        ({"F": "N*m"}, "m", "Force 'push', force: .* a force is wanted"),
        ({"rest": "mm"}, "m", "free_length: .* has the unit mm, and a length is in m here; give"),
        ({"heavy": "t", "F": "N"}, "mm", "mass: .* a mass is in kg here; .* or another mass_unit"),
        (
            {"inertia": "kg*m^2"},
            "mm",
            r"a moment of inertia is in kg\*mm\^2 here; give its value in",
        ),
        ({"k": "N/mm"}, "m", "a force per length is in N/m here; give its value in that$"),
        ({"heavy": "kg", "k": "N/m", "F": "N", "inertia": "kg*m^2", "rest": "m"}, "m", None),
        ({"heavy": "kg", "k": "N/mm", "F": "N", "inertia": "kg*mm^2", "rest": "mm"}, "mm", None),
        ({"heavy": "lb", "k": "lbf/in", "F": "N/(m/m)"}, "px", None),
        ({"F": "mN"}, "mm", "a force is in N here"),
    ],
)
def test_that_units_that_do_not_fit_are_refused(units, lengths, message):
    m = kc.Mechanism("arm", length_unit=lengths)
    names = ("heavy", "inertia", "k", "F", "rest")
    heavy, inertia, k, load, rest = (
        m.parameter(name, 1.0, unit=units.get(name, "")) for name in names
    )
    body = m.body("arm", mass=2 * heavy, inertia=inertia)
    m.add(kc.Revolute("pin", m.ground, (0, 0), body, (0, 0)))
    m.add(kc.Spring("s", m.ground, (5, 0), body, (1, 0), k, rest))
    m.add(kc.Force("push", body, (1, 0), (0, -load)))
    if message is None:
        assert m.system().loads
        return
    with pytest.raises(kc.ModelError, match=message):
        m.system()


def test_that_all_problems_are_told_together():
    m, body = arm(mass=-1, inertia=1)
    m.add(kc.Torque("a", body, sympy.Symbol("u")))
    m.add(kc.Force("b", "rod", (0, 0), (1, 0)))
    with pytest.raises(kc.ModelError) as error:
        m.system()
    assert len(error.value.problems) == 3


def test_that_a_plate_has_the_inertia_of_its_parts():
    """An L is the sum of two rectangles; its corners go around both ways."""
    corners = [(0, 0), (4, 0), (4, 3), (2, 3), (2, 1), (0, 1)]
    exact = [tuple(map(sympy.Integer, corner)) for corner in corners]
    parts = [(4, 1, 2, 0.5), (2, 2, 3, 2)]
    area = sum(a * b for a, b, _, _ in parts)
    x = sum(a * b * u for a, b, u, _ in parts) / area
    y = sum(a * b * v for a, b, _, v in parts) / area
    second = sum(
        a * b * ((a * a + b * b) / 12 + (u - x) ** 2 + (v - y) ** 2) for a, b, u, v in parts
    )
    for given in (exact, exact[::-1]):
        found, centre, about = plate(given)
        assert [float(item) for item in (found, *centre, about)] == pytest.approx(
            [area, x, y, second]
        )


def test_that_every_type_is_public_and_has_its_arguments_in_the_docstring():
    for name, kind in LOADS.items():
        assert getattr(kc, name) is kind
        assert all(f"\n{argument}\n" in str(kind.__doc__) for argument in kind.arguments())


TEXT = """
kincompile = 1
name = "arm"
gravity = [0, "-g"]
parameters = [{name = "g", default = 9.81}, {name = "k", default = 30}]
bodies = [
    {name = "arm", guess = [1, 0, 0], mass = 2, inertia = "8/12", centre = [0.1, 0]},
    {name = "sheet", outline = [[0, 0], [1, 0], [0, 1]], density = 7850, thickness = 0.01},
]
loads = [
    {type = "Spring", name = "s", i = "ground", point_i = [0, 2], j = "arm", point_j = [1, 0],
     stiffness = "k", free_length = 0.4, force = "3*phi_arm_dot"},
    {type = "Force", name = "cut", body = "sheet", point = [0, 0],
     force = [{times = [0, 1, 2, 3], values = [0, 1, 1, 0], over = "x_arm"}, 5]},
    {type = "HingeFriction", name = "dry", i = "ground", j = "arm", moment = 0.3},
    {type = "SliderFriction", name = "rub", i = "ground", point_i = [0, 0], axis_i = [1, 0],
     j = "arm", point_j = [0, 0], force = 0.3, velocity = 0.1},
    {type = "Torque", name = "servo", body = "arm", torque = {points = [[0, 0], [1, 5]]}},
]
constraints = [
    {type = "Revolute", name = "pin", i = "arm", point_i = [-1, 0], j = "ground", point_j = [0, 0]},
]
"""


def written(tmp_path, text):
    path = tmp_path / "model.toml"
    path.write_text(text.replace(",\n     ", ", "), encoding="utf-8")
    return path


def test_that_a_file_reads_back_as_it_was_written(tmp_path):
    path = written(tmp_path, TEXT)
    model = kc.read_model(path)
    again = kc.read_model(written(tmp_path, model.to_toml()))
    assert again.to_toml() == model.to_toml()
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    jsonschema.validate(read_toml(path, model.to_toml().encode()).data, kc.model_schema())
    one, other = (kc.compile(item) for item in (model, again))
    q = np.linspace(0.1, 0.7, 6)
    np.testing.assert_array_equal(one.Q(q, 2 * q, 0.3), other.Q(q, 2 * q, 0.3))
    np.testing.assert_array_equal(one.M(q, 0.3), other.M(q, 0.3))
    assert one.LOADS == ("arm", "sheet", "s", "cut", "dry", "rub", "servo")


def test_that_a_file_gives_what_python_does(tmp_path):
    m = kc.Mechanism("arm")
    g, k = m.parameter("g", 9.81), m.parameter("k", 30)
    m.gravity = (0, -g)
    body = m.body("arm", (1, 0, 0), mass=2, inertia=8 / 12, centre=(0.1, 0))
    m.add(kc.Revolute("pin", body, (-1, 0), m.ground, (0, 0)))
    m.add(kc.Spring("s", m.ground, (0, 2), body, (1, 0), k, 0.4, force=3 * body.phi_dot))
    text = "\n".join(line for line in TEXT.split("\n") if "sheet" not in line)
    start, end = text.index("     force = [{times"), text.index("]\nconstraints")
    module = kc.compile(kc.read_model(written(tmp_path, text[:start] + text[end:])))
    own = kc.compile(m)
    q = np.array([0.9, 0.2, 0.4])
    np.testing.assert_allclose(own.Q(q, q, 0.0), module.Q(q, q, 0.0), rtol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"Spring"', '"Sprin"', r"load 's', type: there is no type 'Sprin'; did you mean 'Spring'"),
        ("density = 7850, ", "", r"line 8.*body 'sheet'.*a mass from the outline needs"),
        ("mass = 2", 'mass = "two"', r"body 'arm', mass: column 1 of 'two'"),
        ("moment = 0.3", "momen = 0.3", "there is no such field; did you mean 'moment'"),
        ('body = "arm", torque', 'body = "leg", torque', "there is no body 'leg'"),
        ('[0, "-g"]', "3", r"gravity: expected \[x, y\]"),
        ("0.4, force", "-0.4, force", r"the free length is -0.4"),
        (
            'values = [0, 1, 1, 0], over = "x_arm"',
            'values = [0, 1, 1], over = "x_arm"',
            "there are 4",
        ),
    ],
)
def test_that_a_file_says_what_is_wrong_and_where(tmp_path, old, new, message):
    assert old in TEXT
    with pytest.raises(kc.ModelError, match=message):
        kc.read_model(written(tmp_path, TEXT.replace(old, new)))
