"""`kincompile transmission`, the table of model files, and the example."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli
from tests import transmission_models as models

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "transmissions"
ANKLE = FOLDER / "ankle.toml"


def run(*arguments):
    return CliRunner().invoke(cli, ["transmission", *map(str, arguments)], prog_name="kincompile")


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "four_bar.toml"
    knee = models.crank_rocker(0.06, 0.30, 0.05, 0.305)
    path.write_text(knee.to_toml())
    return path


def test_that_the_table_of_a_file_is_tabulated():
    result = run(ANKLE)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0] == "ankle: (left [m], right [m]) -> (pitch [rad], roll [rad])"
    assert lines[1] == "6 poses"
    f = kc.transmission(kc.read_model(ANKLE), ["left", "right"], ["pitch", "roll"])
    u = np.array([0.24, 0.23])
    row = np.array([float(text) for text in lines[9].split()])
    wanted = *u, *f(u), *f.J(u).ravel(), *f.effort(u, [35, 0]), np.linalg.det(f.J(u))
    np.testing.assert_allclose(row, wanted, rtol=1e-5)
    assert "lock-up: foot" in lines[-1]


def test_that_options_say_what_a_table_does(four_bar):
    names = "--inputs", "motor", "--outputs", "rocker.phi"
    result = run(four_bar, *names, "--grid", "motor=0.5:60deg:3", "--effort", "rocker.phi=5")
    assert result.exit_code == 0, result.output
    rows = [line.split() for line in result.stdout.splitlines()[4:7]]
    golden = [0.5, 0.325043226472306, 1.72388737247146, 8.61943686235732]
    np.testing.assert_allclose([float(x) for x in rows[0][:4]], golden, rtol=1e-5)
    assert float(rows[2][0]) == pytest.approx(np.pi / 3, rel=1e-5)
    # The ends of the input are those of the table: positions of type 2.
    limits = result.stdout.splitlines()[-1].split()
    assert [float(limits[3]), float(limits[7])] == pytest.approx([0.369863, 2.356], abs=1e-4)


def test_that_degrees_are_shown(four_bar):
    result = run(four_bar, "--inputs", "motor", "--outputs", "rocker.phi", "--deg")
    assert "motor [deg]" in result.stdout
    assert float(result.stdout.splitlines()[4].split()[0]) == pytest.approx(np.degrees(1.5), 1e-5)


def test_that_poses_that_are_not_reached_end_with_3(four_bar):
    names = "--inputs", "motor", "--outputs", "rocker.phi"
    result = run(four_bar, *names, "--grid", "motor=1:2.5:2")
    assert result.exit_code == 3
    assert "nan" in result.stdout
    assert "1 of 2 poses were not reached, the first at motor = 2.5" in result.stderr


def spheres(motors):
    """Return the platform of the delta: where three spheres about the elbows meet, below."""
    turns = 2 * np.pi * np.arange(3) / 3
    out = 0.2 + 0.25 * np.cos(motors) - 0.05
    centres = np.stack([out * np.cos(turns), out * np.sin(turns), -0.25 * np.sin(motors)], axis=1)
    # The planes between spheres give a line: its points are first + s along.
    rows = 2 * (centres[1:] - centres[0])
    right = (centres[1:] ** 2).sum(axis=1) - (centres[0] ** 2).sum()
    first = np.linalg.lstsq(rows, right, rcond=None)[0]
    along = np.cross(*rows) / np.linalg.norm(np.cross(*rows))
    along *= -np.sign(along[2])
    apart = first - centres[0]
    half = apart @ along
    return first + (np.sqrt(half**2 - apart @ apart + 0.25) - half) * along


@pytest.mark.slow
def test_that_a_slice_of_three_inputs_is_tabulated():
    """The third input of the delta is held by the table, or by an option with one value."""
    path = FOLDER / "delta.toml"
    for options, third in (((), 0.7), (("--grid", "motor_3=30deg"), np.pi / 6)):
        result = run(path, *options)
        assert result.exit_code == 0, result.output
        lines = result.stdout.splitlines()
        assert lines[1] == "6 poses"
        rows = np.array([[float(text) for text in line.split()[:6]] for line in lines[4:10]])
        np.testing.assert_allclose(rows[:, 2], third, rtol=1e-5)
        for row in rows:
            motors = *row[:2], third
            np.testing.assert_allclose(row[3:], spheres(np.array(motors)), atol=1e-5)


WRONG = [
    ((), "has no table [transmission]. Add one; its fields are: inputs, outputs, grid, efforts"),
    (("--inputs", "moter", "--outputs", "rocker.phi"), "did you mean 'motor'?"),
    (("--inputs", "motor", "--outputs", "rocker.phi", "--grid", "motor=1:2"), "NAME=FIRST:LAST:CO"),
    (("--inputs", "motor", "--outputs", "rocker.phi", "--grid", "motor=1:2:0"), "with a count of"),
    (("--inputs", "motor", "--outputs", "rocker.phi", "--grid", "moter=1:2:3"), "no input or outp"),
    (("--inputs", "motor", "--outputs", "rocker.phi", "--effort", "psi=3"), "no input or output"),
    (("--inputs", "motor", "--outputs", "rocker.phi", "--effort", "rocker.phi=x"), "give NAME=VAL"),
]


@pytest.mark.parametrize(("options", "message"), WRONG)
def test_that_wrong_options_are_named(four_bar, options, message):
    result = run(four_bar, *options)
    assert result.exit_code == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr


TABLES = [
    ('inputs = ["left"]', "outputs"),
    ('inputs = "left"\noutputs = ["roll"]', "expected a list of names in quotes"),
    (
        'inputs = ["left"]\noutputs = ["roll"]\ngrid = { left = { from = 1, to = 2 } }',
        "give it a c",
    ),
    ('inputs = ["left"]\noutputs = ["roll"]\nefforts = { roll = "" }', "efforts"),
]


@pytest.mark.parametrize(("table", "message"), TABLES)
def test_that_wrong_tables_are_named(tmp_path, table, message):
    path = tmp_path / "ankle.toml"
    path.write_text(ANKLE.read_text().partition("[transmission]")[0] + f"[transmission]\n{table}\n")
    result = run(path)
    assert result.exit_code == 2
    assert message in result.stderr


EXAMPLES = {
    "ankle": "actuators [0.207166 0.213622] m",  # golden, T3-SPU pose 2
    "crank_rocker": "ratio of the rates [0.4662,",
    "delta": "motors [0.633316 0.506013 0.753213] rad",  # by three spheres, at (0, 0.05, -0.5)
    "five_bar": "motors [1.830595 0.942654] rad",  # golden, T6, the inverse at (0.02, 0.15)
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "delta")) for name in EXAMPLES]
)
def test_that_an_example_is_the_same_as_data_and_prints_what_it_says(capsys, name):
    model = runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")["m"]
    assert EXAMPLES[name] in capsys.readouterr().out
    read = kc.read_model(FOLDER / f"{name}.toml")
    assert kc.emit(read).source == kc.emit(model).source
    assert "transmission" in json.dumps(dict(read.tasks))
    assert run(FOLDER / f"{name}.toml").exit_code == 0


def test_that_there_is_a_test_of_every_example():
    assert {path.stem for path in FOLDER.iterdir() if path.suffix} == set(EXAMPLES)


def test_that_a_model_with_a_table_is_written_with_it():
    assert kc.read_model(ANKLE).to_toml().endswith(ANKLE.read_text().partition("\n\n")[2][-200:])


def test_that_the_ratio_of_a_crank_rocker_is_that_of_the_textbook():
    f = kc.transmission(kc.read_model(FOLDER / "crank_rocker.toml"), ["motor"], ["rocker.phi"])
    poses = f.at(np.linspace(0, 2 * np.pi, 25)[:, np.newaxis])
    names = [f.module.COORDINATES.index(f"phi_{body}") for body in ("crank", "coupler", "rocker")]
    crank, coupler, rocker = poses.q[:, names].T
    ratio = 0.04 * np.sin(coupler - crank) / (0.08 * np.sin(coupler - rocker))
    np.testing.assert_allclose(poses.J[:, 0, 0], ratio, rtol=1e-11, atol=1e-13)
