"""The section `sketch` of a model file: the same mechanism as the calls of `kc.Sketch`."""

import json
import re
from pathlib import Path

import pytest

import kincompile as kc
from kincompile import spatial
from kincompile.files.file_format import MOST_DRAWN, model_schema
from kincompile.files.model_file import read_data_model

JANSEN = """
kincompile = 1
name = "jansen"
length_unit = "mm"
analysis = { end = 1.0, points = 361 }

[sketch]
ground = { O = [0, 0], B = ["-a", "-l"] }
parts = [
    { link = "crank", joints = "O A", length = "m" },
    { link = "upper_rod", joints = "A C", length = "j" },
    { link = "lower_rod", joints = "A E", length = "k" },
    { link = "plate", joints = "B C D", BC = "b", BD = "d", CD = "e" },
    { link = "rocker", joints = "B E", length = "c" },
    { link = "side_rod", joints = "D F", length = "f" },
    { link = "leg", joints = "E F G", EF = "g", FG = "h", EG = "i" },
    { drive = "crank", value = "2*pi*t" },
]

[sketch.lengths]
a = 38.0
l = 7.8
m = 15.0
j = 50.0
k = 61.9
b = 41.5
d = 40.1
e = 55.8
c = 39.3
f = 39.4
g = 36.7
h = 65.7
i = 49.0

[sketch.joints]
A = [15.0, 0.0]
C = [-20.0, 30.0]
D = [-70.0, 15.0]
E = [-25.0, -45.0]
F = [-60.0, -30.0]
G = [-30.0, -95.0]
"""

EVERYTHING = """
kincompile = 1
name = "everything"
parameters = [{ name = "w", default = 2.0, unit = "rad/s" }]

[sketch]
lengths = { r = 0.1, d = 0.45 }
ground = { O = [0, 0], C = [0, "-d"], E = [0.5, 0] }
joints = { A = [0.1, 0], D = [0.14, 0.24], R = [-0.15, 0.26], T = [-0.2, 0.2], F = [0.6, 0] }
parts = [
    { link = "crank", joints = "O A", length = "r" },
    { link = "lever", joints = "C D", CD = 0.7 },
    { slot = "A", along = "C D" },
    { link = "rod", joints = "D R T", DR = 0.3, T = [0.2, 0.05] },
    { slider = "ram", joints = "R", along = [1, 0] },
    { wheel = "big", joint = "E" },
    { wheel = "small", joint = "F" },
    { link = "arm", joints = "E F", length = 0.1 },
    { gear = "mesh", i = "big", centre_i = "E", radius_i = 0.06, RING },
    { drive = "crank", value = "w*t" },
    { drive = "big", value = { points = [[0, 0], [1, "90*deg"]], law = "modified sine" } },
    { drive = "arm", value = "t", against = "lever" },
    { point = "D" },
]

[[outputs]]
name = "gap"
expression = "x_T - x_ram"
unit = "m"
""".replace("RING", 'j = "small", centre_j = "F", radius_j = 0.04')


IN_SPACE = """
kincompile = 1
name = "press"
space = 3
parameters = [{ name = "w", default = 2.0, unit = "rad/s", range = [1, 3] }]
outputs = [{ name = "rise", expression = "z_ram*omega_y_rocker" }]

[sketch]
lengths = { r = 0.1, lift = 0.4 }
ground = { O = [0, 0, 0], P = [0.3, 0, -0.1], Q = [0.3, 0.2, -0.1], T = [1, 1, 0], V = [1, 1, 2] }
joints = { A = ["r", 0, 0], B = [0.3, 0.1, 0.2], S = [0.4, 0.3, 0], U = [1, 1, "lift"] }
hinges = { O = [0, 0, 1] }
parts = [
    { link = "crank", joints = "O A" },
    { link = "rocker", joints = "P Q B" },
    { rod = "coupler", joints = "A B" },
    { slider = "ram", joints = "S", along = [0, 0, 1] },
    { rod = "push", joints = "B S", length = 0.3 },
    { slider = "lift_bar", joints = "U", along = "T V" },
    { drive = "crank", value = "w*t" },
    { drive = "lift_bar", value = { points = [[0, 0], [1, "lift/4"]], law = "modified sine" } },
    { point = "B" },
]
"""


