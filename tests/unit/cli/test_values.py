"""Numbers behind options: degrees and formulas; the times of a motion."""

import csv
import json
from typing import Any

import numpy as np
import pytest

MODEL = """
import kincompile as kc
m = kc.Mechanism("slider_crank", points=25)
n = m.parameter("n", 30, unit="rpm")
phi0 = m.parameter("phi0", 30 * kc.deg, unit="rad")
theta = m.parameter("theta", 30 * kc.deg, unit="deg")
L = m.parameter("L", 0.3, unit="m")
m.end = 60 / n
crank, rod, slider = m.body("crank"), m.body("rod", (0.25, 0, 0)), m.body("slider", (0.4, 0, 0))
m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
m.add(kc.Revolute("A", crank, (0.1, 0), rod, (-L / 2, 0)))
m.add(kc.Revolute("B", rod, (L / 2, 0), slider, (0, 0)))
m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), slider, (0, 0), (1, 0)))
m.add(kc.AbsoluteAngle("motor", crank, phi0 + 0 * theta + 2 * kc.pi * kc.t * n / 60))
"""


@pytest.fixture
def model(tmp_path) -> str:
    """Return the file of a slider-crank whose end is a revolution."""
    path = tmp_path / "model.py"
    path.write_text(MODEL, encoding="utf-8")
    return str(path)


@pytest.fixture
def motion(kincompile, model, tmp_path):
    """Return a function that runs the model with options and returns the columns it writes."""

    def written(*options: str) -> Any:
        result = kincompile("run", model, *options, "-o", str(tmp_path / "motion.csv"))
        assert result.exit_code == 0, result.stderr
        with (tmp_path / "motion.csv").open(encoding="utf-8") as file:
            rows = list(csv.reader(file))
        return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))

    return written


def test_that_the_end_is_a_revolution_at_any_speed(motion):
    assert motion()["t [s]"][[0, -1]].tolist() == [0, 2]
    assert motion("--set", "n=120")["t [s]"][[0, -1]].tolist() == [0, 0.5]
    t = motion("--start", "15/n", "--end", "30/n", "--points", "3")["t [s]"]
    assert t.tolist() == [0.5, 0.75, 1]


def test_that_degrees_are_read_and_shown(motion):
    columns = motion("--set", "phi0=-15deg", "--deg", "--points", "5")
    assert columns["phi_crank [deg]"] == pytest.approx([-15, 75, 165, 255, 345], abs=1e-12)
    assert columns["phi_crank_dot [deg/s]"] == pytest.approx([180] * 5)
    x, y = 0.1 * np.cos(np.pi / 12), 0.1 * np.sin(np.pi / 12)
    assert columns["x_slider [m]"][0] == pytest.approx(x + np.sqrt(0.09 - y**2))
    columns = motion("--set", "phi0=pi/6", "--points", "2")
    assert columns["phi_crank [rad]"][0] == pytest.approx(np.pi / 6)


def test_that_all_files_and_the_summary_have_degrees(model, kincompile, tmp_path):
    done = kincompile("run", model, "--deg")
    assert "phi_crank   deg" in done.stdout
    assert "180" in next(line for line in done.stdout.splitlines() if line.startswith("phi_crank"))
    for name in ("motion.json", "motion.npz"):
        assert kincompile("run", model, "--deg", "-o", str(tmp_path / name)).exit_code == 0
    data = json.loads((tmp_path / "motion.json").read_text(encoding="utf-8"))
    with np.load(tmp_path / "motion.npz") as file:
        arrays = dict(file)
    column = data["coordinates"].index("phi_crank")
    assert (data["units"]["phi_crank"], arrays["units"][column]) == ("deg", "deg")
    assert data["units"]["phi0"] == "rad"
    assert np.array(data["q"])[:, column] == pytest.approx(np.linspace(30, 390, 25))
    assert arrays["q_dot"][:, column] == pytest.approx([180] * 25)
    assert data["parameters"]["theta"] == 30


def test_a_grid_in_crank_angle(motion):
    columns = motion("--set", "phi0=0", "--grid", "crank.phi=0:360deg:30deg", "--deg")
    assert columns["phi_crank [deg]"] == pytest.approx(np.arange(0, 361, 30), abs=1e-9)
    assert columns["t [s]"] == pytest.approx(np.arange(13) / 6, abs=1e-9)


WRONG = {
    "--set L=30deg": "30*deg is in degrees, and this is no angle but in m",
    "--set crank=30deg": "there is no parameter 'crank'",
    "--set phi0=open(3)": "'open' is not a function",
    "--end m/2": "--end m/2: give a time, such as 0.25 or 30deg: there is no 'm'",
    "--start 1/0": "this divides by zero",
    "--start inf": "--start inf: give a finite time",
    "--grid crank.phi": "write NAME=FIRST:LAST:STEP",
    "--grid crank.phi=0:360deg:-1": "give a step that leads from the first value to the last",
    "--grid crank.phi=0:360deg:1deg": "crank.phi goes from 0.523599 to 6.80678",
    "--grid slider.x=0.2:0.4:1deg": "give numbers; deg is in degrees",
}


@pytest.mark.parametrize("options", WRONG)
def test_that_wrong_values_are_told(model, kincompile, options):
    result = kincompile("run", model, *options.split())
    assert result.exit_code == 2
    assert WRONG[options] in result.stderr
