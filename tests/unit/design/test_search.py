"""The search of a fit: what is linear, published cases, budgets, executors, other designs."""

import itertools
import math
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy
from scipy import optimize

import kincompile as kc
from kincompile import spatial
from kincompile.design.demands import read_demands
from kincompile.design.descent import Descent
from kincompile.design.placing import Placing, best_places
from kincompile.design.search import Search
from kincompile.design.together import Together
from kincompile.design.trial import Workbench
from kincompile.design.variables import Variables

_SCIPY: Any = optimize
"""Its types leave out what it exports."""

LENGTHS = ("r1", "r2", "r3", "r4")
TURN = (0.0, 2 * math.pi)

# Closed path of 18 points at equal steps of the crank, and six points on a line without times
# (Cabrera, Simon, Prado: Optimal synthesis of mechanisms with genetic algorithms, Mechanism and
# Machine Theory 37, 2002).
CLOSED = [
    (0.5, 1.1), (0.4, 1.1), (0.3, 1.1), (0.2, 1.0), (0.1, 0.9), (0.05, 0.75), (0.02, 0.6),
    (0.0, 0.5), (0.0, 0.4), (0.03, 0.3), (0.1, 0.25), (0.15, 0.2), (0.2, 0.3), (0.3, 0.4),
    (0.4, 0.5), (0.5, 0.7), (0.6, 0.9), (0.6, 1.0),
]  # fmt: skip
BEST_CLOSED = 0.0090289
# Ten points of an ellipse (the same); the best published error is 0.0034.
ELLIPSE = [
    (20, 10), (17.66, 15.142), (11.736, 17.878), (5, 16.928), (0.60307, 12.736),
    (0.60307, 7.2638), (5, 3.0718), (11.736, 2.1215), (17.66, 4.8577), (20, 10),
]  # fmt: skip
BEST_ELLIPSE = 4.85e-4
ON_LINE = [(20.0, 20.0 + 5 * k) for k in range(6)]


def four_bar(name="anywhere", has_start=True, **values):
    """Return a four-bar in any place: turned by a, its crank at s when it starts."""
    m = kc.Mechanism(name, end=2 * math.pi, points=73)
    given = {"r1": 3.7, "r2": 1.0, "r3": 4.0, "r4": 2.7, "u": 1.7, "v": 1.7}
    given |= {"x0": 0.0, "y0": 0.0, "a": 0.0} | ({"s": 0.0} if has_start else {}) | values
    p = {key: m.parameter(key, value) for key, value in given.items()}
    x0, y0, r1, a = p["x0"], p["y0"], p["r1"], p["a"]
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (1.7, 1, 0.8))
    rocker = m.body("rocker", (3.7, 0, 1.9))
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (x0, y0)))
    m.add(kc.Revolute("B", crank, (p["r2"], 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (p["r3"], 0), rocker, (p["r4"], 0)))
    end = (x0 + r1 * sympy.cos(a), y0 + r1 * sympy.sin(a))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, end))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t + p.get("s", 0)))
    m.point("P", rod, (p["u"], p["v"]))
    return m


def box(lengths, places, has_start=True):
    """Return bounds of all parameters."""
    found = dict.fromkeys(LENGTHS, lengths) | dict.fromkeys(("u", "v", "x0", "y0"), places)
    return found | {"a": TURN} | ({"s": TURN} if has_start else {})


def some(model, targets, bounds, count=64):
    """Return a descent over a mechanism, and motions that it starts from."""
    module = kc.compile(model)
    demands = read_demands(module, model.system(), targets)
    bench = Workbench(module, demands, tuple(bounds), {})
    variables = Variables(np.array(list(bounds.values())))
    search = Search(bench, variables, kc.assemblies(module, 0.0))
    search.spread(count, (0, 0))
    starts = search.found
    descent = Descent(bench, variables)
    batch = descent.solved(starts.x, starts.q)
    return descent, batch.some(batch.good)


