"""simEngine2D's .adm and .acf: the reference figures through the command line, and bad files."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli
from kincompile.files.adm_file import read_adm

FOLDER = Path(__file__).parent / "simengine2d"

# model, analysis, index of the time in the grid, columns and what cases.md prints for them
FIGURES: dict[str, tuple[str, str, int, list[str], list[tuple[float, ...]]]] = {
    "R1 at 0": (
        "simplePend", "grid_0.37", 0, ["x_pendulum", "y_pendulum", "phi_pendulum"],
        [(1, 0, 1.570796), (6.283185307, 0, 6.283185307), (0, 39.4784176044, 0)],
    ),
    "R1 at 0.37": (
        "simplePend", "grid_0.37", 37, ["x_pendulum", "y_pendulum", "phi_pendulum"],
        [
            (1.7289686274, 1.6845471059, 3.8955748905),
            (-4.301136318, 4.5802449692, 6.2831853072),
            (-28.7785278938, -27.0248365177, 0),
        ],
    ),
    "R5 at 1": (
        "sliderCrankKIN", "grid_1", 10, ["x_crank", "y_crank", "phi_crank", "x_slider"],
        [
            (1.0806046117, 1.6829419696, 1, 7.128182679),
            (-3.3658839392, 2.1612092235, 2, -9.6608672505),
            (-7.6883023862, -4.570558655, 2, -14.6709405263),
        ],
    ),
    "R5 at 2": (
        "sliderCrankKIN", "grid_2", 100, ["x_slider", "phi_connecting_rod"],
        [
            (2.5657729691, 0.528843303), (5.9973842394, 2.0188410197),
            (44.8122168458, -5.9587032698),
        ],
    ),
    "R6 at 0.1": (
        "project1", "grid_1", 1, ["x_body_1", "y_body_1", "phi_body_1", "x_body_2", "phi_body_2"],
        [
            (0.8663667454, 1.2456241417, 0.8414709848, 4.3627039091, -0.3382902322),
            (-4.0286244305, 3.6003948909, 5.4030230587, -9.323919371, -1.2722376416),
            (43.2890914625, -77.8395788418, -84.1470984808, 108.8157532945, 26.9359963787),
        ],
    ),
    "R7 rack and pinion at 0.5": (
        "rackPinion", "grid_1", 5, ["x_rack", "y_rack", "phi_rack", "phi_pinion"],
        [
            (0.1, -0.05, 0, 2), (0, 0, 0, 0),
            (-0.1 * np.pi**2, 0, 0, -2 * np.pi**2),
        ],
    ),
    "R10 ladder at 1": (
        "rodDYN", "grid_1", 10, ["x_ladder", "y_ladder", "phi_ladder"],
        [
            (1.9977728, 0.09436006, 1.52359878), (2 * np.cos(1 + np.pi / 6), -1.9977728, 1),
            (-1.9977728, -0.09436006, 0),
        ],
    ),
    "R10 pendulum at 1": (
        "pendKIN", "grid_1", 10, ["x_bar", "y_bar", "phi_bar"],
        [
            (1.33273349, 1.49124828, 0.84147098), (-0.80572489, 0.72007898, 0.54030231),
            (0.86578183, -1.55679158, -0.84147098),
        ],
    ),
}  # fmt: skip


@pytest.mark.every(4)
@pytest.mark.parametrize("case", FIGURES)
def test_that_the_command_line_gives_the_reference_figures(case, tmp_path):
    model, analysis, index, columns, figures = FIGURES[case]
    output = tmp_path / "motion.json"
    arguments = ["run", FOLDER / f"{model}.adm", "--analysis", FOLDER / f"{analysis}.acf"]
    done = CliRunner().invoke(cli, [str(part) for part in (*arguments, "-o", output)])
    assert done.exit_code == 0, done.output
    motion = json.loads(output.read_text(encoding="utf-8"))
    places = [motion["coordinates"].index(name) for name in columns]
    for quantity, expected in zip(("q", "q_dot", "q_ddot"), figures, strict=True):
        found = np.array(motion[quantity][index])[places]
        np.testing.assert_allclose(found, expected, rtol=2e-8, atol=5e-7 if index == 0 else 5e-9)


def test_that_the_grid_has_one_time_more_than_steps():
    settings = kc.read_analysis(FOLDER / "grid_0.37.acf")
    assert (settings.end, settings.points) == (0.37, 38)


def test_that_what_is_left_out_is_said(caplog):
    kc.read(FOLDER / "simplePend.adm")
    kc.read(FOLDER / "sliderCrankKIN.adm")
    assert [record.getMessage().split(": ", 1)[1] for record in caplog.records] == [
        "the drawing (vis) is left out",
        "forces and contacts are left out: they do not change kinematics",
    ]


def test_that_a_model_of_the_course_can_be_written_as_toml():
    model = kc.read(FOLDER / "rackPinion.adm")
    assert 'type = "RackAndPinion"' in model.to_toml()


ADM = """{
"name": "arm",
"bodies": [
{"name": "arm", "id": 3, "q0": [1, 0, 0]},
{"name": "rod", "id": 9, "q0": [1, 0, 0]}
],
"constraints": [
{"name": "pin", "id": 1, "type": "RevoluteJoint", "body1": 3, "sP1": [-1, 0], "sP2": [0, 0]},
{"name": "slide", "id": 2, "type": "TranslationalJoint", "body1": 3, "sP1": [1, 0],
 "vP1": [1, 1], "body2": 9, "sP2": [0, 0], "vP2": [1, 0]},
{"name": "a", "id": 4, "type": "AbsoluteAngle", "body1": 3, "fun": "t"},
{"name": "b", "id": 5, "type": "RelativeDistance", "body1": 3, "sP1": [0, 0],
 "body2": 9, "sP2": [0, 0], "fun": "1 + t/10"}
]}
"""

BAD = {
    "unknown type": ("RevoluteJoint", "BallJoint", 8, "constraint 'pin', type: there is no const"),
    "unknown body": ('"body2": 9, "sP2": [0, 0], "v', '"body2": 4, "sP2": [0, 0], "v', 10,
                     "constraint 'slide', body2: there is no body with the id 4; ids are: 3, 9"),
    "id twice": ('"id": 9', '"id": 3', 5, "body 'rod', id: the id 3 is given twice"),
    "no id": ('"id": 9, ', "", 5, "body 'rod': no id"),
    "no q0": (', "q0": [1, 0, 0]}\n]', "}\n]", 5, "body 'rod': no q0"),
    "missing field": (', "vP2": [1, 0]', "", 9, "constraint 'slide': TranslationalJoint has no v"),
    "function": ('"t"', '"system(t)"', 11, "constraint 'a', fun: column 1 of 'system(t)': 'system"),
    "assignment": ('"t"', '"t = 1"', 11, "constraint 'a', fun: column 1"),
    "no length": ("[1, 1]", "[0, 0]", 10, "constraint 'slide', vP1: the direction has no length"),
    "no bodies": ('"bodies"', '"body"', 1, "no bodies; a model of simEngine2D has"),
    "nan": ("[-1, 0]", "[NaN, 0]", 8, "constraint 'pin', sP1, entry 1: nan is not a finite"),
    "division by zero": ("[-1, 0]", "[1/0, 0]", 8, "constraint 'pin', sP1, entry 1: column 3"),
    "distance": ('"1 + t/10"', '"NONE"', 12, "Distance 'b', distance: the distance is 0"),
    "cut short": ("]}\n", "", 14, "this is not JSON"),
    "key twice": ('"id": 9', '"name": 9', 5, "the key 'name' is given a second time"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_that_a_problem_has_line_and_field(name):
    old, new, line, message = BAD[name]
    assert ADM.count(old) >= 1
    with pytest.raises(kc.ModelError) as caught:
        read_adm(Path("arm.adm"), ADM.replace(old, new, 1).encode())
    assert any(
        problem.startswith(f"arm.adm, line {line}: {message}") for problem in caught.value.problems
    ), caught.value.problems


def test_that_directions_have_length_one():
    slide = read_adm(Path("arm.adm"), ADM.encode()).constraints[1]
    assert isinstance(slide, kc.Translational)
    np.testing.assert_allclose([float(x) for x in slide.axis_i], [0.5**0.5, 0.5**0.5])


@pytest.mark.parametrize(
    "text", ["! Adams View model name: arm\n", "ADAMS/View\n", "PART/01, MASS = 1\n"]
)
@pytest.mark.parametrize("ending", ["adm", "acf"])
def test_that_the_other_format_with_the_same_ending_is_recognised(tmp_path, text, ending):
    path = tmp_path / f"model.{ending}"
    path.write_text(text, encoding="utf-8")
    read = kc.read if ending == "adm" else kc.read_analysis
    with pytest.raises(kc.ModelError, match=rf"{ending}, line 1: this is a file of MSC Adams"):
        read(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"outputSteps": 3}', "line 1: no tend; an analysis has"),
        ('{"tend": 1}', "line 1: no stepSize"),
        ('{"tend": -1, "outputSteps": 3}', "line 1: tend: expected a positive number, not -1"),
        ('{"tend": "1", "outputSteps": 3}', "line 1: tend: expected a number, not '1'"),
        ('{"tend": 1,\n"outputSteps": 2.5}', "line 2: outputSteps: expected a whole number"),
        ('{"tend": 1, "stepSize": 1e-9}', "line 1: stepSize: this is more than"),
        (
            '{"tend": 1, "outputSteps": 3,\n"simulation": "equilibrium"}',
            "line 2: simulation: there is no",
        ),
        ('{"tend": 1, "outputSteps": 3,\n"simulation": 3}', "line 2: simulation: there is no"),
        ('{"tend": 1, "outputSteps": 3,\n"Tend": 3}', "line 2: the key 'tend' is given a second"),
        ("[1]", "line 1: expected an object, not a list"),
    ],
)
def test_that_a_bad_analysis_is_refused(tmp_path, text, message):
    path = tmp_path / "a.acf"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(kc.ModelError) as caught:
        kc.read_analysis(path)
    assert caught.value.problems[0].startswith(f"{path}, {message}"), caught.value.problems


def test_that_steps_of_a_size_make_a_grid(tmp_path, caplog):
    path = tmp_path / "a.acf"
    path.write_text('{"simulation": "dynamics", "tend": 2, "stepSize": 0.5}', encoding="utf-8")
    assert kc.read_analysis(path).points == 5
    assert "Dynamics is asked for; its times are read, and the kinematics is solved" in caplog.text


# The six .acf files of rserban/simEngine2D, folder Models.
COURSE = {
    "dynamics": ("Dynamics", 10.0, 0.001, 1000), "finalExam": ("Dynamics", 4.0, 0.005, 400),
    "kinematics": ("Kinematics", 5.0, 0.01, 500), "project1": ("Kinematics", 5.0, 0.01, 300),
    "project2": ("Dynamics", 1.0, 0.001, 500), "shurikenCatapult": ("Kinematics", 5.0, 0.01, 500),
}  # fmt: skip


@pytest.mark.parametrize("change", [str, str.lower, str.upper, str.swapcase])
@pytest.mark.parametrize("name", COURSE)
def test_that_the_analyses_of_the_course_are_read_in_any_case(tmp_path, caplog, name, change):
    kind, end, step, count = COURSE[name]
    keys = [change(key) for key in ("simulation", "tend", "stepSize", "outputSteps")]
    content = dict(zip(keys, (change(kind), end, step, count), strict=True))
    path = tmp_path / f"{name}.acf"
    path.write_text(json.dumps(content, indent="\t"), encoding="utf-8")
    settings = kc.read_analysis(path)
    assert (settings.end, settings.points) == (end, count + 1)
    assert ("without masses and forces" in caplog.text) == (kind == "Dynamics")


@pytest.mark.parametrize("word", ["inverse dynamics", "Inverse-Dynamics", "INVERSE_DYNAMICS"])
def test_that_inverse_dynamics_has_times_too(tmp_path, caplog, word):
    path = tmp_path / "a.acf"
    path.write_text(f'{{"simulation": "{word}", "tend": 1, "outputSteps": 2}}', encoding="utf-8")
    assert kc.read_analysis(path).points == 3
    assert "InverseDynamics is asked for" in caplog.text


@pytest.mark.parametrize("change", [str.lower, str.upper, str.swapcase])
def test_that_types_and_keys_of_a_model_are_read_in_any_case(change):
    text = ADM
    for word in (
        "bodies", "constraints", "id", "q0", "type", "body1", "sP1", "vP1", "body2", "sP2", "vP2",
        "fun", "RevoluteJoint", "TranslationalJoint", "AbsoluteAngle", "RelativeDistance",
    ):  # fmt: skip
        text = text.replace(f'"{word}"', f'"{change(word)}"')
    assert text != ADM
    changed, usual = (read_adm(Path("arm.adm"), item.encode()) for item in (text, ADM))
    assert changed.to_toml() == usual.to_toml()
    with pytest.raises(kc.ModelError, match=r"line 8: constraint 'pin', sP1, entry 1: nan"):
        read_adm(Path("arm.adm"), text.replace("[-1, 0]", "[NaN, 0]").encode())


def test_that_an_analysis_is_an_acf_file(tmp_path):
    with pytest.raises(kc.InputError, match=r"an analysis from .*: one is a file ending in \.acf"):
        kc.read_analysis(tmp_path / "a.json")
