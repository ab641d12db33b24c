"""No path passes a bifurcation unnoticed: march, grid, variants, compiled march, grouped form."""

import itertools
import warnings

import numpy as np
import pytest

import kincompile as kc

PATHS = ("march", "grid", "variants", "compiled", "compiled variants", "grouped")
MODULES = {"compiled": "c", "compiled variants": "c", "grouped": "grouped"}
START = 1.0
FLAT = np.pi - START
"""When the parallelogram, whose crank starts at START and turns with 1 rad/s, is flat."""


@pytest.fixture(scope="module")
def parallelograms(build, quick_compiler):
    model = build["four_bar"]((1.0, 2.0, 1.0, 2.0), start=START, guess=(START, 0.0, START))
    assert quick_compiler
    return {
        "numpy": kc.compile(model),
        "c": kc.compile(model, target="c"),
        "grouped": kc.compile(model, form="grouped"),
    }


def status_and_angle(modules, path, t):
    """Return the status of every point, the coupler's angle, and the events."""
    module = modules[MODULES.get(path, "numpy")]
    if "variants" in path:
        solution = kc.solve(module, t, p=np.zeros((2, 1, 0)))
        return solution.status[0], solution["phi_coupler"][0], None
    method = path if path in ("march", "grid") else None
    solution = kc.solve(module, t, method=method)
    return solution.status, solution["phi_coupler"], solution.events


