"""Synthesis: derivatives against differences, closed forms, published cases, limits, branches."""

import math

import numpy as np
import pytest
import sympy
from scipy.optimize import minimize_scalar

import kincompile as kc
from kincompile.design.demands import read_demands
from kincompile.design.fit import _with_limits
from kincompile.design.search import in_order
from kincompile.design.trial import Workbench

LENGTHS = ("r1", "r2", "r3", "r4")


def slow(*values):
    """Return parameters of the slow run."""
    return pytest.param(*values, marks=pytest.mark.slow)


def fourbar(name="four_bar", end=2 * math.pi, points=73, ahead=0.0, **values):
    """Return a four-bar whose crank turns by t, with a point P in the frame of its rod."""
    m = kc.Mechanism(name, end=end, points=points)
    lengths = {"r1": 3.7, "r2": 2.0, "r3": 4.0, "r4": 2.7, "u": 1.7, "v": 1.7, **values}
    r1, r2, r3, r4, u, v = (m.parameter(key, value, "m") for key, value in lengths.items())
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (1.7, 1, 0.8))
    rocker = m.body("rocker", (r1, 0, 1.9))
    m.add(kc.Revolute("A", crank, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (r2, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (r3, 0), rocker, (r4, 0)))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, (r1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t + ahead))
    m.point("P", rod, (u, v))
    ends = m.point("before", rod, (0, 0)), m.point("joint", rod, (r3, 0)), (r1, 0)
    m.output("mu", kc.outputs.transmission_angle(*ends), unit="rad")
    return m


def bench(model, targets, names):
    """Return what evaluates trials of a model, and its variables at the defaults."""
    wider = _with_limits(model, targets)
    module = kc.compile(wider)
    demands = read_demands(module, wider.system(), targets)
    return Workbench(module, demands, names, {}), module


@pytest.mark.parametrize(
    "targets",
    [
        [kc.targets.path("P", [(3, 3), (2, 3.5)], [0.5, 1.0])],
        [kc.targets.path("P", [(3, 3), (2, 3.5), (1, 4)])],
        [
            kc.targets.value("rocker.phi_dot", [0.3, 0.1], weight=3.0),
            kc.targets.pose("rod", [(1, 1, 0.5)], [0.3], angle_weight=2.0),
            kc.targets.path("P", [(3, 3), (2, 3.5)]),
        ],
        [kc.targets.time_ratio("rocker.phi", 1.2, weight=2.0)],
        [
            kc.targets.value("rocker.phi", [1.8], [0.5]),
            kc.targets.limit("mu", 0.7, 2.4),
            kc.targets.limit(sympy.Symbol("r3") / sympy.Symbol("r2"), most=1.5),
        ],
    ],
    ids=["timed", "untimed", "mixed", "ratio", "limits"],
)
def test_derivatives_of_deviations_and_limits_are_exact(targets):
    names = ("r1", "r2", "r3", "r4", "u", "v")
    tried, module = bench(fourbar(), targets, names)
    times = [0.6 + 0.1 * k for k in range(len(tried.demands.time_bounds()))]
    x = np.array([3.7, 2.0, 4.0, 2.7, 1.7, 1.6, *times])
    guess = np.array(module.GUESS)
    trial = tried.solved(x, guess)
    found = tried.derivatives(trial)
    h = 1e-5
    for k in range(x.size):
        step = h * np.eye(x.size)[k]
        up, down = tried.solved(x + step, guess), tried.solved(x - step, guess)
        for own, name in zip(found, ("residuals", "gaps"), strict=True):
            slope = (getattr(up, name) - getattr(down, name)) / (2 * h)
            np.testing.assert_allclose(own[:, k], slope, rtol=2e-7, atol=2e-8)


