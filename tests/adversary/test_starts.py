"""Bad starts: what NumPy, C, JavaScript and Octave make of the same one, and who gets home.

Every found position is compared with the closed form of the chain, which knows all assemblies.
"""

import itertools
import json
import os
import shutil
import subprocess
import warnings

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import iterate, problem
from kincompile.view.page_scripts import solver_script
from tests.adversary.chains import (
    Placement,
    closings,
    coordinates,
    poses_of,
    random_chain,
    reach,
)
from tests.adversary.test_chains import Case, chain_of, start_of
from tests.page_modules import in_node
from tests.targets.conftest import OCTAVE, run_octave

STRUCTURES = (("RRR",), ("RRP", "slot"), ("RRR", "gear", "RRR"), ("slot", "RRR", "RRP"))
AT_START = np.zeros(1)
NODE = shutil.which("node") or shutil.which("nodejs")
SHARE = 1 if "ADVERSARY_REPORT" in os.environ else 5
"""Part of the starts that the slow suite tries; `python -m tests.adversary` tries all."""


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
    """Return status and position from a guess, and what is said of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.SingularConfigurationWarning)
        solution = kc.solve(module, 0.0, guess=guess)
    return int(solution.status[0]), solution.q[0], solution.message


def compare(count, record):
    """Solve bad starts by NumPy and by C: what is found is an assembly, and the same in both.

    Returns of how many nothing is found.
    """
    tried = gave_up = other = 0
    for case, random in cases():
        modules = [kc.compile(case.model, target=target) for target in ("numpy", "c")]
        is_geared = "gear" in case.chain.kinds  # whose wheel has more ways to lie
        for guess in bad_starts(case, random, count // len(STRUCTURES)):
            found = [solved(module, guess) for module in modules]
            (status, q, _), (of_c, q_of_c, _) = found
            tried, gave_up = tried + 1, gave_up + (status != kc.Status.CONVERGED)
            other += status != of_c or not np.allclose(q, q_of_c, 1e-9, 1e-9, equal_nan=True)
            for code, position, _ in found:
                if code == kc.Status.CONVERGED and not is_geared:
                    turns = np.max(np.abs(position - guess)[2::3]) / (2 * np.pi)
                    assert turns < 1.01, f"{turns:.1f} turns from the guess"
                    assert start_of(case, position) is not None, "no assembly of the closed form"
    record(tried=tried, wrong=other, gave_up=gave_up)
    assert other == 0
    return gave_up


@pytest.mark.slow
def test_a_few_bad_starts_in_c(quick_compiler, record):
    compare(40, record)


@pytest.mark.slow
def test_many_bad_starts(quick_compiler, record):
    assert compare(2000 // SHARE, record) <= 40 / SHARE


def under_node(folder, text, result):
    """Return the value of an expression after a script."""
    path = folder / "starts.js"
    path.write_text(f"{text}\nconsole.log(JSON.stringify({result}))", encoding="utf-8")
    done = subprocess.run([str(NODE), str(path)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def in_javascript(folder, model, t, guesses):
    """Return statuses, positions, the event and what another start has elsewhere, of each guess."""
    solve = """JOBS.map(guess => {
      const motion = MODEL.solver.solve(MODEL, TIMES, MODEL.DEFAULTS, guess);
      const event = MODEL.solver.explain(motion);
      return [Array.from(motion.status), Array.from(motion.q), event, motion.other, motion.strays];
    })"""
    solve = solve.replace("TIMES", json.dumps(np.atleast_1d(t).tolist()))
    solve = solve.replace("JOBS", json.dumps(np.atleast_2d(guesses).tolist()))
    source = kc.emit(model, "javascript").source
    found = under_node(folder, source, solve.replace("MODEL", model.name))
    for status, q, *rest in found:
        yield np.array(status), np.array(q, dtype=float).reshape(len(status), -1), *rest


def in_octave(folder, model, guesses):
    """Yield whether Octave's start finds a position from each guess, and the position."""
    kc.emit(model, "octave").write(folder)
    columns = "; ".join(" ".join(map(repr, row)) for row in guesses.T.tolist())
    defaults = kc.compile(model).DEFAULTS.tolist()
    lines = [
        "warning('off', 'all');", f"guesses = [{columns}];", f"p = {defaults}';",
        "for k = 1:size(guesses, 2)",
        f"[q, is_found] = {model.name}_assemble(guesses(:, k), 0, p);",
        "show('start', [is_found; q]);",
        "end",
    ]  # fmt: skip
    for is_found, *q in run_octave(folder, lines)["start"]:
        yield bool(is_found), np.array(q)


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="octave-cli is not installed (Debian: octave)")
def test_many_starts_in_octave(tmp_path, record):
    """All is as in the runtime."""
    tried = gave_up = 0
    for number, (case, random) in enumerate(cases()):
        module, guesses = kc.compile(case.model), bad_starts(case, random, 500 // SHARE)
        (folder := tmp_path / str(number)).mkdir()
        results = in_octave(folder, case.model, guesses)
        for guess, (is_found, q) in zip(guesses, results, strict=True):
            status, known, _ = solved(module, guess)
            is_same = is_found == (status == kc.Status.CONVERGED)
            is_same &= not is_found or np.allclose(q, known, 1e-9, 1e-9)
            assert is_same
            tried, gave_up = tried + 1, gave_up + (status != kc.Status.CONVERGED)
    record(tried=tried, wrong=0, gave_up=gave_up)


needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed (Debian: nodejs)")


@needs_node
@pytest.mark.slow
def test_many_starts_in_javascript(tmp_path, record):
    """All is as in the runtime."""
    tried = gave_up = 0
    for case, random in cases():
        module, guesses = kc.compile(case.model), bad_starts(case, random, 500 // SHARE)
        results = in_javascript(tmp_path, case.model, 0.0, guesses)
        for guess, (status, q, _, elsewhere, strays) in zip(guesses, results, strict=True):
            known, q_known, said = solved(module, guess)
            tried += 1
            is_same = status[0] == known and np.allclose(q, q_known, 1e-9, 1e-9, equal_nan=True)
            bodies = f"with {', '.join(elsewhere or ())} elsewhere, is as near to the guess"
            is_same &= (bodies if elsewhere else "on another branch" if strays else "") in said
            is_same &= bool(elsewhere or strays) == ("kc.assemblies gives all of them" in said)
            assert is_same
            gave_up += known != kc.Status.CONVERGED
    record(tried=tried, wrong=0, gave_up=gave_up)


def motions_in_javascript(seeds, folder):
    """Follow chains up to and beyond lock-ups in JavaScript; return how many ended in one."""
    lock_ups = 0
    for case in map(chain_of, seeds):
        solution = kc.solve(kc.compile(case.model), case.t)
        ((status, q, event, *_),) = in_javascript(folder, case.model, case.t, case.guess)
        np.testing.assert_array_equal(status, solution.status)
        is_there = np.isfinite(solution.q).all(axis=1)
        np.testing.assert_array_equal(np.isfinite(q).all(axis=1), is_there)
        apart = reach(q[is_there], solution.q[is_there], case.at.scale * (1 + abs(case.at.origin)))
        assert np.max(apart, initial=0.0) < 1e-9
        assert (event and event["kind"]) == (solution.events[-1].kind if solution.events else None)
        lock_ups += event is not None
    return lock_ups


@needs_node
def test_that_chains_end_alike_in_javascript(tmp_path):
    assert motions_in_javascript(range(6), tmp_path) >= 2


@needs_node
@pytest.mark.slow
def test_that_many_chains_end_alike_in_javascript(tmp_path):
    assert motions_in_javascript(range(6, 6 + 54 // SHARE), tmp_path) >= 18 // SHARE


@needs_node
@pytest.mark.slow
def test_two_hundred_bad_starts_on_the_page(record):
    """Newton's panel takes the plain iterates, and so they are compared."""
    tried, thrown = 0, 0
    statuses = {"converged": 0, "singular": 2, "not finite": 3, "not converged": 1}
    for case, random in cases():
        module, guesses = kc.compile(case.model), bad_starts(case, random, 50)
        text = solver_script(case.model) + "import { newton } from './newton.js';\n"
        text += "tell(given.map(guess => newton.iterate(emitted, guess, 0)));"
        for guess, found in zip(guesses, in_node(text, guesses.tolist()), strict=True):
            known = iterate(
                problem(code_of(module), module.DEFAULTS, guess, 0.0), 0.0, guess, 1e-10, 25
            )
            tried += 1
            if max(known.corrections, default=0.0) > np.pi:  # thrown far: roundings decide where
                thrown += 1
                continue
            assert statuses[found["status"]] == known.status
            last = np.array(found["iterates"][-1]["q"])
            np.testing.assert_allclose(last, known.points[-1].q, rtol=1e-6, atol=1e-6)
    record(tried=tried, wrong=0, gave_up=thrown)
    assert tried - thrown >= 80


NEAR = np.pi / 6, 0.1
"""A start is near: 30 degrees, a tenth of a length."""


def linkages():
    """Yield random linkages at an assembly that has no other one as near as a start may be."""
    seed = 0
    while True:
        random = np.random.default_rng([seed, 30])
        kinds = [("RRR", "RRP", "slot")[k] for k in random.integers(0, 3, random.integers(1, 4))]
        chain, at = random_chain(random, kinds), Placement(10 ** random.uniform(-3, 3))
        ways = closings(chain)
        known = np.array(
            [coordinates(chain, at, poses_of(chain, AT_START, way)[0])[0] for way in ways]
        )
        exact = coordinates(chain, at, poses_of(chain, AT_START, {})[0])[0]
        apart = np.abs(known - exact)
        apart[:, 2::3] = np.abs(np.remainder(apart[:, 2::3] + np.pi, 2 * np.pi) - np.pi)
        apart.reshape(len(ways), -1, 3)[:, :, :2] *= NEAR[0] / NEAR[1] / at.scale
        distances = np.sort(np.max(apart, axis=1))
        seed += 1
        if distances[1] > 2 * NEAR[0]:
            yield Case(chain, at, AT_START, exact), random


def near_start(case, random):
    """Return a start near the assembly of a linkage."""
    away = random.uniform(-1, 1, case.guess.size) * NEAR[0]
    away.reshape(-1, 3)[:, :2] *= case.at.scale * NEAR[1] / NEAR[0]
    return case.guess + away


def come_home(count, record):
    """Start near an assembly of random linkages; return the share that reaches it.

    What does not reach it fails, or says that another assembly is as near.
    """
    reached = other = 0
    for case, random in itertools.islice(linkages(), count):
        status, q, said = solved(kc.compile(case.model), near_start(case, random))
        is_home = reach(q[np.newaxis], case.guess[np.newaxis], case.at.scale)[0] < 1e-6
        reached += is_home
        is_told = status != kc.Status.CONVERGED or "is as near to the guess" in said
        other += not (is_home or is_told)
    record(tried=count, wrong=other, gave_up=count - reached - other)
    assert other == 0
    return reached / count


def test_a_few_near_starts(record):
    assert come_home(20, record) == 1


@pytest.mark.slow
def test_that_near_starts_come_home(record):
    assert come_home(1000 // SHARE, record) >= (0.997 if SHARE == 1 else 0.99)
