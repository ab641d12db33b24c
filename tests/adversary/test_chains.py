"""Random chains through every way of solving, against their motion in closed form.

Never a number that is not finite with CONVERGED, never a point off the closed form (that is: off
the manifold, or on another branch), never one beyond a stretched dyad; and what exists is found.
Seeds count from 0 and from 1000; `chain_of` makes everything of one.
"""

import dataclasses
import os
import time
import warnings
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import kincompile as kc
from tests.adversary.chains import (
    Chain,
    Placement,
    closings,
    coordinates,
    mechanism,
    motion,
    poses_of,
    random_chain,
    reach,
)

KINDS = ("RRR", "RRP", "slot", "gear")
TIMES = (
    np.linspace(0, 3, 200),  # a grid
    np.linspace(0, 4, 9),  # sparse: up to a third of a turn between two times
    np.sort(np.r_[0, np.repeat(np.linspace(0, 3, 40), 2)]),  # each time twice, the first one thrice
    np.linspace(0, -3, 60),  # falling
)
FAR = 1e2
"""How far from the origin a mechanism may lie, in its sizes."""


@dataclass(frozen=True)
class Case:
    """A chain in its place, times and a poor guess."""

    chain: Chain
    at: Placement
    t: np.ndarray
    guess: np.ndarray

    def moved(self, at):
        """Return the chain in another place, with the guess that lies alike."""
        poses, _ = poses_of(self.chain, self.t[:1], {})
        away = self.guess - coordinates(self.chain, self.at, poses)[0]
        away.reshape(-1, 3)[:, :2] *= at.scale / self.at.scale
        turned = np.exp(1j * (at.turn - self.at.turn)) * (away[::3] + 1j * away[1::3])
        away[::3], away[1::3] = turned.real, turned.imag
        return Case(self.chain, at, self.t, coordinates(self.chain, at, poses)[0] + away)

    @property
    def model(self):
        """The mechanism."""
        return mechanism(self.chain, self.at, self.guess)


def chain_of(seed):
    """Return the case of a seed."""
    random = np.random.default_rng(seed)
    kinds = [KINDS[k] for k in random.integers(0, 4, random.integers(1, 5))]
    chain = random_chain(random, kinds)
    away = random.choice((0.0, 1.0, 1e2, FAR)) * np.exp(1j * random.uniform(-3, 3))
    at = Placement(10 ** random.uniform(-9, 9), random.uniform(-3, 3), complex(away))
    t = TIMES[random.integers(0, 4)]
    guess = coordinates(chain, at, poses_of(chain, t[:1], {})[0])[0]
    noise = random.uniform(-1, 1, guess.size) * random.choice((0.01, 0.1, 0.4))
    noise.reshape(-1, 3)[:, :2] *= at.scale
    return Case(chain, at, t, guess + noise)


def start_of(case, q):
    """Return the way in which the dyads are closed at a found position, and its turns.

    Nothing, where it is none of the ways: then it is off the manifold.
    """
    for closing in closings(case.chain):
        poses, _ = poses_of(case.chain, case.t[:1], closing)
        known = coordinates(case.chain, case.at, poses)[0]
        turns = np.zeros_like(q)
        turns[2::3] = 2 * np.pi * np.round((q - known)[2::3] / (2 * np.pi))
        if reach((q - turns)[np.newaxis], known[np.newaxis], case.at.scale)[0] < tolerance(case):
            return closing, turns
    return None


def tolerance(case):
    """Return how far from the closed form a position may be, in radians and sizes."""
    return 1e-7 + 1e-10 * abs(case.at.origin)


def check(case, solution):
    """Compare a solution with the closed form; return how many points it should have found."""
    good = solution.status == kc.Status.CONVERGED
    for values in (solution.q, solution.q_dot, solution.q_ddot):
        assert np.isfinite(values[good]).all()
    if not good[0]:
        assert not solution.success
        return case.t.size
    found = start_of(case, solution.q[0])
    assert found is not None, "the first position is none of those in which the dyads close"
    closing, turns = found
    known = motion(case.chain, case.at, case.t, closing)
    assert not good[known.margin <= 0].any(), "converged beyond a stretched dyad"
    with np.errstate(invalid="ignore"):
        error = reach(solution.q, known.q + turns, case.at.scale)
    # A dyad near its limit magnifies a rounding error by the root of what is left.
    allowed = tolerance(case) / np.sqrt(np.maximum(known.margin, 1e-12))
    assert (error[good] <= allowed[good]).all(), "off the branch on which it began"
    return int(np.sum((known.margin > 1e-3) & ~good))