def in_space():
    """Return what `IN_SPACE` says, by calls."""
    s = spatial.Sketch("press")
    w = s.parameter("w", 2.0, "rad/s", (1, 3))
    r, lift = s.length("r", 0.1), s.length("lift", 0.4)
    s.ground(O=(0, 0, 0), P=(0.3, 0, -0.1), Q=(0.3, 0.2, -0.1), T=(1, 1, 0), V=(1, 1, 2))
    s.joints(A=(r, 0, 0), B=(0.3, 0.1, 0.2), S=(0.4, 0.3, 0), U=(1, 1, lift))
    s.hinges(O=(0, 0, 1))
    s.link("crank", "O A")
    rocker = s.link("rocker", "P Q B")
    s.rod("coupler", "A B")
    ram = s.slider("ram", "S", along=(0, 0, 1))
    s.rod("push", "B S", 0.3)
    s.slider("lift_bar", "U", along="T V")
    s.drive("crank", w * kc.t)
    s.drive("lift_bar", kc.motion.sequence([(0, 0), (1, lift / 4)], law="modified sine"))
    s.point("B")
    m = s.mechanism()
    m.output("rise", ram.z * rocker.omega[1])
    return m


def toml(text):
    return read_data_model(Path("model.toml"), text.encode())


def everything():
    """Return what `EVERYTHING` says, by calls."""
    s = kc.Sketch("everything")
    w = s.parameter("w", 2.0, "rad/s")
    r, d = s.length("r", 0.1), s.length("d", 0.45)
    s.ground(O=(0, 0), C=(0, -d), E=(0.5, 0))
    s.joints(A=(0.1, 0), D=(0.14, 0.24), R=(-0.15, 0.26), T=(-0.2, 0.2), F=(0.6, 0))
    s.link("crank", "O A", r)
    s.link("lever", "C D", CD=0.7)
    s.slot("A", along="C D")
    s.link("rod", "D R T", DR=0.3, T=(0.2, 0.05))
    ram = s.slider("ram", "R", along=(1, 0))
    s.wheel("big", "E")
    s.wheel("small", "F")
    s.link("arm", "E F", 0.1)
    s.gear("mesh", "big", "E", 0.06, "small", "F", 0.04)
    s.drive("crank", w * kc.t)
    s.drive("big", kc.motion.sequence([(0, 0), (1, 90 * kc.deg)], law="modified sine"))
    s.drive("arm", kc.t, against="lever")
    s.point("D")
    m = s.mechanism()
    (tool,) = (item for item in m.outputs if item.name == "T")
    m.output("gap", tool.x - ram.x, "m")
    return m


@pytest.mark.parametrize(
    ("text", "by_calls"),
    [
        (JANSEN, lambda: kc.read_model("examples/jansen.py")),
        (EVERYTHING, everything),
        (IN_SPACE, in_space),
    ],
    ids=["jansen", "everything", "in space"],
)
def test_that_a_drawing_in_a_file_is_the_drawing_in_python(text, by_calls):
    found, expected = toml(text), by_calls()
    assert found.to_toml() == expected.to_toml()
    assert kc.emit(found).source == kc.emit(expected).source


def test_that_the_schema_has_a_drawing():
    jsonschema = pytest.importorskip("jsonschema")
    tomllib = pytest.importorskip("tomllib")
    validator = jsonschema.Draft202012Validator(model_schema())
    for text in (JANSEN, EVERYTHING, IN_SPACE):
        assert not list(validator.iter_errors(tomllib.loads(text)))
    bad = tomllib.loads(JANSEN)
    bad["sketch"]["parts"][0] = {"rope": "O A"}
    assert list(validator.iter_errors(bad))


