"""Parameter variants: the four-bar with 100,000 sets of lengths at 100 times each, in chunks.

`python -m benchmarks.variants [variants]` prints a table. Each contender streams: it solves a
chunk, hands the motion on, and forgets it; memory does not depend on the number of variants.
"""

from __future__ import annotations

import json
import math
import resource
import sys
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc
from benchmarks import machine
from benchmarks.linkages import FOUR_BAR
from benchmarks.peers import dyads, plain_c
from benchmarks.peers.common import Motion, Skipped, Vector
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import Timing, in_turn, printed_by_processes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import ModuleType

    Solve = Callable[[Vector, Vector], Motion]

VARIANTS, TIMES, CHUNK = 100_000, 100, 2_000
SPREAD = 0.02
"""Relative spread of the lengths: all variants can be assembled and turn."""

STOPPED, ANGLES = 2000, 200
"""Sets of each kind that are compared with those that move, and at how many times."""

ROCKER = 22.0, 14.0, 14.0, 20.0
"""Lengths of a four-bar whose crank cannot turn."""

PROCESSES, STOPS = 3, 7
AGREEMENT = 1e-8
NUMPY, C, PLAIN = "kincompile, NumPy", "kincompile, C", "plain C, started from a prediction"


def main(variants: int) -> None:
    """Measure in fresh processes and print."""
    before = machine.load()
    print(check_all())
    found, skipped = measure(variants)
    heads = (
        "contender",
        "us a point, median (least)",
        "x plain C",
        "memory above the first chunk, MB",
    )
    points = f"{variants:,} variants x {TIMES} times"
    print_table(f"Four-bar, {points}", heads, rows(found, skipped))
    print_targets(
        "Variants: what was to be reached", [*reached(found), *stopped(), *beside_dyads()]
    )
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def check_all() -> str:
    """Require that all contenders give the same motion, and say who takes part."""
    t, p = FOUR_BAR.times(TIMES), next(chunks(64))
    wanted, names = kincompile("numpy")(t, p), []
    for name, build in CONTENDERS.items():
        try:
            found = build()(t, p)
        except Skipped:
            continue
        names.append(name)
        for one, other in zip(found, wanted, strict=True):
            size = float(np.max(np.abs(other)))
            np.testing.assert_allclose(one, other, rtol=0, atol=AGREEMENT * size, err_msg=name)
    return f"The same motion to {AGREEMENT:g}: {', '.join(names)}.\n"


def measure(variants: int) -> tuple[dict[str, tuple[Timing, ...]], dict[str, str]]:
    """Time each contender in processes of its own, in turn."""
    skipped, commands = {}, {}
    for name, build in CONTENDERS.items():
        try:
            build()
        except Skipped as reason:
            skipped[name] = str(reason)
        else:
            commands[name] = ("-m", "benchmarks.variants", str(variants), name)
    return printed_by_processes(commands, rounds=PROCESSES), skipped


def one_process(variants: int, name: str) -> None:
    """Stream all variants and print seconds a point, and how memory grew after the first chunk."""
    t, solve = FOUR_BAR.times(TIMES), CONTENDERS[name]()
    solve(t, next(chunks(CHUNK)))
    memory, total, start = _peak(), 0.0, process_time()
    for p in chunks(variants):
        total += float(solve(t, p)[2][-1, -1, -1])
    seconds = process_time() - start
    if not np.isfinite(total):
        raise ArithmeticError(f"{name}: some motion is not finite")
    print(json.dumps([seconds / (variants * TIMES), _peak() - memory]))


def chunks(variants: int) -> Iterator[Vector]:
    """Give parameter sets (B, k), chunk by chunk; the speed is the same for all."""
    rng = np.random.default_rng(4)
    for first in range(0, variants, CHUNK):
        count = min(CHUNK, variants - first)
        factors = 1 + SPREAD * rng.uniform(-1, 1, (count, FOUR_BAR.values.size))
        factors[:, -1] = 1
        yield factors * FOUR_BAR.values


def kincompile(target: str) -> Solve:
    """Return how kincompile solves a chunk: all variants in one call."""
    try:
        module = kc.compile(FOUR_BAR.mechanism(), target=target)
    except kc.UnsupportedError as error:
        raise Skipped(str(error)) from None

    def solve(t: Vector, p: Vector) -> Motion:
        solution = kc.solve(module, t, p[:, np.newaxis], throw=True)
        return solution.q, solution.q_dot, solution.q_ddot

    return solve


def plain() -> Solve:
    """Return how the plain program solves a chunk: one variant after the other."""
    return plain_c.PlainC(FOUR_BAR).variants


CONTENDERS: dict[str, Callable[[], Solve]] = {
    NUMPY: lambda: kincompile("numpy"),
    C: lambda: kincompile("c"),
    PLAIN: plain,
}


