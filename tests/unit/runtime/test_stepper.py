"""`kc.stepper`: a motion one time after the other, which `kc.solve` gives for all times at once."""

import copy
import pickle

import numpy as np
import pytest

import kincompile as kc
from kincompile.errors import InputError, StructuralError
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.native.stepper import _zeros
from kincompile.runtime.problem import problem

from .test_corners import TIMES, press
from .test_variants import parallelogram

pytestmark = pytest.mark.usefixtures("quick_compiler")

TARGETS = ("numpy", "c", "grouped")


def compile_for(model, target):
    return kc.compile(model, form="grouped") if target == "grouped" else kc.compile(model, target)


def compare(now, solution, k=-1, tolerance=1e-12):
    """Compare with a point of a solution, each kind of numbers relative to its largest.

    In grouped form factors of Phi_q serve that are those of 1e-11 scales away.
    """
    if getattr(solution.module, "FORM", "") == "grouped":
        tolerance = 1e-10
    assert now.status == solution.status[k]
    seen = solution.observed
    outputs = seen.y[k], seen.y_dot[k], seen.y_ddot[k]
    pairs = [(now.q, solution.q[k]), (now.q_dot, solution.q_dot[k])]
    pairs += [(now.q_ddot, solution.q_ddot[k]), *zip(now.outputs, outputs, strict=True)]
    for here, there in pairs:
        size = np.max(abs(there), initial=1.0, where=np.isfinite(there))
        np.testing.assert_allclose(here, there, rtol=0, atol=tolerance * size)


GUESSES = ((0, 0, 1), (1, 1.7, 0.1), (3, 0, 2))


def rocked(name="rocked", guesses=GUESSES):
    """Return a four-bar whose crank is led to and fro, into a lock-up at sin t = 0.9217."""
    m = kc.Mechanism(name)
    a, b, c, d = (m.parameter(x, value, "m") for x, value in zip("abcd", (2, 2, 2, 3), strict=True))
    names = ("crank", "coupler", "rocker")
    crank, coupler, rocker = (m.body(x, guess=y) for x, y in zip(names, guesses, strict=True))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (a, 0), coupler, (0, 0)))
    m.add(kc.Revolute("C", coupler, (b, 0), rocker, (c, 0)))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 1 + kc.t))
    m.output("lift", coupler.phi**2)
    return m


LOCK_UP = np.arccos((2**2 + 3**2 - 4**2) / (2 * 2 * 3)) - 1
"""The time at which coupler and rocker are in line."""


# ------------------------------------------------------------------ the motion of solve


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(
    "name",
    [
        *("four_bar", "cam_by_table", "wrecker_boom", "spatial_slider_crank"),
        *(pytest.param(x, marks=pytest.mark.slow) for x in ("jansen", "rssr", "delta_robot")),
    ],
)
@pytest.mark.filterwarnings("ignore::kincompile.errors.AssemblyWarning")
def test_that_times_in_turn_give_the_motion_of_solve(example_named, name, target):
    example = example_named(name)
    module = example.native if target == "c" else compile_for(example.model, target)
    t = np.linspace(0, example.model.end, 25)
    solution, step = kc.solve(module, t), kc.stepper(module)
    for k, time in enumerate(t):
        compare(step(time), solution, k)


@pytest.mark.parametrize("target", TARGETS)
def test_that_times_in_any_order_give_it_too(example_named, target):
    module = compile_for(example_named("four_bar").model, target)
    step, start = kc.stepper(module), kc.solve(module, 0.0).q[0]
    assert step.now is None
    count = 4 if target == "grouped" else 20
    for time in [0.0, *np.random.default_rng(4).uniform(-10, 10, count), 0.0, 0.0, 4.2]:
        now = step(time)
        assert now is step.now
        # From the first position, so that angles have turned as often.
        compare(now, kc.solve(module, [0.0, time], guess=start, method="march"))


@pytest.mark.parametrize("target", TARGETS)
def test_that_a_turn_in_one_call_is_followed(example_named, target):
    module = compile_for(example_named("four_bar").model, target)
    step = kc.stepper(module)
    turn = 2 * np.pi / 1.5
    first, later = step(0.3), step(0.3 + 20 * turn)
    turned = (later.q - first.q) / (2 * np.pi)
    assert turned[2] == pytest.approx(20)  # the crank
    np.testing.assert_allclose(np.delete(turned, 2), 0, atol=1e-9)


