"""What may be given, what may not, and that nothing given or returned is shared."""

import math
from typing import Any

import mpmath
import numpy as np
import pytest

import kincompile as kc

N = 7
q = np.linspace(0.1, 0.9, N)
FUNCTIONS = ("Phi", "Phi_q", "nu", "Phi_q_nonzeros", "position", "velocity")
WITH_RATES = ("gamma", "acceleration", "kinematics", "kinematics_batch_last")


def call(module: Any, name: str, state: Any, t: Any = 0.5, *p: Any, rates: Any = None) -> Any:
    """Call a function, with rates where it takes them."""
    if name not in WITH_RATES:
        return getattr(module, name)(state, t, *p)
    return getattr(module, name)(state, state if rates is None else rates, t, *p)


def flat(found: Any) -> Any:
    return np.hstack([np.ravel(item) for item in (found if isinstance(found, tuple) else (found,))])


@pytest.mark.parametrize("name", [*FUNCTIONS, *WITH_RATES[:3]])
@pytest.mark.parametrize(
    "given",
    [
        q.tolist(),
        tuple(q.tolist()),
        np.asfortranarray(q),
        np.repeat(q, 2)[::2],
        q.astype(np.longdouble),
        q[::-1].copy()[::-1],
    ],
    ids=["list", "tuple", "fortran", "strided", "longdouble", "reversed"],
)
def test_that_any_array_of_the_numbers_is_as_good(rich: Any, name: str, given: Any) -> None:
    np.testing.assert_allclose(flat(call(rich, name, given)), flat(call(rich, name, q)), 1e-14)


@pytest.mark.parametrize("name", [*FUNCTIONS, *WITH_RATES[:3]])
def test_that_integers_are_numbers(rich: Any, name: str) -> None:
    whole = [1, 0, 2, -1, 3, 1, 2]
    expected = flat(call(rich, name, np.array(whole, dtype=float), 1.0, np.array([1.0, 2.0])))
    for state in (whole, np.array(whole), np.array(whole, dtype=np.int8)):
        found = flat(call(rich, name, state, 1, [1, 2]))
        assert found.dtype == float
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("t", [0.5, np.float64(0.5), np.array(0.5), np.float32(0.5), [0.5]])
def test_that_time_may_be_any_scalar(rich: Any, t: Any) -> None:
    np.testing.assert_allclose(np.ravel(rich.Phi(q, t)), rich.Phi(q, 0.5), rtol=1e-14)


@pytest.mark.parametrize("name", [*FUNCTIONS, *WITH_RATES[:3]])
@pytest.mark.parametrize("batch", [(), (3,)])
def test_that_results_are_ones_own(rich: Any, name: str, batch: Any) -> None:
    """Writing into a result changes neither what was given nor what comes next."""
    state = np.broadcast_to(q, (*batch, N)).copy()
    before, first = state.copy(), call(rich, name, state)
    known = flat(first).copy()
    for item in first if isinstance(first, tuple) else (first,):
        assert item.flags.writeable
        assert not np.shares_memory(item, state)
        item[...] = -7.0
    np.testing.assert_array_equal(state, before)
    np.testing.assert_array_equal(flat(call(rich, name, state)), known)


def test_that_read_only_arrays_will_do(rich: Any) -> None:
    frozen = np.tile(q, (3, 1))
    frozen.flags.writeable = False
    np.testing.assert_array_equal(rich.Phi(frozen, 0.5), rich.Phi(frozen.copy(), 0.5))


def test_that_parameters_may_be_a_vector_or_a_batch(rich: Any) -> None:
    batch = np.array([[0.4, 1.3], [0.6, 0.9]])
    found = rich.Phi(q, 0.5, batch)
    for k in range(2):
        np.testing.assert_allclose(found[k], rich.Phi(q, 0.5, batch[k]), rtol=1e-13)
        np.testing.assert_allclose(found[k], rich.Phi(q, 0.5, batch[k].tolist()), rtol=1e-13)
    assert np.abs(found[0] - found[1]).max() > 0.1


# ---- what is refused -----------------------------------------------------------------------------

bad_shapes = {
    "one number too few": q[:6],
    "one number too many": np.append(q, 1.0),
    "a scalar": 1.0,
    "nothing": [],
    "transposed": np.zeros((N, 3)),
}


