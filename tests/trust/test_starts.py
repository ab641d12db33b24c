"""From a rough guess: the assembly beside it, on all targets, without turns that nobody meant."""

import warnings

import numpy as np
import pytest

import kincompile as kc

from .linkages import random_linkage

GUESSES = 20


@pytest.mark.parametrize("seed", range(12))
def test_the_assembly_beside_a_guess_is_found(seed):
    rng = np.random.default_rng(seed)
    linkage = random_linkage(rng, 1 + seed % 3)
    module = kc.compile(linkage.mechanism)
    for _ in range(GUESSES):
        found = kc.newton(module, 0.0, linkage.guess(rng))
        np.testing.assert_allclose(found.q, linkage.q, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.slow
def test_all_targets_begin_at_the_same_position_from_any_guess(seed, quick_compiler):
    rng = np.random.default_rng(100 + seed)
    linkage = random_linkage(rng, 1 + seed % 2)
    module = kc.compile(linkage.mechanism)
    options = ({"target": "c"}, {"form": "grouped"})
    native, grouped = (kc.compile(linkage.mechanism, **option) for option in options)
    t = np.linspace(0, 0.01, 3)
    for degrees in np.linspace(60, 180, GUESSES):
        guess = linkage.guess(rng, degrees, 1.0)
        expected = kc.solve(module, t, guess=guess)
        sets = np.array([module.DEFAULTS])[np.newaxis]
        for found in (
            *(kc.solve(other, t, guess=guess) for other in (native, grouped)),
            *(kc.solve(other, t, sets, guess=guess) for other in (module, native)),
        ):
            np.testing.assert_array_equal(found.status.ravel(), expected.status)
            np.testing.assert_allclose(found.q.reshape(expected.q.shape), expected.q, atol=1e-9)


@pytest.mark.parametrize("turns", [-3, 40])
def test_free_turns_are_those_of_the_guess(turns):
    linkage = random_linkage(np.random.default_rng(5), 2)
    module = kc.compile(linkage.mechanism)
    guess = linkage.q + np.where(linkage.angles, 2 * np.pi * turns, 0.0)
    guess[2] = linkage.q[2]  # its driver says which turn
    found = kc.solve(module, 0.0, guess=guess)
    np.testing.assert_allclose(found.q[0], guess, rtol=0, atol=1e-9)
    coupled = kc.Mechanism("wheels")
    one, two = (coupled.body(name, guess=(x, 0, 0)) for name, x in (("one", 0), ("two", 3)))
    coupled.add(kc.Revolute("a", coupled.ground, (0, 0), one, (0, 0)))
    coupled.add(kc.Revolute("b", coupled.ground, (3, 0), two, (0, 0)))
    coupled.add(kc.AbsoluteAngle("motor", one, kc.t + 100))
    coupled.add(kc.RelativeAngle("belt", one, two, 0.5))
    q = kc.newton(kc.compile(coupled), 0.0, None).q  # no turn of these is free
    np.testing.assert_allclose(q, [0, 0, 100, 3, 0, 100.5], atol=1e-9)


@pytest.mark.parametrize("option", [{}, {"form": "grouped"}, {"target": "c"}], ids=str)
def test_a_guess_as_far_as_numbers_go_loosens_no_equation(option, quick_compiler):
    """Rounding errors of the place of a guess are no excuse for those of a position."""
    linkage = random_linkage(np.random.default_rng(3), 1)
    module = kc.compile(linkage.mechanism, **option)
    angular = np.array([module.UNITS[name] == "rad" for name in module.COORDINATES])
    for power in (11, 13, 16, 100, 300):
        for moved in (angular, ~angular):
            guess = np.array(linkage.q) + 10.0**power * moved
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # another assembly is as near
                found = kc.solve(module, np.linspace(0, 0.01, 3), guess=guess)
            assert found.good.all() or not found.good.any()
            for q, t in zip(found.q[found.good], found.t[found.good], strict=True):
                np.testing.assert_allclose(module.Phi(q, t), 0, atol=1e-5)
