"""The motion as a pandas table and as xarray's labelled arrays: names, units, numbers."""

import sys

import numpy as np
import pytest

from kincompile import errors
from kincompile.errors import UnsupportedError
from kincompile.names import rate_unit
from kincompile.runtime.solve import solve


@pytest.fixture
def motion(pendulum):
    return solve(pendulum, np.linspace(0, 1, 4), {"omega": 0.1})


@pytest.fixture
def variants(example_named):
    module = example_named("four_bar").module
    return solve(
        module, np.linspace(0, 1, 4), np.stack([module.DEFAULTS, module.DEFAULTS])[:, None]
    )


def test_that_the_table_of_pandas_is_the_motion(motion):
    pytest.importorskip("pandas", reason="pandas is not installed")
    frame = motion.to_pandas()
    assert (frame.index.name, frame.shape) == ("t", (4, 11))
    assert list(frame.columns[-2:]) == ["status", "residual"]
    np.testing.assert_array_equal(frame.index, motion.t)
    for column in frame.columns[:-2]:
        np.testing.assert_array_equal(frame[column], motion[column])
    units = frame.attrs["units"]
    assert units["t"] == "s"
    assert sorted(set(units.values())) == ["m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "s"]


def test_that_the_arrays_of_xarray_are_the_motion(motion):
    pytest.importorskip("xarray", reason="xarray is not installed")
    data = motion.to_xarray()
    for name in motion.coordinates:
        np.testing.assert_array_equal(data[name], motion[name])
        assert data[name].attrs["units"] == motion.units[name]
        np.testing.assert_array_equal(data[f"{name}_ddot"], motion[f"{name}_ddot"])
    assert (data["t"].attrs["units"], data.attrs["name"]) == ("s", "pendulum")


def test_that_variants_are_a_dimension(variants):
    pytest.importorskip("xarray", reason="xarray is not installed")
    data = variants.to_xarray()
    assert dict(data.sizes) == {"variant": 2, "t": 4}
    name = variants.coordinates[0]
    np.testing.assert_array_equal(data[name], variants[name])


def test_that_a_table_has_variants_one_below_the_other(variants):
    pytest.importorskip("pandas", reason="pandas is not installed")
    table = variants.to_pandas()
    assert table.index.names[-1] == "t"
    for name in variants.coordinates:
        np.testing.assert_array_equal(table[name], variants[name].ravel())


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_that_a_missing_package_is_named(motion, monkeypatch, package):
    """A checkout stays editable; elsewhere there is no `.` to install."""
    monkeypatch.setitem(sys.modules, package, None)
    wanted = rf"{package} is not installed; pip install -e '\.\[tables\]' in the checkout brings it"
    with pytest.raises(UnsupportedError, match=wanted):
        getattr(motion, f"to_{package}")()
    monkeypatch.setattr(errors, "__file__", "/elsewhere/kincompile/errors.py")
    with pytest.raises(UnsupportedError, match=r"pip install 'kincompile\[tables\]' brings it"):
        getattr(motion, f"to_{package}")()


def test_that_what_has_no_unit_gets_none():
    assert [rate_unit(unit, order) for unit in ("", "m") for order in range(3)] == [
        *("", "", ""), *("m", "m/s", "m/s^2"),
    ]  # fmt: skip