def changed(old, new):
    assert old in JANSEN
    return JANSEN.replace(old, new)


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (changed('joints = "O A"', 'joints = "O X"'), 10, "link 'crank': unknown joints X"),
        (changed('"E F G", EF', '"E F G", EX'), 16, "link 'leg', EX: EX is not a pair"),
        (changed("link = ", "rope = "), 10, "one of link, wheel, slider, slot, gear, drive, point"),
        (changed('length = "m"', 'length = "mm"'), 10, "column 1 of 'mm'"),
        (changed('length = "m"', "length = -1"), 10, "the length is -1"),
        (changed('joints = "O A"', "joints = 3"), 10, "expected a text in quotes, not 3"),
        (changed(', value = "2*pi*t"', ""), 17, "no value; fields are: drive, value, against"),
        (changed('drive = "crank"', 'drive = "cranc"'), 17, "drive of 'cranc'"),
        (changed('"E F G", EF', '"E F", EF'), 35, "no link has the joints G"),
        (changed('"lower_rod"', '"crank"'), 12, "there is a link 'crank' already"),
        (changed("O = [0, 0]", "O = [0]"), 8, "expected [x, y]"),
        (changed("O = [0, 0]", '"a b" = [0, 0]'), 8, "'a b'"),
        (changed("d = 40.1", "d = 1.0"), 13, "link 'plate'"),
        (changed("a = 38.0", 'a = "38"'), 21, "expected a number"),
        (changed("[sketch.joints]", "[sketch.pins]"), 35, "there is no such field"),
        (changed("A = [15.0, 0.0]", 'A = [15, "x_crank"]'), 36, "x_crank"),
        ('kincompile = 1\nname = "x"\nsketch = 3\n', 3, "expected a table, not 3"),
        ('kincompile = 1\nname = "x"\n[sketch]\nparts = 3\n', 4, "expected a list, not 3"),
    ],
)
def test_that_what_is_wrong_is_told_with_file_and_line(text, line, said):
    with pytest.raises(kc.ModelError) as caught:
        toml(text)
    found = [x for x in caught.value.problems if x.startswith(f"model.toml, line {line}: ")]
    assert any(said in problem for problem in found), caught.value.problems


def test_that_a_joint_may_be_called_as_what_python_has():
    found = toml(re.sub(r"\bA\b", "self", JANSEN))
    assert {item.name for item in found.constraints} >= {"O", "self", "self_lower_rod"}


def test_that_a_drawing_without_end_is_refused_at_once():
    joints = {f"J{k}": [k, 0] for k in range(MOST_DRAWN + 1)}
    data = {"kincompile": 1, "name": "x", "sketch": {"joints": joints, "parts": []}}
    with pytest.raises(kc.ModelError, match="at most 300 joints"):
        read_data_model(Path("x.json"), json.dumps(data).encode())
    data["sketch"] = {
        "joints": dict(list(joints.items())[:31]),
        "parts": [{"link": "a", "joints": " ".join(list(joints)[:31])}],
    }
    with pytest.raises(kc.ModelError, match="at most 30 joints"):
        read_data_model(Path("x.json"), json.dumps(data).encode())


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ('"P Q B"', '"P Q X"', 15, "link 'rocker': unknown joints X"),
        ("O = [0, 0, 1]", "Z = [0, 0, 1]", 12, "hinge 'Z': unknown joints Z"),
        ("O = [0, 0, 1]", "O = [0, 1]", 12, "[x, y, z]"),
        ('joints = "A B"', 'joints = "A B", width = 2', 16, "width"),
        ('{ rod = "coupler"', '{ gear = "coupler"', 16, "one of link, slider, rod, drive, point"),
    ],
)
def test_that_a_wrong_drawing_in_space_is_told_with_its_line(old, new, line, said):
    assert old in IN_SPACE
    with pytest.raises(kc.ModelError) as caught:
        toml(IN_SPACE.replace(old, new))
    assert any(said in text and f"line {line}" in text for text in caught.value.problems)
