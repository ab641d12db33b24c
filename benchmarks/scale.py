"""Scale: N four-bar loops, each with its own lengths, geared crank to crank or driven in a chain.

`python -m benchmarks.scale [--plot FILE] [N ...]` prints tables, and takes minutes. Each
measurement is a fresh process (`scale_process`).
"""

from __future__ import annotations

import argparse
import importlib.util
import math
from typing import TYPE_CHECKING

from benchmarks import machine
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import Timing, printed_by_processes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    Measured = dict[tuple[str, str, int], tuple[Timing, ...]]

SIZES = (100, 1_000, 10_000)
CHAIN = 1_000
PROCESSES = 3
BUILD, MEMORY, FOUR, STEP = range(4)
UNITS = (1.0, 1e6, 1e-3, 1e-3)
HEADS = ("N", "contender", "model + compile, s", "peak MB", "all four, ms", "one step, ms")
NAMES = {
    "kincompile": "kincompile, NumPy",
    "casadi": "CasADi VM, fast_newton, sparse QR; gears as a ratio of angles",
    "casadi-rolling": "CasADi VM, fast_newton, sparse QR; gears by kc.Gear's equation",
    "superlu": "kincompile's values, SciPy's SuperLU",
    "hand": "MATLAB-style loop, dense np.linalg.solve",
}
LARGEST = {"hand": 100}
"""Loops up to which a contender can go: a dense Phi_q of 1,000 loops has 650 MB."""


def main(sizes: Sequence[int], plot: str | None) -> None:
    """Measure and print."""
    before = machine.load()
    gears = {(name, "gears", n) for name in NAMES for n in sizes if n <= LARGEST.get(name, n)}
    chain = {(name, "chain", CHAIN) for name in NAMES if name not in ("hand", "casadi-rolling")}
    found = measure(sorted((key for key in gears | chain if is_there(key[0])), key=str))
    print_table("N geared four-bar loops", HEADS, rows(found, "gears"))
    print_table("A chain: each crank driven by the rocker before it", HEADS, rows(found, "chain"))
    if len(sizes) > 1:
        heads = ("contender", "from N to N", *HEADS[2:])
        print_table("Exponents of growth", heads, growth(found, min(sizes), max(sizes)))
    print_targets("Scale: what was to be reached", reached(found, sizes))
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")
    if plot:
        draw(found, sizes, plot)


def is_there(name: str) -> bool:
    """Return whether a contender's package is installed; say so if not."""
    if name.startswith("casadi") and importlib.util.find_spec("casadi") is None:
        print(f"{NAMES[name]}: skipped, casadi is not installed\n")
        return False
    return True


def measure(keys: Sequence[tuple[str, str, int]]) -> Measured:
    """Run the processes, in turn."""
    commands = {
        " ".join(map(str, key)): ("-m", "benchmarks.scale_process", *map(str, key)) for key in keys
    }
    printed = printed_by_processes(commands, rounds=PROCESSES)
    return {key: printed[" ".join(map(str, key))] for key in keys}


def rows(found: Measured, kind: str) -> Iterator[list[str]]:
    """Give a row per size and contender."""
    for (name, its_kind, n), values in sorted(found.items(), key=lambda item: item[0][2]):
        if its_kind == kind:
            cells = (f"{x.median / unit:.3g}" for x, unit in zip(values, UNITS, strict=True))
            yield [f"{n:,}", NAMES[name], *cells]


def growth(found: Measured, small: int, large: int) -> Iterator[list[str]]:
    """Give the exponents e of cost ~ N^e from the smallest size to the largest."""
    for name in NAMES:
        ends = found.get((name, "gears", small)), found.get((name, "gears", large))
        if ends[0] and ends[1]:
            yield [
                NAMES[name],
                f"{small:,} to {large:,}",
                *(f"{exponent(found, name, small, large, what):.2f}" for what in range(4)),
            ]


def exponent(found: Measured, name: str, small: int, large: int, what: int) -> float:
    """Return the exponent of growth of one quantity."""
    few, many = (found[name, "gears", n][what].median for n in (small, large))
    return math.log(many / few) / math.log(large / small)


def reached(found: Measured, sizes: Sequence[int]) -> Iterator[Target]:
    """Compare with what was to be reached; that is stated for 10,000 loops."""
    ours = found.get(("kincompile", "gears", SIZES[-1]))
    if ours:
        limits = ((BUILD, 4, "s"), (MEMORY, 500, "MB"), (FOUR, 5, "ms"), (STEP, 40, "ms"))
        for what, limit, unit in limits:
            measured = ours[what].median / UNITS[what]
            yield Target(f"N = 10,000: {HEADS[what + 2]}", measured, "at most", limit, unit)
    if len(sizes) > 1:
        for what in (BUILD, FOUR, STEP):
            measured = exponent(found, "kincompile", min(sizes), max(sizes), what)
            yield Target(f"exponent of growth: {HEADS[what + 2]}", measured, "at most", 1.15)
    yield from beside_casadi(found, max(sizes))
    chain = found["kincompile", "chain", CHAIN][STEP].median / UNITS[STEP]
    yield Target("chain, N = 1,000: one step, ms", chain, "at most", 60, "ms")


def beside_casadi(found: Measured, n: int) -> Iterator[Target]:
    """Compare with CasADi in the same run: what was to be reached lies below its numbers."""
    for name in ("casadi", "casadi-rolling"):
        theirs = found.get((name, "gears", n))
        if theirs is None:
            continue
        for what in (BUILD, FOUR, STEP):
            ratio = found["kincompile", "gears", n][what].median / theirs[what].median
            title = f"N = {n:,}: {HEADS[what + 2].partition(',')[0]}, x {NAMES[name]}"
            yield Target(title, ratio, "at most", 1)


def draw(
    found: Mapping[tuple[str, str, int], tuple[Timing, ...]], sizes: Sequence[int], file: str
) -> None:
    """Draw cost against N."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.4), layout="constrained")
    axes = figure.subplots(1, 3)
    for axis, what in zip(axes, (BUILD, FOUR, STEP), strict=True):
        for name, label in NAMES.items():
            points = [(n, found[name, "gears", n]) for n in sizes if (name, "gears", n) in found]
            heights = [values[what].median / UNITS[what] for _, values in points]
            axis.loglog([n for n, _ in points], heights, "o-", label=label)
        axis.set(xlabel="four-bar loops N", title=HEADS[what + 2])
        axis.grid(alpha=0.3)
    lines = axes[0].get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower center", ncols=2, fontsize="small")
    figure.savefig(file)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scale")
    parser.add_argument("sizes", nargs="*", type=int, default=SIZES)
    parser.add_argument("--plot", metavar="FILE")
    arguments = parser.parse_args()
    main(arguments.sizes, arguments.plot)