def test_that_a_file_alone_has_one_too(example_named, tmp_path):
    example = example_named("four_bar")
    kc.emit(example.model).write(tmp_path)
    module = kc.load(tmp_path / "four_bar.py")
    t = np.linspace(0, 4, 12)
    solution, step = kc.solve(module, t), kc.stepper(module)
    go = module.stepper(solution.q[0], 0.0)
    for k, time in enumerate(t):
        compare(step(time), solution, k)
        states, status = go(time)
        assert status == 0
        for here, there in zip(states, (solution.q, solution.q_dot, solution.q_ddot), strict=True):
            np.testing.assert_allclose(here, there[k], atol=1e-12 * np.max(abs(there[k])))
    states, _ = go(0.1, [10.0, 26.0, 18.0, 20.2, 1.5])
    expected = kc.solve(module, 0.1, {"d": 20.2}, solution.q[0])
    np.testing.assert_allclose(states[0], expected.q[0], atol=1e-11)
    nowhere, status = go(0.1, [10.0, 26.0, 18.0, 90.0, 1.5])
    assert status != 0
    assert np.isnan(nowhere).all()
    again, _ = go(0.1, [10.0, 26.0, 18.0, 20.2, 1.5])
    np.testing.assert_allclose(again[0], states[0], atol=1e-12)
    for given in ([0.1],), ("x",), (np.nan,), (0.1, [1.0]), (0.1j,):
        with pytest.raises(InputError, match=r"four_bar: (t|p|a step) "):
            go(*given)


def test_that_an_earlier_file_is_followed_carefully():
    """A module without a march: every step is that of `solve`."""
    from kincompile.runtime.load import from_source

    from .conftest import MODULES

    text = (MODULES / "slider_crank_format_1.txt").read_text(encoding="utf-8")
    module = from_source(text, "slider_crank")
    t = np.linspace(0, 1, 6)
    solution, step = kc.solve(module, t), kc.stepper(module)
    for k, time in enumerate(t):
        compare(step(time), solution, k)


@pytest.mark.parametrize("target", TARGETS)
def test_that_redundant_equations_are_left_out(target):
    m = kc.Mechanism("repeated")
    rod = m.body("rod", guess=(1, 0, 0))
    for name in ("pin", "again"):
        m.add(kc.Revolute(name, m.ground, (0, 0), rod, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t**2))
    with pytest.warns(kc.RedundantConstraintWarning):
        module = compile_for(m, target)
    t = np.linspace(0, 2, 9)
    solution, step = kc.solve(module, t), kc.stepper(module)
    for k, time in enumerate(t):
        compare(step(time), solution, k)


# ------------------------------------------------------------------ where a motion ends


@pytest.mark.parametrize("target", TARGETS)
def test_a_lock_up_and_the_way_back(target):
    module = compile_for(rocked(), target)
    t = np.array([0, 0.3, 0.6, 0.75, LOCK_UP + 0.05])
    solution, step = kc.solve(module, t), kc.stepper(module)
    assert solution.status[-1] == kc.Status.LOCK_UP
    for k, time in enumerate(t):
        now = step(time)
        compare(now, solution, k)
    assert "Lock-up at t = " in now.message
    assert not now.success
    assert np.isnan([now.q_dot, now.q_ddot]).all()
    assert step.now.t == 0.75  # where it stands
    compare(step(0.76), kc.solve(module, [0, 0.76]))
    assert step.now.message == ""
    assert step(2.0).status != 0
    compare(step(0.1), kc.solve(module, [0, 0.1]))


@pytest.mark.parametrize("target", TARGETS)
def test_that_it_goes_as_near_to_a_lock_up_as_solve(target):
    """Rates near a singular position are too uncertain to go on from."""
    module = compile_for(rocked(), target)
    step = kc.stepper(module)
    times = [0.0, *(LOCK_UP - 10.0**-k for k in range(1, 9))]
    solution = kc.solve(module, times, method="march")
    for k, time in enumerate(times):
        now = step(time)
        assert now.status == solution.status[k]
        np.testing.assert_allclose(now.q, solution.q[k], atol=1e-7)
    compare(step(0.2), kc.solve(module, [0, 0.2]))


@pytest.mark.parametrize("target", TARGETS)
def test_a_bifurcation(target):
    """A parallelogram in line: `solve` ends there, or goes through."""
    module = compile_for(parallelogram(), target)
    t = np.array([0.1, 0.3, 0.45, 0.55, 0.7])
    ended, step = kc.solve(module, t), kc.stepper(module)
    assert ended.status[3] == kc.Status.SINGULAR
    for k, time in enumerate(t[:4]):
        assert step(time).status == ended.status[k]
    step = kc.stepper(module, through="smooth")
    with pytest.warns(kc.BranchSwitchWarning) as caught:
        found = [step(time) for time in t]
    assert {x.filename for x in caught} == {__file__}
    assert all(now.success for now in found)
    assert abs(step.now["b.phi"]) < 1e-9  # the coupler stays parallel


