"""Singular configurations in time: found, told apart, located, named, and passed when asked."""

import pickle
import warnings

import numpy as np
import pytest
import sympy

import kincompile as kc

from . import linkages

METHODS = ("grid", "march")


@pytest.fixture(scope="module")
def r3(example_named):
    return example_named("problem_3_5_6").module


@pytest.fixture(scope="module")
def r4(example_named):
    return example_named("example_3_7_5").module


@pytest.fixture
def parallelogram(build):
    return kc.compile(build["four_bar"]((1.0, 2.0, 1.0, 2.0), guess=(1.0, 0.0, 1.0)))


def the_event(solution):
    assert not solution.success
    (event,) = solution.events
    assert event.message in solution.message
    assert f"t = {event.t:.10g}" in event.message
    return event


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("points", [8, 51, 1000])
def test_that_problem_3_5_6_locks_up(r3, method, points):
    event = the_event(kc.solve(r3, np.linspace(0, 5, points), method=method))
    assert event.kind == "lock-up"
    assert abs(event.t - 4.5) < 1e-6
    assert event.bodies == ("y2", "phi3")
    np.testing.assert_allclose(event.q, [0.85, 0, -np.pi / 2], atol=1e-6)
    # At the dead point x2 stands still: what moves is y2, and phi3 by an angle.
    assert abs(event.null_vector["x2"]) < 1e-6
    assert max(map(abs, event.null_vector.values())) == 1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.slow
def test_the_lock_up_backwards_in_time(r3, method):
    event = the_event(kc.solve(r3, -np.linspace(0, 1, 40), method=method))
    assert event.kind == "lock-up"
    assert abs(event.t + 0.5) < 1e-6


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("points", [31, 36, 400])
@pytest.mark.parametrize(
    ("rod", "kind", "time"), [(0.5, "lock-up", 2.0), (1.0, "bifurcation", 6.0)]
)
def test_that_example_3_7_5_stops(r4, method, points, rod, kind, time):
    solution = kc.solve(r4, np.linspace(0, 10, points), p={"l": rod}, method=method)
    event = the_event(solution)
    assert event.kind == kind
    assert abs(event.t - time) < 1e-6
    assert event.bodies == ("x2", "phi2")
    before = solution.t < time - 1e-9
    assert np.all(solution.status[before] == kc.Status.CONVERGED)
    assert np.all(solution.status[~before] != kc.Status.CONVERGED)


@pytest.mark.parametrize("method", METHODS)
def test_that_a_long_rod_is_regular(r4, method):
    solution = kc.solve(r4, np.linspace(0, 24, 400), p={"l": 1.5}, method=method)
    assert solution.success
    assert solution.events == []
    assert np.all(solution.branch == solution.branch[0])
    assert np.all(solution.condition < 20)


@pytest.mark.parametrize("rod", [0.9999, 0.99, 0.3])
@pytest.mark.slow
def test_the_time_of_a_lock_up_against_its_formula(r4, rod):
    event = the_event(kc.solve(r4, np.linspace(0, 10, 101), p={"l": rod}))
    assert event.kind == "lock-up"
    assert abs(event.t - 12 / np.pi * np.arcsin(rod)) < 1e-6


def test_that_a_rod_a_little_too_long_passes_without_an_event(r4):
    solution = kc.solve(r4, np.linspace(0, 10, 101), p={"l": 1.0001})
    assert solution.success
    assert solution.events == []
    assert np.nanmax(solution.condition) > 50


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("points", [36, 71, 1000])  # the second has a point at the bifurcation
def test_that_the_smooth_branch_goes_on(r4, method, points):
    t = np.linspace(0, 7, points)
    with pytest.warns(
        kc.BranchSwitchWarning, match="example_3_7_5 .* bifurcation at t = 6, and on"
    ):
        solution = kc.solve(r4, t, p={"l": 1.0}, method=method, through="smooth")
    assert solution.success
    assert [event.kind for event in solution.events] == ["bifurcation"]
    np.testing.assert_allclose(solution["phi2"], np.pi / 2 - np.pi / 12 * t, atol=1e-9)
    np.testing.assert_allclose(solution["phi2_dot"], -np.pi / 12, atol=1e-8)
    np.testing.assert_allclose(solution["x2_ddot"], -2 * (np.pi / 12) ** 2 * np.cos(np.pi / 12 * t),
                               atol=1e-6)  # fmt: skip
    assert solution.branch[0] != solution.branch[-1]
    assert np.all(solution.residual < 1e-12)


def test_that_a_lock_up_is_not_passed(r4):
    solution = kc.solve(r4, np.linspace(0, 7, 71), p={"l": 0.5}, through="smooth")
    assert the_event(solution).kind == "lock-up"


def test_that_another_way_through_is_refused(r4):
    with pytest.raises(kc.InputError, match="through is 'both': give 'smooth', or nothing"):
        kc.solve(r4, 0, through="both")