def solutions(case, way):
    """Yield the solutions of one way, with the case that each belongs to."""
    if way == "placements":
        for at in (Placement(), case.at, Placement(1e9, 1.0, 1j * FAR), Placement(1e-9, -2.0, 1e2)):
            moved = case.moved(at)
            yield moved, kc.solve(kc.compile(moved.model), case.t)
        return
    if way == "variants":
        found = kc.solve(kc.compile(case.model), case.t, p=np.reshape(RATES, (-1, 1, 1)))
        for k, rate in enumerate(RATES):
            names = ("q", "q_dot", "q_ddot", "status")
            values = {name: getattr(found, name)[k] for name in names}
            slower = dataclasses.replace(case, t=rate * case.t)
            yield slower, SimpleNamespace(success=not values["status"].any(), **values)
        return
    module = kc.compile(case.model, form="grouped" if way == "grouped" else None)
    methods = {"methods": ("grid", "march"), "grouped": ("march",), "c": ("march",)}
    for method in methods[way]:
        yield case, kc.solve(module, case.t, method=method)
    if way == "c":
        yield case, kc.solve(kc.compile(case.model, target="c"), case.t)


RATES = (1.0, 0.7, 1.0)
"""How fast the clock of each variant goes; equal ones have equal statuses."""

SHARE = 1 if "ADVERSARY_REPORT" in os.environ else 4
"""Part of the seeds that the slow suite tries; `python -m tests.adversary` tries all."""
SEEDS = {"methods": 160, "placements": 40, "grouped": 40, "variants": 40, "c": 8}
QUICK = {"methods": 8, "placements": 2, "grouped": 3, "variants": 3, "c": 1}


def check_seeds(way, seeds, record):
    """Solve the chains of some seeds; the statuses of one chain are the same in every solution."""
    gave_up, points, slowest = 0, 0, 0.0
    for seed in seeds:
        case, statuses = chain_of(seed), []
        started = time.process_time()
        for each, solution in solutions(case, way):
            try:
                gave_up += check(each, solution) > 0
            except AssertionError as error:
                raise AssertionError(f"seed {seed}, {case.chain.kinds}: {error}") from error
            statuses.append(solution.status)
            points += int(np.sum(solution.status == kc.Status.CONVERGED))
        slowest = max(slowest, time.process_time() - started)
        for status in statuses[2:] if way == "variants" else statuses[1:]:
            np.testing.assert_array_equal(status, statuses[0], err_msg=f"seed {seed}")
    record(tried=len(seeds), wrong=0, gave_up=gave_up, slowest=slowest)
    assert points > 5 * len(seeds)
    assert gave_up <= 0.005 * len(seeds)


@pytest.fixture(autouse=True)
def _quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.SingularConfigurationWarning)
        yield


@pytest.mark.parametrize("way", SEEDS)
@pytest.mark.slow
def test_a_few_random_chains(way, record, request):
    if way == "c":
        request.getfixturevalue("quick_compiler")
    check_seeds(way, range(QUICK[way]), record)


@pytest.mark.slow
@pytest.mark.parametrize("way", SEEDS)
def test_many_random_chains(way, record, request):
    if way == "c":
        request.getfixturevalue("quick_compiler")
    check_seeds(way, range(1000, 1000 + SEEDS[way] // SHARE), record)


def test_that_the_closed_form_meets_the_equations(record):
    """The oracle against the module: two descriptions of one chain, of each kind of dyad."""
    for number, kind in enumerate(KINDS):
        random = np.random.default_rng(number)
        chain, at = random_chain(random, [kind]), Placement(3.0, 0.7, 2 + 1j)
        t = np.linspace(0, 0.2, 5)
        known = motion(chain, at, t, {})
        module = kc.compile(mechanism(chain, at, known.q[0]))
        np.testing.assert_allclose(module.Phi(known.q, t), 0, atol=1e-13)
        assert start_of(Case(chain, at, t, known.q[0]), known.q[0]) is not None