@pytest.mark.parametrize("target", TARGETS)
def test_corners_of_drivers(target):
    module = compile_for(press(corners=True), target)
    t = np.linspace(0, 2.5, 26)
    step = kc.stepper(module)
    with pytest.warns(kc.CornerWarning):
        solution = kc.solve(module, t)
    assert (solution.status == kc.Status.CORNER).sum() == len(TIMES)
    for k, time in enumerate(t):
        now = step(time)
        compare(now, solution, k, 1e-11)
        assert now.success
    assert step(TIMES[2]).status == kc.Status.CORNER  # backwards


def test_that_a_jump_has_no_way(edited):
    module = edited("pendulum", ("phi - phi_0 - omega * t", "phi - phi_0 - (1.0 if t > 1 else 0)"))
    step = kc.stepper(module)
    start = step(0.5)
    now, expected = step(1.5), kc.solve(module, [0.5, 1.5])
    assert now.status == expected.status[1] == kc.Status.NOT_CONVERGED
    assert "the motion does not lead there continuously" in now.message
    assert step.now is start
    step.reset()
    assert step.now is None
    assert step(1.5)["phi_rod"] == pytest.approx(1 + start["phi_rod"])


@pytest.mark.parametrize("target", TARGETS)
def test_that_a_reset_assembles_from_another_guess(target):
    module = compile_for(rocked(), target)
    step, crossed = kc.stepper(module), kc.assemblies(module, 0.3)
    first = step(0.3)
    for guess in (dict(zip(module.COORDINATES, crossed[0], strict=True)), *crossed):
        step.reset(guess)
        compare(step(0.3), kc.solve(module, 0.3, guess=guess))
    step.reset()
    np.testing.assert_allclose(step(0.3).q, first.q, atol=1e-12)


@pytest.mark.parametrize("target", TARGETS)
def test_that_a_prediction_without_numbers_has_no_position(target):
    """As that of a time of 1e300 s, which functions of a module in grouped form refuse."""
    module = compile_for(rocked(), target)
    equations = problem(code_of(module), module.DEFAULTS, module.GUESS, 0.0, sparse=True)
    for number in (np.inf, np.nan):
        assert equations.at(np.full(module.N_COORDINATES, number), 0.0) is None


def test_that_a_gap_without_positions_is_not_jumped(example_3_7_5):
    step = kc.stepper(example_3_7_5, {"l": 0.5})
    assert [step(t).status for t in (0, 1, 12, 1, 13)] == [0, 0, kc.Status.LOCK_UP, 0, 7]


@pytest.mark.parametrize("target", TARGETS)
def test_that_a_first_position_beside_a_lock_up_is_gone_on_from(target):
    """It is too near to singular to step from, but it is where the motion stands."""
    module = compile_for(rocked(), target)
    step, beyond = kc.stepper(module), 2 * np.pi - 1.9 - LOCK_UP  # where there are positions again
    assert kc.solve(module, beyond).success
    assert step(LOCK_UP - 5e-12).success
    assert step(beyond).status is kc.Status.LOCK_UP


def test_that_the_first_call_says_where_a_guess_chooses_no_assembly():
    module = kc.compile(rocked(guesses=[(0, 0, 0)] * 3))
    with pytest.warns(kc.AssemblyWarning, match="there is no guess of") as caught:
        now = kc.stepper(module)(0.0)
    assert [x.filename for x in caught] == [__file__]
    assert now.success


def test_a_first_call_that_finds_no_position():
    step = kc.stepper(kc.compile(rocked()), {"a": 0.2, "b": 0.2})
    now = step(0)
    assert now.status is kc.Status.NOT_ASSEMBLED
    assert now.message.startswith("rocked failed at t = 0, point 1 of 1 (NOT_ASSEMBLED).")
    assert repr(now) == "<rocked at t = 0: NOT_ASSEMBLED>"
    assert step.now is None
    assert step(0, a=2, b=2).success
    assert step(0, [2.0, 2.0, 2.0, 3.0]).success


# ------------------------------------------------------------------ parameters


