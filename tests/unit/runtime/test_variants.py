"""Many parameter sets at once: each as if it were alone, and none disturbed by another."""

import json
from dataclasses import replace

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime import problem, start
from kincompile.runtime.engine.code import PLACE, code_of
from kincompile.runtime.engine.linear import Dense, Planned
from kincompile.runtime.status import Status
from tests.unit.design.test_fit import three_cranks


@pytest.fixture(scope="module")
def four_bar(example_named):
    return example_named("four_bar").module


@pytest.fixture(scope="module")
def sets(four_bar):
    rng = np.random.default_rng(0)
    p = four_bar.DEFAULTS * (1 + 0.02 * rng.normal(size=(12, 1, four_bar.DEFAULTS.size)))
    p[..., four_bar.PARAMETERS.index("omega")] = 1.5
    p[3, 0, four_bar.PARAMETERS.index("b")] = 100.0  # cannot be assembled
    return p


def test_that_each_variant_is_solved_as_if_alone(four_bar, sets):
    t = np.linspace(0, 4, 60)
    together = kc.solve(four_bar, t, p=sets)
    assert together.q.shape == (12, 60, 9)
    for k, p in enumerate(sets):
        alone = kc.solve(four_bar, t, p=p[0], method="march")
        np.testing.assert_array_equal(together.status[k], alone.status)
        for one, other in (
            (together.q[k], alone.q),
            (together.q_dot[k], alone.q_dot),
            (together.q_ddot[k], alone.q_ddot),
        ):
            np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-9)


def test_that_one_bad_variant_is_named_and_the_others_are_good(four_bar, sets):
    solution = kc.solve(four_bar, np.linspace(0, 1, 9), p=sets)
    assert not solution.success
    assert "1 of 12 variants failed; the first is variant 3 at t = 0" in solution.message
    assert (np.delete(solution.status, 3, axis=0) == 0).all()
    assert np.isnan(solution.q[3]).all()
    assert solution.status[3].tolist() == [6] + [4] * 8


def test_that_steps_too_long_for_all_are_taken_by_the_careful_march(four_bar):
    p = np.repeat(four_bar.DEFAULTS[np.newaxis, np.newaxis], 3, axis=0)
    t = np.linspace(0, 4, 7)
    together, alone = kc.solve(four_bar, t, p=p), kc.solve(four_bar, t, method="march")
    assert together.success, together.message
    np.testing.assert_allclose(together.q[1], alone.q, atol=1e-9)


def test_that_columns_have_a_leading_axis(four_bar, sets):
    solution = kc.solve(four_bar, [0.0, 0.1], p=sets[:2])
    assert solution["phi_rocker_dot"].shape == (2, 2)
    assert solution.parameters["b"].shape == (2,)


def test_that_more_variants_than_a_chunk_are_all_solved(four_bar):
    p = np.repeat(four_bar.DEFAULTS[np.newaxis, np.newaxis], 2100, axis=0)
    solution = kc.solve(four_bar, [0.0, 0.05], p=p)
    assert solution.success
    np.testing.assert_array_equal(solution.q[0], solution.q[-1])


@pytest.mark.parametrize("shape", [(3, 1, 4), (3, 2, 5), (0, 1, 5)])
def test_that_a_wrong_shape_is_refused(four_bar, shape):
    with pytest.raises(kc.InputError, match=r"give real numbers of shape \(B, 1, 5\)"):
        kc.solve(four_bar, 0.0, p=np.ones(shape))


def test_that_a_value_that_is_not_finite_is_named(four_bar, sets):
    p = sets.copy()
    p[5, 0, 1] = np.nan
    name = four_bar.PARAMETERS[1]
    with pytest.raises(kc.InputError, match=f"parameter {name!r} of variant 5 is nan"):
        kc.solve(four_bar, 0.0, p=p)


def test_that_the_description_counts_the_points_of_all(four_bar, sets):
    solution = kc.solve(four_bar, [0.0, 0.1], p=sets)
    assert repr(solution) == (
        "<Solution of four_bar: 12 variants of 2 points, t = 0 to 0.1; failed, 22 of 24 points "
        "converged; see .message>"
    )