@pytest.mark.parametrize(
    ("target", "is_exact"),
    [
        (kc.targets.straight("P", (0.5, 2.0), within=0.1, weight=2.0), False),
        (kc.targets.circular("P", (0.5, 2.0), within=0.1, weight=2.0), False),
        (kc.targets.dwell("rocker.phi", (0.5, 2.0), within=0.1), True),
        (kc.targets.dwell("rocker.phi", (0.5, 2.0), at=1.8, within=0.1), True),
        (kc.targets.straight("P", (0.5, 2.0), line=[(0, 1), (3, 2)], within=0.1), True),
        (kc.targets.circular("P", (0.5, 2.0), circle=(1, 1, 2), within=0.1), True),
    ],
)
def test_derivatives_of_deviations_from_a_shape(target, is_exact):
    """Those of the sum of squares are exact, those of each where nothing is chosen as well."""
    names = ("r1", "r2", "r3", "r4", "u", "v")
    tried, module = bench(fourbar(), [target], names)
    x, guess = np.array([3.7, 2.0, 4.0, 2.7, 1.7, 1.6]), np.array(module.GUESS)
    trial = tried.solved(x, guess)
    found, _ = tried.derivatives(trial)
    h, gradient = 1e-5, []
    for k in range(x.size):
        step = h * np.eye(x.size)[k]
        up, down = tried.solved(x + step, guess), tried.solved(x - step, guess)
        gradient.append((up.error - down.error) / (2 * h))
        if is_exact:
            slope = (up.residuals - down.residuals) / (2 * h)
            np.testing.assert_allclose(found[:, k], slope, rtol=2e-7, atol=2e-8)
    assert np.abs(gradient).max() > 1e-3
    np.testing.assert_allclose(2 * trial.residuals @ found, gradient, rtol=1e-6, atol=1e-7)


def hoekens_offsets(r1):
    """Return how far Hoeken's path is from its line, by two circles; lengths r1, 1, 2.5, 2.5, 5."""
    a = np.exp(1j * np.linspace(math.pi / 2, 1.5 * math.pi, 25))
    way = r1 - a
    b = a + way * (0.5 + 1j * np.sqrt((2.5 / np.abs(way)) ** 2 - 0.25))
    path = 2 * b - a
    centred = np.column_stack((path.real, path.imag)) - (path.real.mean(), path.imag.mean())
    return centred @ np.linalg.svd(centred)[2][1]


def test_the_straightest_hoeken_linkage():
    """Of lengths 1, 2.5, 2.5 the best distance of pivots, by a search along the closed form."""
    m = fourbar("hoeken", r1=2.3, r2=1.0, r3=2.5, r4=2.5, u=5.0, v=0.0)
    target = kc.targets.straight("P", (math.pi / 2, 1.5 * math.pi), within=0.02)
    found = kc.fit(m, target, bounds={"r1": (1.8, 2.4)}, samples=16, starts=2)
    best = minimize_scalar(
        lambda r1: np.sum(hoekens_offsets(r1) ** 2), bounds=(1.8, 2.4), method="bounded",
        options={"xatol": 1e-10},
    )  # fmt: skip
    assert found.parameters["r1"] == pytest.approx(best.x, abs=1e-5)
    assert found.error == pytest.approx(best.fun, rel=1e-8)
    assert found.success
    (reached,) = found.reached
    assert reached.off == pytest.approx(np.abs(hoekens_offsets(best.x)).max(), rel=1e-4)
    assert "straightness of P" in found.to_text()


@pytest.mark.slow
def test_a_circle_beside_a_time_ratio_and_a_dwell_that_is_far():
    """B goes round A with the crank, whose length is found; the rocker rests nowhere."""
    m = fourbar()
    m.point("B1", m.bodies[0], (sympy.Symbol("r2"), 0))
    targets = [
        kc.targets.circular("B1", (0.5, 4.0), circle=(0, 0, 1.9), within=1e-6),
        kc.targets.time_ratio("rocker.phi", 1.2),
    ]
    bounds = {"r2": (1.8, 2.1), "r1": (3.5, 4.2), "r4": (2.4, 3.0)}
    found = kc.fit(m, targets, bounds=bounds, samples=64, starts=4)
    assert found.success
    assert found.parameters["r2"] == pytest.approx(1.9, abs=1e-6)
    rest = kc.targets.dwell("rocker.phi", (0.5, 4.0), within=1e-3)
    far = kc.fit(m, rest, bounds={"r4": (2.4, 3.0)}, samples=16, starts=2)
    assert not far.success
    assert "dwell of rocker.phi" in far.message


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: kc.targets.straight("P", (2, 1), within=1), "give the first time first"),
        (lambda: kc.targets.straight("P", (1, 2), within=0), "give positive numbers"),
        (
            lambda: kc.targets.straight("P", (1, 2), line=[(0, 0), (0, 0)], within=1),
            "has no direction",
        ),
        (lambda: kc.targets.circular("P", (1, 2), circle=(0, 0, -1), within=1), "positive radius"),
        (lambda: kc.targets.dwell("P.x", (1, 2), at="top", within=1), "not a finite number"),
        (
            lambda: kc.targets.path("P", [(1, 1)], [0], within=-1),
            "is to be within -1: give a positive",
        ),
        (
            lambda: kc.targets.time_ratio("x", 1.2, within=-1),
            "has weight and within: give positive",
        ),
    ],
)
def test_shapes_that_cannot_be_asked_for(make, words):
    with pytest.raises(kc.InputError, match=words):
        make()


