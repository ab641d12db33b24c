"""`kincompile assemblies`, and `--assembly` of run and view."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli

MODEL = """
import kincompile as kc

s = kc.Sketch("four_bar", end=2.0, points=21)
s.ground(O=(0, 0), C=(20, 0))
s.joints(A=(10, 0), B=(20, 20))
s.link("crank", "O A", 10)
s.link("coupler", "A B", 26)
s.link("rocker", "C B", 18)
s.drive("crank", kc.t * s.parameter("omega", 1.5))
mechanism = s.mechanism()
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "four_bar.py"
    path.write_text(MODEL)
    return path


def run(*arguments):
    return CliRunner().invoke(cli, [str(item) for item in arguments])


def test_that_it_lists_what_differs(model):
    done = run("assemblies", model)
    assert done.exit_code == 0
    heading, _, header, *rows = done.stdout.splitlines()
    assert heading == "four_bar: 2 assemblies at t = 0; the coordinates that differ"
    assert header.split() == ["coordinate", "unit", "1", "2"]
    assert [row.split()[0] for row in rows] == ["phi_coupler", "phi_rocker"]
    found = kc.assemblies(kc.compile(kc.read_model(model)))
    values = np.array([row.split()[2:] for row in rows], dtype=float)
    np.testing.assert_allclose(values, found[:, [5, 8]].T, rtol=1e-5)
    *_, last = run("assemblies", model, "--deg").stdout.splitlines()
    name, unit, *degrees = last.split()
    assert (name, unit) == ("phi_rocker", "deg")
    np.testing.assert_allclose(np.array(degrees, dtype=float), np.degrees(found[:, 8]), rtol=1e-5)


def test_that_it_lists_those_of_a_time_and_of_parameters(model):
    done = run("assemblies", model, "--time", 1, "--set", "omega=0.5")
    found = kc.assemblies(kc.compile(kc.read_model(model)), 1.0, {"omega": 0.5})
    assert "at t = 1;" in done.stdout
    assert f"{found[1, 5]:.6g}" in done.stdout


def test_that_run_and_view_start_in_the_one_that_is_named(model, tmp_path):
    found = kc.assemblies(kc.compile(kc.read_model(model)))
    for number in (1, 2):
        written = tmp_path / f"{number}.json"
        assert run("run", model, "--assembly", number, "-o", written).exit_code == 0
        first = json.loads(written.read_text())["q"][0]
        assert first == pytest.approx(found[number - 1])
    assert run("view", model, "--assembly", 2, "-o", tmp_path / "page.html").exit_code == 0
    done = run("run", model, "--assembly", 3)
    assert (done.exit_code, "four_bar has 2 assemblies at t = 0" in done.stderr) == (2, True)


def test_that_a_page_draws_each_and_says_how_far_it_moves(model, tmp_path):
    page = tmp_path / "assemblies.html"
    assert run("assemblies", model, "-o", page).exit_code == 0
    text = page.read_text()
    assert "<h1>Assemblies of four_bar at t = 0</h1>" in text
    assert re.findall(r"<strong>(.*?)</strong> <span>(.*?)</span>", text) == [
        ("Assembly 1", "moves to the end"),
        ("Assembly 2", "moves to the end"),
    ]
    assert text.count('<div class="card">') == 2
    # In one frame, so that a pivot of the ground stands in the same place.
    first, second = re.findall(r'"extent":(\[.*?\])', text)
    assert first == second
    low, high = json.loads(first)[2:]
    assert (low < -18, high > 18) == (True, True)


@pytest.mark.filterwarnings("default")
def test_that_a_start_without_a_guess_is_the_first_line_of_what_run_says(model):
    model.write_text(MODEL.replace("B=(20, 20)", "B=(40, 0)"))
    done = run("run", model)
    assert done.exit_code == 0
    assert done.stderr.startswith("Warning: four_bar: the guess lies folded, and there are 2")


def test_that_a_mechanism_that_cannot_be_assembled_is_told(model, tmp_path):
    model.write_text(MODEL.replace('"A B", 26', '"A B", 60'))
    done = run("assemblies", model, "-o", tmp_path / "page.html")
    assert (done.exit_code, not (tmp_path / "page.html").exists()) == (3, True)
    assert "four_bar cannot be assembled at t = 0" in done.stderr


def test_that_a_page_of_another_kind_is_refused_first(tmp_path):
    done = run("assemblies", tmp_path / "none.py", "-o", tmp_path / "page.pdf")
    assert (done.exit_code, "end its name in .html" in done.stderr) == (2, True)