def test_that_files_hold_all_variants(four_bar, sets, tmp_path):
    solution = kc.solve(four_bar, [0.0, 0.1], p=sets[:2])
    with np.load(kc.write(solution, tmp_path / "motion.npz")) as arrays:
        np.testing.assert_array_equal(arrays["q"], solution.q)
    document = json.loads(kc.write(solution, tmp_path / "motion.json").read_text(encoding="utf-8"))
    np.testing.assert_array_equal(document["q"], solution.q)
    assert document["parameters"]["b"] == sets[:2, 0, four_bar.PARAMETERS.index("b")].tolist()
    header, *rows = kc.write(solution, tmp_path / "motion.csv").read_text().splitlines()
    place = header.split(",").index("phi_rocker [rad]")
    found = np.array([float(row.split(",")[place]) for row in rows])
    np.testing.assert_array_equal(found.reshape(2, 2), solution["phi_rocker"])


@pytest.mark.parametrize("target", ["numpy", "c"])
@pytest.mark.filterwarnings("ignore::kincompile.errors.RedundantConstraintWarning")
def test_that_redundant_equations_are_solved_together_as_alone(target):
    m = kc.Mechanism("cranks")
    a, third = m.parameter("a", 1.0), m.parameter("third", 1.0)
    bar = m.body("bar", (1, 0, 0))
    for k, at in enumerate([(0, 0), (2, 0), (1, 1.5)]):
        crank = m.body(f"crank_{k}", (*at, 0.01))
        m.add(kc.Revolute(f"A{k}", m.ground, at, crank, (0, 0)))
        m.add(kc.Revolute(f"B{k}", crank, (third if k == 2 else a, 0), bar, at))
        if k == 0:
            m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    module, t = kc.compile(m, target), np.linspace(0, 4, 9)  # flat at first, alone at this time
    lengths = np.array([1.0, 1.2, 1.1, 0.8]), np.array([1.0, 1.2, 1.0, 0.8])
    together = kc.solve(module, t, {"a": lengths[0], "third": lengths[1]})
    assert together.good.all(axis=1).tolist() == [True, True, False, True]
    for k, (one, other) in enumerate(zip(*lengths, strict=True)):
        alone = kc.solve(module, t, {"a": one, "third": other})
        np.testing.assert_array_equal(together.status[k], alone.status)
        np.testing.assert_allclose(together.q[k], alone.q, atol=1e-12)
        np.testing.assert_allclose(together.q_ddot[k], alone.q_ddot, atol=1e-9)


def test_that_sets_that_cannot_be_assembled_are_found_out_together(four_bar, monkeypatch):
    rng = np.random.default_rng(1)
    sets = {name: rng.uniform(0.1, 5, 48) for name in "abcd"}
    alone = [kc.newton(four_bar, 0.0, None, {k: x[n] for k, x in sets.items()}) for n in range(48)]
    failed = [result.status != Status.CONVERGED for result in alone]
    steps = []
    one_step = problem.safeguarded_step

    def counted(*arguments):
        steps.append(arguments)
        return one_step(*arguments)

    monkeypatch.setattr(start, "safeguarded_step", counted)
    together = kc.solve(four_bar, 0.0, sets)
    left = [not good and not is_lost for good, is_lost in zip(together.good, failed, strict=True)]
    assert not together.good[failed].any()
    assert sum(left) < 48 - sum(failed)
    assert (together.status[left] == Status.NOT_CONVERGED).all()  # beside the model's own branch
    assert 10 < sum(failed) < 40
    assert len(steps) < 20 * sum(failed)  # one by one they take a hundred each
    of_start = {Status.NOT_CONVERGED: Status.NOT_ASSEMBLED}
    for k in np.flatnonzero(failed).tolist():
        assert together.status[k, 0] == of_start.get(alone[k].status, alone[k].status)


def test_that_compiled_code_solves_what_is_ordinary_alone(
    example_named, quick_compiler, monkeypatch
):
    module = example_named("four_bar").native
    careful: list[object] = []
    monkeypatch.setattr("kincompile.runtime.variants._Chunk._assembled", careful.append)
    found = kc.solve(module, np.linspace(0, 1, 9), {"a": module.DEFAULTS[0] * np.ones(5)})
    assert found.success
    assert not careful


def test_that_compiled_code_follows_each_set_from_its_own_position(
    example_named, quick_compiler, monkeypatch
):
    example = example_named("four_bar")
    lengths = example.module.DEFAULTS[0] * np.where(
        np.arange(24) % 2, 2.9, 1
    )  # with 3 an angle is half a turn away, either way
    t = np.linspace(0, 4, 50)
    expected = kc.solve(example.module, t, {"a": lengths})
    steps: list[object] = []
    monkeypatch.setattr("kincompile.runtime.variants._Chunk._finish", steps.append)
    found = kc.solve(example.native, t, {"a": lengths})
    assert not steps
    np.testing.assert_array_equal(found.status, expected.status)
    assert (found.status[1::2] == Status.LOCK_UP).any(axis=1).all()
    np.testing.assert_allclose(found.q, expected.q, atol=1e-9)


