"""The same mechanism in other units: the same verdicts, iterations and ways through the grid."""

from typing import Any

import numpy as np
import pytest

import kincompile as kc

SIZES = (1e-6, 1e-3, 1e4, 1e6)
LENGTHS = np.arange(9) % 3 < 2


def in_units(module, size, t, overrides=None, **options):
    """Solve the four-bar with all lengths so many times as large; return it in its own units."""
    p, factors = module.DEFAULTS.copy(), np.where(LENGTHS, size, 1.0)
    for name, value in (overrides or {}).items():
        p[module.PARAMETERS.index(name)] = value
    p[:4] *= size
    if options.pop("variants", False):
        p = (p * np.linspace(1, 1.01, 5)[:, np.newaxis])[:, np.newaxis]
        p[..., 4] = 1.5
    solution = kc.solve(module, t, p, module.GUESS * factors, **options)
    return solution, [values / factors for values in (solution.q, solution.q_dot, solution.q_ddot)]


@pytest.fixture(scope="module")
def modules(example_named, quick_compiler):
    example = example_named("four_bar")
    return {
        "numpy": example.module,
        "c": example.native,
        "grouped": kc.compile(example.model, form="grouped"),
    }


WAYS: dict[str, tuple[str, int, dict[str, Any]]] = {
    "grid": ("numpy", 2001, {"method": "grid"}),
    "march": ("numpy", 161, {"method": "march"}),
    "long steps": ("numpy", 9, {}),
    "variants": ("numpy", 161, {"variants": True}),
    "compiled": ("c", 2001, {}),
    "compiled variants": ("c", 161, {"variants": True}),
    "grouped": ("grouped", 161, {}),
}


@pytest.mark.every(5)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("way", WAYS)
def test_no_unit_of_length_is_judged_otherwise_or_takes_more_work(modules, way, size):
    target, points, options = WAYS[way]
    t = np.linspace(0, 4, points)
    (ours, here), (theirs, there) = (
        in_units(modules[target], unit, t, **options) for unit in (size, 1.0)
    )
    assert theirs.success, theirs.message
    np.testing.assert_array_equal(ours.status, theirs.status)
    assert np.max(np.abs(ours.iterations - theirs.iterations)) <= 1
    assert ours.statistics == theirs.statistics
    for one, other in zip(here, there, strict=True):
        assert np.max(np.abs(one - other)) <= 1e-9 * np.max(np.abs(other))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("method", ["grid", "march"])
@pytest.mark.slow
def test_a_lock_up_is_the_same_event_in_all_units(modules, size, method):
    t = np.linspace(0, 4, 101)
    (ours, _), (theirs, _) = (
        in_units(modules["numpy"], unit, t, {"a": 40.0}, method=method) for unit in (size, 1.0)
    )
    np.testing.assert_array_equal(ours.status, theirs.status)
    assert not theirs.success
    assert [event.kind for event in ours.events] == [event.kind for event in theirs.events]
    for one, other in zip(ours.events, theirs.events, strict=True):
        assert one.t == pytest.approx(other.t, rel=1e-9)
        assert one.bodies == other.bodies


@pytest.mark.parametrize("size", SIZES)
def test_newton_takes_the_same_iterations_in_all_units(modules, size):
    module, scale = modules["numpy"], np.where(LENGTHS, size, 1.0)
    theirs = kc.newton(module, 1.0, None)
    p = module.DEFAULTS * np.where(np.arange(5) < 4, size, 1.0)
    ours = kc.newton(module, 1.0, module.GUESS * scale, p)
    assert ours.status is theirs.status
    assert abs(ours.iterations - theirs.iterations) <= 1
    np.testing.assert_allclose(ours.q / scale, theirs.q, rtol=0, atol=1e-9)
