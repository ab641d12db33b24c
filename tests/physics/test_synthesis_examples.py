"""The examples of synthesis run as scripts, and say what the docs say."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.design.task_tables import read_fit

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "synthesis"


def run(name, capsys):
    found = runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
    return found, capsys.readouterr().out


@pytest.mark.slow
def test_that_the_fit_makes_the_dwell_longer(capsys):
    found, said = run("dwell_six_bar", capsys)
    assert "dwell_six_bar reaches all targets" in said
    rests, swings = (
        [float(x) for x in re.findall(pattern, said)]
        for pattern in (r"rests for ([\d.]+)", r"swings by ([\d.]+)")
    )
    assert rests[0] == 126.5
    assert rests[1] > 150
    assert swings == pytest.approx([36.1, 36.3], abs=0.25)
    path = FOLDER / "dwell_six_bar.toml"
    model = kc.read_model(path)
    assert kc.emit(model).source == kc.emit(found["mechanism"]).source
    given = read_fit(path, model)
    assert repr(given.pop("targets")) == repr(found["targets"])
    assert given["bounds"] == found["bounds"]
    assert (given["samples"], given["starts"]) == (8, 2)


def test_that_five_poses_are_met(capsys):
    found, said = run("five_poses", capsys)
    assert "five_poses: all" in said
    assert "12 four-bars, of which 4 go through the poses in their order" in said
    (off,) = re.findall(r"off the poses by (\S+) cm", said)
    assert float(off) < 1e-9
    # The links of the cognates, by the triangles of Roberts, which are similar to the coupler's.
    O, A, B, C, P = found["linkages"][0].places  # noqa: N806, E741
    other = [abs(x) for x in ((C - O) * (P - A) / (B - A), P - A, (B - C) * (P - A) / (B - A))]
    printed = re.findall(r"the same path: (.*)", said)
    lengths = [sorted(float(x) for x in line.split(", ")) for line in printed]
    assert any(all(min(abs(np.array(own) - x)) < 1e-3 for x in other) for own in lengths)


def test_that_there_is_a_test_of_every_example():
    names = {"dwell_six_bar.py", "dwell_six_bar.toml", "five_poses.py", "five_poses.toml"}
    assert {path.name for path in FOLDER.iterdir() if path.suffix} == names
