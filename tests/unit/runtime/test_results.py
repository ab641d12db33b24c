import csv
import json

import numpy as np
import pytest

from kincompile.errors import InputError
from kincompile.runtime.results.write import write
from kincompile.runtime.solve import solve
from kincompile.runtime.status import Status


@pytest.fixture
def partial(problem_3_5_6):
    """A solution with a failed point and one that was not tried."""
    return solve(problem_3_5_6, [0.1, 1 / 3, 5, 6])


@pytest.fixture
def whole(pendulum):
    """A solution of a mechanism with parameters."""
    return solve(pendulum, np.linspace(0, 1, 4), {"omega": 0.1})


def test_csv_reads_back_to_the_last_bit(partial, tmp_path):
    path = write(partial, tmp_path / "motion.csv")
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == [
        *("t [s]", "x2 [m]", "y2 [m]", "phi3 [rad]"),
        *("x2_dot [m/s]", "y2_dot [m/s]", "phi3_dot [rad/s]"),
        *("x2_ddot [m/s^2]", "y2_ddot [m/s^2]", "phi3_ddot [rad/s^2]", "status", "residual"),
    ]
    table = np.array(rows, dtype=float)
    np.testing.assert_array_equal(table[:, 0], partial.t)
    np.testing.assert_array_equal(table[:, 1:4], partial.q)
    np.testing.assert_array_equal(table[:, 4:7], partial.q_dot)
    np.testing.assert_array_equal(table[:, 7:10], partial.q_ddot)
    np.testing.assert_array_equal(table[:, 10], partial.status)
    np.testing.assert_array_equal(table[:, 11], partial.residual)
    assert [row[10] for row in rows] == ["0", "0", "7", "4"]
    assert path.read_bytes().count(b"\n") == 5
    assert b"\r" not in path.read_bytes()


def test_npz_reads_back_without_pickle(whole, tmp_path):
    path = write(whole, tmp_path / "motion.npz")
    with np.load(path, allow_pickle=False) as data:
        for name in ("t", "q", "q_dot", "q_ddot", "status", "residual", "iterations"):
            np.testing.assert_array_equal(data[name], getattr(whole, name))
        assert tuple(data["coordinates"]) == whole.coordinates
        assert tuple(data["equations"]) == whole.equations
        assert tuple(data["units"]) == ("m", "m", "rad")
        parameters = zip(data["parameters"].tolist(), data["parameter_values"], strict=True)
        assert dict(parameters) == whole.parameters
        assert str(data["name"]) == "pendulum"
        assert str(data["message"]) == whole.message
        assert bool(data["success"]) is True


def test_npz_of_a_mechanism_without_parameters_needs_no_pickle(partial, tmp_path):
    with np.load(write(partial, tmp_path / "motion.npz"), allow_pickle=False) as data:
        assert data["parameters"].shape == data["parameter_values"].shape == (0,)
        assert not data["success"]


def test_json_is_valid_and_reads_back(partial, tmp_path):
    text = write(partial, tmp_path / "motion.json").read_text(encoding="utf-8")

    def forbidden(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    document = json.loads(text, parse_constant=forbidden)
    for name in ("t", "q", "q_dot", "q_ddot", "residual"):
        values = np.array(document[name], dtype=float)  # null becomes NaN
        np.testing.assert_array_equal(values, getattr(partial, name))
    assert document["q"][3] == [None, None, None]
    assert document["status"] == partial.status.tolist()
    assert document["iterations"] == partial.iterations.tolist()
    assert document["statuses"]["4"] == Status.NOT_REACHED.sentence
    assert document["units"] == {"x2": "m", "y2": "m", "phi3": "rad"}
    assert document["coordinates"] == ["x2", "y2", "phi3"]
    assert document["equations"] == ["pin.x", "pin.y", "length"]
    assert document["name"] == "problem_3_5_6"
    assert document["success"] is False
    assert document["message"] == partial.message


def test_json_names_the_parameters(whole, tmp_path):
    document = json.loads(write(whole, tmp_path / "motion.json").read_text(encoding="utf-8"))
    assert document["parameters"] == {"omega": 0.1, "phi_0": np.pi / 2}


@pytest.mark.parametrize("suffix", ["csv", "npz", "json"])
def test_the_same_solution_gives_the_same_bytes(whole, tmp_path, suffix):
    first = write(whole, tmp_path / f"a.{suffix}").read_bytes()
    assert write(whole, str(tmp_path / f"b.{suffix.upper()}")).read_bytes() == first


@pytest.mark.parametrize("name", ["motion.xlsx", "motion", "csv"])
def test_another_suffix_is_refused(whole, tmp_path, name):
    with pytest.raises(InputError, match=rf"cannot write .*{name}: end its name in \.csv, \.npz"):
        write(whole, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(whole, tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        write(whole, tmp_path / "missing" / "motion.csv")
