"""Many parameter sets at once: each as if it were alone, and none disturbed by another."""

import json

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime import newton
from kincompile.runtime.status import Status


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
    assert solution.status[3].tolist() == [1] + [4] * 8


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
    one_step = newton.safeguarded_step

    def counted(*arguments):
        steps.append(arguments)
        return one_step(*arguments)

    monkeypatch.setattr(newton, "safeguarded_step", counted)
    together = kc.solve(four_bar, 0.0, sets)
    assert (~together.good[:, 0]).tolist() == failed
    assert 10 < sum(failed) < 40
    assert len(steps) < 20 * sum(failed)  # one by one they take a hundred each
    for k in np.flatnonzero(failed).tolist():
        assert together.status[k, 0] == alone[k].status


def test_that_compiled_code_solves_what_is_ordinary_alone(
    example_named, quick_compiler, monkeypatch
):
    module = example_named("four_bar").native
    careful: list[object] = []
    monkeypatch.setattr("kincompile.runtime.variants._Chunk.run", careful.append)
    found = kc.solve(module, np.linspace(0, 1, 9), {"a": module.DEFAULTS[0] * np.ones(5)})
    assert found.success
    assert not careful