@pytest.mark.parametrize("name", [*FUNCTIONS, *WITH_RATES[:3]])
@pytest.mark.parametrize("given", bad_shapes.values(), ids=bad_shapes)
def test_that_a_state_of_the_wrong_shape_is_refused(rich: Any, name: str, given: Any) -> None:
    with pytest.raises(kc.InputError, match=r"rich: q has shape \(.*last axis must hold 7 numbers"):
        call(rich, name, given, rates=q)


def test_that_the_refusal_names_the_coordinates(rich: Any) -> None:
    with pytest.raises(kc.InputError, match=r"\(6,\).* x_crank, y_crank, .*alpha_cam"):
        rich.Phi(q[:6], 0.5)
    with pytest.raises(kc.InputError, match=r"p has shape \(3,\).*must hold 2 numbers: a, b"):
        rich.Phi(q, 0.5, [1.0, 2.0, 3.0])
    with pytest.raises(kc.InputError, match=r"q_dot has shape \(2,\)"):
        rich.gamma(q, [1.0, 2.0], 0.5)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("batch", [(), (4,)])
def test_that_what_is_not_finite_is_refused_by_name(rich: Any, value: float, batch: Any) -> None:
    state = np.broadcast_to(q, (*batch, N)).copy()
    state[..., 4] = value
    with pytest.raises(kc.InputError, match=r"rich: q is not finite in y_rod; give finite"):
        rich.Phi(state, 0.5)
    with pytest.raises(kc.InputError, match="q_dot is not finite in y_rod"):
        rich.kinematics(q, state, 0.5)
    with pytest.raises(kc.InputError, match="t is not finite"):
        rich.Phi(q, np.full(batch, value))
    with pytest.raises(kc.InputError, match="p is not finite in b"):
        rich.Phi(q, 0.5, np.broadcast_to([1.0, value], (*batch, 2)))


def test_that_all_coordinates_that_are_not_finite_are_named(rich: Any) -> None:
    state = q.copy()
    state[[0, 6]] = math.nan, math.inf
    with pytest.raises(kc.InputError, match="x_crank, alpha_cam"):
        rich.Phi(state, 0.5)


def test_that_large_numbers_are_finite(rich: Any) -> None:
    """Their sum overflows, they do not."""
    huge = np.full(N, 1.5e308)
    huge[2] = huge[5] = huge[6] = 0.3
    assert np.isnan(rich.Phi(huge, 0.5)).sum() + np.isfinite(rich.Phi(huge, 0.5)).sum() < N + 1


@pytest.mark.parametrize("given", ["abc", ["a"] * N, [[1, 2], [3]], object(), {}])
@pytest.mark.parametrize("name", ["Phi", "kinematics"])
def test_that_what_is_no_array_of_numbers_is_refused(rich: Any, name: str, given: Any) -> None:
    with pytest.raises(kc.InputError, match=r"rich: q is not an array of numbers"):
        call(rich, name, given)
    with pytest.raises(kc.InputError, match=r"rich: p "):
        call(rich, name, q, 0.5, given)


@pytest.mark.parametrize("given", [None, [None] * N])
def test_that_nothing_is_no_finite_number(rich: Any, given: Any) -> None:
    with pytest.raises(kc.InputError, match="rich: q "):
        rich.Phi(given, 0.5)
    with pytest.raises(kc.InputError, match="rich: t is not finite"):
        rich.Phi(q, None)


@pytest.mark.parametrize("t", ["now", {}, object()])
def test_that_a_time_that_is_no_number_is_refused(rich: Any, t: Any) -> None:
    with pytest.raises(kc.InputError, match="rich: t is not an array of numbers"):
        rich.Phi(q, t)


def test_that_batches_that_do_not_fit_are_refused(rich: Any) -> None:
    with pytest.raises(kc.InputError, match=r"q \(3, 7\), t \(2,\).* do not fit each other"):
        rich.Phi(np.zeros((3, N)), np.zeros(2))
    with pytest.raises(kc.InputError, match=r"q \(3, 7\), q_dot \(4, 7\)"):
        rich.gamma(np.zeros((3, N)), np.zeros((4, N)), 0.0)
    with pytest.raises(kc.InputError, match=r"p \(4, 2\)"):
        rich.nu(np.zeros((3, N)), 0.0, np.ones((4, 2)))