CRANK_ROCKERS = {
    "r1": (3.0, 4.0), "r2": (0.5, 1.5), "r3": (3.0, 5.0), "r4": (2.5, 3.5), "u": (-3, 3),
    "v": (-3, 3), "x0": (-3, 3), "y0": (-3, 3), "a": TURN, "s": TURN,
}  # fmt: skip


def test_that_motions_side_by_side_are_those_that_are_solved_alone():
    descent, batch = some(four_bar(), [timed(CLOSED)], CRANK_ROCKERS)
    names, module = descent.bench.names, descent.bench.module
    _, by = descent.seen(batch, names).combined()
    assert by is not None
    for k in (0, len(batch.x) // 2):
        p = dict(zip(names, batch.x[k].tolist(), strict=True))
        alone = kc.solve(module, batch.t[k], p, batch.q[k, 0])
        np.testing.assert_allclose(batch.q[k], alone.q, atol=1e-9)
        slopes = kc.sensitivities(alone, names, ["x_P", "y_P"])
        expected = np.concatenate([[slopes[c, n] for n in names] for c in ("x_P", "y_P")], axis=1)
        np.testing.assert_allclose(by[k], expected.T, rtol=1e-7, atol=1e-9)


def timed(points):
    """Return the target of points at equal steps of a turn."""
    return kc.targets.path("P", points, 2 * math.pi * np.arange(len(points)) / len(points))


def test_which_parameters_are_linear():
    descent, batch = some(four_bar(), [timed(CLOSED)], CRANK_ROCKERS)
    names = descent.bench.names
    assert {names[k] for k in descent.linear_of(batch.some(slice(16)))} == {"u", "v", "x0", "y0"}


def test_that_a_motion_without_derivatives_hides_no_linear_parameter():
    """Lengths may be almost zero: one of the motions has derivatives that are no numbers."""
    descent, batch = some(four_bar(), [timed(CLOSED)], box((1e-4, 50), (-50, 50)))
    names = descent.bench.names
    assert not np.isfinite(descent.seen(batch, names).rows()[1]).all()
    assert {names[k] for k in descent.linear_of(batch)} == {"u", "v", "x0", "y0"}


def test_that_what_a_limit_depends_on_is_not_taken_as_linear():
    limit = kc.targets.limit("P.y", most=2.0)
    descent, batch = some(four_bar(), [timed(CLOSED), limit], CRANK_ROCKERS)
    found = descent.linear_of(batch.some(slice(16)))
    assert not {descent.bench.names[k] for k in found} & {"v", "y0"}


def test_that_linear_parameters_are_at_their_best():
    """Beside a search by SciPy in these parameters alone, each motion solved anew."""
    descent, batch = some(four_bar(), [timed(CLOSED)], CRANK_ROCKERS)
    names, module = descent.bench.names, descent.bench.module
    wide = Variables(np.array([(-50.0, 50.0)] * 10))
    descent = Descent(descent.bench, wide)
    found = descent.projected(batch.some(slice(4)))
    linear = [names.index(name) for name in ("u", "v", "x0", "y0")]
    p, t = dict(zip(names, batch.x[0].tolist(), strict=True)), batch.t[0]

    def off(values):
        own = p | dict(zip(("u", "v", "x0", "y0"), values.tolist(), strict=True))
        motion = kc.solve(
            module,
            t,
            own,
            batch.q[0, 0] + np.tile([own["x0"] - p["x0"], own["y0"] - p["y0"], 0], 3),
        )
        return (np.column_stack((motion["P.x"], motion["P.y"])) - CLOSED).ravel()

    best = _SCIPY.least_squares(off, batch.x[0, linear], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(found.x[0, linear], best.x, rtol=1e-5, atol=1e-6)


def test_how_parameters_move_turn_and_scale_a_mechanism():
    descent, batch = some(four_bar(), [timed(CLOSED)], CRANK_ROCKERS)
    names = descent.bench.names
    seen = descent.seen(batch, names)
    z = seen.column("x_P", 0) + 1j * seen.column("y_P", 0)
    slopes = seen.slope("x_P", 0) + 1j * seen.slope("y_P", 0)
    placing = Placing.of(z, slopes, batch.x)
    assert placing is not None
    place, turn = 2.0 - 1.0j, 1.7 * np.exp(0.4j)
    p = dict(zip(names, batch.x[0].tolist(), strict=True))
    moved = dict(
        zip(names, placing.moved(batch.x[:1], np.array([place]), np.array([turn]))[0], strict=True)
    )
    ground = turn * complex(p["x0"], p["y0"]) + place
    expected = {key: 1.7 * p[key] for key in (*LENGTHS, "u", "v")}
    expected |= {"x0": ground.real, "y0": ground.imag, "a": p["a"] + 0.4, "s": p["s"] + 0.4}
    assert moved == pytest.approx(expected)


def test_that_a_mechanism_on_a_given_ground_is_not_moved():
    bounds = {key: value for key, value in CRANK_ROCKERS.items() if key != "x0"}
    descent, batch = some(four_bar(), [timed(CLOSED)], bounds)
    seen = descent.seen(batch, descent.bench.names)
    z = seen.column("x_P", 0) + 1j * seen.column("y_P", 0)
    slopes = seen.slope("x_P", 0) + 1j * seen.slope("y_P", 0)
    assert Placing.of(z, slopes, batch.x) is None


def test_the_best_place_of_points():
    rng = np.random.default_rng(5)
    z, arms = (
        rng.normal(size=(2, 12)) + 1j * rng.normal(size=(2, 12)),
        np.exp(1j * rng.uniform(0, 6, (2, 12))),
    )
    slopes = np.stack((arms, 1j * arms), axis=-1)
    wanted = (1 + 2j) + 3 * np.exp(1j) * (z[0] + (0.3 - 0.2j) * arms[0])
    place, turn, along = best_places(z, slopes, wanted, np.ones(12))
    assert place[0] == pytest.approx(1 + 2j)
    assert turn[0] == pytest.approx(3 * np.exp(1j))
    np.testing.assert_allclose(along[0], (0.3, -0.2))


@pytest.mark.slow
def test_the_best_known_error_of_a_closed_path_of_18_points():
    found = kc.fit(four_bar(), timed(CLOSED), bounds=box((0.05, 50), (-50, 50)), seed=8)
    assert found.error <= BEST_CLOSED
    own = found.motion
    off = np.column_stack((own["P.x"], own["P.y"])) - CLOSED
    assert found.error == pytest.approx((off**2).sum())
    assert found.others
    assert all(item.error >= found.error for item in found.others)


@pytest.mark.slow
def test_the_best_known_error_of_ten_points_of_an_ellipse():
    """The last point comes at the very end of the cycle: limits of times bind."""
    bounds = box((5, 80), (-80, 80), has_start=False)
    found = kc.fit(four_bar(has_start=False), kc.targets.path("P", ELLIPSE), bounds=bounds)
    assert found.error <= BEST_ELLIPSE
    at = np.array([item.t for item in found.reached])[::2]
    assert (np.diff(at) > 0).all()
    assert at[-1] <= 2 * math.pi * (1 + 1e-6)


@pytest.mark.slow
def test_six_points_of_a_line_are_met():
    bounds = box((5, 60), (-60, 60), has_start=False)
    model = four_bar(has_start=False)
    found = kc.fit(model, kc.targets.path("P", ON_LINE), bounds=bounds)
    assert found.error < 1e-15
    at = np.array([item.t for item in found.reached])
    assert (np.diff(at[::2]) > 0).all()


def unassembled(bounds=None):
    """Return a fit to points of a crank-rocker, by a drawing whose crank cannot turn."""
    own = kc.compile(four_bar("reached"))
    motion = kc.solve(own, np.radians([10, 80, 150, 220, 290]))
    path = np.column_stack((motion["P.x"], motion["P.y"]))
    drawn = four_bar("drawn", r2=2.5, r3=2.4)
    assert not kc.solve(kc.compile(drawn), motion.t).success
    bounds = bounds or {"r2": (0.2, 3), "r3": (2, 6), "r4": (2, 6), "u": (-3, 3), "v": (-3, 3)}
    target = kc.targets.path("P", path, motion.t)
    return kc.fit(drawn, target, bounds=bounds, samples=1, starts=2)


@pytest.mark.filterwarnings("ignore::kincompile.errors.KincompileWarning")
def test_that_a_drawing_is_used_which_cannot_be_assembled_at_the_times():
    found = unassembled()
    assert found.success
    assert found.error < 1e-20
    assert found.drawn
    assert "moved r2 from 2.5 to " in found.effort()
    assert "began with others" in replace(found, drawn={}).effort()


@pytest.mark.filterwarnings("ignore::kincompile.errors.KincompileWarning")
def test_that_a_drawing_is_moved_where_there_are_no_points_to_reach():
    """To where it is just assembled at the end, and a little further, as it is singular there."""
    m, t = four_bar("drawn", r2=2.5, r3=2.4, u=1.0, v=1.0), np.linspace(1.0, 2.0, 25)
    straight = kc.targets.straight("P", (1.0, 2.0), within=1.0)
    bounds = {"r2": (0.2, 3.0), "r3": (2.0, 6.0), "r4": (2.0, 6.0)}
    bounds |= dict.fromkeys(("u", "v"), (-3.0, 3.0))
    found = kc.fit(m, straight, bounds=bounds, samples=1, starts=1)
    assert found.drawn
    module = kc.compile(m)
    assert not kc.solve(module, t).success
    assert kc.solve(module, t, found.drawn).success


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.errors.KincompileWarning")
def test_a_drawing_in_space_whose_guess_is_singular_and_cannot_be_assembled():
    """A crank about z, a rod too short, a rocker about x: the rod lies across the rocker's way."""
    m, o, x, z = spatial.Mechanism("short"), (0, 0, 0), (1, 0, 0), (0, 0, 1)
    a, b, c, d = (m.parameter(*item) for item in (("a", 1), ("b", 1), ("c", 2), ("d", 2.5)))
    crank, rocker = m.body("crank"), m.body("rocker", (2.5, 0, 0))
    m.add(spatial.Revolute("A", m.ground, o, z, crank, o, z))
    m.add(spatial.RelativeRotation("motor", m.ground, z, x, crank, z, x, 0.8 + 0.3 * kc.t))
    m.add(spatial.Revolute("D", m.ground, (d, 0, 0), x, rocker, o, x))
    m.add(spatial.Distance("rod", crank, (a, 0, 0), rocker, (0, 0, c), b))
    m.point("P", rocker, (0, 0, c))
    wanted = kc.targets.value("P.z", [2.0, 1.976, 1.915, 1.845], [0.1, 0.5, 0.9, 1.2], within=1e-3)
    bounds = {"a": (0.5, 2), "b": (0.9, 6), "c": (1, 3), "d": (1, 4)}
    found = kc.fit(m, wanted, bounds=bounds, samples=1, starts=4)
    assert found.drawn
    assert found.success


@pytest.mark.filterwarnings("ignore::kincompile.errors.KincompileWarning")
def test_that_more_sets_are_led_where_none_gets_through():
    m = four_bar("drawn", r3=1.0, r4=1.0)
    bounds = {"r1": (1.0, 6.0), "r2": (0.5, 2.0), "r3": (1.0, 6.0), "r4": (1.0, 6.0)}
    target = kc.targets.path("P", [(2.0, 3.0), (1.0, 3.6), (0.0, 3.7)])
    found = kc.fit(m, target, bounds=bounds, samples=1, starts=2)
    assert found.success
    assert found.drawn == {}
    assert found.counts.sampled == 1


def test_that_a_drawing_near_which_nothing_is_assembled_is_refused():
    """Its crank can be no shorter."""
    with pytest.raises(kc.errors.InputError, match="does not move through the times"):
        unassembled(bounds={"r2": (2.4, 3), "u": (-3, 3)})


@pytest.mark.parametrize("has_times", [True, False])
def test_that_equations_and_targets_have_the_derivatives_of_differences(has_times):
    m = four_bar()
    t = [0.3, 1.0, 2.0] if has_times else None
    targets = [kc.targets.path("P", CLOSED[:3], t), kc.targets.value("rocker.phi", [1, 2, 3], t)]
    module = kc.compile(m)
    bounds = np.array(list(CRANK_ROCKERS.values()))
    bench = Workbench(module, read_demands(module, m.system(), targets), tuple(CRANK_ROCKERS), {})
    every = np.concatenate((bounds, np.reshape(bench.demands.time_bounds(), (-1, 2))))
    together = Together(Descent(bench, Variables(every)))
    rng = np.random.default_rng(1)
    x = every[:, 0] + np.ptp(every, axis=1) * rng.uniform(0.2, 0.4, (2, len(every)))
    q = rng.normal(size=(2, 6, 9))
    by_x, by_q = rng.normal(size=x.shape), rng.normal(size=q.shape)
    _, slopes_q, slopes_x = together.rows(x, q)
    ahead, behind = (together.rows(x + h * by_x, q + h * by_q)[0] for h in (1e-6, -1e-6))
    expected = np.einsum("bpri,bpi->bpr", slopes_q, by_q)
    expected += np.einsum("bpri,bi->bpr", slopes_x, by_x)
    np.testing.assert_allclose((ahead - behind) / 2e-6, expected, rtol=1e-7, atol=1e-7)


def test_that_times_are_shortened_that_are_a_little_late():
    module = kc.compile(m := four_bar())
    target = kc.targets.path("P", CLOSED[:3], between=(1.0, 3.0))
    demands = read_demands(module, m.system(), [target])
    late, far = np.array([1.5, 0.5, 1.001]), np.array([1.5, 0.5, 1.5])
    np.testing.assert_allclose(
        demands.instants(demands.within(late))[0], 1 + np.array([0.5, 1.0, 2.001]) * 2 / 2.001
    )
    np.testing.assert_array_equal(demands.within(far), far)


def straight(**options):
    """Return a fit of a path that cannot be reached."""
    wanted = [(2.0, 3.0), (1.0, 3.6), (0.0, 3.7), (-1.0, 3.4)]
    target = kc.targets.path("P", wanted, [0.5, 1.0, 1.5, 2.0])
    bounds = {"u": (0.0, 4.0), "v": (0.0, 4.0), "r2": (1.0, 2.0)}
    return kc.fit(
        four_bar(r2=1.5), target, bounds=bounds, **({"samples": 64, "starts": 8} | options)
    )


def test_the_least_largest_deviation_of_what_is_linear():
    """Of a point of the coupler: a linear program, solved by SciPy."""
    wanted, t = np.array([(2.0, 3.0), (1.0, 3.6), (0.0, 3.7), (-1.0, 3.4)]), [0.5, 1.0, 1.5, 2.0]
    m = four_bar(r2=1.5)
    found = kc.fit(
        m,
        kc.targets.path("P", wanted, t),
        bounds={"u": (0, 4), "v": (0, 4)},
        samples=16,
        starts=4,
        norm="maximum",
    )
    motion = kc.solve(kc.compile(m), t, guess=found.motion.q[0])
    co, si = np.cos(motion["rod.phi"]), np.sin(motion["rod.phi"])
    rows = np.concatenate((np.column_stack((co, -si)), np.column_stack((si, co))))
    right = np.concatenate((wanted[:, 0] - motion["rod.x"], wanted[:, 1] - motion["rod.y"]))
    one = np.ones((8, 1))
    best = _SCIPY.linprog(
        [0, 0, 1], np.block([[rows, -one], [-rows, -one]]), np.concatenate((right, -right)),
        bounds=[(0, 4), (0, 4), (0, None)],
    )  # fmt: skip
    assert max(abs(item.off) for item in found.reached) == pytest.approx(best.fun, rel=1e-6)
    plain = kc.fit(
        m, kc.targets.path("P", wanted, t), bounds={"u": (0, 4), "v": (0, 4)}, samples=16, starts=4
    )
    assert plain.error < found.error
    assert max(abs(item.off) for item in plain.reached) > 1.01 * best.fun


def test_a_budget_of_motions_ends_the_search_and_says_so():
    whole, brief = straight(), straight(evaluations=20)
    assert not whole.counts.is_cut
    assert brief.counts.is_cut
    assert "budget" in brief.effort()
    assert brief.counts.motions < whole.counts.motions
    assert brief.error >= whole.error * (1 - 1e-9)


def test_a_budget_of_seconds_ends_the_search(monkeypatch):
    """By a clock that two seconds pass on whenever it is looked at."""
    clock = itertools.count(step=2)
    monkeypatch.setattr("kincompile.design.explore.time.perf_counter", lambda: float(next(clock)))
    assert straight(seconds=5).counts.is_cut
    assert not straight(seconds=10**6).counts.is_cut
    monkeypatch.setattr(Together, "led", None)  # for which no time is left
    assert straight(seconds=1).counts.is_cut


def test_that_evolution_begins_with_as_many_sets_as_it_needs(monkeypatch):
    monkeypatch.setattr("kincompile.design.search.GENERATIONS", 1)
    found = straight(samples=1, starts=2, search="differential evolution")
    assert found.counts.sampled >= 5


def test_progress_rises_to_the_end():
    seen = []
    straight(progress=lambda done, total: seen.append((done, total)))
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert len({total for _, total in seen}) == 1
    assert seen[-1][0] <= seen[-1][1]


@pytest.mark.slow
def test_that_parts_are_the_same_wherever_they_are_searched():
    options = {"samples": 4096 + 64}
    here = straight(**options)
    with ThreadPoolExecutor(2) as pool:
        there = straight(executor=pool, **options)
    assert here.parameters == there.parameters
    assert here.counts.sampled == there.counts.sampled == 4160


def test_that_the_defaults_are_among_the_starts():
    """So that a fit goes on from the model that another one has found."""
    first = straight(samples=256)
    again = kc.fit(
        first.model,
        kc.targets.path(
            "P", [(2.0, 3.0), (1.0, 3.6), (0.0, 3.7), (-1.0, 3.4)], [0.5, 1.0, 1.5, 2.0]
        ),
        bounds={"u": (0.0, 4.0), "v": (0.0, 4.0), "r2": (1.0, 2.0)},
        samples=1,
        starts=1,
    )
    assert again.error <= first.error * (1 + 1e-9)
    assert again.drawn is None


def test_other_designs_and_their_front():
    found = straight(samples=256, starts=32)
    every = (found, *found.others)
    assert len(every) > 1
    assert [item.error for item in every] == sorted(item.error for item in every)
    names = ("crank", "rod", "rocker", "P")
    x, y = ([found.motion[f"{axis}_{name}"] for name in names] for axis in "xy")
    assert found.size == pytest.approx(math.hypot(np.ptp(x), np.ptp(y)))
    front = set(map(id, found.front))
    assert id(found) in front
    for item in every:
        surpassed = any(
            other.error <= item.error and other.size <= item.size
            and (other.error, other.size) != (item.error, item.size)
            for other in every
        )  # fmt: skip
        assert (id(item) in front) == (not surpassed)
    assert "front" in found.to_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"norm": "cubes"}, "there is no norm 'cubes'"),
        ({"seconds": 0}, "seconds is 0: give a whole number"),
        ({"seconds": 0.5}, "seconds is 0.5: give a whole number"),
        ({"evaluations": 0}, "evaluations is 0: give a whole number"),
    ],
)
def test_options_that_cannot_be_used(options, words):
    with pytest.raises(kc.InputError, match=words):
        straight(**options)


@pytest.mark.slow
def test_that_parts_are_searched_in_processes():
    here = straight(samples=4096 + 64)
    with ProcessPoolExecutor(2) as pool:
        there = straight(samples=4096 + 64, executor=pool)
    assert here.parameters == there.parameters
