"""The motion that emitted JavaScript solves for, against the runtime: numbers, statuses, events."""

import json
import warnings

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import problem
from kincompile.runtime.results.observed import observed
from kincompile.runtime.status import Status

from .conftest import CHROMIUM, NODE, SPACE, in_chromium, in_node

FACTORS = ((1.0, 1.0), (0.9, 1.1), (0.6, 1.5), (0.3, 2.0))
"""Between which parts of its default each parameter is drawn, for one motion after the other."""

SOLVE = """JSON.stringify(JOBS.map(([t, p, guess]) => {
  const motion = MODEL.solver.solve(MODEL, t, p, guess), event = MODEL.solver.explain(motion);
  const arrays = ["q", "q_dot", "q_ddot", "y", "y_dot", "y_ddot", "status", "near", "iterations"];
  const found = Object.fromEntries(arrays.map(name => [name, Array.from(motion[name])]));
  const { size, magnitude, noise } = motion.equations;
  return [{ ...found, scales: [[size], Array.from(magnitude), Array.from(noise)] }, event];
}))"""

STATUSES = "JSON.stringify(Object.entries(MODEL.solver).filter(([, x]) => Number.isInteger(x)))"

RUNNERS = [
    pytest.param(
        in_node, marks=pytest.mark.skipif(NODE is None, reason="node is not installed"), id="node"
    ),
    pytest.param(
        in_chromium,
        marks=[
            pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
            pytest.mark.slow,
            pytest.mark.browser,
        ],
        id="chromium",
    ),
]


@pytest.fixture(params=RUNNERS)
def solved(request, tmp_path):
    """Return the function that solves a model for (times, parameters, guess) in JavaScript."""

    def run(model, jobs):
        (tmp_path / "model.js").write_text(kc.emit(model, "javascript").source, encoding="utf-8")
        text = SOLVE.replace("JOBS", json.dumps(jobs)).replace("MODEL", model.name)
        return json.loads(request.param(tmp_path, {"model": model.name}, text))

    return run


def compare(found, event, solution):
    """Compare a motion with the runtime's, relative to the largest number of its kind."""
    assert found["status"] == solution.status.tolist()
    module, p = solution.module, np.array(list(solution.parameters.values()))
    motion = solution.q, solution.q_dot, solution.q_ddot
    outputs = observed(code_of(module), motion, solution.t, p)
    if np.isfinite(solution.q[0]).all():
        with np.errstate(all="ignore"):  # as while it solves
            equations = problem(code_of(module), p, solution.q[0].copy(), solution.t[0])
        scales = np.array([equations.size]), equations.magnitude, equations.noise
        for values, known in zip(found["scales"], scales, strict=True):
            np.testing.assert_allclose(values, known, rtol=1e-6)
    names = ("q", "q_dot", "q_ddot", "y", "y_dot", "y_ddot")
    for name, known in zip(names, (*motion, outputs.y, outputs.y_dot, outputs.y_ddot), strict=True):
        values = np.array(found[name], dtype=float).reshape(known.shape)
        np.testing.assert_array_equal(np.isfinite(values), np.isfinite(known), name)
        scale = np.max(np.abs(known), where=np.isfinite(known), initial=0.0)
        np.testing.assert_allclose(values, known, rtol=0, atol=1e-9 * scale, err_msg=name)
    assert (event is None) == (not solution.events)
    if event is not None:
        known = solution.events[-1]
        assert (event["kind"], tuple(event["bodies"])) == (known.kind, known.bodies)
        assert event["t"] == pytest.approx(known.t, rel=1e-7)


def jobs_of(model, module):
    """Return times and parameters: the model's own, and twice as long with other lengths."""
    rng = np.random.default_rng(20261122)
    size = module.DEFAULTS.size
    sets = [module.DEFAULTS * rng.uniform(*part, size) for part in FACTORS[: 4 if size else 1]]
    end, points = model.system().end, min(model.system().points, 201)
    grids = np.linspace(0, end, points), np.linspace(0, 2 * end, 151)
    return [[t.tolist(), p.tolist(), module.GUESS.tolist()] for p in sets for t in grids]