def test_freudensteins_three_precision_points_are_reached():
    # y = x^1.5 on 1..4, Chebyshev's spacing; lengths by Freudenstein's linear equations, d = 1.
    x = np.array([1.20096189432334, 2.5, 3.79903810567666])
    theta = np.radians(20 + (x - 1) / 3 * 90)
    phi = np.radians(40 + (x**1.5 - 1) / 7 * 90)
    m = fourbar("freudenstein", r1=1.0, r2=0.6, r3=0.8, r4=0.6)
    target = kc.targets.value("rocker.phi", phi, theta)
    bounds = dict.fromkeys(("r2", "r3", "r4"), (0.2, 2.0))
    found = kc.fit(m, target, bounds=bounds, samples=64, starts=8)
    assert found.success
    assert found.error < 1e-20
    matrix = np.column_stack((np.cos(phi), -np.cos(theta), np.ones(3)))
    k1, k2, k3 = np.linalg.solve(matrix, np.cos(theta - phi))
    a, c = 1 / k1, 1 / k2
    b = math.sqrt(a * a + c * c + 1 - 2 * a * c * k3)
    assert (a, b, c) == pytest.approx((0.545874184319922, 0.872936471028201, 0.496810872280478))
    closed = [found.parameters[name] for name in ("r2", "r3", "r4")]
    np.testing.assert_allclose(closed, (a, b, c), rtol=1e-8)
    # The result is a model: it starts on its branch and passes the points.
    motion = kc.solve(kc.compile(found.model), theta)
    np.testing.assert_allclose(motion["rocker.phi"] % (2 * math.pi), phi, atol=1e-9)


def test_path_without_times_finds_them_in_order():
    m = fourbar(r1=4.0, r2=2.0, r3=5.0, r4=5.0, u=2.5, v=1.0)
    at = np.array([0.7, 1.5, 2.4, 3.4])
    points = kc.solve(kc.compile(m), at)
    wanted = np.column_stack((points["P.x"], points["P.y"]))
    bounds = {"u": (1, 4), "v": (0, 3)}
    found = kc.fit(m, kc.targets.path("P", wanted), bounds=bounds, samples=128, starts=4)
    assert found.error < 1e-18
    times = [item.t for item in found.reached if item.column == "x_P"]
    assert times == sorted(times)
    np.testing.assert_allclose(times, at, atol=1e-7)
    assert found.parameters == pytest.approx({"u": 2.5, "v": 1.0}, abs=1e-7)