@pytest.mark.parametrize("target", TARGETS)
def test_that_parameters_change_on_the_way(target):
    module = compile_for(rocked(), target)
    step, rng = kc.stepper(module, {"d": 2.9}), np.random.default_rng(2)
    q, p, t = kc.solve(module, 0.0, {"d": 2.9}).q[0], step(0.0).p, 0.0
    for _ in range(12):
        p = p + rng.uniform(-0.03, 0.03, p.size)
        t += rng.uniform(-0.05, 0.05)
        now = step(t, p)
        expected = kc.solve(module, t, p, q)
        compare(now, expected)
        q = now.q
    compare(step(t, a=2.05), kc.solve(module, t, {"a": 2.05, "d": 2.9}, q))
    own = step(t)
    np.testing.assert_array_equal(own.p, [2, 2, 2, 2.9])  # its own again
    compare(own, kc.solve(module, t, {"d": 2.9}, q))
    np.testing.assert_array_equal(step(t, {"c": 2.1}).p, [2, 2, 2.1, 2.9])


@pytest.mark.parametrize("target", TARGETS)
def test_that_large_changes_stay_on_the_branch(target):
    """From the guess of the model Newton's method ends on the other one."""
    module = compile_for(rocked(), target)
    crossed = kc.assemblies(module, 0.3)
    assert len(crossed) == 2
    for guess in crossed:
        step = kc.stepper(module, guess=guess)
        start = step(0.3)
        scaled = step(0.3, a=20.0, b=20.0, c=20.0, d=30.0)
        lengths = np.tile([10, 10, 1], 3)
        np.testing.assert_allclose(scaled.q, lengths * start.q, atol=1e-9)
        compare(step(0.3), kc.solve(module, 0.3, guess=guess))
        many = kc.solve(module, [0.3], {"b": [2.0, 3.1]}, guess)
        np.testing.assert_allclose(step(0.3, b=3.1).q, many.q[1, 0], atol=1e-11)


@pytest.mark.parametrize("target", TARGETS)
def test_that_parameters_may_not_lead_over_the_end_of_a_branch(target):
    step = kc.stepper(compile_for(rocked(), target))
    step(0.2)
    here = step(0.5)
    now = step(0.5, a=0.3, b=0.3, c=0.3)
    assert now.status is kc.Status.NOT_CONVERGED
    assert now.message == (
        "rocked cannot go from the parameters that it has at t = 0.5 to those that are given: on "
        "the straight line between them its branch ends. Change them less, or assemble it anew by "
        ".reset(guess)."
    )
    assert np.isnan([now.q, now.q_dot, now.q_ddot, *now.outputs.T[:0]]).all()
    assert step.now is here
    np.testing.assert_allclose(step(0.5).q, here.q, atol=1e-12)


@pytest.mark.parametrize("factor", [1.01, 1 / 1.01])
def test_that_lengths_are_judged_by_the_size_that_they_have(factor, monkeypatch):
    """Small steps lead far, and what is a jump is small beside the first size at last."""
    sizes = []

    def noted(*given):
        found = problem(*given)
        sizes.append(found.size)
        return found

    step = kc.stepper(kc.compile(rocked()))
    monkeypatch.setattr("kincompile.runtime.stepper.problem", noted)
    step(0.3)
    (first,) = sizes
    for scale in factor ** np.arange(700):
        now = step(0.3, a=2 * scale, b=2 * scale, c=2 * scale, d=3 * scale)
        assert now.success
        assert 0.4 < sizes[-1] / (first * scale) < 2.5
    assert sizes[-1] / first == pytest.approx(factor**699, rel=1.5)
    assert len(sizes) < 20  # once for each doubling, and not at each step


def test_that_no_array_of_a_caller_is_kept():
    module = kc.compile(rocked(), "c")
    step, p = kc.stepper(module), module.DEFAULTS.copy()
    first = step(0.2, p)
    q = first.q
    p[:] = 7
    assert (first.p == module.DEFAULTS).all()
    own = kc.stepper(module, {"a": 2.1})
    for kept in (first.q, first.p, own(0.2).p, own(0.2, b=2.1).p):
        with pytest.raises(ValueError, match="read-only"):
            kept[:] = 0
    np.testing.assert_allclose(step(0.2).q, q, atol=1e-12)


# ------------------------------------------------------------------ one beside another


@pytest.mark.parametrize("target", TARGETS)
def test_that_two_of_one_module_do_not_disturb_each_other(example_named, target):
    module = compile_for(example_named("four_bar").model, target)
    t = np.linspace(0, 4, 15)
    one, other = kc.stepper(module), kc.stepper(module, {"b": 24.0})
    first, second = kc.solve(module, t), kc.solve(module, 5 - t, {"b": 24.0})
    for k, time in enumerate(t):
        compare(one(time), first, k)
        compare(other(5 - time), second, k)


def test_that_numbers_of_a_step_in_c_begin_with_a_line_of_the_cache():
    """Else a step of an RSSR linkage takes half as long again."""
    for count in (1, 9, 1000, 100_000):
        found = _zeros(count)
        assert (found.size, found.ctypes.data % 64) == (count, 0)
        assert not found.any()


