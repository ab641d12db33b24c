"""The march that an emitted NumPy module ends with: what the runtime and the solver's text find."""

import linecache
import warnings

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.errors import InputError
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import problem
from kincompile.runtime.status import Status
from tests.unit.solver import conftest as solver

from .conftest import SPACE
from .test_javascript_motion import CASES, free, jobs_of

pytestmark = [
    pytest.mark.filterwarnings("ignore::kincompile.errors.SingularConfigurationWarning"),
    pytest.mark.filterwarnings("ignore::kincompile.errors.AssemblyWarning"),
    pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning"),
]


@pytest.fixture
def loaded(tmp_path):
    """Return the function that gives the module in the file of a model."""

    def load(model, **options):
        emitted = kc.emit(model, **options)
        emitted.write(tmp_path)
        return kc.load(tmp_path / f"{emitted.name}.py")

    return load


def compare(module, t, p=None):
    """Compare a march with the runtime's, from the position at which that starts."""
    p = module.DEFAULTS if p is None else p
    solution = kc.solve(module, t, p)
    if not np.isfinite(solution.q[0]).all():
        return solution
    *found, status = module.march(solution.q[0], t, p)
    np.testing.assert_array_equal(status, solution.status)
    reached = status == Status.CONVERGED
    for here, there in zip(found, (solution.q, solution.q_dot, solution.q_ddot), strict=True):
        known = there[reached]
        np.testing.assert_allclose(here[reached], known, rtol=0, atol=1e-11 * np.max(abs(known)))
        assert np.isnan(here[~reached]).all()
    return solution


