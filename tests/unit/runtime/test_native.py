"""The compiled module keeps the contract of the NumPy module, number by number and word by word."""

import ctypes
import threading
from itertools import pairwise

import numpy as np
import pytest
import sympy

import kincompile as kc

pytestmark = pytest.mark.usefixtures("quick_compiler")

OF_POSITION = ("Phi", "Phi_q", "nu", "Phi_q_nonzeros", "position", "velocity")
OF_STATE = ("gamma", "acceleration", "kinematics")


def states(module, *shape):
    """Return seeded coordinates, rates and times."""
    rng = np.random.default_rng(5)
    q, q_dot = rng.uniform(-1.5, 1.5, (2, *shape, module.N_COORDINATES))
    return q, q_dot, rng.uniform(0, 2, shape)


def assert_same(here, there):
    """Compare one array or several: shapes and types, NaN where NaN is, numbers to 1e-12."""
    here, there = (x if isinstance(x, tuple) else (x,) for x in (here, there))
    for a, b in zip(here, there, strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def assert_functions_agree(native, module, q, q_dot, *rest):
    for name in OF_POSITION:
        assert_same(getattr(native, name)(q, *rest), getattr(module, name)(q, *rest))
    for name in OF_STATE:
        assert_same(getattr(native, name)(q, q_dot, *rest), getattr(module, name)(q, q_dot, *rest))


@pytest.fixture(scope="module")
def four_bar(example_named):
    """The compiled module and the NumPy module."""
    example = example_named("four_bar")
    return example.native, example.module


# ---------------------------------------------------------------- every example


@pytest.mark.parametrize("shape", [(), (1,), (33,), (2, 40)])
@pytest.mark.slow
def test_every_function_agrees(example, shape):
    q, q_dot, t = states(example.module, *shape)
    assert_functions_agree(example.native, example.module, q, q_dot, t if shape else 0.7)


@pytest.mark.every(5)
def test_the_layout_with_the_batch_last_agrees(example):
    q, q_dot, t = states(example.module, 70)
    arguments = np.ascontiguousarray(q.T), np.ascontiguousarray(q_dot.T), t
    results = example.native.kinematics_batch_last(*arguments)
    assert_same(results, example.module.kinematics_batch_last(*arguments))


def test_the_planned_solve_agrees(example):
    q, _, t = states(example.module, 3, 20)
    b = np.random.default_rng(1).uniform(-1, 1, (20, example.module.N_EQUATIONS))
    nonzeros = example.module.Phi_q_nonzeros(q, t)
    expected = example.module.solve(nonzeros, b)
    np.testing.assert_allclose(example.native.solve(nonzeros, b), expected, rtol=1e-10, atol=1e-12)


def test_the_march_agrees_with_the_careful_one(example):
    times = np.linspace(0, example.model.end, example.model.points)
    found = kc.solve(example.native, times)
    assert found.success
    assert found.statistics["compiled"] == times.size
    expected = kc.solve(example.module, times, method="march")
    for name in ("q", "q_dot", "q_ddot"):
        here, there = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(here, there, rtol=0, atol=1e-12 * (1 + np.abs(there).max()))
    assert found.message[: found.message.index(";")] in expected.message


# ---------------------------------------------------------------- arguments


def test_states_that_share_what_the_others_vary(four_bar):
    native, module = four_bar
    q, q_dot, _ = states(module, 4, 1)
    p = module.DEFAULTS * np.linspace(0.9, 1.1, 3)[:, np.newaxis]
    assert_functions_agree(native, module, q, q_dot[0, 0], 0.3)
    assert_functions_agree(native, module, q, q_dot, np.linspace(0, 1, 3), p)


@pytest.mark.parametrize("t", [0.25, 1, np.float64(0.5), np.array(0.75), np.float32(0.5)])
def test_any_number_is_a_time(four_bar, t):
    native, module = four_bar
    q, q_dot, _ = states(module)
    assert_functions_agree(native, module, q, q_dot, t)


def test_lists_integers_and_arrays_that_are_not_contiguous(four_bar):
    native, module = four_bar
    q, q_dot, t = states(module, 10)
    assert_functions_agree(native, module, q[::2], q_dot[::-2], t[::2])
    assert_functions_agree(native, module, q.tolist(), q_dot.tolist(), t.tolist())
    assert_functions_agree(native, module, np.arange(9), np.ones(9, dtype=int), 1)
    assert_same(
        native.kinematics_batch_last(q.T, q_dot.T, t),
        module.kinematics_batch_last(q.T, q_dot.T, t),
    )


@pytest.mark.parametrize("points", [1, 7, 8, 1000, 4096])
def test_rows_of_a_batch_begin_where_cache_lines_do(four_bar, points):
    native, _ = four_bar
    q = np.tile(native.GUESS[:, np.newaxis], points)
    for rows in native.kinematics_batch_last(q, q, 0.0):
        assert rows.ctypes.data % 64 == 0
        assert rows.strides[0] % 128 == 64


def test_an_empty_batch_gives_empty_arrays(four_bar):
    native, module = four_bar
    q, q_dot, t = states(module, 0)
    assert_functions_agree(native, module, q, q_dot, t)


def test_complex_steps_run_as_in_numpy(four_bar):
    native, module = four_bar
    q, q_dot, _ = states(module)
    assert_functions_agree(native, module, q + 1e-30j, q_dot, 0.3)


def test_parameters_of_one_point_count_each_time(four_bar):
    native, module = four_bar
    q, _, _ = states(module)
    other = module.DEFAULTS * 1.5
    for p in (module.DEFAULTS, other, module.DEFAULTS, other * 2, other):
        assert_same(native.Phi(q, 0.1, p), module.Phi(q, 0.1, p))
    other[0] = 7.0
    assert_same(native.Phi(q, 0.1, other), module.Phi(q, 0.1, other))


def test_results_are_the_callers_own(four_bar):
    native, _ = four_bar
    q, q_dot, _ = states(native)
    first = native.kinematics(q, q_dot, 0.1)
    kept = [part.copy() for part in first]
    native.kinematics(2 * q, q_dot, 0.2)
    assert_same(first, tuple(kept))


def test_arrays_of_an_earlier_call_are_filled_again(four_bar):
    native, module = four_bar
    q, q_dot, t = states(module, 100)
    out = native.kinematics_batch_last(q.T, q_dot.T, t)
    again = native.kinematics_batch_last(2 * q.T, q_dot.T, t, out=out)
    assert all(a is b for a, b in zip(again, out, strict=True))
    assert_same(again, module.kinematics_batch_last(2 * q.T, q_dot.T, t))


@pytest.mark.parametrize(
    "bad",
    [
        {"out": ()},
        {"out": "no"},
        {"out": tuple(np.empty((9, 5)) for _ in range(4))},
        {"out": [np.empty((m, 6), dtype=np.float32) for m in (9, 25, 9, 9)]},
    ],
)
def test_other_arrays_to_fill_are_refused(four_bar, bad):
    native, _ = four_bar
    q, q_dot, t = states(native, 6)
    with pytest.raises(kc.InputError, match="out is not what an earlier call returned"):
        native.kinematics_batch_last(q.T, q_dot.T, t, **bad)


@pytest.mark.parametrize("where", ["q", "q_dot", "t", "p"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("shape", [(), (40,)])
def test_what_is_not_finite_is_refused_as_in_numpy(four_bar, where, value, shape):
    native, module = four_bar
    q, q_dot, t = states(module, *shape)
    arguments = {"q": q, "q_dot": q_dot, "t": t, "p": module.DEFAULTS.copy()}
    arguments[where] = arguments[where] if where != "t" or shape else np.array(t)
    arguments[where][(-1,) * arguments[where].ndim] = value
    arguments["t"] = arguments["t"] if shape else float(arguments["t"])
    with pytest.raises(kc.InputError) as expected:
        module.kinematics(**arguments)
    with pytest.raises(kc.InputError, match="not finite") as found:
        native.kinematics(**arguments)
    assert str(found.value) == str(expected.value)


@pytest.mark.parametrize(
    "arguments",
    [
        (np.zeros(8), np.zeros(9), 0.0),
        (np.zeros(9), np.zeros((2, 8)), 0.0),
        (np.zeros((2, 9)), np.zeros((3, 9)), 0.0),
        (np.zeros(9), np.zeros(9), "soon"),
        (np.zeros(9), np.zeros(9), 0.0, np.zeros(4)),
    ],
)
def test_wrong_shapes_are_refused_as_in_numpy(four_bar, arguments):
    native, module = four_bar
    with pytest.raises(kc.InputError) as expected:
        module.kinematics(*arguments)
    with pytest.raises(kc.InputError, match="four_bar: ") as found:
        native.kinematics(*arguments)
    assert str(found.value) == str(expected.value)


def test_outside_a_domain_there_is_nan_as_in_numpy():
    x, y = sympy.symbols("x y")
    m = kc.ConstraintSystem("domain", "x y", [sympy.sqrt(x) - y, sympy.log(y) - x])
    native, module = kc.compile(m, target="c"), kc.compile(m)
    q = np.array([[-1.0, 2.0], [1.0, -2.0], [1.0, 2.0]])
    assert_functions_agree(native, module, q, q, 0.0)
    assert_functions_agree(native, module, q[0], q[0], 0.0)


def test_threads_do_not_mix_their_points(four_bar):
    native, module = four_bar
    points = [states(module)[0] * k for k in range(1, 5)]
    expected = [module.Phi(q, 0.1) for q in points]
    wrong = []

    def work(k):
        for _ in range(3000):
            found = native.Phi(points[k], 0.1)
            if np.max(np.abs(found - expected[k])) > 1e-9:
                wrong.append(k)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_the_functions_are_documented_and_named_as_in_numpy(four_bar):
    native, module = four_bar
    for name in (*OF_POSITION, *OF_STATE, "solve", "kinematics_batch_last"):
        function = getattr(native, name)
        assert function.__name__ == name
        assert function.__doc__.startswith(getattr(module, name).__doc__)


# ---------------------------------------------------------------- the march


@pytest.mark.parametrize("points", [1, 2, 3, 8, 17, 34, 60, 150, 701])
@pytest.mark.parametrize("backwards", [False, True])
def test_coarse_and_fine_grids_agree_with_the_careful_march(four_bar, points, backwards):
    native, module = four_bar
    times = np.linspace(0, 4.0, points)[:: -1 if backwards else 1]
    found, expected = kc.solve(native, times), kc.solve(module, times, method="march")
    assert found.statistics.get("compiled", 1) == points  # of one time there is but a start
    for name in ("q", "q_dot", "q_ddot"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=1e-11, atol=1e-11
        )
    np.testing.assert_array_equal(found.status, expected.status)
    assert found.residual.max() < 1e-12 * 26


def test_a_grid_with_sudden_gaps_and_equal_times(four_bar):
    native, module = four_bar
    times = np.sort(np.r_[np.linspace(0, 1, 50), np.linspace(3, 3.01, 90), 3.01, 7.0, 7.0])
    found, expected = kc.solve(native, times), kc.solve(module, times, method="march")
    assert found.statistics["compiled"] == times.size
    np.testing.assert_allclose(found.q_ddot, expected.q_ddot, rtol=1e-10, atol=1e-10)


def test_newton_takes_the_same_iterations_to_assemble(four_bar):
    native, module = four_bar
    assert kc.solve(native, 0.0).iterations == kc.solve(module, 0.0, method="march").iterations


def test_a_lock_up_has_the_verdict_of_the_careful_march(four_bar):
    native, module = four_bar
    times = np.linspace(0, 4, 300)
    p = {"a": 20.0, "b": 15.0, "c": 18.0, "d": 20.0}
    guess = kc.newton(module, 0.4, None, p).q
    found = kc.solve(native, times + 0.4, p, guess)
    expected = kc.solve(module, times + 0.4, p, guess, method="march")
    assert not expected.success
    assert found.message == expected.message
    np.testing.assert_array_equal(found.status, expected.status)
    good = found.status == 0
    np.testing.assert_allclose(found.q[good], expected.q[good], rtol=1e-9)
    assert np.isnan(found.q_dot[~good]).all()


@pytest.mark.parametrize("method", ["grid", "march"])
def test_a_method_that_is_asked_for_is_taken(four_bar, method):
    native, _ = four_bar
    assert "compiled" not in kc.solve(native, np.linspace(0, 1, 50), method=method).statistics


def test_a_position_beyond_the_reach_of_the_guess_is_assembled_with_care(four_bar):
    native, module = four_bar
    far = dict.fromkeys(module.COORDINATES, 0.0)
    with pytest.warns(kc.AssemblyWarning, match="the guess lies folded"):
        found, expected = kc.solve(native, 0.3, guess=far), kc.solve(module, 0.3, guess=far)
    assert expected.success
    np.testing.assert_allclose(found.q, expected.q, rtol=1e-9, atol=1e-9)


def test_the_order_of_convergence_is_that_of_newton(four_bar):
    native, _ = four_bar
    exact = kc.solve(native, 0.2).q[0]
    counts = []
    for error in (1e-1, 1e-3, 1e-7):
        counts.append(int(kc.solve(native, 0.2, guess=exact + error).iterations[0]))
    assert all(more >= fewer for more, fewer in pairwise(counts))
    assert counts[0] <= 6
    assert counts[-1] <= 2


def test_the_code_of_lanes_agrees(example):
    """Compiled for arrays of positions; what is not finite stays in its lane."""
    native, module = example.native, example.module
    q, _, t = states(module, 40)
    q[7, 0] = np.nan
    sets = np.ascontiguousarray((module.DEFAULTS * np.linspace(1, 1.1, 40)[:, np.newaxis]).T)
    for time, p in ((t, module.DEFAULTS), (0.3, sets), (t, sets)):
        for rows in (q.T, np.ascontiguousarray(q.T), q.T + 0j):
            with np.errstate(all="ignore"):
                found, expected = (
                    [np.broadcast_to(row, 40) for row in position(module.ARRAYS, rows, time, p)]
                    for position in (native.LANES["position"], module.LANES["position"])
                )
            np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)


# ---------------------------------------------------------------- variants


@pytest.mark.parametrize("points", [1, 12, 120])
def test_variants_agree_with_those_of_numpy_and_bad_ones_disturb_none(four_bar, points):
    native, module = four_bar
    sets = module.DEFAULTS * np.random.default_rng(9).uniform(0.95, 1.05, (75, 5))
    sets[[3, 40]] = [100.0, 1.0, 1.0, 20.0, 1.5]  # too short to be assembled
    sets[[4, 70]] = [20.0, 15.0, 18.0, 20.0, 1.5]  # locks up
    times = np.linspace(0.4, 4.0, points)
    found = kc.solve(native, times, sets[:, np.newaxis])
    expected = kc.solve(module, times, sets[:, np.newaxis])
    np.testing.assert_array_equal(found.status, expected.status)
    assert found.message == expected.message
    for name in ("q", "q_dot", "q_ddot"):
        here, there = getattr(found, name), getattr(expected, name)
        assert here.shape == there.shape == (75, points, 9)
        np.testing.assert_allclose(here, there, rtol=1e-9, atol=1e-9)
    good = (found.status == 0).all(axis=1)
    assert 60 <= good.sum() < 75
    alone = kc.solve(native, times, sets[50])
    np.testing.assert_allclose(found.q_ddot[50], alone.q_ddot, rtol=1e-10, atol=1e-10)


def test_steps_towards_a_lock_up_are_as_long_as_velocities_allow(four_bar):
    native, module = four_bar
    sets = np.tile([20.0, 15.0, 18.0, 20.0, 1.5], (40, 1)) * np.linspace(0.99, 1, 40)[:, None]
    guess = kc.newton(module, 0.4, None, sets[0]).q
    found = kc.solve(native, np.linspace(0.4, 4, 30), sets[:, np.newaxis], guess)
    locked = found.status == kc.Status.LOCK_UP
    assert locked.any(axis=1).all()
    assert found.iterations[locked].max() <= 100  # 158 and more where steps are halved and doubled


@pytest.mark.every(5)
def test_variants_of_every_example(example):
    n = example.module
    rng = np.random.default_rng(4)
    sets = n.DEFAULTS * rng.uniform(0.999, 1.001, (5, n.DEFAULTS.size))
    times = np.linspace(0, example.model.end, 25)
    found = kc.solve(example.native, times, sets[:, np.newaxis])
    expected = kc.solve(n, times, sets[:, np.newaxis])
    np.testing.assert_array_equal(found.status, expected.status)
    np.testing.assert_allclose(found.q_ddot, expected.q_ddot, rtol=1e-9, atol=1e-9)


def test_two_blocks_that_turn_singular_together_are_noticed():
    x, y = sympy.symbols("x y")
    equations = [x**2 - (1 - kc.t) ** 2, y**2 - 4 * (1 - kc.t) ** 2]
    m = kc.ConstraintSystem("twins", "x y", equations, guess=(1, 2))
    native, module = kc.compile(m, target="c"), kc.compile(m)
    for times in (np.linspace(0, 1.9, 38), np.array([0.0, 0.93, 1.11, 1.3])):
        found, expected = kc.solve(native, times), kc.solve(module, times, method="march")
        assert not found.success
        np.testing.assert_array_equal(found.status, expected.status)
        assert found.message == expected.message
        assert "x, y may continue in two ways" in found.message


# ---------------------------------------------------------------- large batches


@pytest.mark.parametrize("points", [12_000, 12_001, 20_013])
def test_batches_that_are_written_past_the_caches_agree(four_bar, points):
    native, module = four_bar
    q, q_dot, t = states(module, points)
    assert_functions_agree(native, module, q, q_dot, t)
    last = np.ascontiguousarray(q.T), np.ascontiguousarray(q_dot.T), t
    expected = module.kinematics_batch_last(*last)
    found = native.kinematics_batch_last(*last)
    assert_same(found, expected)
    assert_same(native.kinematics_batch_last(*last, out=found), expected)


@pytest.mark.slow
def test_that_all_quantities_in_one_go_are_compiled_on_request(
    monkeypatch, tmp_path, quick_compiler, example_named
):
    """Motions, steps and single quantities need one library; `kinematics` has another."""
    monkeypatch.setenv("CC", quick_compiler)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    module = example_named("four_bar").module
    native = kc.compile(example_named("four_bar").model, target="c")
    q, q_dot, t = states(module, 40)
    for at in (3, slice(None)):
        state = q[at], q_dot[at], t[at] if at != 3 else float(t[at])
        for name in OF_POSITION:
            assert_same(
                getattr(native, name)(state[0], state[2]), getattr(module, name)(state[0], state[2])
            )
        for name in ("gamma", "acceleration"):
            assert_same(getattr(native, name)(*state), getattr(module, name)(*state))
    assert kc.solve(native, np.linspace(0, 1, 5)).success
    kc.stepper(native)(0.1)
    first = set(tmp_path.rglob("*.so"))
    assert len(first) == 1
    assert_same(native.kinematics(q, q_dot, t), module.kinematics(q, q_dot, t))
    (second,) = set(tmp_path.rglob("*.so")) - first
    rows = q.T.copy(), q_dot.T.copy(), t
    assert_same(native.kinematics_batch_last(*rows), module.kinematics_batch_last(*rows))
    assert_same(native.kinematics(q[0], q_dot[0], 0.5), module.kinematics(q[0], q_dot[0], 0.5))
    absent = ("solve", "march", "go_on", "follow_variants")
    assert not any(hasattr(ctypes.CDLL(str(second)), f"four_bar_{name}") for name in absent)
