"""Every example runs as a script, says that it converged, and prints figures a person can check."""

import re
import runpy

import numpy as np
import pytest

FIGURES = {
    "simple_pendulum": "1.728969 1.684547",
    "problem_3_5_6": "0.38125  0.121031 1.065436",
    "example_3_7_5": "1.118034 1.570796 0.841069",
    "slider_crank": "x = 7.128183, x_dot = -9.660867",
    "double_pendulum": "0.866367  1.245624  0.841471",
    "four_bar": "phi_coupler = 0.276250, phi_rocker = 4.388911",
    "inverted_slider_crank": "t = 2  phi_guide = -0.251606",
    "wrecker_boom": "boom angle from 10.99 to 54.08 degrees",
    "gear_train": "turns of the arm: 1.000000",
    "rack_and_pinion": "pinion +2.000 rad, rack +0.1000 m",
    "cam_flat_follower": "highest: 60.000 mm at a cam angle of 270 degrees",
    "jansen": "the foot steps 67.908 mm and lifts 22.457 mm",
    "klann": "the foot steps 64.194 mm and lifts 31.271 mm",
    "shaper": "the slow stroke takes 1.332802 times as long as the fast one",
    "double_wishbone": "camber from +0.000 to +0.561 degrees",
    "cam_by_table": "highest: 60.000 mm at a cam angle of 270 degrees",
    "swing_and_dwell": "the arm's largest speed is 1.760 times the mean of its swing",
    "balanced_four_bar": "share 1.0: shaking force swings by 0.000 N",
    "slot_follower": "back at 152.95, where it was: 152.95",
}


def test_that_it_prints_its_figures(example, capsys):
    runpy.run_path(str(example.path), run_name="__main__")
    printed = capsys.readouterr().out
    name, points = example.path.stem, example.model.points
    assert printed.startswith(f"{name}: all {points} points converged")
    assert FIGURES[name] in printed


def test_that_it_solves_over_its_whole_grid(example):
    assert example.solution.success, example.solution.message
    assert not example.solution.status.any()
    assert np.all(example.solution.residual < 1e-12)


def test_that_it_is_named_as_its_file_and_says_its_source(example):
    docstring = runpy.run_path(str(example.path))["__doc__"]
    assert example.model.name == example.path.stem
    assert re.search(
        r"^Source: .*(R\d+|reference cases|catalogue|linkage of|dimensions ours)",
        docstring,
        re.MULTILINE,
    )


@pytest.mark.parametrize("word", ["lock", "4.5"])
def test_that_the_example_that_stops_early_says_why(example_named, word):
    path = example_named("problem_3_5_6").path
    assert word in runpy.run_path(str(path))["__doc__"]