def locking(four_bar, count):
    """Return sets of a four-bar that cannot turn, and the times up to which each can move.

    Crank, coupler and rocker are stretched where the third side of the triangle is b + c.
    """
    rng = np.random.default_rng(7)
    a, b, c, d = (x * (1 + 0.05 * rng.uniform(-1, 1, count)) for x in (10.0, 26.0, 18.0, 46.0))
    p = {"a": a, "b": b, "c": c, "d": d}
    return p, np.arccos((a**2 + d**2 - (b + c) ** 2) / (2 * a * d)) / 1.5


@pytest.mark.parametrize("target", ["numpy", "native"])
def test_that_a_lock_up_has_its_status_where_mechanics_says(example_named, target, quick_compiler):
    module = getattr(example_named("four_bar"), "native" if target == "native" else "module")
    p, ends = locking(module, 40)
    t = np.linspace(0.3, 2.0, 23)
    found = kc.solve(module, t, p)
    for status, end in zip(found.status, ends, strict=True):
        reached = int((t < end).sum())
        assert 0 < reached < t.size
        assert status.tolist() == [0] * reached + [7] + [4] * (t.size - reached - 1)
    alone = kc.solve(module, t, {name: values[5] for name, values in p.items()})
    np.testing.assert_array_equal(found.status[5], alone.status)
    np.testing.assert_allclose(found.q[5], alone.q, atol=1e-8)
    assert "40 of 40 variants failed" in found.message
    assert "(LOCK_UP)" in found.message
    assert "Solve it alone to see where exactly a motion ends" in found.message
    assert alone.events[0].t == pytest.approx(ends[5], abs=1e-7)


def test_that_what_cannot_move_costs_at_most_ten_times_what_does(four_bar, monkeypatch):
    counts = {"together": 0, "alone": 0}
    for engine, name in ((Planned, "together"), (Dense, "alone")):

        def evaluate(self, q, t, own=engine.evaluate, name=name):
            counts[name] += q[0].size
            return own(self, q, t)

        monkeypatch.setattr(engine, "evaluate", evaluate)
    t, spent = np.linspace(0.3, 2.0, 50), []
    locked, _ = locking(four_bar, 64)
    moving = locked | {"d": 0.4 * locked["d"]}
    for p, status in ((moving, Status.CONVERGED), (locked, Status.LOCK_UP)):
        counts.update(together=0, alone=0)
        found = kc.solve(four_bar, t, p)
        assert (found.status == status).any(axis=1).all()
        spent.append(counts["together"] / 64)
        assert counts["alone"] < 100  # the first position of all is found alone
    assert spent[1] < 10 * spent[0]


@pytest.mark.parametrize("left_out", [0.0, 1e-6, 1e-4])
def test_that_an_end_just_before_another_one_is_a_lock_up(left_out):
    # Rates of y grow as those of x do, once more: no step gets near enough to see that alone.
    x, y, c = sympy.symbols("x y c")
    equations = [x**2 + kc.t - 1, y**2 - x + c]
    given = {"parameters": {c: 0.1}, "guess": {x: 1.0, y: 1.0}}
    module = kc.compile(kc.ConstraintSystem("ends", [x, y], equations, **given))
    t = np.append(np.linspace(0, 0.999, 30), 1 + 1e-5 * np.arange(-3.5, 2))
    found = kc.solve(module, t, {"c": [left_out, left_out / 2]})
    assert [row[(row != 0).argmax()] for row in found.status] == [Status.LOCK_UP] * 2


def test_that_equations_without_values_are_no_lock_up():
    x = sympy.Symbol("x")
    end = sympy.Symbol("end")
    system = kc.ConstraintSystem("edge", [x], [x - sympy.sqrt(end - kc.t)], parameters={end: 1.0})
    module = kc.compile(system)
    found = kc.solve(module, np.linspace(0, 2, 9), {"end": np.array([0.9, 1.1, 3.0])})
    assert [row.max() for row in found.status] == [4, 4, 0]
    assert [(row == Status.NOT_FINITE).sum() for row in found.status] == [1, 1, 0]