@pytest.mark.every(5)
def test_that_motions_of_examples_are_those_of_the_runtime(loaded, example):
    module = loaded(example.model)
    for t, p, _ in jobs_of(example.model, module):
        compare(module, np.array(t[::3]), p)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=[pytest.mark.slow] * (path.stem != "spatial_slider_crank"))
        for path in SPACE
    ],
    ids=lambda path: path.stem,
)
def test_that_motions_in_space_are_those_of_the_runtime(loaded, path):
    model = kc.read_model(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        module = loaded(model)
    for t, p, _ in jobs_of(model, module)[:4]:
        compare(module, np.array(t[::10]), p)


def test_that_lock_ups_are_among_them(loaded, example_named):
    """Else the comparison above would not see one."""
    model = example_named("wrecker_boom").model
    module = loaded(model)
    solutions = [compare(module, np.array(t[::3]), p) for t, p, _ in jobs_of(model, module)]
    assert {Status.CONVERGED, Status.LOCK_UP} <= {x for item in solutions for x in item.status}


@pytest.mark.every(5)
@pytest.mark.parametrize("case", CASES)
def test_that_a_motion_ends_as_by_the_text(loaded, monkeypatch, case):
    """As in C and Rust, where the text on NumPy has arrays, in which nothing raises."""
    make, guess, grid = CASES[case]
    module, t = loaded(make()), np.linspace(*grid)
    q = kc.solve(module, t[:1], guess=guess).q[0]
    q = q if np.isfinite(q).all() else np.array(guess, dtype=float)
    with np.errstate(all="ignore"):
        size = problem(code_of(module), module.DEFAULTS, q.copy(), t[0]).size
    monkeypatch.setattr(solver, "start_of", lambda *_: (q, size))
    reached, expected = solver.marched(module, 1, t, [module.DEFAULTS])
    *found, status = module.march(q, t, size=size)
    np.testing.assert_array_equal(status, expected.status)
    for here, there in zip(found, (expected.q, expected.q_dot, expected.q_ddot), strict=True):
        known = there.T[:reached]
        atol = 1e-10 * np.max(abs(known), initial=0.0)
        np.testing.assert_allclose(here[:reached], known, rtol=1e-9, atol=atol)


x = sympy.Symbol("x")
RAISING = {
    "1/0": (1 / x - 1 - kc.t, 0.0),
    "1/0 on the way": (x - 1 / (1 - 2 * kc.t), 1.0),
    "a singular Phi_q": (x**2 - kc.t, 0.0),
    "overflow of a power": (x**40 - 1 - kc.t, 1e200),
    "overflow of a function": (sympy.exp(x) - 1 - kc.t, 1e4),
    "outside a domain": (sympy.log(x) + kc.t, -1.0),
    "a root of a negative number on the way": (x - sympy.sqrt(0.3 - kc.t), 0.5),
    "an equation without terms": (x**3 * 1e-200 - kc.t, 1e-150),
}


@pytest.mark.parametrize("case", RAISING)
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_that_no_number_lets_a_march_raise(loaded, case):
    equation, guess = RAISING[case]
    module = loaded(free("raising", equation))
    for size in (None, 1.0, 1e-300, 1e300):
        q, q_dot, q_ddot, status = module.march([guess], np.linspace(0, 1, 6), size=size)
        reached = (status == 0).sum()
        assert reached < 6 or size == 1e300  # by which nothing is large
        assert not status[:reached].any()
        assert status[reached:].all()
        assert np.isfinite([q[:reached], q_dot[:reached], q_ddot[:reached]]).all()


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_that_no_guess_lets_a_march_raise(loaded, example_named):
    rng = np.random.default_rng(7)
    module = loaded(free("far", sympy.sin(x) - kc.t))
    assert module.march([1.7e308], [0.0, 0.1])[3].shape == (2,)
    for name in ("four_bar", "cam_by_table", "slot_follower"):
        module = loaded(example_named(name).model)
        for power in (0, 1, 10, 100, 300):
            q = 10.0**power * rng.uniform(-1, 1, module.N_COORDINATES)
            status = module.march(q, [0.0, 0.1, 0.2])[3]
            assert status.shape == (3,)


def test_that_sizes_are_those_of_the_runtime(loaded, example):
    module = loaded(example.model)
    size = problem(code_of(module), module.DEFAULTS, example.solution.q[0].copy(), 0.0).size
    found = vars(module)["_size"](example.solution.q[0], 0.0, module.DEFAULTS)
    if module.BODIES:
        assert found == pytest.approx(size, rel=1e-6)
    else:  # there are no lever arms: lengths serve, which any size near them does
        assert size / 3 < found < 3 * size


@pytest.mark.parametrize(
    ("q", "t", "size", "message"),
    [
        (np.zeros((2, 9)), [0.0], None, "a position q"),
        (np.zeros(9), 0.0, None, "times t"),
        (np.zeros(9), [], None, "at least one"),
        (np.zeros(9, dtype=complex), [0.0], None, "real numbers"),
        (np.zeros(8), [0.0], None, "must hold 9 numbers"),
        (np.zeros(9), [np.nan], None, "t is not finite"),
        (np.zeros(9), [0.0], 0.0, "a length above 0, not 0.0"),
        (np.zeros(9), [0.0], np.inf, "a length above 0, not inf"),
    ],
)
def test_that_wrong_arguments_are_refused(loaded, example_named, q, t, size, message):
    module = loaded(example_named("four_bar").model)
    with pytest.raises(InputError, match=message):
        module.march(q, t, size=size)


def test_that_modules_with_more_in_them_have_one_too(loaded, example_named):
    model = example_named("four_bar").model
    module = loaded(model, sensitivities=["a"])
    q = kc.solve(module, [0.0]).q[0]
    assert not module.march(q, np.linspace(0, 1, 11))[3].any()
    model = example_named("balanced_four_bar").model
    compare(loaded(model, dynamics=True), np.linspace(0, 1, 11))


def test_that_redundant_equations_are_left_out(loaded, case_named):
    compare(loaded(case_named("repeated").model), np.linspace(0, 1, 11))


def test_which_modules_have_none(case_named, example_named):
    grouped = kc.emit(example_named("four_bar").model, form="grouped").source
    free_body = kc.emit(case_named("undriven").model).source
    assert "def march(" not in grouped + free_body
    assert not hasattr(example_named("four_bar").module, "march")


def test_that_the_march_ends_a_file(example_named):
    """What comes before it is the text of the module that `kc.compile` gives."""
    before, _, march = example_named("four_bar").source.partition("\n# ---- march: ")
    compiled = "".join(linecache.getlines(example_named("four_bar").module.__file__))
    assert before.strip() == compiled.strip()
    assert all(len(line) <= 100 for line in march.splitlines())


NAMES = ("march", "b", "s", "o", "m", "at", "size", "step", "correct", "most", "count", "N", "rows")


def test_that_names_of_a_mechanism_do_not_meet_those_of_the_text(loaded):
    m = kc.Mechanism("march")
    before = m.ground
    for name in NAMES:
        length = m.parameter(f"{name}_1" if name in ("m", "s") else name, 1.0)
        body = m.body(name, guess=(1, 0, 0))
        m.add(kc.Revolute(f"{name}_pin", before, (length, 0), body, (0, 0)))
        m.add(kc.RelativeAngle(f"{name}_drive", before, body, kc.t + 1))
        before = body
    compare(loaded(m), np.linspace(0, 1, 5))