def rows(found: dict[str, tuple[Timing, ...]], skipped: dict[str, str]) -> Iterator[list[str]]:
    """Give a row per contender."""
    plain = found.get(PLAIN)
    for name, (time, memory) in sorted(found.items(), key=lambda item: item[1][0].median):
        ratio = f"{time.median / plain[0].median:.3g}" if plain else ""
        cell = f"{time.median * 1e6:.3g} ({time.least * 1e6:.3g})"
        yield [name, cell, ratio, f"{memory.median / 1e3:.3g}"]
    for name, reason in skipped.items():
        yield [name, f"skipped: {reason}", "", ""]


def reached(found: dict[str, tuple[Timing, ...]]) -> Iterator[Target]:
    """Compare with what was to be reached."""
    for name, limit in ((NUMPY, 1.2), (C, 0.2)):
        if name in found:
            yield Target(f"{name}, us a point", found[name][0].median * 1e6, "at most", limit, "us")


def stopped() -> Iterator[Target]:
    """Compare sets that lock up, or cannot be assembled, with sets that move."""
    for target in ("numpy", "c"):
        module = kc.compile(FOUR_BAR.mechanism(), target)
        for what, t, moving, sets in kinds():
            runs = [(_timed(module, t, moving), _timed(module, t, sets)) for _ in range(STOPS)]
            least, most = (min(run[k][0] for run in runs) / STOPPED for k in range(2))
            part = runs[0][1][1]
            ratio = (most - (1 - part) * least) / part / least
            yield Target(f"{target}: a set that {what} / one that moves", ratio, "at most", 5, "x")


def kinds() -> Iterator[tuple[str, Vector, Vector, Vector]]:
    """Give what stops sets, times, sets that move and sets of which some or all are stopped."""
    t, moving = FOUR_BAR.times(ANGLES), next(chunks(STOPPED))
    every, other, nearly_all = slice(None), slice(1, None, 2), np.arange(STOPPED) % 20 > 0
    for what, place, factor, some in (
        ("locks up", 3, 2.5, every),
        ("cannot be assembled", 0, 2.0, every),
        ("cannot be assembled, beside as many that move", 0, 2.0, other),
        ("cannot be assembled, 19 beside one that moves", 0, 2.0, nearly_all),
        ("locks up, beside as many that move", 3, 2.5, other),
        ("locks up, 19 beside one that moves", 3, 2.5, nearly_all),
        ("locks up beyond a gap, beside as many that move", 0, 3.0, other),
    ):
        p = moving.copy()
        p[some, place] *= factor
        yield what, t, moving, p
    angles = 0.3 + np.linspace((0, 0), (0.2, math.tau), STOPPED)  # of the crank, at t = 1
    few, turn = (np.array([(*ROCKER, angle) for angle in column]) for column in angles.T)
    yield "is out of reach, over all angles of a crank", np.linspace(1, 1.02, ANGLES), few, turn


def beside_dyads() -> Iterator[Target]:
    """Compare q, q_dot and q_ddot in C with positions of the joints by dyads in NumPy."""
    t, p = FOUR_BAR.times(ANGLES), next(chunks(STOPPED))
    a, b, c, d, omega = p.T
    zero = np.zeros_like(a)
    places = [np.stack(pair, axis=1) for pair in ((zero, zero), (a, zero), (d, zero))]
    places.append(dyads.meeting(places[1], places[2], b, c))
    start, solve = np.stack(places, axis=1), kincompile("c")
    q, end = solve(t, p)[0], dyads.joints(start, [(3, 1, 2)], omega[0] * t)[:, 3]
    angle = q[..., 5]
    middle = end - 0.5 * b[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    np.testing.assert_allclose(q[..., 3:5], middle, rtol=0, atol=1e-12 * float(np.abs(q).max()))
    del q
    calls: dict[str, Callable[[], object]] = {
        C: lambda: solve(t, p),
        dyads.NAME: lambda: dyads.joints(start, [(3, 1, 2)], omega[0] * t),
    }
    found = in_turn(calls, calls=1, rounds=15)
    ratio = found[C].least / found[dyads.NAME].least
    # A quarter of what LInK's own lines take, of whose time these take 0.31.
    yield Target(f"{C}, with rates / {dyads.NAME}", ratio, "at most", 0.8, "x")


def _timed(module: ModuleType, t: Vector, p: Vector) -> tuple[float, float]:
    """Return processor time [s], and which part of the sets stops."""
    start = process_time()
    solution = kc.solve(module, t, p[:, np.newaxis])
    return process_time() - start, float((~solution.good).any(axis=1).mean())


def _peak() -> float:
    """Return the process's peak memory [kB]."""
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else VARIANTS
    if len(sys.argv) > 2:  # the name of a contender: the process of one measurement
        one_process(count, sys.argv[2])
    else:
        main(count)