def check(modules, path, t, flat=FLAT):
    status, angle, events = status_and_angle(modules, path, t)
    good = status == kc.Status.CONVERGED
    assert not good[t > flat + 1e-9].any()
    assert good[t < flat - 1e-3].all()
    np.testing.assert_allclose(angle[good], 0, atol=1e-6)  # the coupler of a parallelogram
    if events is not None:
        (event,) = events
        assert (event.kind, event.bodies) == ("bifurcation", ("coupler", "rocker"))
        assert abs(event.t - flat) < 1e-6
        assert "through='smooth'" in event.message


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    ("points", "end"),
    [
        *itertools.product([7, 100, 1000], [FLAT + 0.5, 2 * FLAT, 3.034, 6.0]),
        pytest.param(10_000, FLAT + 0.5, marks=pytest.mark.slow),
        pytest.param(10_000, 3.034, marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_that_the_flat_parallelogram_is_noticed(parallelograms, path, points, end):
    check(parallelograms, path, np.linspace(0, end, points))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.slow
def test_that_points_close_to_the_bifurcation_do_not_lead_past_it(parallelograms, path, seed):
    random = np.random.default_rng(seed)
    for _ in range(4):
        before, after = 10 ** random.uniform(-9, -1, 2)
        count = int(random.integers(3, 60))
        t = np.append(np.linspace(0, FLAT - before, count), [FLAT + after, FLAT + 0.7, FLAT + 1])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kc.SingularConfigurationWarning)
            check(parallelograms, path, t)


@pytest.mark.every(3)
@pytest.mark.parametrize("path", ["march", "grid", "compiled", "grouped"])
@pytest.mark.parametrize("points", [20, 1000])
def test_that_every_path_goes_on_along_the_smooth_branch(parallelograms, path, points):
    module = parallelograms[MODULES.get(path, "numpy")]
    t = np.linspace(0, 9, points)
    method = path if path in ("march", "grid") else None
    with pytest.warns(kc.BranchSwitchWarning, match="bifurcation at t = .*, and on") as found:
        solution = kc.solve(module, t, method=method, through="smooth")
    assert len(found) == 3
    assert solution.success
    np.testing.assert_allclose([event.t for event in solution.events], FLAT + np.pi * np.arange(3),
                               atol=1e-6)  # fmt: skip
    np.testing.assert_allclose(solution["phi_coupler"], 0, atol=1e-8)
    np.testing.assert_allclose(solution["phi_rocker"], START + t, atol=1e-8)
    np.testing.assert_allclose(solution["y_coupler_dot"], np.cos(START + t), atol=1e-6)
    np.testing.assert_allclose(solution["x_coupler_ddot"], -np.cos(START + t), atol=1e-5)


def row_of_parallelograms(count, lag):
    """Return parallelograms side by side, each crank behind the one before it by an angle."""
    m = kc.Mechanism("row")
    before = None
    for k in range(count):
        angle, x = START - k * lag, 5.0 * k
        middle, height = 0.5 * np.cos(angle), 0.5 * np.sin(angle)
        crank = m.body(f"crank{k}", guess=(x + middle, height, angle))
        coupler = m.body(f"coupler{k}", guess=(x + 2 * middle + 1, 2 * height, 0))
        rocker = m.body(f"rocker{k}", guess=(x + 2 + middle, height, angle))
        m.add(kc.Revolute(f"A{k}", m.ground, (x, 0), crank, (-0.5, 0)))
        m.add(kc.Revolute(f"B{k}", crank, (0.5, 0), coupler, (-1, 0)))
        m.add(kc.Revolute(f"C{k}", coupler, (1, 0), rocker, (0.5, 0)))
        m.add(kc.Revolute(f"D{k}", rocker, (-0.5, 0), m.ground, (x + 2, 0)))
        if before is None:
            m.add(kc.AbsoluteAngle("motor", crank, START + kc.t))
        else:
            m.add(kc.RelativeAngle(f"G{k}", before, crank, -lag))
        before = crank
    return m


@pytest.mark.parametrize("form", ["inline", "grouped"])
@pytest.mark.parametrize("count", [4, 5])
def test_that_equal_loops_that_fold_together_are_noticed(form, count):
    # The sign of det Phi_q of an even number of them does not change: those of its blocks do.
    solution = kc.solve(kc.compile(row_of_parallelograms(count, 0.0), form=form),
                        np.linspace(0, 3, 50))  # fmt: skip
    (event,) = solution.events
    assert event.kind == "bifurcation"
    assert abs(event.t - FLAT) < 1e-6
    assert set(event.bodies) == {f"{name}{k}" for name in ("coupler", "rocker")
                                 for k in range(count)}  # fmt: skip
    assert solution.branch.shape[1] >= count


@pytest.mark.parametrize("form", ["inline", "grouped"])
def test_that_of_loops_that_fold_one_after_the_other_the_first_is_found(form):
    # All of them fold between two points of the grid.
    module = kc.compile(row_of_parallelograms(3, 0.01), form=form)
    solution = kc.solve(module, np.linspace(0, 3, 31))
    (event,) = solution.events
    assert abs(event.t - FLAT) < 1e-6
    assert event.bodies == ("coupler0", "rocker0")
    with pytest.warns(kc.BranchSwitchWarning):
        solution = kc.solve(module, np.linspace(0, 3, 31), through="smooth")
    np.testing.assert_allclose([event.t for event in solution.events],
                               FLAT + 0.01 * np.arange(3), atol=1e-6)  # fmt: skip
    assert solution.success


@pytest.mark.slow
def test_that_a_large_mechanism_names_its_bifurcation():
    module = kc.compile(row_of_parallelograms(34, 0.005))
    assert module.FORM == "grouped"
    solution = kc.solve(module, np.linspace(0, 3, 31))
    (event,) = solution.events
    assert abs(event.t - FLAT) < 1e-6
    assert event.bodies == ("coupler0", "rocker0")


def test_that_a_converged_point_near_a_singularity_is_warned_about(parallelograms):
    t = np.array([0.0, 1.0, FLAT - 1e-6])
    for name in ("numpy", "c"):
        with pytest.warns(
            kc.SingularConfigurationWarning, match=r"nearly singular at t = 2\.14159165.*condition"
        ):
            solution = kc.solve(parallelograms[name], t)
        assert solution.success
        assert solution.condition[-1] > 1e5
