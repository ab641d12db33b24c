"""Arrays of parameters: by name, in pairs or every combination, and an axis of the result."""

import csv

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli

TIMES = np.linspace(0, 2, 40)
A, B = np.array([9.0, 10.0, 11.0]), np.array([24.0, 26.0])


@pytest.fixture(params=["numpy", "c", "grouped"])
def module(request, example_named, quick_compiler):
    example = example_named("four_bar")
    if request.param == "grouped":
        return kc.compile(example.model, form="grouped")
    return example.native if request.param == "c" else example.module


def alone(module, **p):
    """Return the motion of one parameter set."""
    return kc.solve(module, TIMES, p)


@pytest.mark.parametrize("values", [A, A.tolist(), tuple(A)])
def test_that_an_array_solves_each_of_its_values(module, values):
    solution = kc.solve(module, TIMES, {"a": values, "d": 21.0})
    assert solution.success
    assert solution.q.shape == (3, 40, 9)
    np.testing.assert_array_equal(solution.parameters["d"], [21.0] * 3)
    for k, a in enumerate(A):
        expected = alone(module, a=a, d=21.0)
        np.testing.assert_allclose(solution.q_ddot[k], expected.q_ddot, atol=1e-8)
        one = solution.variant(k)
        assert one.parameters == expected.parameters
        np.testing.assert_array_equal(one["phi_rocker"], solution["phi_rocker"][k])


def test_that_several_arrays_go_in_pairs(module):
    solution = kc.solve(module, TIMES, {"a": A[:2], "b": B})
    for k in range(2):
        np.testing.assert_allclose(solution.q[k], alone(module, a=A[k], b=B[k]).q, atol=1e-9)
    data = solution.to_xarray()
    assert data["phi_rocker"].dims == ("variant", "t")
    np.testing.assert_array_equal(data["a"], A[:2])
    np.testing.assert_array_equal(data["b"], B)
    assert data["b"].dims == ("variant",)


def test_that_every_combination_is_solved_on_request(module):
    solution = kc.solve(module, TIMES, {"a": A, "b": B}, product=True)
    data = solution.to_xarray()
    assert data["phi_rocker"].dims == ("a", "b", "t")
    assert data["a"].attrs == {"units": "m"}
    for a in A:
        for b in B:
            found = data["phi_rocker"].sel(a=a, b=b)
            np.testing.assert_allclose(found, alone(module, a=a, b=b)["phi_rocker"], atol=1e-9)


def test_that_one_array_is_an_axis_with_its_name(module):
    data = kc.solve(module, TIMES, {"a": A}).to_xarray()
    assert data["phi_rocker"].dims == ("a", "t")
    assert data["status"].dims == ("a", "t")
    np.testing.assert_array_equal(data["a"], A)


def test_that_sets_without_names_keep_the_parameters_that_differ(example_named):
    module = example_named("four_bar").module
    sets = np.tile(module.DEFAULTS, (2, 1, 1))
    sets[1, 0, 1] = 24.0
    data = kc.solve(module, TIMES, sets).to_xarray()
    assert data["phi_rocker"].dims == ("variant", "t")
    np.testing.assert_array_equal(data["b"], [26.0, 24.0])
    assert "a" not in data.coords
    single = kc.solve(module, TIMES, sets[:1]).to_xarray()
    assert single["phi_rocker"].shape == (1, 40)


def test_that_a_table_and_a_file_have_the_values_in_front(example_named, tmp_path):
    module = example_named("four_bar").module
    solution = kc.solve(module, TIMES, {"a": A, "b": B}, product=True)
    table = solution.to_pandas()
    assert table.index.names == ["a", "b", "t"]
    expected = alone(module, a=10.0, b=24.0)["phi_rocker"]
    np.testing.assert_allclose(table.loc[10.0, 24.0]["phi_rocker"], expected, atol=1e-9)
    with kc.write(solution, tmp_path / "sets.csv").open() as file:
        header, *rows = csv.reader(file)
    assert header[:4] == ["a [m]", "b [m]", "t [s]", "x_crank [m]"]
    assert len(rows) == 6 * 40
    assert [float(x) for x in rows[3 * 40 + 1][:3]] == [10.0, 26.0, TIMES[1]]
    column = header.index("phi_rocker [rad]")
    found = [float(row[column]) for row in rows[2 * 40 : 3 * 40]]
    np.testing.assert_array_equal(found, solution["phi_rocker"][2])


