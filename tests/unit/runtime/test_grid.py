"""A grid solved at once: answers and verdicts of the march, and no trust where it is not due."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.march import March


def both(module, t, **options):
    return (kc.solve(module, t, method=method, **options) for method in ("grid", "march"))


@pytest.mark.every(5)
@pytest.mark.parametrize("points", [33, 257, pytest.param(2000, marks=pytest.mark.slow)])
def test_every_example_has_the_same_motion_by_both_methods(example, points):
    ours, theirs = both(example.module, np.linspace(0, example.model.end, points))
    assert ours.success, ours.message
    for one, other in (
        (ours.q, theirs.q),
        (ours.q_dot, theirs.q_dot),
        (ours.q_ddot, theirs.q_ddot),
    ):
        scale = 1 + np.max(np.abs(other), axis=0)
        assert np.max(np.abs(one - other) / scale) < 1e-12


def test_that_most_points_of_a_fine_grid_are_not_marched(example):
    solution = kc.solve(example.module, np.linspace(0, example.model.end, 2000))
    assert solution.statistics["marched"] == 0
    assert 1 < solution.statistics["coarse"] < 400


@pytest.mark.parametrize(
    "times",
    [
        np.r_[0, np.linspace(0, 1, 99)],
        np.r_[np.zeros(40), np.linspace(0, 1, 60)],
        np.repeat(np.linspace(0, 1, 50), 2),
        np.r_[1, np.linspace(1, 0, 99)],
        1e6 + 1e-9 * np.linspace(0, 1, 100),
    ],
    ids=["first twice", "first often", "each twice", "falling", "too near to tell apart"],
)
def test_that_a_time_may_repeat_on_a_grid(example_named, times):
    ours, theirs = both(example_named("four_bar").module, times)
    for solution in (ours, theirs):
        assert solution.success, solution.message
        assert all(np.isfinite(x).all() for x in (solution.q, solution.q_dot, solution.q_ddot))
    np.testing.assert_allclose(ours.q, theirs.q, rtol=0, atol=1e-8)


@pytest.mark.parametrize("points", [100, 451, pytest.param(2001, marks=pytest.mark.slow)])
def test_that_a_grid_across_a_lock_up_has_the_verdict_of_the_march(example_named, points):
    module = example_named("problem_3_5_6").module
    ours, theirs = both(module, np.linspace(0, 5, points))
    np.testing.assert_array_equal(ours.status, theirs.status)
    assert not ours.success
    assert np.isnan(ours.q[ours.status == kc.Status.NOT_REACHED]).all()


@pytest.mark.parametrize(("length", "end"), [(0.5, 2.5), (1.0, 7.0), (1.5, 24.0)])
def test_that_singular_cases_have_the_verdict_of_the_march(example_named, length, end):
    module = example_named("example_3_7_5").module
    ours, theirs = both(module, np.linspace(0, end, 701), p={"l": length})
    np.testing.assert_array_equal(ours.status, theirs.status)


def test_that_a_grid_that_falls_gives_the_motion_backwards(example_named):
    module = example_named("four_bar").module
    t = np.linspace(0, 4, 500)
    forward = kc.solve(module, t)
    backward = kc.solve(module, t[::-1], guess=forward.q[-1])
    np.testing.assert_allclose(backward.q[::-1], forward.q, atol=1e-10)


def test_that_times_may_be_uneven(example_named):
    module = example_named("slider_crank").module
    t = np.sort(np.random.default_rng(3).uniform(0, 2, 300))
    ours, theirs = both(module, t)
    np.testing.assert_allclose(ours.q_ddot, theirs.q_ddot, rtol=1e-9, atol=1e-9)


def test_that_points_that_are_not_trusted_are_marched(example_named, monkeypatch):
    module = example_named("four_bar").module
    t = np.linspace(0, 4, 400)
    whole = kc.solve(module, t)
    solve_together = March.solve_together

    def doubting(march, times, states, residual, smallest):
        good = solve_together(march, times, states, residual, smallest)
        good[100:110] = False
        return good

    monkeypatch.setattr(March, "solve_together", doubting)
    solution = kc.solve(module, t)
    assert solution.success
    assert solution.statistics["marched"] == 10
    np.testing.assert_allclose(solution.q_ddot, whole.q_ddot, rtol=1e-10, atol=1e-10)


def test_that_a_wrong_factorization_is_noticed(example_named):
    """A sign flipped in the emitted solve: the grid distrusts every point, the march finds them."""
    example = example_named("slider_crank")
    source = example.source
    mark = source.index("def _solve(f, F, b):")
    returned = source.index("    return (", mark)
    line_end = source.index("\n", returned) + 1
    first = source[line_end : source.index("\n", line_end)]
    broken = (
        source[:line_end]
        + first.replace("    ", "    -", 1).replace("-    ", "    -")
        + source[line_end + len(first) :]
    )
    assert broken != source
    from kincompile.runtime.load import from_source

    module = from_source(broken, "broken")
    t = np.linspace(0, 1, 200)
    solution = kc.solve(module, t)
    np.testing.assert_allclose(solution.q, kc.solve(example.module, t, method="march").q, atol=1e-9)
    assert solution.statistics["marched"] > 100


def test_that_an_unknown_method_is_refused(example_named):
    with pytest.raises(kc.InputError, match="give 'grid', 'march', or nothing"):
        kc.solve(example_named("four_bar").module, 0.0, method="leap")


@pytest.mark.parametrize("centre", [0.3, 0.47, 0.81])
def test_what_the_coarse_march_steps_over_is_found_and_followed(centre):
    # A twitch of half a radian within eight points: the interpolation knows nothing of it.
    m = kc.Mechanism("twitch")
    rod = m.body("rod", guess=(1, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t + sympy.exp(-(((kc.t - centre) / 0.004) ** 2)) / 2))
    module, times = kc.compile(m), np.linspace(0, 1, 2001)
    found = kc.solve(module, times, method="grid")
    assert found.success
    assert found.statistics["marched"] > 0
    phi = times + np.exp(-(((times - centre) / 0.004) ** 2)) / 2
    expected = np.stack((np.cos(phi), np.sin(phi), phi), axis=-1)
    np.testing.assert_allclose(found.q, expected, rtol=0, atol=1e-12)
