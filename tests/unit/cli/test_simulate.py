"""`kincompile simulate`: motions that follow from forces, written as any motion."""

import csv
import math

import pytest

import kincompile as kc

MODEL = """
kincompile = 1
name = "drop"
gravity = [0, -10]
analysis = { end = 1.0, points = 5 }
bodies = [{ name = "stone", mass = 2, inertia = 1 }]
constraints = [
    { type = "AbsoluteX", name = "wire", body = "stone", point = [0, 0], value = 0 },
    { type = "AbsoluteAngle", name = "level", body = "stone", angle = 0 },
]
"""


@pytest.fixture
def drop(tmp_path):
    """Return the file of a stone that slides down a wire."""
    path = tmp_path / "drop.toml"
    path.write_text(MODEL, encoding="utf-8")
    return path


def test_that_a_stone_falls_and_its_energies_are_written(kincompile, drop, tmp_path):
    done = kincompile("simulate", drop, "--position", "stone.y=3", "-o", tmp_path / "fall.csv")
    assert (done.exit_code, done.stdout) == (0, "")
    assert "5 CONVERGED" in done.stderr
    with (tmp_path / "fall.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["y_stone [m]"]) == pytest.approx(3 - 5)
    assert float(rows[-1]["kinetic_energy [J]"]) == pytest.approx(100)
    assert float(rows[-1]["work [J]"]) == pytest.approx(100)


def test_that_a_stop_and_the_forces_are_in_the_summary(kincompile, drop):
    options = ("--velocity", "stone.y_dot=5", "--stop", "stone.y=0.5", "--forces")
    done = kincompile("simulate", drop, *options)
    assert (done.exit_code, done.stderr) == (0, "")
    # 5 t - 5 t^2 = 1/2 on the way up.
    time = (1 - math.sqrt(0.6)) / 2
    assert f"comes to its stop, 0.5, at t = {time:.10g}" in done.stdout
    assert "drop: forces" in done.stdout


def test_that_the_right_side_is_compiled_for_other_integrators(kincompile, drop, tmp_path):
    done = kincompile("compile", drop, "--dynamics", "-o", tmp_path / "own.py")
    assert (done.exit_code, done.stderr) == (0, f"Wrote {tmp_path / 'own.py'}\n")
    module = kc.load(tmp_path / "own.py")
    assert module.accelerations([0, 1, 0], [0, 0, 0], 0.0).tolist() == [0, -10, 0]
    (tmp_path / "light.toml").write_text(
        MODEL.replace("mass = 2, inertia = 1", "guess = [0, 1, 0]")
    )
    light = kincompile("compile", tmp_path / "light.toml", "--dynamics", "-o", "-")
    assert (light.exit_code, light.stdout) == (2, "")
    assert "no masses" in light.stderr


def test_that_of_two_stops_the_first_that_is_met_ends_the_motion(kincompile, drop):
    options = ("--velocity", "stone.y_dot=5", "--stop", "stone.y=0.5", "--stop", "stone.y=-1")
    done = kincompile("simulate", drop, *options)
    assert "comes to its stop, 0.5" in done.stdout


def test_that_a_motion_that_ends_early_is_written_and_what_cannot_be_is_said(
    kincompile, drop, tmp_path
):
    tail = '\n[[loads]]\ntype = "Force"\nname = "F"\nbody = "stone"\npoint = [0, 0]\n'
    (tmp_path / "early.toml").write_text(MODEL + tail + 'force = [0, "1/(t - 0.5)"]\n')
    out = tmp_path / "early.csv"
    done = kincompile("simulate", tmp_path / "early.toml", "-o", out)
    assert done.exit_code == 3
    assert "stopped at t = 0.5" in done.stderr
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert math.isfinite(float(rows[1]["y_stone [m]"]))
    assert rows[-1]["y_stone [m]"] == "nan"
    for wrong in (("--rtol", "nan"), ("--method", "Euler"), ("--stop", "stone.z=1"),
                  ("--velocity", "stone.y_dot"), ("--end", "nan"), ("--set", "L=2")):  # fmt: skip
        assert kincompile("simulate", drop, *wrong).exit_code == 2


def test_that_mistakes_are_messages(kincompile, drop):
    done = kincompile("simulate", drop, "--position", "ston.y=3")
    assert done.exit_code == 2
    assert "there is no coordinate 'ston.y'; did you mean 'y_stone'?" in done.stderr
    assert kincompile("simulate", drop, "--points", "1", "--end", "0").exit_code == 2
    over = kincompile("simulate", drop, "--position", "stone.x=3")
    assert over.exit_code == 3
    assert "cannot begin" in over.stderr