def press():
    """Return a slider-crank of crank 1 and rod 3, whose guide has the offset e."""
    m = kc.Mechanism("press", end=2 * math.pi, points=181)
    e = m.parameter("e", 0.1, "m")
    crank, rod = m.body("crank", (0, 0, 0.3)), m.body("rod", (1, 0.3, 0))
    ram = m.body("ram", (4, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (1, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (3, 0), ram, (0, 0)))
    m.add(kc.Translational("D", m.ground, (0, e), (1, 0), ram, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t + 0.3))
    return m


def ratio_of_press(offset):
    """Return the time ratio: the rise takes pi + beta, beta between both dead centres."""
    turn = abs(math.asin(offset / 4) - math.asin(offset / 2))
    return (math.pi + turn) / (math.pi - turn)


def test_time_ratio_of_an_offset_slider_crank_is_reached():
    ratio = kc.targets.time_ratio("ram.x", 1.1)
    found = kc.fit(press(), ratio, bounds={"e": (-1.5, -0.01)}, samples=32)
    assert found.success
    assert ratio_of_press(found.parameters["e"]) == pytest.approx(1.1, abs=1e-7)


def test_that_each_time_ratio_counts_once():
    ratios = [kc.targets.time_ratio("ram.x", 1.1), kc.targets.time_ratio("ram.x", 1.3)]
    x = kc.targets.value("ram.x", [3.8], [0.2])
    found = kc.fit(press(), [*ratios, x], bounds={"e": (-1.5, -0.01)}, samples=32)
    assert [item.wanted for item in found.reached] == [3.8, 1.1, 1.3]

    def error(e):
        place = math.cos(0.5) + math.sqrt(9 - (math.sin(0.5) - e) ** 2)
        ratio = ratio_of_press(e)
        return (place - 3.8) ** 2 + (ratio - 1.1) ** 2 + (ratio - 1.3) ** 2

    best = minimize_scalar(error, bounds=(-1.5, -0.01), options={"xatol": 1e-10})
    assert found.parameters["e"] == pytest.approx(best.x, abs=1e-5)
    assert found.error == pytest.approx(best.fun, rel=1e-6)


@pytest.mark.parametrize("minimizer", ["SLSQP", slow("trust-constr")])
def test_active_limit_holds_and_costs_as_little_as_possible(minimizer):
    m = fourbar()
    r2 = sympy.Symbol("r2")
    target = kc.targets.value("rocker.phi", [1.9, 1.7], [0.5, 1.0])
    free = kc.fit(m, target, bounds={"r2": (0.5, 3), "r4": (2, 4)}, samples=64, starts=4)
    longest = 0.8 * free.parameters["r2"]
    targets = [target, kc.targets.limit(r2, most=longest, title="crank")]
    bounds = {"r2": (0.5, 3), "r4": (2, 4)}
    found = kc.fit(m, targets, bounds=bounds, samples=64, starts=4, minimizer=minimizer)
    assert found.limits[0].holds
    assert found.parameters["r2"] == pytest.approx(longest, rel=2e-6)
    # The least along the limit, by a scan of the other dimension.
    scan = found.parameters["r4"] + np.linspace(-0.02, 0.02, 41)
    motion = kc.solve(kc.compile(m), [0.5, 1.0], {"r2": longest, "r4": scan})
    errors = ((motion["rocker.phi"] - [1.9, 1.7]) ** 2).sum(axis=1)
    assert found.error <= errors.min() * (1 + 1e-3)


@pytest.mark.slow
def test_transmission_angle_is_kept_over_the_whole_turn():
    m = fourbar(r1=4.0, r2=1.5, r3=4.0, r4=3.0)
    at = [0.5, 1.2]
    own = kc.solve(kc.compile(m), at, {"r2": 1.2, "r4": 3.5})
    target = kc.targets.path("P", np.column_stack((own["P.x"], own["P.y"])), at)
    keep = kc.targets.limit("mu", 45 * kc.deg, 135 * kc.deg, title="transmission angle")
    bounds = {"r2": (0.3, 3), "r3": (2, 6), "r4": (2, 6), "u": (-3, 3), "v": (-3, 3)}
    found = kc.fit(m, [target, keep], bounds=bounds, samples=128, starts=4)
    assert found.success
    whole = kc.solve(kc.compile(found.model), np.linspace(0, 2 * math.pi, 73))
    assert whole.success
    assert whole["mu"].min() >= math.radians(45) - 1e-6
    assert whole["mu"].max() <= math.radians(135) + 1e-6


@pytest.mark.parametrize(
    ("points", "ahead"),
    [slow(5, 0.0), (9, 0.5), slow(73, 0.04)],
)
def test_limits_are_kept_between_the_times_of_the_model(points, ahead):
    m = fourbar(points=points, ahead=ahead, r1=4.0, r2=1.5, r3=4.0, r4=3.0)
    at = [0.5, 1.2]
    own = kc.solve(kc.compile(m), at, {"r2": 1.9, "r4": 3.5})
    target = kc.targets.path("P", np.column_stack((own["P.x"], own["P.y"])), at)
    keep = kc.targets.limit("mu", least=45 * kc.deg, title="transmission angle")
    bounds = {"r2": (0.3, 3), "r4": (2, 6)}
    found = kc.fit(m, [target, keep], bounds=bounds, samples=64, starts=4)
    r2, r4 = (found.parameters[name] for name in bounds)
    # The angle is least where crank and ground lie on one line.
    least = math.acos((4.0**2 + r4**2 - (4.0 - r2) ** 2) / (2 * 4.0 * r4))
    assert least >= math.radians(45) - 1e-7
    assert least == pytest.approx(math.radians(45), abs=1e-5)
    assert found.limits[0].holds
    assert found.limits[0].least == pytest.approx(least, abs=1e-9)


def test_that_a_limit_which_is_broken_between_the_times_does_not_hold():
    keep = kc.targets.limit("mu", least=80 * kc.deg, title="transmission angle")
    target = kc.targets.path("P", [(3, 3), (2, 3.5)], [0.5, 1.2])
    m = fourbar(points=5, ahead=math.pi / 4)
    found = kc.fit(m, [target, keep], bounds={"u": (1, 2), "v": (1, 2)}, samples=32, starts=3)
    least = math.acos((4.0**2 + 2.7**2 - (3.7 - 2.0) ** 2) / (2 * 4.0 * 2.7))
    assert found.limits[0].least == pytest.approx(least, abs=1e-9)
    assert not found.limits[0].holds
    assert not found.success
    assert found.errors == ()
    assert len(found.outside) == 1 + len(found.others)
    assert list(found.outside) == sorted(found.outside)


@pytest.mark.parametrize("rate", [slow("phi_dot"), "phi_ddot"])
def test_limits_of_rates_are_judged_between_the_times(rate):
    m = fourbar(points=5)
    whole = kc.solve(kc.compile(m), np.linspace(0, 2 * math.pi, 20001))[f"rocker.{rate}"]
    target = kc.targets.value("P.x", [3.0], [0.5])
    keep = kc.targets.limit(f"rocker.{rate}", most=0.999 * whole.max())
    found = kc.fit(m, [target, keep], bounds={"u": (1, 2)}, samples=16, starts=2)
    assert not found.limits[0].holds
    assert found.limits[0].greatest == pytest.approx(whole.max(), rel=1e-4)


def test_result_never_jumps_its_branch():
    # Wanted are points of both branches of one four-bar: a fit that jumped would reach them all.
    m = fourbar()
    module = kc.compile(m)
    positions = kc.assemblies(module, 0.5)
    one, other = (kc.solve(module, [0.5, 0.9], guess=q) for q in positions)
    wanted = [(one["P.x"][0], one["P.y"][0]), (other["P.x"][1], other["P.y"][1])]
    target = kc.targets.path("P", wanted, [0.5, 0.9])
    found = kc.fit(m, target, bounds={"u": (1.6, 1.8), "v": (1.6, 1.8)}, samples=32, starts=4)
    assert not found.success
    assert found.error > 0.1
    assert "the farthest is" in found.message
    fine = np.linspace(0.5, 0.9, 50)
    motion = kc.solve(kc.compile(found.model), fine)
    np.testing.assert_allclose(motion["P.x"][[0, -1]], found.motion["P.x"], atol=1e-9)
    assert (motion.branch == motion.branch[0]).all()


def test_target_out_of_reach_says_how_near_and_where():
    found = kc.fit(
        fourbar(), kc.targets.path("P", [(30, 0)], [0.5]), bounds={"u": (0, 2), "v": (0, 2)},
        samples=32,
    )  # fmt: skip
    assert not found.success
    assert "x_P at t = 0.5" in found.message
    assert "from 30" in found.message
    assert "(far)" in str(found)


@pytest.mark.slow
def test_search_by_differential_evolution_reaches_the_same():
    m = fourbar()
    motion = kc.solve(kc.compile(m), [0.5, 1.0, 1.5])
    wanted = np.column_stack((motion["P.x"], motion["P.y"]))
    target = kc.targets.path("P", wanted, [0.5, 1.0, 1.5])
    bounds = {"r2": (1.5, 2.5), "u": (1, 2), "v": (1, 2)}
    found = kc.fit(m, target, bounds=bounds, samples=8, starts=2, search="differential evolution")
    assert found.error < 1e-18
    assert found.counts.sampled > 8


def test_same_seed_gives_the_same_result():
    target = kc.targets.path("P", [(3, 3), (2, 3.6)], [0.5, 1.1])
    one, other = (
        kc.fit(fourbar(), target, bounds={"u": (1, 2), "v": (1, 2)}, samples=32, starts=2)
        for _ in range(2)
    )
    assert one.parameters == other.parameters


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"bounds": {"q": (0, 1)}}, "no parameter 'q'"),
        ({"bounds": {"u": (2, 1)}}, "the bounds of 'u' go from 2 to 1"),
        ({"bounds": {"u": (0, math.inf)}}, "give finite numbers"),
        ({"bounds": {"u": 3}}, "the bounds of 'u' are 3"),
        ({"parameters": ["u"]}, "'u' has no bounds"),
        ({}, "four_bar has no design variables"),
        ({"parameters": ["u"], "bounds": {"u": (0, 1), "v": (0, 1)}}, "there are bounds of v"),
        ({"bounds": {"u": (0, 1)}, "p": {"u": 1}}, "is both a design variable and fixed in p"),
        ({"bounds": {"u": (0, 1)}, "starts": 0}, "starts is 0"),
        ({"bounds": {"u": (0, 1)}, "search": "genetic"}, "there is no search 'genetic'"),
        ({"bounds": {"u": (0, 1)}, "minimizer": "BFGS"}, "there is no minimizer 'BFGS'"),
        ({"bounds": {"r2": (30, 40)}, "samples": 8}, "does not move through the times"),
        ({"targets": [], "bounds": {"u": (0, 1)}}, "there is nothing to reach"),
        ({"targets": ["P"], "bounds": {"u": (0, 1)}}, "'P' is not a target"),
        ({"targets": kc.targets.path("Q", [(1, 2)]), "bounds": {"u": (0, 1)}}, "'x_Q'"),
        (
            {"targets": kc.targets.time_ratio("speed", 2), "bounds": {"u": (0, 1)}},
            "time ratio of speed: four_bar: the output 'speed' has no second rate",
        ),
        (
            {"targets": kc.targets.value("speed_ddot", [1.0], [0.5]), "bounds": {"u": (0, 1)}},
            "speed_ddot: four_bar: the output 'speed' has no second rate",
        ),
        (
            {"targets": kc.targets.time_ratio("P.x_dot", 2), "bounds": {"u": (0, 1)}},
            "name the coordinate or output itself",
        ),
        (
            {"targets": kc.targets.time_ratio("crank.phi", 2), "bounds": {"u": (1.6, 1.7)}},
            "there is no time ratio of phi_crank: a time ratio needs a column that rises",
        ),
    ],
)
def test_bad_input_says_what_and_where(arguments, words):
    given = {"samples": 32, "targets": kc.targets.path("P", [(3, 3)], [0.5]), **arguments}
    m = fourbar()
    m.output("speed", sympy.Symbol("phi_rocker_dot"))
    with pytest.raises(kc.InputError, match=words):
        kc.fit(m, **given)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: kc.targets.path("P", [(1, 2)], [0.1, 0.2]), "1 values and 2 times"),
        (lambda: kc.targets.path("P", [(1, 2), (2, 3)], [0.2, 0.1]), "do not rise"),
        (lambda: kc.targets.path("P", [(1, math.nan)]), "is not a finite number"),
        (lambda: kc.targets.path("P", 3), "give a list of numbers"),
        (lambda: kc.targets.path("P", [(1,)]), "have 1 coordinates"),
        (lambda: kc.targets.pose("rod", [(1, 2)]), "give x, y, phi"),
        (lambda: kc.targets.value("mu", [1.0], weight=-1), "has the weight -1"),
        (lambda: kc.targets.value("mu", [1.0], between=(2, 1)), "give the first time first"),
        (lambda: kc.targets.time_ratio("mu", -1), "give a positive number"),
        (lambda: kc.targets.limit("mu"), "has no limit"),
        (lambda: kc.targets.limit("mu", 2, 1), "give the least value first"),
    ],
)
def test_targets_check_what_they_are_given(make, words):
    with pytest.raises(kc.InputError, match=words):
        make()


