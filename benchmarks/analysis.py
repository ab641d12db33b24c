"""Whole analyses: one revolution, position by Newton to 1e-10, velocity and acceleration.

`python -m benchmarks.analysis [points]` prints a table per mechanism, and takes some minutes with
10,000 points. Compilation, by whomever, is not counted, and neither is the first call.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc
from benchmarks import machine
from benchmarks.linkages import LINKAGES, POINTS, Linkage
from benchmarks.peers import casadi_peer, hand_loop, jax_peer, numba_peer, plain_c, pylinkage_peer
from benchmarks.peers.common import Analysis, Motion, Skipped, Vector
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator
    from types import ModuleType

    from benchmarks.timing import Timing

    Builders = dict[str, Callable[[Linkage], Analysis]]

NUMPY, C = "kincompile, NumPy", "kincompile, C"
PLAIN = "plain C: SymPy cse, dense LU, gcc -O3"
PREDICTED = "plain C, started from a prediction"
LOOP = "MATLAB-style loop, np.linalg.solve"
LAMBDIFY, CSE = "SymPy lambdify, np.linalg.solve", "SymPy lambdify with cse, np.linalg.solve"
GENERATED = "CasADi fast_newton in mapaccum, generated C"
SLOW_ROUNDS, ROUNDS = 3, 25
SLOW = frozenset({LOOP, LAMBDIFY, CSE, "CasADi rootfinder, one call a step"})
AGREEMENT = 1e-8


def main(points: int) -> None:
    """Measure and print."""
    before, targets = machine.load(), []
    for linkage in LINKAGES:
        analyses, skipped = build(linkage, points, builders())
        times = measure(analyses, linkage.times(points))
        print_table(
            f"{linkage.name}, {points} points, {len(linkage.guess)} coordinates",
            ("contender", "ms, median (least)", "x plain C"),
            rows(times, skipped),
        )
        targets += list(reached(linkage, times))
    print_targets("Whole analyses: what was to be reached, ratios of medians", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def builders() -> Builders:
    """Return how each contender is built."""
    return {
        NUMPY: lambda linkage: kincompile(linkage, "numpy"),
        C: lambda linkage: kincompile(linkage, "c"),
        PLAIN: lambda linkage: plain_c.PlainC(linkage).analysis(is_predicted=False),
        PREDICTED: lambda linkage: plain_c.PlainC(linkage).analysis(is_predicted=True),
        **pylinkage_peer.CONTENDERS,
        **casadi_peer.CONTENDERS,
        **numba_peer.CONTENDERS,
        **jax_peer.CONTENDERS,
        LOOP: hand_loop.by_hand,
        LAMBDIFY: lambda linkage: hand_loop.by_sympy(linkage, cse=False),
        CSE: lambda linkage: hand_loop.by_sympy(linkage, cse=True),
    }


def kincompile(linkage: Linkage, target: str) -> Analysis:
    """Return the analysis by kincompile."""
    module = module_of(linkage, target)

    def analyse(times: Vector) -> Motion:
        solution = kc.solve(module, times, throw=True)
        return solution.q, solution.q_dot, solution.q_ddot

    return analyse


def module_of(linkage: Linkage, target: str) -> ModuleType:
    """Return the compiled module."""
    try:
        module: ModuleType = kc.compile(linkage.mechanism(), target=target)
    except kc.UnsupportedError as error:
        raise Skipped(str(error)) from None
    return module


def build(
    linkage: Linkage, points: int, contenders: Builders
) -> tuple[dict[str, Analysis], dict[str, str]]:
    """Build all contenders, run each once, and require that their motions agree."""
    analyses: dict[str, Analysis] = {}
    skipped: dict[str, str] = {}
    times, wanted = linkage.times(points), None
    for name, builder in contenders.items():
        try:
            analysis = builder(linkage)
            motion = analysis(times)
        except Skipped as reason:
            skipped[name] = str(reason)
            continue
        analyses[name] = analysis
        if name not in pylinkage_peer.CONTENDERS:
            wanted = wanted or motion
            _require_equal(name, motion, wanted)
    return analyses, skipped


def _require_equal(name: str, found: Motion, wanted: Motion) -> None:
    for one, other in zip(found, wanted, strict=True):
        size = float(np.max(np.abs(other)))
        np.testing.assert_allclose(one, other, rtol=0, atol=AGREEMENT * size, err_msg=name)


def measure(
    analyses: dict[str, Analysis],
    t: Vector,
    slow: Collection[str] = SLOW,
    rounds: int = ROUNDS,
) -> dict[str, Timing]:
    """Time the contenders in turn, the slow ones in fewer rounds."""

    def calls(*, is_slow: bool) -> dict[str, Callable[[], object]]:
        return {
            name: partial(analysis, t)
            for name, analysis in analyses.items()
            if (name in slow) == is_slow
        }

    fast = in_turn(calls(is_slow=False), calls=1, rounds=rounds)
    last = in_turn(calls(is_slow=True), calls=1, rounds=SLOW_ROUNDS)
    return fast | last


def rows(times: dict[str, Timing], skipped: dict[str, str]) -> Iterator[list[str]]:
    """Give a row per contender, the fastest first; those that could not run with the reason."""
    plain = times.get(PLAIN)
    for name, timing in sorted(times.items(), key=lambda item: item[1].median):
        shown = f"**{name}**" if name.startswith("kincompile") else name
        ratio = f"{timing.median / plain.median:.3g}" if plain else ""
        yield [shown, f"{timing.median * 1e3:.3g} ({timing.least * 1e3:.3g})", ratio]
    for name, reason in skipped.items():
        yield [name, f"skipped: {reason}", ""]


def reached(linkage: Linkage, times: dict[str, Timing]) -> Iterator[Target]:
    """Compare with what was to be reached."""
    is_first = linkage is LINKAGES[0]
    limits = {
        (NUMPY, PLAIN): ("at most", 0.6 if is_first else 0.8),
        (C, PLAIN): ("at most", 0.12 if is_first else 0.2),
    }
    if is_first:
        limits |= {(GENERATED, NUMPY): ("at least", 6.0), (LOOP, NUMPY): ("at least", 300.0)}
    for (one, other), (kind, limit) in limits.items():
        if one in times and other in times:
            ratio = times[one].median / times[other].median
            yield Target(f"{linkage.name}: {one} / {other}", ratio, kind, limit)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else POINTS)