@pytest.mark.parametrize(
    ("p", "message"),
    [
        (
            {"a": A, "b": B},
            r"different numbers, 3 of 'a', 2 of 'b': arrays are taken in pairs, so give them one "
            r"length, or product=True \(--product\) to solve every combination, 6 of them",
        ),
        ({"a": []}, r"parameter 'a' has the values \[\]: give real numbers"),
        ({"a": ["x", "y"]}, "parameter 'a' has the values"),
        ({"a": [9.0, np.nan]}, "parameter 'a' is nan: give a finite number"),
        ({"x": A}, "there is no parameter 'x'"),
        ({"a": np.ones((2, 2))}, r"parameter 'a' has shape \(2, 2\)"),
    ],
)
def test_what_is_said_of_bad_arrays(example_named, p, message):
    with pytest.raises(kc.InputError, match=message):
        kc.solve(example_named("four_bar").module, TIMES, p)


def test_that_bad_arrays_and_all_else_are_told_at_once(example_named):
    with pytest.raises(kc.InputError) as caught:
        kc.solve(example_named("four_bar").module, [0, np.nan], {"a": A, "b": B, "x": 1})
    assert len(caught.value.problems) == 3


@pytest.mark.parametrize("number", [3, -4])
def test_that_a_variant_that_is_not_there_is_refused(example_named, number):
    module = example_named("four_bar").module
    solution = kc.solve(module, TIMES, {"a": A})
    with pytest.raises(kc.InputError, match="has 3 variants, counted from 0: there is no"):
        solution.variant(number)
    with pytest.raises(kc.InputError, match="has no variants"):
        solution.variant(0).variant(0)


def run(example, *arguments):
    return CliRunner().invoke(cli, ["run", str(example.path.with_suffix(".toml")), *arguments])


def test_that_run_sweeps(example_named, tmp_path):
    example, path = example_named("four_bar"), tmp_path / "sweep.csv"
    done = run(example, "--points", "20", "--sweep", "a=9:11:3")
    assert done.exit_code == 0
    head, *rows = done.stdout.splitlines()
    assert head.split()[:5] == ["a", "[m]", "points", "found", head.split()[4]]
    assert [row.split()[:4] for row in rows] == [[a, "20", "of", "20"] for a in ("9", "10", "11")]
    model = kc.read_model(example.path)
    t = np.linspace(0, model.end, 20)
    least = kc.solve(kc.compile(model), t, {"a": 10.0})[head.split()[4]].min()
    assert float(rows[1].split()[4]) == pytest.approx(least, rel=1e-5)
    sweeps = ("--sweep", "a=9:11:3", "--sweep", "b=24:26:2")
    done = run(example, "--points", "20", *sweeps, "--product", "-o", str(path))
    assert (done.exit_code, len(path.read_text().splitlines())) == (0, 1 + 6 * 20)
    done = run(example, *sweeps)
    assert (done.exit_code, "--product" in done.stderr) == (2, True)


@pytest.mark.parametrize("sweep", ["a", "a=1", "a=1:2", "a=1:2:x", "a=1:2:0", "a=1:nan:3", "=1"])
def test_that_a_sweep_that_is_none_is_told(example_named, sweep):
    done = run(example_named("four_bar"), "--sweep", sweep)
    expected = f"--sweep {sweep}: give NAME=FIRST:LAST:COUNT with numbers"
    assert (done.exit_code, expected in done.stderr) == (2, True)


def test_that_a_parameter_is_not_both_set_and_swept(example_named):
    done = run(example_named("four_bar"), "--set", "a=9", "--sweep", "a=9:10:2")
    assert (done.exit_code, "--set and --sweep both name a" in done.stderr) == (2, True)