@pytest.mark.every(5)
@pytest.mark.filterwarnings("ignore::kincompile.errors.SingularConfigurationWarning")
def test_that_motions_of_examples_are_those_of_the_runtime(solved, example):
    jobs = jobs_of(example.model, example.module)
    for (t, p, _), (found, event) in zip(jobs, solved(example.model, jobs), strict=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kc.AssemblyWarning)
            compare(found, event, kc.solve(example.module, t, p))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.errors.SingularConfigurationWarning")
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize("path", SPACE, ids=lambda path: path.stem)
def test_that_motions_in_space_are_those_of_the_runtime(solved, path):
    model = kc.read_model(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        module = kc.compile(model)
        jobs = [[x[0][::10], *x[1:]] for x in jobs_of(model, module)[:4]]
        for (t, p, _), (found, event) in zip(jobs, solved(model, jobs), strict=True):
            compare(found, event, kc.solve(module, t, p))


@pytest.mark.skipif(NODE is None, reason="node is not installed")
def test_that_statuses_have_the_names_of_the_runtime(example_named, tmp_path):
    kc.emit(example_named("four_bar").model, "javascript").write(tmp_path)
    found = json.loads(
        in_node(tmp_path, {"four_bar": "four_bar"}, STATUSES.replace("MODEL", "four_bar"))
    )
    assert dict(found) == {status.name: int(status) for status in Status}


@pytest.mark.slow
def test_that_lock_ups_are_among_them(example_named):
    """Else the comparison above would not see one."""
    kinds = set()
    for name in ("wrecker_boom", "swing_and_dwell", "problem_3_5_6"):
        example = example_named(name)
        for t, p, _ in jobs_of(example.model, example.module):
            kinds |= {event.kind for event in kc.solve(example.module, t, p).events}
    assert kinds == {"lock-up"}


def test_that_angles_start_in_the_turn_of_their_driver(solved):
    m = spatial.Mechanism("wheel")
    x, z = (1, 0, 0), (0, 0, 1)
    disc = m.body("disc")
    m.add(spatial.Screw("S", m.ground, (0, 0, 0), z, x, disc, (0, 0, 0), z, x, 0.3))
    m.add(spatial.RelativeRotation("motor", m.ground, z, x, disc, z, x, 50 * kc.t))
    ((found, _),) = solved(m, [[[1.0, 2.0], [], [0, 0, 0, 1, 0, 0, 0, 0]]])
    angles = np.reshape(found["q"], (2, -1))[:, -1]
    np.testing.assert_allclose(angles, [50, 100], rtol=1e-13)


def parallelogram():
    """Return a parallelogram, which goes through a bifurcation when it lies flat."""
    m = kc.Mechanism("parallelogram", end=4.0, points=41)
    r = m.parameter("r", 1.0, unit="m")
    names = ("left", "coupler", "right")
    left, coupler, right = (m.body(name) for name in names)
    m.add(kc.Revolute("A", m.ground, (0, 0), left, (0, 0)))
    m.add(kc.Revolute("B", left, (r, 0), coupler, (0, 0)))
    m.add(kc.Revolute("C", coupler, (3, 0), right, (r, 0)))
    m.add(kc.Revolute("D", right, (0, 0), m.ground, (3, 0)))
    m.add(kc.AbsoluteAngle("motor", left, 1 + kc.t))
    return m


GUESS = [0, 0, 1, 0.54, 0.84, 0, 3, 0, 1]


def free(name, equation, unit=""):
    coordinate = kc.Coordinate("x", guess=0.4, unit=unit) if unit else "x"
    return kc.ConstraintSystem(name, [coordinate], [equation])


x = sympy.Symbol("x")
CASES = {
    "bifurcation": (parallelogram, GUESS, (0, 4, 41)),
    "beside it": (parallelogram, GUESS, (0, 4, 18)),
    "falling times": (parallelogram, GUESS, (2, -3, 41)),
    "at a bifurcation": (parallelogram, [0, 0, 0, 1, 0, 0, 3, 0, 0], (-1, 1, 5)),
    "one time": (parallelogram, GUESS, (0.5, 0.5, 1)),
    "rough guess": (parallelogram, [0] * 9, (0, 1, 5)),
    "far guess": (parallelogram, [5, -7, 9, 40, 3, 30, -3, 8, -9], (0, 1, 5)),
    "lock-up": (lambda: free("root", x**2 - 1 + kc.t), [1.0], (0, 2, 21)),
    "lock-up at a point": (lambda: free("root", x**2 - 1 + kc.t), [1.0], (0, 2, 3)),
    "lock-up at the start": (lambda: free("root", x**2 - kc.t), [0.0], (0, 1, 3)),
    "no root": (lambda: free("none", x**2 + 1 + kc.t**2), [0.3], (0, 1, 3)),
    "not finite": (lambda: free("log", sympy.log(x) - kc.t), [-1.0], (0, 1, 3)),
    "no other side": (lambda: free("log", x * sympy.log(x) + 0.3), [0.3717418546365915], (0, 1, 3)),
    "steeper and steeper": (
        lambda: free("steep", sympy.tan(x) - 10 * kc.t), [0.0], (0, 1e5, 9)
    ),
    "larger and larger": (lambda: free("grows", x**3 - kc.t), [1e-3], (1e-9, 1, 9)),
    "no values beside the guess": (
        lambda: free("edge", sympy.sqrt(x - 5) - 0.3 - kc.t), [5.1], (0, 1, 9)
    ),
    "ends": (lambda: free("ends", x - sympy.sqrt(1 - kc.t)), [1.0], (0, 2, 5)),
    "jump": (
        lambda: free("jump", x - sympy.Piecewise((0, kc.t < 0.55), (3, True))), [0.0], (0, 1, 11)
    ),
}  # fmt: skip


@pytest.mark.every(5)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.filterwarnings("ignore::kincompile.errors.CornerWarning")
@pytest.mark.filterwarnings("ignore::kincompile.errors.AssemblyWarning")
@pytest.mark.filterwarnings("ignore::kincompile.errors.SingularConfigurationWarning")
def test_that_a_motion_ends_as_in_the_runtime(solved, case):
    make, guess, grid = CASES[case]
    model = make()
    module, t = kc.compile(model), np.linspace(*grid)
    ((found, event),) = solved(model, [[t.tolist(), module.DEFAULTS.tolist(), guess]])
    compare(found, event, kc.solve(module, t, guess=guess))


@pytest.mark.filterwarnings("ignore::kincompile.errors.AssemblyWarning")
@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "cam_flat_follower"])
def test_that_rough_guesses_lead_where_the_runtime_goes(solved, example_named, name):
    """Turned by whole turns, and so rough that the nearer branch is not the first that is found."""
    model, module = example_named(name).model, example_named(name).module
    start = example_named(name).solution.q[0]
    equations = problem(code_of(module), module.DEFAULTS, start.copy(), 0.0)
    rng = np.random.default_rng(7)
    guesses = start + equations.reference * rng.uniform(-0.8, 0.8, (60, start.size))
    guesses[::2] += equations.angular * 2 * np.pi * rng.integers(-2, 3, (30, start.size))
    jobs = [[[0.0], module.DEFAULTS.tolist(), guess.tolist()] for guess in guesses]
    ways = set()
    for guess, (found, _) in zip(guesses, solved(model, jobs), strict=True):
        known = kc.solve(module, [0.0], guess=guess)
        assert found["status"] == known.status.tolist()
        q = np.array(found["q"], dtype=float)
        np.testing.assert_allclose(q, known.q[0], atol=1e-8 * equations.size)
        ways.add(tuple(np.round(known.q[0] - start, 3)))
    assert len(ways) > 3


