"""No path gives numbers that are not finite as converged, and a time may repeat on all of them."""

import numpy as np
import pytest

import kincompile as kc
import kincompile.runtime.solve as solve_module

GRIDS = {
    "the first twice": np.r_[0, np.linspace(0, 1, 99)],
    "each twice": np.repeat(np.linspace(0, 1, 50), 2),
    "many at once": np.r_[np.zeros(40), np.linspace(0, 1, 40)],
    "falling": np.r_[1.0, 1.0, np.linspace(1, 0, 80)],
    "without an end": np.r_[np.linspace(0, 1, 80), np.ones(40)],
}
WAYS = ("grid", "march", "variants", "compiled", "compiled variants", "grouped")


@pytest.fixture(scope="module")
def modules(example_named, quick_compiler):
    example = example_named("four_bar")
    grouped = kc.compile(example.model, form="grouped")
    return {"compiled": example.native, "grouped": grouped, "": example.module}


@pytest.mark.every(5)
@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("way", WAYS)
def test_times_may_repeat(modules, way, grid):
    module, t = modules.get(way.partition(" ")[0], modules[""]), GRIDS[grid]
    sets = np.tile(module.DEFAULTS, (2, 1, 1)) if "variants" in way else None
    found = kc.solve(module, t, sets, method=way if way in ("grid", "march") else None)
    assert found.success
    times, inverse = np.unique(t, return_inverse=True)
    expected = kc.solve(modules[""], times, method="march")
    for name in ("q", "q_dot", "q_ddot"):
        given = np.atleast_3d(getattr(found, name).T).T
        wanted = getattr(expected, name)[inverse]
        np.testing.assert_allclose(
            given, np.broadcast_to(wanted, given.shape), rtol=1e-9, atol=1e-9
        )


@pytest.mark.parametrize("variants", [False, True])
def test_numbers_that_are_not_finite_are_never_taken_for_converged(modules, monkeypatch, variants):
    """Whatever the cause: here a fault that is put where the motion has been found."""
    name = "solve_variants" if variants else "follow"
    found = getattr(solve_module, name)

    def faulty(*arguments):
        result = found(*arguments)
        q_ddot = result.q_ddot if variants else result[0].states[2].T
        q_ddot[..., 2, 4] = np.nan
        return result

    monkeypatch.setattr(solve_module, name, faulty)
    module = modules[""]
    sets = np.tile(module.DEFAULTS, (2, 1, 1)) if variants else None
    solution = kc.solve(module, np.linspace(0, 1, 50), sets)
    assert not solution.success
    assert (solution.status[..., 2] == kc.Status.NOT_FINITE).all()
    assert np.count_nonzero(solution.status) == (2 if variants else 1)
    assert "numbers that are not finite" in solution.message
