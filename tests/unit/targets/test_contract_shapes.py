"""Points, batches, and what broadcasts against what."""

from itertools import product
from typing import Any

import numpy as np
import pytest

N, K = 7, 2
SHAPES: list[tuple[int, ...]] = [(), (1,), (3,), (2, 3), (2, 1), (0,)]
SINGLE = {"Phi": (N,), "Phi_q": (N, N), "nu": (N,), "gamma": (N,), "Phi_q_nonzeros": (-1,)}
FUSED = {
    "position": ("Phi", "Phi_q"),
    "velocity": ("Phi_q", "nu"),
    "acceleration": ("Phi_q", "gamma"),
    "kinematics": ("Phi", "Phi_q", "nu", "gamma"),
}
WITH_RATES = ("gamma", "acceleration", "kinematics")


def fitting() -> list[tuple[tuple[int, ...], ...]]:
    """Return the batches of q, q_dot, t and p that broadcast."""
    found: list[tuple[tuple[int, ...], ...]] = []
    for shapes in product(SHAPES, SHAPES, SHAPES, SHAPES):
        try:
            np.broadcast_shapes(*shapes)
        except ValueError:
            continue
        found.append(shapes)
    return found


def arguments(name: str, shapes: tuple[tuple[int, ...], ...]) -> list[Any]:
    rng = np.random.default_rng(3)
    q, q_dot, t, p = shapes
    states = [rng.uniform(-1, 1, (*q, N))]
    if name in WITH_RATES:
        states.append(rng.uniform(-1, 1, (*q_dot, N)))
    return [*states, rng.uniform(0, 1, t), rng.uniform(0.5, 1, (*p, K))]


def point_by_point(module: Any, name: str, given: list[Any], batch: tuple[int, ...]) -> Any:
    """Evaluate each point by itself and stack the results."""
    *states, t, p = given
    vectors = [np.broadcast_to(item, (*batch, item.shape[-1])) for item in (*states, p)]
    times = np.broadcast_to(t, batch)
    found = [
        getattr(module, name)(
            *(vector[index] for vector in vectors[:-1]), float(times[index]), vectors[-1][index]
        )
        for index in np.ndindex(*batch)
    ]
    return np.array(found).reshape(*batch, *np.shape(found[0])) if found else None


@pytest.mark.every(5)
@pytest.mark.parametrize("shapes", fitting()[::5], ids=str)
def test_that_arguments_broadcast_like_a_gufunc(rich: Any, shapes: Any) -> None:
    for name, core in SINGLE.items():
        given = arguments(name, shapes)
        batch = np.broadcast_shapes(*(shapes if name in WITH_RATES else (shapes[0], *shapes[2:])))
        found = getattr(rich, name)(*given)
        if core != (-1,):
            assert found.shape == (*batch, *core)
        expected = point_by_point(rich, name, given, batch)
        if expected is None:
            assert found.size == 0
        else:
            np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("batch", SHAPES, ids=str)
@pytest.mark.parametrize("name", FUSED)
def test_that_fused_functions_give_what_the_single_ones_give(
    rich: Any, name: str, batch: tuple[int, ...]
) -> None:
    given = arguments(name, (batch,) * 4)
    for part, found in zip(FUSED[name], getattr(rich, name)(*given), strict=True):
        own = given if part in WITH_RATES or name not in WITH_RATES else [given[0], *given[2:]]
        expected = getattr(rich, part)(*own)
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", [*SINGLE, *FUSED])
def test_that_an_empty_batch_has_empty_results(rich: Any, name: str) -> None:
    found = getattr(rich, name)(*arguments(name, ((0,), (0,), (), ())))
    cores = [SINGLE[part] for part in FUSED.get(name, (name,))]
    for result, core in zip(found if isinstance(found, tuple) else (found,), cores, strict=True):
        assert result.shape[0] == 0
        assert result.ndim == 1 + len(core)


def test_that_constant_entries_take_the_shape_of_the_batch(tabled: Any) -> None:
    """Nu does not depend on q, and most entries of Phi_q on nothing."""
    q = np.zeros((5, 2, 4))
    assert tabled.nu(q, 0.0).shape == (5, 2, 4)
    assert tabled.nu(q[0, 0], np.zeros((5, 2))).shape == (5, 2, 4)
    nonzeros = tabled.Phi_q_nonzeros(q, 0.0)
    assert nonzeros.shape == (5, 2, len(tabled.PATTERN))
    assert (nonzeros == nonzeros[0, 0]).all()


