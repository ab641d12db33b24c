"""Bad starts: what is found is an assembly of the closed form; the page makes the same iterates."""

import json
import shutil
import subprocess
import warnings

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime.newton import iterate
from kincompile.runtime.problem import problem
from kincompile.view.newton_panel import newton_method, newton_script
from tests.adversary.chains import Placement, coordinates, poses_of, random_chain
from tests.adversary.test_chains import Case, start_of

STRUCTURES = (("RRR",), ("RRP", "slot"), ("RRR", "gear", "RRR"), ("slot", "RRR", "RRP"))
AT_START = np.zeros(1)
NODE = shutil.which("node") or shutil.which("nodejs")


def cases():
    """Yield a chain of each structure, at its exact start, with a generator of its own."""
    for number, kinds in enumerate(STRUCTURES):
        random = np.random.default_rng(number)
        chain, at = random_chain(random, list(kinds)), Placement(2.5, 0.4, 1 + 0.5j)
        exact = coordinates(chain, at, poses_of(chain, AT_START, {})[0])[0]
        yield Case(chain, at, AT_START, exact), random


def bad_starts(case, random, count):
    """Return starts anywhere: half of them near by, half up to half a turn and two sizes off."""
    spread = np.where(np.arange(count) % 2, 0.5, np.pi)[:, np.newaxis]
    away = random.uniform(-1, 1, (count, case.guess.size)) * spread
    away.reshape(count, -1, 3)[:, :, :2] *= case.at.scale * 2 / np.pi
    return case.guess + away


def solved(module, guess):
    """Return status and position from a guess."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.SingularConfigurationWarning)
        solution = kc.solve(module, 0.0, guess=guess)
    return int(solution.status[0]), solution.q[0]


def check_starts(count, record):
    """Solve from bad starts: what is found closes every dyad, and what is not says so."""
    tried = gave_up = 0
    for case, random in cases():
        module = kc.compile(case.model)
        for guess in bad_starts(case, random, count // len(STRUCTURES)):
            status, q = solved(module, guess)
            tried, gave_up = tried + 1, gave_up + (status != kc.Status.CONVERGED)
            if status == kc.Status.CONVERGED:
                assert np.max(np.abs(module.Phi(q, 0.0))) < 1e-8 * case.at.scale
                is_geared = "gear" in case.chain.kinds  # whose wheel has more ways to lie
                assert is_geared or start_of(case, q) is not None, guess.tolist()
    record(tried=tried, wrong=0, gave_up=gave_up)
    assert gave_up <= 0.03 * tried


def test_a_few_bad_starts(record):
    check_starts(60, record)


@pytest.mark.slow
def test_two_thousand_bad_starts(record):
    check_starts(2000, record)


@pytest.mark.skipif(NODE is None, reason="node is not installed (Debian: nodejs)")
@pytest.mark.slow
def test_two_hundred_bad_starts_on_the_page(tmp_path, record):
    """Newton's panel takes the plain iterates, and so they are compared."""
    tried, thrown = 0, 0
    statuses = {"converged": 0, "singular": 2, "not finite": 3, "not converged": 1}
    for case, random in cases():
        module, guesses = kc.compile(case.model), bad_starts(case, random, 50)
        text = newton_script(case.model) + "\n" + newton_method()
        starts = json.dumps(guesses.tolist())
        text += f"\nconst all = {starts}.map(g => newton.iterate(emitted, g, 0));"
        path = tmp_path / f"{tried}.js"
        path.write_text(text + "\nconsole.log(JSON.stringify(all))", encoding="utf-8")
        done = subprocess.run([str(NODE), str(path)], capture_output=True, text=True, check=True)
        for guess, found in zip(guesses, json.loads(done.stdout), strict=True):
            known = iterate(problem(module, module.DEFAULTS, guess, 0.0), 0.0, guess, 1e-10, 25)
            tried += 1
            if max(known.corrections, default=0.0) > np.pi:  # thrown far: roundings decide where
                thrown += 1
                continue
            assert statuses[found["status"]] == known.status
            last = np.array(found["iterates"][-1]["q"])
            np.testing.assert_allclose(last, known.points[-1].q, rtol=1e-6, atol=1e-6)
    record(tried=tried, wrong=0, gave_up=thrown)
    assert tried - thrown >= 60
