"""Constants of an emitted module."""

from typing import Any

import numpy as np
import pytest


def test_that_a_module_says_what_it_is(rich: Any) -> None:
    assert (rich.NAME, rich.FORMAT) == ("rich", 3)
    assert len(rich.FINGERPRINT) == 32
    assert int(rich.FINGERPRINT, 16) > 0
    assert (rich.N_COORDINATES, rich.N_EQUATIONS) == (7, 7)


def test_that_names_are_in_the_order_of_the_model(rich: Any) -> None:
    assert rich.COORDINATES == (
        "x_crank", "y_crank", "phi_crank", "x_rod", "y_rod", "phi_rod", "alpha_cam",
    )  # fmt: skip
    assert rich.EQUATIONS == (
        "A.x", "A.y", "motor", "link", "cam.contact", "cam.tangent", "free",
    )  # fmt: skip
    assert rich.PARAMETERS == ("a", "b")


def test_that_units_are_known(rich: Any) -> None:
    assert rich.UNITS == {
        "x_crank": "m", "y_crank": "m", "phi_crank": "rad", "x_rod": "m", "y_rod": "m",
        "phi_rod": "rad", "alpha_cam": "rad", "a": "m", "b": "",
    }  # fmt: skip


def test_that_guess_and_defaults_are_numbers(rich: Any) -> None:
    np.testing.assert_array_equal(rich.DEFAULTS, [0.4, 1.3])
    np.testing.assert_array_equal(rich.GUESS, [0.1, 0.2, 0.3, 1, 0, 0.4, 0.4])


@pytest.mark.parametrize(
    ("name", "dtype", "shape"),
    [("DEFAULTS", float, (2,)), ("GUESS", float, (7,)), ("PATTERN", int, None)],
)
def test_that_constant_arrays_cannot_be_changed(
    rich: Any, name: str, dtype: Any, shape: Any
) -> None:
    array = getattr(rich, name)
    assert array.dtype == np.dtype(dtype)
    assert shape in (None, array.shape)
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 0


def test_that_a_module_without_parameters_has_an_empty_vector(tabled: Any) -> None:
    assert tabled.PARAMETERS == ()
    assert tabled.DEFAULTS.shape == (0,)
    q = np.array([1.0, 0.2, 0.1, 0.3])
    np.testing.assert_array_equal(tabled.Phi(q, 0.5), tabled.Phi(q, 0.5, np.zeros(0)))


def test_that_the_pattern_is_sorted_and_within_the_matrix(rich: Any) -> None:
    places = [tuple(place) for place in rich.PATTERN.tolist()]
    assert places == sorted(set(places))
    assert rich.PATTERN.shape == (len(places), 2)
    assert (rich.PATTERN >= 0).all()
    assert (rich.PATTERN < 7).all()


def test_that_what_is_not_in_the_pattern_is_zero(rich: Any) -> None:
    rng = np.random.default_rng(1)
    dense = rich.Phi_q(rng.normal(size=(20, 7)), 0.3)
    pattern = np.zeros((7, 7), dtype=bool)
    pattern[tuple(rich.PATTERN.T)] = True
    assert (dense[:, ~pattern] == 0).all()
    assert (dense[:, pattern] != 0).any(axis=0).all()