@pytest.mark.parametrize("batch", [(), (4,), (2, 3), (0,)], ids=str)
def test_that_nonzeros_are_the_entries_of_the_pattern(rich: Any, batch: tuple[int, ...]) -> None:
    given = arguments("Phi_q", (batch, (), batch, ()))
    rows, columns = rich.PATTERN.T
    nonzeros = rich.Phi_q_nonzeros(*given)
    np.testing.assert_array_equal(nonzeros, rich.Phi_q(*given)[..., rows, columns])


@pytest.mark.parametrize(("t_shape", "p_shape"), [((), ()), ((6,), ()), ((), (6,)), ((6,), (6,))])
def test_that_the_batch_may_be_the_last_axis(rich: Any, t_shape: Any, p_shape: Any) -> None:
    q, q_dot, t, p = arguments("kinematics", ((6,), (6,), t_shape, p_shape))
    Phi, Phi_q, nu, gamma = rich.kinematics(q, q_dot, t, p)
    rows, columns = rich.PATTERN.T
    last = rich.kinematics_batch_last(q.T, q_dot.T, t, p.T)
    assert [item.shape for item in last] == [(N, 6), (len(rows), 6), (N, 6), (N, 6)]
    expected = (Phi.T, Phi_q[:, rows, columns].T, nu.T, gamma.T)
    for found, known in zip(last, expected, strict=True):
        np.testing.assert_allclose(found, known, rtol=1e-13, atol=1e-13)


def test_that_defaults_are_taken_where_no_parameters_are_given(rich: Any) -> None:
    q, q_dot, t, _ = arguments("kinematics", ((3,), (3,), (), ()))
    for found, known in zip(
        rich.kinematics(q, q_dot, t), rich.kinematics(q, q_dot, t, rich.DEFAULTS), strict=True
    ):
        np.testing.assert_array_equal(found, known)
    last = rich.kinematics_batch_last(q.T, q_dot.T, 0.5)
    np.testing.assert_array_equal(last[0], rich.Phi(q, 0.5).T)


def test_that_a_batch_longer_than_a_block_is_the_same(rich: Any) -> None:
    """Long batches are evaluated in blocks: nothing is lost where they meet."""
    rng = np.random.default_rng(11)
    q, q_dot, t = rng.normal(size=(4001, N)), rng.normal(size=(4001, N)), rng.uniform(size=4001)
    p = rng.uniform(0.5, 1, (4001, K))
    whole = rich.kinematics(q, q_dot, t, p)
    for some in (slice(0, 5), slice(1997, 2003), slice(3998, 4001)):
        part = rich.kinematics(q[some], q_dot[some], t[some], p[some])
        for found, known in zip(whole, part, strict=True):
            np.testing.assert_array_equal(found[some], known)


@pytest.mark.parametrize("batch", [(), (5,), (2, 3)], ids=str)
def test_that_the_planned_solve_takes_batches(rich: Any, batch: tuple[int, ...]) -> None:
    q, t, p = arguments("Phi_q", (batch, (), (), ()))
    b = np.random.default_rng(2).normal(size=(*batch, N))
    x = rich.solve(rich.Phi_q_nonzeros(q, t, p), b)
    assert x.shape == (*batch, N)
    left = (rich.Phi_q(q, t, p) @ x[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(left, b, rtol=1e-9, atol=1e-9)


def test_that_the_lanes_run_on_floats_and_on_arrays(written_out: Any) -> None:
    q, q_dot, t, p = arguments("kinematics", ((3,), (3,), (), ()))
    kernel = written_out.LANES["kinematics"]
    arrays = kernel(written_out.ARRAYS, list(q.T), list(q_dot.T), t, list(p))
    for k in range(3):
        floats = kernel(written_out.FLOATS, q[k].tolist(), q_dot[k].tolist(), float(t), p.tolist())
        assert all(isinstance(value, float | int) for value in floats)
        taken = [np.broadcast_to(value, 3)[k] for value in arrays]
        np.testing.assert_allclose(floats, taken, rtol=1e-13, atol=1e-13)