def test_that_a_guess_as_far_as_numbers_go_loosens_no_equation(solved, example_named):
    model, module = example_named("four_bar").model, example_named("four_bar").module
    angular = np.array([module.UNITS[name] == "rad" for name in module.COORDINATES])
    jobs = [
        [[0.0], module.DEFAULTS.tolist(), (module.GUESS + 10.0**power * moved).tolist()]
        for power in (11, 13, 16, 100, 300)
        for moved in (angular, ~angular)
    ]
    for found, _ in solved(model, jobs):
        if found["status"] == [Status.CONVERGED]:
            np.testing.assert_allclose(module.Phi(np.array(found["q"]), 0.0), 0, atol=1e-4)


def test_that_corners_of_drivers_have_their_status(solved):
    m = kc.Mechanism("ramp", end=1.0, points=11)
    arm = m.body("arm", guess=(0, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (0, 0)))
    angle = sympy.Piecewise((0, kc.t < 0.5), (kc.t - 0.5, True))
    m.add(kc.AbsoluteAngle("motor", arm, angle, corners=True))
    module, t = kc.compile(m), np.linspace(0, 1, 11)
    ((found, event),) = solved(m, [[t.tolist(), [], module.GUESS.tolist()]])
    with pytest.warns(kc.CornerWarning):
        solution = kc.solve(module, t)
    assert set(found["status"]) == {0, 5}
    compare(found, event, solution)


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_redundant_equations_are_left_out_of_the_solve(solved, case_named):
    model, t = case_named("repeated").model, np.linspace(0, 1, 11)
    module = kc.compile(model)
    ((found, event),) = solved(model, [[t.tolist(), [], module.GUESS.tolist()]])
    compare(found, event, kc.solve(module, t))


@pytest.mark.parametrize("end", [40, 400])
def test_that_an_equation_that_becomes_small_is_not_singular(solved, end):
    t = np.linspace(0, end, 41).tolist()
    model = free("decay", sympy.exp(-x) - sympy.exp(-kc.t))
    ((found, event),) = solved(model, [[t, [], [0]]])
    assert event is None
    assert found["status"] == [0] * len(t)
    np.testing.assert_allclose(found["q"], t, rtol=0, atol=1e-7 * end)
    assert kc.solve(kc.compile(model), t, guess=[0]).success


def test_that_a_gap_takes_as_many_steps_as_in_the_runtime(solved):
    """After a step that was too long the next ones are no longer: fewer fail."""
    model = free("wave", x - sympy.sin(kc.t))
    solution = kc.solve(kc.compile(model), [0, 300.0], guess=[0])
    ((found, _),) = solved(model, [[[0, 300.0], [], [0]]])
    np.testing.assert_allclose(found["q"], [0, np.sin(300.0)], rtol=0, atol=1e-9)
    assert found["iterations"][0] == solution.iterations[0]
    assert found["iterations"][1] == pytest.approx(solution.iterations[1], rel=0.03)
