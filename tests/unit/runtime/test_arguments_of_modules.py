"""What functions of emitted modules are given is checked, that of the planned solve too."""

import numpy as np
import pytest

import kincompile as kc

RNG = np.random.default_rng(7)


@pytest.fixture(scope="module", params=["numpy", "c", "grouped"])
def module(request, example_named, quick_compiler):
    example = example_named("slider_crank")
    if request.param == "grouped":
        return kc.compile(example.model, form="grouped")
    return example.module if request.param == "numpy" else example.native


def test_that_solve_refuses_what_is_no_system(module):
    entries, m = module.Phi_q_nonzeros(module.GUESS, 0.2), module.N_EQUATIONS
    b = RNG.normal(size=m)
    wrong_entries = {
        "one": entries[:1], "number": np.float64(1), "short": entries[:-1],
        "long": np.append(entries, 1.0),
        "nan": entries * np.nan, "empty": np.zeros(0), "text": "x", "none": None,
        "dense": module.Phi_q(module.GUESS, 0.2), "dates": np.zeros(entries.size, "M8[s]"),
    }  # fmt: skip
    for wrong in wrong_entries.values():
        with pytest.raises(kc.InputError, match="nonzeros"):
            module.solve(wrong, b)
    for wrong in (np.float64(1), np.ones(1), b[:-1], np.append(b, 1.0), b * np.inf, [None] * m):
        with pytest.raises(kc.InputError, match="b "):
            module.solve(entries, wrong)
    with pytest.raises(kc.InputError, match="do not fit each other"):
        module.solve(np.stack([entries] * 2), np.stack([b] * 3))


def test_that_solve_takes_what_broadcasts(module):
    q = module.GUESS + RNG.uniform(-0.1, 0.1, (3, 1, module.GUESS.size))
    entries, b = module.Phi_q_nonzeros(q, 0.2), RNG.normal(size=(2, module.N_EQUATIONS))
    x = module.solve(entries.tolist(), b.tolist())
    assert x.shape == (3, 2, module.GUESS.size)
    product = (module.Phi_q(q, 0.2) @ x[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(product, np.broadcast_to(b, product.shape), atol=1e-9)


@pytest.mark.parametrize("t", [10**400, -(10**400), "now", None, np.datetime64("2026-01-01")])
def test_that_a_time_that_is_no_number_is_refused(module, t):
    with pytest.raises(kc.InputError, match="t is not"):
        module.Phi(module.GUESS, t)
    with pytest.raises(kc.InputError, match="t "):
        kc.solve(module, t)


@pytest.mark.parametrize("kind", ["M8[s]", [("a", float)], "U3"])
def test_that_arrays_of_other_things_are_no_numbers(module, kind):
    with pytest.raises(kc.InputError, match="q is not an array of numbers"):
        module.Phi(np.zeros(module.GUESS.size, kind), 0.0)


def test_that_a_whole_number_is_a_time(module):
    np.testing.assert_array_equal(module.Phi(module.GUESS, 2), module.Phi(module.GUESS, 2.0))
