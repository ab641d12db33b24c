"""One fresh process of `benchmarks.versus`: prints processor times by name, as JSON.

It imports whichever kincompile is first on the path, and of the benchmarks what other checkouts
have too.
"""

from __future__ import annotations

import json
import statistics
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc
from benchmarks import mechanisms
from benchmarks.linkages import LINKAGES, POINTS
from benchmarks.loops import Loops

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.linkages import Linkage

LOOPS = 10_000
BATCH = 100_000
VARIANTS = 20_000


def timed(call: Callable[[], object], calls: int, rounds: int = 5) -> float:
    """Return the median time of a call, after one that does not count."""
    call()
    samples = []
    for _ in range(rounds):
        start = process_time()
        for _ in range(calls):
            call()
        samples.append((process_time() - start) / calls)
    return statistics.median(samples)


def once(call: Callable[[], object]) -> float:
    """Return the time of a call that is the first of its kind."""
    start = process_time()
    call()
    return process_time() - start


def building() -> dict[str, float]:
    """Return the times of building; the first counts what is imported then."""
    return {
        "build, first": once(lambda: kc.compile(mechanisms.four_bar())),
        "build, another": timed(lambda: kc.compile(mechanisms.crank_rocker()), 3),
    }


def points(target: str) -> dict[str, float]:
    """Return the times of one point and of batches of the four-bar."""
    module = kc.compile(mechanisms.four_bar(), target=target)
    q, t, p = module.GUESS.copy(), 0.1, module.DEFAULTS
    many = np.tile(q, (BATCH, 1)) + 0.01
    some, last, times = many[:1000].copy(), np.ascontiguousarray(many.T), np.linspace(0, 1, BATCH)
    return {
        f"one point, {target}": timed(lambda: module.kinematics(q, q, t, p), 2000),
        f"one position, {target}": timed(lambda: module.position(q, t, p), 2000),
        f"batch of 1,000, {target}": timed(
            lambda: module.kinematics(some, some, times[:1000], p), 20
        ),
        f"batch last of 100,000, {target}": timed(
            lambda: module.kinematics_batch_last(last, last, times, p), 2
        ),
    }


def analysis(linkage: Linkage, target: str) -> float:
    """Return the time of a whole analysis of 10,000 points."""
    module, times = kc.compile(linkage.mechanism(), target=target), linkage.times(POINTS)
    return timed(lambda: kc.solve(module, times), 2)


def variants(target: str) -> float:
    """Return the time of many parameter sets of the four-bar."""
    module = kc.compile(mechanisms.four_bar(), target=target)
    spread = 1 + 0.01 * np.random.default_rng(1).random((VARIANTS, 1, module.DEFAULTS.size))
    sets, times = module.DEFAULTS * spread, np.linspace(0, 1, 20)
    return timed(lambda: kc.solve(module, times, sets), 1, 3)


def of_target(target: str, mark: str) -> dict[str, float]:
    """Return all times of a target that do not depend on the size of the mechanism."""
    found = points(target)
    for linkage in LINKAGES:
        found[f"{mark}analysis, {linkage.name}"] = analysis(linkage, target)
    return {**found, f"{mark}variants of the four-bar": variants(target)}


def large() -> dict[str, float]:
    """Return the times of ten thousand loops."""
    model = Loops.of(LOOPS, is_chain=False).mechanism()
    found = {"10,000 loops, build": once(lambda: kc.compile(model, form="grouped"))}
    module = kc.compile(model, form="grouped")
    q = np.array(module.GUESS)
    positions = [q, q + 0.01] * 100

    def all_four() -> object:
        q = positions.pop()
        return module.evaluate(q, 0.1), module.nu(q, 0.1), module.gamma(q, q, 0.1)

    found["10,000 loops, all four"] = timed(all_four, 3)
    found["10,000 loops, ten steps"] = timed(
        lambda: kc.solve(module, 0.01 * np.arange(11), throw=True), 1, 3
    )
    return found


if __name__ == "__main__":
    print(json.dumps(building() | of_target("numpy", "") | of_target("c", "C ") | large()))
