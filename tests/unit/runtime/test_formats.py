"""Modules of an earlier format load, say which bodies they have, and solve."""

from pathlib import Path

import numpy as np
import pytest

import kincompile as kc

MODULE = Path(__file__).parent / "modules" / "slider_crank_format_1.txt"


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    path = tmp_path_factory.mktemp("old") / "slider_crank.py"
    path.write_bytes(MODULE.read_bytes())
    return kc.load(path)


def test_that_a_module_of_format_1_says_its_bodies(old, example_named):
    assert old.FORMAT == 1
    assert old.BODIES == example_named("slider_crank").module.BODIES
    assert {columns for _, _, columns in old.BODIES} == {3}


@pytest.mark.parametrize("method", ["grid", "march"])
def test_that_a_module_of_format_1_solves_as_one_of_today(old, example_named, method):
    t = np.linspace(0, 1, 50)
    found = kc.solve(old, t, method=method)
    known = kc.solve(example_named("slider_crank").module, t, method=method)
    assert found.success
    for name in ("q", "q_dot", "q_ddot"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(known, name), rtol=1e-10, atol=1e-10
        )


def test_that_a_module_of_format_1_is_verified(old):
    assert kc.verify(old).passed