@pytest.mark.parametrize(
    ("state", "rates", "t", "p", "message"),
    [
        (np.zeros((6, 3)), np.zeros((N, 3)), 0.0, None, r"q has shape \(6, 3\).*first axis"),
        (np.zeros((N, 3)), np.zeros((N, 4)), 0.0, None, "do not have the same last axis"),
        (np.zeros((N, 3)), np.zeros((N, 3)), np.zeros(4), None, "do not have the same last axis"),
        (np.zeros((N, 3)), np.zeros((N, 3)), 0.0, np.ones((2, 4)), "do not have the same last"),
        (np.zeros((N, 3)), np.zeros((N, 3)), 0.0, np.ones(3), r"p has shape \(3,\)"),
        (np.full((N, 3), math.nan), np.zeros((N, 3)), 0.0, None, "q is not finite in x_crank"),
    ],
)  # fmt: skip
def test_that_a_batch_of_the_wrong_layout_is_refused(
    rich: Any, state: Any, rates: Any, t: Any, p: Any, message: str
) -> None:
    with pytest.raises(kc.InputError, match=message):
        rich.kinematics_batch_last(state, rates, t, *(() if p is None else (p,)))


@pytest.mark.parametrize(
    ("state", "rates"),
    [
        (q, q),
        (np.zeros((N, 2, 3)), np.zeros((N, 2, 3))),
        (np.zeros((N, 3)), q),
        (np.zeros((N, 2, 3)), np.zeros((N, 3))),
    ],
)
def test_that_the_batch_last_form_wants_one_batch_axis(rich: Any, state: Any, rates: Any) -> None:
    message = r"do not have the same last axis; give states \(7, N\), t \(\) or \(N,\), and p"
    with pytest.raises(kc.InputError, match=message):
        rich.kinematics_batch_last(state, rates, 0.0)


# ---- domains, and the accuracy of cosine and sine ------------------------------------------------


@pytest.mark.parametrize(
    "point",
    [
        pytest.param((1.0, 0.5, 0.3), id="root"),
        pytest.param((3.0, -1.0, 0.3), id="log"),
        pytest.param((3.0, 0.0, 0.3), id="log of zero"),
        pytest.param((3.0, 1.0, 0.0), id="pole"),
        pytest.param((3.0, 1.0, 1000.0), id="overflow"),
        pytest.param((-1.0, 1.0, 1.0), id="power"),
    ],
)
def test_that_outside_a_domain_point_and_batch_agree(risky: Any, point: Any) -> None:
    states = np.array([(3.0, 1.0, 0.5), point, (4.0, 0.7, 0.2)])
    for name in ("Phi", "Phi_q", "gamma"):
        batch = call(risky, name, states, 0.0)
        for k, state in enumerate(states):
            np.testing.assert_allclose(batch[k], call(risky, name, state, 0.0), rtol=1e-13)
        assert np.isfinite(batch[[0, 2]]).all()
    assert not np.isfinite(risky.Phi(np.array(point), 0.0)).all()


def test_that_cosine_and_sine_are_accurate_at_every_angle(written_out: Any) -> None:
    """Through tan(angle / 2) they are, also where it has its pole."""
    rng = np.random.default_rng(4)
    quarters = np.arange(-8, 9) * (np.pi / 2)
    beside = [np.nextafter(quarters, side) for side in (-100, 100)]
    angles = np.hstack(
        [quarters, *beside, rng.uniform(-20, 20, 300), rng.uniform(-1e8, 1e8, 300), 1e-300, 1e-9]
    )
    cosine, sine = written_out.ARRAYS.cos_sin(angles)
    with mpmath.workdps(40):
        exact = [(float(mpmath.cos(angle)), float(mpmath.sin(angle))) for angle in angles.tolist()]
    assert np.abs(cosine - np.array(exact)[:, 0]).max() < 4e-16
    assert np.abs(sine - np.array(exact)[:, 1]).max() < 4e-16
    assert np.abs(cosine**2 + sine**2 - 1).max() < 1e-15


@pytest.mark.parametrize("angle", [0.0, math.pi, -math.pi, math.pi / 2, 1.5 * math.pi, 1e6])
def test_that_point_and_batch_agree_at_special_angles(rich: Any, angle: float) -> None:
    state = q.copy()
    state[[2, 5]] = angle, -angle
    for name in ("Phi", "Phi_q", "gamma"):
        batch = call(rich, name, state[np.newaxis])
        np.testing.assert_allclose(batch[0], call(rich, name, state), rtol=1e-13, atol=2e-15)