@pytest.mark.slow
def test_that_many_ends_leave_the_others_as_if_alone(four_bar):
    rng = np.random.default_rng(11)
    p = {name: rng.uniform(5, 50, 60) for name in "abcd"}
    t = np.linspace(0.1, 5, 40)
    found = kc.solve(four_bar, t, p)
    kinds = set()
    for k in range(60):
        one = {name: values[k] for name, values in p.items()}
        guess = found.q[k, 0] if found.status[k, 0] == Status.CONVERGED else None
        alone = kc.solve(four_bar, t, one, guess, method="march")
        if found.status[k, 0] == Status.NOT_CONVERGED:  # alone it is on the other branch
            first, other = (np.sin(q[8] - q[5]) for q in (found.q[0, 0], alone.q[0]))
            assert first * other < 0
            continue
        np.testing.assert_array_equal(found.status[k], alone.status)
        good = found.status[k] == Status.CONVERGED
        np.testing.assert_allclose(found.q[k][good], alone.q[good], atol=1e-8)
        kinds.update(found.status[k].tolist())
    assert kinds >= {Status.CONVERGED, Status.NOT_REACHED, Status.NOT_ASSEMBLED, Status.LOCK_UP}


def counted(module, monkeypatch):
    """Let a module count positions evaluated, and evaluations of one alone."""
    code, evaluated, alone = code_of(module), [0], [0]
    own = code.lanes
    assert own is not None

    def lanes(f, q, t, p):
        evaluated[0] += np.size(q[0])
        return own.position(f, q, t, p)

    def written(q, t, p):
        evaluated[0] += q.size // q.shape[-1]
        alone[0] += 1
        return code.written(q, t, p)

    counting = replace(code, lanes=replace(own, position=lanes), written=written)
    counting = replace(counting, position=written)
    monkeypatch.setitem(vars(module), PLACE, counting)
    return evaluated, alone


def test_that_a_set_that_cannot_move_takes_few_evaluations(four_bar, monkeypatch):
    evaluated, alone = counted(four_bar, monkeypatch)
    rng, t = np.random.default_rng(1), np.linspace(0, 4, 50)
    p = four_bar.DEFAULTS * (1 + 0.02 * rng.uniform(-1, 1, (200, four_bar.DEFAULTS.size)))
    p[:, four_bar.PARAMETERS.index("omega")] = 1.5

    def count(which, longer=2, status=Status.NOT_ASSEMBLED):
        evaluated[0], alone[0], sets = 0, 0, p.copy()
        sets[which, four_bar.PARAMETERS.index("a")] *= longer
        found = kc.solve(four_bar, t, p=sets[:, np.newaxis])
        assert (found.status[which, 0] == status).all()
        return evaluated[0]

    moving = count(slice(0, 0))
    of_first = alone[0]
    half = count(slice(1, None, 2))  # these are led there by the first one, which moves
    assert half - moving / 2 < 4.5 * moving / 2
    assert count(slice(None)) < 4.5 * moving
    # These are on the branch of the first one again, beyond sets that cannot be assembled.
    beyond = count(slice(1, None, 2), 3, Status.CONVERGED)
    assert beyond - moving / 2 < 10 * moving / 2
    assert alone[0] <= 2 * of_first  # a position alone costs as much as a hundred in arrays


def test_that_compiled_code_leads_and_attempts_without_arrays(
    example_named, quick_compiler, monkeypatch
):
    module, calls = example_named("four_bar").native, []
    evaluate = Planned.evaluate

    def counted(self, q, t):
        calls.append(q.shape)
        return evaluate(self, q, t)

    monkeypatch.setattr(Planned, "evaluate", counted)
    t, longer = np.linspace(0, 4, 20), np.where(np.arange(64) % 2, 2, 1)
    for factor, status in ((longer, Status.NOT_ASSEMBLED), (1.5 * longer, Status.CONVERGED)):
        calls.clear()
        found = kc.solve(module, t, {"a": module.DEFAULTS[0] * factor})
        assert (found.status[1::2, 0] == status).all()
        assert len(calls) < 40  # on arrays every step of every attempt takes some


def parallelogram():
    """Return a mechanism that comes to a bifurcation at t = 0.5."""
    m = kc.Mechanism("parallelogram")
    length = m.parameter("L", 1.0)
    a, b = m.body("a", guess=(0, 0, 1)), m.body("b", guess=(0.5, 0.8, 0))
    c = m.body("c", guess=(2, 0, 1))
    m.add(kc.Revolute("O", m.ground, (0, 0), a, (0, 0)))
    m.add(kc.Revolute("A", a, (length, 0), b, (0, 0)))
    m.add(kc.Revolute("B", b, (2, 0), c, (length, 0)))
    m.add(kc.Revolute("C", c, (0, 0), m.ground, (2, 0)))
    m.add(kc.AbsoluteAngle("motor", a, 2 * kc.pi * kc.t))
    return m