def three_cranks():
    """Three parallel cranks that carry a bar: one joint more than the motion needs."""
    m = kc.Mechanism("cranks", end=6.0, points=25)
    a, other = m.parameter("a", 1.0, "m"), m.parameter("other", 1.0, "m")
    u, v = m.parameter("u", 0.5, "m"), m.parameter("v", 0.8, "m")
    bar = m.body("bar", (1, 0, 0))
    for k, at in enumerate([(0, 0), (2, 0), (1, 1.5)]):
        crank = m.body(f"crank_{k}", (*at, 0.01))
        m.add(kc.Revolute(f"A{k}", m.ground, at, crank, (0, 0)))
        m.add(kc.Revolute(f"B{k}", crank, (a if k < 2 else a * other, 0), bar, at))
        if k == 0:
            m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    m.point("P", bar, (u, v))
    return m


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.errors.RedundantConstraintWarning")
def test_redundant_equations_are_fitted_as_others_are():
    t = np.linspace(0, 6, 7)  # at zero two of the cranks are a flat parallelogram
    circle = np.column_stack((1.3 * np.cos(t) + 0.7, 1.3 * np.sin(t) + 0.4))
    bounds = {"a": (0.5, 2), "u": (0, 1), "v": (0, 1)}
    target = kc.targets.path("P", circle, t)
    found = kc.fit(three_cranks(), target, bounds=bounds, samples=8, starts=1)
    assert found.success
    assert [found.parameters[name] for name in "auv"] == pytest.approx([1.3, 0.7, 0.4])
    with pytest.raises(kc.InputError, match=r"Equations that repeat others, B2\.x, have to agree"):
        kc.fit(three_cranks(), target, bounds={"other": (0.5, 0.9)}, samples=4, starts=1)
    with pytest.raises(kc.InputError, match="no longer agree with the others if other changed"):
        kc.tolerance(three_cranks(), {"a": 1e-3, "other": 1e-3}, of="P.x")