def test_that_a_step_in_c_begins_at_any_array_and_where_there_is_a_position():
    code = code_of(kc.compile(rocked(), "c"))
    q, p = kc.solve(code.module, 0.3).q[0], code.module.DEFAULTS
    make = code.stepper
    assert make is not None
    states, status = make(np.repeat(q, 2)[::2], 0.3, p, 3.0)(0.3, p)
    assert status == 0
    np.testing.assert_allclose(states[0], q, atol=1e-12)
    begun_nowhere = make(q, 0.3, p * [0.1, 0.1, 1, 1], 3.0)
    assert begun_nowhere(0.3, p)[1] != 0


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_that_it_cannot_be_copied(example_named, target, copied):
    step = kc.stepper(compile_for(example_named("four_bar").model, target))
    with pytest.raises(InputError, match=r"four_bar cannot be copied or pickled. Make another"):
        copied(step)


def test_that_columns_have_names(example_named):
    module = kc.compile(rocked())
    now = kc.stepper(module)(0.2)
    solution = kc.solve(module, 0.2)
    for name in ("crank.phi", "phi_crank", "rocker.phi_dot", "x_coupler_ddot", "lift", "lift_ddot"):
        assert now[name] == pytest.approx(solution[name][0], abs=1e-12)
    with pytest.raises(InputError, match=r"rocked has no column 'crnk.phi'; did you mean"):
        now["crnk.phi"]


def test_that_outputs_are_not_finite_where_they_have_no_value():
    m = rocked("domain")
    m.output("root", 1 / (kc.t - 0.2))
    now = kc.stepper(kc.compile(m))(0.2)
    assert now.success
    assert not np.isfinite(now["root"])


# ------------------------------------------------------------------ wrong arguments


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda step: step("now"), "t is str: give real numbers"),
        (lambda step: step(np.nan), r"t\[0\] is nan: times must be finite"),
        (lambda step: step(-np.inf), r"t\[0\] is -inf: times must be finite"),
        (lambda step: step([1.0, 2.0]), "a stepper takes one time, got 2: kc.solve takes many"),
        (lambda step: step(0.5, aa=2), "there is no parameter 'aa'; did you mean 'a'?"),
        (lambda step: step(0.5, {"B": 2}), "there is no parameter 'B'"),
        (lambda step: step(0.5, a="long"), "parameter 'a' is str: give real numbers"),
        (lambda step: step(0.5, a=[1, 2]), r"parameter 'a' has shape \(2,\): give one number"),
        (lambda step: step(0.5, a=np.inf), "parameter 'a' is inf: give a finite number"),
        (lambda step: step(0.5, a=10**400), "parameter 'a' is int: give real numbers"),
        (lambda step: step(0.5, a=True), "parameter 'a' is bool: give real numbers"),
        (lambda step: step(0.5, np.array([2, 2, 2, "3"], object)), "is an array of object: give r"),
        (lambda step: step(0.5, [1.0]), r"the parameter vector has shape \(1,\), expected \(4,\)"),
        (lambda step: step(0.5, np.full(4, np.nan)), "parameter 'a' is nan"),
        (lambda step: step(0.5, {"a": 1}, b=2), "p is given, and b by name"),
        (lambda step: step.reset({"rod.phi": 1}), "there is no coordinate 'phi_rod'"),
    ],
)
def test_that_what_is_wrong_is_said_and_changes_nothing(call, message):
    step = kc.stepper(kc.compile(rocked()))
    here = step(0.5)
    with pytest.raises(InputError, match=message):
        call(step)
    assert step.now is here
    np.testing.assert_allclose(step(0.5).q, here.q, atol=1e-12)


def test_what_has_no_stepper(example_named):
    with pytest.raises(InputError, match=r"compile the mechanism first"):
        kc.stepper(rocked())
    module = kc.compile(rocked())
    with pytest.raises(InputError, match="there is no parameter 'z'"):
        kc.stepper(module, {"z": 1})
    with pytest.raises(InputError, match="through is 'any'"):
        kc.stepper(module, through="any")
    free = kc.Mechanism("free")
    free.add(kc.Revolute("pin", free.body("rod", guess=(0, 0, 0)), (0, 0), free.ground, (0, 0)))
    with pytest.raises(StructuralError):
        kc.stepper(kc.compile(free))
    m = example_named("four_bar").model
    with pytest.raises(InputError, match=r"a Transmission is a function already: call it, f\(u\)"):
        kc.stepper(kc.transmission(m, "motor", "rocker.phi"))