@pytest.mark.every(5)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(12))
def test_the_change_point_of_a_parallelogram(parallelogram, method, seed):
    random = np.random.default_rng(seed)
    t = np.linspace(0, random.uniform(2.3, 12), int(random.integers(6, 300)))
    event = the_event(kc.solve(parallelogram, t, method=method))
    assert event.kind == "bifurcation"
    assert abs(event.t - (np.pi - 1)) < 1e-6
    assert event.bodies == ("coupler", "rocker")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.BranchSwitchWarning)
        solution = kc.solve(parallelogram, t, method=method, through="smooth")
    assert solution.success
    times = [event.t for event in solution.events]
    expected = np.arange(np.pi - 1, t[-1], np.pi)
    np.testing.assert_allclose(times, expected, atol=1e-6)
    np.testing.assert_allclose(solution["phi_coupler"], 0, atol=1e-8)
    np.testing.assert_allclose(solution["phi_rocker_dot"], 1, atol=1e-6)
    np.testing.assert_allclose(solution["x_coupler_ddot"], -np.cos(1 + t), atol=1e-5)


def test_a_start_at_the_change_point(parallelogram):
    event = the_event(kc.solve(parallelogram, np.linspace(np.pi - 1, 4, 12)))
    assert event.kind == "bifurcation"
    assert event.t == np.pi - 1


def test_a_start_at_a_lock_up(r3):
    event = the_event(kc.solve(r3, [4.5, 4.6], guess=(0.85, 0.0, -np.pi / 2)))
    assert event.kind == "lock-up"


def test_that_a_driver_that_jumps_is_a_branch_switch():
    m = kc.Mechanism("jumping")
    arm = m.body("arm", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, 3 * sympy.tanh(1e7 * (kc.t - 1)) + kc.t))
    event = the_event(kc.solve(kc.compile(m), np.linspace(0, 2, 20)))
    assert event.kind == "branch switch"
    assert event.bodies == ("arm",)
    assert 0.9 < event.t <= 1.0001


def test_that_a_pickled_solution_keeps_all_but_the_module(r4):
    solution = kc.solve(r4, np.linspace(0, 3, 31), p={"l": 0.5})
    copy = pickle.loads(pickle.dumps(solution))
    assert [event.t for event in copy.events] == [event.t for event in solution.events]
    np.testing.assert_array_equal(copy.q, solution.q)
    with pytest.raises(kc.InputError, match="was pickled, and the compiled module was not"):
        copy.condition  # noqa: B018


@pytest.mark.parametrize("scale", [1, 1000])
def test_that_the_condition_does_not_depend_on_the_unit(build, scale):
    lengths = tuple(scale * length for length in (0.2, 0.5, 0.4, 0.5))
    module = kc.compile(build["four_bar"](lengths, unit="m" if scale == 1 else "mm"))
    solution = kc.solve(module, np.linspace(0, 6, 40))
    assert solution.success
    assert solution.condition.shape == (40,)
    np.testing.assert_allclose(solution.condition[0], 6.347656, rtol=1e-6)
    if scale == 1000:
        assert np.linalg.cond(module.Phi_q(solution.q[0], 0.0)) > 5e4


def test_condition_and_branch_of_what_was_not_reached(r3):
    solution = kc.solve(r3, np.linspace(0, 5, 51))
    assert np.isnan(solution.condition[46:]).all()
    assert solution.condition[45] > 1e6
    assert np.all(solution.branch[46:] == 0)
    assert solution.branch.shape == (51, 1)


def test_condition_and_branch_of_variants(r4):
    solution = kc.solve(r4, [0, 1], np.array([[[1.5]], [[2.0]], [[3.0]]]))
    assert solution.condition.shape == (3, 2)
    assert solution.branch.shape == (3, 2, 1)
    alone = kc.solve(r4, [0, 1], [2.0])
    np.testing.assert_allclose(solution.condition[1], alone.condition)
    np.testing.assert_array_equal(solution.branch[1], alone.branch)


@pytest.mark.parametrize("method", ["grid", "march"])
@pytest.mark.parametrize("away", [0.0, 1e-3, 0.1])
def test_that_a_dead_centre_at_the_first_time_is_singular_however_it_is_reached(method, away):
    # Newton's method ends a rounding error before it, where rates of 1e8 can still be computed.
    module = kc.compile(linkages.dead_centre().mechanism)
    q = linkages.dead_centre().q
    guess = q + away * np.random.default_rng(1).uniform(-1, 1, q.size)
    solution = kc.solve(module, np.linspace(0, 0.01, 40), guess=guess, method=method)
    assert solution.status[:2].tolist() == [kc.Status.SINGULAR, kc.Status.NOT_REACHED]
    assert solution.condition[0] > 1e7
    assert the_event(solution).kind == "lock-up"


@pytest.mark.parametrize("method", ["grid", "march"])
def test_that_a_double_root_at_the_first_time_is_singular(method):
    x, y = sympy.symbols("x y")
    touching = [x**2 + y**2 - 1, x - 1]
    system = kc.ConstraintSystem("f", coordinates=[x, y], equations=touching, guess=(1, 0.1))
    solution = kc.solve(kc.compile(system), np.linspace(0, 1, 5), method=method)
    assert solution.status.tolist() == [2, 4, 4, 4, 4]