def test_points_are_matched_in_their_order_at_least_cost():
    rng = np.random.default_rng(3)
    off = rng.random((5, 7, 3))
    error, chosen = in_order(off)
    for k in range(5):
        every = {
            (a, b, c): off[k, a, 0] + off[k, b, 1] + off[k, c, 2]
            for a in range(7)
            for b in range(a + 1, 7)
            for c in range(b + 1, 7)
        }
        assert error[k] == pytest.approx(min(every.values()))
        assert tuple(chosen[k].tolist()) == min(every, key=lambda key: every[key])


@pytest.mark.slow
def test_five_points_with_times_are_reached_as_well_as_published():
    points = [(3, 3), (2.759, 3.363), (2.372, 3.663), (1.890, 3.862), (1.355, 3.943)]
    target = kc.targets.path("P", points, np.radians([30, 45, 60, 75, 90]))
    r1, r2, r3, r4 = sympy.symbols(LENGTHS)
    rest = (r1 + r3 + r4 - r2, r1 + r4 - r3 - r2, r1 + r3 - r4 - r2, r3 + r4 - r1 - r2)
    limits = [kc.targets.limit(item, least=0) for item in (*rest[1:], r1 - r2, r3 - r2, r4 - r2)]
    bounds = dict.fromkeys(LENGTHS, (0.1, 50)) | {"u": (-50, 50), "v": (-50, 50)}
    found = kc.fit(fourbar(), [target, *limits], bounds=bounds)
    assert found.error <= 7.4157513068e-7 * (1 + 1e-10)
