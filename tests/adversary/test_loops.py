"""Random loops in space against their closed form, and their derivatives by complex steps.

Never a number that is not finite with CONVERGED, never a point off the closed form (that is: off
the manifold, or on another branch), never one beyond a stretched rod; and what exists is found.
"""

import itertools
import os
import time
import warnings
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from tests.adversary.loops import Loop, Rocker, mechanism, motion, random_loop

TIMES = (np.linspace(0, 3, 60), np.linspace(0, 4, 9), np.linspace(0, -3, 25))
# Two thousand take ten minutes: `python -m tests.adversary` runs them all, CI a tenth.
PARTS, EACH = (20, 100) if "ADVERSARY_REPORT" in os.environ else (2, 50)
DERIVED = ("Phi", "Phi_q", "nu", "gamma")


def places_of(loop: Loop, followers: list[Any]) -> list[Any]:
    """Return where the next pin of each follower is, one for each time."""
    pairs = zip(loop.stages, followers, loop.pins[1:], strict=True)
    return [part.place(here, pin) for part, here, pin in pairs]


def found_places(loop: Loop, found: Any, scale: float) -> list[Any]:
    """Return the same of a solution, in the unit of the loop."""
    bodies = [k for k, body in enumerate(found.coordinates) if body.startswith("x_follower")]
    first = [sum(loop.has_body[:k]) + k + 1 for k in range(len(loop.stages))]
    places = []
    for column, number, pin in zip(bodies, first, loop.pins[1:], strict=True):
        r, p = found.q[:, column : column + 3], found.q[:, column + 3 : column + 7]
        turn = Rotation.from_quat(np.nan_to_num(p[:, [1, 2, 3, 0]], nan=0.5))
        places.append(r / scale + turn.apply(loop.frames[number].inv().apply(pin)))
    return places


def signs_of(loop: Loop, starts: list[Any]) -> tuple[int, ...] | None:
    """Return the way in which the stages are closed at the found start, None where it is none."""
    for signs in itertools.product((1, -1), repeat=len(loop.stages)):
        followers, margin = motion(loop, np.zeros(2), signs)
        here = places_of(loop, followers)
        if margin[0] >= 0 and all(
            np.abs(a[0] - b[0]).max() < 1e-6 for a, b in zip(here, starts, strict=True)
        ):
            return signs
    return None


def check(seed: int) -> tuple[int, int]:
    """Compile, verify and solve a loop; return how many points were good and how many missing."""
    random = np.random.default_rng(seed)
    loop, t = random_loop(random), TIMES[random.integers(0, len(TIMES))]
    scale, noise = float(10 ** random.uniform(-6, 6)), float(random.choice((0.0, 0.02, 0.1)))
    module = kc.compile(mechanism(loop, scale, noise, random))
    checks = kc.verify(module).checks
    assert {item.quantity for item in checks} >= set(DERIVED)
    # At a dead centre, nearly, x is uncertain in half of its digits, by whatever method, and some
    # equation shows it; Newton's method mends that of a position.
    wrong = [x for x in checks if not x.passed and (x.quantity != "solve" or x.error > 1e-6)]
    assert not wrong, f"seed {seed}"
    found = kc.solve(module, t)
    good = found.status == kc.Status.CONVERGED
    for values in (found.q, found.q_dot, found.q_ddot):
        assert np.isfinite(values[good]).all(), f"seed {seed}"
    if not good[0]:
        return 0, t.size
    places = found_places(loop, found, scale)
    signs = signs_of(loop, places)
    assert signs is not None, f"seed {seed}: the first position is none in which the rods close"
    followers, margin = motion(loop, t, signs)
    assert not good[margin <= 0].any(), f"seed {seed}: converged beyond a stretched rod"
    # A rod near its limit magnifies a rounding error by the root of what is left.
    allowed = 1e-7 / np.sqrt(np.maximum(margin, 1e-12))
    for here, known in zip(places, places_of(loop, followers), strict=True):
        error = np.abs(here - known).max(axis=1)
        assert (error[good] <= allowed[good]).all(), f"seed {seed}: off its branch"
    return int(good.sum()), int(np.sum((margin > 1e-2) & ~good))


def check_seeds(seeds: range, record: Any) -> None:
    gave_up, points, slowest = 0, 0, 0.0
    for seed in seeds:
        started = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kc.SingularConfigurationWarning)
            good, missing = check(seed)
        points, gave_up = points + good, gave_up + (missing > 0)
        slowest = max(slowest, time.process_time() - started)
    record(tried=len(seeds), wrong=0, gave_up=gave_up, slowest=slowest)
    assert points > 5 * len(seeds)
    assert gave_up <= 0.005 * len(seeds)


def test_a_few_random_loops_in_space(record: Any) -> None:
    check_seeds(range(4), record)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_many_random_loops_in_space(part: int, record: Any) -> None:
    first = 1000 + part * EACH
    check_seeds(range(first, first + EACH), record)


def test_that_the_closed_form_meets_the_equations() -> None:
    """The oracle against the module: two descriptions of one loop."""
    for seed in range(6):
        random = np.random.default_rng(seed)
        loop = random_loop(random)
        module = kc.compile(mechanism(loop, 1.0, 0.0, random))
        assert np.abs(module.Phi(module.GUESS, 0.0)).max() < 1e-13
        assert any(isinstance(part, Rocker) for part in (loop.crank, *loop.stages))