def test_that_a_set_at_a_bifurcation_takes_few_evaluations(monkeypatch):
    module, t = kc.compile(parallelogram()), np.linspace(0.1, 0.7, 41)
    evaluated, alone = counted(module, monkeypatch)
    kc.solve(module, t[:20], {"L": np.linspace(0.8, 1.1, 100)})
    moving, of_first = 2 * evaluated[0], alone[0]
    evaluated[0], alone[0] = 0, 0
    found = kc.solve(module, t, {"L": np.linspace(0.8, 1.1, 100)})
    assert set(found.status[:, 27]) == {Status.SINGULAR}
    assert alone[0] == of_first
    assert evaluated[0] < 4 * moving


@pytest.mark.parametrize(
    "form", ["inline", *(pytest.param(x, marks=pytest.mark.slow) for x in ("c", "grouped"))]
)
def test_that_variants_go_through_a_bifurcation(form, quick_compiler):
    m = parallelogram()
    module = kc.compile(m, "c") if form == "c" else kc.compile(m, form=form)
    t, lengths = np.linspace(0.1, 0.7, 61), np.array([0.8, 0.9, 1.1])
    stopped = kc.solve(module, t, {"L": lengths})
    assert (stopped.status == Status.SINGULAR).any(axis=1).all()
    with pytest.warns(kc.BranchSwitchWarning, match="3 variants went through a bifurcation.*0.5,"):
        found = kc.solve(module, t, {"L": lengths}, through="smooth")
    assert found.success, found.message
    angle = 2 * np.pi * t
    np.testing.assert_allclose(found["phi_b"], 0, atol=1e-9)  # the coupler stays parallel
    np.testing.assert_allclose(np.sin(found["phi_c"] - angle), 0, atol=1e-9)
    np.testing.assert_allclose(found["x_b"], lengths[:, None] * np.cos(angle), atol=1e-9)
    np.testing.assert_allclose(found["phi_c_dot"], 2 * np.pi, atol=1e-6)


@pytest.mark.filterwarnings("ignore::kincompile.errors.RedundantConstraintWarning")
def test_that_sets_that_take_steps_alone_keep_their_numbers():
    module, t = kc.compile(three_cranks()), np.linspace(0, 6, 73)  # folded at each half turn
    lengths = np.random.default_rng(0).uniform(0.5, 2, 8)
    found = kc.solve(module, t, {"a": lengths})
    assert found.success
    for a, q in zip(lengths, found.q, strict=True):
        np.testing.assert_allclose(q, kc.solve(module, t, {"a": a}).q, atol=1e-8)


def test_that_nothing_is_said_of_points_that_are_not_reached(example_named, quick_compiler):
    module = kc.compile(example_named("four_bar").model, target="c")
    lengths = np.random.default_rng(11).uniform(5, 50, (4, 600))
    found = kc.solve(module, np.linspace(0.1, 5, 40), dict(zip("abcd", lengths, strict=True)))
    beyond = found.status == Status.NOT_REACHED
    assert beyond.sum() > 1000
    for values in (found.q, found.q_dot, found.q_ddot, found.residual):
        assert np.isnan(values[beyond]).all()
    assert not found.iterations[beyond].any()


def test_that_compiled_sets_that_end_at_once_or_on_the_way_leave_the_others_alone(
    example_named, quick_compiler
):
    example = example_named("four_bar")
    native, t = example.native, np.linspace(0, 4, 40)
    p = np.tile(native.DEFAULTS, (70, 1))
    p[:, native.PARAMETERS.index("a")] *= np.linspace(0.95, 1.05, 70)
    p[1::3, native.PARAMETERS.index("a")] = 100.0  # cannot be assembled
    p[2::3, native.PARAMETERS.index("d")] *= 2.5  # locks up
    together = kc.solve(native, t, p[:, np.newaxis])
    ends = [Status.CONVERGED, Status.NOT_ASSEMBLED, Status.LOCK_UP]
    for k in range(9):
        alone = kc.solve(example.module, t, p[k])
        assert ends[k % 3] in together.status[k]
        np.testing.assert_array_equal(together.status[k], alone.status)
        reached = alone.status == Status.CONVERGED
        assert reached.any() == (k % 3 != 1)
        for name in ("q", "q_dot", "q_ddot"):
            found, wanted = getattr(together, name)[k], getattr(alone, name)
            np.testing.assert_allclose(found[reached], wanted[reached], rtol=1e-8, atol=1e-8)
            assert np.isnan(found[~reached]).all()
