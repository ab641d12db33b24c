"""Points, joints and outputs as columns of a solution."""

import json
import pickle
import re

import numpy as np
import pytest

import kincompile as kc
from kincompile import outputs
from kincompile.runtime.results.write import summary

A, L = 0.06, 0.26


@pytest.fixture(scope="module")
def model():
    m = kc.Mechanism("observed")
    length = m.parameter("L", L, unit="m")
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (0.1, 0, 0))
    end = m.point("end", rod, (length / 2, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (-A / 2, 0)))
    m.add(kc.Revolute("A", crank, (A / 2, 0), rod, (-length / 2, 0)))
    m.add(kc.AbsoluteY("guide", end, 0))
    m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t))
    m.output("travel", end.x - (L - A), "m")
    m.output("pull", outputs.acceleration(end), "m/s^2")
    return m


@pytest.fixture(scope="module", params=["numpy", "c"])
def solution(request, model):
    request.getfixturevalue("quick_compiler")
    return kc.solve(kc.compile(model, target=request.param), np.linspace(0, 1, 101))


def piston(t):
    """Return position and velocity of the end of a slider-crank's rod."""
    angle, w = 2 * np.pi * t, 2 * np.pi
    root = np.sqrt(L**2 - (A * np.sin(angle)) ** 2)
    x = A * np.cos(angle) + root
    return x, -A * w * np.sin(angle) * (1 + A * np.cos(angle) / root)


def test_that_a_point_is_a_column_with_its_rates(solution):
    x, x_dot = piston(solution.t)
    np.testing.assert_allclose(solution["end.x"], x, atol=1e-13)
    np.testing.assert_allclose(solution["x_end_dot"], x_dot, atol=1e-12)
    np.testing.assert_allclose(solution["travel"], x - (L - A), atol=1e-13)
    np.testing.assert_allclose(solution["pull"], np.abs(solution["end.x_ddot"]), atol=1e-9)
    assert np.isnan(solution["pull_dot"]).all()
    assert solution.column("travel_ddot").unit == "m/s^2"


def test_that_a_joint_is_a_point_too(solution):
    angle = 2 * np.pi * solution.t
    np.testing.assert_allclose(solution["A.x"], A * np.cos(angle), atol=1e-14)
    np.testing.assert_allclose(solution["A.y_dot"], 2 * np.pi * A * np.cos(angle), atol=1e-13)
    np.testing.assert_allclose(solution["O.x"], 0, atol=1e-15)
    assert "x_A" not in solution.names


def test_that_variants_have_outputs_of_their_own(model):
    lengths = np.array([0.2, 0.26, 0.4])
    t = np.linspace(0, 1, 40)
    several = kc.solve(kc.compile(model), t, lengths.reshape(-1, 1, 1))
    for row, length in zip(several["end.x"], lengths, strict=True):
        alone = kc.solve(kc.compile(model), t, {"L": length})
        np.testing.assert_allclose(row, alone["end.x"], atol=1e-13)


def test_that_where_the_motion_ends_outputs_end(model):
    module = kc.compile(model)
    found = kc.solve(module, np.linspace(0, 1, 101), {"L": 0.055})
    assert not found.success
    known = found.status == 0
    assert known.any()
    assert np.isfinite(found["travel"][known]).all()
    assert np.isnan(found["travel"][~known]).all()


def test_that_files_and_tables_have_them(solution, tmp_path):
    kc.write(solution, tmp_path / "a.csv")
    header = (tmp_path / "a.csv").read_text().splitlines()[0]
    for title in ("x_end [m]", "y_end_dot [m/s]", "travel_ddot [m/s^2]", "pull [m/s^2]"):
        assert title in header.split(","), title
    kc.write(solution, tmp_path / "a.json")
    data = json.loads((tmp_path / "a.json").read_text())
    assert data["outputs"] == ["x_end", "y_end", "travel", "pull"]
    np.testing.assert_array_equal(np.array(data["y"])[:, 2], solution["travel"])
    kc.write(solution, tmp_path / "a.npz")
    np.testing.assert_array_equal(np.load(tmp_path / "a.npz")["y"][:, 2], solution["travel"])
    assert re.search(r"\ntravel +m +0 +0\.5 ", summary(solution))
    assert "travel" in solution._repr_html_()


def test_that_a_pickled_solution_keeps_them(solution):
    copy = pickle.loads(pickle.dumps(solution))
    np.testing.assert_array_equal(copy["travel_dot"], solution["travel_dot"])


def test_that_joints_nobody_asked_for_are_not_pickled(model):
    copy = pickle.loads(pickle.dumps(kc.solve(kc.compile(model), 0.1)))
    with pytest.raises(kc.InputError, match="read its joints before pickling"):
        copy["A.x"]


def test_that_an_unknown_column_is_refused_with_the_outputs(solution):
    with pytest.raises(kc.InputError, match=r"the outputs x_end, y_end, travel, pull; add _dot"):
        solution["nothing"]
